//! Readings as messages of Foxglove's schemas.

use foxglove::messages::{
    CameraCalibration, Color, CompressedImage, CubePrimitive, Duration, FrameTransform,
    FrameTransforms, KeyValuePair, LocationFix, Odometry, PackedElementField, PointCloud, Pose,
    PosesInFrame, Quaternion, SceneEntity, SceneUpdate, Timestamp, Vector3,
    location_fix::PositionCovarianceType, packed_element_field::NumericType,
};
use glam::{DAffine3, DQuat, DVec3};

use crate::{
    log::protobuf_messages::{Control, Imu, Situation},
    policy::{Action, Mode},
    projection::Camera,
    sensors::{gnss::GnssFix, odometry::OdometryReading},
    sim::{
        clouds::{self, Number, Packed},
        message::{Sent, planar_covariance},
        reading::{self, Object, ObjectKind, Reading},
        rig::{Mounted, Rig},
    },
    world::kind::VehicleKind,
};

/// The topic of the controls that moved the car.
pub const APPLIED_CONTROL: &str = "/vehicle/applied_control";

/// Frames of the log; transforms between them are on `/tf` and `/tf_static`.
const WORLD: &str = "map";
const EGO: &str = "base_link";

fn frame(mounted: Mounted) -> &'static str {
    match mounted {
        Mounted::Camera => "camera_front_optical",
        Mounted::Lidar => "lidar_top",
        Mounted::Radar => "radar_front",
        Mounted::Gnss => "gnss",
    }
}

/// Told once: where the sensors sit on the car.
pub fn at_start(stamp_ns: i64, rig: &Rig) -> Vec<Sent> {
    let mounts = rig.mounts();
    let transforms = mounts
        .iter()
        .map(|(mounted, mount)| transform(stamp_ns, EGO, frame(*mounted), mount))
        .collect();
    vec![Sent::new("/tf_static", FrameTransforms { transforms })]
}

/// A reading as messages.
pub fn messages(stamp_ns: i64, reading: &Reading, rig: &Rig) -> Vec<Sent> {
    let timestamp = Some(timestamp(stamp_ns));
    let stamp = Some(prost_stamp(stamp_ns));
    match reading {
        Reading::Picture(jpeg) => {
            let frame_id = frame(Mounted::Camera).to_string();
            let image = CompressedImage {
                timestamp,
                frame_id,
                data: jpeg.clone().into(),
                format: "jpeg".into(),
            };
            vec![
                Sent::new("/camera/front/image", image),
                Sent::new(
                    "/camera/front/calibration",
                    calibration(stamp_ns, &rig.camera.intrinsics),
                ),
            ]
        }
        Reading::Lidar(returns) => {
            let cloud = cloud(stamp_ns, Mounted::Lidar, clouds::of_lidar(returns, true));
            vec![Sent::new("/lidar/points", cloud)]
        }
        Reading::Radar(returns) => {
            let cloud = cloud(stamp_ns, Mounted::Radar, clouds::of_radar(returns));
            vec![Sent::new("/radar/front", cloud)]
        }
        Reading::Odometry(reading) => {
            let world_from_ego =
                DAffine3::from_rotation_translation(reading.orientation, reading.position_m);
            let transforms = vec![transform(stamp_ns, WORLD, EGO, &world_from_ego)];
            vec![
                Sent::new("/tf", FrameTransforms { transforms }),
                Sent::new("/odom", odometry(stamp_ns, reading, rig)),
            ]
        }
        Reading::Imu(reading) => {
            let imu = Imu {
                timestamp: stamp,
                frame_id: EGO.into(),
                orientation: Some(quaternion(reading.orientation)),
                angular_velocity: Some(vector(reading.turn_radps)),
                linear_acceleration: Some(vector(reading.acceleration_mps2)),
            };
            vec![Sent::new("/imu", imu)]
        }
        Reading::Fix(reading) => vec![Sent::new("/gnss", fix(stamp_ns, reading))],
        Reading::Control { wanted, applied, .. } => vec![
            Sent::new("/vehicle/control", control(stamp_ns, wanted)),
            Sent::new(APPLIED_CONTROL, control(stamp_ns, applied)),
        ],
        Reading::Situation { in_junction, speed_limit_mps, command } => {
            let situation = Situation {
                timestamp: stamp,
                frame_id: EGO.into(),
                in_junction: *in_junction,
                speed_limit_mps: *speed_limit_mps as f32,
                command: command.name().into(),
            };
            vec![Sent::new("/situation", situation)]
        }
        Reading::Route(poses) => {
            let poses = poses.iter().map(pose).collect();
            let path = PosesInFrame { timestamp, frame_id: WORLD.into(), poses };
            vec![Sent::new("/route", path)]
        }
        Reading::Objects(objects) => {
            let entities = objects.iter().map(|object| entity(stamp_ns, object)).collect();
            vec![Sent::new("/objects", SceneUpdate { deletions: Vec::new(), entities })]
        }
    }
}

