//! Which instant a message is of: that of its header, or when it was logged or published.
//!
//! The default is the header's stamp: when the sensor measured. Where a sensor's clock is not that
//! of the others, another instant can be chosen for its topic, or an offset added to its stamps.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};

/// The latest instant that is told apart from others, and in the negative the earliest: the year
/// 2116. Differences of two instants always fit i64.
pub const LATEST_NS: i64 = (1 << 62) - 1;

/// The largest offset, seconds: 60 years, from a simulator's time to ours.
const MOST_OFFSET_S: f64 = 60.0 * 365.25 * 86_400.0;

/// An instant that a message has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Clock {
    /// The stamp in the message's header: when the sensor measured.
    #[default]
    Header,
    /// When the message was recorded.
    Log,
    /// When the message was sent.
    Publish,
}

impl Clock {
    /// The name in profiles and flags.
    pub fn name(self) -> &'static str {
        match self {
            Clock::Header => "header",
            Clock::Log => "log",
            Clock::Publish => "publish",
        }
    }
}

/// How the messages of a log are stamped; topics that are not named have header stamps as they are.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ClockRule {
    pub default: Clock,
    /// Other instants, by topic.
    pub topics: BTreeMap<String, Clock>,
    /// Seconds to add to the stamps, by topic.
    pub offset_s: BTreeMap<String, f64>,
}

impl ClockRule {
    /// The instant that stamps a topic's messages.
    pub fn of(&self, topic: &str) -> Clock {
        self.topics.get(topic).copied().unwrap_or(self.default)
    }

    /// What is added to a topic's stamps.
    pub fn offset_ns(&self, topic: &str) -> i64 {
        self.offset_s.get(topic).map_or(0, |seconds| (seconds * 1e9).round() as i64)
    }

    /// Topics that are named.
    pub fn named(&self) -> impl Iterator<Item = &str> {
        let offsets = self.offset_s.keys().filter(|topic| !self.topics.contains_key(*topic));
        self.topics.keys().chain(offsets).map(String::as_str)
    }

    /// Make sure that the offsets are numbers that can be added.
    ///
    /// # Errors
    ///
    /// [`Error::Config`] if one is not finite or beyond 60 years.
    pub fn check(&self) -> Result<()> {
        let far = |seconds: f64| seconds.is_nan() || seconds.abs() > MOST_OFFSET_S;
        match self.offset_s.iter().find(|(_, seconds)| far(**seconds)) {
            Some((topic, seconds)) => Err(Error::Config {
                key: format!("clock.offset_s of {topic}"),
                what: format!("{seconds} s is not within 60 years"),
                hint: None,
            }),
            None => Ok(()),
        }
    }
}

/// A file's time as an instant: what lies beyond [`LATEST_NS`] is that.
pub fn instant_ns(nanoseconds: u64) -> i64 {
    i64::try_from(nanoseconds).map_or(LATEST_NS, |ns| ns.min(LATEST_NS))
}

/// A stamp moved by an offset, kept within [`LATEST_NS`] on either side.
pub fn moved_ns(stamp_ns: i64, offset_ns: i64) -> i64 {
    stamp_ns.saturating_add(offset_ns).clamp(-LATEST_NS, LATEST_NS)
}

/// `TOPIC=header|log|publish`, as the flag `--clock` has it.
///
/// # Errors
///
/// A sentence that says what is missing.
pub fn parse_clock(text: &str) -> Result<(String, Clock), String> {
    let (topic, name) = split(text)?;
    let clocks = [Clock::Header, Clock::Log, Clock::Publish];
    let clock = clocks.into_iter().find(|clock| clock.name() == name);
    let clock = clock.ok_or_else(|| format!("`{name}` is not header, log or publish"))?;
    Ok((topic.to_string(), clock))
}

/// `TOPIC=NUMBER` with a unit (s, ms, us or ns), as the flag `--offset` has it: topic and seconds.
///
/// # Errors
///
/// A sentence that says what is missing.
pub fn parse_offset(text: &str) -> Result<(String, f64), String> {
    let (topic, amount) = split(text)?;
    let number_end = amount.trim_end_matches(|c: char| c.is_ascii_alphabetic()).len();
    let (number, unit) = amount.split_at(number_end);
    let per_second = match unit {
        "s" => 1.0,
        "ms" => 1e3,
        "us" => 1e6,
        "ns" => 1e9,
        _ => return Err(format!("`{amount}` has no unit: s, ms, us or ns")),
    };
    let number: f64 = number.parse().map_err(|_error| format!("`{number}` is no number"))?;
    Ok((topic.to_string(), number / per_second))
}

fn split(text: &str) -> Result<(&str, &str), String> {
    let parts = text.rsplit_once('=').filter(|(topic, _)| !topic.is_empty());
    parts.ok_or_else(|| "a topic and a value with `=` between them are needed".to_string())
}

/// An instant for people: UTC where it can be a date of our time, else seconds.
pub fn instant_text(stamp_ns: i64) -> String {
    const DAY_S: i64 = 86_400;
    let seconds = stamp_ns.div_euclid(1_000_000_000);
    let millis = stamp_ns.rem_euclid(1_000_000_000) / 1_000_000;
    // Before 1980 there was no GPS and no log: a simulator's time.
    if seconds < 10 * 365 * DAY_S {
        return format!("{:.3} s", stamp_ns as f64 * 1e-9);
    }
    let (days, of_day) = (seconds / DAY_S, seconds % DAY_S);
    let (year, month, day) = civil_date(days);
    let (hour, minute, second) = (of_day / 3600, of_day / 60 % 60, of_day % 60);
    format!("{year}-{month:02}-{day:02} {hour:02}:{minute:02}:{second:02}.{millis:03} UTC")
}

/// Two instants for people, as a range.
pub fn range_text((first_ns, last_ns): (i64, i64)) -> String {
    format!("{} ... {}", instant_text(first_ns), instant_text(last_ns))
}

/// Year, month and day of a number of days since 1970, in the Gregorian calendar.
fn civil_date(days: i64) -> (i64, i64, i64) {
    let is_leap = |year: i64| year % 4 == 0 && (year % 100 != 0 || year % 400 == 0);
    let (mut year, mut left) = (1970, days);
    while left >= 365 + i64::from(is_leap(year)) {
        left -= 365 + i64::from(is_leap(year));
        year += 1;
    }
    let february = 28 + i64::from(is_leap(year));
    let months = [31, february, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31];
    let mut month = 0;
    while left >= months[month] {
        left -= months[month];
        month += 1;
    }
    (year, month as i64 + 1, left + 1)
}
