//! Values to samples: what each message type says about the drive.
//!
//! One function a message type. Types are recognised by the name of their definition and their
//! fields are found by name, so a definition with more fields, or in another order, still reads.

pub mod kind;
pub mod header;
pub mod geometry;
pub mod ego;
pub mod frames;
pub mod control;
pub mod camera;
pub mod radar;
pub mod route;
pub mod conditions;
pub mod situation;

pub use camera::camera_info;
pub use conditions::{Weather, carla_town, carla_weather};
pub use control::{
    CarlaStatus, Control, ackermann, actuation, carla_control, carla_status, steering_report,
};
pub use ego::{
    Fix, Inertial, Odometry, child_frame, fix, inertial, odometry, stamped_pose, stamped_twist,
};
pub use frames::transforms;
pub use geometry::{Pose, pose};
pub use header::{Header, header, header_of_first_field};
pub use kind::Kind;
pub use radar::{RadarReturn, polar, radar_scan, radar_tracks};
pub use route::path;
pub use situation::{Situation, situation};
