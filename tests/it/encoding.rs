//! Every message type of the encoder, read back by decoders that are not ours.

use glam::{DQuat, DVec3};
use pmp::log::{definitions::definition, encode::*};
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
    let header = header.iter().filter(|_| message.schema() != "tf2_msgs/msg/TFMessage");
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
