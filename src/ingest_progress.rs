//! What an ingest looks like on a terminal while it runs: a line for all of it, and one for each
//! log at work.
//!
//! How much time is left is told from what each phase has taken a byte of log so far, so logs that
//! were not opened yet count by their size.

use std::{
    collections::BTreeMap,
    fmt,
    sync::{Mutex, PoisonError},
    time::{Duration, Instant},
};

use indicatif::{HumanCount, HumanDuration, MultiProgress, ProgressBar, ProgressStyle};

use crate::dataset::{
    ingest_event::{Event, Step},
    logs::GivenLog,
};

/// Lines change no faster than eyes can follow.
const REDRAW_EVERY: Duration = Duration::from_millis(100);

/// Steps of a bar.
const BAR_STEPS: u64 = 1000;

/// What is done with a log, in this order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    Hashing,
    Copying,
    Reading,
    MakingFrames,
}

impl fmt::Display for Phase {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self {
            Phase::Hashing => "hashing",
            Phase::Copying => "copying",
            Phase::Reading => "reading",
            Phase::MakingFrames => "making frames",
        })
    }
}

/// How far a log is.
#[derive(Clone, Debug, Default)]
struct LogWork {
    bytes: f64,
    /// Bytes to do in each phase, and those that are done.
    to_copy: f64,
    copied: f64,
    read: f64,
    made: f64,
    opened_ticks: u64,
    made_ticks: u64,
    /// When something was last heard of it, from the beginning of the ingest.
    heard: Duration,
    phase: Option<Phase>,
    has_started: bool,
    has_ended: bool,
}

/// What a phase has taken so far, over all logs and threads.
#[derive(Clone, Copy, Debug, Default)]
struct Cost {
    bytes: f64,
    seconds: f64,
}

impl Cost {
    /// The seconds that so many bytes more will take on one thread; `None` while nothing is known.
    fn of(self, bytes: f64) -> Option<f64> {
        match bytes > 0.0 {
            true => (self.bytes > 0.0).then(|| bytes * self.seconds / self.bytes),
            false => Some(0.0),
        }
    }
}

/// The sums of all events so far.
#[derive(Clone, Debug, Default)]
pub struct Ledger {
    logs: Vec<LogWork>,
    copying: Cost,
    reading: Cost,
    making: Cost,
    at_once: usize,
    most_at_once: usize,
    pub frames: u64,
    pub ended: usize,
}

impl Ledger {
    /// A ledger of some logs.
    pub fn new(logs: &[GivenLog]) -> Ledger {
        let work = |log: &GivenLog| LogWork {
            bytes: log.bytes as f64,
            to_copy: log.bytes_to_copy() as f64,
            ..LogWork::default()
        };
        Ledger { logs: logs.iter().map(work).collect(), ..Ledger::default() }
    }

    /// Note what was told of a log at the time `now`.
    pub fn note(&mut self, number: usize, step: Step, now: Duration) {
        let Some(log) = self.logs.get_mut(number) else { return };
        let seconds = now.saturating_sub(log.heard).as_secs_f64();
        log.heard = now;
        let spend = |cost: &mut Cost, bytes: f64| {
            cost.bytes += bytes;
            cost.seconds += seconds;
        };
        match step {
            Step::Started => {
                self.at_once += 1;
                self.most_at_once = self.most_at_once.max(self.at_once);
                log.has_started = true;
            }
            Step::Hashed => log.phase = None,
            Step::Hashing => log.phase = Some(Phase::Hashing),
            Step::Copied { bytes } => {
                spend(&mut self.copying, bytes as f64 - log.copied);
                log.copied = bytes as f64;
                log.phase = Some(Phase::Copying);
            }
            Step::Read { bytes } => {
                spend(&mut self.reading, bytes as f64 - log.read);
                log.read = bytes as f64;
                log.phase = Some(Phase::Reading);
            }
            Step::Opened { ticks } => {
                spend(&mut self.reading, 0.0);
                log.opened_ticks += ticks;
                log.phase = Some(Phase::MakingFrames);
            }
            Step::Made { ticks, frames } => {
                log.made_ticks += ticks;
                // A log may be opened in parts; what is done never becomes less.
                let share = log.made_ticks as f64 / log.opened_ticks.max(1) as f64;
                let made = (log.bytes * share).max(log.made);
                spend(&mut self.making, made - log.made);
                log.made = made;
                self.frames += frames;
            }
            Step::Ended => {
                (log.phase, log.has_ended) = (None, true);
                self.at_once -= usize::from(log.has_started);
                self.ended += 1;
            }
        }
    }

