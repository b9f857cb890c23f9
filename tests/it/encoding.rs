//! Every message type of the encoder, read back by decoders that are not ours.

use glam::{DQuat, DVec3};
use pmp::log::{definitions::definition, encode::*, protobuf_messages};
use prost_reflect::{DescriptorPool, DynamicMessage};
use re_cdr::{BigEndian, CdrEndian, CdrReader, LittleEndian};
use re_ros_msg::{
    MessageSchema,
    deserialize::{MapResolver, Value, decode_message, primitive_array::PrimitiveArray},
};

/// The message as the independent decoder reads it by the definition that the log carries;
/// nothing may be left over.
fn decode<E: CdrEndian>(message: &dyn Message, endian: Endian) -> Value {
    let name = message.schema();
    let schema = MessageSchema::parse(name, &definition(name).unwrap()).unwrap();
    let types = schema.dependencies.iter().map(|spec| (spec.name.clone(), spec));
    let bytes = message.encode(endian);
    assert_eq!(bytes[..2], [0, u8::from(endian == Endian::Little)], "encapsulation");
    let mut reader = CdrReader::<E>::new(&bytes[4..]);
    let value = decode_message(&mut reader, &schema.spec, &MapResolver::new(types)).unwrap();
    assert_eq!(reader.remaining(), 0, "{name}: bytes left over");
    value
}

/// A field by path; steps that are numbers index sequences.
fn at<'a>(value: &'a Value, path: &str) -> &'a Value {
    path.split('.').fold(value, |value, step| match value {
        Value::Message(fields) => fields.get(step).unwrap_or_else(|| panic!("no {step}: {path}")),
        Value::Sequence(items) | Value::Array(items) => &items[step.parse::<usize>().unwrap()],
        other => panic!("{path}: {other:?} has no {step}"),
    })
}

/// Fields as text, so that one table holds numbers, flags and strings.
fn text(value: &Value) -> String {
    match value {
        Value::PrimitiveSeq(array) | Value::PrimitiveArray(array) => match array {
            PrimitiveArray::U8(v) => format!("{v:?}"),
            PrimitiveArray::F64(v) => format!("{v:?}"),
            other => panic!("{other:?}"),
        },
        Value::String(v) => v.clone(),
        Value::Bool(v) => v.to_string(),
        Value::U8(v) => v.to_string(),
        Value::I8(v) => v.to_string(),
        Value::U16(v) => v.to_string(),
        Value::I32(v) => v.to_string(),
        Value::U32(v) => v.to_string(),
        Value::F32(v) => v.to_string(),
        Value::F64(v) => v.to_string(),
        other => panic!("{other:?}"),
    }
}

/// The fields named, in both byte orders.
fn check(message: &dyn Message, expected: &[(&str, &str)]) {
    let little = decode::<LittleEndian>(message, Endian::Little);
    let big = decode::<BigEndian>(message, Endian::Big);
    let header = [("header.stamp.sec", "1700000000"), ("header.stamp.nanosec", "250000001")];
    let header_less = ["tf2_msgs/msg/TFMessage", "carla_msgs/msg/CarlaWeatherParameters"];
    let header = header.iter().filter(|_| !header_less.contains(&message.schema()));
    for (path, wanted) in header.chain(expected) {
        assert_eq!(text(at(&little, path)), *wanted, "{} {path}, little", message.schema());
        assert_eq!(text(at(&big, path)), *wanted, "{} {path}, big", message.schema());
    }
}

/// Of a length that leaves what follows unaligned.
fn header() -> Header {
    Header { stamp_ns: 1_700_000_000_250_000_001, frame_id: "frame".into() }
}

fn pose() -> Pose {
    Pose { position: DVec3::new(1.5, -2.5, 3.5), orientation: DQuat::from_xyzw(0.1, 0.2, 0.3, 0.4) }
}

fn twist() -> Twist {
    Twist { linear: DVec3::new(4.5, 5.5, 6.5), angular: DVec3::new(7.5, 8.5, 9.5) }
}

