//! Logs as the rigs that pmp knows by name write them: a bend to the left at a constant speed, with
//! each rig's topics, types, frames and mounts.
#![allow(clippy::unwrap_used)]

use serde_json::{Value as Json, json};

use crate::{
    fixtures::{Cdr, Layout, Recorded, jpeg, mcap_bytes, ns},
    foxglove_fixtures::{Form, Told, base64, rotation, time, vector},
};

pub(crate) const SPEED_MPS: f64 = 5.0;
pub(crate) const YAW_RATE_RADPS: f64 = 0.2;
pub(crate) const SECONDS: f64 = 4.5;
const START_NS: i64 = 1_700_000_000_000_000_000;

/// The camera: this far ahead of the car's frame and above it, looking along its x axis.
pub(crate) const CAMERA_M: [f64; 3] = [1.5, 0.0, 1.25];
pub(crate) const FOCAL: f64 = 30.0;
pub(crate) const SIZE: [usize; 2] = [60, 25];

/// Points of every cloud, in the car's frame.
pub(crate) const POINTS: [[f64; 3]; 3] = [[21.5, 1.3, 1.0], [12.0, -2.2, 0.45], [31.5, 4.45, 2.9]];

/// The return of every radar, in the car's frame, and how fast it comes nearer along its line of
/// sight from the radar, which sits at the camera.
pub(crate) const RETURN: [f64; 3] = [26.5, -3.2, 1.1];
pub(crate) const CLOSING_MPS: f64 = -3.5;

/// Rotations as quaternions x, y, z, w: none, an optical frame on a car, a lidar whose x points to
/// the right and whose y points ahead.
pub(crate) const NONE: [f64; 4] = [0.0, 0.0, 0.0, 1.0];
pub(crate) const OPTICAL: [f64; 4] = [-0.5, 0.5, -0.5, 0.5];
const X_RIGHT: [f64; 4] =
    [0.0, 0.0, -std::f64::consts::FRAC_1_SQRT_2, std::f64::consts::FRAC_1_SQRT_2];

/// x, y and heading after some seconds.
pub(crate) fn pose(t: f64) -> [f64; 3] {
    let (radius, turned) = (SPEED_MPS / YAW_RATE_RADPS, YAW_RATE_RADPS * t);
    [radius * turned.sin(), radius * (1.0 - turned.cos()), turned]
}

pub(crate) fn yaw_quaternion(yaw: f64) -> [f64; 4] {
    [0.0, 0.0, (yaw / 2.0).sin(), (yaw / 2.0).cos()]
}

/// Instants of a rate over the drive.
pub(crate) fn at_rate(rate_hz: f64) -> impl Iterator<Item = f64> {
    (0..=(SECONDS * rate_hz).round() as usize).map(move |i| i as f64 / rate_hz)
}

/// A point of the car's frame in that of a sensor that sits at `origin` with the same axes.
fn from(origin: [f64; 3], point: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|i| point[i] - origin[i])
}

/// ROS 2 messages of a log.
#[derive(Default)]
pub(crate) struct Messages(Vec<Recorded>);

impl Messages {
    pub(crate) fn add(
        &mut self,
        topic: &'static str,
        type_name: &'static str,
        t: f64,
        cdr: &mut Cdr,
    ) {
        let log_time_ns = START_NS + ns(t);
        self.0.push(Recorded { topic, type_name, log_time_ns, data: cdr.finish() });
    }

    pub(crate) fn bytes(mut self) -> Vec<u8> {
        self.0.sort_by_key(|message| message.log_time_ns);
        mcap_bytes(&self.0, &Layout::default())
    }

    pub(crate) fn odometry(&mut self, topic: &'static str, frames: [&str; 2], t: f64) {
        let [x, y, yaw] = pose(t);
        let twist = [SPEED_MPS, 0.0, 0.0, 0.0, 0.0, YAW_RATE_RADPS];
        self.odometry_of(topic, frames, t, [x, y, 0.0], yaw_quaternion(yaw), twist);
    }

    pub(crate) fn odometry_of(
        &mut self,
        topic: &'static str,
        [frame, child]: [&str; 2],
        t: f64,
        position: [f64; 3],
        turn: [f64; 4],
        twist: [f64; 6],
    ) {
        let mut cdr = header(t, frame);
        cdr.text(child).f64s(&position).f64s(&turn).f64s(&[0.0; 36]);
        cdr.f64s(&twist).f64s(&[0.0; 36]);
        self.add(topic, "nav_msgs/Odometry", t, &mut cdr);
    }

