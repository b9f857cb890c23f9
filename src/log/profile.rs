//! Profiles: what a user says about a log that the log does not say itself.

use std::{collections::BTreeMap, path::Path};

use serde::{Deserialize, Serialize};

use crate::{
    error::{Error, Result},
    frame::{Conditions, IMAGE_HEIGHT, IMAGE_WIDTH},
    log::{
        clock::ClockRule,
        conventions::{ControlRule, EgoRule, RadarRule},
        rigs::Rig,
        topics::Topics,
    },
    projection::Crop,
};

/// Front-wheel angle at full steering of an ordinary passenger car, rad (35 degrees). Used where
/// a log has wheel angles and neither a normalised steering nor a configured lock.
pub const DEFAULT_STEERING_LOCK_RAD: f64 = 0.611;

/// How to read a log. Everything has a default; an unknown key is an error.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Profile {
    /// What the log was recorded with; `None`: recognised by its topics, if it is a known rig.
    pub rig: Option<String>,
    /// Topics that have to be there. Those of a rig need not.
    pub topics: Topics,
    pub clock: ClockRule,
    pub tolerance_ms: Tolerance,
    pub camera: CameraRule,
    pub ego: EgoRule,
    pub radar: RadarRule,
    pub control: ControlRule,
    pub required: Required,
    /// Conditions of the drive, where the log's metadata does not tell them.
    pub conditions: Conditions,
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

/// Signals without which there is no frame, besides the camera and the ego motion.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Required {
    pub lidar: bool,
    pub radar: bool,
    pub control: bool,
}

impl Profile {
    /// The profile of a rig by its name, `auto`, or one from a TOML file.
    ///
    /// # Errors
    ///
    /// [`Error::Config`] if there is neither, the file is not a profile, or a value is out of
    /// range.
    pub fn load(name_or_path: &str) -> Result<Profile> {
        let is_file = Path::new(name_or_path).extension().is_some_and(|e| e == "toml");
        let mut profile: Profile = if is_file {
            let text =
                std::fs::read_to_string(name_or_path).map_err(Error::io("read", name_or_path))?;
            toml::from_str(&text).map_err(|error| Error::Config {
                key: name_or_path.to_string(),
                what: error.to_string(),
                hint: None,
            })?
        } else {
            Profile { rig: Some(name_or_path.to_string()), ..Profile::default() }
        };
        profile.rig = profile.rig.filter(|name| name != "auto");
        profile.check(if is_file { "rig" } else { "--profile" })?;
        Ok(profile)
    }

    /// The profile with what a rig knows in the place of what it leaves open, except topics.
    pub fn on(&self, rig: Option<&Rig>) -> Profile {
        let mut profile = self.clone();
        if let Some(rig) = rig {
            profile.ego.world = self.ego.world.or(rig.ego.world);
            profile.ego.base = self.ego.base.clone().or_else(|| rig.ego.base.clone());
            profile.radar.azimuth = self.radar.azimuth.or(rig.radar.azimuth);
            profile.radar.closing_speed = self.radar.closing_speed.or(rig.radar.closing_speed);
            let lock = self.control.steering_lock_rad.or(rig.control.steering_lock_rad);
            profile.control.steering_lock_rad = lock;
        }
        profile
    }

    fn check(&self, rig_key: &str) -> Result<()> {
        self.clock.check()?;
        let fail =
            |key: &str, what: String| Err(Error::Config { key: key.to_string(), what, hint: None });
        if let Some(rig) = self.rig.as_deref().filter(|rig| Rig::names().all(|name| name != *rig)) {
            let names: Vec<_> = Rig::names().collect();
            return Err(Error::Config {
                key: rig_key.into(),
                what: format!("`{rig}` is not a profile"),
                hint: Some(format!(
                    "built-in profiles are auto, {}; a profile of your own is a FILE.toml",
                    names.join(", ")
                )),
            });
        }
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
