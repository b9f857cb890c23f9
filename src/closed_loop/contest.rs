//! Policies drive a suite: many episodes at a time, and resumable.
//!
//! ```text
//! DIR/drive.json                      what decides the rows; written first, locked while driving
//!     episodes/POLICY/EPISODE.json    each episode as soon as it is over: its row and where time went
//!     logs/POLICY/EPISODE.mcap        where logs are wanted
//!     failures/POLICY/EPISODE.svg     what a policy with a camera saw last
//!     timing.json                     wall time by policy
//!     episodes.parquet                all rows, written last
//! ```

use std::{
    any::Any,
    fs,
    panic::{AssertUnwindSafe, catch_unwind},
    path::{Path, PathBuf},
    sync::{
        Mutex, PoisonError,
        atomic::{AtomicBool, AtomicUsize, Ordering},
    },
    thread,
};

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::{
    atomic,
    claim::claim,
    closed_loop::{
        outing::{self, Clock, Outing, Setting},
        pilot::Pilot,
        row::EpisodeRow,
        strip::strip,
        suite::{Episode, Suite},
        tally::begun,
        timing::Timing,
    },
    error::{Error, Result},
    scene::shapes::Shapes,
    sim::{rig::Rig, stage::Stages},
};

/// Makes a pilot; each thread has its own.
pub type MakePilot = Box<dyn Fn() -> Result<Box<dyn Pilot>> + Send + Sync>;

/// Who takes part.
pub struct Entrant {
    /// In tables; no two of a contest have the same.
    pub name: String,
    /// What decides how it drives: a digest of its weights, its controller.
    pub identity: Value,
    pub make: MakePilot,
}

/// Who drives what, and where to.
pub struct Contest {
    pub suite: Suite,
    pub entrants: Vec<Entrant>,
    /// OpenDRIVE files in place of the package's own towns.
    pub maps: Option<PathBuf>,
    /// Keep a log of every episode.
    pub record: bool,
    pub jobs: usize,
    pub out: PathBuf,
}

/// What is kept of an episode.
#[derive(Serialize, Deserialize)]
struct Kept {
    row: EpisodeRow,
    clock: Clock,
}

