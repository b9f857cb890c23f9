//! Conditional imitation learning: a head for each command of the navigator.
//!
//! ```text
//! camera [B,H,W,3] - convolutions - fc -+- image [B,I] -+- cat - fc - joint [B,J] - fc of the command - action
//! speed  [B,1] --------------------- fc -+- speed [B,S] -+
//!                                        image [B,I] ------ fc ---------------------------------- speed, guessed
//! ```
//!
//! Codevilla et al., 2018 (arXiv:1710.02410), with the layers of its authors' code; with ResNet34
//! in the place of the convolutions it is CIL-R (paper §IV.A). The guessed speed is not fed the
//! speed: it makes the picture's feature tell whether the surroundings move.

use candle_core::{DType, Tensor};
use candle_nn::{VarBuilder, init::NonLinearity};

use crate::{
    dataset::batch::Inputs,
    error::Result,
    frame::Command,
    model::{
        dense::Dense,
        describe::Layer,
        encoder::{Encoder, Sensor},
        net_config::{ActionRange, CilConfig},
        output::{self, Output, VELOCITY_UNIT_MPS},
        pass::Pass,
    },
};

/// The network.
#[derive(Clone, Debug)]
pub struct Cil {
    encoder: Encoder,
    image: Dense,
    velocity: Dense,
    joint: Dense,
    /// In the order of [`Command::ALL`].
    branches: Vec<Dense>,
    speed: Dense,
    action_range: ActionRange,
    image_dropout: f64,
}

impl Cil {
    /// Build with parameters named `image.conv0.weight`, `image.fc0.weight`,
    /// `branch.follow.fc0.weight`, `speed.fc0.bias`, ...
    ///
    /// # Errors
    ///
    /// [`Error::Tensor`](crate::error::Error::Tensor) if the builder lacks a parameter or has it
    /// in another shape.
    pub fn new(cfg: &CilConfig, vb: VarBuilder) -> Result<Self> {
        let (relu, linear) = (NonLinearity::ReLU, NonLinearity::Linear);
        let encoder = Encoder::new(Sensor::Camera, &cfg.picture, vb.pp("image"))?;
        let layers = |from: usize, hidden: &[usize], last: NonLinearity, name: &str| {
            Dense::new(&[&[from], hidden].concat(), last, vb.pp(name))
        };
        let head = |from: usize, to: usize, name: &str| {
            let sizes = [&cfg.branch_hidden[..], &[to]].concat();
            Ok::<_, crate::error::Error>(
                layers(from, &sizes, linear, name)?.with_dropout(cfg.branch_dropout),
            )
        };
        let width = |hidden: &[usize]| hidden.last().copied().unwrap_or(0);
        let (image, velocity) = (width(&cfg.image_hidden), width(&cfg.velocity_hidden));
        let branch = |command: &Command| head(cfg.joint, 3, &format!("branch.{}", command.name()));
        Ok(Self {
            image: layers(encoder.width, &cfg.image_hidden, relu, "image")?
                .with_dropout(cfg.image_dropout),
            encoder,
            velocity: layers(1, &cfg.velocity_hidden, relu, "velocity")?,
            joint: layers(image + velocity, &[cfg.joint], relu, "joint")?,
            branches: Command::ALL.iter().map(branch).collect::<Result<_>>()?,
            speed: head(image, 1, "speed")?,
            action_range: cfg.action,
            image_dropout: cfg.image_dropout,
        })
    }

    /// The layers in the way of the data, for one frame.
    pub fn layers(&self) -> Vec<Layer> {
        let fronts = [&self.image, &self.velocity, &self.joint];
        let dense = fronts.into_iter().chain(&self.branches).chain([&self.speed]);
        self.encoder.layers().into_iter().chain(dense.flat_map(Dense::layers)).collect()
    }

    /// # Errors
    ///
    /// [`Error::Config`](crate::error::Error::Config) if the batch lacks the camera,
    /// [`Error::Tensor`](crate::error::Error::Tensor) if shapes disagree.
    pub fn forward(&self, inputs: &Inputs, pass: &Pass) -> Result<Output> {
        let present = inputs.present.narrow(1, 0, 1)?; // [B, 1]
        let camera = output::picture(&inputs.camera, "camera")?;
        let image = self.encoder.forward(camera, &present, pass)?;
        let image = self.image.forward(&image, pass)?.relu()?.broadcast_mul(&present)?; // [B, I]
        let image = pass.dropout(&image, self.image_dropout, "image")?;
        let speed = (output::speed_mps(inputs)? / VELOCITY_UNIT_MPS)?; // [B, 1]
        let velocity = self.velocity.forward(&speed, pass)?.relu()?; // [B, S]
        let joint = Tensor::cat(&[&image, &velocity], 1)?;
        let joint = self.joint.forward(&joint, pass)?.relu()?; // [B, J]

        // Every head answers; that of the command is listened to, and only it learns.
        let mut action: Option<Tensor> = None; // [B, 3]
        for (command, branch) in (0u32..).zip(&self.branches) {
            let given = inputs.command.eq(command)?.to_dtype(DType::F32)?;
            let given = given.to_dtype(joint.dtype())?.unsqueeze(1)?; // [B, 1]
            let answer = branch.forward(&joint, pass)?.broadcast_mul(&given)?;
            action = Some(match action {
                None => answer,
                Some(others) => (others + answer)?,
            });
        }
        let action = action.ok_or_else(|| candle_core::Error::msg("no command"))?;
        Ok(Output {
            action: output::action(&action, self.action_range, pass)?,
            attention: None,
            motion: None,
            speed: Some(self.speed.forward(&image, pass)?),
        })
    }
}
