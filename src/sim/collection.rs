//! A collection: the episodes of a plan as logs in a folder, many at a time, and resumable.
//!
//! The folder's `plan.json` says what it is a collection of. It is written first, and locked as long as
//! a process records there. Every log names the plan and its own number in the metadata record that it
//! begins with, so a log that is there is known to be one of these, and is not recorded again. What a
//! killed process left half-written has a name of its own and is cleared away.

use std::{
    collections::BTreeMap,
    fs::{self, File},
    path::PathBuf,
};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::{
    atomic::{self, UNFINISHED, file_name},
    claim::claim,
    error::{Error, Result},
    log::head,
    scene::shapes::Shapes,
    sim::{
        message::Encoding,
        plan::{Episode, Plan},
        record::{Recipe, record},
        stage::Stages,
    },
};

/// Name of the file that says what a folder is a collection of.
pub const PLAN_FILE: &str = "plan.json";

/// Name of the metadata record by which a log is known: `plan` is the SHA-256 of [`PLAN_FILE`], `number`
/// that of the episode.
pub const EPISODE_RECORD: &str = "pmp.episode";

/// Length of a drive to reckon with before it is known, s: the paper's 10.8 h over 360 episodes
/// (section III.B).
const USUAL_S: u64 = 108;

/// Episodes to record.
#[derive(Clone, Debug)]
pub struct Collection {
    /// Folder for the logs; made if it is missing.
    pub out: PathBuf,
    /// OpenDRIVE files in place of the package's own towns.
    pub maps: Option<PathBuf>,
    pub plan: Plan,
    pub episodes: u32,
    pub recipe: Recipe,
}

/// What decides the bytes of all logs of a folder.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct PlanFile {
    pmp: String,
    plan: Plan,
    /// SHA-256 by town, of maps that are not the package's own.
    maps: BTreeMap<String, String>,
    encoding: Encoding,
    seconds: Option<f64>,
    perturb: f64,
    beams: usize,
}

/// What a collection tells of its progress, in simulated seconds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Progress {
    /// There is this much to do, as far as one can say.
    ToDo(u64),
    /// One second was driven.
    Second,
    /// A drive is over that was reckoned with a length and had another.
    Over { reckoned: u64, driven: u64 },
}

impl Collection {
    /// Record all episodes that are not there yet, on as many threads as the current rayon pool has;
    /// the logs of all, in the order of episodes. No byte depends on the number of threads, or on what
    /// was recorded when.
    ///
    /// # Errors
    ///
    /// [`Error::Exists`] if the folder is another plan's, or has a log of an episode's name that is
    /// none of this plan; [`Error::Config`] if the recipe makes no sense, a town has no route, or
    /// another process is at work in the folder; [`Error::Io`] if a file cannot be written; as
    /// [`Stages::get`].
    pub fn record(&self, tell: &(dyn Fn(Progress) + Sync)) -> Result<Vec<PathBuf>> {
        self.recipe.check()?;
        fs::create_dir_all(&self.out).map_err(Error::io("create", &self.out))?;
        let (_lock, digest) = self.claim()?;
        let episodes = self.plan.episodes(self.episodes);
        let mut missing = Vec::new();
        for episode in &episodes {
            if !self.is_recorded(episode, &digest)? {
                missing.push(episode);
            }
        }
        self.clear_unfinished()?;
        let reckoned = self.recipe.seconds.map_or(USUAL_S, |seconds| seconds.ceil() as u64);
        tell(Progress::ToDo(reckoned * missing.len() as u64));
        let stages = Stages::new(self.maps.as_deref(), &self.plan.towns);
        let shapes = Shapes::new();
        missing.into_par_iter().with_max_len(1).try_for_each(|episode| -> Result<()> {
            let driven = std::cell::Cell::new(0);
            let on_second = || {
                driven.set(driven.get() + 1);
                tell(Progress::Second);
            };
            let (stage, path) = (stages.get(&episode.town)?, self.path(episode));
            let identity = identity(episode, &digest);
            let identity = (EPISODE_RECORD, &identity);
            record(&stage, &shapes, episode, &self.recipe, &path, identity, &on_second)?;
            tell(Progress::Over { reckoned, driven: driven.get() });
            Ok(())
        })?;
        Ok(episodes.iter().map(|episode| self.path(episode)).collect())
    }

