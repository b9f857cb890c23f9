//! A log opened as a drive: its topics chosen, its grid laid, its frames ready to be made.

use std::{collections::BTreeMap, path::Path as FilePath};

use glam::{DQuat, DVec3};
use serde::{Deserialize, Serialize};

use crate::{
    dataset::{
        align::{self, Grid, Signals, Tick},
        clocks,
        conditions::conditions,
        control::Controls,
        footage::{Footage, LeftOut},
        future::future,
        motion::Motion,
        picture::{self, Decoded},
        ralidar::{lidar_pixels, radar_pixels},
        route::{self, Path, command},
    },
    drops::Reason,
    error::{Error, Result},
    frame::{Conditions, Frame, LidarPixels, RadarPixels, Route, Skew},
    log::{
        APPLIED_CONTROL, CONDITIONS_RECORD,
        candidates::measures_no_speed,
        image,
        mapping::Mapping,
        profile::{CameraRule, Profile},
        reader::{Place, SegmentReader},
        recording::{Recording, Series, Stamped, Topic, Unused, mapping_error},
        rigs::Rig,
        signals::Pose,
        value::Struct,
    },
    projection::{Camera, Crop},
};

/// A log, ready to give frames.
#[derive(Debug)]
pub struct Drive {
    pub recording: Recording,
    pub mapping: Mapping,
    pub profile: Profile,
    pub grid: Grid,
    pub conditions: Conditions,
    /// Intrinsics of the stored picture, where the log has them.
    pub stored_camera: Option<Camera>,
    /// What was assumed, chosen or found, for people.
    pub notes: Vec<String>,
    /// Sensors that the log has and frames will not: each says why.
    pub left_out: Vec<String>,
    /// Width and height of the recorded pictures.
    picture_size: (usize, usize),
    /// The topic of what moved the car, where that is not always what the driver wanted.
    pub applied_control: Option<String>,
    controls: Controls,
    motion: Motion,
    driven: Path,
    /// Planned routes by the time from which they hold.
    planned: Vec<Stamped<Path>>,
    /// Of a camera whose pictures depend on each other.
    footage: Option<Footage>,
    lidar: Option<Sensor>,
    radar: Option<Sensor>,
}

/// A lidar or radar whose returns can be brought onto the picture.
#[derive(Debug)]
struct Sensor {
    topic: String,
    /// Rotates the camera's frame where its axes are those of a body (x forward).
    optical_from_camera: Pose,
}

/// Which signal a large message belongs to.
#[derive(Clone, Copy, Debug)]
enum Signal {
    Camera,
    Lidar,
    Radar,
}

/// What a large message shows, or why it shows nothing.
#[derive(Debug)]
enum Sensed {
    /// JPEG as stored.
    Picture(Result<Vec<u8>, LeftOut>),
    Lidar(Result<LidarPixels, String>),
    Radar(Result<RadarPixels, String>),
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

        let footage = camera_topic.video.as_ref().map(Footage::new).transpose();
        let footage = footage.map_err(|(what, hint)| {
            let what = format!("the camera {} cannot be read: {what}", camera_topic.name);
            mapping_error(&recording.log, what, hint)
        })?;

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
        let camera = match topic(&mapping.camera_info).map(|topic| &topic.series) {
            Some(Series::CameraInfo(infos)) => {
                if infos.len() > 1 {
                    notes.push("camera_info: the calibration changes; the first is used".into());
                }
                infos.first().map(|info| info.value.clone())
            }
            _ => None,
        };
        let mut sensor = |name: &Option<String>, signal: &str| -> Result<Option<Sensor>> {
            let Some(topic) = topic(name) else { return Ok(None) };
            if camera.is_none() {
                left_out.push(format!(
                    "{signal} {}: the camera has no calibration, so nothing can be projected",
                    topic.name
                ));
                return Ok(None);
            }
            Sensor::place(&recording, &motion, camera_topic, topic).map(Some)
        };
        let lidar = sensor(&mapping.lidar, "lidar")?;
        let radar = sensor(&mapping.radar, "radar")?;

