//! Readings as ROS 2 messages, under the names and in the frames of CARLA's ROS bridge
//! (`docs/ros_sensors.md` in <https://github.com/carla-simulator/ros-bridge>).

use glam::{DAffine3, DQuat, DVec3};

use crate::{
    log::encode::{
        Accel, CameraInfo, CarlaEgoVehicleControl, CarlaEgoVehicleStatus, CarlaWeatherParameters,
        CarlaWorldInfo, CompressedImage, Header, Imu, NavSatFix, NavSatStatus, ObjectArray,
        Odometry, Path, PointCloud2, PointField, Polygon, Pose, PoseStamped, PoseWithCovariance,
        RegionOfInterest, Situation, SolidPrimitive, TfMessage, Transform, TransformStamped, Twist,
        TwistWithCovariance,
    },
    policy::Action,
    projection::Camera,
    scene::conditions::{Illumination, Weather},
    sensors::{gnss::GnssFix, imu::ImuReading, odometry::OdometryReading},
    sim::{
        clouds::{self, Number, Packed},
        message::{Sent, planar_covariance},
        plan::Episode,
        reading::{self, Object, ObjectKind, Reading},
        rig::{Mounted, Rig},
    },
    world::{ego::Car, kind::VehicleKind},
};

/// The topic of the controls that moved the car.
pub const APPLIED_CONTROL: &str = "/carla/ego_vehicle/vehicle_status";

const WORLD: &str = "map";
const EGO: &str = "ego_vehicle";

fn frame(mounted: Mounted) -> &'static str {
    match mounted {
        Mounted::Camera => "ego_vehicle/rgb_front",
        Mounted::Lidar => "ego_vehicle/lidar",
        Mounted::Radar => "ego_vehicle/radar_front",
        Mounted::Gnss => "ego_vehicle/gnss",
    }
}

/// Told once: where the sensors sit on the car, the town and the weather.
pub fn at_start(stamp_ns: i64, rig: &Rig, episode: &Episode) -> Vec<Sent> {
    let mounts = rig.mounts();
    let transforms = mounts
        .iter()
        .map(|(mounted, mount)| transform(header(stamp_ns, EGO), frame(*mounted), mount))
        .collect();
    // The map's text would be megabytes in each log.
    let world = CarlaWorldInfo { map_name: episode.town.clone(), opendrive: String::new() };
    vec![
        Sent::new("/tf_static", TfMessage { transforms }),
        Sent::new("/carla/world_info", world),
        Sent::new("/carla/weather", weather(episode)),
    ]
}

/// A reading as messages.
pub fn messages(stamp_ns: i64, reading: &Reading, rig: &Rig) -> Vec<Sent> {
    match reading {
        Reading::Picture(jpeg) => {
            let header = header(stamp_ns, frame(Mounted::Camera));
            let image = CompressedImage { header, format: "jpeg".into(), data: jpeg.clone() };
            vec![
                Sent::new("/carla/ego_vehicle/rgb_front/image/compressed", image),
                Sent::new(
                    "/carla/ego_vehicle/rgb_front/camera_info",
                    camera_info(stamp_ns, &rig.camera.intrinsics),
                ),
            ]
        }
        Reading::Lidar(returns) => {
            let cloud = cloud(stamp_ns, Mounted::Lidar, clouds::of_lidar(returns, false));
            vec![Sent::new("/carla/ego_vehicle/lidar", cloud)]
        }
        Reading::Radar(returns) => {
            let cloud = cloud(stamp_ns, Mounted::Radar, clouds::of_radar_as_carla(returns));
            vec![Sent::new("/carla/ego_vehicle/radar_front", cloud)]
        }
        Reading::Odometry(reading) => {
            let world_from_ego =
                DAffine3::from_rotation_translation(reading.orientation, reading.position_m);
            let transforms = vec![transform(header(stamp_ns, WORLD), EGO, &world_from_ego)];
            vec![
                Sent::new("/tf", TfMessage { transforms }),
                Sent::new("/carla/ego_vehicle/odometry", odometry(stamp_ns, reading, rig)),
            ]
        }
        Reading::Imu(reading) => {
            vec![Sent::new("/carla/ego_vehicle/imu", imu(stamp_ns, reading, rig))]
        }
        Reading::Fix(reading) => vec![Sent::new("/carla/ego_vehicle/gnss", fix(stamp_ns, reading))],
        Reading::Control { wanted, applied, car } => vec![
            Sent::new("/carla/ego_vehicle/vehicle_control_cmd", control(stamp_ns, wanted)),
            Sent::new(APPLIED_CONTROL, status(stamp_ns, car, applied)),
        ],
        Reading::Situation { in_junction, speed_limit_mps, command } => {
            let situation = Situation {
                header: header(stamp_ns, EGO),
                in_junction: *in_junction,
                speed_limit_mps: *speed_limit_mps as f32,
                command: command.name().into(),
            };
            vec![Sent::new("/carla/ego_vehicle/situation", situation)]
        }
        Reading::Route(poses) => {
            let stamped = |place: &reading::Pose| PoseStamped {
                header: header(stamp_ns, WORLD),
                pose: pose(place),
            };
            let poses = poses.iter().map(stamped).collect();
            let path = Path { header: header(stamp_ns, WORLD), poses };
            vec![Sent::new("/carla/ego_vehicle/waypoints", path)]
        }
        Reading::Objects(objects) => {
            let objects = objects.iter().map(|object| box_of(stamp_ns, object)).collect();
            let array = ObjectArray { header: header(stamp_ns, WORLD), objects };
            vec![Sent::new("/carla/ego_vehicle/objects", array)]
        }
    }
}

