//! Sizes of the networks: everything that is needed to rebuild one for its weights.

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
    /// Camera, ralidar, route and velocity to an action and a motion mixture (the paper's).
    #[default]
    Pmp,
    /// The same without camera and ralidar: what route and velocity alone are worth.
    Blind,
    /// Camera, velocity and command to an action, by a shallow image module (Codevilla 2018).
    Cil,
    /// The same with ResNet34 as its image module.
    CilR,
    /// Camera, velocity and route to an action, by ResNet34 (intention-net).
    Int,
}

/// Sizes to start from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Preset {
    /// The smallest: `pmp` and `blind` see route and velocity only (0.25 M parameters), the
    /// others a picture of 16 x 40. A minute on two cores.
    Nano,
    /// Pictures of 32 x 80, half a million parameters: minutes on two cores.
    #[default]
    Tiny,
    /// Pictures of 64 x 160 with batch norm, some two million parameters: hours on two cores.
    Small,
    /// The paper's sizes, ResNet34: for a GPU.
    Paper,
}

/// What a network can do without, to see what it is worth.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Deserialize, Serialize, ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Part {
    Camera,
    Ralidar,
    /// The speeds that radar measured; where lidar met something stays.
    Radar,
    Route,
    Velocity,
    /// Features count alike instead of by their attention.
    Attention,
}

/// The network of a run.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(tag = "structure", rename_all = "kebab-case")]
pub enum NetConfig {
    Pmp(PmpConfig),
    Cil(CilConfig),
    Int(IntConfig),
}

/// How a picture becomes a feature.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct PictureConfig {
    /// What the stored picture is shrunk to, pixels.
    pub height: usize,
    pub width: usize,
    pub encoder: Encoder,
    /// Channels after each convolution; of a ResNet34 those of its first stage, which each of the
    /// three others doubles.
    pub channels: Vec<usize>,
    /// Batch norm after each convolution; a ResNet34 always has it.
    pub batch_norm: bool,
}

/// Convolutions from a picture to what the fully connected layers get.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Encoder {
    /// 3 x 3 of stride 2, as many as there are `channels`; all pixels that are left go on.
    Strided,
    /// CIL's eight without padding: 5 x 5 of stride 2, then 3 x 3 of strides 1, 2, 1, 2, 1, 1, 1.
    Cil,
    /// He et al., 2015; the mean over all pixels goes on.
    Resnet34,
}

/// The PMP network (paper §III.C).
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct PmpConfig {
    /// What is left out: camera, ralidar, radar, route, velocity, attention.
    pub disable: Vec<Part>,
    pub picture: PictureConfig,
    #[serde(default)]
    pub ranging: Ranging,
    /// Width of what each branch says (paper: 2048).
    pub feature: usize,
    /// Widths between input and feature, or between feature and output.
    pub route_hidden: Vec<usize>,
    pub velocity_hidden: Vec<usize>,
    pub attention_hidden: Vec<usize>,
    pub action_hidden: Vec<usize>,
    pub motion_hidden: Vec<usize>,
    /// Modes of the motion mixture. With the route given, what is left to choose is mostly
    /// whether to go or to brake.
    pub modes: usize,
    pub mixture: MixtureKind,
    #[serde(default)]
    pub action: ActionRange,
    /// Planned speeds are added to the speed of now.
    pub residual_speed: bool,
    /// Whether the speed of now is also told from the pictures and the route alone, against
    /// standing still for ever (Codevilla 2019).
    pub speed_head: bool,
    /// Share of numbers dropped in the heads while learning.
    pub dropout: f64,
}

/// How the places that lidar met are told.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Ranging {
    /// Coordinates in units of 50 m, the paper read literally. No return is 0, and what is very
    /// near is almost 0.
    #[default]
    Metres,
    /// Nearness in place of the depth: 0 without a return, 1 at the lens, 1/2 at 5 m; right and
    /// down in units in which a car is large.
    Nearness,
}

/// How any numbers become an action in its range.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum ActionRange {
    /// Steering by tanh, pedals by the logistic function, which is flat near 0, where most brakes
    /// are.
    #[default]
    Squashed,
    /// As they are while learning, cut to the range when they are used (Codevilla 2018).
    Cut,
}

