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
