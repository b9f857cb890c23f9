//! What became of every message, topic by topic: what was read is what was used and what was not.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

use crate::{
    dataset::{
        align::{self, Tick},
        drive::{Drive, Made},
    },
    log::{
        recording::{Recording, Series, Stamped, Topic},
        signals::Kind,
    },
};

/// Why a message is not in the dataset. The order here is the order in reports.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LeftOut {
    /// Its bytes do not follow the definition.
    Undecodable,
    /// Its header stamp is zero, and those of others of its topic are not.
    NoStamp,
    /// Another message of its topic has the same stamp.
    SameStamp,
    /// It lies before the first tick or after the last.
    OutsideGrid,
    /// Another message is nearer to the tick, or none of the ticks is near.
    NotNearest,
    /// It is nearest to a tick that was left out.
    TickLeftOut,
    /// A tick asked for it, and its content cannot be used.
    Damaged,
    /// A path of fewer than two points.
    TooShort,
    /// Nothing says where its sensor sits on the picture.
    NotPlaced,
    /// Its part of the log gave no frame.
    NoFrame,
    /// Frames do not need its topic, or another one was taken.
    TopicNotUsed,
}

impl LeftOut {
    /// The name in reports and columns.
    pub fn name(self) -> &'static str {
        match self {
            LeftOut::Undecodable => "undecodable",
            LeftOut::NoStamp => "no_stamp",
            LeftOut::SameStamp => "same_stamp",
            LeftOut::OutsideGrid => "outside_grid",
            LeftOut::NotNearest => "not_nearest",
            LeftOut::TickLeftOut => "tick_left_out",
            LeftOut::Damaged => "damaged",
            LeftOut::TooShort => "too_short",
            LeftOut::NotPlaced => "not_placed",
            LeftOut::NoFrame => "no_frame",
            LeftOut::TopicNotUsed => "topic_not_used",
        }
    }
}

/// The messages of a topic: `read` is `used` and the sum of `left_out`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct TopicAccount {
    pub topic: String,
    #[serde(rename = "type")]
    pub type_name: String,
    /// What frames take from it; `None` where they take nothing.
    #[serde(rename = "use")]
    pub used_as: Option<String>,
    pub read: u64,
    /// Samples in frames, or of what the ego motion, the calibration or the route was made of.
    pub used: u64,
    pub left_out: BTreeMap<LeftOut, u64>,
}

impl TopicAccount {
    fn new(topic: &str, type_name: &str, read: u64) -> TopicAccount {
        TopicAccount {
            topic: topic.to_string(),
            type_name: type_name.to_string(),
            used_as: None,
            read,
            used: read,
            left_out: BTreeMap::new(),
        }
    }

    /// Take some of the used ones away.
    fn leave(&mut self, why: LeftOut, count: u64) {
        let count = count.min(self.used);
        if count > 0 {
            self.used -= count;
            *self.left_out.entry(why).or_default() += count;
        }
    }
}

/// Stamps of one sensor's samples by what became of them.
#[derive(Debug, Default)]
struct Fate {
    used: BTreeSet<i64>,
    damaged: BTreeSet<i64>,
    of_dropped_ticks: BTreeSet<i64>,
}

/// What became of the samples that ticks asked for.
#[derive(Debug, Default)]
pub struct Fates {
    camera: Fate,
    lidar: Fate,
    radar: Fate,
    control: Fate,
}

impl Fates {
    /// The samples of the ticks that were left out when the grid was laid.
    pub fn of_dropped_ticks(drive: &Drive) -> Fates {
        let fate =
            |stamps: &BTreeSet<i64>| Fate { of_dropped_ticks: stamps.clone(), ..Fate::default() };
        let dropped = &drive.grid.dropped;
        Fates {
            camera: fate(&dropped.camera),
            lidar: fate(&dropped.lidar),
            radar: fate(&dropped.radar),
            control: fate(&dropped.control),
        }
    }

    /// Note what became of a tick.
    pub fn take(&mut self, drive: &Drive, tick: &Tick, made: &Made) {
        let is_frame = made.frame.is_ok();
        let is_damaged = |topic: &Option<String>| {
            topic.as_ref().is_some_and(|topic| made.damaged.iter().any(|(name, _)| name == topic))
        };
        let note = |fate: &mut Fate, stamp_ns: Option<i64>, is_damaged: bool| {
            let Some(stamp_ns) = stamp_ns else { return };
            match (is_damaged, is_frame) {
                (true, _) => fate.damaged.insert(stamp_ns),
                (false, true) => fate.used.insert(stamp_ns),
                (false, false) => fate.of_dropped_ticks.insert(stamp_ns),
            };
        };
        let mapping = &drive.mapping;
        note(&mut self.camera, Some(tick.image.stamp_ns), !is_frame);
        let (lidar, radar) = (tick.lidar.as_ref(), tick.radar.as_ref());
        note(&mut self.lidar, lidar.map(|s| s.stamp_ns), is_damaged(&mapping.lidar));
        note(&mut self.radar, radar.map(|s| s.stamp_ns), is_damaged(&mapping.radar));
        note(&mut self.control, tick.control.as_ref().map(|s| s.stamp_ns), false);
    }
}