/// Which numbers of a motion share a weight.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum MixtureKind {
    /// One weight a mode for all steps: a mode is one manoeuvre.
    Manoeuvre,
    /// A mixture of its own at every step, the paper read literally.
    Step,
}

/// Conditional imitation learning, with the layers of its authors' code.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct CilConfig {
    pub picture: PictureConfig,
    /// Widths after the convolutions; the last is the picture's feature.
    pub image_hidden: Vec<usize>,
    /// Widths after the speed; the last is its feature.
    pub velocity_hidden: Vec<usize>,
    /// Width of what both are joined to.
    pub joint: usize,
    /// Widths before the outputs of each of the four commands and of the speed head.
    pub branch_hidden: Vec<usize>,
    #[serde(default)]
    pub action: ActionRange,
    /// Shares of numbers dropped while learning: after the picture, and in the branches.
    pub image_dropout: f64,
    pub branch_dropout: f64,
}

/// Intention-net, its rendered map replaced by the local route (paper §IV.A).
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct IntConfig {
    pub picture: PictureConfig,
    /// Width of the picture's feature.
    pub image_feature: usize,
    /// Widths after the route and after the velocity; the last ones are their features.
    pub route_hidden: Vec<usize>,
    pub velocity_hidden: Vec<usize>,
    /// Widths before the action.
    pub joint_hidden: Vec<usize>,
    #[serde(default)]
    pub action: ActionRange,
    /// Share of numbers dropped before each layer of the joint part while learning.
    pub dropout: f64,
}

/// Check a value: whether it is good, its key, what it has to be.
type Need<'n> = &'n dyn Fn(bool, &str, &str) -> Result<()>;

impl NetConfig {
    /// The sizes of a model at a preset.
    pub fn preset(model: Model, preset: Preset) -> Self {
        match model {
            Model::Pmp => NetConfig::Pmp(PmpConfig::preset(preset)),
            Model::Blind => {
                let disable = vec![Part::Camera, Part::Ralidar];
                NetConfig::Pmp(PmpConfig { disable, ..PmpConfig::preset(preset) })
            }
            Model::Cil => NetConfig::Cil(CilConfig::preset(preset)),
            Model::CilR => {
                let cil = CilConfig::preset(preset);
                let encoder = Encoder::Resnet34;
                let channels = vec![[4, 8, 16, 64][preset as usize]];
                let picture = PictureConfig { encoder, channels, batch_norm: true, ..cil.picture };
                NetConfig::Cil(CilConfig { picture, ..cil })
            }
            Model::Int => NetConfig::Int(IntConfig::preset(preset)),
        }
    }

    /// What the network's pictures are like; `None` if it sees none.
    pub fn picture(&self) -> Option<&PictureConfig> {
        match self {
            NetConfig::Pmp(pmp) => {
                (pmp.has(Part::Camera) || pmp.has(Part::Ralidar)).then_some(&pmp.picture)
            }
            NetConfig::Cil(cil) => Some(&cil.picture),
            NetConfig::Int(int) => Some(&int.picture),
        }
    }

    /// Size of the pictures to prepare; `None` for a network without pictures.
    pub fn input_size(&self) -> Option<InputSize> {
        self.picture().map(|&PictureConfig { height, width, .. }| InputSize { height, width })
    }

    /// Do without some parts.
    ///
    /// # Errors
    ///
    /// [`Error::Config`] for a network that cannot.
    pub fn disable(&mut self, parts: &[Part]) -> Result<()> {
        match self {
            NetConfig::Pmp(pmp) => {
                pmp.disable.extend(parts);
                pmp.disable.sort_unstable();
                pmp.disable.dedup();
                Ok(())
            }
            _ if parts.is_empty() => Ok(()),
            _ => Err(Error::Config {
                key: "disable".into(),
                what: "only the networks `pmp` and `blind` can do without a part".into(),
                hint: None,
            }),
        }
    }

