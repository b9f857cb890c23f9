//! A log opened as a drive: its topics chosen, its grid laid, its frames ready to be made.

use std::{collections::BTreeMap, path::Path as FilePath};

use glam::{DQuat, DVec3};
use serde::{Deserialize, Serialize};

use crate::{
    dataset::{
        align::{self, Grid, Signals, Tick},
        control::Controls,
        ego::EgoTrack,
        footage::{Footage, LeftOut},
        future::future,
        picture::{self, Decoded},
        ralidar::{lidar_pixels, radar_pixels},
        route::{Path, command},
    },
    drops::Reason,
    error::Result,
    frame::{Conditions, Frame, Route, Skew},
    log::{
        APPLIED_CONTROL, CONDITIONS_RECORD, image,
        mapping::{Mapping, PoseSource},
        profile::Profile,
        reader::Place,
        recording::{Recording, Series, Stamped, Topic, mapping_error},
        signals::Pose,
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
    /// Intrinsics of the recorded picture, where the log has them.
    pub camera: Option<Camera>,
    /// What was assumed, chosen or found, for people.
    pub notes: Vec<String>,
    /// Sensors that the log has and frames will not: each says why.
    pub left_out: Vec<String>,
    controls: Controls,
    track: EgoTrack,
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

/// A JPEG and the camera that would have taken it.
type StoredPicture = (Vec<u8>, Option<Camera>);

/// Stored pictures of a video by their places, or why there is none.
type Filmed = BTreeMap<(u32, u32), Result<StoredPicture, LeftOut>>;

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
    /// Scan a log, choose its topics and lay the grid.
    ///
    /// # Errors
    ///
    /// If the file is no readable log, has no messages, lacks a camera or an ego pose, has a
    /// lidar or radar that cannot be placed relative to the camera, or if the profile names a
    /// topic that is not there.
    pub fn open(path: &FilePath, profile: &Profile, rate_hz: f64) -> Result<Drive> {
        let recording = Recording::scan(path)?;
        if recording.log.message_count() == 0 {
            let what = "the log has no messages";
            let hint = "was anything published while it was recorded? \
                        `pmp-ingest inspect LOG` shows its topics";
            return Err(mapping_error(&recording.log, what.to_string(), hint));
        }
        let mapping = Mapping::choose(&recording, profile)?;
        let tolerance_ns = align::nanos(profile.tolerance_ms.ego);
        let track = EgoTrack::new(&recording, &mapping, tolerance_ns)?;
        let topic = |name: &Option<String>| recording.topics.get(name.as_ref()?);
        let Some(camera_topic) = topic(&mapping.camera) else {
            let hint = "frames need a camera: sensor_msgs/CompressedImage or sensor_msgs/Image; \
                        `pmp-ingest inspect LOG` shows what the log has";
            return Err(mapping_error(&recording.log, "no camera".into(), hint));
        };

        let footage = camera_topic.video.as_ref().map(Footage::new).transpose();
        let footage = footage.map_err(|(what, hint)| {
            let what = format!("the camera {} cannot be read: {what}", camera_topic.name);
            mapping_error(&recording.log, what, hint)
        })?;

        let mut notes = mapping.notes.clone();
        let mut left_out = Vec::new();
        notes.extend(track.notes.iter().cloned());
        let applied = recording.log.metadata.get(CONDITIONS_RECORD);
        let applied = applied.and_then(|record| record.get(APPLIED_CONTROL)).cloned();
        let controls = Controls::new(topic(&mapping.control), topic(&applied), profile, &track);
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
            Sensor::place(&recording, &mapping, camera_topic, topic).map(Some)
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
            ego: &track,
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
                        time; `pmp-ingest inspect LOG` shows when each begins and ends";
            return Err(mapping_error(&recording.log, what, hint));
        };
        let planned = match topic(&mapping.route).map(|topic| &topic.series) {
            Some(Series::Path(paths)) => paths
                .iter()
                .filter(|path| path.value.len() > 1)
                .map(|path| Stamped { stamp_ns: path.stamp_ns, value: Path::planned(&path.value) })
                .collect(),
            _ => Vec::new(),
        };
        let conditions = conditions(&recording, profile);
        let driven = Path::driven(&track);
        let profile = profile.clone();
        Ok(Drive {
            mapping,
            profile,
            grid,
            conditions,
            camera,
            notes,
            left_out,
            controls,
            track,
            driven,
            planned,
            footage,
            lidar,
            radar,
            recording,
        })
    }

    /// What is worth keeping beside the frames.
    ///
    /// # Errors
    ///
    /// If the profile's crop does not lie inside the picture.
    pub fn calibration(&self) -> Result<Calibration> {
        let stored = |camera: &Camera| self.stored_camera(camera, camera.width, camera.height);
        Ok(Calibration { camera: self.camera.as_ref().map(stored).transpose()? })
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
    /// If the log cannot be read any more, or the profile's crop does not fit its pictures.
    pub fn frames(&self, ticks: &[Tick]) -> Result<Vec<Made>> {
        let messages = self.fetch(ticks)?;
        let filmed = self.filmed(ticks)?;
        ticks.iter().map(|tick| self.frame(tick, &messages, &filmed)).collect()
    }

    /// The messages that some ticks need, each segment of the log read once; those of a video,
    /// which need more than these, are read where it is decoded.
    fn fetch(&self, ticks: &[Tick]) -> Result<BTreeMap<(u32, u32), Vec<u8>>> {
        let mut wanted: BTreeMap<u32, Vec<Place>> = BTreeMap::new();
        for tick in ticks {
            let image = Some(&tick.image).filter(|_| self.footage.is_none());
            let heavy = [image, tick.lidar.as_ref(), tick.radar.as_ref()];
            for sample in heavy.into_iter().flatten() {
                wanted.entry(sample.value.segment).or_default().push(sample.value);
            }
        }
        let mut messages = BTreeMap::new();
        for (segment, places) in wanted {
            let bytes = self.recording.log.segment(segment)?;
            for place in places {
                let (start, end) = (place.start as usize, (place.start + place.len) as usize);
                messages.insert((place.segment, place.start), bytes[start..end].to_vec());
            }
        }
        Ok(messages)
    }

    fn frame(
        &self,
        tick: &Tick,
        messages: &BTreeMap<(u32, u32), Vec<u8>>,
        filmed: &Filmed,
    ) -> Result<Made> {
        let bytes = |place: &Place| &messages[&(place.segment, place.start)];
        let mut damaged = Vec::new();
        let place = &tick.image.value;
        let image = match filmed.get(&(place.segment, place.start)) {
            Some(image) => image.clone(),
            None => self.still(bytes(place))?,
        };
        let (image, camera) = match image {
            Ok(image) => image,
            Err((reason, why)) => {
                return Ok(Made { frame: Err((reason, tick.stamp_ns, why)), damaged });
            }
        };
        let mut project = |sensor: &Option<Sensor>, sample: &Option<Stamped<Place>>| {
            let (sensor, sample) = (sensor.as_ref()?, sample.as_ref()?);
            let topic = &self.recording.topics[&sensor.topic];
            let camera_frame = &self.recording.topics[self.mapping.camera.as_ref()?].frame_id;
            let pose =
                self.recording.transforms.lookup(camera_frame, &topic.frame_id, sample.stamp_ns);
            match pose {
                Ok(pose) => {
                    Some((topic, sensor.optical_from_camera.then(&pose), bytes(&sample.value)))
                }
                Err(why) => {
                    damaged.push((sensor.topic.clone(), why));
                    None
                }
            }
        };
        let lidar = project(&self.lidar, &tick.lidar);
        let radar = project(&self.radar, &tick.radar);
        let mut keep = |topic: &Topic, error: crate::error::Error| {
            damaged.push((topic.name.clone(), error.to_string()));
        };
        let lidar = lidar.zip(camera.as_ref()).and_then(|((topic, pose, bytes), camera)| {
            let cloud = topic.decode(bytes);
            let pixels = cloud.and_then(|cloud| lidar_pixels(&cloud, &pose, camera));
            pixels.map_err(|error| keep(topic, error)).ok()
        });
        let radar = radar.zip(camera.as_ref()).and_then(|((topic, pose, bytes), camera)| {
            let returns = topic.decode(bytes);
            let pixels = returns.and_then(|r| radar_pixels(topic.kind, &r, &pose, camera));
            pixels.map_err(|error| keep(topic, error)).ok()
        });

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
            future: future(&self.track, tick.stamp_ns, &tick.ego),
            skew,
            conditions: self.conditions.clone(),
            in_junction: None,
            speed_limit_mps: None,
            perturbed: self.controls.is_perturbed(tick.control.as_ref()),
        };
        Ok(Made { frame: Ok(Box::new(frame)), damaged })
    }

    /// The stored picture of a message that holds one.
    fn still(&self, bytes: &[u8]) -> Result<Result<StoredPicture, LeftOut>> {
        let damaged = |why: String| Ok(Err((Reason::ImageDamaged, why)));
        let Some(topic) = self.camera_topic() else { return damaged("no camera".to_string()) };
        let message = match topic.decode(bytes) {
            Ok(message) => message,
            Err(error) => return damaged(error.to_string()),
        };
        let decoded = image::picture(topic.kind, &message)
            .map_err(|error| error.to_string())
            .and_then(|picture| picture::decode(&picture, &self.profile.camera));
        match decoded {
            Ok(decoded) => self.store(&decoded),
            Err(why) => damaged(why),
        }
    }

    /// The stored pictures of some ticks of a video, by place; nothing where the camera is no video.
    fn filmed(&self, ticks: &[Tick]) -> Result<Filmed> {
        let mut filmed = BTreeMap::new();
        if let Some((footage, topic)) = self.footage.as_ref().zip(self.camera_topic()) {
            let wanted: Vec<Place> = ticks.iter().map(|tick| tick.image.value).collect();
            footage.decode(&self.recording.log, topic, &wanted, &mut |place, picture| {
                let stored = match picture {
                    Ok(rgb) => self.store(&Decoded::whole(rgb))?,
                    Err(left_out) => Err(left_out),
                };
                filmed.insert((place.segment, place.start), stored);
                Ok(())
            })?;
        }
        Ok(filmed)
    }

    fn store(&self, decoded: &Decoded) -> Result<Result<StoredPicture, LeftOut>> {
        let camera = self.camera.as_ref();
        let camera =
            camera.map(|c| self.stored_camera(c, decoded.width, decoded.height)).transpose()?;
        let jpeg = decoded.stored(&self.profile.camera);
        Ok(jpeg.map(|jpeg| (jpeg, camera)).map_err(|why| (Reason::ImageDamaged, why)))
    }

    fn camera_topic(&self) -> Option<&Topic> {
        self.recording.topics.get(self.mapping.camera.as_ref()?)
    }

    /// The camera of the stored picture, when the recorded one has this size.
    fn stored_camera(&self, camera: &Camera, width: usize, height: usize) -> Result<Camera> {
        // Calibrated at another resolution than the pictures have: binning, or scaling on the way.
        let all = Crop { x: 0, y: 0, width: camera.width, height: camera.height };
        let recorded = camera.cropped_and_scaled(all, width, height)?;
        let rule = &self.profile.camera;
        let crop = rule.crop.unwrap_or(Crop { x: 0, y: 0, width, height });
        recorded.cropped_and_scaled(crop, rule.width, rule.height)
    }

    fn route(&self, tick: &Tick) -> Route {
        let current = self.planned.partition_point(|path| path.stamp_ns <= tick.stamp_ns);
        let planned = current.checked_sub(1).and_then(|at| self.planned.get(at));
        planned
            .and_then(|path| path.value.ahead_on_route(&tick.ego))
            .unwrap_or_else(|| self.driven.ahead_of_driver(tick.stamp_ns, &tick.ego))
    }
}