        let located = |topic: Option<&Topic>| match topic.map(|topic| &topic.series) {
            Some(Series::Located(samples)) => samples.clone(),
            _ => Vec::new(),
        };
        let of = |sensor: &Option<Sensor>| {
            located(sensor.as_ref().and_then(|sensor| recording.topics.get(&sensor.topic)))
        };
        let (lidar_samples, radar_samples) = (of(&lidar), of(&radar));
        let signals = Signals {
            ego: &motion.track,
            camera: &located(Some(camera_topic)),
            lidar: &lidar_samples,
            radar: &radar_samples,
            control: &controls.samples,
        };
        let period_ns = (1e9 / rate_hz) as i64;
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
        let picture_size =
            picture_size(&recording, camera_topic, footage.as_ref(), &profile.camera)?;
        let stored = |camera: &Camera| stored_camera(camera, picture_size, &profile.camera);
        let stored_camera = camera.as_ref().map(stored).transpose()?;
        let conditions = conditions(&recording, &mapping, &profile, &mut notes);
        let driven = Path::driven(&motion.track);
        Ok(Drive {
            mapping,
            profile,
            grid,
            conditions,
            stored_camera,
            picture_size,
            notes,
            left_out,
            applied_control: applied,
            controls,
            motion,
            driven,
            planned,
            footage,
            lidar,
            radar,
            recording,
        })
    }

    /// Whether frames can have lidar returns.
    pub fn has_lidar(&self) -> bool {
        self.lidar.is_some()
    }

    /// Whether frames can have radar returns.
    pub fn has_radar(&self) -> bool {
        self.radar.is_some()
    }

    /// What is worth keeping beside the frames.
    pub fn calibration(&self) -> Calibration {
        Calibration { camera: self.stored_camera.clone() }
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
        let sensed = self.sense(ticks)?;
        Ok(ticks.iter().map(|tick| self.frame(tick, &sensed)).collect())
    }

    /// What the pictures and clouds of some ticks show, by the place of their messages, each of
    /// which is read, decoded and brought down to what is stored once, in the order of the file.
    fn sense(&self, ticks: &[Tick]) -> Result<BTreeMap<Place, Sensed>> {
        let mut wanted = BTreeMap::new();
        for tick in ticks {
            if self.footage.is_none() {
                wanted.insert(tick.image.value, (Signal::Camera, tick.image.stamp_ns));
            }
            for (signal, sample) in [(Signal::Lidar, &tick.lidar), (Signal::Radar, &tick.radar)] {
                wanted.extend(sample.as_ref().map(|s| (s.value, (signal, s.stamp_ns))));
            }
        }
        let mut reader = SegmentReader::new(&self.recording.log);
        let mut sensed = BTreeMap::new();
        for (place, (signal, stamp_ns)) in wanted {
            let message = reader.message(&place)?;
            let shown = match signal {
                Signal::Camera => Sensed::Picture(self.picture(message)),
                Signal::Lidar => Sensed::Lidar(self.project(
                    &self.lidar,
                    message,
                    stamp_ns,
                    |topic, message, pose, camera| {
                        lidar_pixels(&topic.decode(message)?, pose, camera)
                    },
                )),
                Signal::Radar => Sensed::Radar(self.project(
                    &self.radar,
                    message,
                    stamp_ns,
                    |topic, message, pose, camera| {
                        radar_pixels(
                            topic.kind,
                            &topic.decode(message)?,
                            &self.profile.radar,
                            pose,
                            camera,
                        )
                    },
                )),
            };
            sensed.insert(place, shown);
        }
        if let Some(footage) = &self.footage {
            let wanted: Vec<Place> = ticks.iter().map(|tick| tick.image.value).collect();
            let log = &self.recording.log;
            footage.decode(log, self.camera_topic(), &wanted, &mut |place, picture| {
                let stored = picture.and_then(|rgb| {
                    let stored = self.store(&Decoded::whole(rgb));
                    stored.map_err(|why| (Reason::ImageDamaged, why))
                });
                sensed.insert(place, Sensed::Picture(stored));
            })?;
        }
        Ok(sensed)
    }

    fn frame(&self, tick: &Tick, sensed: &BTreeMap<Place, Sensed>) -> Made {
        let mut damaged = Vec::new();
        let image = match &sensed[&tick.image.value] {
            Sensed::Picture(Ok(jpeg)) => jpeg.clone(),
            Sensed::Picture(Err((reason, why))) => {
                let frame = Err((*reason, tick.stamp_ns, why.clone()));
                return Made { frame, damaged };
            }
            Sensed::Lidar(_) | Sensed::Radar(_) => unreachable!("the image is the camera's"),
        };
        let mut keep = |sensor: &Option<Sensor>, why: &String| {
            let topic = sensor.as_ref().map(|sensor| sensor.topic.clone()).unwrap_or_default();
            damaged.push((topic, why.clone()));
        };
        let lidar = match tick.lidar.as_ref().map(|sample| &sensed[&sample.value]) {
            Some(Sensed::Lidar(Ok(pixels))) => Some(pixels.clone()),
            Some(Sensed::Lidar(Err(why))) => {
                keep(&self.lidar, why);
                None
            }
            _ => None,
        };
        let radar = match tick.radar.as_ref().map(|sample| &sensed[&sample.value]) {
            Some(Sensed::Radar(Ok(pixels))) => Some(pixels.clone()),
            Some(Sensed::Radar(Err(why))) => {
                keep(&self.radar, why);
                None
            }
            _ => None,
        };

        let skew = |stamp_ns: i64| (stamp_ns - tick.stamp_ns) as i32;
        let skew = Skew {
            image_ns: skew(tick.image.stamp_ns),
            lidar_ns: lidar.as_ref().and(tick.lidar.as_ref()).map(|s| skew(s.stamp_ns)),
            radar_ns: radar.as_ref().and(tick.radar.as_ref()).map(|s| skew(s.stamp_ns)),
            control_ns: tick.control.as_ref().map(|s| skew(s.stamp_ns)),
        };
        let route = self.route(tick);
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
            command: command(&route),
            route,
            future: future(&self.motion.track, tick.stamp_ns, &tick.ego),
            skew,
            conditions: self.conditions.clone(),
            in_junction: None,
            speed_limit_mps: None,
            perturbed: self.controls.is_perturbed(tick.control.as_ref()),
        };
        Made { frame: Ok(Box::new(frame)), damaged }
    }

    /// The picture of a message as it is stored, or why there is none.
    fn picture(&self, message: &[u8]) -> Result<Vec<u8>, LeftOut> {
        let message = self.camera_topic().decode(message).map_err(|error| error.to_string());
        let stored = message.and_then(|message| {
            self.store(&recorded_picture(self.camera_topic(), &message, &self.profile.camera)?)
        });
        stored.map_err(|why| (Reason::ImageDamaged, why))
    }

    fn store(&self, recorded: &Decoded) -> Result<Vec<u8>, String> {
        if (recorded.width, recorded.height) != self.picture_size {
            let (width, height) = self.picture_size;
            return Err(format!(
                "{} x {} pixels, where the first picture of the drive has {width} x {height}",
                recorded.width, recorded.height
            ));
        }
        recorded.stored(&self.profile.camera)
    }

    /// Bring the returns of a sensor's message onto the stored picture.
    fn project<T>(
        &self,
        sensor: &Option<Sensor>,
        message: &[u8],
        stamp_ns: i64,
        pixels: impl Fn(&Topic, &[u8], &Pose, &Camera) -> Result<T>,
    ) -> Result<T, String> {
        let (Some(sensor), Some(camera)) = (sensor, &self.stored_camera) else {
            unreachable!("a sensor is placed where there is a calibrated camera")
        };
        let recording = &self.recording;
        let topic = &recording.topics[&sensor.topic];
        let camera_frame = &self.camera_topic().frame_id;
        let pose = recording.transforms.lookup(camera_frame, &topic.frame_id, stamp_ns)?;
        let pose = sensor.optical_from_camera.then(&pose);
        pixels(topic, message, &pose, camera).map_err(|error| error.to_string())
    }

    fn camera_topic(&self) -> &Topic {
        let name = self.mapping.camera.as_deref().unwrap_or_default();
        &self.recording.topics[name]
    }

    fn route(&self, tick: &Tick) -> Route {
        let current = self.planned.partition_point(|path| path.stamp_ns <= tick.stamp_ns);
        let planned = current.checked_sub(1).and_then(|at| self.planned.get(at));
        planned
            .and_then(|path| path.value.ahead_on_route(&tick.ego))
            .unwrap_or_else(|| self.driven.ahead_of_driver(tick.stamp_ns, &tick.ego))
    }
}