    pub(crate) fn twist(&mut self, topic: &'static str, frame: &str, t: f64, twist: [f64; 6]) {
        self.add(topic, "geometry_msgs/TwistStamped", t, header(t, frame).f64s(&twist));
    }

    /// An IMU without an attitude, where `attitude` is none.
    pub(crate) fn imu(
        &mut self,
        topic: &'static str,
        frame: &str,
        t: f64,
        attitude: Option<[f64; 4]>,
        turn: [f64; 3],
    ) {
        let mut covariance = [0.0; 9];
        covariance[0] = if attitude.is_some() { 0.0 } else { -1.0 };
        let mut cdr = header(t, frame);
        cdr.f64s(&attitude.unwrap_or([0.0; 4])).f64s(&covariance);
        cdr.f64s(&turn).f64s(&[0.0; 9]).f64s(&[0.0; 3]).f64s(&[0.0; 9]);
        self.add(topic, "sensor_msgs/Imu", t, &mut cdr);
    }

    pub(crate) fn fix(&mut self, topic: &'static str, t: f64, status: i8, place: [f64; 3]) {
        let mut cdr = header(t, "gps");
        cdr.u8(status as u8).number(1_u16.to_le_bytes()).f64s(&place).f64s(&[0.0; 9]).u8(0);
        self.add(topic, "sensor_msgs/NavSatFix", t, &mut cdr);
    }

    pub(crate) fn transform(
        &mut self,
        topic: &'static str,
        frames: [&str; 2],
        t: f64,
        place: [f64; 3],
        turn: [f64; 4],
    ) {
        let mut cdr = Cdr::new(false);
        cdr.u32(1).header(START_NS + ns(t), frames[0]).text(frames[1]).f64s(&place).f64s(&turn);
        self.add(topic, "tf2_msgs/TFMessage", t, &mut cdr);
    }

