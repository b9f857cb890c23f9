//! What the camera, the lidar and the radar of a drive show, brought down to what is stored.
//!
//! Pictures become JPEGs of one size, clouds become pixels of that picture, each message for itself.

use glam::{DQuat, DVec3};

use crate::{
    dataset::{
        footage::{Footage, LeftOut},
        motion::Motion,
        picture::{self, Decoded},
        ralidar::{lidar_pixels, radar_pixels},
    },
    drops::Reason,
    error::Result,
    frame::{LidarPixels, RadarPixels},
    log::{
        conventions::RadarRule,
        image,
        mapping::Mapping,
        profile::{CameraRule, Profile},
        reader::SegmentReader,
        recording::{Recording, Series, Topic, mapping_error},
        signals::Pose,
        value::Struct,
    },
    projection::{Camera, Crop},
};

/// The sensors of a drive that frames take from.
#[derive(Debug, PartialEq)]
pub struct Senses {
    /// Intrinsics of the stored picture, where the log has them.
    pub stored_camera: Option<Camera>,
    /// Name of its topic.
    camera: String,
    /// Width and height of the recorded pictures.
    picture_size: (usize, usize),
    rule: CameraRule,
    radar_rule: RadarRule,
    /// Of a camera whose pictures depend on each other.
    pub footage: Option<Footage>,
    lidar: Option<Sensor>,
    radar: Option<Sensor>,
}

/// A lidar or radar whose returns can be brought onto the picture.
#[derive(Debug, PartialEq)]
struct Sensor {
    topic: String,
    /// Rotates the camera's frame where its axes are those of a body (x forward).
    optical_from_camera: Pose,
}

/// Which signal a large message belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Signal {
    Camera,
    Lidar,
    Radar,
}

impl Signal {
    pub const ALL: [Signal; 3] = [Signal::Camera, Signal::Lidar, Signal::Radar];
}

/// What a large message shows, or why it shows nothing.
#[derive(Debug)]
pub enum Sensed {
    /// JPEG as stored.
    Picture(Result<Vec<u8>, LeftOut>),
    Lidar(Result<LidarPixels, String>),
    Radar(Result<RadarPixels, String>),
}

