//! Frames' pictures and pixels made while the log is scanned, from chunks that are decompressed
//! anyway.
//!
//! Which messages a drive's frames need is known only when all of the log has been read. But after
//! its first chunks it can mostly be told: the topics, where sensors sit, and when the grid begins.
//! So the drive is opened on what has been read so far, and what its ticks would take is made as it
//! comes by. Where the next message may be nearer to a tick, its data is held until that is known.
//!
//! Nothing depends on that guess but time: [`Stock`] gives out only what would be made again.

use std::{collections::BTreeMap, path::Path, sync::Arc};

use rayon::prelude::*;

use crate::{
    dataset::{
        align,
        drive::Drive,
        senses::{Sensed, Senses, Signal},
        stock::Stock,
    },
    error::Result,
    log::{
        profile::{Profile, Tolerance},
        reader::Place,
        recording::{Recording, Series, Stamped},
        scan::Scanned,
        signals::Pose,
    },
};

/// When a log has become so many times longer, what was guessed of it is guessed again.
const GUESS_AGAIN_AT: u64 = 4;

/// Makes what a drive will need.
pub struct Ahead<'c> {
    profile: &'c Profile,
    rate_hz: f64,
    /// Messages that are worked on at once; with one, nothing is copied for it.
    at_once: usize,
    stock: Stock,
    guess: Option<Guess>,
    chunks: u64,
    guess_at: u64,
    /// Of each signal's topic, its last message: whether it is needed, the next one tells.
    held: BTreeMap<String, Needed>,
    waiting: Vec<Needed>,
}

/// What a drive seems to be.
struct Guess {
    recording: Recording,
    senses: Arc<Senses>,
    start_ns: i64,
    period_ns: i64,
    tolerance: Tolerance,
}

/// A message that frames need, with its data.
struct Needed {
    signal: Signal,
    sample: Stamped<Place>,
    data: Vec<u8>,
}

/// Three samples in a row, by their stamps: is the middle one needed?
struct Neighbours {
    before_ns: Option<i64>,
    own_ns: i64,
    after_ns: Option<i64>,
}

impl Neighbours {
    /// As if the next one came after half of the time that has passed since the last one: most are
    /// needed then, too, or not needed at all.
    fn with_next_soon(self) -> Neighbours {
        let gap_ns = self.own_ns.saturating_sub(self.before_ns.unwrap_or(self.own_ns));
        Neighbours { after_ns: Some(self.own_ns.saturating_add(gap_ns / 2)), ..self }
    }
}