/// An episode that is over; the first of them may come from an earlier attempt.
pub enum Progress<'r> {
    Kept(&'r EpisodeRow),
    Driven(&'r EpisodeRow),
}

impl Contest {
    /// Drive all episodes that are not driven yet; the rows of all, in the order of policies and
    /// episodes, and where time went.
    ///
    /// # Errors
    ///
    /// [`Error::Config`] if two entrants have one name, or another process is at work in the folder;
    /// [`Error::Exists`] if the folder is another contest's; as [`Stages::get`], [`outing::drive`] and
    /// the making of pilots.
    pub fn drive(
        &self,
        tell: &(dyn Fn(Progress) + Sync),
    ) -> Result<(Vec<EpisodeRow>, Vec<Timing>)> {
        self.check_names()?;
        let identity = self.identity()?;
        let _lock = claim(&self.out.join("drive.json"), &identity, "contest", differing)?;
        let tasks: Vec<(&Entrant, &Episode)> = self
            .entrants
            .iter()
            .flat_map(|entrant| self.suite.episodes.iter().map(move |episode| (entrant, episode)))
            .collect();
        let mut missing = Vec::new();
        for (entrant, episode) in &tasks {
            match atomic::read_json_if_exists::<Kept>(&self.kept_path(entrant, episode))? {
                Some(kept) => tell(Progress::Kept(&kept.row)),
                None => missing.push((*entrant, *episode)),
            }
        }
        self.drive_all(&missing, tell)?;
        let (mut rows, mut timings) = (Vec::new(), Vec::new());
        for entrant in &self.entrants {
            let kept = self.suite.episodes.iter().map(|episode| {
                let kept: Kept = atomic::read_json(&self.kept_path(entrant, episode))?;
                Ok((kept.row, kept.clock))
            });
            let episodes: Vec<_> = kept.collect::<Result<_>>()?;
            timings.push(Timing::of(&entrant.name, &episodes));
            rows.extend(episodes.into_iter().map(|(row, _)| row));
        }
        Ok((rows, timings))
    }

    /// Drive episodes on `jobs` threads. The first error stops all of them.
    fn drive_all(
        &self,
        tasks: &[(&Entrant, &Episode)],
        tell: &(dyn Fn(Progress) + Sync),
    ) -> Result<()> {
        let stages = Stages::new(self.maps.as_deref(), &self.suite.towns());
        let (shapes, rig) = (Shapes::new(), Rig::default());
        let (next, is_over) = (AtomicUsize::new(0), AtomicBool::new(false));
        let error = Mutex::new(None);
        let work = || -> Result<()> {
            let mut pilot: Option<(&str, Box<dyn Pilot>)> = None;
            while !is_over.load(Ordering::Relaxed) {
                let Some((entrant, episode)) = tasks.get(next.fetch_add(1, Ordering::Relaxed))
                else {
                    return Ok(());
                };
                let mut own = match pilot.take().filter(|(name, _)| *name == entrant.name) {
                    Some((_, pilot)) => pilot,
                    None => (entrant.make)()?,
                };
                let stage = stages.get(&episode.town)?;
                let setting =
                    Setting { suite: &self.suite, stage: &stage, shapes: &shapes, rig: &rig };
                let log = self.record.then(|| self.path("logs", entrant, episode, "mcap"));
                if let Some(folder) = log.as_deref().and_then(Path::parent) {
                    fs::create_dir_all(folder).map_err(Error::io("create", folder))?;
                }
                let driven = catch_unwind(AssertUnwindSafe(|| {
                    outing::drive(&setting, episode, &entrant.name, own.as_mut(), log.as_deref())
                }));
                let row = match driven {
                    Ok(outing) => {
                        pilot = Some((&entrant.name, own));
                        self.keep(entrant, episode, outing?, &rig)?
                    }
                    Err(panic) => self.keep_panic(entrant, episode, &*panic)?,
                };
                tell(Progress::Driven(&row));
            }
            Ok(())
        };
        // A policy's own parallel work stays on the thread of its episode: there are as many
        // episodes at a time as there are threads to be used.
        let alone = || -> Result<()> {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
            let pool = pool.map_err(|error| Error::Config {
                key: "--jobs".into(),
                what: error.to_string(),
                hint: None,
            })?;
            pool.install(work)
        };
        thread::scope(|scope| {
            for _ in 0..self.jobs.max(1).min(tasks.len()) {
                scope.spawn(|| {
                    if let Err(failed) = alone() {
                        is_over.store(true, Ordering::Relaxed);
                        let mut error = error.lock().unwrap_or_else(PoisonError::into_inner);
                        error.get_or_insert(failed);
                    }
                });
            }
        });
        error.into_inner().unwrap_or_else(PoisonError::into_inner).map_or(Ok(()), Err)
    }

    /// Keep what came of an episode.
    fn keep(
        &self,
        entrant: &Entrant,
        episode: &Episode,
        outing: Outing,
        rig: &Rig,
    ) -> Result<EpisodeRow> {
        let Outing { row, clock, film } = outing;
        if !row.success
            && let Some(svg) = strip(&film, &row, rig)
        {
            write(&self.path("failures", entrant, episode, "svg"), svg.as_bytes())?;
        }
        let kept = Kept { row, clock };
        self.keep_row(entrant, episode, &kept)?;
        Ok(kept.row)
    }

    /// Keep that a policy panicked, which is a bug, and no reason to lose the other episodes.
    fn keep_panic(
        &self,
        entrant: &Entrant,
        episode: &Episode,
        panic: &(dyn Any + Send),
    ) -> Result<EpisodeRow> {
        let what = panic.downcast_ref::<String>().cloned();
        let what = what.or_else(|| panic.downcast_ref::<&str>().map(|what| what.to_string()));
        let row = EpisodeRow {
            reason: "crashed".into(),
            error: Some(format!("panicked: {}", what.unwrap_or_default())),
            ..begun(&entrant.name, &self.suite.name, episode)
        };
        let kept = Kept { row, clock: Clock::default() };
        self.keep_row(entrant, episode, &kept)?;
        Ok(kept.row)
    }

    fn keep_row(&self, entrant: &Entrant, episode: &Episode, kept: &Kept) -> Result<()> {
        let text = serde_json::to_vec(kept)
            .map_err(|source| Error::Json { path: self.kept_path(entrant, episode), source })?;
        write(&self.kept_path(entrant, episode), &text)
    }

    fn kept_path(&self, entrant: &Entrant, episode: &Episode) -> PathBuf {
        self.path("episodes", entrant, episode, "json")
    }

    fn path(&self, room: &str, entrant: &Entrant, episode: &Episode, ending: &str) -> PathBuf {
        self.out.join(room).join(&entrant.name).join(format!("{episode}.{ending}"))
    }

    /// What decides the rows.
    fn identity(&self) -> Result<Value> {
        let mut maps = Vec::new();
        if let Some(folder) = &self.maps {
            for town in self.suite.towns() {
                let path = folder.join(format!("{town}.xodr"));
                maps.push(
                    serde_json::json!({ "town": town, "sha256": atomic::sha256_of_file(&path)? }),
                );
            }
        }
        let entrants = self.entrants.iter().map(
            |entrant| serde_json::json!({ "name": entrant.name, "identity": entrant.identity }),
        );
        Ok(serde_json::json!({
            "pmp": env!("CARGO_PKG_VERSION"),
            "suite": self.suite,
            "maps": maps,
            "policies": entrants.collect::<Vec<_>>(),
            "record": self.record,
        }))
    }

    fn check_names(&self) -> Result<()> {
        for (at, entrant) in self.entrants.iter().enumerate() {
            let is_taken = self.entrants[..at].iter().any(|other| other.name == entrant.name);
            let is_folder = !entrant.name.is_empty() && !entrant.name.contains(['/', '\\']);
            if is_taken || !is_folder || entrant.name.starts_with('.') {
                return Err(Error::Config {
                    key: "--policy".into(),
                    what: format!("two policies are called `{}`, or it is no name", entrant.name),
                    hint: Some("drive them into folders of their own, or rename one".into()),
                });
            }
        }
        Ok(())
    }
}

/// Keys in which two identities differ.
fn differing(found: &Value, wanted: &Value) -> Vec<String> {
    let keys = wanted.as_object().into_iter().flatten().map(|(key, _)| key);
    keys.filter(|key| found.get(key) != wanted.get(key)).cloned().collect()
}

fn write(path: &Path, data: &[u8]) -> Result<()> {
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder).map_err(Error::io("create", folder))?;
    }
    atomic::write(path, data)?;
    Ok(())
}
