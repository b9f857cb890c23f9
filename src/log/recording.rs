//! One pass over a log: small signals decoded, pictures and clouds located.
//!
//! What is small (poses, speeds, controls, calibration) is kept whole, per topic. Of what is
//! large only the time and the place in the file are kept, so memory does not grow with the
//! pictures, and the second pass decodes those that frames need and no others.

use std::{collections::BTreeMap, path::Path, sync::Arc};

use glam::DVec3;

use crate::{
    error::{Error, Result},
    log::{
        cloud::Cloud,
        decoder::Decoder,
        reader::{Channel, Log, Message, Place},
        signals::{self, CarlaStatus, Control, Header, Kind, Odometry, Pose},
        transforms::TransformTree,
        value::Struct,
        video::Video,
    },
    projection::Camera,
};

/// A sample with its time.
#[derive(Clone, Debug, PartialEq)]
pub struct Stamped<T> {
    pub stamp_ns: i64,
    pub value: T,
}

/// The samples of one topic, ascending by stamp.
#[derive(Clone, Debug)]
pub enum Series {
    /// Pictures, clouds and radar scans: located, not decoded.
    Located(Vec<Stamped<Place>>),
    CameraInfo(Vec<Stamped<Camera>>),
    Odometry(Vec<Stamped<Odometry>>),
    Pose(Vec<Stamped<Pose>>),
    /// Linear and angular velocity.
    Twist(Vec<Stamped<(DVec3, DVec3)>>),
    /// Angular velocity.
    Imu(Vec<Stamped<DVec3>>),
    Control(Vec<Stamped<Control>>),
    Status(Vec<Stamped<CarlaStatus>>),
    Path(Vec<Stamped<Vec<DVec3>>>),
}

/// A topic that pmp can use.
#[derive(Debug)]
pub struct Topic {
    pub name: String,
    pub kind: Kind,
    pub channel: Arc<Channel>,
    pub decoder: Arc<Decoder>,
    pub series: Series,
    /// What the packets of a video depend on; the series locates those that hold a picture.
    pub video: Option<Video>,
    /// `frame_id` of the first message.
    pub frame_id: String,
    /// `child_frame_id` of the first odometry message.
    pub child_frame_id: Option<String>,
    /// Fields of the first cloud.
    pub cloud_fields: Vec<String>,
    /// Header stamps are all zero, so log times stand in for them.
    pub uses_log_time: bool,
    /// Messages that could not be decoded, and why the first could not.
    pub undecodable: (u64, Option<String>),
    /// Messages that came after one with a later stamp.
    pub out_of_order: u64,
}

/// A topic that pmp does not use.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Unused {
    pub topic: String,
    pub type_name: String,
    pub why: String,
}

/// All that one pass over a log tells.
#[derive(Debug)]
pub struct Recording {
    pub log: Log,
    /// By name.
    pub topics: BTreeMap<String, Topic>,
    pub unused: Vec<Unused>,
    pub transforms: TransformTree,
}

impl Recording {
    /// Scan a log; `on_bytes` hears of progress.
    ///
    /// # Errors
    ///
    /// As [`Log::scan`]. A message that cannot be decoded is counted in its topic, not an error.
    pub fn scan(path: &Path) -> Result<Recording> {
        let mut builder = Builder::default();
        let log = Log::scan(path, &mut |message| {
            builder.add(message);
            Ok(())
        })?;
        Ok(builder.finish(log))
    }
}

/// What a channel turned out to be at its first message.
enum Entry {
    /// Name of the topic in [`Builder::topics`].
    Used(String),
    Unused,
}

#[derive(Default)]
struct Builder {
    channels: BTreeMap<u16, Entry>,
    topics: BTreeMap<String, Topic>,
    unused: Vec<Unused>,
    transforms: TransformTree,
}

impl Builder {
    fn add(&mut self, message: &Message) {
        let id = message.channel.id;
        if !self.channels.contains_key(&id) {
            let entry = self.open(message.channel);
            self.channels.insert(id, entry);
        }
        let Some(Entry::Used(name)) = self.channels.get(&id) else { return };
        let Some(topic) = self.topics.get_mut(name) else { return };
        if let Err(error) = topic.add(message, &mut self.transforms) {
            topic.undecodable.0 += 1;
            topic.undecodable.1.get_or_insert_with(|| error.to_string());
        }
    }