fn header(stamp_ns: i64, frame: &str) -> Header {
    Header { stamp_ns, frame_id: frame.to_owned() }
}

fn pose(pose: &reading::Pose) -> Pose {
    Pose { position: pose.position_m, orientation: with_positive_w(pose.orientation) }
}

/// A quaternion and its negative are the same rotation; readers expect the one with w >= 0.
fn with_positive_w(rotation: DQuat) -> DQuat {
    if rotation.w < 0.0 { -rotation } else { rotation }
}

fn transform(header: Header, child: &str, parent_from_child: &DAffine3) -> TransformStamped {
    let (_, rotation, translation) = parent_from_child.to_scale_rotation_translation();
    let transform = Transform { translation, rotation: with_positive_w(rotation) };
    TransformStamped { header, child_frame_id: child.to_owned(), transform }
}

/// The preset of CARLA 0.9.16 that is nearest: rain, wetness and the height of the sun.
fn weather(episode: &Episode) -> CarlaWeatherParameters {
    let (cloudiness, precipitation, wetness) = match episode.sky.weather {
        Weather::Clear => (5.0, 0.0, 0.0),
        Weather::Drizzle => (20.0, 30.0, 50.0),
        Weather::Rainy => (60.0, 60.0, 60.0),
        Weather::Storm => (100.0, 100.0, 100.0),
    };
    let sun_altitude_angle = match episode.sky.illumination {
        Illumination::Daytime => 45.0,
        Illumination::Sunset => 15.0,
        Illumination::Night | Illumination::Dark => -90.0,
    };
    CarlaWeatherParameters {
        cloudiness,
        precipitation,
        precipitation_deposits: wetness,
        wind_intensity: precipitation,
        fog_density: 0.0,
        fog_distance: 0.0,
        wetness,
        sun_azimuth_angle: 0.0,
        sun_altitude_angle,
    }
}

