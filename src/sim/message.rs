//! A reading as the messages that a car's drivers would publish, in one of two flavours.

use clap::ValueEnum;
use serde::{Deserialize, Serialize};

use crate::log::encode::Message;

/// How logs speak.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Encoding {
    /// Foxglove's schemas, as protobuf.
    #[default]
    Foxglove,
    /// ROS 2 messages under the names of CARLA's ROS bridge.
    Ros2,
}

/// A message and where it goes.
pub struct Sent {
    pub topic: &'static str,
    pub message: Box<dyn Message>,
}

impl Sent {
    pub fn new(topic: &'static str, message: impl Message + 'static) -> Sent {
        Sent { topic, message: Box::new(message) }
    }
}

/// Variances of x, y and the turn about z; the car cannot leave the ground.
pub fn planar_covariance(linear_std: f64, angular_std: f64) -> [f64; 36] {
    let mut covariance = [0.0; 36];
    covariance[0] = linear_std * linear_std;
    covariance[7] = linear_std * linear_std;
    covariance[35] = angular_std * angular_std;
    covariance
}
