//! Logs made for tests, by the `mcap` crate and an encoder of its own for CDR and ROS 1: nothing of
//! what is tested makes its input.
#![allow(clippy::unwrap_used)]

use std::{
    collections::BTreeMap,
    fs,
    io::Cursor,
    path::{Path, PathBuf},
};

use mcap::{
    Compression, WriteOptions, Writer,
    records::{MessageHeader, Metadata},
};

use crate::definitions::{definition, idl_definition, ros1_definition, schema_name};

/// Bytes of one message in plain CDR: numbers aligned to their size, behind a 4-byte head; or in
/// ROS 1's serialisation, which is that without head, padding and zero bytes behind strings.
pub(crate) struct Cdr {
    bytes: Vec<u8>,
    is_big_endian: bool,
    /// 8 in encoding version 1, 4 in version 2, 1 in ROS 1.
    most_alignment: usize,
    is_ros1: bool,
}

impl Cdr {
    pub(crate) fn new(is_big_endian: bool) -> Cdr {
        let head = vec![0, u8::from(!is_big_endian), 0, 0];
        Cdr { bytes: head, is_big_endian, most_alignment: 8, is_ros1: false }
    }

    pub(crate) fn version_2(is_big_endian: bool) -> Cdr {
        let head = vec![0, 6 + u8::from(!is_big_endian), 0, 0];
        Cdr { bytes: head, is_big_endian, most_alignment: 4, is_ros1: false }
    }

    pub(crate) fn ros1() -> Cdr {
        Cdr { bytes: Vec::new(), is_big_endian: false, most_alignment: 1, is_ros1: true }
    }

    /// A number by its little-endian bytes.
    pub(crate) fn number<const N: usize>(&mut self, mut little: [u8; N]) -> &mut Cdr {
        let alignment = N.min(self.most_alignment);
        // The head's 4 bytes count only where there is alignment beyond them.
        while alignment > 1 && !(self.bytes.len() - 4).is_multiple_of(alignment) {
            self.bytes.push(0);
        }
        if self.is_big_endian {
            little.reverse();
        }
        self.bytes.extend_from_slice(&little);
        self
    }

    pub(crate) fn u8(&mut self, value: u8) -> &mut Cdr {
        self.number([value])
    }

    pub(crate) fn u32(&mut self, value: u32) -> &mut Cdr {
        self.number(value.to_le_bytes())
    }

    pub(crate) fn i32(&mut self, value: i32) -> &mut Cdr {
        self.number(value.to_le_bytes())
    }

    pub(crate) fn f32(&mut self, value: f32) -> &mut Cdr {
        self.number(value.to_le_bytes())
    }

    pub(crate) fn f64(&mut self, value: f64) -> &mut Cdr {
        self.number(value.to_le_bytes())
    }

    pub(crate) fn f64s(&mut self, values: &[f64]) -> &mut Cdr {
        values.iter().for_each(|value| {
            self.f64(*value);
        });
        self
    }

    pub(crate) fn text(&mut self, text: &str) -> &mut Cdr {
        let end: &[u8] = if self.is_ros1 { &[] } else { &[0] };
        self.u32((text.len() + end.len()) as u32);
        self.bytes.extend_from_slice(text.as_bytes());
        self.bytes.extend_from_slice(end);
        self
    }

    /// A sequence of bytes with its length.
    pub(crate) fn bytes(&mut self, bytes: &[u8]) -> &mut Cdr {
        self.u32(bytes.len() as u32);
        self.bytes.extend_from_slice(bytes);
        self
    }

    /// `std_msgs/Header`.
    pub(crate) fn header(&mut self, stamp_ns: i64, frame_id: &str) -> &mut Cdr {
        let (sec, nanosec) =
            (stamp_ns.div_euclid(1_000_000_000), stamp_ns.rem_euclid(1_000_000_000));
        if self.is_ros1 {
            // Its sequence number, which no one should need.
            self.u32(7);
        }
        self.i32(sec as i32).u32(nanosec as u32).text(frame_id)
    }

    pub(crate) fn finish(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.bytes)
    }
}

/// One message of a log, not yet written.
#[derive(Clone, Debug)]
pub(crate) struct Recorded {
    pub(crate) topic: &'static str,
    /// `pkg/Type`.
    pub(crate) type_name: &'static str,
    pub(crate) log_time_ns: i64,
    pub(crate) data: Vec<u8>,
}

/// What definitions and messages are written in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Format {
    Ros2Msg,
    Ros2Idl,
    Ros1,
}