fn counting<const N: usize>() -> [f64; N] {
    std::array::from_fn(|i| i as f64 + 0.5)
}

fn control() -> CarlaEgoVehicleControl {
    CarlaEgoVehicleControl {
        header: header(),
        throttle: 0.25,
        steer: -0.5,
        brake: 0.75,
        hand_brake: true,
        reverse: false,
        gear: -3,
        manual_gear_shift: true,
    }
}

#[test]
fn poses_twists_and_paths_read_back() {
    check(
        &PoseStamped { header: header(), pose: pose() },
        &[
            ("pose.position.y", "-2.5"),
            ("pose.orientation.x", "0.1"),
            ("pose.orientation.w", "0.4"),
        ],
    );
    check(
        &TwistStamped { header: header(), twist: twist() },
        &[("header.frame_id", "frame"), ("twist.linear.x", "4.5"), ("twist.angular.z", "9.5")],
    );
    let poses = vec![PoseStamped { header: header(), pose: pose() }; 2];
    check(
        &Path { header: header(), poses },
        &[("poses.1.header.frame_id", "frame"), ("poses.1.pose.orientation.z", "0.3")],
    );
}

#[test]
fn odometry_reads_back_with_both_covariances() {
    let odometry = Odometry {
        header: header(),
        child_frame_id: "base".into(),
        pose: PoseWithCovariance { pose: pose(), covariance: counting() },
        twist: TwistWithCovariance { twist: twist(), covariance: counting() },
    };
    let covariance = format!("{:?}", counting::<36>());
    check(
        &odometry,
        &[
            ("child_frame_id", "base"),
            ("pose.pose.position.z", "3.5"),
            ("pose.covariance", &covariance),
            ("twist.twist.linear.y", "5.5"),
            ("twist.covariance", &covariance),
        ],
    );
}

#[test]
fn transforms_read_back_each_with_its_child() {
    let transform = |child: &str| TransformStamped {
        header: header(),
        child_frame_id: child.into(),
        transform: Transform { translation: pose().position, rotation: pose().orientation },
    };
    check(
        &TfMessage { transforms: vec![transform("a"), transform("lidar")] },
        &[
            ("transforms.0.child_frame_id", "a"),
            ("transforms.1.header.stamp.nanosec", "250000001"),
            ("transforms.1.child_frame_id", "lidar"),
            ("transforms.1.transform.rotation.w", "0.4"),
        ],
    );
}

#[test]
fn pictures_and_calibrations_read_back() {
    check(
        &CompressedImage { header: header(), format: "jpeg".into(), data: vec![1, 2, 3] },
        &[("format", "jpeg"), ("data", "[1, 2, 3]")],
    );
    let image = Image {
        header: header(),
        height: 1,
        width: 2,
        encoding: "rgb8".into(),
        is_bigendian: 0,
        step: 6,
        data: vec![9, 8, 7, 6, 5, 4],
    };
    check(
        &image,
        &[("width", "2"), ("encoding", "rgb8"), ("step", "6"), ("data", "[9, 8, 7, 6, 5, 4]")],
    );
    let info = CameraInfo {
        header: header(),
        height: 250,
        width: 600,
        distortion_model: "plumb_bob".into(),
        d: vec![0.1, 0.2],
        k: counting(),
        r: counting(),
        p: counting(),
        binning_x: 3,
        binning_y: 4,
        roi: RegionOfInterest { x_offset: 5, y_offset: 6, height: 7, width: 8, do_rectify: true },
    };
    let (nine, twelve) = (format!("{:?}", counting::<9>()), format!("{:?}", counting::<12>()));
    check(
        &info,
        &[
            ("height", "250"),
            ("d", "[0.1, 0.2]"),
            ("k", &nine),
            ("r", &nine),
            ("p", &twelve),
            ("binning_y", "4"),
            ("roi.width", "8"),
            ("roi.do_rectify", "true"),
        ],
    );
}

