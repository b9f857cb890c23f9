//! A log opened as a drive: its topics chosen, its grid laid, its frames ready to be made.

use std::{path::Path as FilePath, sync::Arc};

use serde::{Deserialize, Serialize};

use crate::{
    dataset::{
        align::{self, Grid, Signals, Tick},
        clocks,
        conditions::conditions,
        control::Controls,
        future::future,
        motion::Motion,
        route::{self, Path, command},
        senses::Senses,
        shown::Shown,
        stock::Stock,
    },
    drops::Reason,
    error::{Error, Result},
    frame::{Conditions, Frame, Route, Skew},
    log::{
        APPLIED_CONTROL, CONDITIONS_RECORD,
        candidates::measures_no_speed,
        mapping::Mapping,
        profile::Profile,
        recording::{Recording, Series, Stamped, Topic, Unused, mapping_error, nearest},
        rigs::Rig,
        signals::Situation,
    },
    projection::Camera,
};

/// A log, ready to give frames.
#[derive(Debug)]
pub struct Drive {
    pub recording: Recording,
    pub mapping: Mapping,
    pub profile: Profile,
    pub grid: Grid,
    pub conditions: Conditions,
    /// What was assumed, chosen or found, for people.
    pub notes: Vec<String>,
    /// Sensors that the log has and frames will not: each says why.
    pub left_out: Vec<String>,
    /// The topic of what moved the car, where that is not always what the driver wanted.
    pub applied_control: Option<String>,
    controls: Controls,
    motion: Motion,
    driven: Path,
    /// Planned routes by the time from which they hold.
    planned: Vec<Stamped<Path>>,
    /// What a map told, ascending by stamp.
    situations: Vec<Stamped<Situation>>,
    /// Camera, lidar and radar.
    pub senses: Senses,
    /// What was made of messages while the log was scanned; nothing, unless it is set.
    pub stock: Arc<Stock>,
}

/// What became of a tick.
#[derive(Debug)]
pub struct Made {
    pub frame: Result<Box<Frame>, (Reason, i64, String)>,
    /// Sensor samples of this tick that could not be decoded: topic and why.
    pub damaged: Vec<(String, String)>,
}

/// What is known of a drive besides its frames.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Calibration {
    /// Intrinsics of the stored picture.
    pub camera: Option<Camera>,
}

impl Drive {
    /// Scan a log and open its first drive; [`Recording::scan`] gives all of them.
    ///
    /// # Errors
    ///
    /// If the file is no readable log, and as [`Drive::new`].
    pub fn open(path: &FilePath, profile: &Profile, rate_hz: f64) -> Result<Drive> {
        Drive::new(Recording::scan(path, &profile.clock)?.swap_remove(0), profile, rate_hz)
    }