impl Senses {
    /// Place the chosen sensors; what is assumed goes to `notes`, what cannot be used to `left_out`.
    ///
    /// # Errors
    ///
    /// If the camera is a video that cannot be decoded or has no picture that can, if a lidar or
    /// radar cannot be placed relative to the camera, or the crop does not lie inside the picture.
    pub fn new(
        recording: &Recording,
        mapping: &Mapping,
        camera_topic: &Topic,
        motion: &Motion,
        profile: &Profile,
        notes: &mut Vec<String>,
        left_out: &mut Vec<String>,
    ) -> Result<Senses> {
        let topic = |name: &Option<String>| recording.topics.get(name.as_ref()?);
        let footage = camera_topic.video.as_ref().map(Footage::new).transpose();
        let footage = footage.map_err(|(what, hint)| {
            let what = format!("the camera {} cannot be read: {what}", camera_topic.name);
            mapping_error(&recording.log, what, hint)
        })?;
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
            Sensor::place(recording, motion, camera_topic, topic).map(Some)
        };
        let lidar = sensor(&mapping.lidar, "lidar")?;
        let radar = sensor(&mapping.radar, "radar")?;
        let picture_size =
            picture_size(recording, camera_topic, footage.as_ref(), &profile.camera)?;
        let stored = |camera: &Camera| stored_camera(camera, picture_size, &profile.camera);
        let stored_camera = camera.as_ref().map(stored).transpose()?;
        Ok(Senses {
            stored_camera,
            camera: camera_topic.name.clone(),
            picture_size,
            rule: profile.camera.clone(),
            radar_rule: profile.radar,
            footage,
            lidar,
            radar,
        })
    }

    /// Topic of the lidar, where frames can have its returns.
    pub fn lidar(&self) -> Option<&str> {
        self.lidar.as_ref().map(|sensor| sensor.topic.as_str())
    }

    /// Topic of the radar, where frames can have its returns.
    pub fn radar(&self) -> Option<&str> {
        self.radar.as_ref().map(|sensor| sensor.topic.as_str())
    }

    /// Name of the topic of a signal, where frames can have what its messages show, each for itself.
    pub fn topic(&self, signal: Signal) -> Option<&str> {
        match signal {
            Signal::Camera => self.footage.is_none().then_some(self.camera.as_str()),
            Signal::Lidar => self.lidar(),
            Signal::Radar => self.radar(),
        }
    }

    /// Where the sensor of a signal sits in the optical frame of the camera; `None` for the camera.
    ///
    /// # Errors
    ///
    /// A sentence, if nothing tells.
    pub fn pose(
        &self,
        recording: &Recording,
        signal: Signal,
        stamp_ns: i64,
    ) -> Result<Option<Pose>, String> {
        let sensor = match signal {
            Signal::Camera => return Ok(None),
            Signal::Lidar => &self.lidar,
            Signal::Radar => &self.radar,
        };
        let Some(sensor) = sensor else {
            unreachable!("a tick has a sample of a sensor that is placed")
        };
        let frame = &recording.topics[&sensor.topic].frame_id;
        let camera_frame = &self.camera_topic(recording).frame_id;
        let pose = recording.transforms.lookup(camera_frame, frame, stamp_ns)?;
        Ok(Some(sensor.optical_from_camera.then(&pose)))
    }

    /// What a message shows: a function of its bytes, of the sensors and of [`pose`](Senses::pose)
    /// alone.
    pub fn sense(
        &self,
        recording: &Recording,
        signal: Signal,
        message: &[u8],
        pose: &Result<Option<Pose>, String>,
    ) -> Sensed {
        let project = |sensor: &Option<Sensor>| match (sensor, &self.stored_camera, pose) {
            (Some(sensor), Some(camera), Ok(Some(pose))) => {
                Ok((&recording.topics[&sensor.topic], camera, *pose))
            }
            (_, _, Err(why)) => Err(why.clone()),
            _ => unreachable!("a sensor is placed where there is a calibrated camera"),
        };
        match signal {
            Signal::Camera => {
                let camera = self.camera_topic(recording);
                let message = camera.decode(message).map_err(|error| error.to_string());
                let stored = message.and_then(|message| {
                    self.store(&recorded_picture(camera, &message, &self.rule)?)
                });
                Sensed::Picture(stored.map_err(|why| (Reason::ImageDamaged, why)))
            }
            Signal::Lidar => {
                Sensed::Lidar(project(&self.lidar).and_then(|(topic, camera, pose)| {
                    let pixels =
                        topic.decode(message).and_then(|m| lidar_pixels(&m, &pose, camera));
                    pixels.map_err(|error| error.to_string())
                }))
            }
            Signal::Radar => {
                Sensed::Radar(project(&self.radar).and_then(|(topic, camera, pose)| {
                    let pixels = topic.decode(message).and_then(|message| {
                        radar_pixels(topic.kind, &message, &self.radar_rule, &pose, camera)
                    });
                    pixels.map_err(|error| error.to_string())
                }))
            }
        }
    }

    /// A picture as it is stored.
    ///
    /// # Errors
    ///
    /// A sentence: it has not the size of the others, or the rule is wrong.
    pub fn store(&self, recorded: &Decoded) -> Result<Vec<u8>, String> {
        if (recorded.width, recorded.height) != self.picture_size {
            let (width, height) = self.picture_size;
            return Err(format!(
                "{} x {} pixels, where the first picture of the drive has {width} x {height}",
                recorded.width, recorded.height
            ));
        }
        recorded.stored(&self.rule)
    }

    /// The camera's topic.
    pub fn camera_topic<'r>(&self, recording: &'r Recording) -> &'r Topic {
        &recording.topics[&self.camera]
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