/// The way that a mode of a plan means to go, from the car.
pub fn planned_motion(stamp_ns: i64, mode: &Mode, speed_mps: f32) -> Sent {
    let places = mode.positions_m(speed_mps).into_iter().zip(mode.yaw_rad);
    let poses = places.map(|([x, y], yaw_rad)| {
        let orientation = DQuat::from_rotation_z(f64::from(yaw_rad));
        pose(&reading::Pose { position_m: DVec3::new(x, y, 0.0), orientation })
    });
    let timestamp = Some(timestamp(stamp_ns));
    let path = PosesInFrame { timestamp, frame_id: EGO.into(), poses: poses.collect() };
    Sent::new("/policy/planned_motion", path)
}

const SECOND_NS: i64 = 1_000_000_000;

fn timestamp(stamp_ns: i64) -> Timestamp {
    Timestamp::new((stamp_ns / SECOND_NS) as u32, (stamp_ns % SECOND_NS) as u32)
}

fn prost_stamp(stamp_ns: i64) -> prost_types::Timestamp {
    prost_types::Timestamp { seconds: stamp_ns / SECOND_NS, nanos: (stamp_ns % SECOND_NS) as i32 }
}

fn vector(v: DVec3) -> Vector3 {
    Vector3 { x: v.x, y: v.y, z: v.z }
}

fn quaternion(q: DQuat) -> Quaternion {
    // A quaternion and its negative are the same rotation; readers expect the one with w >= 0.
    let q = if q.w < 0.0 { -q } else { q };
    Quaternion { x: q.x, y: q.y, z: q.z, w: q.w }
}

fn pose(pose: &reading::Pose) -> Pose {
    Pose {
        position: Some(vector(pose.position_m)),
        orientation: Some(quaternion(pose.orientation)),
    }
}

fn transform(
    stamp_ns: i64,
    parent: &str,
    child: &str,
    parent_from_child: &DAffine3,
) -> FrameTransform {
    let (_, rotation, translation) = parent_from_child.to_scale_rotation_translation();
    FrameTransform {
        timestamp: Some(timestamp(stamp_ns)),
        parent_frame_id: parent.into(),
        child_frame_id: child.into(),
        translation: Some(vector(translation)),
        rotation: Some(quaternion(rotation)),
    }
}

