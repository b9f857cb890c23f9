//! Which topic is which signal: by type, by name where a type has several, or as a profile says.

use crate::{
    error::Result,
    log::{
        profile::Profile,
        recording::{Recording, Series, Topic, mapping_error},
        signals::Kind,
    },
};

/// Cloud fields that hold a radial speed, and so make a cloud a radar's.
pub const RADIAL_SPEED_FIELDS: [&str; 8] = [
    "velocity",
    "doppler",
    "doppler_velocity",
    "radial_velocity",
    "radial_speed",
    "range_rate",
    "vr",
    "v",
];

/// The chosen topics; names are keys of [`Recording::topics`].
#[derive(Clone, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Mapping {
    pub camera: Option<String>,
    pub camera_info: Option<String>,
    pub lidar: Option<String>,
    pub radar: Option<String>,
    pub pose: Option<PoseSource>,
    pub velocity: Option<String>,
    pub control: Option<String>,
    pub route: Option<String>,
    /// Why a topic was chosen among several, and what is missing.
    pub notes: Vec<String>,
}

/// Where the ego pose comes from.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PoseSource {
    /// An odometry or pose topic.
    Topic(String),
    /// The transform of this frame in `/tf`.
    Transform(String),
    /// Integrated from a velocity topic and a yaw rate (an IMU, or the same twist).
    Integrated { speed: String, yaw_rate: String },
}

impl Mapping {
    /// Choose the topics of a recording.
    ///
    /// # Errors
    ///
    /// [`Error::Mapping`](crate::error::Error::Mapping) if a topic that the profile names is not
    /// in the log or is of a type that cannot be that signal. A signal that is merely absent is
    /// not an error here.
    pub fn choose(recording: &Recording, profile: &Profile) -> Result<Mapping> {
        let wanted = &profile.topics;
        let mut chooser = Chooser { recording, ignore: &wanted.ignore, notes: Vec::new() };
        let camera = chooser.topic("camera", &wanted.camera, &is_camera, &camera_rank)?;
        let camera_info = match (&wanted.camera_info, &camera) {
            (None, Some(camera)) => chooser.info_of(camera),
            (named, _) => chooser.topic("camera_info", named, &is_info, &|_| 0)?,
        };
        let lidar = chooser.topic("lidar", &wanted.lidar, &is_lidar, &front_rank)?;
        let radar = chooser.topic("radar", &wanted.radar, &is_radar, &front_rank)?;
        let pose = chooser.pose(profile)?;
        let velocity = chooser.topic("velocity", &wanted.velocity, &is_velocity, &|_| 0)?;
        let control = chooser.topic("control", &wanted.control, &is_control, &control_rank)?;
        let route = chooser.topic("route", &wanted.route, &is_route, &|_| 0)?;
        let notes = chooser.notes;
        Ok(Mapping { camera, camera_info, lidar, radar, pose, velocity, control, route, notes })
    }
}

impl Mapping {
    /// What a topic is used as, for people.
    pub fn uses(&self, topic: &str) -> Option<String> {
        let (pose, speed, yaw_rate) = match self.pose.clone() {
            Some(PoseSource::Topic(topic)) => (Some(topic), None, None),
            Some(PoseSource::Integrated { speed, yaw_rate }) => (None, Some(speed), Some(yaw_rate)),
            Some(PoseSource::Transform(_)) | None => (None, None, None),
        };
        let uses = [
            ("camera", &self.camera),
            ("camera calibration", &self.camera_info),
            ("lidar", &self.lidar),
            ("radar", &self.radar),
            ("ego pose", &pose),
            ("ego pose (speed)", &speed),
            ("ego pose (yaw rate)", &yaw_rate),
            ("velocity, where the pose has none", &self.velocity),
            ("control", &self.control),
            ("route", &self.route),
        ];
        let named: Vec<_> = uses
            .into_iter()
            .filter(|(_, name)| name.as_deref() == Some(topic))
            .map(|(signal, _)| signal)
            .collect();
        (!named.is_empty()).then(|| named.join(", "))
    }
}

