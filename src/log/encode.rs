//! ROS 2 messages as bytes: XCDR1, as every ROS 2 recorder stores them.
//!
//! A message type is a struct whose fields stand in the order of its definition; what is written
//! follows from that list alone.

use glam::{DQuat, DVec3};

use crate::log::definitions::definition;

/// Byte order of a message; ROS 2 on today's machines writes little.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Endian {
    #[default]
    Little,
    Big,
}

/// Bytes of the encapsulation header; alignment counts from behind it.
const ENCAPSULATION_BYTES: usize = 4;

/// A message under construction.
#[derive(Debug)]
pub struct Cdr {
    bytes: Vec<u8>,
    endian: Endian,
}

impl Cdr {
    fn new(endian: Endian) -> Self {
        let id = match endian {
            Endian::Little => 1,
            Endian::Big => 0,
        };
        Cdr { bytes: vec![0, id, 0, 0], endian }
    }

    /// A number of `N` bytes, given in little-endian order, aligned to its own size.
    fn put<const N: usize>(&mut self, mut number: [u8; N]) {
        while !(self.bytes.len() - ENCAPSULATION_BYTES).is_multiple_of(N) {
            self.bytes.push(0);
        }
        if self.endian == Endian::Big {
            number.reverse();
        }
        self.bytes.extend_from_slice(&number);
    }
}

/// Something that can stand in a message.
pub trait Field: Sized {
    fn put(&self, cdr: &mut Cdr);

    /// The elements of an array or sequence, one after the other.
    fn put_all(items: &[Self], cdr: &mut Cdr) {
        for item in items {
            item.put(cdr);
        }
    }
}

macro_rules! number_fields {
    ($($number:ty),*) => {$(
        impl Field for $number {
            fn put(&self, cdr: &mut Cdr) {
                cdr.put(self.to_le_bytes());
            }
        }
    )*};
}
number_fields!(i8, u16, i32, u32, f32, f64);

impl Field for u8 {
    fn put(&self, cdr: &mut Cdr) {
        cdr.put([*self]);
    }

    fn put_all(items: &[Self], cdr: &mut Cdr) {
        cdr.bytes.extend_from_slice(items);
    }
}

impl Field for bool {
    fn put(&self, cdr: &mut Cdr) {
        cdr.put([u8::from(*self)]);
    }
}

impl Field for String {
    fn put(&self, cdr: &mut Cdr) {
        (self.len() as u32 + 1).put(cdr);
        cdr.bytes.extend_from_slice(self.as_bytes());
        cdr.bytes.push(0);
    }
}

impl<T: Field> Field for Vec<T> {
    fn put(&self, cdr: &mut Cdr) {
        (self.len() as u32).put(cdr);
        T::put_all(self, cdr);
    }
}

impl<T: Field, const N: usize> Field for [T; N] {
    fn put(&self, cdr: &mut Cdr) {
        T::put_all(self, cdr);
    }
}

/// `geometry_msgs/Vector3` and `geometry_msgs/Point`.
impl Field for DVec3 {
    fn put(&self, cdr: &mut Cdr) {
        self.to_array().put(cdr);
    }
}

/// `geometry_msgs/Quaternion`: x, y, z, w.
impl Field for DQuat {
    fn put(&self, cdr: &mut Cdr) {
        self.to_array().put(cdr);
    }
}

/// What a log says of a message type, so that readers need not know it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Definition {
    /// Of the definition and of the messages, by MCAP's well-known names.
    pub schema_encoding: &'static str,
    pub message_encoding: &'static str,
    pub data: Vec<u8>,
}

/// A whole message, as a topic carries it.
pub trait Message: Send {
    /// Name of the type: `package/msg/Type` of ROS 2, `package.Type` of protobuf.
    fn schema(&self) -> &'static str;

    /// The definition of the type; `None` if there is none.
    fn definition(&self) -> Option<Definition>;

    /// The bytes of the message; the byte order is a question in ROS 2 alone.
    fn encode(&self, endian: Endian) -> Vec<u8>;
}