    pub(crate) fn camera(&mut self, [image, info]: [&'static str; 2], frame: &str, t: f64) {
        let [width, height] = SIZE;
        if image.contains("compressed") {
            let mut cdr = header(t, frame);
            cdr.text("jpeg").bytes(&jpeg(width, height, 100));
            self.add(image, "sensor_msgs/CompressedImage", t, &mut cdr);
        } else {
            let mut cdr = header(t, frame);
            cdr.u32(height as u32).u32(width as u32).text("bgr8").u8(0).u32(3 * width as u32);
            cdr.bytes(&vec![100; 3 * width * height]);
            self.add(image, "sensor_msgs/Image", t, &mut cdr);
        }
        let (cx, cy) = (width as f64 / 2.0, height as f64 / 2.0);
        let mut cdr = header(t, frame);
        cdr.u32(height as u32).u32(width as u32).text("plumb_bob").u32(5).f64s(&[0.0; 5]);
        cdr.f64s(&[FOCAL, 0.0, cx, 0.0, FOCAL, cy, 0.0, 0.0, 1.0]);
        cdr.f64s(&[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]);
        cdr.f64s(&[FOCAL, 0.0, cx, 0.0, 0.0, FOCAL, cy, 0.0, 0.0, 0.0, 1.0, 0.0]);
        cdr.u32(0).u32(0).u32(0).u32(0).u32(0).u32(0).u8(0);
        self.add(info, "sensor_msgs/CameraInfo", t, &mut cdr);
    }

    /// A cloud of 32-bit floats at these offsets.
    pub(crate) fn cloud(
        &mut self,
        topic: &'static str,
        frame: &str,
        t: f64,
        layout: (&[(&str, usize)], usize),
        points: &[Vec<f64>],
    ) {
        let (fields, step) = layout;
        let mut cdr = header(t, frame);
        cdr.u32(1).u32(points.len() as u32).u32(fields.len() as u32);
        for (name, offset) in fields {
            cdr.text(name).u32(*offset as u32).u8(7).u32(1);
        }
        let mut data = vec![0; step * points.len()];
        for (point, bytes) in points.iter().zip(data.chunks_exact_mut(step)) {
            for (value, (_, offset)) in point.iter().zip(fields) {
                bytes[*offset..offset + 4].copy_from_slice(&(*value as f32).to_le_bytes());
            }
        }
        cdr.u8(0).u32(step as u32).u32(data.len() as u32).bytes(&data).u8(1);
        self.add(topic, "sensor_msgs/PointCloud2", t, &mut cdr);
    }

    /// The points of the drive, from a lidar at this place with the car's axes.
    pub(crate) fn lidar(&mut self, topic: &'static str, frame: &str, t: f64, place: [f64; 3]) {
        let points: Vec<_> = POINTS.iter().map(|point| from(place, *point).to_vec()).collect();
        let fields = [("x", 0), ("y", 4), ("z", 8), ("intensity", 12)];
        self.cloud(topic, frame, t, (&fields, 16), &points);
    }

    fn scan(&mut self, topic: &'static str, frame: &str, t: f64) {
        let [x, y, z] = from(CAMERA_M, RETURN);
        let (range, flat) = ((x * x + y * y + z * z).sqrt(), x.hypot(y));
        let mut cdr = header(t, frame);
        cdr.u32(1).f32(range as f32).f32(y.atan2(x) as f32).f32(z.atan2(flat) as f32);
        cdr.f32(CLOSING_MPS as f32).f32(1.0);
        self.add(topic, "radar_msgs/RadarScan", t, &mut cdr);
    }

    pub(crate) fn path(&mut self, topic: &'static str, frame: &str, t: f64, points: &[[f64; 2]]) {
        let mut cdr = header(t, frame);
        cdr.u32(points.len() as u32);
        for [x, y] in points {
            cdr.header(START_NS + ns(t), frame).f64s(&[*x, *y, 0.0]).f64s(&NONE);
        }
        self.add(topic, "nav_msgs/Path", t, &mut cdr);
    }

    /// Throttle 0.25, steering -0.5 (left), brake 0.125.
    fn carla_control(&mut self, topic: &'static str, t: f64) {
        let mut cdr = header(t, "");
        cdr.f32(0.25).f32(-0.5).f32(0.125).u8(0).u8(0).i32(1).u8(0);
        self.add(topic, "carla_msgs/CarlaEgoVehicleControl", t, &mut cdr);
    }

    fn carla_status(&mut self, topic: &'static str, t: f64) {
        let mut cdr = header(t, "map");
        cdr.f32(SPEED_MPS as f32).f64s(&[0.0; 6]).f64s(&yaw_quaternion(pose(t)[2]));
        cdr.header(START_NS + ns(t), "").f32(0.25).f32(-0.5).f32(0.125).u8(0).u8(0).i32(1).u8(0);
        self.add(topic, "carla_msgs/CarlaEgoVehicleStatus", t, &mut cdr);
    }
}

pub(crate) fn header(t: f64, frame: &str) -> Cdr {
    let mut cdr = Cdr::new(false);
    cdr.header(START_NS + ns(t), frame);
    cdr
}

/// The bridge's radar cloud: angles of the simulator, a hole before the last field.
pub(crate) const CARLA_RADAR_FIELDS: [(&str, usize); 7] = [
    ("x", 0),
    ("y", 4),
    ("z", 8),
    ("Range", 12),
    ("Velocity", 16),
    ("AzimuthAngle", 20),
    ("ElevationAngle", 28),
];

/// The radar's return as a point of that cloud.
pub(crate) fn carla_radar_point() -> Vec<f64> {
    let [x, y, z] = from(CAMERA_M, RETURN);
    let (range, flat) = ((x * x + y * y + z * z).sqrt(), x.hypot(y));
    vec![x, y, z, range, CLOSING_MPS, -y.atan2(x), z.atan2(flat)]
}

pub(crate) fn carla() -> Vec<u8> {
    let mut log = Messages::default();
    let mut world = Cdr::new(false);
    log.add("/carla/world_info", "carla_msgs/CarlaWorldInfo", 0.0, {
        world.text("Carla/Maps/Town03").text("<OpenDRIVE/>")
    });
    // SoftRainSunset: cloudiness, rain, deposits, wind, fog (two), wetness, azimuth, altitude.
    let mut weather = Cdr::new(false);
    for value in [20.0, 30.0, 50.0, 30.0, 2.0, 0.75, 0.0, -1.0, 15.0] {
        weather.f32(value);
    }
    log.add("/carla/weather", "carla_msgs/CarlaWeatherParameters", 0.0, &mut weather);
    let circle: Vec<[f64; 2]> =
        (0..40).map(|i| pose(f64::from(i) * 0.4)).map(|p| [p[0], p[1]]).collect();
    log.path("/carla/hero/waypoints", "map", 0.0, &circle);
    for t in at_rate(20.0) {
        log.odometry("/carla/hero/odometry", ["map", "hero"], t);
        let [x, y, yaw] = pose(t);
        log.transform("/tf", ["map", "hero"], t, [x, y, 0.0], yaw_quaternion(yaw));
        // The bridge takes mounts from world coordinates, and rounds them differently each time.
        let rounded = [CAMERA_M[0] + 1e-5 * (7.0 * t).sin(), CAMERA_M[1], CAMERA_M[2]];
        log.transform("/tf", ["hero", "hero/rgb_front"], t, rounded, OPTICAL);
        log.transform("/tf", ["hero", "hero/lidar"], t, [0.0, 0.0, 2.4], NONE);
        log.transform("/tf", ["hero", "hero/radar_front"], t, CAMERA_M, NONE);
        log.carla_status("/carla/hero/vehicle_status", t);
        log.carla_control("/carla/hero/vehicle_control_cmd", t);
    }
    for t in at_rate(10.0) {
        let front = ["/carla/hero/rgb_front/image", "/carla/hero/rgb_front/camera_info"];
        log.camera(front, "hero/rgb_front", t);
        log.camera(
            ["/carla/hero/rgb_view/image", "/carla/hero/rgb_view/camera_info"],
            "hero/rgb_view",
            t,
        );
        log.lidar("/carla/hero/lidar", "hero/lidar", t, [0.0, 0.0, 2.4]);
        log.lidar("/carla/hero/semantic_lidar", "hero/semantic_lidar", t, [0.0, 0.0, 2.4]);
        let radar = (CARLA_RADAR_FIELDS.as_slice(), 32);
        log.cloud("/carla/hero/radar_front", "hero/radar_front", t, radar, &[carla_radar_point()]);
    }
    log.bytes()
}

pub(crate) fn kitti() -> Vec<u8> {
    let imu_m = [-1.405, 0.32, 0.93];
    let mut log = Messages::default();
    log.transform("/tf_static", ["base_link", "imu_link"], 0.0, imu_m, NONE);
    log.transform("/tf_static", ["imu_link", "velo_link"], 0.0, from(imu_m, [0.0, 0.0, 1.7]), NONE);
    log.transform(
        "/tf_static",
        ["imu_link", "camera_color_left"],
        0.0,
        from(imu_m, CAMERA_M),
        OPTICAL,
    );
    let right = from(imu_m, [1.5, -0.54, 1.25]);
    log.transform("/tf_static", ["imu_link", "camera_color_right"], 0.0, right, OPTICAL);
    for t in at_rate(10.0) {
        let [x, y, yaw] = pose(t);
        log.transform("/tf", ["world", "base_link"], t, [x, y, 0.0], yaw_quaternion(yaw));
        // The unit sits off the car's origin, and so moves otherwise than it.
        let [forward, left] = [SPEED_MPS - YAW_RATE_RADPS * imu_m[1], YAW_RATE_RADPS * imu_m[0]];
        let twist = [forward, left, 0.0, 0.0, 0.0, YAW_RATE_RADPS];
        log.twist("/kitti/oxts/gps/vel", "imu_link", t, twist);
        log.imu(
            "/kitti/oxts/imu",
            "imu_link",
            t,
            Some(yaw_quaternion(yaw)),
            [0.0, 0.0, YAW_RATE_RADPS],
        );
        log.fix("/kitti/oxts/gps/fix", t, 0, [49.0, 8.4, 116.0]);
        let left = ["/kitti/camera_color_left/image_raw", "/kitti/camera_color_left/camera_info"];
        log.camera(left, "camera_color_left", t);
        let right =
            ["/kitti/camera_color_right/image_raw", "/kitti/camera_color_right/camera_info"];
        log.camera(right, "camera_color_right", t);
        log.lidar("/kitti/velo/pointcloud", "velo_link", t, [0.0, 0.0, 1.7]);
    }
    log.bytes()
}

pub(crate) fn autoware() -> Vec<u8> {
    let mut log = Messages::default();
    log.transform(
        "/tf_static",
        ["base_link", "camera0/camera_optical_link"],
        0.0,
        CAMERA_M,
        OPTICAL,
    );
    log.transform("/tf_static", ["base_link", "radar"], 0.0, CAMERA_M, NONE);
    for t in at_rate(20.0) {
        log.odometry("/localization/kinematic_state", ["map", "base_link"], t);
        let mut velocity = header(t, "base_link");
        velocity.f32(SPEED_MPS as f32).f32(0.0).f32(YAW_RATE_RADPS as f32);
        let topic = "/vehicle/status/velocity_status";
        log.add(topic, "autoware_vehicle_msgs/VelocityReport", t, &mut velocity);
        // A bare stamp; half of the sample vehicle's lock, to the left.
        let mut steering = Cdr::new(false);
        let stamp_ns = START_NS + ns(t);
        steering.i32((stamp_ns / 1_000_000_000) as i32).u32((stamp_ns % 1_000_000_000) as u32);
        steering.f32(0.35);
        let topic = "/vehicle/status/steering_status";
        log.add(topic, "autoware_vehicle_msgs/SteeringReport", t, &mut steering);
        let mut pedals = header(t, "base_link");
        pedals.f64s(&[0.25, 0.125, 0.0]);
        let topic = "/vehicle/status/actuation_status";
        log.add(topic, "tier4_vehicle_msgs/ActuationStatusStamped", t, &mut pedals);
    }
    for t in at_rate(10.0) {
        let front = [
            "/sensing/camera/camera0/image_rect_color/compressed",
            "/sensing/camera/camera0/camera_info",
        ];
        log.camera(front, "camera0/camera_optical_link", t);
        let side = [
            "/sensing/camera/camera1/image_rect_color/compressed",
            "/sensing/camera/camera1/camera_info",
        ];
        log.camera(side, "camera1/camera_optical_link", t);
        log.lidar("/sensing/lidar/concatenated/pointcloud", "base_link", t, [0.0; 3]);
        log.scan("/sensing/radar/front_center/objects_raw", "radar", t);
    }
    log.bytes()
}

/// Without odometry: the car's own speed and an IMU are all that says how it moves.
pub(crate) fn comma() -> Vec<u8> {
    let mut log = Messages::default();
    log.transform("/tf_static", ["base_link", "camera_front"], 0.0, CAMERA_M, OPTICAL);
    log.transform("/tf_static", ["base_link", "radar_front"], 0.0, CAMERA_M, NONE);
    for t in at_rate(50.0) {
        log.twist("/vehicle/speed", "base_link", t, [SPEED_MPS, 0.0, 0.0, 0.0, 0.0, 0.0]);
        log.imu("/imu", "imu", t, None, [0.0, 0.0, YAW_RATE_RADPS]);
        let mut steering = header(t, "");
        steering.f32(0.1).f32(0.0).f32(0.0).f32(0.0).f32(0.0);
        log.add("/vehicle/steering", "ackermann_msgs/AckermannDriveStamped", t, &mut steering);
        log.carla_control("/vehicle/control", t);
    }
    for t in at_rate(10.0) {
        let camera = ["/camera/front/image/compressed", "/camera/front/camera_info"];
        log.camera(camera, "camera_front", t);
        log.scan("/radar/front", "radar_front", t);
    }
    log.bytes()
}

pub(crate) fn pmp() -> Vec<u8> {
    let mut log = Messages::default();
    let mounts = [("camera_front_optical", CAMERA_M, OPTICAL), ("radar_front", CAMERA_M, NONE)];
    for (frame, place, turn) in mounts {
        log.transform("/tf_static", ["base_link", frame], 0.0, place, turn);
    }
    log.transform("/tf_static", ["base_link", "lidar_top"], 0.0, [0.0, 0.0, 1.8], NONE);
    for t in at_rate(20.0) {
        log.odometry("/odom", ["odom", "base_link"], t);
        log.carla_control("/vehicle/control", t);
        log.carla_status("/vehicle/status", t);
    }
    for t in at_rate(10.0) {
        let camera = ["/camera/front/image/compressed", "/camera/front/camera_info"];
        log.camera(camera, "camera_front_optical", t);
        log.lidar("/lidar/points", "lidar_top", t, [0.0, 0.0, 1.8]);
        log.scan("/radar/front", "radar_front", t);
    }
    log.bytes()
}

/// A packed cloud of 32-bit floats.
fn packed(names: &[&str], points: &[Vec<f64>]) -> Json {
    let field = |(i, name): (usize, &&str)| json!({"name": name, "offset": 4 * i, "type": 7});
    let data: Vec<u8> =
        points.iter().flatten().flat_map(|value| (*value as f32).to_le_bytes()).collect();
    json!({
        "point_stride": 4 * names.len(),
        "fields": names.iter().enumerate().map(field).collect::<Vec<_>>(),
        "data": base64(&data),
    })
}

/// As foxglove/nuscenes2mcap writes it: mounts on `/tf` again and again, a pose that is none, a
/// lidar whose y axis points ahead, a radar that tells velocities and not radial speeds.
pub(crate) fn nuscenes() -> Vec<u8> {
    let mut messages = Vec::new();
    let mut tell = |topic, type_name, t: f64, frame: &str, mut values: Json| {
        let stamp_ns = START_NS + ns(t);
        values["timestamp"] = time(stamp_ns);
        values["frame_id"] = json!(frame);
        messages.push(Told { topic, type_name, log_time_ns: stamp_ns, values });
    };
    let transform = |parent: &str, child: &str, place: [f64; 3], turn: [f64; 4]| {
        json!({
            "parent_frame_id": parent, "child_frame_id": child,
            "translation": vector(place), "rotation": rotation(turn),
        })
    };
    for t in at_rate(20.0) {
        let [x, y, yaw] = pose(t);
        let ego = transform("map", "base_link", [x + 400.0, y + 1100.0, 0.0], yaw_quaternion(yaw));
        tell("/tf", "FrameTransform", t, "", ego);
    }
    for t in at_rate(2.0) {
        for camera in ["cam_front", "cam_front_left"] {
            tell("/tf", "FrameTransform", t, "", transform("base_link", camera, CAMERA_M, OPTICAL));
        }
        let lidar = transform("base_link", "lidar_top", [0.0, 0.0, 1.84], X_RIGHT);
        tell("/tf", "FrameTransform", t, "", lidar);
        let radar = transform("base_link", "radar_front", CAMERA_M, NONE);
        tell("/tf", "FrameTransform", t, "", radar);
        let none = json!({"position": vector([0.0; 3]), "orientation": rotation(NONE)});
        tell("/pose", "PoseInFrame", t, "base_link", json!({"pose": none}));
    }
    for t in at_rate(10.0) {
        let [width, height] = SIZE;
        let (cx, cy) = (width as f64 / 2.0, height as f64 / 2.0);
        let cameras = [
            ("/cam_front/image_rect_compressed", "/cam_front/camera_info", "cam_front"),
            (
                "/cam_front_left/image_rect_compressed",
                "/cam_front_left/camera_info",
                "cam_front_left",
            ),
        ];
        for (image, info, frame) in cameras {
            let picture = base64(&jpeg(width, height, 100));
            tell(image, "CompressedImage", t, frame, json!({"format": "jpeg", "data": picture}));
            // The converter leaves out the distortion.
            let calibration = json!({
                "width": width, "height": height, "distortion_model": "", "D": [],
                "K": [FOCAL, 0.0, cx, 0.0, FOCAL, cy, 0.0, 0.0, 1.0],
                "R": [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
                "P": [FOCAL, 0.0, cx, 0.0, 0.0, FOCAL, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
            });
            tell(info, "CameraCalibration", t, frame, calibration);
        }
        let points = POINTS.map(|[x, y, z]| vec![-y, x, z - 1.84, 0.5, 3.0]);
        let lidar = packed(&["x", "y", "z", "intensity", "ring"], &points);
        tell("/lidar_top", "PointCloud", t, "lidar_top", lidar);
        let [x, y, z] = from(CAMERA_M, RETURN);
        let range = (x * x + y * y + z * z).sqrt();
        // A velocity across the line of sight, besides what comes nearer along it.
        let along = CLOSING_MPS * range / (x * x + y * y);
        let (vx, vy) = (along * x - 0.7 * y, along * y + 0.7 * x);
        let radar = packed(&["x", "y", "z", "vx", "vy"], &[vec![x, y, z, vx, vy]]);
        tell("/radar_front", "PointCloud", t, "radar_front", radar);
    }
    messages.sort_by_key(|message| message.log_time_ns);
    Form::Protobuf.log(&messages)
}
