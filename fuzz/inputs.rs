//! What is done with an input of each fuzz target. The tests run the same over `fuzz/corpus/`.
//!
//! Nothing here may panic, hang or take memory that its input does not justify. Targets of message
//! encodings take a definition and a message in one input, see [`Parts`], so that both are fuzzed.
//! Each says whether the input was understood; of seeds the tests ask that it was.

use std::{fs, path::PathBuf, sync::Arc};

use pmp::{
    dataset::{
        drive::Drive,
        picture::{self, jpeg_header::Header},
        ralidar::{lidar_pixels, radar_pixels},
    },
    log::{
        conventions::RadarRule,
        decoder::Decoder,
        definitions,
        image::Picture,
        profile::{CameraRule, Profile},
        reader::{Channel, SchemaRecord},
        signals::{Kind, Pose},
    },
    projection::Camera,
};

/// A whole file: scanned, mapped, aligned, and its first frames made.
pub(crate) fn mcap(input: &[u8]) -> bool {
    let path = scratch();
    fs::write(&path, input).expect("the scratch file can be written");
    let Ok(drive) = Drive::open(&path, &Profile::default(), 10.0) else { return false };
    let ticks = &drive.grid.ticks[..drive.grid.ticks.len().min(4)];
    drive.frames(ticks).is_ok_and(|made| made.iter().any(|tick| tick.frame.is_ok()))
}

/// A ROS 2 definition (`ros2msg`, or `ros2idl` where the text has a `module`) and a CDR message.
pub(crate) fn cdr(input: &[u8]) -> bool {
    let Some(parts) = Parts::of(input) else { return false };
    let is_idl = parts.definition.windows(7).any(|word| word == b"module ");
    parts.decode(if is_idl { "ros2idl" } else { "ros2msg" }, "cdr")
}

/// A ROS 1 definition and a message.
pub(crate) fn ros1(input: &[u8]) -> bool {
    let Some(parts) = Parts::of(input) else { return false };
    parts.decode("ros1msg", "ros1")
}

/// A descriptor set and a message.
pub(crate) fn protobuf(input: &[u8]) -> bool {
    let Some(parts) = Parts::of(input) else { return false };
    parts.decode("protobuf", "protobuf")
}

/// A JSON Schema and a message.
pub(crate) fn json(input: &[u8]) -> bool {
    let Some(parts) = Parts::of(input) else { return false };
    parts.decode("jsonschema", "json")
}

/// A `sensor_msgs/PointCloud2` in CDR, projected as a lidar's and as a radar's.
pub(crate) fn cloud(input: &[u8]) -> bool {
    let name = "sensor_msgs/msg/PointCloud2";
    let text = definitions::definition(name).expect("a type that pmp writes");
    let channel = channel(name, "ros2msg", "cdr", text.into_bytes());
    let decoder = Decoder::of(&channel).expect("a definition that pmp writes");
    let Ok(message) = decoder.decode(input) else { return false };
    let camera = Camera::from_fov(64, 32, 1.5);
    let _ =
        radar_pixels(Kind::PointCloud, &message, &RadarRule::default(), &Pose::IDENTITY, &camera);
    lidar_pixels(&message, &Pose::IDENTITY, &camera).is_ok()
}

/// A JPEG, decoded and stored at sizes that shrink it by much and by little, as it is, and enlarged.
pub(crate) fn jpeg(input: &[u8]) -> bool {
    // What is large takes as long as it is large: that it is refused beyond a limit is tested.
    const MOST_PIXELS: usize = 1 << 18;
    let Ok(Header { width, height, .. }) = Header::read(input) else { return false };
    if width * height > MOST_PIXELS {
        return false;
    }
    let sizes = [(2, 2), (16, 8), (width, height), (2 * width, 2 * height)];
    let stored = sizes.map(|(width, height)| {
        let rule = CameraRule { width, height, ..CameraRule::default() };
        let decoded = picture::decode(&Picture::Compressed { data: input }, &rule);
        decoded.and_then(|decoded| decoded.stored(&rule)).is_ok()
    });
    stored.contains(&true)
}

/// An input of a message target: length of the type's name (1 byte), the name, length of the
/// definition (2 bytes, little-endian), the definition, and the message as the rest.
struct Parts<'i> {
    name: &'i str,
    definition: &'i [u8],
    message: &'i [u8],
}

impl<'i> Parts<'i> {
    fn of(input: &'i [u8]) -> Option<Parts<'i>> {
        let (name_len, rest) = input.split_first()?;
        let (name, rest) = rest.split_at_checked(usize::from(*name_len))?;
        let (len, rest) = rest.split_first_chunk::<2>()?;
        let (definition, message) = rest.split_at_checked(u16::from_le_bytes(*len).into())?;
        Some(Parts { name: std::str::from_utf8(name).ok()?, definition, message })
    }

    fn decode(&self, definition_encoding: &str, message_encoding: &str) -> bool {
        let (name, data) = (self.name, self.definition.to_vec());
        let channel = channel(name, definition_encoding, message_encoding, data);
        let Ok(decoder) = Decoder::of(&channel) else { return false };
        let _ = decoder.header(self.message);
        decoder.decode(self.message).is_ok()
    }
}

fn channel(
    name: &str,
    definition_encoding: &str,
    message_encoding: &str,
    data: Vec<u8>,
) -> Channel {
    let (name, encoding) = (name.to_string(), definition_encoding.to_string());
    Channel {
        id: 1,
        topic: "/topic".into(),
        message_encoding: message_encoding.into(),
        schema: Some(Arc::new(SchemaRecord { name, encoding, data })),
    }
}

/// A file in memory where the system has that.
fn scratch() -> PathBuf {
    let memory = PathBuf::from("/dev/shm");
    let folder = if memory.is_dir() { memory } else { std::env::temp_dir() };
    folder.join(format!("pmp-fuzz-{}.mcap", std::process::id()))
}
