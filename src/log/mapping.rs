//! Which topic is which signal: as a profile says, by the names of a known rig, or by type.
//!
//! Among topics that could all be a signal, names rank them where they say something plain (front
//! before left). Where they do not, the choice is the user's: the error lists them and gives the
//! flag that answers it.

use crate::{
    error::Result,
    log::{
        candidates::{self, BASE_FRAMES, Candidate},
        profile::Profile,
        recording::{Recording, Topic, mapping_error},
        rigs::Rig,
        topics::{Names, matches},
    },
};

/// The chosen topics; names are keys of [`Recording::topics`].
#[derive(Clone, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(default)]
pub struct Mapping {
    /// The rig that the log was recorded with, if it is a known one.
    pub rig: Option<String>,
    pub camera: Option<String>,
    pub camera_info: Option<String>,
    pub lidar: Option<String>,
    pub radar: Option<String>,
    pub pose: Option<PoseSource>,
    pub velocity: Option<String>,
    pub control: Option<String>,
    /// Throttle and brake, where the control has none.
    pub pedals: Option<String>,
    pub route: Option<String>,
    pub weather: Option<String>,
    pub town: Option<String>,
    pub situation: Option<String>,
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
    /// Positions from satellites, headings from an IMU or from a twist that turns. Where there is
    /// a speed, it carries the pose from one position to the next.
    Gnss { fix: String, heading: String, speed: Option<String> },
}

impl Mapping {
    /// Choose the topics of a recording.
    ///
    /// # Errors
    ///
    /// [`Error::Mapping`](crate::error::Error::Mapping) if a topic that the profile names is not
    /// in the log or is of a type that cannot be that signal, or if several topics could be the
    /// camera, the lidar, the radar or the pose and nothing says which. A signal that is merely
    /// absent is not an error here.
    pub fn choose(recording: &Recording, profile: &Profile) -> Result<Mapping> {
        let rig = match &profile.rig {
            Some(name) => Rig::named(name),
            None => {
                let channels = recording.log.channels.values();
                Rig::of_log(&channels.map(|channel| channel.topic.as_str()).collect::<Vec<_>>())
            }
        };
        let mut notes = Vec::new();
        if let Some(rig) = rig.as_ref().filter(|_| profile.rig.is_none()) {
            notes.push(format!("rig: {} ({}), by its topics", rig.name, rig.about));
        }
        let rig_name = rig.as_ref().map(|rig| rig.name.to_string());
        let mut chooser = Chooser { recording, profile, rig, notes };
        let camera = chooser.topic(&candidates::CAMERA)?;
        let camera_info = match (&profile.topics.camera_info, &camera) {
            (None, Some(camera)) => chooser.info_of(camera)?,
            _ => chooser.topic(&candidates::CAMERA_INFO)?,
        };
        Ok(Mapping {
            rig: rig_name,
            camera,
            camera_info,
            lidar: chooser.topic(&candidates::LIDAR)?,
            radar: chooser.topic(&candidates::RADAR)?,
            pose: chooser.pose()?,
            velocity: chooser.topic(&candidates::VELOCITY)?,
            control: chooser.topic(&candidates::CONTROL)?,
            pedals: chooser.topic(&candidates::PEDALS)?,
            route: chooser.topic(&candidates::ROUTE)?,
            weather: chooser.topic(&candidates::WEATHER)?,
            town: chooser.topic(&candidates::TOWN)?,
            situation: chooser.topic(&candidates::SITUATION)?,
            notes: chooser.notes,
        })
    }

