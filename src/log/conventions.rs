//! What the numbers of a log mean where its messages do not say it: axes, signs, limits.
//!
//! Everything is optional: a profile says it, else the rig, else the default that is named here.

use serde::{Deserialize, Serialize};

/// Axes of the world that poses are given in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum World {
    /// x and y span the ground, z points up (ROS REP-103). The default.
    Enu,
    /// x north, y east, z down. Also taken where a frame's name has the word `ned`.
    Ned,
    /// x forward, y right, z up: CARLA's and Unreal's own axes, without the bridge to ROS.
    LeftHanded,
}

/// How the ego motion is read.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct EgoRule {
    pub world: Option<World>,
    /// Frame of the car, where it has none of the usual names.
    pub base: Option<String>,
}

/// A side of the car.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Side {
    Left,
    Right,
}

/// The sign of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Sign {
    Negative,
    Positive,
}

/// How radar returns are read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RadarRule {
    /// To which side azimuths grow in clouds without x, y, z; by default to the left (REP-103).
    pub azimuth: Option<Side>,
    /// Sign of the speed of what comes nearer; negative by default.
    pub closing_speed: Option<Sign>,
}

/// How controls are read.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ControlRule {
    /// Front-wheel angle at full steering, rad.
    pub steering_lock_rad: Option<f64>,
}