/// How a file is laid out.
#[derive(Clone, Debug)]
pub(crate) struct Layout {
    pub(crate) format: Format,
    pub(crate) compression: Option<Compression>,
    pub(crate) is_chunked: bool,
    pub(crate) chunk_bytes: u64,
    /// Chunk indexes and the rest of the summary at the end.
    pub(crate) has_summary: bool,
    pub(crate) conditions: BTreeMap<String, String>,
}

impl Default for Layout {
    fn default() -> Self {
        Layout {
            format: Format::Ros2Msg,
            compression: None,
            is_chunked: true,
            chunk_bytes: 16 << 10,
            has_summary: true,
            conditions: BTreeMap::new(),
        }
    }
}

/// An MCAP file of some messages, in their order.
pub(crate) fn mcap_bytes(messages: &[Recorded], layout: &Layout) -> Vec<u8> {
    let options = WriteOptions::new()
        .compression(layout.compression)
        .use_chunks(layout.is_chunked)
        .chunk_size(Some(layout.chunk_bytes))
        .emit_summary_records(layout.has_summary)
        .emit_summary_offsets(layout.has_summary)
        .library("fixture");
    let mut writer = Writer::with_options(Cursor::new(Vec::new()), options).unwrap();
    let mut channels: BTreeMap<&str, u16> = BTreeMap::new();
    if !layout.conditions.is_empty() {
        let (name, metadata) = ("pmp.conditions".to_string(), layout.conditions.clone());
        writer.write_metadata(&Metadata { name, metadata }).unwrap();
    }
    for (sequence, message) in messages.iter().enumerate() {
        let channel_id = *channels.entry(message.topic).or_insert_with(|| {
            let ros2 = schema_name(message.type_name);
            let (name, encoding, text, messages) = match layout.format {
                Format::Ros2Msg => (ros2, "ros2msg", definition(message.type_name), "cdr"),
                Format::Ros2Idl => (ros2, "ros2idl", idl_definition(message.type_name), "cdr"),
                Format::Ros1 => {
                    let name = message.type_name.to_string();
                    (name, "ros1msg", ros1_definition(message.type_name), "ros1")
                }
            };
            let schema = writer.add_schema(&name, encoding, text.as_bytes()).unwrap();
            writer.add_channel(schema, message.topic, messages, &BTreeMap::new()).unwrap()
        });
        let header = MessageHeader {
            channel_id,
            sequence: sequence as u32,
            log_time: message.log_time_ns as u64,
            publish_time: message.log_time_ns as u64,
        };
        writer.write_to_known_channel(&header, &message.data).unwrap();
    }
    writer.finish().unwrap();
    writer.into_inner().into_inner()
}

/// Nanoseconds of a number of seconds.
pub(crate) fn ns(seconds: f64) -> i64 {
    (seconds * 1e9).round() as i64
}

/// A drive on a circle to the left (or straight on) at a constant speed: camera and lidar at
/// 10 Hz, odometry at 50 Hz, controls at 20 Hz, radar at 10 Hz.
#[derive(Clone, Debug)]
pub(crate) struct DriveLog {
    pub(crate) start_ns: i64,
    pub(crate) seconds: f64,
    pub(crate) speed_mps: f64,
    /// Positive = left.
    pub(crate) yaw_rate_radps: f64,
    pub(crate) is_big_endian: bool,
    /// Without them the header stamps are zero, and only the log times tell.
    pub(crate) has_header_stamps: bool,
    pub(crate) has_lidar: bool,
    pub(crate) has_radar: bool,
    pub(crate) has_control: bool,
    /// Without it nothing says where the lidar and the radar sit.
    pub(crate) has_transforms: bool,
    /// From, to: seconds after the start.
    pub(crate) camera_gap_s: Option<(f64, f64)>,
    pub(crate) ego_gap_s: Option<(f64, f64)>,
    /// Pictures that are no JPEG, by index.
    pub(crate) bad_pictures: Vec<usize>,
    /// Zeros behind every picture's end: bytes to carry that cost no decoding.
    pub(crate) picture_padding: usize,
    /// Swap neighbours of each topic, so that every second message comes late.
    pub(crate) is_out_of_order: bool,
    pub(crate) layout: Layout,
}

impl Default for DriveLog {
    fn default() -> Self {
        DriveLog {
            start_ns: 1_700_000_000_000_000_000,
            seconds: 5.0,
            speed_mps: 5.0,
            yaw_rate_radps: 0.1,
            is_big_endian: false,
            has_header_stamps: true,
            has_lidar: true,
            has_radar: true,
            has_control: true,
            has_transforms: true,
            camera_gap_s: None,
            ego_gap_s: None,
            bad_pictures: Vec::new(),
            picture_padding: 0,
            is_out_of_order: false,
            layout: Layout::default(),
        }
    }
}

/// Pictures of the fixture: small, so that they cost nothing.
pub(crate) const CAMERA_WIDTH: usize = 60;
pub(crate) const CAMERA_HEIGHT: usize = 25;

