//! What the simulated car senses: camera, lidar, radar, odometry, inertial unit, satellites.
//!
//! Every sensor is a function of the town's meshes, the instant, the ego vehicle's state, the sky, and
//! a stream of random numbers of its own.

pub mod floats;
pub mod rays;
pub mod fan;
pub mod sweep;
pub mod rain;
pub mod echo;
pub mod lidar;
pub mod radar;
pub mod odometry;
pub mod imu;
pub mod gnss;
pub mod camera;
