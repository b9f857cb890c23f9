//! What a training run is, whole: defaults, presets, a TOML file, ranges.
//!
//! A value is settled in this order: the preset of the model, the file, the command line. What
//! comes out is saved with every key in the run directory, so a run can be read back after a
//! preset has changed. `schemas/train.toml` lists and explains every key.

use std::path::PathBuf;

use candle_core::{DType, Device};
use serde::{Deserialize, Serialize};

use crate::{
    dataset::loader::SamplingConfig,
    error::{Error, Result},
    model::{
        device::Place,
        net_config::{Model, NetConfig, Preset},
    },
};

/// A training run: on the CPU the same value and the same dataset give the same weights.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct TrainConfig {
    pub model: Model,
    pub preset: Preset,
    /// Optimiser steps, not epochs: comparable across dataset sizes. The direct action drives
    /// after some 600, the planned motion needs about 3000. Raised when a run is resumed, they
    /// stretch the cosine from there on: more training, but not the run that had them all along.
    pub steps: u64,
    /// Frames per step.
    pub batch_size: usize,
    /// Parts that a step's frames are worked through in, one after the other: less memory, the
    /// same gradient, except that batch norm sees a part at a time.
    pub micro_batches: usize,
    pub optimizer: Optimizer,
    /// Peak learning rate, reached after `warmup`.
    pub lr: f64,
    pub schedule: Schedule,
    /// Learning rate that the cosine falls to at the last step.
    pub lr_end: f64,
    /// Steps between two falls of the `step` schedule, and the factor of each.
    pub lr_step: u64,
    pub lr_factor: f64,
    /// Steps of linear warm-up.
    pub warmup: u64,
    /// AdamW's decoupled weight decay, on every parameter.
    pub weight_decay: f64,
    /// Gradients are scaled down to this global L2 norm; 0 leaves them as they are.
    pub clip_norm: f64,
    /// Decay of the moving average of the weights that is judged and drives; 0 for the weights
    /// themselves.
    pub ema: f64,
    pub loss: LossConfig,
    pub sampling: SamplingConfig,
    /// Seeds the weights, the order of frames, what is dropped and what is disturbed; nothing
    /// else is random.
    pub seed: u64,
    /// Steps between two lines of training loss.
    pub log_every: u64,
    /// Steps between two validations.
    pub eval_every: u64,
    /// Batches per validation, at most: fewer if there are fewer.
    pub eval_batches: u64,
    /// Validations without a new best loss after which the training ends; 0 for never.
    pub patience: u64,
    /// Steps between two checkpoints.
    pub save_every: u64,
    /// Checkpoints that are kept, the last ones; that of the best validation is kept besides.
    pub keep: usize,
    /// A file of ResNet34 weights to start from, `.safetensors` or `.pth`; empty for none.
    pub pretrained: PathBuf,
    /// Where to compute; a run may be continued elsewhere.
    #[serde(default)]
    pub device: Place,
    #[serde(default)]
    pub precision: Precision,
    pub net: NetConfig,
}

/// What the encoders of the pictures, nearly all of the work, compute with while learning.
/// Weights, moments, everything behind the encoders and validations are always f32.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Precision {
    #[default]
    F32,
    /// Half the memory, 8 bits of precision: on a GPU.
    Bf16,
}

impl Precision {
    /// The type of the encoders' activations while learning; `None` for that of their pictures.
    ///
    /// # Errors
    ///
    /// [`Error::Config`] for a type that is slower than f32 on the device.
    pub fn on(self, device: &Device) -> Result<Option<DType>> {
        match self {
            Precision::F32 => Ok(None),
            Precision::Bf16 if !device.is_cpu() => Ok(Some(DType::BF16)),
            Precision::Bf16 => Err(Error::Config {
                key: "precision".into(),
                what: "bf16 is for GPUs, and this is the CPU".into(),
                hint: Some("`precision = \"f32\"`, or a GPU by `--device cuda`".into()),
            }),
        }
    }
}

/// What is minimised.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct LossConfig {
    /// Weights of steer, throttle, brake in the action term; only their ratios matter. Equal,
    /// because less on the brake (CIL's 0.05) brakes too little once there is traffic.
    pub action_weights: [f64; 3],
    /// Weight of the motion term, NLL per number, beside the action term.
    pub motion_weight: f64,
    pub assign: Assign,
    /// Weight of the entropy of the modes' weights, which is raised: against one mode for all.
    pub entropy_weight: f64,
    /// Weight of the speed term, mean absolute error in units of 12 m/s, where the network has a
    /// speed head.
    pub speed_weight: f64,
}