struct Chooser<'r> {
    recording: &'r Recording,
    ignore: &'r [String],
    notes: Vec<String>,
}

impl Chooser<'_> {
    /// The named topic, or the one of the lowest rank among those that fit.
    fn topic(
        &mut self,
        signal: &str,
        named: &Option<String>,
        fits: &dyn Fn(&Topic) -> bool,
        rank: &dyn Fn(&Topic) -> u32,
    ) -> Result<Option<String>> {
        let topics = &self.recording.topics;
        let ignore = self.ignore;
        let candidates = || {
            let usable = topics.values().filter(|t| !t.series.is_empty() && fits(t));
            usable.filter(|t| !ignore.contains(&t.name))
        };
        if let Some(name) = named {
            if candidates().any(|topic| topic.name == *name) {
                return Ok(Some(name.clone()));
            }
            let have: Vec<_> = candidates().map(|topic| topic.name.as_str()).collect();
            let have = if have.is_empty() { "none".to_string() } else { have.join(", ") };
            let unused = self.recording.unused.iter().find(|unused| unused.topic == *name);
            let why = unused.map_or("it is not in the log, or empty".to_string(), |unused| {
                format!("{}: {}", unused.type_name, unused.why)
            });
            let what = format!("topic `{name}` cannot be the {signal} ({why})");
            let hint = format!("topics that could be the {signal}: {have}");
            return Err(mapping_error(&self.recording.log, what, &hint));
        }
        let mut ranked: Vec<_> = candidates().map(|topic| (rank(topic), &topic.name)).collect();
        ranked.sort();
        if let [(_, best), others @ ..] = ranked.as_slice()
            && !others.is_empty()
        {
            let others: Vec<_> = others.iter().map(|(_, name)| name.as_str()).collect();
            self.notes.push(format!("{signal}: {best} taken, not {}", others.join(", ")));
        }
        Ok(ranked.first().map(|(_, name)| (*name).clone()))
    }

    /// The calibration of a camera: the one of its frame, or the one that lies nearest by name.
    fn info_of(&mut self, camera: &str) -> Option<String> {
        let infos =
            || self.recording.topics.values().filter(|t| is_info(t) && !t.series.is_empty());
        let frame = &self.recording.topics.get(camera)?.frame_id;
        let shared =
            |name: &str| name.bytes().zip(camera.bytes()).take_while(|(a, b)| a == b).count();
        let best = infos().max_by_key(|info| (info.frame_id == *frame, shared(&info.name)))?;
        let namespace = camera.rfind('/').map_or("", |at| &camera[..at]);
        if best.frame_id != *frame && !best.name.starts_with(namespace) {
            self.notes.push(format!("camera_info: none belongs to {camera}"));
            return None;
        }
        Some(best.name.clone())
    }

    fn pose(&mut self, profile: &Profile) -> Result<Option<PoseSource>> {
        let named = profile.topics.odometry.clone().or_else(|| profile.topics.pose.clone());
        if let Some(topic) = self.topic("pose", &named, &is_pose, &pose_rank)? {
            return Ok(Some(PoseSource::Topic(topic)));
        }
        let frames = ["base_link", "ego_vehicle", "base_footprint", "vehicle"];
        let frame = frames.into_iter().find(|f| self.recording.transforms.track(f).is_some());
        if let Some(frame) = frame {
            self.notes.push(format!("pose: no odometry, so it is taken from /tf of `{frame}`"));
            return Ok(Some(PoseSource::Transform(frame.to_string())));
        }
        let speed = self.topic("speed", &profile.topics.velocity, &is_velocity, &|_| 0)?;
        let yaw_rate = self.topic("yaw rate", &None, &is_yaw_rate, &yaw_rate_rank)?;
        let Some((speed, yaw_rate)) = speed.zip(yaw_rate) else { return Ok(None) };
        self.notes.push(format!(
            "pose: none in the log, so it is integrated from {speed} and {yaw_rate}; the world \
             frame is the car's own"
        ));
        Ok(Some(PoseSource::Integrated { speed, yaw_rate }))
    }
}