    /// Check every range.
    ///
    /// # Errors
    ///
    /// [`Error::Config`] for the first key whose value makes no sense.
    pub fn validate(&self) -> Result<()> {
        let need = |good: bool, key: &str, what: &str| {
            let error =
                || Error::Config { key: format!("net.{key}"), what: what.into(), hint: None };
            good.then_some(()).ok_or_else(error)
        };
        match self {
            NetConfig::Pmp(pmp) => pmp.validate(&need),
            NetConfig::Cil(cil) => cil.validate(&need),
            NetConfig::Int(int) => int.validate(&need),
        }
    }
}

impl PictureConfig {
    fn strided(height: usize, width: usize, channels: [usize; 4], batch_norm: bool) -> Self {
        let channels = channels.to_vec();
        PictureConfig { height, width, encoder: Encoder::Strided, channels, batch_norm }
    }

    fn resnet34(height: usize, width: usize, first_stage: usize) -> Self {
        let (encoder, channels) = (Encoder::Resnet34, vec![first_stage]);
        PictureConfig { height, width, encoder, channels, batch_norm: true }
    }

    /// The pictures of the small presets.
    fn small(preset: Preset) -> Self {
        match preset {
            Preset::Nano => Self::strided(16, 40, [4, 8, 16, 32], false),
            Preset::Tiny => Self::strided(32, 80, [8, 16, 32, 64], false),
            Preset::Small | Preset::Paper => Self::strided(64, 160, [16, 32, 64, 128], true),
        }
    }

    fn validate(&self, need: Need) -> Result<()> {
        let channels = &self.channels;
        let fits = match self.encoder {
            Encoder::Strided => (1..=8).contains(&channels.len()),
            Encoder::Cil => channels.len() == 8,
            Encoder::Resnet34 => channels.len() == 1,
        };
        let what = match self.encoder {
            Encoder::Strided => "must have 1 ... 8 entries, one for each convolution",
            Encoder::Cil => "must have 8 entries, one for each convolution of `cil`",
            Encoder::Resnet34 => "must have one entry, the channels of a ResNet34's first stage",
        };
        need(fits, "picture.channels", what)?;
        let sane = channels.iter().all(|c| (1..=1024).contains(c));
        need(sane, "picture.channels", "must be in 1 ... 1024")?;
        let least = match self.encoder {
            Encoder::Strided | Encoder::Resnet34 => 1,
            Encoder::Cil => 77, // the eight leave one pixel of that
        };
        let range = format!("must be in {least} ... 4096");
        for (key, side) in [("picture.height", self.height), ("picture.width", self.width)] {
            need((least..=4096).contains(&side), key, &range)?;
        }
        Ok(())
    }
}

impl PmpConfig {
    fn preset(preset: Preset) -> Self {
        let tiny = Self {
            disable: vec![],
            picture: PictureConfig::small(preset),
            ranging: Ranging::default(),
            feature: 128,
            route_hidden: vec![128],
            velocity_hidden: vec![64],
            attention_hidden: vec![64],
            action_hidden: vec![128],
            motion_hidden: vec![256],
            modes: 3,
            mixture: MixtureKind::Manoeuvre,
            action: ActionRange::default(),
            residual_speed: false,
            speed_head: false,
            dropout: 0.0,
        };
        match preset {
            Preset::Nano => Self { disable: vec![Part::Camera, Part::Ralidar], ..tiny },
            Preset::Tiny => tiny,
            Preset::Small => Self {
                feature: 256,
                route_hidden: vec![256],
                velocity_hidden: vec![128],
                attention_hidden: vec![128],
                action_hidden: vec![256],
                motion_hidden: vec![512],
                ..tiny
            },
            Preset::Paper => Self {
                picture: PictureConfig::resnet34(250, 600, 64),
                feature: 2048,
                route_hidden: vec![512, 1024],
                velocity_hidden: vec![128, 512],
                attention_hidden: vec![512],
                action_hidden: vec![512, 256],
                motion_hidden: vec![1024, 512],
                ..tiny
            },
        }
    }

    /// Whether a part takes part.
    pub fn has(&self, part: Part) -> bool {
        !self.disable.contains(&part)
    }

