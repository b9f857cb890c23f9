//! The run directory: a training on disk, whole at every moment.
//!
//! ```text
//! RUN/
//!   config.json                       every key of the configuration
//!   metrics.jsonl                     one line per logged step or validation, no wall-clock times
//!   events.out.tfevents.0.pmp         the same for TensorBoard
//!   curves.svg                        the same as a picture
//!   checkpoints/step-00000300/
//!     weights.safetensors             by parameter name
//!     average.safetensors             the weights' moving average, if the configuration has one
//!     optimizer.safetensors           first.NAME and second.NAME
//!   run.json                          version, step, dataset, program, checkpoints, checksums, the best
//! ```
//!
//! A checkpoint is written beside the others under a temporary name, flushed to the disk and
//! renamed; then `run.json` is replaced to point to it; only then are those deleted that are not
//! to be kept. So whenever the process or the machine dies, `run.json` names weights and moments
//! of one and the same step. Lines of `metrics.jsonl` after that step are cut off when the run is
//! resumed.

use std::{
    collections::{BTreeMap, HashMap},
    fs::{self, File},
    io::Write as _,
    path::{Path, PathBuf},
};

use candle_core::{Device, Tensor};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::{
    atomic::{self, UNFINISHED},
    error::{Error, Result},
    model::{config::TrainConfig, curves, events::EventFile, metrics::ValidationLine},
};

/// Version of the layout.
pub const VERSION: u32 = 2;

const CONFIG: &str = "config.json";
const METRICS: &str = "metrics.jsonl";
const MANIFEST: &str = "run.json";
const CHECKPOINTS: &str = "checkpoints";
const WEIGHTS: &str = "weights.safetensors";
const AVERAGE: &str = "average.safetensors";
const OPTIMIZER: &str = "optimizer.safetensors";
const CURVES: &str = "curves.svg";

/// `run.json`: where the run stands. A reader ignores keys that it does not know.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
pub struct Manifest {
    pub version: u32,
    /// Version of pmp that wrote the checkpoint.
    pub pmp: String,
    /// SHA-256 of the program that wrote it: the code, exactly.
    pub program: String,
    /// Identity of the dataset trained on.
    pub dataset: String,
    /// Optimiser steps taken.
    pub step: u64,
    /// Name of the checkpoint of that step.
    pub checkpoint: String,
    /// SHA-256 of each file of each checkpoint that is kept, hexadecimal.
    pub checkpoints: BTreeMap<String, BTreeMap<String, String>>,
    #[serde(flatten)]
    pub progress: Progress,
}

/// What a training remembers besides weights and moments.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
pub struct Progress {
    /// The validation of the smallest loss.
    pub best: Option<Best>,
    /// Validations since.
    pub validations_since_best: u64,
    /// Whether it ended before its last step, because validations did not improve.
    pub stopped_early: bool,
}

/// The validation of the smallest loss; the checkpoint of its step is kept.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
pub struct Best {
    pub step: u64,
    /// The validation's total loss.
    pub total: f64,
}

/// What a training is at a step, to be saved.
#[derive(Debug)]
pub struct Snapshot {
    pub step: u64,
    pub weights: BTreeMap<String, Tensor>,
    pub average: Option<BTreeMap<String, Tensor>>,
    pub moments: BTreeMap<String, Tensor>,
    pub progress: Progress,
}

/// What a training continues from.
#[derive(Debug)]
pub struct Checkpoint {
    pub step: u64,
    pub weights: HashMap<String, Tensor>,
    pub average: Option<HashMap<String, Tensor>>,
    pub moments: HashMap<String, Tensor>,
    pub progress: Progress,
}

/// A run directory that a training writes to.
#[derive(Debug)]
pub struct RunDir {
    dir: PathBuf,
    config: TrainConfig,
    dataset: String,
    program: String,
    /// Checksums by file by checkpoint.
    kept: BTreeMap<String, BTreeMap<String, String>>,
    metrics: File,
    events: EventFile,
}