fn is_camera(topic: &Topic) -> bool {
    let name = topic.name.to_ascii_lowercase();
    // Pictures that are no photographs: they have the type of a camera and not its content.
    let other = ["depth", "semantic", "segmentation", "instance", "optical_flow", "dvs"];
    matches!(topic.kind, Kind::CompressedImage | Kind::CompressedVideo | Kind::Image)
        && !other.iter().any(|word| name.contains(word))
}

fn is_info(topic: &Topic) -> bool {
    topic.kind == Kind::CameraInfo
}

fn has_radial_speed(topic: &Topic) -> bool {
    let is_speed =
        |field: &String| RADIAL_SPEED_FIELDS.iter().any(|name| field.eq_ignore_ascii_case(name));
    topic.cloud_fields.iter().any(is_speed)
}

fn is_radar(topic: &Topic) -> bool {
    let named = topic.name.to_ascii_lowercase().contains("radar");
    match topic.kind {
        Kind::RadarScan | Kind::RadarTracks => true,
        Kind::PointCloud => {
            let lidar = topic.name.to_ascii_lowercase().contains("lidar");
            has_radial_speed(topic) && (named || !lidar)
        }
        _ => false,
    }
}

fn is_lidar(topic: &Topic) -> bool {
    let named_radar = topic.name.to_ascii_lowercase().contains("radar");
    topic.kind == Kind::PointCloud && !is_radar(topic) && !named_radar
}

fn is_pose(topic: &Topic) -> bool {
    // A goal is a pose that somebody wants, not one that the car had.
    let is_goal = topic.name.to_ascii_lowercase().contains("goal");
    matches!(topic.kind, Kind::Odometry | Kind::Pose) && !is_goal
}

fn is_velocity(topic: &Topic) -> bool {
    matches!(topic.kind, Kind::Twist | Kind::CarlaStatus) && !is_command(topic)
}

/// An IMU, or a twist that turns at all.
fn is_yaw_rate(topic: &Topic) -> bool {
    match &topic.series {
        Series::Imu(_) => true,
        Series::Twist(samples) => !is_command(topic) && samples.iter().any(|s| s.value.1.z != 0.0),
        _ => false,
    }
}

fn yaw_rate_rank(topic: &Topic) -> u32 {
    u32::from(topic.kind != Kind::Imu)
}

fn is_control(topic: &Topic) -> bool {
    matches!(topic.kind, Kind::CarlaControl | Kind::CarlaStatus | Kind::Ackermann)
}

fn is_route(topic: &Topic) -> bool {
    topic.kind == Kind::Path
}

/// A twist that says what was asked for, not what happened.
fn is_command(topic: &Topic) -> bool {
    let name = topic.name.to_ascii_lowercase();
    topic.kind == Kind::Twist && ["cmd", "command", "target"].iter().any(|w| name.contains(w))
}

fn front_rank(topic: &Topic) -> u32 {
    let name = topic.name.to_ascii_lowercase();
    if name.contains("front") || name.contains("top") {
        0
    } else if ["left", "right", "rear", "back"].iter().any(|word| name.contains(word)) {
        2
    } else {
        1
    }
}

fn camera_rank(topic: &Topic) -> u32 {
    // Of two forms of one camera's pictures, compressed ones cost less to read than raw ones; a
    // video comes last, since one lost packet takes others with it.
    let form = match topic.kind {
        Kind::CompressedVideo => 2,
        Kind::Image => 1,
        _ => 0,
    };
    3 * front_rank(topic) + form
}

fn pose_rank(topic: &Topic) -> u32 {
    match topic.kind {
        Kind::Odometry => 0,
        _ => 1,
    }
}

fn control_rank(topic: &Topic) -> u32 {
    match topic.kind {
        Kind::CarlaControl => 0,
        Kind::CarlaStatus => 1,
        _ => 2,
    }
}