/// Which modes a motion teaches.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Assign {
    /// All, by how likely each made it: the likelihood of the mixture.
    Soft,
    /// The one whose means are nearest, and the weights to choose it (as MTR does).
    Nearest,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Optimizer {
    /// Kingma & Ba, 2015; weight decay is not applied.
    Adam,
    /// Loshchilov & Hutter, 2019.
    Adamw,
}

/// The learning rate after the warm-up.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Schedule {
    Constant,
    /// Half a cosine from `lr` to `lr_end`.
    Cosine,
    /// Times `lr_factor` every `lr_step` steps.
    Step,
}

impl Default for TrainConfig {
    fn default() -> Self {
        Self::preset(Model::default(), Preset::default())
    }
}

impl TrainConfig {
    /// The recipe of a model at a preset.
    pub fn preset(model: Model, preset: Preset) -> Self {
        let small = Self {
            model,
            preset,
            steps: 3000,
            batch_size: 32,
            micro_batches: 1,
            optimizer: Optimizer::Adamw,
            lr: 1e-3,
            schedule: Schedule::Cosine,
            lr_end: 0.0,
            lr_step: 100_000,
            lr_factor: 0.5,
            warmup: 50,
            weight_decay: 0.01,
            clip_norm: 5.0,
            ema: 0.0,
            loss: LossConfig {
                action_weights: [1.0 / 3.0; 3],
                motion_weight: 0.1,
                assign: Assign::Soft,
                entropy_weight: 0.0,
                speed_weight: 0.05,
            },
            sampling: SamplingConfig::default(),
            seed: 0,
            log_every: 50,
            eval_every: 500,
            eval_batches: 32,
            patience: 0,
            save_every: 250,
            keep: 1,
            pretrained: PathBuf::new(),
            device: Place::Auto,
            precision: Precision::F32,
            net: NetConfig::preset(model, preset),
        };
        match preset {
            Preset::Nano | Preset::Tiny => small,
            Preset::Small => Self { steps: 16_000, ..small },
            // Paper §IV.A: Adam, 1e-4, 90 frames, 234 thousand steps, and no more is said.
            Preset::Paper => Self {
                steps: 234_000,
                batch_size: 90,
                micro_batches: 9,
                optimizer: Optimizer::Adam,
                lr: 1e-4,
                schedule: Schedule::Constant,
                warmup: 0,
                weight_decay: 0.0,
                clip_norm: 0.0,
                eval_every: 5000,
                save_every: 1000,
                ..small
            },
        }
    }

    /// A TOML file over a preset: model and preset as given, else as the file names them, else the
    /// defaults. The file says only what differs.
    ///
    /// # Errors
    ///
    /// [`Error::Config`] with the key, for a key that does not exist or a value out of range.
    pub fn from_toml(text: &str, model: Option<Model>, preset: Option<Preset>) -> Result<Self> {
        Self::from_table(toml::from_str(text).map_err(wrong)?, model, preset)
    }

    /// The same of a table.
    ///
    /// # Errors
    ///
    /// Those of [`from_toml`](Self::from_toml).
    pub fn from_table(
        mut file: toml::Table,
        model: Option<Model>,
        preset: Option<Preset>,
    ) -> Result<Self> {
        let its_model = file.remove("model").map(|m| m.try_into().map_err(wrong)).transpose()?;
        let its_preset = file.remove("preset").map(|p| p.try_into().map_err(wrong)).transpose()?;
        let (model, preset) = (model.or(its_model), preset.or(its_preset));
        let base = Self::preset(model.unwrap_or_default(), preset.unwrap_or_default());
        let mut whole = toml::Table::try_from(&base).map_err(|e| Error::Config {
            key: "preset".into(),
            what: e.to_string(),
            hint: None,
        })?;
        overlay(&mut whole, file, "")?;
        let config: Self = whole.try_into().map_err(wrong)?;
        config.validate()?;
        Ok(config)
    }

    /// Learning rate at a step, from 0: linear up to `lr`, then by the schedule.
    pub fn lr_at(&self, step: u64) -> f64 {
        if step < self.warmup {
            return self.lr * (step + 1) as f64 / self.warmup as f64;
        }
        let since = step - self.warmup;
        match self.schedule {
            Schedule::Constant => self.lr,
            Schedule::Step => self.lr * self.lr_factor.powi((since / self.lr_step) as i32),
            Schedule::Cosine => {
                let span = self.steps.saturating_sub(self.warmup).max(1) as f64;
                let done = (since as f64 / span).min(1.0);
                let cosine = (std::f64::consts::PI * done).cos();
                self.lr_end + (self.lr - self.lr_end) * (1.0 + cosine) / 2.0
            }
        }
    }