    /// What is being done with a log, and the share of it that is done.
    pub fn at_work(&self, number: usize) -> Option<(Phase, f64)> {
        let log = self.logs.get(number)?;
        let phase = log.phase?;
        let (done, of) = match phase {
            Phase::Hashing => (0.0, 1.0),
            Phase::Copying => (log.copied, log.to_copy),
            Phase::Reading => (log.read, log.bytes),
            Phase::MakingFrames => (log.made, log.bytes),
        };
        Some((phase, if of > 0.0 { done / of } else { 0.0 }))
    }

    /// The share of all bytes, each counted once a phase, that is done.
    pub fn share_done(&self) -> f64 {
        let phases = |log: &LogWork| log.to_copy + 2.0 * log.bytes;
        let all: f64 = self.logs.iter().map(phases).sum();
        let done = |log: &LogWork| match log.has_ended {
            true => phases(log),
            false => log.copied + log.read + log.made,
        };
        let done: f64 = self.logs.iter().map(done).sum();
        if all > 0.0 { done / all } else { 1.0 }
    }

    /// The time left, if every phase has begun somewhere.
    pub fn time_left(&self) -> Option<Duration> {
        let left = || self.logs.iter().filter(|log| !log.has_ended);
        let bytes = |pick: fn(&LogWork) -> f64| left().map(pick).sum::<f64>().max(0.0);
        let seconds = self.copying.of(bytes(|log| log.to_copy - log.copied))?
            + self.reading.of(bytes(|log| log.bytes - log.read))?
            + self.making.of(bytes(|log| log.bytes - log.made))?;
        // Between two logs a thread is not idle for long.
        let threads = self.most_at_once.min(left().count()).max(1);
        Duration::try_from_secs_f64(seconds / threads as f64).ok()
    }
}

/// The lines on stderr; where that is no terminal, nothing is drawn.
pub struct IngestProgress {
    begun: Instant,
    lines: MultiProgress,
    state: Mutex<State>,
}

struct State {
    ledger: Ledger,
    names: Vec<String>,
    overall: ProgressBar,
    /// Of each log at work.
    logs: BTreeMap<usize, ProgressBar>,
    drawn: Option<Instant>,
}

impl Default for IngestProgress {
    fn default() -> Self {
        let lines = MultiProgress::new();
        let overall =
            lines.add(ProgressBar::new(BAR_STEPS).with_style(style("ingest {wide_bar} {msg}")));
        overall.enable_steady_tick(Duration::from_millis(250));
        let (names, logs) = (Vec::new(), BTreeMap::new());
        let state = State { ledger: Ledger::default(), names, overall, logs, drawn: None };
        IngestProgress { begun: Instant::now(), lines, state: Mutex::new(state) }
    }
}

fn style(template: &str) -> ProgressStyle {
    ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar())
}

impl IngestProgress {
    /// Show what is told.
    pub fn tell(&self, event: Event) {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let state = &mut *state;
        match event {
            Event::Begun { logs } => {
                state.ledger = Ledger::new(logs);
                state.names = logs.iter().map(GivenLog::name).collect();
            }
            Event::OfLog { number, step } => {
                let phase = |ledger: &Ledger| ledger.at_work(number).map(|(phase, _)| phase);
                let before = phase(&state.ledger);
                state.ledger.note(number, step, self.begun.elapsed());
                let is_due = state.drawn.is_none_or(|drawn| drawn.elapsed() >= REDRAW_EVERY);
                if is_due || phase(&state.ledger) != before {
                    self.draw(state);
                }
            }
            Event::Sending { bytes } => {
                state.overall.reset();
                state.overall.set_style(style(
                    "send {wide_bar} {binary_bytes} of {binary_total_bytes}, \
                     {binary_bytes_per_sec}, {eta} left",
                ));
                state.overall.set_length(bytes);
            }
            Event::Sent { bytes } => state.overall.inc(bytes),
        }
    }

    fn draw(&self, state: &mut State) {
        state.drawn = Some(Instant::now());
        state.logs.retain(|number, line| {
            let is_at_work = state.ledger.at_work(*number).is_some();
            if !is_at_work {
                line.finish_and_clear();
                self.lines.remove(line);
            }
            is_at_work
        });
        for (number, name) in state.names.iter().enumerate() {
            let Some((phase, share)) = state.ledger.at_work(number) else { continue };
            let line = state.logs.entry(number).or_insert_with(|| {
                let bar = ProgressBar::new(BAR_STEPS);
                let style = style("  {bar:20} {percent:>3} % {msg:13} {prefix}");
                self.lines.add(bar.with_style(style).with_prefix(name.clone()))
            });
            line.set_message(phase.to_string());
            line.set_position((share * BAR_STEPS as f64) as u64);
        }
        let ledger = &state.ledger;
        state.overall.set_position((ledger.share_done() * BAR_STEPS as f64) as u64);
        let rate = ledger.frames as f64 / self.begun.elapsed().as_secs_f64().max(1e-3);
        let left = match ledger.time_left() {
            Some(left) => format!("{:#} left", HumanDuration(left)),
            None => "time left not known yet".to_string(),
        };
        state.overall.set_message(format!(
            "{} of {} logs, {} frames, {rate:.0}/s, {left}",
            ledger.ended,
            state.names.len(),
            HumanCount(ledger.frames),
        ));
    }