impl RunDir {
    /// Start a run in a directory that does not exist or is empty, or continue one.
    ///
    /// With `resume`, a directory without a run is started, one with a run must have the same
    /// configuration (`steps` may be more, `device` another) and the same dataset; without a
    /// checkpoint it starts from step 0.
    ///
    /// # Errors
    ///
    /// [`Error::Run`] if something is there already and `resume` is false, if it is not a run, is
    /// of another version or dataset, or a checksum does not match; [`Error::Config`] naming the
    /// first key that differs; [`Error::Io`].
    pub fn open(
        dir: &Path,
        config: &TrainConfig,
        dataset: &str,
        resume: bool,
        device: &Device,
    ) -> Result<(Self, Option<Checkpoint>)> {
        let there = names(dir)?;
        let ours = |name: &String| *name == format!("{CONFIG}.{UNFINISHED}");
        if there.iter().all(|name| resume && ours(name)) {
            fs::create_dir_all(dir).map_err(Error::io("create", dir))?;
            atomic::write_json(&dir.join(CONFIG), config)?;
        } else if !resume {
            return Err(Error::Run {
                path: dir.into(),
                what: "the run directory is not empty".into(),
                hint: Some("`--resume` continues a run; a new one needs another `--out`".into()),
            });
        }
        let Some(mut saved) = saved_config(dir)? else {
            return Err(Error::Run {
                path: dir.join(CONFIG),
                what: "not a training run, there is no configuration".into(),
                hint: Some("give the directory that an earlier `--out` named".into()),
            });
        };
        let manifest = manifest(dir)?;
        if let Some(manifest) = manifest.as_ref().filter(|m| m.dataset != dataset) {
            return Err(Error::Run {
                path: dir.into(),
                what: format!("the run was trained on {}, not on {dataset}", manifest.dataset),
                hint: Some("give the dataset it was started with, or another `--out`".into()),
            });
        }
        let changes = saved.steps < config.steps || saved.device != config.device;
        saved.steps = saved.steps.max(config.steps);
        saved.device = config.device;
        same(&as_read(dir, &saved)?, &as_read(dir, config)?, "")?;
        if changes {
            atomic::write_json(&dir.join(CONFIG), &saved)?;
        }
        let kept = manifest.as_ref().map(|m| m.checkpoints.clone()).unwrap_or_default();
        let checkpoint = manifest.map(|m| checkpoint(dir, &m, device)).transpose()?;
        let (metrics, lines) = cut(&dir.join(METRICS), checkpoint.as_ref().map_or(0, |c| c.step))?;
        let events = EventFile::create(dir, &lines)?;
        let (dataset, program) = (dataset.into(), program_sha256()?);
        let run = Self { dir: dir.into(), config: saved, dataset, program, kept, metrics, events };
        Ok((run, checkpoint))
    }

    /// The configuration as it stands in the directory: what is trained with, so that the digits
    /// of a number are those that a resumed run reads back.
    pub fn config(&self) -> &TrainConfig {
        &self.config
    }

    /// Append a line to `metrics.jsonl`; it must have the field `step`.
    ///
    /// # Errors
    ///
    /// [`Error::Io`].
    pub fn append(&mut self, line: &impl Serialize) -> Result<()> {
        let path = self.dir.join(METRICS);
        let mut text = serde_json::to_vec(line).map_err(Error::json(&path))?;
        self.events.append(&text)?;
        text.push(b'\n');
        self.metrics.write_all(&text).map_err(Error::io("write", &path))
    }

    /// Make a checkpoint the state of the run.
    ///
    /// # Errors
    ///
    /// [`Error::Io`]; the run then stands at its last checkpoint.
    pub fn commit(&mut self, snapshot: &Snapshot) -> Result<()> {
        self.metrics.sync_all().map_err(Error::io("flush", self.dir.join(METRICS)))?;
        self.draw_curves()?;
        let parent = self.dir.join(CHECKPOINTS);
        let name = checkpoint_name(snapshot.step);
        let (making, made) = (parent.join(format!("{name}.{UNFINISHED}")), parent.join(&name));
        for leftover in [&making, &made] {
            remove(leftover)?;
        }
        fs::create_dir_all(&making).map_err(Error::io("create", &making))?;
        let mut sha256 = BTreeMap::new();
        let average = snapshot.average.iter().map(|average| (AVERAGE, average));
        let files = [(WEIGHTS, &snapshot.weights), (OPTIMIZER, &snapshot.moments)];
        for (file, tensors) in files.into_iter().chain(average) {
            let bytes = safetensors::serialize(tensors, None).map_err(candle_core::Error::from)?;
            let committed = atomic::write(&making.join(file), &bytes)?;
            sha256.insert(file.into(), committed.sha256);
        }
        atomic::sync_folder(&making)?;
        fs::rename(&making, &made).map_err(Error::io("rename", &making))?;
        atomic::sync_folder(&parent)?;

        self.kept.insert(name.clone(), sha256);
        let best = snapshot.progress.best.as_ref().map(|best| checkpoint_name(best.step));
        let last: Vec<String> = self.kept.keys().rev().take(self.config.keep).cloned().collect();
        self.kept.retain(|name, _| last.contains(name) || best.as_ref() == Some(name));
        let manifest = Manifest {
            version: VERSION,
            pmp: env!("CARGO_PKG_VERSION").into(),
            program: self.program.clone(),
            dataset: self.dataset.clone(),
            step: snapshot.step,
            checkpoint: name,
            checkpoints: self.kept.clone(),
            progress: snapshot.progress.clone(),
        };
        atomic::write_json(&self.dir.join(MANIFEST), &manifest)?;
        for old in names(&parent)?.into_iter().filter(|old| !self.kept.contains_key(old)) {
            remove(&parent.join(old))?;
        }
        Ok(())
    }

