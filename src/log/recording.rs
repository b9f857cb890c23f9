//! What one pass over a log tells: small signals decoded, pictures and clouds located.
//!
//! What is small (poses, speeds, controls, calibration) is kept whole, per topic. Of what is
//! large only the time and the place in the file are kept, so memory does not grow with the
//! pictures, and the second pass decodes those that frames need and no others.

use std::{collections::BTreeMap, sync::Arc};

use glam::DVec3;

use crate::{
    error::{Error, Result},
    log::{
        clock::{Clock, ClockRule, moved_ns},
        cloud::Cloud,
        decoder::Decoder,
        jumps::{Course, JUMP_NS},
        reader::{Channel, Log, Message, Place},
        signals::{
            self, CarlaStatus, Control, Fix, Header, Inertial, Kind, Odometry, Pose, Situation,
            Weather,
        },
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
    Imu(Vec<Stamped<Inertial>>),
    Fix(Vec<Stamped<Fix>>),
    Control(Vec<Stamped<Control>>),
    Status(Vec<Stamped<CarlaStatus>>),
    Path(Vec<Stamped<Vec<DVec3>>>),
    Weather(Vec<Stamped<Weather>>),
    Town(Vec<Stamped<String>>),
    Situation(Vec<Stamped<Situation>>),
}

/// A topic that pmp can use.
#[derive(Clone, Debug)]
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
    /// Which instant of a message stamps its sample.
    pub clock: Clock,
    /// Header stamps are asked for and all zero, so log times stand in for them.
    pub uses_log_time: bool,
    /// Messages, of whatever became of them.
    pub messages: u64,
    /// Messages that could not be decoded, and why the first could not.
    pub undecodable: (u64, Option<String>),
    pub first_undecodable: Option<Place>,
    /// Messages that came after one with a later stamp.
    pub out_of_order: u64,
    /// Messages whose stamp another one had already.
    pub repeated: u64,
    /// Messages whose header stamp is zero, while those of others are not.
    pub unstamped: u64,
    /// The shortest time from stamp, without offset, to log time.
    least_delay_ns: i64,
    /// Added to every stamp.
    offset_ns: i64,
    pub(super) course: Course,
    /// Marks that there were when the last calibration was kept.
    marks_seen: usize,
}

/// A topic that pmp does not use.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Unused {
    pub topic: String,
    pub type_name: String,
    pub why: String,
    /// What it could be, if it could be decoded.
    pub kind: Option<Kind>,
    pub messages: u64,
}

/// All that one pass over a log tells of a drive; a log has several where its clocks jump back.
#[derive(Debug)]
pub struct Recording {
    pub log: Arc<Log>,
    /// By name.
    pub topics: BTreeMap<String, Topic>,
    pub unused: Vec<Unused>,
    pub transforms: TransformTree,
    /// Topics whose clock jumped back where this recording begins.
    pub jumped: Vec<String>,
}

impl Recording {
    /// Messages of all topics.
    pub fn message_count(&self) -> u64 {
        let used = self.topics.values().map(|topic| topic.messages);
        used.chain(self.unused.iter().map(|unused| unused.messages)).sum()
    }

    /// Take over what was told before and holds on: the calibration of a camera.
    pub(super) fn inherit(&mut self, earlier: &Recording) {
        for (name, topic) in &mut self.topics {
            if let Series::CameraInfo(samples) = &mut topic.series
                && samples.is_empty()
                && let Some(Series::CameraInfo(before)) =
                    earlier.topics.get(name).map(|t| &t.series)
            {
                samples.extend(before.last().cloned());
            }
        }
    }

    /// Put all samples in order.
    pub(super) fn settle(&mut self) {
        self.transforms.finish();
        self.topics.values_mut().for_each(Topic::settle);
        self.unused.sort_by(|a, b| a.topic.cmp(&b.topic));
    }
}

/// How far a topic had come when a clock stepped back.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct TopicMark {
    samples: usize,
    messages: u64,
    undecodable: u64,
    pub(super) last_ns: Option<i64>,
}