    /// Take the lines away.
    pub fn finish(&self) {
        let state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        state.logs.values().for_each(ProgressBar::finish_and_clear);
        state.overall.finish_and_clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::PathBuf;

    /// A ledger of logs of so many bytes.
    fn ledger(bytes: &[u64]) -> Ledger {
        let log = |bytes: &u64| {
            let mut log = GivenLog::local(PathBuf::from("none"));
            log.bytes = *bytes;
            log
        };
        Ledger::new(&bytes.iter().map(log).collect::<Vec<_>>())
    }

    fn note(ledger: &mut Ledger, at_s: u64, number: usize, step: Step) {
        ledger.note(number, step, Duration::from_secs(at_s));
    }

    /// The whole of a log of so many bytes: 1 s to read 10 bytes, 3 s to make their frames.
    fn go_through(ledger: &mut Ledger, begin_s: u64, number: usize, bytes: u64) {
        note(ledger, begin_s, number, Step::Started);
        note(ledger, begin_s + bytes / 10, number, Step::Read { bytes });
        note(ledger, begin_s + bytes / 10, number, Step::Opened { ticks: 4 });
        note(ledger, begin_s + bytes * 4 / 10, number, Step::Made { ticks: 4, frames: 3 });
        note(ledger, begin_s + bytes * 4 / 10, number, Step::Ended);
    }

    #[test]
    fn time_left_counts_logs_that_were_not_opened_by_their_size() {
        let mut ledger = ledger(&[100, 50, 200]);
        assert_eq!(ledger.time_left(), None);
        go_through(&mut ledger, 0, 0, 100);
        assert_eq!((ledger.ended, ledger.frames), (1, 3));
        assert_eq!(ledger.time_left(), Some(Duration::from_secs(100)));
        go_through(&mut ledger, 40, 1, 50);
        assert_eq!(ledger.time_left(), Some(Duration::from_secs(80)));
        // Half read: 10 s of reading are left, and 60 s of making.
        note(&mut ledger, 60, 2, Step::Started);
        note(&mut ledger, 70, 2, Step::Read { bytes: 100 });
        assert_eq!(ledger.at_work(2), Some((Phase::Reading, 0.5)));
        assert_eq!(ledger.time_left(), Some(Duration::from_secs(70)));
        note(&mut ledger, 80, 2, Step::Read { bytes: 200 });
        note(&mut ledger, 80, 2, Step::Opened { ticks: 8 });
        note(&mut ledger, 95, 2, Step::Made { ticks: 2, frames: 2 });
        assert_eq!(ledger.at_work(2), Some((Phase::MakingFrames, 0.25)));
        assert_eq!(ledger.time_left(), Some(Duration::from_secs(45)));
        assert!(ledger.share_done() > 0.7 && ledger.share_done() < 1.0);
        note(&mut ledger, 140, 2, Step::Ended);
        assert_eq!((ledger.time_left(), ledger.share_done()), (Some(Duration::ZERO), 1.0));
    }

    #[test]
    fn threads_side_by_side_and_logs_that_were_committed_before_are_reckoned_with() {
        let mut ledger = ledger(&[100, 100, 100, 100, 1000]);
        // Found to be committed: it takes no time, and says nothing about the others.
        note(&mut ledger, 0, 4, Step::Started);
        note(&mut ledger, 0, 4, Step::Ended);
        assert_eq!(ledger.time_left(), None);
        note(&mut ledger, 0, 1, Step::Started);
        go_through(&mut ledger, 0, 0, 100);
        assert_eq!(ledger.time_left(), Some(Duration::from_secs(60)), "three logs on two threads");
        // A log opened in two parts never goes back.
        note(&mut ledger, 10, 1, Step::Read { bytes: 100 });
        note(&mut ledger, 10, 1, Step::Opened { ticks: 4 });
        note(&mut ledger, 25, 1, Step::Made { ticks: 3, frames: 3 });
        note(&mut ledger, 25, 1, Step::Opened { ticks: 4 });
        note(&mut ledger, 26, 1, Step::Made { ticks: 1, frames: 1 });
        assert_eq!(ledger.at_work(1), Some((Phase::MakingFrames, 0.75)));
    }
}