#[test]
fn clouds_scans_and_inertial_data_read_back() {
    let field =
        |name: &str, offset| PointField { name: name.into(), offset, datatype: 7, count: 1 };
    let cloud = PointCloud2 {
        header: header(),
        height: 1,
        width: 2,
        fields: vec![field("x", 0), field("ring", 4)],
        is_bigendian: false,
        point_step: 3,
        row_step: 6,
        data: vec![1, 2, 3, 4, 5, 6],
        is_dense: true,
    };
    check(
        &cloud,
        &[
            ("fields.1.name", "ring"),
            ("fields.1.offset", "4"),
            ("fields.1.count", "1"),
            ("point_step", "3"),
            ("data", "[1, 2, 3, 4, 5, 6]"),
            ("is_dense", "true"),
        ],
    );
    let imu = Imu {
        header: header(),
        orientation: pose().orientation,
        orientation_covariance: counting(),
        angular_velocity: twist().angular,
        angular_velocity_covariance: counting(),
        linear_acceleration: twist().linear,
        linear_acceleration_covariance: counting(),
    };
    let nine = format!("{:?}", counting::<9>());
    check(
        &imu,
        &[
            ("orientation.z", "0.3"),
            ("angular_velocity.x", "7.5"),
            ("linear_acceleration.z", "6.5"),
            ("linear_acceleration_covariance", &nine),
        ],
    );
    let returned = RadarReturn {
        range: 12.5,
        azimuth: -0.25,
        elevation: 0.125,
        doppler_velocity: -7.5,
        amplitude: 3.0,
    };
    check(
        &RadarScan { header: header(), returns: vec![returned; 3] },
        &[("returns.2.doppler_velocity", "-7.5"), ("returns.2.amplitude", "3")],
    );
}

#[test]
fn controls_and_vehicle_reports_read_back() {
    check(
        &control(),
        &[
            ("throttle", "0.25"),
            ("steer", "-0.5"),
            ("brake", "0.75"),
            ("hand_brake", "true"),
            ("reverse", "false"),
            ("gear", "-3"),
            ("manual_gear_shift", "true"),
        ],
    );
    let status = CarlaEgoVehicleStatus {
        header: header(),
        velocity: 3.5,
        acceleration: Accel { linear: twist().linear, angular: twist().angular },
        orientation: pose().orientation,
        control: control(),
    };
    check(
        &status,
        &[
            ("velocity", "3.5"),
            ("acceleration.angular.y", "8.5"),
            ("orientation.w", "0.4"),
            ("control.header.frame_id", "frame"),
            ("control.manual_gear_shift", "true"),
        ],
    );
    let drive = AckermannDrive {
        steering_angle: 0.5,
        steering_angle_velocity: 1.5,
        speed: 2.5,
        acceleration: 3.5,
        jerk: 4.5,
    };
    check(
        &AckermannDriveStamped { header: header(), drive },
        &[("drive.steering_angle", "0.5"), ("drive.jerk", "4.5")],
    );
}