/// The picture of a message as it was recorded, or what is wrong with it.
fn recorded_picture<'m>(
    topic: &Topic,
    message: &'m Struct,
    rule: &CameraRule,
) -> Result<Decoded<'m>, String> {
    let picture = image::picture(topic.kind, message).map_err(|error| error.to_string())?;
    picture::decode(&picture, rule)
}

/// Width and height of the first picture that can be decoded: those of all pictures of a drive,
/// so that one calibration holds for all its frames.
fn picture_size(
    recording: &Recording,
    camera: &Topic,
    footage: Option<&Footage>,
    rule: &CameraRule,
) -> Result<(usize, usize)> {
    let Series::Located(samples) = &camera.series else { return Ok((0, 0)) };
    let mut reader = SegmentReader::new(&recording.log);
    let mut size = Err("there is none".to_string());
    for sample in samples {
        if let Some(footage) = footage {
            footage.decode(&recording.log, camera, &[sample.value], &mut |_, picture| {
                size = picture.map(|rgb| (rgb.width, rgb.height)).map_err(|(_, why)| why);
            })?;
        } else {
            let message = camera.decode(reader.message(&sample.value)?);
            size = message.map_err(|error| error.to_string()).and_then(|message| {
                recorded_picture(camera, &message, rule).map(|p| (p.width, p.height))
            });
        }
        if let Ok(size) = size {
            return Ok(size);
        }
    }
    let what = format!("none of the {} pictures of {} can be decoded", samples.len(), camera.name);
    let why = size.err().unwrap_or_default();
    Err(mapping_error(&recording.log, what, &format!("the last one: {why}")))
}

