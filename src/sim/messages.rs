//! What the simulator's sensors say, as the messages that a car's drivers would publish.

use glam::{DAffine3, DQuat, DVec2, DVec3};
use jpeg_encoder::{ColorType, Encoder};

use crate::{
    log::encode::{
        Accel, CameraInfo, CarlaEgoVehicleControl, CarlaEgoVehicleStatus, CompressedImage, Header,
        Imu, Odometry, PointCloud2, PointField, Pose, PoseWithCovariance, RadarReturn, RadarScan,
        RegionOfInterest, TfMessage, Transform, TransformStamped, Twist, TwistWithCovariance,
    },
    noise::Noise,
    policy::Action,
    projection::Camera,
    sim::{camera, lidar, radar},
    world::ego::Car,
};

/// Frames of the log; transforms between them are on `/tf` and `/tf_static`.
pub const WORLD: &str = "odom";
pub const EGO: &str = "base_link";
pub const CAMERA: &str = "camera_front_optical";
pub const LIDAR: &str = "lidar_top";
pub const RADAR: &str = "radar_front";

/// Quality of pictures, as CARLA's bridge stores them.
const JPEG_QUALITY: u8 = 90;

const GRAVITY_MPS2: f64 = 9.81;

/// Standard deviations of odometry and of the inertial unit.
const POSITION_STD_M: f64 = 0.01;
const YAW_STD_RAD: f64 = 0.0005;
const VELOCITY_STD_MPS: f64 = 0.02;
const YAW_RATE_STD_RADPS: f64 = 0.002;
const ACCELERATION_STD_MPS2: f64 = 0.05;

pub fn header(stamp_ns: i64, frame: &str) -> Header {
    Header { stamp_ns, frame_id: frame.to_owned() }
}

/// A picture as JPEG.
///
/// # Panics
///
/// If `rgb` is not as large as the simulated camera's picture.
pub fn image(stamp_ns: i64, rgb: &[u8]) -> CompressedImage {
    let Camera { width, height, .. } = camera::intrinsics();
    let mut data = Vec::new();
    Encoder::new(&mut data, JPEG_QUALITY)
        .encode(rgb, width as u16, height as u16, ColorType::Rgb)
        .expect("a picture of the camera's size fits a JPEG in memory");
    CompressedImage { header: header(stamp_ns, CAMERA), format: "jpeg".into(), data }
}