    /// Choose the topics of a recording and lay the grid.
    ///
    /// # Errors
    ///
    /// If the log has no messages, lacks a camera or an ego pose, has a lidar or radar that cannot
    /// be placed relative to the camera, has streams whose stamps do not overlap, or if the profile
    /// names a topic that is not there.
    pub fn new(recording: Recording, profile: &Profile, rate_hz: f64) -> Result<Drive> {
        if recording.log.message_count() == 0 {
            let what = "the log has no messages";
            let hint = "was anything published while it was recorded? \
                        `pmp-ingest inspect LOG` shows its topics";
            return Err(mapping_error(&recording.log, what.to_string(), hint));
        }
        let unreadable = unreadable(&recording, profile);
        let explain = |error| explained(error, &unreadable);
        let mapping = Mapping::choose(&recording, profile).map_err(explain)?;
        let rig = mapping.rig.as_deref().and_then(Rig::named);
        let profile = profile.on(rig.as_ref());
        let tolerance_ns = align::nanos(profile.tolerance_ms.ego);
        let motion =
            Motion::new(&recording, &mapping, &profile.ego, tolerance_ns).map_err(explain)?;
        let topic = |name: &Option<String>| recording.topics.get(name.as_ref()?);
        let Some(camera_topic) = topic(&mapping.camera) else {
            let hint = "frames need a camera: sensor_msgs/CompressedImage or sensor_msgs/Image; \
                        `pmp-ingest inspect LOG` shows what the log has";
            return Err(explain(mapping_error(&recording.log, "no camera".into(), hint)));
        };

        let mut notes = mapping.notes.clone();
        notes.extend(unreadable.iter().cloned());
        notes.extend(clocks::notes(&recording, &mapping, &profile));
        let mut left_out =
            clocks::check_overlap(&recording, &mapping, &profile.required, &motion.track)?;
        notes.extend(motion.notes.iter().cloned());
        let applied = recording.log.metadata.get(CONDITIONS_RECORD);
        let applied = applied.and_then(|record| record.get(APPLIED_CONTROL)).cloned();
        let (control, pedals) = (topic(&mapping.control), topic(&mapping.pedals));
        let controls = Controls::new(control, pedals, topic(&applied), &profile, &motion.track);
        notes.extend(controls.notes.iter().cloned());
        let senses = Senses::new(
            &recording,
            &mapping,
            camera_topic,
            &motion,
            &profile,
            &mut notes,
            &mut left_out,
        )?;

        let located = |topic: Option<&Topic>| match topic.map(|topic| &topic.series) {
            Some(Series::Located(samples)) => samples.clone(),
            _ => Vec::new(),
        };
        let of = |name: Option<&str>| located(name.and_then(|name| recording.topics.get(name)));
        let (lidar_samples, radar_samples) = (of(senses.lidar()), of(senses.radar()));
        let signals = Signals {
            ego: &motion.track,
            camera: &located(Some(camera_topic)),
            lidar: &lidar_samples,
            radar: &radar_samples,
            control: &controls.samples,
        };
        let period_ns = align::period_ns(rate_hz);
        let grid = align::align(&signals, &profile.tolerance_ms, &profile.required, period_ns);
        let Some(grid) = grid else {
            let what = "there is no instant at which all required signals exist".to_string();
            let hint = "the camera, the ego pose and what the profile requires must overlap in \
                        time; `pmp-ingest inspect --json LOG` shows when each begins and ends, \
                        and --offset or --clock put a clock right";
            return Err(mapping_error(&recording.log, what, hint));
        };
        let (planned, unplaced) =
            route::planned(topic(&mapping.route), &motion, &recording.transforms);
        left_out.extend(unplaced);
        if let Some(topic) = topic(&mapping.radar).filter(|topic| measures_no_speed(topic)) {
            notes.push(format!(
                "radar: {} measures no radial speed, so radar_speed is null; its returns are kept",
                topic.name
            ));
        }
        let conditions = conditions(&recording, &mapping, &profile, &mut notes);
        let situations = match topic(&mapping.situation).map(|topic| &topic.series) {
            Some(Series::Situation(samples)) => samples.clone(),
            _ => Vec::new(),
        };
        let driven = Path::driven(&motion.track);
        Ok(Drive {
            mapping,
            profile,
            grid,
            conditions,
            notes,
            left_out,
            applied_control: applied,
            controls,
            motion,
            driven,
            planned,
            situations,
            senses,
            recording,
            stock: Arc::default(),
        })
    }

    /// What is worth keeping beside the frames.
    pub fn calibration(&self) -> Calibration {
        Calibration { camera: self.senses.stored_camera.clone() }
    }

    /// Distance driven from the first to the last tick, metres, seen from above.
    pub fn distance_m(&self) -> f64 {
        let ticks = self.grid.ticks.windows(2);
        let step = |w: &[Tick]| (w[1].ego.position_m - w[0].ego.position_m).truncate().length();
        ticks.map(step).sum()
    }

    /// Make the frames of some of the grid's ticks, in their order.
    ///
    /// # Errors
    ///
    /// If the log cannot be read any more.
    pub fn frames(&self, ticks: &[Tick]) -> Result<Vec<Made>> {
        let shown = Shown::new(&self.senses, &self.recording, ticks, &self.stock)?;
        Ok(ticks.iter().map(|tick| self.frame(tick, &shown)).collect())
    }