    fn validate(&self, need: Need) -> Result<()> {
        let inputs = [Part::Camera, Part::Ralidar, Part::Route, Part::Velocity];
        let sees = inputs.into_iter().any(|part| self.has(part));
        need(sees, "disable", "leaves the network without any input")?;
        self.picture.validate(need)?;
        widths(need, "feature", &[self.feature])?;
        widths(need, "route_hidden", &self.route_hidden)?;
        widths(need, "velocity_hidden", &self.velocity_hidden)?;
        widths(need, "attention_hidden", &self.attention_hidden)?;
        widths(need, "action_hidden", &self.action_hidden)?;
        widths(need, "motion_hidden", &self.motion_hidden)?;
        need((1..=64).contains(&self.modes), "modes", "must be in 1 ... 64")?;
        share(need, "dropout", self.dropout)
    }
}

impl CilConfig {
    fn preset(preset: Preset) -> Self {
        let small = |feature: usize| Self {
            picture: PictureConfig::small(preset),
            image_hidden: vec![feature],
            velocity_hidden: vec![64],
            joint: feature,
            branch_hidden: vec![feature],
            action: ActionRange::default(),
            image_dropout: 0.0,
            branch_dropout: 0.0,
        };
        match preset {
            Preset::Nano => small(64),
            Preset::Tiny => small(128),
            Preset::Small => small(256),
            Preset::Paper => Self {
                picture: PictureConfig {
                    height: 88,
                    width: 200,
                    encoder: Encoder::Cil,
                    channels: vec![32, 32, 64, 64, 128, 128, 256, 256],
                    batch_norm: true,
                },
                image_hidden: vec![512, 512],
                velocity_hidden: vec![128, 128],
                joint: 512,
                branch_hidden: vec![256, 256],
                action: ActionRange::default(),
                image_dropout: 0.3,
                branch_dropout: 0.5,
            },
        }
    }

    fn validate(&self, need: Need) -> Result<()> {
        self.picture.validate(need)?;
        need(!self.image_hidden.is_empty(), "image_hidden", "must have a layer")?;
        need(!self.velocity_hidden.is_empty(), "velocity_hidden", "must have a layer")?;
        widths(need, "image_hidden", &self.image_hidden)?;
        widths(need, "velocity_hidden", &self.velocity_hidden)?;
        widths(need, "joint", &[self.joint])?;
        widths(need, "branch_hidden", &self.branch_hidden)?;
        share(need, "image_dropout", self.image_dropout)?;
        share(need, "branch_dropout", self.branch_dropout)
    }
}

impl IntConfig {
    fn preset(preset: Preset) -> Self {
        let small = |feature: usize, first_stage: usize| {
            let PictureConfig { height, width, .. } = PictureConfig::small(preset);
            Self {
                picture: PictureConfig::resnet34(height, width, first_stage),
                image_feature: feature,
                route_hidden: vec![feature, feature],
                velocity_hidden: vec![64],
                joint_hidden: vec![feature],
                action: ActionRange::default(),
                dropout: 0.0,
            }
        };
        match preset {
            Preset::Nano => small(64, 4),
            Preset::Tiny => small(128, 8),
            Preset::Small => small(256, 16),
            Preset::Paper => Self {
                picture: PictureConfig::resnet34(250, 600, 64),
                image_feature: 2048,
                route_hidden: vec![512, 1024, 2048],
                velocity_hidden: vec![64],
                joint_hidden: vec![2048],
                action: ActionRange::default(),
                dropout: 0.3,
            },
        }
    }

    fn validate(&self, need: Need) -> Result<()> {
        self.picture.validate(need)?;
        need(!self.route_hidden.is_empty(), "route_hidden", "must have a layer")?;
        need(!self.velocity_hidden.is_empty(), "velocity_hidden", "must have a layer")?;
        widths(need, "image_feature", &[self.image_feature])?;
        widths(need, "route_hidden", &self.route_hidden)?;
        widths(need, "velocity_hidden", &self.velocity_hidden)?;
        widths(need, "joint_hidden", &self.joint_hidden)?;
        share(need, "dropout", self.dropout)
    }
}

fn widths(need: Need, key: &str, widths: &[usize]) -> Result<()> {
    need(widths.len() <= 8, key, "must have 8 layers or fewer")?;
    need(widths.iter().all(|width| (1..=8192).contains(width)), key, "must be in 1 ... 8192")
}

fn share(need: Need, key: &str, share: f64) -> Result<()> {
    need((0.0..1.0).contains(&share), key, "must be 0 or more and below 1")
}