/// The camera's calibration.
pub fn camera_info(stamp_ns: i64) -> CameraInfo {
    let Camera { width, height, fx, fy, cx, cy, .. } = camera::intrinsics();
    let (width, height) = (width as u32, height as u32);
    CameraInfo {
        header: header(stamp_ns, CAMERA),
        height,
        width,
        distortion_model: "plumb_bob".into(),
        d: vec![0.0; 5],
        k: [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0],
        r: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        p: [fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
        binning_x: 0,
        binning_y: 0,
        roi: RegionOfInterest { x_offset: 0, y_offset: 0, height: 0, width: 0, do_rectify: false },
    }
}

/// A turn of the lidar: x, y, z, intensity as float32, ring as uint16, 18 bytes a point.
///
/// Rounded to 1/256 m and 1/256 of full intensity, which is finer than the noise: a quarter of
/// the bytes of a drive would otherwise be noise in the last bits.
pub fn point_cloud(stamp_ns: i64, returns: &[lidar::LidarReturn]) -> PointCloud2 {
    const UINT16: u8 = 4;
    const FLOAT32: u8 = 7;
    const POINT_BYTES: u32 = 18;
    let field =
        |name: &str, offset, datatype| PointField { name: name.into(), offset, datatype, count: 1 };
    let mut data = Vec::with_capacity(POINT_BYTES as usize * returns.len());
    for point in returns {
        let [x, y, z] = point.position_m.to_array();
        for value in [x, y, z, point.intensity] {
            let rounded = (value * 256.0).round() / 256.0;
            data.extend_from_slice(&(rounded as f32).to_le_bytes());
        }
        data.extend_from_slice(&point.ring.to_le_bytes());
    }
    PointCloud2 {
        header: header(stamp_ns, LIDAR),
        height: 1,
        width: returns.len() as u32,
        fields: vec![
            field("x", 0, FLOAT32),
            field("y", 4, FLOAT32),
            field("z", 8, FLOAT32),
            field("intensity", 12, FLOAT32),
            field("ring", 16, UINT16),
        ],
        is_bigendian: false,
        point_step: POINT_BYTES,
        row_step: POINT_BYTES * returns.len() as u32,
        data,
        is_dense: true,
    }
}

/// A scan of the radar.
pub fn radar_scan(stamp_ns: i64, returns: &[radar::RadarReturn]) -> RadarScan {
    let returns = returns.iter().map(|r| RadarReturn {
        range: r.range_m as f32,
        azimuth: r.azimuth_rad as f32,
        elevation: r.elevation_rad as f32,
        doppler_velocity: r.speed_mps as f32,
        amplitude: r.amplitude_db as f32,
    });
    RadarScan { header: header(stamp_ns, RADAR), returns: returns.collect() }
}

/// Where the car measures itself to be: pose in the world frame, twist in its own.
pub fn odometry(stamp_ns: i64, ego: &Car, noise: &mut Noise) -> Odometry {
    let mut near = |value: f64, std: f64| value + noise.normal(std);
    let position = DVec3::new(
        near(ego.position_m.x, POSITION_STD_M),
        near(ego.position_m.y, POSITION_STD_M),
        0.0,
    );
    let orientation = DQuat::from_rotation_z(near(ego.yaw_rad, YAW_STD_RAD));
    let velocity = ego.velocity_ego_mps();
    let twist = Twist {
        linear: DVec3::new(
            near(velocity.x, VELOCITY_STD_MPS),
            near(velocity.y, VELOCITY_STD_MPS),
            0.0,
        ),
        angular: DVec3::new(0.0, 0.0, near(ego.yaw_rate_radps(), YAW_RATE_STD_RADPS)),
    };
    Odometry {
        header: header(stamp_ns, WORLD),
        child_frame_id: EGO.into(),
        pose: PoseWithCovariance {
            pose: Pose { position, orientation },
            covariance: planar_covariance(POSITION_STD_M, YAW_STD_RAD),
        },
        twist: TwistWithCovariance {
            twist,
            covariance: planar_covariance(VELOCITY_STD_MPS, YAW_RATE_STD_RADPS),
        },
    }
}

/// Variances of x, y and the turn about z; the car cannot leave the ground.
fn planar_covariance(linear_std: f64, angular_std: f64) -> [f64; 36] {
    let mut covariance = [0.0; 36];
    covariance[0] = linear_std * linear_std;
    covariance[7] = linear_std * linear_std;
    covariance[35] = angular_std * angular_std;
    covariance
}

/// The inertial unit at the ego frame's origin: gravity pushes it up.
///
/// `acceleration_mps2` is that of the origin, in the world frame.
pub fn imu(stamp_ns: i64, ego: &Car, acceleration_mps2: DVec2, noise: &mut Noise) -> Imu {
    let felt = DVec2::from_angle(-ego.yaw_rad).rotate(acceleration_mps2);
    let mut shaken = |x: f64, y: f64, z: f64, std: f64| {
        DVec3::new(x + noise.normal(std), y + noise.normal(std), z + noise.normal(std))
    };
    let variances = |std: f64| {
        let v = std * std;
        [v, 0.0, 0.0, 0.0, v, 0.0, 0.0, 0.0, v]
    };
    Imu {
        header: header(stamp_ns, EGO),
        orientation: ego.orientation(),
        orientation_covariance: [0.0; 9],
        angular_velocity: shaken(0.0, 0.0, ego.yaw_rate_radps(), YAW_RATE_STD_RADPS),
        angular_velocity_covariance: variances(YAW_RATE_STD_RADPS),
        linear_acceleration: shaken(felt.x, felt.y, GRAVITY_MPS2, ACCELERATION_STD_MPS2),
        linear_acceleration_covariance: variances(ACCELERATION_STD_MPS2),
    }
}

/// Steering and pedals.
pub fn control(stamp_ns: i64, action: &Action) -> CarlaEgoVehicleControl {
    CarlaEgoVehicleControl {
        header: header(stamp_ns, EGO),
        throttle: action.throttle,
        steer: action.steer,
        brake: action.brake,
        hand_brake: false,
        reverse: false,
        gear: 1,
        manual_gear_shift: false,
    }
}

/// The car's own report, with the control that reached it.
pub fn status(stamp_ns: i64, ego: &Car, applied: &Action) -> CarlaEgoVehicleStatus {
    CarlaEgoVehicleStatus {
        header: header(stamp_ns, WORLD),
        velocity: ego.velocity_ego_mps().length() as f32,
        acceleration: Accel {
            linear: DVec3::new(ego.acceleration_mps2, 0.0, 0.0),
            angular: DVec3::ZERO,
        },
        orientation: ego.orientation(),
        control: control(stamp_ns, applied),
    }
}

/// Where the sensors sit on the car.
pub fn static_transforms(stamp_ns: i64) -> TfMessage {
    let mounts = [
        (CAMERA, camera::ego_from_camera()),
        (LIDAR, lidar::ego_from_lidar()),
        (RADAR, radar::ego_from_radar()),
    ];
    let transforms =
        mounts.iter().map(|(child, mount)| transform(header(stamp_ns, EGO), child, mount));
    TfMessage { transforms: transforms.collect() }
}

/// The pose of an odometry message as a transform.
pub fn ego_transform(odometry: &Odometry) -> TfMessage {
    let Pose { position, orientation } = odometry.pose.pose;
    let world_from_ego = DAffine3::from_rotation_translation(orientation, position);
    TfMessage { transforms: vec![transform(odometry.header.clone(), EGO, &world_from_ego)] }
}

fn transform(header: Header, child: &str, parent_from_child: &DAffine3) -> TransformStamped {
    let (_, rotation, translation) = parent_from_child.to_scale_rotation_translation();
    // A quaternion and its negative are the same rotation; readers expect the one with w >= 0.
    let rotation = if rotation.w < 0.0 { -rotation } else { rotation };
    let transform = Transform { translation, rotation };
    TransformStamped { header, child_frame_id: child.to_owned(), transform }
}