/// Focal length of the fixture's camera, pixels.
pub(crate) const CAMERA_FOCAL: f64 = 30.0;

/// The camera sits this far ahead of the ego origin, and this high.
pub(crate) const CAMERA_AHEAD_M: f64 = 1.5;
pub(crate) const CAMERA_UP_M: f64 = 1.25;

/// Points of every cloud, in the ego frame (the lidar sits at the ego origin).
pub(crate) const LIDAR_POINTS: [[f32; 3]; 4] =
    [[21.5, 0.01, 1.24], [11.5, 2.01, 1.24], [11.5, 2.01, 1.19], [-5.0, 0.0, 1.0]];

/// Range, azimuth, elevation and speed of the one return of every radar scan (the radar sits at
/// the camera).
pub(crate) const RADAR_RETURN: [f32; 4] = [20.0, -0.25, 0.01, -3.5];

impl DriveLog {
    /// x, y and heading at a time after the start, from the closed form.
    pub(crate) fn pose(&self, seconds: f64) -> [f64; 3] {
        let (v, w) = (self.speed_mps, self.yaw_rate_radps);
        match w == 0.0 {
            true => [v * seconds, 0.0, 0.0],
            false => {
                let (sin, cos) = (w * seconds).sin_cos();
                [v / w * sin, v / w * (1.0 - cos), w * seconds]
            }
        }
    }

    /// All messages in the order of their log times.
    pub(crate) fn messages(&self) -> Vec<Recorded> {
        let mut messages = Vec::new();
        if self.has_transforms {
            messages.push(self.transforms());
        }
        let in_gap = |gap: Option<(f64, f64)>, t: f64| {
            gap.is_some_and(|(from, to)| t > from - 1e-6 && t < to - 1e-6)
        };
        let ticks = |rate_hz: f64| {
            let count = (self.seconds * rate_hz).round() as usize;
            (0..=count).map(move |i| (i, i as f64 / rate_hz))
        };
        for (_, t) in ticks(50.0).filter(|(_, t)| !in_gap(self.ego_gap_s, *t)) {
            messages.push(self.odometry(t));
        }
        for (i, t) in ticks(10.0).filter(|(_, t)| !in_gap(self.camera_gap_s, *t)) {
            messages.push(self.picture(i, t));
            messages.push(self.camera_info(t));
        }
        for (_, t) in ticks(10.0) {
            if self.has_lidar {
                messages.push(self.cloud(t));
            }
            if self.has_radar {
                messages.push(self.scan(t));
            }
        }
        for (_, t) in ticks(20.0).filter(|_| self.has_control) {
            messages.push(self.control(t));
        }
        messages.sort_by_key(|message| message.log_time_ns);
        if self.is_out_of_order {
            messages.sort_by_key(|message| message.topic);
            messages.chunks_exact_mut(2).for_each(|pair| pair.reverse());
        }
        messages
    }

    pub(crate) fn bytes(&self) -> Vec<u8> {
        mcap_bytes(&self.messages(), &self.layout)
    }

    /// Write the log into a folder.
    pub(crate) fn write(&self, folder: &Path, name: &str) -> PathBuf {
        let path = folder.join(name);
        fs::write(&path, self.bytes()).unwrap();
        path
    }

    fn empty(&self) -> Cdr {
        match self.layout.format {
            Format::Ros1 => Cdr::ros1(),
            Format::Ros2Msg | Format::Ros2Idl => Cdr::new(self.is_big_endian),
        }
    }

    fn cdr(&self, t: f64, frame_id: &str) -> Cdr {
        let mut cdr = self.empty();
        let stamp_ns = if self.has_header_stamps { self.start_ns + ns(t) } else { 0 };
        cdr.header(stamp_ns, frame_id);
        cdr
    }

    fn message(
        &self,
        topic: &'static str,
        type_name: &'static str,
        t: f64,
        cdr: &mut Cdr,
    ) -> Recorded {
        let log_time_ns = self.start_ns + ns(t);
        Recorded { topic, type_name, log_time_ns, data: cdr.finish() }
    }

    fn odometry(&self, t: f64) -> Recorded {
        let [x, y, yaw] = self.pose(t);
        let mut cdr = self.cdr(t, "odom");
        cdr.text("base_link").f64s(&[x, y, 0.0]);
        cdr.f64s(&[0.0, 0.0, (yaw / 2.0).sin(), (yaw / 2.0).cos()]).f64s(&[0.0; 36]);
        cdr.f64s(&[self.speed_mps, 0.0, 0.0, 0.0, 0.0, self.yaw_rate_radps]).f64s(&[0.0; 36]);
        self.message("/odom", "nav_msgs/Odometry", t, &mut cdr)
    }

