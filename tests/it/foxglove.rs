//! Logs of Foxglove's message types: the same drive in every encoding gives the same frames.
#![allow(clippy::unwrap_used)]

use std::{collections::BTreeMap, fs, io::Cursor, path::Path};

use mcap::{Writer, records::MessageHeader};
use pmp::{
    dataset::drive::Drive,
    frame::{Frame, RouteSource},
    log::{
        clock::ClockRule,
        cloud::Cloud,
        decoder::Decoder,
        image::{self, Encoding, Picture, Pixels},
        profile::Profile,
        reader::{Channel, SchemaRecord},
        recording::{Recording, Series},
        signals::{self, Kind},
        value::Endian,
    },
};
use serde_json::{Value as Json, json};

use crate::{
    fixtures::{
        CAMERA_AHEAD_M, CAMERA_FOCAL, CAMERA_HEIGHT, CAMERA_UP_M, CAMERA_WIDTH, DriveLog,
        LIDAR_POINTS, RADAR_RETURN, jpeg, ns,
    },
    foxglove_fixtures::{FORMS, Form, Told, base64, rotation, time, vector},
};

/// A cloud of doubles with a byte before them, so that nothing is aligned.
fn cloud(points: &[Vec<f64>], names: &[&str], position: [f64; 3], turn: [f64; 4]) -> Json {
    let field = |(i, name): (usize, &&str)| json!({"name": name, "offset": 1 + 8 * i, "type": 8});
    let intensity = json!({"name": "intensity", "offset": 0, "type": 1});
    let fields: Vec<_> = names.iter().enumerate().map(field).chain([intensity]).collect();
    let point = |point: &Vec<f64>| {
        let numbers = point.iter().flat_map(|number| number.to_le_bytes());
        [7].into_iter().chain(numbers).collect::<Vec<u8>>()
    };
    json!({
        "pose": {"position": vector(position), "orientation": rotation(turn)},
        "point_stride": 1 + 8 * names.len(),
        "fields": fields,
        "data": base64(&points.iter().flat_map(point).collect::<Vec<_>>()),
    })
}