    fn open(&mut self, channel: &Arc<Channel>) -> Entry {
        match usable(channel) {
            Ok((kind, decoder)) => {
                self.topics
                    .entry(channel.topic.clone())
                    .or_insert_with(|| Topic::new(kind, channel.clone(), Arc::new(decoder)));
                Entry::Used(channel.topic.clone())
            }
            Err(why) => {
                let type_name = channel.schema.as_ref().map(|schema| schema.name.clone());
                let (topic, type_name) = (channel.topic.clone(), type_name.unwrap_or_default());
                self.unused.push(Unused { topic, type_name, why });
                Entry::Unused
            }
        }
    }

    fn finish(mut self, log: Log) -> Recording {
        self.transforms.finish();
        for topic in self.topics.values_mut() {
            topic.series.sort();
            topic.video.iter_mut().for_each(Video::finish);
        }
        self.unused.sort_by(|a, b| a.topic.cmp(&b.topic));
        let Builder { topics, unused, transforms, .. } = self;
        Recording { log, topics, unused, transforms }
    }
}

/// Whether and as what a channel can be read.
fn usable(channel: &Channel) -> Result<(Kind, Decoder), String> {
    let record = channel.schema.as_ref().ok_or("the log has no definition for it")?;
    let kind = Kind::of(&record.name).ok_or("a type that frames do not need")?;
    Ok((kind, Decoder::of(channel)?))
}

impl Topic {
    fn new(kind: Kind, channel: Arc<Channel>, decoder: Arc<Decoder>) -> Topic {
        let series = match kind {
            Kind::CompressedImage | Kind::CompressedVideo => Series::Located(Vec::new()),
            Kind::Image | Kind::PointCloud => Series::Located(Vec::new()),
            Kind::RadarScan | Kind::RadarTracks => Series::Located(Vec::new()),
            Kind::CameraInfo => Series::CameraInfo(Vec::new()),
            Kind::Odometry => Series::Odometry(Vec::new()),
            Kind::Pose => Series::Pose(Vec::new()),
            Kind::Twist => Series::Twist(Vec::new()),
            Kind::Imu => Series::Imu(Vec::new()),
            Kind::Ackermann | Kind::CarlaControl => Series::Control(Vec::new()),
            Kind::CarlaStatus => Series::Status(Vec::new()),
            Kind::Path => Series::Path(Vec::new()),
            // Transforms go to the tree; the series stays empty.
            Kind::Transforms => Series::Located(Vec::new()),
        };
        Topic {
            name: channel.topic.clone(),
            kind,
            channel,
            decoder,
            series,
            video: (kind == Kind::CompressedVideo).then(Video::default),
            frame_id: String::new(),
            child_frame_id: None,
            cloud_fields: Vec::new(),
            uses_log_time: false,
            undecodable: (0, None),
            out_of_order: 0,
        }
    }

    /// Decode a message of this topic.
    ///
    /// # Errors
    ///
    /// [`Error::Decode`] if its bytes do not follow the definition.
    pub fn decode<'a>(&'a self, data: &'a [u8]) -> Result<Struct<'a>> {
        self.decoder.decode(data)
    }

