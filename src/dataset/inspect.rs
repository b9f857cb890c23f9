//! What a log holds, and how it would be read.

use std::{collections::BTreeMap, fmt, path::Path};

use serde::Serialize;

use crate::{
    error::{Error, Result},
    log::{
        mapping::Mapping,
        profile::Profile,
        reader::Damage,
        recording::{Recording, Topic},
    },
};

/// A topic of a log.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TopicReport {
    pub topic: String,
    pub type_name: String,
    pub messages: u64,
    /// Mean rate from the first to the last stamp; `None` below two messages or for topics that
    /// are not read.
    pub rate_hz: Option<f64>,
    /// First and last stamp, ns, before any clock jumps back.
    pub stamps_ns: Option<(i64, i64)>,
    pub frame_id: Option<String>,
    /// What it would be used as.
    pub used_as: Option<String>,
    /// Why it cannot be used.
    pub unused_because: Option<String>,
}

/// A log, looked at.
#[derive(Debug, Serialize)]
pub struct LogReport {
    pub size_bytes: u64,
    pub messages: u64,
    /// One, and another from each place on where its clocks jump back; rates, mapping and
    /// transforms are those of the first.
    pub episodes: usize,
    pub topics: Vec<TopicReport>,
    pub mapping: Mapping,
    /// Why there is no mapping, where a question is open.
    #[serde(skip)]
    pub open_question: Option<Error>,
    pub damage: Vec<Damage>,
    /// Transforms of the log: `parent -> child`.
    pub transforms: Vec<String>,
}

/// Look at a log without writing anything.
///
/// Where topics cannot be chosen, the report still lists them all, and has the reason.
///
/// # Errors
///
/// If the file is no readable log.
pub fn inspect(path: &Path, profile: &Profile) -> Result<LogReport> {
    let recordings = Recording::scan(path, &profile.clock)?;
    let recording = &recordings[0];
    let (mapping, open_question) = match Mapping::choose(recording, profile) {
        Ok(mapping) => (mapping, None),
        Err(error) => (Mapping::default(), Some(error)),
    };
    let mut counts: BTreeMap<&str, u64> = BTreeMap::new();
    for (id, count) in &recording.log.counts {
        *counts.entry(&recording.log.channels[id].topic).or_default() += count;
    }
    let mut topics: Vec<TopicReport> =
        recording.topics.values().map(|t| read(t, &mapping)).collect();
    topics.extend(recording.unused.iter().map(|unused| TopicReport {
        topic: unused.topic.clone(),
        type_name: unused.type_name.clone(),
        messages: 0,
        rate_hz: None,
        stamps_ns: None,
        frame_id: None,
        used_as: None,
        unused_because: Some(unused.why.clone()),
    }));
    for channel in recording.log.channels.values() {
        if topics.iter().all(|topic| topic.topic != channel.topic) {
            topics.push(TopicReport {
                topic: channel.topic.clone(),
                type_name: channel.schema.as_ref().map_or(String::new(), |s| s.name.clone()),
                messages: 0,
                rate_hz: None,
                stamps_ns: None,
                frame_id: None,
                used_as: None,
                unused_because: Some("no messages".to_string()),
            });
        }
    }
    for topic in &mut topics {
        topic.messages = counts.get(topic.topic.as_str()).copied().unwrap_or_default();
    }
    topics.sort_by(|a, b| a.topic.cmp(&b.topic));
    Ok(LogReport {
        size_bytes: recording.log.size_bytes,
        messages: recording.log.message_count(),
        episodes: recordings.len(),
        topics,
        mapping,
        open_question,
        damage: recording.log.damage.clone(),
        transforms: recording.transforms.links(),
    })
}

fn read(topic: &Topic, mapping: &Mapping) -> TopicReport {
    let span = topic.series.span_ns().filter(|(first, last)| last > first);
    let rate_hz =
        span.map(|(first, last)| (topic.series.len() - 1) as f64 / ((last - first) as f64 * 1e-9));
    TopicReport {
        topic: topic.name.clone(),
        type_name: topic.channel.schema.as_ref().map_or(String::new(), |s| s.name.clone()),
        messages: 0,
        rate_hz,
        stamps_ns: topic.series.span_ns(),
        frame_id: Some(topic.frame_id.clone()).filter(|frame| !frame.is_empty()),
        used_as: mapping.uses(&topic.name),
        unused_because: None,
    }
}

impl LogReport {
    /// As one JSON object.
    pub fn json(&self) -> String {
        let mut text = serde_json::to_string_pretty(self).unwrap_or_default();
        text.push('\n');
        text
    }
}

impl fmt::Display for LogReport {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        writeln!(f, "{} messages, {} bytes", self.messages, self.size_bytes)?;
        let width = |pick: fn(&TopicReport) -> usize, least: usize| {
            self.topics.iter().map(pick).max().unwrap_or(0).max(least)
        };
        let (topic_width, type_width) =
            (width(|t| t.topic.len(), 5), width(|t| t.type_name.len(), 4));
        writeln!(
            f,
            "\n{:topic_width$}  {:type_width$}  {:>8}  {:>8}  used as",
            "topic", "type", "messages", "rate, Hz"
        )?;
        for topic in &self.topics {
            let rate = topic.rate_hz.map_or("–".to_string(), |rate| format!("{rate:.1}"));
            let usage = match (&topic.used_as, &topic.unused_because) {
                (Some(signal), _) => signal.clone(),
                (None, Some(why)) => format!("– ({why})"),
                (None, None) => "–".to_string(),
            };
            writeln!(
                f,
                "{:topic_width$}  {:type_width$}  {:>8}  {rate:>8}  {usage}",
                topic.topic, topic.type_name, topic.messages
            )?;
        }
        writeln!(f)?;
        if self.open_question.is_some() {
            return Ok(());
        }
        let mut missing = |signal: &str, present: bool, consequence: &str| match present {
            true => Ok(()),
            false => writeln!(f, "no {signal}: {consequence}"),
        };
        missing("camera", self.mapping.camera.is_some(), "no frames can be made")?;
        missing("ego pose", self.mapping.pose.is_some(), "no frames can be made")?;
        missing("lidar", self.mapping.lidar.is_some(), "its columns will be null")?;
        missing("radar", self.mapping.radar.is_some(), "its columns will be null")?;
        missing("control", self.mapping.control.is_some(), "its columns will be null")?;
        missing("route", self.mapping.route.is_some(), "the driven path stands in for it")?;
        if !self.transforms.is_empty() {
            writeln!(f, "transforms: {}", self.transforms.join(", "))?;
        }
        if self.episodes > 1 {
            writeln!(f, "clocks jump back: the log has {} parts", self.episodes)?;
        }
        for note in &self.mapping.notes {
            writeln!(f, "note: {note}")?;
        }
        for damage in &self.damage {
            writeln!(f, "byte {}: {}", damage.offset, damage.what)?;
        }
        Ok(())
    }
}