impl Topic {
    /// A topic without messages yet.
    pub fn new(
        kind: Kind,
        channel: Arc<Channel>,
        decoder: Arc<Decoder>,
        clock: &ClockRule,
    ) -> Topic {
        let series = match kind {
            Kind::CompressedImage | Kind::CompressedVideo => Series::Located(Vec::new()),
            Kind::Image | Kind::PointCloud => Series::Located(Vec::new()),
            Kind::RadarScan | Kind::RadarTracks => Series::Located(Vec::new()),
            Kind::CameraInfo => Series::CameraInfo(Vec::new()),
            Kind::Odometry => Series::Odometry(Vec::new()),
            Kind::Pose => Series::Pose(Vec::new()),
            Kind::Twist => Series::Twist(Vec::new()),
            Kind::Imu => Series::Imu(Vec::new()),
            Kind::Fix => Series::Fix(Vec::new()),
            Kind::Ackermann | Kind::CarlaControl | Kind::Steering | Kind::Actuation => {
                Series::Control(Vec::new())
            }
            Kind::Weather => Series::Weather(Vec::new()),
            Kind::WorldInfo => Series::Town(Vec::new()),
            Kind::Situation => Series::Situation(Vec::new()),
            Kind::CarlaStatus => Series::Status(Vec::new()),
            Kind::Path => Series::Path(Vec::new()),
            // Transforms go to the tree; the series stays empty.
            Kind::Transforms => Series::Located(Vec::new()),
        };
        let clock_of_topic = clock.of(&channel.topic);
        Topic {
            name: channel.topic.clone(),
            kind,
            clock: clock_of_topic,
            offset_ns: clock.offset_ns(&channel.topic),
            channel,
            decoder,
            series,
            video: (kind == Kind::CompressedVideo).then(Video::default),
            frame_id: String::new(),
            child_frame_id: None,
            cloud_fields: Vec::new(),
            uses_log_time: clock_of_topic == Clock::Header,
            messages: 0,
            undecodable: (0, None),
            first_undecodable: None,
            out_of_order: 0,
            repeated: 0,
            unstamped: 0,
            least_delay_ns: i64::MAX,
            course: Course::default(),
            marks_seen: 0,
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

    /// The shortest time from stamp to log time; `None` where messages have no stamp of their own.
    pub fn delay_ns(&self) -> Option<i64> {
        let has_stamps = self.clock == Clock::Header && self.least_delay_ns != i64::MAX;
        has_stamps.then(|| moved_ns(self.least_delay_ns, -self.offset_ns))
    }

    /// The instant of a message. As long as all header stamps are zero, log times stand in.
    pub(super) fn stamp(&mut self, header: &Header, message: &Message) -> i64 {
        if self.uses_log_time && header.stamp_ns != 0 {
            // So there is a clock, and the zeros before were its beginning, or not yet set.
            self.uses_log_time = false;
            self.series.restamp(moved_ns(0, self.offset_ns));
            self.course = Course::default();
        }
        if self.clock == Clock::Header && !self.uses_log_time {
            let delay_ns = moved_ns(message.log_time_ns, -moved_ns(header.stamp_ns, 0));
            self.least_delay_ns = self.least_delay_ns.min(delay_ns);
        }
        let stamp_ns = match self.clock {
            Clock::Header if self.uses_log_time => message.log_time_ns,
            Clock::Header => header.stamp_ns,
            Clock::Log => message.log_time_ns,
            Clock::Publish => message.publish_time_ns,
        };
        moved_ns(stamp_ns, self.offset_ns)
    }

    /// The instant of one transform of a message, which has no header of its own.
    pub(super) fn stamp_of_link(&mut self, header: &Header, message: &Message) -> i64 {
        self.uses_log_time &= header.stamp_ns == 0;
        let stamp_ns = match self.clock {
            Clock::Header if header.stamp_ns != 0 => header.stamp_ns,
            Clock::Header | Clock::Log => message.log_time_ns,
            Clock::Publish => message.publish_time_ns,
        };
        moved_ns(stamp_ns, self.offset_ns)
    }

    pub(super) fn add(&mut self, message: &Message, stamp_ns: i64, marks: usize) -> Result<()> {
        let decoder = self.decoder.clone();
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
                // Calibration is sent with every picture; only its changes are kept, and the first
                // of what may be a new episode.
                let is_new = samples.last().is_none_or(|last| last.value != value);
                if is_new || self.marks_seen != marks {
                    self.marks_seen = marks;
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
                samples.push(Stamped { stamp_ns, value: signals::inertial(&decode()?)? });
            }
            Series::Fix(samples) => {
                samples.push(Stamped { stamp_ns, value: signals::fix(&decode()?)? });
            }
            Series::Control(samples) => {
                let message = decode()?;
                let value = match self.kind {
                    Kind::Ackermann => signals::ackermann(&message)?,
                    Kind::Steering => signals::steering_report(&message)?,
                    Kind::Actuation => signals::actuation(&message)?,
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
            Series::Weather(samples) => {
                samples.push(Stamped { stamp_ns, value: signals::carla_weather(&decode()?)? });
            }
            Series::Town(samples) => {
                samples.push(Stamped { stamp_ns, value: signals::carla_town(&decode()?)? });
            }
            Series::Situation(samples) => {
                samples.push(Stamped { stamp_ns, value: signals::situation(&decode()?)? });
            }
        }
        Ok(())
    }

    /// Learn from the first message what holds for all of the topic.
    pub(super) fn describe(&mut self, message: &Message, header: &Header) -> Result<()> {
        self.frame_id = header.frame_id.clone();
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

    pub(super) fn mark(&self) -> TopicMark {
        TopicMark {
            samples: self.series.len(),
            messages: self.messages,
            undecodable: self.undecodable.0,
            last_ns: self.course.last_ns(),
        }
    }

    /// Cut off what came after a mark.
    pub(super) fn split_off(&mut self, at: TopicMark) -> Topic {
        let later = Topic {
            series: self.series.split_off(at.samples),
            video: self.video.as_mut().map(|video| video.split_off(at.samples)),
            messages: self.messages - at.messages,
            undecodable: (self.undecodable.0 - at.undecodable, self.undecodable.1.clone()),
            ..self.clone()
        };
        self.messages = at.messages;
        self.undecodable.0 = at.undecodable;
        later
    }

    /// Put the samples in order, and count those that were not or that have no place in it.
    pub(super) fn settle(&mut self) {
        self.out_of_order = self.series.steps_back();
        let before = self.series.len() as u64;
        let unset_ns = moved_ns(0, self.offset_ns);
        let unset = self.series.count_at(unset_ns);
        self.series.sort();
        self.video.iter_mut().for_each(Video::finish);
        if matches!(self.series, Series::CameraInfo(_)) {
            return;
        }
        self.repeated = before - self.series.len() as u64;
        let has_own_clock = self.clock == Clock::Header && !self.uses_log_time;
        // A clock that begins at zero goes on from there; a stamp that nobody set does not.
        if has_own_clock && self.series.begins_alone_at(unset_ns) {
            self.series.remove_first();
            self.unstamped = unset;
            self.repeated -= unset - 1;
        }
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
            Series::Fix($samples) => $body,
            Series::Weather($samples) => $body,
            Series::Town($samples) => $body,
            Series::Situation($samples) => $body,
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

    /// Ascending; of samples with the same stamp the first stays, and of calibrations those that
    /// change something.
    fn sort(&mut self) {
        with_samples!(self, samples => {
            samples.sort_by_key(|sample| sample.stamp_ns);
            samples.dedup_by_key(|sample| sample.stamp_ns);
        });
        if let Series::CameraInfo(samples) = self {
            samples.dedup_by(|later, earlier| later.value == earlier.value);
        }
    }

    /// Samples with an earlier stamp than the one before.
    fn steps_back(&self) -> u64 {
        let steps_back = |pair: (i64, i64)| pair.1 < pair.0;
        with_samples!(self, samples => {
            let pairs = samples.windows(2).map(|pair| (pair[0].stamp_ns, pair[1].stamp_ns));
            pairs.filter(|pair| steps_back(*pair)).count() as u64
        })
    }

    /// Samples with this stamp.
    fn count_at(&self, stamp_ns: i64) -> u64 {
        with_samples!(self, samples => {
            samples.iter().filter(|sample| sample.stamp_ns == stamp_ns).count() as u64
        })
    }

    /// Whether the first sample is at this instant and none follows soon.
    fn begins_alone_at(&self, stamp_ns: i64) -> bool {
        with_samples!(self, samples => match samples.as_slice() {
            [first, rest @ ..] if first.stamp_ns == stamp_ns => {
                rest.first().is_none_or(|next| next.stamp_ns - stamp_ns > JUMP_NS)
            }
            _ => false,
        })
    }

    fn remove_first(&mut self) {
        with_samples!(self, samples => drop(samples.remove(0)));
    }

    /// Stamp all samples anew.
    fn restamp(&mut self, stamp_ns: i64) {
        with_samples!(self, samples => {
            samples.iter_mut().for_each(|sample| sample.stamp_ns = stamp_ns);
        });
    }

    fn split_off(&mut self, at: usize) -> Series {
        match self {
            Series::Located(samples) => Series::Located(samples.split_off(at)),
            Series::CameraInfo(samples) => Series::CameraInfo(samples.split_off(at)),
            Series::Odometry(samples) => Series::Odometry(samples.split_off(at)),
            Series::Pose(samples) => Series::Pose(samples.split_off(at)),
            Series::Twist(samples) => Series::Twist(samples.split_off(at)),
            Series::Imu(samples) => Series::Imu(samples.split_off(at)),
            Series::Control(samples) => Series::Control(samples.split_off(at)),
            Series::Status(samples) => Series::Status(samples.split_off(at)),
            Series::Path(samples) => Series::Path(samples.split_off(at)),
            Series::Fix(samples) => Series::Fix(samples.split_off(at)),
            Series::Weather(samples) => Series::Weather(samples.split_off(at)),
            Series::Town(samples) => Series::Town(samples.split_off(at)),
            Series::Situation(samples) => Series::Situation(samples.split_off(at)),
        }
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
