//! The frame: what the car sensed at one tick, its state, and what it did next.
//!
//! First waist of the toolkit: a recorded log and the simulator both make frames, and nothing
//! after them can tell which. Columns of the same names, with units, are in
//! `schemas/frame.v1.json`.

use half::f16;

/// Ticks per second of the default grid (paper §III.B).
pub const GRID_HZ: f64 = 10.0;

/// Steps of future motion in a frame: t = 0.1 ... 3.0 s (paper §III.C4).
pub const FUTURE_STEPS: usize = 30;

/// Seconds between two steps of future motion.
pub const FUTURE_STEP_S: f64 = 0.1;

/// Waypoints of the local route (paper eq. 1).
pub const ROUTE_POINTS: usize = 130;

/// Arc length between two waypoints, metres (paper §III.C1).
pub const ROUTE_SPACING_M: f64 = 0.4;

/// Width of the stored picture, pixels (paper §III.C2).
pub const IMAGE_WIDTH: usize = 600;

/// Height of the stored picture, pixels.
pub const IMAGE_HEIGHT: usize = 250;

/// One tick of the grid. SI units and radians; ego frame x forward, y left, z up (REP-103).
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// Index on the grid, from 0; gaps where frames were left out.
    pub index: u32,
    /// Grid time, ns since the Unix epoch.
    pub stamp_ns: i64,
    /// JPEG, RGB.
    pub image: Vec<u8>,
    /// `None` where the log has no lidar near this tick.
    pub lidar: Option<LidarPixels>,
    /// `None` where the log has no radar near this tick.
    pub radar: Option<RadarPixels>,
    /// Planar velocity (vx, vy) in the ego frame, m/s.
    pub velocity_mps: [f32; 2],
    /// Heading of the ego frame in the world frame, rad in (-pi, pi].
    pub yaw_rad: f64,
    /// Position of the ego frame in the world frame, m.
    pub position_m: [f64; 3],
    pub action: RecordedAction,
    pub route: Route,
    pub command: Command,
    pub future: Future,
    pub skew: Skew,
    pub conditions: Conditions,
    pub in_junction: Option<bool>,
    pub speed_limit_mps: Option<f32>,
    /// The applied action was disturbed on purpose; `action` holds what the expert wanted.
    pub perturbed: bool,
}

/// Planar speed in m/s, negative when reversing: the convention of [`Future::speed_mps`].
pub fn signed_speed_mps([vx, vy]: [f32; 2]) -> f32 {
    if vx < 0.0 { -vx.hypot(vy) } else { vx.hypot(vy) }
}

/// Lidar returns on the picture, the nearest per pixel, ascending in `pixel`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LidarPixels {
    /// row x width + column.
    pub pixel: Vec<u32>,
    /// Metres in the camera's optical frame: x right, y down, z forward.
    pub x: Vec<f16>,
    pub y: Vec<f16>,
    pub z: Vec<f16>,
}

/// Radar returns on the picture, the nearest per pixel, ascending in `pixel`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RadarPixels {
    /// row x width + column.
    pub pixel: Vec<u32>,
    /// Radial speed relative to the ego vehicle, m/s, negative = approaching; `None` of a radar that
    /// does not measure it.
    pub speed_mps: Option<Vec<f16>>,
}

/// What the driver did. A channel is `None` where the log does not have it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RecordedAction {
    /// In [-1, 1], positive = right (CARLA's sign).
    pub steer: Option<f32>,
    /// In [0, 1].
    pub throttle: Option<f32>,
    /// In [0, 1].
    pub brake: Option<f32>,
}

/// The way ahead, in the ego frame of now.
#[derive(Clone, Debug, PartialEq)]
pub struct Route {
    /// x1, y1, x2, y2, ... in metres; the first waypoint is the closest, the last one is repeated.
    pub waypoints_m: [f32; 2 * ROUTE_POINTS],
    /// Waypoints before the padding.
    pub len: u8,
    pub source: RouteSource,
}

/// Where a route came from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RouteSource {
    /// From a route in the log.
    Planned,
    /// From where the car went.
    Driven,
}

impl RouteSource {
    pub fn name(self) -> &'static str {
        match self {
            RouteSource::Planned => "planned",
            RouteSource::Driven => "driven",
        }
    }

    /// The source of that name, as stored in the dataset.
    pub fn from_name(name: &str) -> Option<Self> {
        [RouteSource::Planned, RouteSource::Driven].into_iter().find(|s| s.name() == name)
    }
}

/// High-level navigation command (CIL's four).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Command {
    Follow,
    Left,
    Right,
    Straight,
}

impl Command {
    pub const ALL: [Command; 4] =
        [Command::Follow, Command::Left, Command::Right, Command::Straight];

    pub fn name(self) -> &'static str {
        match self {
            Command::Follow => "follow",
            Command::Left => "left",
            Command::Right => "right",
            Command::Straight => "straight",
        }
    }

    /// The command of that name, as stored in the dataset.
    pub fn from_name(name: &str) -> Option<Self> {
        Command::ALL.into_iter().find(|c| c.name() == name)
    }
}

/// What the car did in the next 3 s: step `i` is `(i + 1) * 0.1` s from now.
#[derive(Clone, Debug, PartialEq)]
pub struct Future {
    /// Planar speed, m/s; negative when reversing.
    pub speed_mps: [f32; FUTURE_STEPS],
    /// Yaw change from now, rad, wrapped into (-pi, pi].
    pub yaw_rad: [f32; FUTURE_STEPS],
    /// Position in the ego frame of now: x1, y1, x2, y2, ... m.
    pub xy_m: [f32; 2 * FUTURE_STEPS],
    /// Valid steps, 0 ... 30; the rest is zero.
    pub len: u8,
}

impl Future {
    /// Nothing is known of what comes.
    pub const UNKNOWN: Future = Future {
        speed_mps: [0.0; FUTURE_STEPS],
        yaw_rad: [0.0; FUTURE_STEPS],
        xy_m: [0.0; 2 * FUTURE_STEPS],
        len: 0,
    };
}

/// Sample time minus grid time, ns; `None` where the sample is absent.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Skew {
    pub image_ns: i32,
    pub lidar_ns: Option<i32>,
    pub radar_ns: Option<i32>,
    pub control_ns: Option<i32>,
}

/// What is known of the surroundings; the same words as the paper's appendix A and B.
#[derive(Clone, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Conditions {
    pub town: Option<String>,
    /// clear, drizzle, rainy, storm.
    pub weather: Option<String>,
    /// daytime, sunset, night, dark.
    pub illumination: Option<String>,
    /// empty, few, regular, dense.
    pub traffic: Option<String>,
}