fn calibration(stamp_ns: i64, intrinsics: &Camera) -> CameraCalibration {
    let Camera { width, height, fx, fy, cx, cy, .. } = *intrinsics;
    CameraCalibration {
        timestamp: Some(timestamp(stamp_ns)),
        frame_id: frame(Mounted::Camera).into(),
        width: width as u32,
        height: height as u32,
        distortion_model: "plumb_bob".into(),
        d: vec![0.0; 5],
        k: vec![fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0],
        r: vec![1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        p: vec![fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
    }
}

fn cloud(stamp_ns: i64, mounted: Mounted, points: Packed) -> PointCloud {
    let field = |(name, offset, number): &(&str, u32, Number)| PackedElementField {
        name: (*name).into(),
        offset: *offset,
        r#type: match number {
            Number::F32 => NumericType::Float32,
            Number::U16 => NumericType::Uint16,
        } as i32,
    };
    PointCloud {
        timestamp: Some(timestamp(stamp_ns)),
        frame_id: frame(mounted).into(),
        pose: Some(Pose {
            position: Some(vector(DVec3::ZERO)),
            orientation: Some(quaternion(DQuat::IDENTITY)),
        }),
        point_stride: points.point_bytes,
        fields: points.fields.iter().map(field).collect(),
        data: points.data.into(),
    }
}

fn odometry(stamp_ns: i64, reading: &OdometryReading, rig: &Rig) -> Odometry {
    let config = &rig.odometry;
    Odometry {
        timestamp: Some(timestamp(stamp_ns)),
        frame_id: WORLD.into(),
        body_frame_id: EGO.into(),
        pose: Some(Pose {
            position: Some(vector(reading.position_m)),
            orientation: Some(quaternion(reading.orientation)),
        }),
        linear_velocity: Some(vector(reading.velocity_mps)),
        angular_velocity: Some(vector(DVec3::Z * reading.yaw_rate_radps)),
        pose_covariance: planar_covariance(config.position_std_m, config.yaw_std_rad).to_vec(),
        velocity_covariance: planar_covariance(config.velocity_std_mps, config.yaw_rate_std_radps)
            .to_vec(),
        metadata: Vec::new(),
    }
}

fn fix(stamp_ns: i64, reading: &GnssFix) -> LocationFix {
    let variance = reading.std_m * reading.std_m;
    LocationFix {
        timestamp: Some(timestamp(stamp_ns)),
        frame_id: frame(Mounted::Gnss).into(),
        latitude: reading.latitude_deg,
        longitude: reading.longitude_deg,
        altitude: reading.altitude_m,
        position_covariance: DAffine3::from_scale(variance).matrix3.to_cols_array().to_vec(),
        position_covariance_type: PositionCovarianceType::DiagonalKnown as i32,
        ..LocationFix::default()
    }
}

fn control(stamp_ns: i64, action: &Action) -> Control {
    Control {
        timestamp: Some(prost_stamp(stamp_ns)),
        frame_id: EGO.into(),
        steer: action.steer,
        throttle: action.throttle,
        brake: action.brake,
    }
}

/// A box that stays until the next ones come.
fn entity(stamp_ns: i64, object: &Object) -> SceneEntity {
    const LIFETIME_NS: u32 = 200_000_000;
    let (name, [r, g, b]) = match object.kind {
        ObjectKind::Vehicle(VehicleKind::Bicycle | VehicleKind::Motorcycle) => {
            ("rider", [0.2, 0.8, 0.9])
        }
        ObjectKind::Vehicle(VehicleKind::Bus | VehicleKind::Truck) => ("truck", [0.9, 0.5, 0.1]),
        ObjectKind::Vehicle(_) => ("vehicle", [0.2, 0.5, 1.0]),
        ObjectKind::Walker(_) => ("pedestrian", [1.0, 0.2, 0.4]),
    };
    let kind = match object.kind {
        ObjectKind::Vehicle(kind) => kind.name(),
        ObjectKind::Walker(kind) => kind.name(),
    };
    let words =
        [("kind", kind.to_string()), ("speed_mps", format!("{:.2}", object.velocity_mps.length()))];
    SceneEntity {
        timestamp: Some(timestamp(stamp_ns)),
        frame_id: WORLD.into(),
        id: format!("{name}-{}", object.id),
        lifetime: Some(Duration::new(0, LIFETIME_NS)),
        metadata: words.map(|(key, value)| KeyValuePair { key: key.into(), value }).to_vec(),
        cubes: vec![CubePrimitive {
            pose: Some(pose(&object.pose)),
            size: Some(vector(object.size_m)),
            color: Some(Color { r, g, b, a: 0.5 }),
        }],
        ..SceneEntity::default()
    }
}