    fn picture(&self, index: usize, t: f64) -> Recorded {
        let mut cdr = self.cdr(t, "camera");
        let mut data = if self.bad_pictures.contains(&index) {
            b"no picture".to_vec()
        } else {
            jpeg(CAMERA_WIDTH, CAMERA_HEIGHT, (index * 3 % 256) as u8)
        };
        data.resize(data.len() + self.picture_padding, 0);
        cdr.text("jpeg").bytes(&data);
        self.message("/camera/front/image/compressed", "sensor_msgs/CompressedImage", t, &mut cdr)
    }

    fn camera_info(&self, t: f64) -> Recorded {
        let (f, cx, cy) = (CAMERA_FOCAL, CAMERA_WIDTH as f64 / 2.0, CAMERA_HEIGHT as f64 / 2.0);
        let mut cdr = self.cdr(t, "camera");
        cdr.u32(CAMERA_HEIGHT as u32).u32(CAMERA_WIDTH as u32).text("plumb_bob");
        cdr.u32(5).f64s(&[0.0; 5]);
        cdr.f64s(&[f, 0.0, cx, 0.0, f, cy, 0.0, 0.0, 1.0]);
        cdr.f64s(&[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]);
        cdr.f64s(&[f, 0.0, cx, 0.0, 0.0, f, cy, 0.0, 0.0, 0.0, 1.0, 0.0]);
        cdr.u32(0).u32(0).u32(0).u32(0).u32(0).u32(0).u8(0);
        self.message("/camera/front/camera_info", "sensor_msgs/CameraInfo", t, &mut cdr)
    }

    fn cloud(&self, t: f64) -> Recorded {
        let mut cdr = self.cdr(t, "lidar");
        cdr.u32(1).u32(LIDAR_POINTS.len() as u32).u32(3);
        for (i, name) in ["x", "y", "z"].into_iter().enumerate() {
            cdr.text(name).u32(4 * i as u32).u8(7).u32(1);
        }
        let points = LIDAR_POINTS.as_flattened();
        let data: Vec<u8> = points
            .iter()
            .flat_map(|number| match self.is_big_endian {
                true => number.to_be_bytes(),
                false => number.to_le_bytes(),
            })
            .collect();
        cdr.u8(u8::from(self.is_big_endian)).u32(12).u32(data.len() as u32).bytes(&data).u8(1);
        self.message("/lidar", "sensor_msgs/PointCloud2", t, &mut cdr)
    }

    fn scan(&self, t: f64) -> Recorded {
        let mut cdr = self.cdr(t, "radar");
        cdr.u32(1);
        for number in RADAR_RETURN {
            cdr.f32(number);
        }
        cdr.f32(1.0);
        self.message("/radar/front", "radar_msgs/RadarScan", t, &mut cdr)
    }

    fn control(&self, t: f64) -> Recorded {
        let mut cdr = self.cdr(t, "");
        cdr.f32(0.25).f32(-0.5).f32(0.125).u8(0).u8(0).i32(1).u8(0);
        self.message("/control", "carla_msgs/CarlaEgoVehicleControl", t, &mut cdr)
    }

    /// `base_link` to the camera (optical), the lidar and the radar.
    fn transforms(&self) -> Recorded {
        // The optical axes are x right, y down, z forward.
        let optical = [-0.5, 0.5, -0.5, 0.5];
        let camera = [CAMERA_AHEAD_M, 0.0, CAMERA_UP_M];
        let none = [0.0, 0.0, 0.0, 1.0];
        let mut cdr = self.empty();
        cdr.u32(3);
        for (child, place, rotation) in
            [("camera", camera, optical), ("lidar", [0.0; 3], none), ("radar", camera, none)]
        {
            cdr.header(self.start_ns, "base_link").text(child).f64s(&place).f64s(&rotation);
        }
        self.message("/tf_static", "tf2_msgs/TFMessage", 0.0, &mut cdr)
    }
}

/// A grey JPEG.
pub(crate) fn jpeg(width: usize, height: usize, grey: u8) -> Vec<u8> {
    let mut data = Vec::new();
    jpeg_encoder::Encoder::new(&mut data, 90)
        .encode(
            &vec![grey; width * height * 3],
            width as u16,
            height as u16,
            jpeg_encoder::ColorType::Rgb,
        )
        .unwrap();
    data
}

/// A file of the shared test data beside the repository; `None`, said in a line, where there is
/// none: the tests must not need it.
pub(crate) fn shared(relative: &str) -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared").join(relative);
    let found = Some(path).filter(|path| path.exists());
    if found.is_none() {
        eprintln!("skipped: no shared/{relative} beside the repository");
    }
    found
}
