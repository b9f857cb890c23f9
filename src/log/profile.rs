//! Profiles: what a user says about a log that the log does not say itself.

use std::{collections::BTreeMap, path::Path};

use serde::{Deserialize, Serialize};

use crate::{
    error::{Error, Result},
    frame::{Conditions, IMAGE_HEIGHT, IMAGE_WIDTH},
    log::clock::ClockRule,
    projection::Crop,
};

/// Names of the built-in profiles, with what they are for.
pub const BUILT_IN: [(&str, &str); 2] = [
    ("auto", "topics are found by type, and by name where a type has several"),
    ("carla-ros-bridge", "topics of CARLA's ROS bridge for the role name `ego_vehicle`"),
];

/// Front-wheel angle at full steering of an ordinary passenger car, rad (35 degrees). Used where
/// a log has wheel angles and neither a normalised steering nor a configured lock.
pub const DEFAULT_STEERING_LOCK_RAD: f64 = 0.611;

/// How to read a log. Everything has a default; an unknown key is an error.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Profile {
    pub topics: Topics,
    pub clock: ClockRule,
    pub tolerance_ms: Tolerance,
    pub camera: CameraRule,
    pub control: ControlRule,
    pub required: Required,
    /// Conditions of the drive, where the log's metadata does not tell them.
    pub conditions: Conditions,
}

/// Topic names. What is not named is found by type.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Topics {
    pub camera: Option<String>,
    pub camera_info: Option<String>,
    pub lidar: Option<String>,
    pub radar: Option<String>,
    /// Odometry: pose and velocity together.
    pub odometry: Option<String>,
    /// A pose, where there is no odometry.
    pub pose: Option<String>,
    /// A velocity, where the odometry has none.
    pub velocity: Option<String>,
    pub control: Option<String>,
    /// A planned route.
    pub route: Option<String>,
    /// Topics to treat as if they were not in the log.
    pub ignore: Vec<String>,
}

/// Furthest that a sample may be from its tick, milliseconds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Tolerance {
    /// A little over half the period of a 10 Hz sensor, so that jitter costs no frames.
    pub camera: f64,
    pub lidar: f64,
    pub radar: f64,
    pub control: f64,
    /// The ego pose is interpolated; its neighbours may be this far on either side.
    pub ego: f64,
}

impl Default for Tolerance {
    fn default() -> Self {
        Tolerance { camera: 60.0, lidar: 60.0, radar: 60.0, control: 100.0, ego: 100.0 }
    }
}

/// How a recorded picture becomes the stored one: cut out `crop`, then scale each axis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct CameraRule {
    pub crop: Option<Crop>,
    pub width: usize,
    pub height: usize,
    /// JPEG quality, 1 to 100. 90 keeps 36 dB at 48 kB a picture.
    pub quality: u8,
}

impl Default for CameraRule {
    fn default() -> Self {
        CameraRule { crop: None, width: IMAGE_WIDTH, height: IMAGE_HEIGHT, quality: 90 }
    }
}

/// How controls are read.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ControlRule {
    /// Front-wheel angle at full steering, rad.
    pub steering_lock_rad: Option<f64>,
}

/// Signals without which there is no frame, besides the camera and the ego motion.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Required {
    pub lidar: bool,
    pub radar: bool,
    pub control: bool,
}

impl Profile {
    /// A built-in profile by name, or one from a TOML file.
    ///
    /// # Errors
    ///
    /// [`Error::Config`] if there is neither, the file is not a profile, or a value is out of
    /// range.
    pub fn load(name_or_path: &str) -> Result<Profile> {
        let profile = match name_or_path {
            "auto" => Profile::default(),
            "carla-ros-bridge" => Profile { topics: carla_ros_bridge(), ..Profile::default() },
            path if Path::new(path).extension().is_some_and(|e| e == "toml") => {
                let text = std::fs::read_to_string(path).map_err(Error::io("read", path))?;
                toml::from_str(&text).map_err(|error| Error::Config {
                    key: path.to_string(),
                    what: error.to_string(),
                    hint: None,
                })?
            }
            other => {
                let names: Vec<_> = BUILT_IN.iter().map(|(name, _)| *name).collect();
                return Err(Error::Config {
                    key: "--profile".into(),
                    what: format!("`{other}` is not a profile"),
                    hint: Some(format!(
                        "built-in profiles are {}; a profile of your own is a FILE.toml",
                        names.join(", ")
                    )),
                });
            }
        };
        profile.check()?;
        Ok(profile)
    }

    /// Make sure that all values are within their ranges.
    ///
    /// # Errors
    ///
    /// [`Error::Config`] names the value that is not.
    pub fn check(&self) -> Result<()> {
        self.clock.check()?;
        let fail =
            |key: &str, what: String| Err(Error::Config { key: key.to_string(), what, hint: None });
        let t = &self.tolerance_ms;
        let tolerances = BTreeMap::from([
            ("tolerance_ms.camera", t.camera),
            ("tolerance_ms.lidar", t.lidar),
            ("tolerance_ms.radar", t.radar),
            ("tolerance_ms.control", t.control),
            ("tolerance_ms.ego", t.ego),
        ]);
        for (key, value) in tolerances {
            if !(0.0..=2000.0).contains(&value) {
                return fail(key, format!("{value} is not between 0 and 2000 ms"));
            }
        }
        let c = &self.camera;
        if !(1..=100).contains(&c.quality) {
            return fail("camera.quality", format!("{} is not between 1 and 100", c.quality));
        }
        if !(8..=8192).contains(&c.width) || !(8..=8192).contains(&c.height) {
            let what = format!("{} x {} is not between 8 and 8192 pixels", c.width, c.height);
            return fail("camera.width, camera.height", what);
        }
        match self.control.steering_lock_rad {
            Some(lock) if !(0.05..=1.6).contains(&lock) => {
                fail("control.steering_lock_rad", format!("{lock} is not between 0.05 and 1.6 rad"))
            }
            _ => Ok(()),
        }
    }
}

fn carla_ros_bridge() -> Topics {
    let topic = |name: &str| Some(format!("/carla/ego_vehicle/{name}"));
    Topics {
        camera: topic("rgb_front/image"),
        camera_info: topic("rgb_front/camera_info"),
        lidar: topic("lidar"),
        radar: topic("radar_front"),
        odometry: topic("odometry"),
        control: topic("vehicle_control_cmd"),
        route: topic("waypoints"),
        ..Topics::default()
    }
}