    fn draw_curves(&self) -> Result<()> {
        let path = self.dir.join(METRICS);
        let text = fs::read_to_string(&path).map_err(Error::io("read", &path))?;
        let lines = text.lines().map(serde_json::from_str).collect::<Result<Vec<Value>, _>>();
        let svg = curves::svg(&lines.map_err(Error::json(&path))?);
        atomic::write(&self.dir.join(CURVES), svg.as_bytes()).map(|_| ())
    }
}

/// Zeros in front, so that names sort as steps do.
fn checkpoint_name(step: u64) -> String {
    format!("step-{step:08}")
}

/// SHA-256 of the program that runs, hexadecimal.
fn program_sha256() -> Result<String> {
    let path = std::env::current_exe().map_err(Error::io("find", "the program itself"))?;
    Ok(atomic::sha256(&fs::read(&path).map_err(Error::io("read", &path))?))
}

/// The configuration of the run in a directory; `None` if there is none.
///
/// # Errors
///
/// [`Error::Json`] if it cannot be understood, [`Error::Io`].
pub fn saved_config(dir: &Path) -> Result<Option<TrainConfig>> {
    atomic::read_json_if_exists(&dir.join(CONFIG))
}

/// What a run has learned.
#[derive(Debug)]
pub struct Trained {
    pub config: TrainConfig,
    pub weights: HashMap<String, Tensor>,
    /// Of the file of the weights.
    pub sha256: String,
}

/// The configuration and the weights of a run: of its last checkpoint if `path` is the run
/// directory, or of the one that `path` is (`RUN/checkpoints/step-00000300`). Where the
/// configuration has a moving average of the weights, that is what a run is.
///
/// # Errors
///
/// [`Error::Run`] if there is no checkpoint, it is of another version, or a checksum does not
/// match; [`Error::Json`], [`Error::Io`].
pub fn trained(path: &Path, device: &Device) -> Result<Trained> {
    let none = || Error::Run {
        path: path.into(),
        what: "no trained run, there is no checkpoint".into(),
        hint: Some("`pmp-train --out` makes one; `--resume` continues one cut short".into()),
    };
    let one_of_many = path.parent().filter(|parent| parent.ends_with(CHECKPOINTS));
    let dir = one_of_many.and_then(Path::parent).unwrap_or(path);
    let (Some(config), Some(manifest)) = (saved_config(dir)?, manifest(dir)?) else {
        return Err(none());
    };
    let name = match one_of_many.and_then(|_| path.file_name()) {
        Some(name) => name.to_string_lossy().into_owned(),
        None => manifest.checkpoint.clone(),
    };
    let sha256 = manifest.checkpoints.get(&name).ok_or_else(none)?;
    let file = if sha256.contains_key(AVERAGE) { AVERAGE } else { WEIGHTS };
    Ok(Trained {
        config,
        weights: tensors(&dir.join(CHECKPOINTS).join(name), sha256, file, device)?,
        sha256: sha256.get(file).cloned().unwrap_or_default(),
    })
}

/// The last validation of the run in a directory, as `metrics.jsonl` has it; `None` if there was
/// none.
///
/// # Errors
///
/// [`Error::Json`] for a line that is none, [`Error::Io`].
pub fn last_validation(dir: &Path) -> Result<Option<ValidationLine>> {
    let path = dir.join(METRICS);
    let text = fs::read_to_string(&path).map_err(Error::io("read", &path))?;
    let mut last = None;
    for line in text.lines() {
        let value: Value = serde_json::from_str(line).map_err(Error::json(&path))?;
        if value["split"] == "val" {
            last = Some(serde_json::from_value(value).map_err(Error::json(&path))?);
        }
    }
    Ok(last)
}

