//! What a training run is, whole: defaults, presets, a TOML file, ranges.
//!
//! A value is settled in this order: defaults, the preset, the file, the command line. What comes
//! out is saved with every key in the run directory, so a run can be read back after a preset has
//! changed.

use clap::ValueEnum;
use serde::{Deserialize, Serialize};

use crate::{
    dataset::sample::InputSize,
    error::{Error, Result},
};

/// Which network.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Model {
    /// Camera, ralidar, route and velocity to an action and a motion mixture.
    #[default]
    Pmp,
}

/// Sizes to start from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Preset {
    /// Route and velocity only, 0.25 M parameters: a minute on two cores.
    Nano,
    /// With camera and ralidar of 32 x 80, 0.55 M parameters: minutes on two cores.
    #[default]
    Tiny,
}

/// A training run: the same value and the same dataset give the same weights.
///
/// An unknown key is an error, not a silent typo. The defaults are the `tiny` recipe, which is
/// the smallest that drove with pictures.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct TrainConfig {
    pub model: Model,
    pub preset: Preset,
    /// Optimiser steps, not epochs: comparable across dataset sizes. The direct action drives
    /// after some 600, the planned motion needs about 3000. Raised when a run is resumed, they
    /// stretch the cosine from there on: more training, but not the run that had them all along.
    pub steps: u64,
    /// Frames per step.
    pub batch_size: usize,
    /// Peak learning rate, reached after `warmup`.
    pub lr: f64,
    /// Learning rate that the cosine falls to at the last step.
    pub lr_end: f64,
    /// Steps of linear warm-up.
    pub warmup: u64,
    /// Decoupled weight decay of AdamW, on every parameter; 0 is the paper's Adam.
    pub weight_decay: f64,
    /// Gradients are scaled down to this global L2 norm.
    pub clip_norm: f64,
    /// Weight of the motion term, NLL per number, beside the action term.
    pub motion_weight: f64,
    /// Weights of steer, throttle, brake in the action term; only their ratios matter. Equal,
    /// because less on the brake (CIL's 0.05) brakes too little once there is traffic.
    pub action_weights: [f64; 3],
    /// Seeds the weights and the order of frames; nothing else is random.
    pub seed: u64,
    /// Steps between two lines of training loss.
    pub log_every: u64,
    /// Steps between two validations.
    pub eval_every: u64,
    /// Batches per validation, at most: fewer if there are fewer.
    pub eval_batches: u64,
    /// Steps between two checkpoints.
    pub save_every: u64,
    pub net: NetConfig,
}

/// Sizes of the network: everything needed to rebuild it for a checkpoint.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct NetConfig {
    /// Whether there is a camera branch.
    pub camera: bool,
    /// Whether there is a ralidar branch.
    pub ralidar: bool,
    /// Of both pictures, pixels.
    pub height: usize,
    pub width: usize,
    /// Channels after each 3 x 3 convolution of stride 2.
    pub channels: Vec<usize>,
    /// Width of what each branch says (paper: 2048).
    pub feature: usize,
    pub route_hidden: usize,
    pub velocity_hidden: usize,
    pub attention_hidden: usize,
    pub action_hidden: usize,
    pub motion_hidden: usize,
    /// Modes of the motion mixture. With the route given, what is left to choose is mostly
    /// whether to go or to brake.
    pub modes: usize,
}

impl Default for TrainConfig {
    fn default() -> Self {
        Self::preset(Preset::default())
    }
}

impl Default for NetConfig {
    fn default() -> Self {
        Self::tiny()
    }
}

impl NetConfig {
    /// No pictures; the blind yardstick that every other network has to beat.
    pub fn nano() -> Self {
        Self { camera: false, ralidar: false, ..Self::tiny() }
    }

    /// Both pictures at 32 x 80, four convolutions, no batch norm.
    pub fn tiny() -> Self {
        Self {
            camera: true,
            ralidar: true,
            height: 32,
            width: 80,
            channels: vec![8, 16, 32, 64],
            feature: 128,
            route_hidden: 128,
            velocity_hidden: 64,
            attention_hidden: 64,
            action_hidden: 128,
            motion_hidden: 256,
            modes: 3,
        }
    }

    /// Size of the pictures to prepare; `None` for a network without pictures.
    pub fn input_size(&self) -> Option<InputSize> {
        let &Self { height, width, .. } = self;
        (self.camera || self.ralidar).then_some(InputSize { height, width })
    }
}

