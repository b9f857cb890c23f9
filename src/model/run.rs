//! The run directory: a training on disk, whole at every moment.
//!
//! ```text
//! RUN/
//!   config.json                       every key of the configuration
//!   metrics.jsonl                     one line per logged step or validation, no wall-clock times
//!   checkpoints/step-00000300/
//!     weights.safetensors             by parameter name
//!     optimizer.safetensors           first.NAME and second.NAME
//!   run.json                          version, step, dataset, which checkpoint, its checksums
//! ```
//!
//! A checkpoint is written beside the last one under a temporary name, flushed to the disk and
//! renamed; then `run.json` is replaced to point to it; only then is the last one deleted. So
//! whenever the process or the machine dies, `run.json` names weights and moments of one and the
//! same step. Lines of `metrics.jsonl` after that step are cut off when the run is resumed.

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
    model::config::TrainConfig,
};

/// Version of the layout.
pub const VERSION: u32 = 1;

const CONFIG: &str = "config.json";
const METRICS: &str = "metrics.jsonl";
const MANIFEST: &str = "run.json";
const CHECKPOINTS: &str = "checkpoints";
const WEIGHTS: &str = "weights.safetensors";
const OPTIMIZER: &str = "optimizer.safetensors";

/// `run.json`: where the run stands. A reader ignores keys that it does not know.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
pub struct Manifest {
    pub version: u32,
    /// Version of pmp that wrote the checkpoint.
    pub pmp: String,
    /// Identity of the dataset trained on.
    pub dataset: String,
    /// Optimiser steps taken.
    pub step: u64,
    /// Directory of the checkpoint, relative to the run's.
    pub checkpoint: String,
    /// SHA-256 of each file in it, hexadecimal.
    pub sha256: BTreeMap<String, String>,
}

/// What a training continues from.
#[derive(Debug)]
pub struct Checkpoint {
    pub step: u64,
    pub weights: HashMap<String, Tensor>,
    pub moments: HashMap<String, Tensor>,
}

/// A run directory that a training writes to.
#[derive(Debug)]
pub struct RunDir {
    dir: PathBuf,
    config: TrainConfig,
    dataset: String,
    metrics: File,
}

impl RunDir {
    /// Start a run in a directory that does not exist or is empty, or continue one.
    ///
    /// With `resume`, a directory without a run is started, one with a run must have the same
    /// configuration (`steps` may be more) and the same dataset; without a checkpoint it starts
    /// from step 0.
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
        let more_steps = saved.steps < config.steps;
        if more_steps {
            saved.steps = config.steps;
        }
        same(&as_read(dir, &saved)?, &as_read(dir, config)?, "")?;
        if more_steps {
            atomic::write_json(&dir.join(CONFIG), &saved)?;
        }
        let checkpoint = manifest.map(|m| checkpoint(dir, &m, device)).transpose()?;
        let metrics = cut(&dir.join(METRICS), checkpoint.as_ref().map_or(0, |c| c.step))?;
        Ok((Self { dir: dir.into(), config: saved, dataset: dataset.into(), metrics }, checkpoint))
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
        text.push(b'\n');
        self.metrics.write_all(&text).map_err(Error::io("write", &path))
    }

    /// Make a checkpoint the state of the run.
    ///
    /// # Errors
    ///
    /// [`Error::Io`]; the run then stands at its last checkpoint.
    pub fn commit(
        &mut self,
        step: u64,
        weights: &BTreeMap<String, Tensor>,
        moments: &BTreeMap<String, Tensor>,
    ) -> Result<()> {
        self.metrics.sync_all().map_err(Error::io("flush", self.dir.join(METRICS)))?;
        let parent = self.dir.join(CHECKPOINTS);
        let name = format!("step-{step:08}");
        let (making, made) = (parent.join(format!("{name}.{UNFINISHED}")), parent.join(&name));
        for leftover in [&making, &made] {
            remove(leftover)?;
        }
        fs::create_dir_all(&making).map_err(Error::io("create", &making))?;
        let mut sha256 = BTreeMap::new();
        for (file, tensors) in [(WEIGHTS, weights), (OPTIMIZER, moments)] {
            let bytes = safetensors::serialize(tensors, None).map_err(candle_core::Error::from)?;
            let committed = atomic::write(&making.join(file), &bytes)?;
            sha256.insert(file.into(), committed.sha256);
        }
        atomic::sync_folder(&making)?;
        fs::rename(&making, &made).map_err(Error::io("rename", &making))?;
        atomic::sync_folder(&parent)?;
        let manifest = Manifest {
            version: VERSION,
            pmp: env!("CARGO_PKG_VERSION").into(),
            dataset: self.dataset.clone(),
            step,
            checkpoint: format!("{CHECKPOINTS}/{name}"),
            sha256,
        };
        atomic::write_json(&self.dir.join(MANIFEST), &manifest)?;
        for old in names(&parent)?.into_iter().filter(|old| *old != name) {
            remove(&parent.join(old))?;
        }
        Ok(())
    }
}

/// The configuration of the run in a directory; `None` if there is none.
///
/// # Errors
///
/// [`Error::Json`] if it cannot be understood, [`Error::Io`].
pub fn saved_config(dir: &Path) -> Result<Option<TrainConfig>> {
    atomic::read_json_if_exists(&dir.join(CONFIG))
}

/// The configuration and the weights of the run in a directory.
///
/// # Errors
///
/// [`Error::Run`] if there is no checkpoint, it is of another version, or a checksum does not
/// match; [`Error::Json`], [`Error::Io`].
pub fn trained(dir: &Path, device: &Device) -> Result<(TrainConfig, HashMap<String, Tensor>)> {
    let (Some(config), Some(manifest)) = (saved_config(dir)?, manifest(dir)?) else {
        return Err(Error::Run {
            path: dir.into(),
            what: "no trained run, there is no checkpoint".into(),
            hint: Some("`pmp-train --out` makes one; `--resume` continues one cut short".into()),
        });
    };
    Ok((config, tensors(dir, &manifest, WEIGHTS, device)?))
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
    let weights = tensors(dir, manifest, WEIGHTS, device)?;
    let moments = tensors(dir, manifest, OPTIMIZER, device)?;
    Ok(Checkpoint { step: manifest.step, weights, moments })
}

fn tensors(
    dir: &Path,
    manifest: &Manifest,
    file: &str,
    device: &Device,
) -> Result<HashMap<String, Tensor>> {
    let path = dir.join(&manifest.checkpoint).join(file);
    let bytes = fs::read(&path).map_err(Error::io("read", &path))?;
    if manifest.sha256.get(file) != Some(&atomic::sha256(&bytes)) {
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
        hint: Some("leave it as it was (`steps` may be raised), or start a new run".into()),
    })
}

/// A configuration as it comes back from a file.
fn as_read(dir: &Path, config: &TrainConfig) -> Result<Value> {
    let path = dir.join(CONFIG);
    let text = serde_json::to_vec(config).map_err(Error::json(&path))?;
    serde_json::from_slice(&text).map_err(Error::json(&path))
}

/// Open `metrics.jsonl` for appending, without what comes after a step.
fn cut(path: &Path, step: u64) -> Result<File> {
    #[derive(Deserialize)]
    struct At {
        step: u64,
    }
    let text = match fs::read(path) {
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
    Ok(file)
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