/// The camera of the stored picture, when the recorded one has this width and height.
fn stored_camera(
    camera: &Camera,
    (width, height): (usize, usize),
    rule: &CameraRule,
) -> Result<Camera> {
    // Calibrated at another resolution than the pictures have: binning, or scaling on the way.
    let all = Crop { x: 0, y: 0, width: camera.width, height: camera.height };
    let recorded = camera.cropped_and_scaled(all, width, height)?;
    let crop = rule.crop.unwrap_or(Crop { x: 0, y: 0, width, height });
    recorded.cropped_and_scaled(crop, rule.width, rule.height)
}

impl Sensor {
    /// Make sure that a sensor can be placed relative to the camera.
    fn place(
        recording: &Recording,
        motion: &Motion,
        camera: &Topic,
        sensor: &Topic,
    ) -> Result<Sensor> {
        let first_ns = sensor.series.span_ns().map_or(0, |(first_ns, _)| first_ns);
        let last_ns = sensor.series.span_ns().map_or(0, |(_, last_ns)| last_ns);
        let middle_ns = first_ns + (last_ns - first_ns) / 2;
        let lookup =
            |target: &str, source: &str| recording.transforms.lookup(target, source, middle_ns);
        lookup(&camera.frame_id, &sensor.frame_id).map_err(|what| {
            let hint = format!(
                "record /tf_static, or leave {} out with `ignore` in a profile's [topics]",
                sensor.name
            );
            mapping_error(&recording.log, what, &hint)
        })?;
        let base_from_camera = motion.base.base_from(&camera.frame_id, &recording.transforms);
        let optical_axis =
            base_from_camera.map(|base_from_camera| base_from_camera.rotation * DVec3::Z);
        // A front camera does not look at the sky: a z axis that points up means that the frame
        // is the camera's body (x forward), whatever its header should name by convention.
        let is_body = optical_axis.is_some_and(|axis| axis.z.abs() > 0.8);
        let rotation =
            if is_body { DQuat::from_xyzw(0.5, -0.5, 0.5, 0.5) } else { DQuat::IDENTITY };
        let optical_from_camera = Pose { position_m: DVec3::ZERO, rotation };
        Ok(Sensor { topic: sensor.name.clone(), optical_from_camera })
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