impl Sensor {
    /// Make sure that a sensor can be placed relative to the camera.
    fn place(
        recording: &Recording,
        mapping: &Mapping,
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
        let ego_frame = match &mapping.pose {
            Some(PoseSource::Topic(topic)) => recording.topics[topic].child_frame_id.as_deref(),
            Some(PoseSource::Transform(frame)) => Some(frame.as_str()),
            Some(PoseSource::Integrated { .. }) | None => None,
        };
        let optical_axis = ego_frame
            .and_then(|ego| lookup(ego, &camera.frame_id).ok())
            .map(|p| p.rotation * DVec3::Z);
        // A front camera does not look at the sky: a z axis that points up means that the frame
        // is the camera's body (x forward), whatever its header should name by convention.
        let is_body = optical_axis.is_some_and(|axis| axis.z.abs() > 0.8);
        let rotation =
            if is_body { DQuat::from_xyzw(0.5, -0.5, 0.5, 0.5) } else { DQuat::IDENTITY };
        let optical_from_camera = Pose { position_m: DVec3::ZERO, rotation };
        Ok(Sensor { topic: sensor.name.clone(), optical_from_camera })
    }
}

/// Conditions from the log's metadata, completed by the profile.
fn conditions(recording: &Recording, profile: &Profile) -> Conditions {
    let record = recording.log.metadata.get(CONDITIONS_RECORD);
    let get = |key: &str, fallback: &Option<String>| {
        record.and_then(|record| record.get(key)).cloned().or_else(|| fallback.clone())
    };
    Conditions {
        town: get("town", &profile.conditions.town),
        weather: get("weather", &profile.conditions.weather),
        illumination: get("illumination", &profile.conditions.illumination),
        traffic: get("traffic", &profile.conditions.traffic),
    }
}