#[test]
fn fixes_boxes_weather_and_situations_read_back() {
    let fix = NavSatFix {
        header: header(),
        status: NavSatStatus { status: -1, service: 3 },
        latitude: 49.5,
        longitude: 8.25,
        altitude: -3.5,
        position_covariance: counting(),
        position_covariance_type: 2,
    };
    let nine = format!("{:?}", counting::<9>());
    check(
        &fix,
        &[
            ("status.status", "-1"),
            ("status.service", "3"),
            ("longitude", "8.25"),
            ("position_covariance", &nine),
            ("position_covariance_type", "2"),
        ],
    );
    let object = Object {
        header: header(),
        id: 7,
        detection_level: 1,
        object_classified: true,
        pose: pose(),
        twist: twist(),
        accel: Accel { linear: twist().linear, angular: twist().angular },
        polygon: Polygon { points: vec![Point32 { x: 0.5, y: 1.5, z: 2.5 }] },
        shape: SolidPrimitive { r#type: 1, dimensions: vec![4.5, 2.0, 1.5] },
        classification: 6,
        classification_certainty: 255,
        classification_age: 12,
    };
    check(
        &ObjectArray { header: header(), objects: vec![object; 2] },
        &[
            ("objects.1.id", "7"),
            ("objects.1.pose.position.y", "-2.5"),
            ("objects.1.polygon.points.0.z", "2.5"),
            ("objects.1.shape.dimensions", "[4.5, 2.0, 1.5]"),
            ("objects.1.classification", "6"),
            ("objects.1.classification_age", "12"),
        ],
    );
    let weather = CarlaWeatherParameters {
        cloudiness: 1.5,
        precipitation: 2.5,
        precipitation_deposits: 3.5,
        wind_intensity: 4.5,
        fog_density: 5.5,
        fog_distance: 6.5,
        wetness: 7.5,
        sun_azimuth_angle: 8.5,
        sun_altitude_angle: -9.5,
    };
    check(&weather, &[("precipitation", "2.5"), ("sun_altitude_angle", "-9.5")]);
    let situation = Situation {
        header: header(),
        in_junction: true,
        speed_limit_mps: 13.5,
        command: "left".into(),
    };
    check(&situation, &[("in_junction", "true"), ("speed_limit_mps", "13.5"), ("command", "left")]);
}

/// A message as an independent decoder reads it by the descriptors that the log carries.
fn reflected(message: &dyn Message) -> DynamicMessage {
    let definition = message.definition().unwrap();
    assert_eq!((definition.schema_encoding, definition.message_encoding), ("protobuf", "protobuf"));
    let pool = DescriptorPool::decode(&*definition.data).unwrap();
    let descriptor = pool.get_message_by_name(message.schema()).unwrap();
    DynamicMessage::decode(descriptor, &*message.encode(Endian::Little)).unwrap()
}

/// A field by path, as text.
fn field(message: &DynamicMessage, path: &str) -> String {
    let (first, rest) = path.split_once('.').unwrap_or((path, ""));
    let value = message.get_field_by_name(first).unwrap_or_else(|| panic!("no {first}"));
    match (&*value, rest) {
        (prost_reflect::Value::Message(part), rest) if !rest.is_empty() => field(part, rest),
        (value, _) => value.to_string(),
    }
}

#[test]
fn our_own_protobuf_types_are_what_their_descriptors_say() {
    let timestamp = Some(prost_types::Timestamp { seconds: 1_700_000_000, nanos: 250_000_001 });
    let frame_id = "frame".to_string();
    let control = protobuf_messages::Control {
        timestamp,
        frame_id: frame_id.clone(),
        steer: -0.5,
        throttle: 0.25,
        brake: 0.75,
    };
    let imu = protobuf_messages::Imu {
        timestamp,
        frame_id: frame_id.clone(),
        orientation: Some(foxglove::messages::Quaternion { x: 0.1, y: 0.2, z: 0.3, w: 0.4 }),
        angular_velocity: Some(foxglove::messages::Vector3 { x: 1.5, y: 2.5, z: 3.5 }),
        linear_acceleration: Some(foxglove::messages::Vector3 { x: 4.5, y: 5.5, z: 6.5 }),
    };
    let situation = protobuf_messages::Situation {
        timestamp,
        frame_id,
        in_junction: true,
        speed_limit_mps: 13.5,
        command: "left".into(),
    };
    let check = |message: &dyn Message, fields: &[(&str, &str)]| {
        let read = reflected(message);
        let head = [("timestamp.seconds", "1700000000"), ("timestamp.nanos", "250000001")];
        for (path, wanted) in head.iter().chain(fields) {
            assert_eq!(field(&read, path), *wanted, "{} {path}", message.schema());
        }
        assert_eq!(read.unknown_fields().count(), 0, "{}", message.schema());
    };
    check(&control, &[("steer", "-0.5"), ("throttle", "0.25"), ("brake", "0.75")]);
    check(
        &imu,
        &[
            ("orientation.w", "0.4"),
            ("angular_velocity.y", "2.5"),
            ("linear_acceleration.z", "6.5"),
        ],
    );
    check(
        &situation,
        &[("in_junction", "true"), ("speed_limit_mps", "13.5"), ("command", "\"left\"")],
    );
}