/// The accounts of all topics of a drive, by name.
pub fn of_drive(drive: &Drive, fates: &Fates) -> Vec<TopicAccount> {
    let mut accounts = read(&drive.recording);
    for topic in drive.recording.topics.values() {
        if let Some(account) = accounts.get_mut(&topic.name) {
            use_topic(drive, fates, topic, account);
        }
    }
    accounts.into_values().collect()
}

/// The accounts of a part of a log that gives no frame.
pub fn without_frames(recording: &Recording) -> Vec<TopicAccount> {
    let mut accounts = read(recording);
    accounts.values_mut().for_each(|account| account.leave(LeftOut::NoFrame, account.used));
    accounts.into_values().collect()
}

/// Put the accounts of several parts of a log together, by topic.
pub fn sum<'a>(parts: impl Iterator<Item = &'a TopicAccount>) -> Vec<TopicAccount> {
    let mut sums: BTreeMap<&str, TopicAccount> = BTreeMap::new();
    for part in parts {
        let sum = sums
            .entry(&part.topic)
            .or_insert_with(|| TopicAccount::new(&part.topic, &part.type_name, 0));
        sum.used_as = sum.used_as.take().or_else(|| part.used_as.clone());
        sum.read += part.read;
        sum.used += part.used;
        for (why, count) in &part.left_out {
            *sum.left_out.entry(*why).or_default() += count;
        }
    }
    sums.into_values().collect()
}

/// All that was read, less what has no place in any series.
fn read(recording: &Recording) -> BTreeMap<String, TopicAccount> {
    let mut accounts = BTreeMap::new();
    for topic in recording.topics.values().filter(|topic| topic.messages > 0) {
        let type_name = topic.channel.schema.as_ref().map_or("", |schema| &schema.name);
        let mut account = TopicAccount::new(&topic.name, type_name, topic.messages);
        account.leave(LeftOut::Undecodable, topic.undecodable.0);
        account.leave(LeftOut::NoStamp, topic.unstamped);
        account.leave(LeftOut::SameStamp, topic.repeated);
        accounts.insert(topic.name.clone(), account);
    }
    for unused in recording.unused.iter().filter(|unused| unused.messages > 0) {
        let new = || TopicAccount::new(&unused.topic, &unused.type_name, 0);
        let account: &mut TopicAccount = accounts.entry(unused.topic.clone()).or_insert_with(new);
        account.read += unused.messages;
        *account.left_out.entry(LeftOut::TopicNotUsed).or_default() += unused.messages;
    }
    accounts
}

fn use_topic(drive: &Drive, fates: &Fates, topic: &Topic, account: &mut TopicAccount) {
    let mapping = &drive.mapping;
    let is = |name: &Option<String>| name.as_deref() == Some(topic.name.as_str());
    account.used_as = match topic.kind {
        Kind::Transforms => Some("transforms".to_string()),
        _ if is(&drive.applied_control) => Some("applied control".to_string()),
        _ => mapping.uses(&topic.name),
    };
    if account.used_as.is_none() {
        return account.leave(LeftOut::TopicNotUsed, account.used);
    }
    let grid = &drive.grid;
    let tolerance = &drive.profile.tolerance_ms;
    let mut by_tick = |stamps: &[i64], fate: &Fate, tolerance_ms: f64| {
        let tolerance_ns = align::nanos(tolerance_ms);
        for stamp_ns in stamps {
            let why = match stamp_ns {
                _ if fate.used.contains(stamp_ns) => continue,
                _ if fate.damaged.contains(stamp_ns) => LeftOut::Damaged,
                _ if fate.of_dropped_ticks.contains(stamp_ns) => LeftOut::TickLeftOut,
                _ if *stamp_ns < grid.start_ns - tolerance_ns => LeftOut::OutsideGrid,
                _ if *stamp_ns > grid.end_ns + tolerance_ns => LeftOut::OutsideGrid,
                _ => LeftOut::NotNearest,
            };
            account.leave(why, 1);
        }
    };
    match &topic.series {
        Series::Located(samples) if is(&mapping.camera) => {
            by_tick(&stamps(samples), &fates.camera, tolerance.camera);
        }
        Series::Located(samples) if is(&mapping.lidar) && drive.senses.lidar().is_some() => {
            by_tick(&stamps(samples), &fates.lidar, tolerance.lidar);
        }
        Series::Located(samples) if is(&mapping.radar) && drive.senses.radar().is_some() => {
            by_tick(&stamps(samples), &fates.radar, tolerance.radar);
        }
        Series::Located(_) if topic.kind != Kind::Transforms => {
            account.leave(LeftOut::NotPlaced, account.used);
        }
        Series::Control(samples) if is(&mapping.control) => {
            by_tick(&stamps(samples), &fates.control, tolerance.control);
        }
        // What tells of the velocity as well is used for that at all times.
        Series::Status(samples) if is(&mapping.control) && !is(&mapping.velocity) => {
            by_tick(&stamps(samples), &fates.control, tolerance.control);
        }
        Series::Path(paths) => {
            let short = paths.iter().filter(|path| path.value.len() < 2).count();
            account.leave(LeftOut::TooShort, short as u64);
        }
        _ => {}
    }
}

fn stamps<T>(samples: &[Stamped<T>]) -> Vec<i64> {
    samples.iter().map(|sample| sample.stamp_ns).collect()
}