/// The messages of a fixture's drive as Foxglove's types; it has no controls, and its poses come
/// without velocities.
pub(crate) fn told(drive: &DriveLog) -> Vec<Told> {
    let mut messages = Vec::new();
    let mut tell = |topic, type_name, t: f64, frame_id: &str, mut values: Json| {
        let stamp_ns = drive.start_ns + ns(t);
        values["timestamp"] = time(stamp_ns);
        values["frame_id"] = json!(frame_id);
        messages.push(Told { topic, type_name, log_time_ns: stamp_ns, values });
    };
    let optical = [-0.5, 0.5, -0.5, 0.5];
    let (camera, none) = ([CAMERA_AHEAD_M, 0.0, CAMERA_UP_M], [0.0, 0.0, 0.0, 1.0]);
    let mount = |child: &str, place: [f64; 3], turn: [f64; 4]| {
        json!({
            "timestamp": time(drive.start_ns), "parent_frame_id": "base_link",
            "child_frame_id": child, "translation": vector(place), "rotation": rotation(turn),
        })
    };
    let mounts = [
        mount("camera", camera, optical),
        mount("lidar", [0.0; 3], none),
        mount("radar", camera, none),
    ];
    tell("/tf", "FrameTransforms", 0.0, "", json!({"transforms": mounts}));
    let at = |rate_hz: f64| {
        (0..=(drive.seconds * rate_hz).round() as usize).map(move |i| (i, i as f64 / rate_hz))
    };
    for (_, t) in at(50.0) {
        let [x, y, yaw] = drive.pose(t);
        let turn = rotation([0.0, 0.0, (yaw / 2.0).sin(), (yaw / 2.0).cos()]);
        let pose = json!({"position": vector([x, y, 0.0]), "orientation": turn});
        tell("/pose", "PoseInFrame", t, "odom", json!({"pose": pose}));
    }
    for (i, t) in at(10.0) {
        let picture = jpeg(CAMERA_WIDTH, CAMERA_HEIGHT, (i * 3 % 256) as u8);
        let picture = json!({"format": "jpeg", "data": base64(&picture)});
        tell("/camera/front/image", "CompressedImage", t, "camera", picture);
        let (f, cx, cy) = (CAMERA_FOCAL, CAMERA_WIDTH as f64 / 2.0, CAMERA_HEIGHT as f64 / 2.0);
        let calibration = json!({
            "width": CAMERA_WIDTH, "height": CAMERA_HEIGHT, "distortion_model": "plumb_bob",
            "D": [], "K": [f, 0.0, cx, 0.0, f, cy, 0.0, 0.0, 1.0],
            "R": [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
            "P": [f, 0.0, cx, 0.0, 0.0, f, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
        });
        tell("/camera/front/calibration", "CameraCalibration", t, "camera", calibration);
        // Its pose turns the lidar's points half around and shifts them.
        let turned = |p: &[f32; 3]| {
            let [x, y, z] = p.map(f64::from);
            vec![1.0 - x, 2.0 - y, z - 0.5]
        };
        let points: Vec<_> = LIDAR_POINTS.iter().map(turned).collect();
        let (position, turn) = ([1.0, 2.0, 0.5], [0.0, 0.0, 1.0, 0.0]);
        let lidar = cloud(&points, &["x", "y", "z"], position, turn);
        tell("/lidar", "PointCloud", t, "lidar", lidar);
        let [range, azimuth, elevation, speed] = RADAR_RETURN.map(f64::from);
        let flat = range * elevation.cos();
        let point =
            vec![flat * azimuth.cos(), flat * azimuth.sin(), range * elevation.sin(), speed];
        let radar = cloud(&[point], &["x", "y", "z", "velocity"], [0.0; 3], none);
        tell("/radar/front", "PointCloud", t, "radar", radar);
    }
    messages.sort_by_key(|message| message.log_time_ns);
    messages
}

fn frames(path: &Path) -> (Vec<Frame>, Drive) {
    let drive = Drive::open(path, &Profile::default(), 10.0).unwrap();
    let made = drive.frames(&drive.grid.ticks).unwrap();
    let frames = made.into_iter().map(|made| {
        assert!(made.damaged.is_empty(), "{:?}", made.damaged);
        *made.frame.unwrap()
    });
    (frames.collect(), drive)
}

fn written(folder: &Path, name: &str, bytes: &[u8]) -> std::path::PathBuf {
    let path = folder.join(name);
    fs::write(&path, bytes).unwrap();
    path
}

#[track_caller]
fn near(a: &[f32], b: &[f32], tolerance: f32) {
    assert_eq!(a.len(), b.len());
    for (a, b) in a.iter().zip(b) {
        assert!((a - b).abs() <= tolerance, "{a} and {b}");
    }
}

#[test]
fn a_drive_told_in_any_form_of_foxgloves_types_gives_the_frames_of_its_ros_2_form() {
    let folder = tempfile::tempdir().unwrap();
    let drive = DriveLog { has_control: false, ..DriveLog::default() };
    let (expected, _) = frames(&drive.write(folder.path(), "ros.mcap"));
    assert_eq!(expected.len(), 51);
    let mut forms = Vec::new();
    for form in FORMS {
        let path = written(folder.path(), "foxglove.mcap", &form.log(&told(&drive)));
        let (frames, opened) = frames(&path);
        assert_eq!(opened.mapping.radar.as_deref(), Some("/radar/front"), "{form:?}");
        assert_eq!(frames.len(), expected.len());
        for (frame, ros) in frames.iter().zip(&expected) {
            assert_eq!((frame.index, frame.stamp_ns), (ros.index, ros.stamp_ns));
            assert!(frame.image == ros.image);
            assert_eq!((&frame.lidar, &frame.radar), (&ros.lidar, &ros.radar), "{form:?}");
            assert_eq!(
                (frame.skew, frame.command, &frame.action),
                (ros.skew, ros.command, &ros.action)
            );
            assert!((frame.yaw_rad - ros.yaw_rad).abs() < 1e-9);
            let apart = |i: usize| (frame.position_m[i] - ros.position_m[i]).abs();
            assert!((0..3).all(|i| apart(i) < 1e-9));
            assert_eq!(frame.route.len, ros.route.len);
            near(&frame.route.waypoints_m, &ros.route.waypoints_m, 1e-5);
            assert_eq!(frame.future.len, ros.future.len);
            near(&frame.future.xy_m, &ros.future.xy_m, 1e-5);
            near(&frame.future.yaw_rad, &ros.future.yaw_rad, 1e-6);
            // Foxglove's pose has no velocity, and a chord of the circle stands in for its tangent:
            // at the ends, where there is one neighbour only, it is turned by 0.005 rad.
            near(&frame.velocity_mps, &ros.velocity_mps, 0.026);
            near(&frame.future.speed_mps, &ros.future.speed_mps, 1e-3);
        }
        forms.push(frames);
    }
    assert!(forms[0] == forms[2], "protobuf and ROS 2 hold the same numbers");
}

fn channel(form: Form, name: &str) -> Channel {
    let (name, data, encoding, message_encoding) = form.schema(name);
    let schema = SchemaRecord { name, encoding: encoding.to_string(), data };
    Channel {
        id: 1,
        topic: "/topic".to_string(),
        message_encoding: message_encoding.to_string(),
        schema: Some(schema.into()),
    }
}

/// Have a message of a type read in every form.
fn in_all_forms(name: &str, values: &Json, check: impl Fn(&pmp::log::value::Struct)) {
    for form in FORMS {
        let decoder = Decoder::of(&channel(form, name)).unwrap();
        let message = form.message(name, values);
        check(&decoder.decode(&message).unwrap());
        if !matches!(name, "FrameTransforms" | "Pose") {
            let header = decoder.header(&message).unwrap();
            assert_eq!(header.stamp_ns, 1_700_000_000_123_456_789, "{form:?}");
        }
    }
}

const STAMP_NS: i64 = 1_700_000_000_123_456_789;

#[test]
fn raw_pictures_of_all_pixel_layouts_are_found() {
    for (name, pixel_bytes) in [
        ("rgb8", 3),
        ("bgr8", 3),
        ("rgba8", 4),
        ("bgra8", 4),
        ("mono8", 1),
        ("mono16", 2),
        ("yuyv", 2),
    ] {
        let step = 2 * pixel_bytes;
        let data: Vec<u8> = (0..3 * step as u8).collect();
        let values = json!({
            "timestamp": time(STAMP_NS), "frame_id": "camera", "width": 2, "height": 3,
            "encoding": name, "step": step, "data": base64(&data),
        });
        in_all_forms("RawImage", &values, |message| {
            let picture = image::picture(Kind::Image, message).unwrap();
            let raw = Pixels {
                width: 2,
                height: 3,
                encoding: Encoding::of(name).unwrap(),
                row_bytes: step,
                endian: Endian::Little,
                data: &data,
            };
            assert_eq!(picture, Picture::Raw(raw));
        });
    }
}

#[test]
fn clouds_of_every_number_type_are_read_where_their_pose_puts_them() {
    let types: [(u8, &[u8], f64); 8] = [
        (1, &[200], 200.0),
        (2, &[0xff], -1.0),
        (3, &[1, 0x80], 32769.0),
        (4, &[0xfe, 0xff], -2.0),
        (5, &[0, 0, 0, 0x80], 2_147_483_648.0),
        (6, &[0xfd, 0xff, 0xff, 0xff], -3.0),
        (7, &1.5_f32.to_le_bytes(), 1.5),
        (8, &(-2.25_f64).to_le_bytes(), -2.25),
    ];
    for (number, bytes, expected) in types {
        let values = json!({
            "timestamp": time(STAMP_NS), "frame_id": "lidar", "point_stride": 9,
            "pose": {"position": vector([1.0, 2.0, 3.0]), "orientation": rotation([0.0, 0.0, 0.0, 2.0])},
            "fields": [{"name": "x", "offset": 1, "type": number}],
            "data": base64(&[&[0], bytes, &vec![0; 8 - bytes.len()]].concat().repeat(3)),
        });
        in_all_forms("PointCloud", &values, |message| {
            let cloud = Cloud::new(message).unwrap();
            let read: Vec<f64> =
                cloud.points().map(|point| point.get(cloud.field("x").unwrap())).collect();
            assert_eq!(read, [expected; 3]);
            assert_eq!(cloud.frame_from_points.unwrap().position_m.to_array(), [1.0, 2.0, 3.0]);
        });
    }
    let refused = |key: &str, value: Json| {
        let field = json!({"name": "x", "offset": 0, "type": 7});
        let mut values = json!({
            "timestamp": time(STAMP_NS), "frame_id": "lidar", "point_stride": 4,
            "fields": [field], "data": base64(&[0; 8]),
        });
        values[key] = value;
        let decoder = Decoder::of(&channel(Form::Json, "PointCloud")).unwrap();
        let message = Form::Json.message("PointCloud", &values);
        let decoded = decoder.decode(&message).unwrap();
        Cloud::new(&decoded).map(|_| ()).unwrap_err().to_string()
    };
    assert!(refused("point_stride", json!(0)).contains("8 bytes are no points of 0 bytes"));
    assert!(refused("data", base64(&[0; 7])).contains("7 bytes are no points of 4 bytes"));
    let field = |offset: u32, kind: u32| json!([{"name": "x", "offset": offset, "type": kind}]);
    assert!(refused("fields", field(1, 7)).contains("does not lie inside a point"));
    assert!(refused("fields", field(0, 0)).contains("has unknown type 0"));
}

#[test]
fn odometry_paths_and_single_transforms_are_read() {
    let pose = json!({"position": vector([1.0, -2.0, 0.0]), "orientation": rotation([0.0, 0.0, 1.0, 0.0])});
    let values = json!({
        "timestamp": time(STAMP_NS), "frame_id": "odom", "body_frame_id": "base_link", "pose": pose,
        "linear_velocity": vector([3.0, 0.5, 0.0]), "angular_velocity": vector([0.0; 3]),
    });
    in_all_forms("Odometry", &values, |message| {
        let odometry = signals::odometry(message).unwrap();
        assert_eq!(odometry.velocity_mps.to_array(), [3.0, 0.5, 0.0]);
        assert_eq!(odometry.pose.position_m.to_array(), [1.0, -2.0, 0.0]);
        assert_eq!(signals::child_frame(message).unwrap(), "base_link");
    });
    let values = json!({"timestamp": time(STAMP_NS), "frame_id": "map", "poses": [pose, pose]});
    in_all_forms("PosesInFrame", &values, |message| {
        let path = signals::path(message).unwrap();
        assert_eq!(path.iter().map(|p| p.to_array()).collect::<Vec<_>>(), [[1.0, -2.0, 0.0]; 2]);
    });
    let values = json!({
        "timestamp": time(STAMP_NS), "parent_frame_id": "map", "child_frame_id": "/base_link",
        "translation": vector([1.0, 2.0, 3.0]), "rotation": rotation([0.0, 0.0, 0.0, 1.0]),
    });
    for form in FORMS {
        let decoder = Decoder::of(&channel(form, "FrameTransform")).unwrap();
        let message = form.message("FrameTransform", &values);
        let transforms = signals::transforms(&decoder.decode(&message).unwrap()).unwrap();
        let [(header, child, pose)] = &transforms[..] else { panic!("{transforms:?}") };
        assert_eq!((header.stamp_ns, header.frame_id.as_str()), (STAMP_NS, "map"));
        assert_eq!((child.as_str(), pose.position_m.to_array()), ("base_link", [1.0, 2.0, 3.0]));
    }
}

#[test]
fn parts_that_a_message_leaves_out_do_not_move_or_turn_anything() {
    let values = json!({"timestamp": Json::Null, "parent_frame_id": "map", "child_frame_id": "car",
        "translation": Json::Null, "rotation": Json::Null});
    for form in [Form::Protobuf, Form::Json] {
        let decoder = Decoder::of(&channel(form, "FrameTransform")).unwrap();
        let message = form.message("FrameTransform", &values);
        let transforms = signals::transforms(&decoder.decode(&message).unwrap()).unwrap();
        assert_eq!((transforms[0].0.stamp_ns, transforms[0].2), (0, signals::Pose::IDENTITY));
    }
}

#[test]
fn a_planned_path_becomes_the_route() {
    let folder = tempfile::tempdir().unwrap();
    let drive = DriveLog { seconds: 1.0, yaw_rate_radps: 0.0, ..DriveLog::default() };
    let mut messages = told(&drive);
    let pose = |i: usize| json!({"position": vector([i as f64, 0.5, 0.0]), "orientation": rotation([0.0, 0.0, 0.0, 1.0])});
    let poses: Vec<_> = (0..80).map(pose).collect();
    let values = json!({"timestamp": time(drive.start_ns), "frame_id": "odom", "poses": poses});
    let log_time_ns = drive.start_ns;
    messages.insert(0, Told { topic: "/route", type_name: "PosesInFrame", log_time_ns, values });
    for form in FORMS {
        let path = written(folder.path(), "route.mcap", &form.log(&messages));
        let (frames, _) = frames(&path);
        let route = &frames[5].route;
        assert_eq!(route.source, RouteSource::Planned);
        assert!((route.waypoints_m[1] - 0.5).abs() < 1e-4, "{:?}", &route.waypoints_m[..4]);
    }
}

#[test]
fn what_cannot_be_used_is_told_with_its_reason() {
    let folder = tempfile::tempdir().unwrap();
    let mut writer = Writer::new(Cursor::new(Vec::new())).unwrap();
    let mut add = |topic: &str, schema: Option<(&str, &str, &[u8])>, encoding: &str| {
        let schema = schema
            .map_or(0, |(name, encoding, data)| writer.add_schema(name, encoding, data).unwrap());
        let channel_id = writer.add_channel(schema, topic, encoding, &BTreeMap::new()).unwrap();
        let header = MessageHeader { channel_id, sequence: 0, log_time: 1, publish_time: 1 };
        writer.write_to_known_channel(&header, b"{}").unwrap();
    };
    let all = Form::Protobuf.schema("LocationFix").1;
    add("/a", None, "json");
    add("/b", Some(("foxglove.Grid", "protobuf", &all)), "protobuf");
    add("/c", Some(("foxglove.RawImage", "protobuf", b"nonsense")), "protobuf");
    add("/d", Some(("foxglove.RawImage", "jsonschema", b"nonsense")), "json");
    add("/e", Some(("foxglove.RawImage", "protobuf", b"")), "protobuf");
    add("/f", Some(("foxglove.RawImage", "flatbuffer", b"")), "flatbuffer");
    writer.finish().unwrap();
    let path = written(folder.path(), "log.mcap", &writer.into_inner().into_inner());
    let recording = Recording::scan(&path, &ClockRule::default()).unwrap().remove(0);
    let why: Vec<_> = recording.unused.iter().map(|unused| unused.why.as_str()).collect();
    assert_eq!(why[0], "the log has no definition for it");
    assert_eq!(why[1], "a type that frames do not need");
    assert!(why[2].starts_with("its descriptors cannot be read: "), "{}", why[2]);
    assert!(why[3].starts_with("its definition is no JSON: "), "{}", why[3]);
    assert_eq!(why[4], "its descriptors do not define `foxglove.RawImage`");
    assert_eq!(why[5], "`flatbuffer` definitions of `flatbuffer` messages are not read");
}

#[test]
fn json_pictures_without_a_schema_are_tried_as_base64() {
    let folder = tempfile::tempdir().unwrap();
    let picture = jpeg(CAMERA_WIDTH, CAMERA_HEIGHT, 80);
    let mut writer = Writer::new(Cursor::new(Vec::new())).unwrap();
    let schema = writer.add_schema("foxglove.CompressedImage", "", b"").unwrap();
    let channel_id = writer.add_channel(schema, "/camera", "json", &BTreeMap::new()).unwrap();
    let header = MessageHeader { channel_id, sequence: 0, log_time: 1, publish_time: 1 };
    // Some writers escape slashes, and some put a point behind whole numbers.
    let data = base64(&picture).as_str().unwrap().replace('/', "\\/");
    let text = format!(
        r#"{{"timestamp": {{"sec": 7.0, "nsec": 5}}, "frame_id": "camera", "data": "{data}"}}"#
    );
    writer.write_to_known_channel(&header, text.as_bytes()).unwrap();
    writer.finish().unwrap();
    let path = written(folder.path(), "log.mcap", &writer.into_inner().into_inner());
    let recording = Recording::scan(&path, &ClockRule::default()).unwrap().remove(0);
    let topic = &recording.topics["/camera"];
    let Series::Located(samples) = &topic.series else { panic!("{:?}", topic.series) };
    assert_eq!(samples[0].stamp_ns, 7_000_000_005);
    let message = topic.decode(text.as_bytes()).unwrap();
    let read = image::picture(topic.kind, &message).unwrap();
    assert_eq!(read, Picture::Compressed { data: &picture });
}