    /// Where the log of an episode is, or will be.
    pub fn path(&self, episode: &Episode) -> PathBuf {
        self.out.join(episode.file_name())
    }

    /// Make the folder this plan's, or see that it is: its plan file, locked, and the digest.
    fn claim(&self) -> Result<(File, String)> {
        let path = self.out.join(PLAN_FILE);
        let file = claim(&path, &self.plan_file()?, "collection", PlanFile::differing)?;
        let digest = atomic::sha256_of_file(&path)?;
        Ok((file, digest))
    }

    fn plan_file(&self) -> Result<PlanFile> {
        let mut maps = BTreeMap::new();
        if let Some(folder) = &self.maps {
            for town in &self.plan.towns {
                let path = folder.join(format!("{town}.xodr"));
                maps.insert(town.clone(), atomic::sha256_of_file(&path)?);
            }
        }
        let recipe = &self.recipe;
        Ok(PlanFile {
            pmp: env!("CARGO_PKG_VERSION").to_string(),
            plan: self.plan.clone(),
            maps,
            encoding: recipe.encoding,
            seconds: recipe.seconds,
            perturb: recipe.burst_chance,
            beams: recipe.rig.lidar.beams,
        })
    }

    /// Whether the log of an episode is there.
    fn is_recorded(&self, episode: &Episode, digest: &str) -> Result<bool> {
        let path = self.path(episode);
        if !path.exists() {
            return Ok(false);
        }
        if head::metadata(&path, EPISODE_RECORD)? == Some(identity(episode, digest)) {
            return Ok(true);
        }
        let hint = "it is no log of this collection; move it away, or choose another --out".into();
        Err(Error::Exists { path, hint })
    }

    /// Remove what a killed process was writing.
    fn clear_unfinished(&self) -> Result<()> {
        for entry in fs::read_dir(&self.out).map_err(Error::io("read", &self.out))? {
            let path = entry.map_err(Error::io("read", &self.out))?.path();
            if file_name(&path).ends_with(&format!(".mcap.{UNFINISHED}")) {
                fs::remove_file(&path).map_err(Error::io("remove", &path))?;
            }
        }
        Ok(())
    }
}

impl PlanFile {
    /// Names of the settings in which two differ.
    fn differing(&self, other: &PlanFile) -> Vec<String> {
        let (a, b) = (&self.plan, &other.plan);
        let settings = [
            ("version of pmp", self.pmp == other.pmp),
            ("seed", a.seed == b.seed),
            ("towns", a.towns == b.towns),
            ("weathers", a.weathers == b.weathers),
            ("illuminations", a.illuminations == b.illuminations),
            ("traffic", a.densities == b.densities),
            ("maps", self.maps == other.maps),
            ("encoding", self.encoding == other.encoding),
            ("seconds", self.seconds == other.seconds),
            ("perturb", self.perturb == other.perturb),
            ("beams", self.beams == other.beams),
        ];
        let differ = settings.into_iter().filter(|(_, is_same)| !is_same);
        differ.map(|(name, _)| name.to_string()).collect()
    }
}

/// What a log of a plan is known by.
fn identity(episode: &Episode, digest: &str) -> BTreeMap<String, String> {
    let words = [("plan", digest.to_string()), ("number", episode.number.to_string())];
    words.map(|(key, value)| (key.to_string(), value)).into()
}

/// The episodes of a plan as a table for people and for programs, tabs between its columns.
pub fn table(episodes: &[Episode]) -> String {
    let mut text = "number\tfile\ttown\tweather\tillumination\ttraffic\n".to_string();
    for episode in episodes {
        let Episode { number, town, sky, traffic, .. } = episode;
        let (weather, illumination) = (sky.weather.name(), sky.illumination.name());
        let (file, traffic) = (episode.file_name(), traffic.name());
        text += &format!("{number}\t{file}\t{town}\t{weather}\t{illumination}\t{traffic}\n");
    }
    text
}