impl<'c> Ahead<'c> {
    /// To make what frames of this rate need, `at_once` messages at a time; it lies in `folder`.
    ///
    /// # Errors
    ///
    /// [`Error::Io`](crate::error::Error::Io) if there is no room for it.
    pub fn new(
        profile: &'c Profile,
        rate_hz: f64,
        folder: &Path,
        at_once: usize,
    ) -> Result<Ahead<'c>> {
        Ok(Ahead {
            profile,
            rate_hz,
            at_once,
            stock: Stock::within(folder)?,
            guess: None,
            chunks: 0,
            guess_at: 1,
            held: BTreeMap::new(),
            waiting: Vec::new(),
        })
    }

    /// Make what is needed of the messages in a chunk that has just been scanned.
    ///
    /// # Errors
    ///
    /// [`Error::Io`](crate::error::Error::Io) if the disk refuses.
    pub fn chunk(&mut self, scanned: &Scanned, chunk: u32, data: &[u8]) -> Result<()> {
        self.chunks += 1;
        if self.chunks >= self.guess_at {
            let recording = scanned.recording()?;
            let guess = recording.and_then(|r| Guess::new(r, self.profile, self.rate_hz));
            // Until there is one, soon again: every chunk that passes has to be read twice.
            let factor = if guess.is_some() { GUESS_AGAIN_AT } else { 2 };
            self.guess_at = self.chunks * factor;
            self.guess = guess.or(self.guess.take());
        }
        let Some(guess) = self.guess.take() else { return Ok(()) };
        for signal in Signal::ALL {
            let topic = guess.senses.topic(signal).and_then(|name| scanned.topic(name));
            if let Some(topic) = topic
                && let Series::Located(samples) = &topic.series
            {
                self.samples(&guess, signal, &topic.name, samples, chunk, data)?;
            }
        }
        if self.waiting.len() >= self.at_once {
            self.make_waiting(&guess)?;
        }
        self.guess = Some(guess);
        Ok(())
    }

    /// What was made.
    ///
    /// # Errors
    ///
    /// [`Error::Io`](crate::error::Error::Io) if the disk refuses.
    pub fn finish(mut self) -> Result<Stock> {
        if let Some(guess) = self.guess.take() {
            self.make_waiting(&guess)?;
        }
        Ok(self.stock)
    }

    /// Go through the samples of a topic that lie in a chunk: the last ones.
    fn samples(
        &mut self,
        guess: &Guess,
        signal: Signal,
        topic: &str,
        samples: &[Stamped<Place>],
        chunk: u32,
        data: &[u8],
    ) -> Result<()> {
        let is_earlier = |sample: &Stamped<Place>| sample.value.segment < chunk;
        let first = samples.partition_point(is_earlier);
        let stamp = |at: Option<usize>| Some(samples.get(at?)?.stamp_ns);
        let neighbours = |at: usize| Neighbours {
            before_ns: stamp(at.checked_sub(1)),
            own_ns: samples[at].stamp_ns,
            after_ns: stamp(at.checked_add(1)),
        };
        if let Some(last) = first.checked_sub(1).filter(|_| first < samples.len())
            && let Some(held) = self.held.remove(topic)
            && held.sample == samples[last]
            && guess.needs(signal, &neighbours(last))
        {
            self.take(guess, held)?;
        }
        for (at, sample) in samples.iter().enumerate().skip(first) {
            let Place { start, len, .. } = sample.value;
            let needed = guess.needs(signal, &neighbours(at));
            let Some(bytes) = data.get(start as usize..(start + len) as usize) else { continue };
            if !needed {
                continue;
            }
            let is_last = at + 1 == samples.len();
            let is_sure = !is_last || guess.needs(signal, &neighbours(at).with_next_soon());
            if self.at_once == 1 && is_sure {
                let (pose, sensed) = guess.sense(signal, sample.stamp_ns, bytes);
                self.stock.add(sample.value, &guess.senses, pose, &sensed)?;
                continue;
            }
            let needed = Needed { signal, sample: sample.clone(), data: bytes.to_vec() };
            match is_sure {
                true => self.waiting.push(needed),
                false => drop(self.held.insert(topic.to_string(), needed)),
            }
        }
        Ok(())
    }

    /// Make something of a message, or let it wait until there are enough.
    fn take(&mut self, guess: &Guess, needed: Needed) -> Result<()> {
        self.waiting.push(needed);
        if self.waiting.len() >= self.at_once { self.make_waiting(guess) } else { Ok(()) }
    }

    fn make_waiting(&mut self, guess: &Guess) -> Result<()> {
        let waiting = std::mem::take(&mut self.waiting);
        let make = |n: &Needed| guess.sense(n.signal, n.sample.stamp_ns, &n.data);
        let made: Vec<_> = match waiting.as_slice() {
            [one] => vec![make(one)],
            several => several.par_iter().map(make).collect(),
        };
        for (needed, (pose, sensed)) in waiting.iter().zip(made) {
            self.stock.add(needed.sample.value, &guess.senses, pose, &sensed)?;
        }
        Ok(())
    }
}

impl Guess {
    fn new(recording: Recording, profile: &Profile, rate_hz: f64) -> Option<Guess> {
        let drive = Drive::new(recording, profile, rate_hz).ok()?;
        Some(Guess {
            start_ns: drive.grid.start_ns,
            period_ns: align::period_ns(rate_hz),
            tolerance: drive.profile.tolerance_ms,
            senses: Arc::new(drive.senses),
            recording: drive.recording,
        })
    }

    /// Whether a tick would take a sample: there is one within the tolerance that has none nearer.
    fn needs(&self, signal: Signal, sample: &Neighbours) -> bool {
        let tolerance_ns = align::nanos(match signal {
            Signal::Camera => self.tolerance.camera,
            Signal::Lidar => self.tolerance.lidar,
            Signal::Radar => self.tolerance.radar,
        });
        let own_ns = sample.own_ns;
        let middle_ns = |other_ns: i64| own_ns + (other_ns.saturating_sub(own_ns)) / 2;
        let from_ns = own_ns.saturating_sub(tolerance_ns);
        let from_ns = from_ns.max(sample.before_ns.map_or(from_ns, middle_ns)).max(self.start_ns);
        let to_ns = own_ns.saturating_add(tolerance_ns);
        let to_ns = to_ns.min(sample.after_ns.map_or(to_ns, middle_ns));
        let past_tick_ns = (from_ns - self.start_ns) % self.period_ns;
        let to_tick_ns = (self.period_ns - past_tick_ns) % self.period_ns;
        from_ns.saturating_add(to_tick_ns) <= to_ns
    }

    fn sense(&self, signal: Signal, stamp_ns: i64, message: &[u8]) -> (Option<Pose>, Sensed) {
        let pose = self.senses.pose(&self.recording, signal, stamp_ns);
        let sensed = self.senses.sense(&self.recording, signal, message, &pose);
        (pose.ok().flatten(), sensed)
    }
}
