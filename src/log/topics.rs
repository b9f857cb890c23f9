//! Names of topics, as profiles, rigs and the command line give them.

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};

/// One name, or several in order of preference. In a name, `*` stands for one segment between
/// slashes: `/carla/*/odometry` is the odometry of whatever the car is called.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Names {
    One(String),
    Several(Vec<String>),
}

impl Names {
    /// In order of preference.
    pub fn iter(&self) -> impl Iterator<Item = &str> {
        let names = match self {
            Names::One(name) => std::slice::from_ref(name),
            Names::Several(names) => names,
        };
        names.iter().map(String::as_str)
    }
}

impl std::fmt::Display for Names {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.write_str(&self.iter().collect::<Vec<_>>().join(", "))
    }
}

impl From<&str> for Names {
    fn from(name: &str) -> Names {
        Names::One(name.to_string())
    }
}

/// Whether a name with `*` for some of its segments is the name of a topic.
pub fn matches(pattern: &str, topic: &str) -> bool {
    let segments = || pattern.split('/').zip(topic.split('/'));
    pattern.split('/').count() == topic.split('/').count()
        && segments().all(|(wanted, is)| wanted == is || (wanted == "*" && !is.is_empty()))
}

/// Topic names by signal. What is not named is found by type.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Topics {
    pub camera: Option<Names>,
    pub camera_info: Option<Names>,
    pub lidar: Option<Names>,
    pub radar: Option<Names>,
    /// Odometry: pose and velocity together.
    pub odometry: Option<Names>,
    /// A pose, where there is no odometry.
    pub pose: Option<Names>,
    /// A velocity, where the odometry has none.
    pub velocity: Option<Names>,
    /// Rate of turn and, for positions from satellites, the attitude.
    pub imu: Option<Names>,
    /// Positions from satellites, where there is nothing better.
    pub gnss: Option<Names>,
    pub control: Option<Names>,
    /// Throttle and brake, where the control has none.
    pub pedals: Option<Names>,
    /// A planned route.
    pub route: Option<Names>,
    /// Topics to treat as if they were not in the log.
    pub ignore: Vec<String>,
}

impl Topics {
    /// Name the topic of a signal, as `camera=/front/image`.
    ///
    /// # Errors
    ///
    /// [`Error::Config`] if there is no such signal, or no name.
    pub fn set(&mut self, assignment: &str) -> Result<()> {
        let wrong = |what: String| Error::Config {
            key: "--topic".into(),
            what,
            hint: Some(
                "write SIGNAL=NAME, with camera, camera_info, lidar, radar, odometry, pose, \
                 velocity, imu, gnss, control, pedals or route; ignore=NAME leaves a topic out"
                    .into(),
            ),
        };
        let (signal, name) = assignment
            .split_once('=')
            .filter(|(_, name)| !name.is_empty())
            .ok_or_else(|| wrong(format!("`{assignment}` names no topic")))?;
        let topic = match signal {
            "camera" => &mut self.camera,
            "camera_info" => &mut self.camera_info,
            "lidar" => &mut self.lidar,
            "radar" => &mut self.radar,
            "odometry" => &mut self.odometry,
            "pose" => &mut self.pose,
            "velocity" => &mut self.velocity,
            "imu" => &mut self.imu,
            "gnss" => &mut self.gnss,
            "control" => &mut self.control,
            "pedals" => &mut self.pedals,
            "route" => &mut self.route,
            "ignore" => {
                self.ignore.push(name.to_string());
                return Ok(());
            }
            _ => return Err(wrong(format!("`{signal}` is not a signal"))),
        };
        *topic = Some(Names::from(name));
        Ok(())
    }
}