/// Structs of a message definition: fields in its order, SI units unless a comment says otherwise.
macro_rules! fields {
    ($($(#[$meta:meta])* $name:ident { $($(#[$about:meta])* $field:ident: $ty:ty,)* })*) => {$(
        $(#[$meta])*
        #[derive(Clone, Debug, PartialEq)]
        pub struct $name {
            $($(#[$about])* pub $field: $ty,)*
        }

        impl Field for $name {
            fn put(&self, cdr: &mut Cdr) {
                $(self.$field.put(cdr);)*
            }
        }
    )*};
}

macro_rules! messages {
    ($($name:ident = $schema:literal),* $(,)?) => {$(
        impl Message for $name {
            fn schema(&self) -> &'static str {
                $schema
            }

            fn definition(&self) -> Option<Definition> {
                let text = definition($schema)?;
                Some(Definition {
                    schema_encoding: "ros2msg",
                    message_encoding: "cdr",
                    data: text.into_bytes(),
                })
            }

            fn encode(&self, endian: Endian) -> Vec<u8> {
                let mut cdr = Cdr::new(endian);
                self.put(&mut cdr);
                cdr.bytes
            }
        }
    )*};
}

messages! {
    CompressedImage = "sensor_msgs/msg/CompressedImage",
    Image = "sensor_msgs/msg/Image",
    CameraInfo = "sensor_msgs/msg/CameraInfo",
    PointCloud2 = "sensor_msgs/msg/PointCloud2",
    Imu = "sensor_msgs/msg/Imu",
    Odometry = "nav_msgs/msg/Odometry",
    Path = "nav_msgs/msg/Path",
    TwistStamped = "geometry_msgs/msg/TwistStamped",
    PoseStamped = "geometry_msgs/msg/PoseStamped",
    TfMessage = "tf2_msgs/msg/TFMessage",
    AckermannDriveStamped = "ackermann_msgs/msg/AckermannDriveStamped",
    CarlaEgoVehicleControl = "carla_msgs/msg/CarlaEgoVehicleControl",
    CarlaEgoVehicleStatus = "carla_msgs/msg/CarlaEgoVehicleStatus",
    RadarScan = "radar_msgs/msg/RadarScan",
    NavSatFix = "sensor_msgs/msg/NavSatFix",
    CarlaWeatherParameters = "carla_msgs/msg/CarlaWeatherParameters",
    CarlaWorldInfo = "carla_msgs/msg/CarlaWorldInfo",
    ObjectArray = "derived_object_msgs/msg/ObjectArray",
    Situation = "pmp_msgs/msg/Situation",
}

/// When and in which frame: `std_msgs/Header`.
#[derive(Clone, Debug, PartialEq)]
pub struct Header {
    /// Since the Unix epoch; ROS can say 1901 to 2038.
    pub stamp_ns: i64,
    pub frame_id: String,
}

impl Field for Header {
    fn put(&self, cdr: &mut Cdr) {
        const SECOND_NS: i64 = 1_000_000_000;
        (self.stamp_ns.div_euclid(SECOND_NS) as i32).put(cdr);
        (self.stamp_ns.rem_euclid(SECOND_NS) as u32).put(cdr);
        self.frame_id.put(cdr);
    }
}

fields! {
    Pose { position: DVec3, orientation: DQuat, }
    PoseStamped { header: Header, pose: Pose, }
    PoseWithCovariance { pose: Pose, covariance: [f64; 36], }
    Twist { linear: DVec3, angular: DVec3, }
    TwistStamped { header: Header, twist: Twist, }
    TwistWithCovariance { twist: Twist, covariance: [f64; 36], }
    Accel { linear: DVec3, angular: DVec3, }
    Transform { translation: DVec3, rotation: DQuat, }
    TransformStamped { header: Header, child_frame_id: String, transform: Transform, }
    TfMessage { transforms: Vec<TransformStamped>, }

    /// The pose is in the header's frame, the twist in the child frame.
    Odometry {
        header: Header,
        child_frame_id: String,
        pose: PoseWithCovariance,
        twist: TwistWithCovariance,
    }
    Path { header: Header, poses: Vec<PoseStamped>, }

    CompressedImage {
        header: Header,
        /// "jpeg" or "png".
        format: String,
        data: Vec<u8>,
    }
    Image {
        header: Header,
        height: u32,
        width: u32,
        encoding: String,
        is_bigendian: u8,
        /// Bytes in a row.
        step: u32,
        data: Vec<u8>,
    }
    RegionOfInterest {
        x_offset: u32,
        y_offset: u32,
        height: u32,
        width: u32,
        do_rectify: bool,
    }
    CameraInfo {
        header: Header,
        height: u32,
        width: u32,
        distortion_model: String,
        d: Vec<f64>,
        /// Row by row.
        k: [f64; 9],
        r: [f64; 9],
        p: [f64; 12],
        binning_x: u32,
        binning_y: u32,
        roi: RegionOfInterest,
    }
    PointField {
        name: String,
        /// Bytes from the start of a point.
        offset: u32,
        /// 4 = uint16, 7 = float32; the definition lists all.
        datatype: u8,
        count: u32,
    }
    PointCloud2 {
        header: Header,
        height: u32,
        width: u32,
        fields: Vec<PointField>,
        is_bigendian: bool,
        /// Bytes of a point and of a row.
        point_step: u32,
        row_step: u32,
        data: Vec<u8>,
        is_dense: bool,
    }
    Imu {
        header: Header,
        orientation: DQuat,
        orientation_covariance: [f64; 9],
        angular_velocity: DVec3,
        angular_velocity_covariance: [f64; 9],
        linear_acceleration: DVec3,
        linear_acceleration_covariance: [f64; 9],
    }

    AckermannDrive {
        /// Of the front wheels, rad, positive = left.
        steering_angle: f32,
        steering_angle_velocity: f32,
        speed: f32,
        acceleration: f32,
        jerk: f32,
    }
    AckermannDriveStamped { header: Header, drive: AckermannDrive, }
    CarlaEgoVehicleControl {
        header: Header,
        throttle: f32,
        /// In [-1, 1], positive = right.
        steer: f32,
        brake: f32,
        hand_brake: bool,
        reverse: bool,
        gear: i32,
        manual_gear_shift: bool,
    }
    CarlaEgoVehicleStatus {
        header: Header,
        /// Speed, m/s.
        velocity: f32,
        acceleration: Accel,
        orientation: DQuat,
        /// What was applied, which need not be what was asked for.
        control: CarlaEgoVehicleControl,
    }
    RadarReturn {
        range: f32,
        /// Rad, positive = left of the sensor's axis.
        azimuth: f32,
        /// Rad, positive = up.
        elevation: f32,
        /// m/s, negative = approaching.
        doppler_velocity: f32,
        /// dB.
        amplitude: f32,
    }
    RadarScan { header: Header, returns: Vec<RadarReturn>, }

    NavSatStatus {
        /// 0 = a fix, negative = none.
        status: i8,
        /// 1 = GPS; the definition lists all.
        service: u16,
    }
    NavSatFix {
        header: Header,
        status: NavSatStatus,
        /// Degrees, WGS 84; altitude above the ellipsoid, m.
        latitude: f64,
        longitude: f64,
        altitude: f64,
        /// East, north, up, m2.
        position_covariance: [f64; 9],
        /// 2 = the diagonal is known.
        position_covariance_type: u8,
    }
    /// Percent and degrees, as the simulator CARLA takes them.
    CarlaWeatherParameters {
        cloudiness: f32,
        precipitation: f32,
        precipitation_deposits: f32,
        wind_intensity: f32,
        fog_density: f32,
        fog_distance: f32,
        wetness: f32,
        sun_azimuth_angle: f32,
        sun_altitude_angle: f32,
    }
    CarlaWorldInfo { map_name: String, opendrive: String, }

    Point32 { x: f32, y: f32, z: f32, }
    Polygon { points: Vec<Point32>, }
    SolidPrimitive {
        /// 1 = a box.
        r#type: u8,
        /// Of a box: length, width, height.
        dimensions: Vec<f64>,
    }
    /// Somebody or something in the way; in the frame of its header.
    Object {
        header: Header,
        id: u32,
        /// 1 = followed over time.
        detection_level: u8,
        object_classified: bool,
        pose: Pose,
        twist: Twist,
        accel: Accel,
        polygon: Polygon,
        shape: SolidPrimitive,
        /// 4 = pedestrian, 5 = bicycle, 6 = car, 7 = truck, 8 = motorcycle; the definition lists all.
        classification: u8,
        classification_certainty: u8,
        classification_age: u32,
    }
    ObjectArray { header: Header, objects: Vec<Object>, }

    /// What a map and a route tell of the place where the car is.
    Situation {
        header: Header,
        in_junction: bool,
        speed_limit_mps: f32,
        /// As [`crate::frame::Command`] names it.
        command: String,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_aligned_from_behind_the_encapsulation_header() {
        let mut cdr = Cdr::new(Endian::Little);
        7_u8.put(&mut cdr);
        1.0_f64.put(&mut cdr);
        let body = &cdr.bytes[ENCAPSULATION_BYTES..];
        assert_eq!(body[..8], [7, 0, 0, 0, 0, 0, 0, 0]);
        assert_eq!(body[8..], 1.0_f64.to_le_bytes());
    }

    #[test]
    fn stamps_before_the_epoch_keep_their_nanoseconds_positive() {
        let mut cdr = Cdr::new(Endian::Little);
        Header { stamp_ns: -1, frame_id: String::new() }.put(&mut cdr);
        assert_eq!(cdr.bytes[4..8], (-1_i32).to_le_bytes());
        assert_eq!(cdr.bytes[8..12], 999_999_999_u32.to_le_bytes());
    }
}
