//! Intention-net: a picture and the way to go, to an action.
//!
//! ```text
//! camera   [B,H,W,3] - ResNet34 - fc -+- image [B,I] -+
//! velocity [B,2] ------------------ fc ---------------+- cat - fc - action
//! route    [B,260] ---------------- fc ---------------+
//! ```
//!
//! Gao et al., 2017 (arXiv:1710.05627), as the paper compares with it (§IV.A): ResNet34 for
//! ResNet50, the local route for the rendered floor map, three outputs for two.

use candle_core::Tensor;
use candle_nn::{VarBuilder, init::NonLinearity};

use crate::{
    dataset::batch::Inputs,
    error::Result,
    frame::ROUTE_POINTS,
    model::{
        dense::Dense,
        describe::Layer,
        encoder::{Encoder, Sensor},
        net_config::{ActionRange, IntConfig},
        output::{self, Output},
        pass::Pass,
    },
};

/// The network.
#[derive(Clone, Debug)]
pub struct Int {
    encoder: Encoder,
    image: Dense,
    velocity: Dense,
    route: Dense,
    joint: Dense,
    action_range: ActionRange,
    dropout: f64,
}

impl Int {
    /// Build with parameters named `camera.conv1.weight`, `camera.fc0.weight`,
    /// `route.fc0.weight`, `action.fc0.bias`, ...
    ///
    /// # Errors
    ///
    /// [`Error::Tensor`](crate::error::Error::Tensor) if the builder lacks a parameter or has it
    /// in another shape.
    pub fn new(cfg: &IntConfig, vb: VarBuilder) -> Result<Self> {
        let (relu, linear) = (NonLinearity::ReLU, NonLinearity::Linear);
        let encoder = Encoder::new(Sensor::Camera, &cfg.picture, vb.pp("camera"))?;
        let layers = |from: usize, widths: &[usize], last: NonLinearity, name: &str| {
            Dense::new(&[&[from], widths].concat(), last, vb.pp(name))
        };
        let width = |hidden: &[usize]| hidden.last().copied().unwrap_or(0);
        let joint = cfg.image_feature + width(&cfg.velocity_hidden) + width(&cfg.route_hidden);
        let action = [&cfg.joint_hidden[..], &[3]].concat();
        Ok(Self {
            image: layers(encoder.width, &[cfg.image_feature], relu, "camera")?,
            encoder,
            velocity: layers(2, &cfg.velocity_hidden, relu, "velocity")?,
            route: layers(2 * ROUTE_POINTS, &cfg.route_hidden, relu, "route")?,
            joint: layers(joint, &action, linear, "action")?.with_dropout(cfg.dropout),
            action_range: cfg.action,
            dropout: cfg.dropout,
        })
    }

    /// The layers in the way of the data, for one frame.
    pub fn layers(&self) -> Vec<Layer> {
        let dense = [&self.image, &self.velocity, &self.route, &self.joint];
        let dense = dense.into_iter().flat_map(Dense::layers);
        self.encoder.layers().into_iter().chain(dense).collect()
    }

    /// # Errors
    ///
    /// [`Error::Config`](crate::error::Error::Config) if the batch lacks the camera,
    /// [`Error::Tensor`](crate::error::Error::Tensor) if shapes disagree.
    pub fn forward(&self, inputs: &Inputs, pass: &Pass) -> Result<Output> {
        let present = inputs.present.narrow(1, 0, 1)?; // [B, 1]
        let camera = output::picture(&inputs.camera, "camera")?;
        let image = self.encoder.forward(camera, &present, pass)?;
        let image = self.image.forward(&image, pass)?.relu()?.broadcast_mul(&present)?;
        let velocity = self.velocity.forward(&output::scaled_velocity(inputs)?, pass)?.relu()?;
        let route = self.route.forward(&output::scaled_route(inputs)?, pass)?.relu()?;
        let joint = Tensor::cat(&[&image, &velocity, &route], 1)?;
        let joint = pass.dropout(&joint, self.dropout, "joint")?;
        let action = output::action(&self.joint.forward(&joint, pass)?, self.action_range, pass)?;
        Ok(Output { action, attention: None, motion: None, speed: None })
    }
}