impl TrainConfig {
    /// The recipe of a preset.
    pub fn preset(preset: Preset) -> Self {
        let net = match preset {
            Preset::Nano => NetConfig::nano(),
            Preset::Tiny => NetConfig::tiny(),
        };
        Self {
            model: Model::Pmp,
            preset,
            steps: 3000,
            batch_size: 32,
            lr: 1e-3,
            lr_end: 0.0,
            warmup: 50,
            weight_decay: 0.01,
            clip_norm: 5.0,
            motion_weight: 0.1,
            action_weights: [1.0 / 3.0; 3],
            seed: 0,
            log_every: 50,
            eval_every: 500,
            eval_batches: 32,
            save_every: 250,
            net,
        }
    }

    /// A TOML file over a preset: `preset` if given, else the one that the file names, else the
    /// default. The file says only what differs.
    ///
    /// # Errors
    ///
    /// [`Error::Config`] with the key, for a key that does not exist or a value out of range.
    pub fn from_toml(text: &str, preset: Option<Preset>) -> Result<Self> {
        let wrong = |e: toml::de::Error| Error::Config {
            key: "configuration".into(),
            what: e.to_string().trim_end().into(),
            hint: None,
        };
        let mut file: toml::Table = toml::from_str(text).map_err(wrong)?;
        let named = file.remove("preset").map(|p| p.try_into().map_err(wrong)).transpose()?;
        let base = Self::preset(preset.or(named).unwrap_or_default());
        let mut whole = toml::Table::try_from(&base).map_err(|e| Error::Config {
            key: "preset".into(),
            what: e.to_string(),
            hint: None,
        })?;
        overlay(&mut whole, file);
        let config: Self = whole.try_into().map_err(wrong)?;
        config.validate()?;
        Ok(config)
    }

    /// Learning rate at a step, from 0: linear up to `lr`, then a cosine down to `lr_end`.
    pub fn lr_at(&self, step: u64) -> f64 {
        if step < self.warmup {
            return self.lr * (step + 1) as f64 / self.warmup as f64;
        }
        let span = self.steps.saturating_sub(self.warmup).max(1) as f64;
        let done = ((step - self.warmup) as f64 / span).min(1.0);
        self.lr_end + (self.lr - self.lr_end) * (1.0 + (std::f64::consts::PI * done).cos()) / 2.0
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
        let weights = &self.action_weights;
        need(self.steps > 0, "steps", "must be at least 1")?;
        need(self.batch_size > 0, "batch_size", "must be at least 1")?;
        need(self.lr.is_finite() && self.lr > 0.0, "lr", "must be above 0")?;
        need((0.0..=self.lr).contains(&self.lr_end), "lr_end", "must be in 0 ... lr")?;
        need((0.0..1.0).contains(&self.weight_decay), "weight_decay", "must be in 0 ... 1")?;
        need(self.clip_norm > 0.0, "clip_norm", "must be above 0")?;
        need(at_least_0(self.motion_weight), "motion_weight", "must be 0 or more")?;
        need(
            weights.iter().all(|w| at_least_0(*w)) && weights.iter().sum::<f64>() > 0.0,
            "action_weights",
            "must be 0 or more, and not all 0",
        )?;
        for (key, every) in [
            ("log_every", self.log_every),
            ("eval_every", self.eval_every),
            ("save_every", self.save_every),
        ] {
            need(every > 0, key, "must be at least 1")?;
        }
        self.net.validate(need)
    }
}

impl NetConfig {
    fn validate(&self, need: impl Fn(bool, &str, &str) -> Result<()>) -> Result<()> {
        for (key, width) in [
            ("net.feature", self.feature),
            ("net.route_hidden", self.route_hidden),
            ("net.velocity_hidden", self.velocity_hidden),
            ("net.attention_hidden", self.attention_hidden),
            ("net.action_hidden", self.action_hidden),
            ("net.motion_hidden", self.motion_hidden),
        ] {
            need((1..=8192).contains(&width), key, "must be in 1 ... 8192")?;
        }
        need((1..=64).contains(&self.modes), "net.modes", "must be in 1 ... 64")?;
        let channels = &self.channels;
        need((1..=8).contains(&channels.len()), "net.channels", "must have 1 ... 8 layers")?;
        let sane = channels.iter().all(|c| (1..=1024).contains(c));
        need(sane, "net.channels", "must be in 1 ... 1024")?;
        let halves = 1 << channels.len();
        for (key, side) in [("net.height", self.height), ("net.width", self.width)] {
            let fits = side > 0 && side <= 4096 && side.is_multiple_of(halves);
            let what = format!("must be a multiple of {halves}: it is halved by every convolution");
            need(fits, key, &what)?;
        }
        Ok(())
    }
}

/// Write the values of `over` into `base`, table by table.
fn overlay(base: &mut toml::Table, over: toml::Table) {
    for (key, value) in over {
        match (base.get_mut(&key), value) {
            (Some(toml::Value::Table(base)), toml::Value::Table(over)) => overlay(base, over),
            (_, value) => {
                base.insert(key, value);
            }
        }
    }
}