    fn add(&mut self, message: &Message, transforms: &mut TransformTree) -> Result<()> {
        let decoder = self.decoder.clone();
        if self.kind == Kind::Transforms {
            let is_static = self.name.ends_with("static");
            for (header, child, pose) in signals::transforms(&decoder.decode(message.data)?)? {
                transforms.insert(&header, &child, pose, is_static);
            }
            return Ok(());
        }
        let header = decoder.header(message.data)?;
        let is_first = self.series.is_empty();
        if is_first {
            self.describe(message, &header)?;
        }
        let stamp_ns = if self.uses_log_time { message.log_time_ns } else { header.stamp_ns };
        if self.series.last_stamp().is_some_and(|last| stamp_ns < last) {
            self.out_of_order += 1;
        }
        let decode = || decoder.decode(message.data);
        match &mut self.series {
            Series::Located(samples) => {
                let has_picture = match &mut self.video {
                    Some(video) => video.add(stamp_ns, message.place, &decode()?)?,
                    None => true,
                };
                if has_picture {
                    samples.push(Stamped { stamp_ns, value: message.place });
                }
            }
            Series::CameraInfo(samples) => {
                let value = signals::camera_info(&decode()?)?;
                // Calibration is sent with every picture; only its changes are kept.
                if samples.last().is_none_or(|last| last.value != value) {
                    samples.push(Stamped { stamp_ns, value });
                }
            }
            Series::Odometry(samples) => {
                samples.push(Stamped { stamp_ns, value: signals::odometry(&decode()?)? });
            }
            Series::Pose(samples) => {
                samples.push(Stamped { stamp_ns, value: signals::stamped_pose(&decode()?)? });
            }
            Series::Twist(samples) => {
                samples.push(Stamped { stamp_ns, value: signals::stamped_twist(&decode()?)? });
            }
            Series::Imu(samples) => {
                samples.push(Stamped { stamp_ns, value: signals::angular_velocity(&decode()?)? });
            }
            Series::Control(samples) => {
                let message = decode()?;
                let value = match self.kind {
                    Kind::Ackermann => signals::ackermann(&message)?,
                    _ => signals::carla_control(&message)?,
                };
                samples.push(Stamped { stamp_ns, value });
            }
            Series::Status(samples) => {
                samples.push(Stamped { stamp_ns, value: signals::carla_status(&decode()?)? });
            }
            Series::Path(samples) => {
                samples.push(Stamped { stamp_ns, value: signals::path(&decode()?)? });
            }
        }
        Ok(())
    }

    /// Learn from the first message what holds for all of the topic.
    fn describe(&mut self, message: &Message, header: &Header) -> Result<()> {
        self.frame_id = header.frame_id.clone();
        self.uses_log_time = header.stamp_ns == 0;
        let decoder = self.decoder.clone();
        match self.kind {
            Kind::Odometry => {
                let message = decoder.decode(message.data)?;
                self.child_frame_id = Some(signals::child_frame(&message)?.to_string());
            }
            Kind::PointCloud => {
                let message = decoder.decode(message.data)?;
                let fields = Cloud::new(&message)?.fields;
                self.cloud_fields = fields.into_iter().map(|field| field.name).collect();
            }
            _ => {}
        }
        Ok(())
    }
}

/// Run the same expression on whatever a series holds.
macro_rules! with_samples {
    ($series:expr, $samples:ident => $body:expr) => {
        match $series {
            Series::Located($samples) => $body,
            Series::CameraInfo($samples) => $body,
            Series::Odometry($samples) => $body,
            Series::Pose($samples) => $body,
            Series::Twist($samples) => $body,
            Series::Imu($samples) => $body,
            Series::Control($samples) => $body,
            Series::Status($samples) => $body,
            Series::Path($samples) => $body,
        }
    };
}

impl Series {
    pub fn len(&self) -> usize {
        with_samples!(self, samples => samples.len())
    }

    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Stamps of the first and the last sample.
    pub fn span_ns(&self) -> Option<(i64, i64)> {
        with_samples!(self, samples => {
            Some((samples.first()?.stamp_ns, samples.last()?.stamp_ns))
        })
    }

    fn last_stamp(&self) -> Option<i64> {
        with_samples!(self, samples => samples.last().map(|sample| sample.stamp_ns))
    }

    /// Ascending; of samples with the same stamp the first stays.
    fn sort(&mut self) {
        with_samples!(self, samples => {
            samples.sort_by_key(|sample| sample.stamp_ns);
            samples.dedup_by_key(|sample| sample.stamp_ns);
        });
    }
}

/// The sample nearest to a time, of ascending samples; the earlier of two equally near ones.
pub fn nearest<T>(samples: &[Stamped<T>], stamp_ns: i64) -> Option<&Stamped<T>> {
    let after = samples.partition_point(|sample| sample.stamp_ns < stamp_ns);
    let candidates = [after.checked_sub(1), Some(after)];
    candidates
        .into_iter()
        .filter_map(|at| samples.get(at?))
        .min_by_key(|sample| (sample.stamp_ns.abs_diff(stamp_ns), sample.stamp_ns))
}

/// For errors about a topic as a whole.
pub fn mapping_error(log: &Log, what: String, hint: &str) -> Error {
    Error::Mapping { path: log.path.clone(), what, hint: hint.to_string() }
}