    /// Check every range.
    ///
    /// # Errors
    ///
    /// [`Error::Config`] for the first key whose value makes no sense.
    pub fn validate(&self) -> Result<()> {
        let need = |good: bool, key: &str, what: &str| {
            let error = || Error::Config { key: key.into(), what: what.into(), hint: None };
            good.then_some(()).ok_or_else(error)
        };
        let at_least_0 = |x: f64| x.is_finite() && x >= 0.0;
        let loss = &self.loss;
        let weights = &loss.action_weights;
        need(self.steps > 0, "steps", "must be at least 1")?;
        need(self.batch_size > 0, "batch_size", "must be at least 1")?;
        let parts = 1..=self.batch_size;
        need(parts.contains(&self.micro_batches), "micro_batches", "must be in 1 ... batch_size")?;
        need(self.lr.is_finite() && self.lr > 0.0, "lr", "must be above 0")?;
        need((0.0..=self.lr).contains(&self.lr_end), "lr_end", "must be in 0 ... lr")?;
        need(self.lr_step > 0, "lr_step", "must be at least 1")?;
        let falls = self.lr_factor > 0.0 && self.lr_factor <= 1.0;
        need(falls, "lr_factor", "must be above 0 and at most 1")?;
        need((0.0..1.0).contains(&self.weight_decay), "weight_decay", "must be in 0 ... 1")?;
        need(at_least_0(self.clip_norm), "clip_norm", "must be 0 or more")?;
        need((0.0..1.0).contains(&self.ema), "ema", "must be 0 or more and below 1")?;
        need(
            weights.iter().all(|w| at_least_0(*w)) && weights.iter().sum::<f64>() > 0.0,
            "loss.action_weights",
            "must be 0 or more, and not all 0",
        )?;
        for (key, weight) in [
            ("loss.motion_weight", loss.motion_weight),
            ("loss.entropy_weight", loss.entropy_weight),
            ("loss.speed_weight", loss.speed_weight),
        ] {
            need(at_least_0(weight), key, "must be 0 or more")?;
        }
        let (balance, augment) = (self.sampling.balance, &self.sampling.augment);
        need((0.0..=1.0).contains(&balance), "sampling.balance", "must be in 0 ... 1")?;
        for (key, share) in [
            ("sampling.augment.brightness", augment.brightness),
            ("sampling.augment.contrast", augment.contrast),
            ("sampling.augment.colour", augment.colour),
            ("sampling.augment.point_dropout", augment.point_dropout),
            ("sampling.augment.camera_dropout", augment.camera_dropout),
            ("sampling.augment.ralidar_dropout", augment.ralidar_dropout),
        ] {
            need((0.0..1.0).contains(&share), key, "must be 0 or more and below 1")?;
        }
        for (key, every) in [
            ("log_every", self.log_every),
            ("eval_every", self.eval_every),
            ("save_every", self.save_every),
            ("keep", self.keep as u64),
        ] {
            need(every > 0, key, "must be at least 1")?;
        }
        self.net.validate()
    }
}

fn wrong(e: toml::de::Error) -> Error {
    let what = e.to_string().trim_end().into();
    Error::Config { key: "configuration".into(), what, hint: None }
}

/// Write the values of `over` into `base`, table by table; `at` is where both lie.
fn overlay(base: &mut toml::Table, over: toml::Table, at: &str) -> Result<()> {
    for (key, value) in over {
        let Some(old) = base.get_mut(&key) else {
            return Err(unknown(&key, at, base));
        };
        match (old, value) {
            (toml::Value::Table(base), toml::Value::Table(over)) => {
                overlay(base, over, &format!("{at}{key}."))?;
            }
            (old, value) => *old = value,
        }
    }
    Ok(())
}

fn unknown(key: &str, at: &str, base: &toml::Table) -> Error {
    let likeness = |name: &&String| (strsim::jaro_winkler(key, name) * 1e6) as u64;
    let nearest = base.keys().max_by_key(likeness).filter(|name| likeness(name) > 700_000);
    let names: Vec<&str> = base.keys().map(String::as_str).collect();
    Error::Config {
        key: format!("{at}{key}"),
        what: "there is no such key".into(),
        hint: Some(match nearest {
            Some(name) => format!("`{at}{name}` is the nearest; all are in schemas/train.toml"),
            None => format!("there are {}", names.join(", ")),
        }),
    }
}
