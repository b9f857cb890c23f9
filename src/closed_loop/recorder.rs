//! A log of an episode: what was sensed at every decision, and what was decided.
//!
//! Unlike a car's log nothing is late: every message has the stamp of its decision, so that the frames
//! that ingest makes of it are those that the policy saw.

use std::{collections::BTreeMap, fs, path::Path};

use crate::{
    closed_loop::{
        observation::{Observation, Observer},
        pilot::Act,
        suite::Episode,
        thought::Thought,
    },
    error::{Error, Result},
    log::{
        CONDITIONS_RECORD,
        writer::{LogOptions, LogWriter},
    },
    sim::{
        clocks::Source,
        drive::Drive,
        foxglove_messages::{at_start, messages, planned_motion},
        reading::Reading,
        record::{OUTCOME_RECORD, outcome},
        rig::Rig,
    },
};

/// Told beside what frames are made of.
const SOURCES: [Source; 4] = [Source::Control, Source::Situation, Source::Route, Source::Objects];

/// Writes the log of one episode, which has its name when it is whole.
pub struct Recorder<'t> {
    log: LogWriter,
    rig: &'t Rig,
    has_begun: bool,
}

impl<'t> Recorder<'t> {
    /// A log of an episode; one of an earlier attempt at the same episode is replaced.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] if the file cannot be written.
    pub fn create(path: &Path, rig: &'t Rig, policy: &str, episode: &Episode) -> Result<Self> {
        if path.exists() {
            fs::remove_file(path).map_err(Error::io("replace", path))?;
        }
        let mut log = LogWriter::create(path, LogOptions::default())?;
        let conditions = episode.planned().conditions();
        let words = [
            ("town", conditions.town),
            ("weather", conditions.weather),
            ("illumination", conditions.illumination),
            ("traffic", conditions.traffic),
        ];
        let words = words.into_iter().filter_map(|(key, value)| Some((key.to_owned(), value?)));
        log.write_metadata(CONDITIONS_RECORD, &words.collect())?;
        let words = [("policy", policy.to_string()), ("episode", episode.to_string())];
        let words = words.map(|(key, value)| (key.to_string(), value));
        log.write_metadata("pmp.evaluation", &BTreeMap::from(words))?;
        Ok(Recorder { log, rig, has_begun: false })
    }

    /// Write what was seen and what was done about it, which is decided already.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] if the disk refuses.
    pub fn write(
        &mut self,
        observer: &mut Observer,
        drive: &Drive,
        seen: &Observation,
        act: &Act,
    ) -> Result<()> {
        let stamp_ns = seen.stamp_ns;
        if !self.has_begun {
            for sent in at_start(stamp_ns, self.rig) {
                self.log.write(sent.topic, sent.message.as_ref(), stamp_ns)?;
            }
            self.has_begun = true;
        }
        for reading in &seen.readings {
            self.reading(stamp_ns, reading)?;
        }
        for source in SOURCES {
            self.reading(stamp_ns, &observer.read(source, drive))?;
        }
        if let Some(mode) = act.plan.strongest() {
            let path = planned_motion(stamp_ns, mode, drive.world.ego().speed_mps as f32);
            self.log.write(path.topic, path.message.as_ref(), stamp_ns)?;
        }
        self.log.write("/policy/decision", &Thought::of(act), stamp_ns)
    }

    fn reading(&mut self, stamp_ns: i64, reading: &Reading) -> Result<()> {
        for sent in messages(stamp_ns, reading, self.rig) {
            self.log.write(sent.topic, sent.message.as_ref(), stamp_ns)?;
        }
        Ok(())
    }

    /// Write how it ended.
    ///
    /// # Errors
    ///
    /// As [`LogWriter::finish`].
    pub fn finish(mut self, drive: &Drive) -> Result<()> {
        self.log.write_metadata(OUTCOME_RECORD, &outcome(drive))?;
        self.log.finish()
    }
}