/// Where the run in a directory stands; `None` before its first checkpoint.
///
/// # Errors
///
/// [`Error::Run`] if it is of another version, [`Error::Json`], [`Error::Io`].
pub fn manifest(dir: &Path) -> Result<Option<Manifest>> {
    let manifest: Option<Manifest> = atomic::read_json_if_exists(&dir.join(MANIFEST))?;
    match manifest {
        Some(Manifest { version, pmp, .. }) if version != VERSION => Err(Error::Run {
            path: dir.join(MANIFEST),
            what: format!("run layout {version}, this pmp reads {VERSION}"),
            hint: Some(format!("it was written by pmp {pmp}")),
        }),
        manifest => Ok(manifest),
    }
}

fn checkpoint(dir: &Path, manifest: &Manifest, device: &Device) -> Result<Checkpoint> {
    let folder = dir.join(CHECKPOINTS).join(&manifest.checkpoint);
    let nothing = BTreeMap::new();
    let sha256 = manifest.checkpoints.get(&manifest.checkpoint).unwrap_or(&nothing);
    let read = |file: &str| tensors(&folder, sha256, file, device);
    Ok(Checkpoint {
        step: manifest.step,
        weights: read(WEIGHTS)?,
        average: sha256.contains_key(AVERAGE).then(|| read(AVERAGE)).transpose()?,
        moments: read(OPTIMIZER)?,
        progress: manifest.progress.clone(),
    })
}

fn tensors(
    folder: &Path,
    sha256: &BTreeMap<String, String>,
    file: &str,
    device: &Device,
) -> Result<HashMap<String, Tensor>> {
    let path = folder.join(file);
    let bytes = fs::read(&path).map_err(Error::io("read", &path))?;
    if sha256.get(file) != Some(&atomic::sha256(&bytes)) {
        return Err(Error::Run {
            path,
            what: format!("damaged: its checksum is not the one in {MANIFEST}"),
            hint: Some("copy the run directory again, or train anew".into()),
        });
    }
    Ok(candle_core::safetensors::load_buffer(&bytes, device)?)
}

/// The first key in which two configurations differ is an error.
fn same(saved: &Value, wanted: &Value, key: &str) -> Result<()> {
    if let (Value::Object(saved), Value::Object(wanted)) = (saved, wanted) {
        let dot = if key.is_empty() { "" } else { "." };
        return saved.iter().try_for_each(|(name, value)| {
            same(value, wanted.get(name).unwrap_or(&Value::Null), &format!("{key}{dot}{name}"))
        });
    }
    if saved == wanted {
        return Ok(());
    }
    Err(Error::Config {
        key: key.into(),
        what: format!("the run was started with {saved}, not {wanted}"),
        hint: Some(
            "leave it as it was (`steps` may be raised, `device` changed), or start a new run"
                .into(),
        ),
    })
}

/// A configuration as it comes back from a file.
fn as_read(dir: &Path, config: &TrainConfig) -> Result<Value> {
    let path = dir.join(CONFIG);
    let text = serde_json::to_vec(config).map_err(Error::json(&path))?;
    serde_json::from_slice(&text).map_err(Error::json(&path))
}

/// Open `metrics.jsonl` for appending, without what comes after a step; and what is left of it.
fn cut(path: &Path, step: u64) -> Result<(File, Vec<u8>)> {
    #[derive(Deserialize)]
    struct At {
        step: u64,
    }
    let mut text = match fs::read(path) {
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => vec![],
        text => text.map_err(Error::io("read", path))?,
    };
    let kept = |line: &&[u8]| {
        line.ends_with(b"\n") && serde_json::from_slice(line).is_ok_and(|at: At| at.step <= step)
    };
    let len =
        text.split_inclusive(|b| *b == b'\n').take_while(kept).map(<[u8]>::len).sum::<usize>();
    let file = File::options().create(true).append(true).open(path);
    let file = file.map_err(Error::io("open", path))?;
    file.set_len(len as u64).map_err(Error::io("truncate", path))?;
    text.truncate(len);
    Ok((file, text))
}

fn names(dir: &Path) -> Result<Vec<String>> {
    let entries = match fs::read_dir(dir) {
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(vec![]),
        entries => entries.map_err(Error::io("list", dir))?,
    };
    let name = |entry: std::io::Result<fs::DirEntry>| {
        Ok(entry.map_err(Error::io("list", dir))?.file_name().to_string_lossy().into_owned())
    };
    entries.map(name).collect()
}

fn remove(dir: &Path) -> Result<()> {
    match fs::remove_dir_all(dir) {
        Err(e) if e.kind() != std::io::ErrorKind::NotFound => Err(Error::io("delete", dir)(e)),
        _ => Ok(()),
    }
}