fn camera_info(stamp_ns: i64, intrinsics: &Camera) -> CameraInfo {
    let Camera { width, height, fx, fy, cx, cy, .. } = *intrinsics;
    let (width, height) = (width as u32, height as u32);
    CameraInfo {
        header: header(stamp_ns, frame(Mounted::Camera)),
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

fn cloud(stamp_ns: i64, mounted: Mounted, points: Packed) -> PointCloud2 {
    const UINT16: u8 = 4;
    const FLOAT32: u8 = 7;
    let field = |(name, offset, number): &(&str, u32, Number)| PointField {
        name: (*name).into(),
        offset: *offset,
        datatype: match number {
            Number::F32 => FLOAT32,
            Number::U16 => UINT16,
        },
        count: 1,
    };
    PointCloud2 {
        header: header(stamp_ns, frame(mounted)),
        height: 1,
        width: points.points(),
        fields: points.fields.iter().map(field).collect(),
        is_bigendian: false,
        point_step: points.point_bytes,
        row_step: points.data.len() as u32,
        data: points.data,
        is_dense: true,
    }
}

fn odometry(stamp_ns: i64, reading: &OdometryReading, rig: &Rig) -> Odometry {
    let config = &rig.odometry;
    Odometry {
        header: header(stamp_ns, WORLD),
        child_frame_id: EGO.into(),
        pose: PoseWithCovariance {
            pose: Pose {
                position: reading.position_m,
                orientation: with_positive_w(reading.orientation),
            },
            covariance: planar_covariance(config.position_std_m, config.yaw_std_rad),
        },
        twist: TwistWithCovariance {
            twist: Twist {
                linear: reading.velocity_mps,
                angular: DVec3::Z * reading.yaw_rate_radps,
            },
            covariance: planar_covariance(config.velocity_std_mps, config.yaw_rate_std_radps),
        },
    }
}

fn diagonal(variances: DVec3) -> [f64; 9] {
    DAffine3::from_scale(variances).matrix3.to_cols_array()
}

fn imu(stamp_ns: i64, reading: &ImuReading, rig: &Rig) -> Imu {
    let config = &rig.imu;
    let covariance = |std: f64| diagonal(DVec3::splat(std * std));
    Imu {
        header: header(stamp_ns, EGO),
        orientation: with_positive_w(reading.orientation),
        orientation_covariance: diagonal(DVec3::Z * config.yaw_std_rad * config.yaw_std_rad),
        angular_velocity: reading.turn_radps,
        angular_velocity_covariance: covariance(config.turn_std_radps),
        linear_acceleration: reading.acceleration_mps2,
        linear_acceleration_covariance: covariance(config.acceleration_std_mps2),
    }
}

fn fix(stamp_ns: i64, reading: &GnssFix) -> NavSatFix {
    const GPS: u16 = 1;
    const DIAGONAL_KNOWN: u8 = 2;
    NavSatFix {
        header: header(stamp_ns, frame(Mounted::Gnss)),
        status: NavSatStatus { status: 0, service: GPS },
        latitude: reading.latitude_deg,
        longitude: reading.longitude_deg,
        altitude: reading.altitude_m,
        position_covariance: diagonal(reading.std_m * reading.std_m),
        position_covariance_type: DIAGONAL_KNOWN,
    }
}

fn control(stamp_ns: i64, action: &Action) -> CarlaEgoVehicleControl {
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
fn status(stamp_ns: i64, car: &Car, applied: &Action) -> CarlaEgoVehicleStatus {
    CarlaEgoVehicleStatus {
        header: header(stamp_ns, WORLD),
        velocity: car.velocity_ego_mps().length() as f32,
        acceleration: Accel { linear: DVec3::X * car.acceleration_mps2, angular: DVec3::ZERO },
        orientation: with_positive_w(car.orientation()),
        control: control(stamp_ns, applied),
    }
}

fn box_of(stamp_ns: i64, object: &Object) -> crate::log::encode::Object {
    const TRACKED: u8 = 1;
    const BOX: u8 = 1;
    let classification = match object.kind {
        ObjectKind::Walker(_) => 4,
        ObjectKind::Vehicle(VehicleKind::Bicycle) => 5,
        ObjectKind::Vehicle(VehicleKind::Car | VehicleKind::Jeep | VehicleKind::Van) => 6,
        ObjectKind::Vehicle(VehicleKind::Truck | VehicleKind::Bus) => 7,
        ObjectKind::Vehicle(VehicleKind::Motorcycle) => 8,
    };
    crate::log::encode::Object {
        header: header(stamp_ns, WORLD),
        id: object.id,
        detection_level: TRACKED,
        object_classified: true,
        pose: pose(&object.pose),
        twist: Twist { linear: object.velocity_mps.extend(0.0), angular: DVec3::ZERO },
        accel: Accel { linear: DVec3::ZERO, angular: DVec3::ZERO },
        polygon: Polygon { points: Vec::new() },
        shape: SolidPrimitive { r#type: BOX, dimensions: object.size_m.to_array().to_vec() },
        classification,
        classification_certainty: u8::MAX,
        classification_age: 0,
    }
}