    fn frame(&self, tick: &Tick, shown: &Shown) -> Made {
        let mut damaged = Vec::new();
        let image = match shown.picture(tick) {
            Ok(jpeg) => jpeg.to_vec(),
            Err((reason, why)) => {
                return Made { frame: Err((reason, tick.stamp_ns, why)), damaged };
            }
        };
        let mut keep = |topic: Option<&str>, why: &str| {
            damaged.push((topic.unwrap_or_default().to_string(), why.to_string()));
        };
        let lidar = shown
            .lidar(tick)
            .and_then(|lidar| lidar.cloned().map_err(|why| keep(self.senses.lidar(), why)).ok());
        let radar = shown
            .radar(tick)
            .and_then(|radar| radar.cloned().map_err(|why| keep(self.senses.radar(), why)).ok());

        let skew = |stamp_ns: i64| (stamp_ns - tick.stamp_ns) as i32;
        let skew = Skew {
            image_ns: skew(tick.image.stamp_ns),
            lidar_ns: lidar.as_ref().and(tick.lidar.as_ref()).map(|s| skew(s.stamp_ns)),
            radar_ns: radar.as_ref().and(tick.radar.as_ref()).map(|s| skew(s.stamp_ns)),
            control_ns: tick.control.as_ref().map(|s| skew(s.stamp_ns)),
        };
        let route = self.route(tick);
        let situation = self.situation(tick);
        let frame = Frame {
            index: tick.index,
            stamp_ns: tick.stamp_ns,
            image,
            lidar,
            radar,
            velocity_mps: tick.ego.velocity_mps.map(|v| v as f32),
            yaw_rad: tick.ego.yaw_rad,
            position_m: tick.ego.position_m.to_array(),
            action: self.controls.action(tick.control.as_ref().map(|sample| &sample.value)),
            command: situation.map_or_else(|| command(&route), |situation| situation.command),
            route,
            future: future(&self.motion.track, tick.stamp_ns, &tick.ego),
            skew,
            conditions: self.conditions.clone(),
            in_junction: situation.map(|situation| situation.in_junction),
            speed_limit_mps: situation.map(|situation| situation.speed_limit_mps as f32),
            perturbed: self.controls.is_perturbed(tick.control.as_ref()),
        };
        Made { frame: Ok(Box::new(frame)), damaged }
    }

    /// What a map tells of the place at a tick, told as near to it as controls have to be.
    fn situation(&self, tick: &Tick) -> Option<&Situation> {
        let near = nearest(&self.situations, tick.stamp_ns)?;
        let tolerance_ns = align::nanos(self.profile.tolerance_ms.control);
        let is_near = near.stamp_ns.abs_diff(tick.stamp_ns) <= tolerance_ns as u64;
        is_near.then_some(&near.value)
    }

    fn route(&self, tick: &Tick) -> Route {
        let current = self.planned.partition_point(|path| path.stamp_ns <= tick.stamp_ns);
        let planned = current.checked_sub(1).and_then(|at| self.planned.get(at));
        planned
            .and_then(|path| path.value.ahead_on_route(&tick.ego))
            .unwrap_or_else(|| self.driven.ahead_of_driver(tick.stamp_ns, &tick.ego))
    }
}

/// Topics that could be used if their encoding were read, each with the reason why it is not.
fn unreadable(recording: &Recording, profile: &Profile) -> Vec<String> {
    let could_be = recording.unused.iter().filter(|unused| unused.kind.is_some());
    let not_ignored = could_be.filter(|unused| !profile.topics.ignore.contains(&unused.topic));
    let tell = |unused: &Unused| format!("{} ({}): {}", unused.topic, unused.type_name, unused.why);
    not_ignored.map(tell).collect()
}

/// An error about a signal that is missing, with the topics that were not read.
fn explained(error: Error, unreadable: &[String]) -> Error {
    match error {
        Error::Mapping { path, what, hint } if !unreadable.is_empty() => {
            let hint = format!("{hint}; topics that could not be read: {}", unreadable.join(", "));
            Error::Mapping { path, what, hint }
        }
        error => error,
    }
}
