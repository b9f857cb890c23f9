//! What an ingest did, as text for people.

use std::fmt::{self, Display, Write as _};

use crate::dataset::{
    account::TopicAccount,
    manifest::{EpisodeRecord, LogRecord, Manifest},
};

/// Damages of one log that are listed; the manifest has them all.
const LISTED: usize = 5;

impl Manifest {
    /// What was made and what was left out, a few lines a log.
    pub fn report(&self) -> impl Display + '_ {
        Report(self)
    }
}

struct Report<'m>(&'m Manifest);

impl Display for Report<'_> {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        for log in &self.0.logs {
            write_log(f, log)?;
        }
        for log in &self.0.failed {
            writeln!(f, "{}: failed: {}", log.source_log, log.error)?;
        }
        let hours = self.0.frames as f64 / self.0.config.rate_hz / 3600.0;
        let plural = |count: usize, word: &str| match count {
            1 => format!("1 {word}"),
            count => format!("{count} {word}s"),
        };
        write!(
            f,
            "{}, {} frames, {hours:.2} h",
            plural(self.0.logs.iter().map(|log| log.episodes.len()).sum(), "episode"),
            self.0.frames
        )?;
        match self.0.failed.len() {
            0 => writeln!(f),
            count => writeln!(f, "; {} gave nothing", plural(count, "log")),
        }
    }
}

fn write_log(f: &mut fmt::Formatter, log: &LogRecord) -> fmt::Result {
    writeln!(
        f,
        "{}: {} frames ({} with 3 s of future), {:.1} s, {:.0} m, {}",
        log.source_log,
        log.frames,
        log.frames_with_full_future,
        log.duration_s,
        log.distance_m,
        log.split.name()
    )?;
    for episode in &log.episodes {
        write_drops(f, episode, log.episodes.len() > 1)?;
    }
    for damage in log.damage.iter().take(LISTED) {
        writeln!(f, "  byte {}: {}", damage.offset, damage.what)?;
    }
    if log.damage.len() > LISTED {
        writeln!(f, "  ... and {} more, see logs/{}.json", log.damage.len() - LISTED, log.episode)?;
    }
    for (topic, (count, why)) in &log.undecodable {
        writeln!(f, "  {topic}: {count} messages could not be decoded ({why})")?;
    }
    for (topic, count) in &log.out_of_order {
        writeln!(f, "  {topic}: {count} messages came late and were put in order")?;
    }
    for (topic, count) in &log.clock_jumps {
        writeln!(f, "  {topic}: its clock jumped back {count} times, each begins an episode")?;
    }
    for account in log.topics.iter().filter(|account| account.used_as.is_some()) {
        write_account(f, account)?;
    }
    let unused = log.topics.iter().filter(|account| account.used_as.is_none());
    let (topics, messages) = unused.fold((0, 0), |(n, sum), topic| (n + 1, sum + topic.read));
    if topics > 0 {
        writeln!(f, "  {messages} messages of {topics} topics that frames take nothing from")?;
    }
    let skews: Vec<_> = log.skews.iter().collect();
    if !skews.is_empty() {
        write!(f, "  ms from tick to sample (median, 95 %, largest):")?;
        for (index, (sensor, skew)) in skews.into_iter().enumerate() {
            let comma = if index == 0 { "" } else { "," };
            let (median, p95, largest) = (skew.median_ms, skew.p95_ms, skew.largest_ms);
            write!(f, "{comma} {sensor} {median:.1} {p95:.1} {largest:.1}")?;
        }
        writeln!(f)?;
    }
    for left_out in &log.left_out {
        writeln!(f, "  left out: {left_out}")?;
    }
    for note in &log.notes {
        writeln!(f, "  note: {note}")?;
    }
    Ok(())
}

/// A line for each reason; `is_named` where the log has other episodes.
fn write_drops(f: &mut fmt::Formatter, episode: &EpisodeRecord, is_named: bool) -> fmt::Result {
    for (reason, drop) in episode.drops.iter() {
        let mut line = format!("{} ticks left out: {}", drop.count, reason.name());
        let after_s = (drop.first_ns - episode.start_ns) as f64 * 1e-9;
        write!(line, ", first {after_s:.1} s after the start")?;
        if is_named {
            write!(line, " of {}", episode.id)?;
        }
        if let Some(example) = &drop.example {
            write!(line, " ({example})")?;
        }
        writeln!(f, "  {line}")?;
    }
    Ok(())
}

/// One line for a topic of which not everything was used.
fn write_account(f: &mut fmt::Formatter, account: &TopicAccount) -> fmt::Result {
    if account.left_out.is_empty() {
        return Ok(());
    }
    let reasons = account.left_out.iter();
    let reasons: Vec<_> = reasons.map(|(why, count)| format!("{count} {}", why.name())).collect();
    let (topic, used, read) = (&account.topic, account.used, account.read);
    writeln!(f, "  {topic}: {used} of {read} messages used; not: {}", reasons.join(", "))
}