    /// What a topic is used as, for people.
    pub fn uses(&self, topic: &str) -> Option<String> {
        let (pose, speed, heading) = match self.pose.clone() {
            Some(PoseSource::Topic(topic)) => (Some(topic), None, None),
            Some(PoseSource::Integrated { speed, yaw_rate }) => (None, Some(speed), Some(yaw_rate)),
            Some(PoseSource::Gnss { fix, heading, speed }) => (Some(fix), speed, Some(heading)),
            Some(PoseSource::Transform(_)) | None => (None, None, None),
        };
        let uses = [
            ("camera", &self.camera),
            ("camera calibration", &self.camera_info),
            ("lidar", &self.lidar),
            ("radar", &self.radar),
            ("ego pose", &pose),
            ("ego pose (speed)", &speed),
            ("ego pose (yaw rate)", &heading),
            ("velocity, where the pose has none", &self.velocity),
            ("control", &self.control),
            ("pedals", &self.pedals),
            ("route", &self.route),
            ("weather", &self.weather),
            ("town", &self.town),
            ("junction, speed limit and command", &self.situation),
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
    profile: &'r Profile,
    rig: Option<Rig>,
    notes: Vec<String>,
}

impl<'r> Chooser<'r> {
    /// Topics of the log that could be a signal.
    fn fitting(&self, candidate: &Candidate) -> Vec<&'r Topic> {
        let ignored = &self.profile.topics.ignore;
        let topics = self.recording.topics.values().filter(|topic| !topic.series.is_empty());
        topics
            .filter(|topic| !ignored.contains(&topic.name))
            .filter(|topic| (candidate.fits)(topic, self.recording))
            .collect()
    }

    /// The topic of a signal: the one that the profile names, else the one that the rig names,
    /// else the one that ranks first by type and name.
    fn topic(&mut self, candidate: &Candidate) -> Result<Option<String>> {
        let fitting = self.fitting(candidate);
        if let Some(names) = (candidate.named)(&self.profile.topics) {
            let Some(named) = of_names(&fitting, names) else {
                return Err(self.not_there(candidate.signal, names, &fitting));
            };
            return self.best_of(candidate, &named);
        }
        if let Some(rig) = &self.rig
            && let Some(names) = (candidate.named)(&rig.topics)
        {
            if let Some(named) = of_names(&fitting, names) {
                return self.best_of(candidate, &named);
            }
            if !fitting.is_empty() {
                self.notes.push(format!(
                    "{}: found by type; {} would have {names}",
                    candidate.signal, rig.name
                ));
            }
        }
        self.best_of(candidate, &fitting)
    }

    /// The topic of the lowest rank.
    fn best_of(&mut self, candidate: &Candidate, topics: &[&Topic]) -> Result<Option<String>> {
        let mut ranked: Vec<_> = topics.iter().map(|t| ((candidate.rank)(t), *t)).collect();
        ranked.sort_by_key(|(rank, topic)| (*rank, &topic.name));
        let Some((best_rank, best)) = ranked.first().copied() else { return Ok(None) };
        let equals: Vec<&Topic> =
            ranked.iter().filter(|(rank, _)| *rank == best_rank).map(|(_, topic)| *topic).collect();
        if (candidate.is_question)(&equals) {
            return Err(self.question(candidate.signal, &equals));
        }
        if ranked.len() > 1 {
            let others: Vec<_> = ranked[1..].iter().map(|(_, t)| t.name.as_str()).collect();
            let (signal, others) = (candidate.signal, others.join(", "));
            let note = format!("{signal}: {} taken, not {others}", best.name);
            // A velocity may be asked for more than once.
            if !self.notes.contains(&note) {
                self.notes.push(note);
            }
        }
        Ok(Some(best.name.clone()))
    }

    /// A topic that the user named cannot be the signal.
    fn not_there(&self, signal: &str, names: &Names, fitting: &[&Topic]) -> crate::error::Error {
        let have: Vec<_> = fitting.iter().map(|topic| topic.name.as_str()).collect();
        let have = if have.is_empty() { "none".to_string() } else { have.join(", ") };
        let unused = &self.recording.unused;
        let unused = unused.iter().find(|unused| names.iter().any(|name| name == unused.topic));
        let why = unused.map_or("it is not in the log, or empty".to_string(), |unused| {
            format!("{}: {}", unused.type_name, unused.why)
        });
        let what = format!("topic `{names}` cannot be the {signal} ({why})");
        let hint = format!("topics that could be the {signal}: {have}");
        mapping_error(&self.recording.log, what, &hint)
    }

    /// Which of several topics it is, nothing says.
    fn question(&self, signal: &str, topics: &[&Topic]) -> crate::error::Error {
        let listed = topics.iter().map(|topic| match topic.frame_id.as_str() {
            "" => topic.name.clone(),
            frame => format!("{} (frame {frame})", topic.name),
        });
        let listed: Vec<_> = listed.collect();
        let what = format!("{} topics could be the {signal}: {}", listed.len(), listed.join(", "));
        let hint = format!(
            "say which: --topic {signal}={}, or `{signal}` in the [topics] of a profile",
            topics[0].name
        );
        mapping_error(&self.recording.log, what, &hint)
    }

    /// The calibration of a camera: the one that the rig names, the one of its frame, or the one
    /// that lies nearest by name.
    fn info_of(&mut self, camera: &str) -> Result<Option<String>> {
        let infos = self.fitting(&candidates::CAMERA_INFO);
        let Some(camera_topic) = self.recording.topics.get(camera) else { return Ok(None) };
        let frame = &camera_topic.frame_id;
        let shared =
            |name: &str| name.bytes().zip(camera.bytes()).take_while(|(a, b)| a == b).count();
        let nearest = |info: &&&Topic| (info.frame_id == *frame, shared(&info.name));
        let Some(best) = infos.iter().max_by_key(nearest) else { return Ok(None) };
        let namespace = camera.rfind('/').map_or("", |at| &camera[..at]);
        if best.frame_id != *frame && !best.name.starts_with(namespace) {
            self.notes.push(format!("camera_info: none belongs to {camera}"));
            return Ok(None);
        }
        Ok(Some(best.name.clone()))
    }

    /// The ego pose, from the best that there is: odometry, a pose, `/tf`, a speed and a yaw rate,
    /// positions from satellites. What the user names comes before all of them.
    fn pose(&mut self) -> Result<Option<PoseSource>> {
        let wanted = &self.profile.topics;
        let is_gnss_wanted =
            wanted.gnss.is_some() && wanted.odometry.is_none() && wanted.pose.is_none();
        if is_gnss_wanted && let Some(gnss) = self.gnss()? {
            return Ok(Some(gnss));
        }
        let poses = [&candidates::ODOMETRY, &candidates::POSE];
        let is_named = |candidate: &&&Candidate| (candidate.named)(wanted).is_some();
        let named = poses.iter().filter(is_named);
        let unnamed = poses.iter().filter(|candidate| !is_named(candidate));
        for candidate in named.chain(unnamed) {
            if let Some(topic) = self.topic(candidate)? {
                return Ok(Some(PoseSource::Topic(topic)));
            }
        }
        self.note_own_frame_poses();
        if let Some(frame) = self.moving_frame() {
            self.notes.push(format!("pose: no odometry, so it is taken from /tf of `{frame}`"));
            return Ok(Some(PoseSource::Transform(frame)));
        }
        let speed = self.topic(&candidates::VELOCITY)?;
        let yaw_rate = self.topic(&candidates::YAW_RATE)?;
        if let Some((speed, yaw_rate)) = speed.zip(yaw_rate) {
            self.notes.push(format!(
                "pose: none in the log, so it is integrated from {speed} and {yaw_rate}; the \
                 world frame is the car's own"
            ));
            return Ok(Some(PoseSource::Integrated { speed, yaw_rate }));
        }
        self.gnss()
    }

    fn gnss(&mut self) -> Result<Option<PoseSource>> {
        let fix = self.topic(&candidates::GNSS)?;
        let heading = self.topic(&candidates::YAW_RATE)?;
        let Some((fix, heading)) = fix.zip(heading) else { return Ok(None) };
        let speed = self.topic(&candidates::VELOCITY)?;
        self.notes.push(format!(
            "pose: from the positions of {fix} and the headings of {heading}; the world is the \
             plane that touches the earth at the first fix, x east, y north"
        ));
        Ok(Some(PoseSource::Gnss { fix, heading, speed }))
    }

    /// Say of poses of the car in its own frame that they are none.
    fn note_own_frame_poses(&mut self) {
        let is_own = |topic: &&Topic| candidates::is_own_frame_pose(topic, self.recording);
        for topic in self.recording.topics.values().filter(is_own) {
            self.notes.push(format!(
                "pose: {} is told in the car's own frame (`{}`), so it is not how the car moves",
                topic.name, topic.frame_id
            ));
        }
    }

    /// The frame of the car, if `/tf` moves it.
    fn moving_frame(&mut self) -> Option<String> {
        let tree = &self.recording.transforms;
        if let Some(base) = &self.profile.ego.base {
            return tree.motion(base).map(|_| base.clone());
        }
        let named = BASE_FRAMES.into_iter().find(|frame| tree.motion(frame).is_some());
        if let Some(frame) = named {
            return Some(frame.to_string());
        }
        let moving: Vec<&str> = tree.moving().collect();
        if let [only] = moving[..] {
            return Some(only.to_string());
        }
        if !moving.is_empty() {
            self.notes.push(format!(
                "pose: none of the moving frames {} has the name of a car's (profile key ego.base)",
                moving.join(", ")
            ));
        }
        None
    }
}

/// Topics of the first of several names that is there.
fn of_names<'r>(topics: &[&'r Topic], names: &Names) -> Option<Vec<&'r Topic>> {
    names.iter().find_map(|name| {
        let named: Vec<_> = topics.iter().filter(|t| matches(name, &t.name)).copied().collect();
        (!named.is_empty()).then_some(named)
    })
}
