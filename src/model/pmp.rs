//! The PMP network: what the car senses and where it should go in, an action and a plan out.
//!
//! ```text
//! camera   [B,H,W,3] - convolutions - fc - f_i [B,F] -+
//! ralidar  [B,H,W,4] - convolutions - fc - f_r [B,F] -+- cat -> f_c -+- attention: fc - softmax -> a
//! velocity [B,2] ------- fc ------------- f_v [B,F] --+              |
//! route    [B,260] ----- fc ------------- f_g [B,F] --+              +- gmm: fc -> mixture over 3 s
//!                                                     |
//!                         f_f = sum of a f [B,F] -----+- action: fc -> steer, throttle, brake
//! ```
//!
//! Cai et al., 2020, §III.C; the sizes are those of [`PmpConfig`]. Inputs come in SI units and
//! are scaled here, so that training and driving cannot differ. A sensor that delivered nothing
//! is masked, not invented: its picture is never read, its feature is zero in both sums and its
//! attention is exactly 0. A ReLU follows every layer but the last of each head.

use candle_core::{D, Tensor};
use candle_nn::{VarBuilder, init::NonLinearity, ops::softmax};

use crate::{
    dataset::batch::Inputs,
    error::Result,
    frame::ROUTE_POINTS,
    model::{
        dense::Dense,
        describe::Layer,
        encoder::{Encoder, Sensor},
        mixture::Mixture,
        net_config::{ActionRange, MixtureKind, Part, PictureConfig, PmpConfig},
        output::{self, Output},
        pass::Pass,
    },
    policy::Senses,
};

/// The network.
#[derive(Clone, Debug)]
pub struct Pmp {
    camera: Option<Eye>,
    ralidar: Option<Eye>,
    velocity: Option<Dense>,
    route: Option<Dense>,
    /// Absent where features count alike.
    attention: Option<Dense>,
    action: Dense,
    gmm: Dense,
    speed: Option<Dense>,
    modes: usize,
    mixture: MixtureKind,
    action_range: ActionRange,
    residual_speed: bool,
}

/// A picture's branch.
#[derive(Clone, Debug)]
struct Eye {
    encoder: Encoder,
    fc: Dense,
}

impl Pmp {
    /// Build with parameters named `camera.conv0.weight`, `route.fc1.bias`, `gmm.fc0.weight`, ...
    ///
    /// # Errors
    ///
    /// [`Error::Tensor`](crate::error::Error::Tensor) if the builder lacks a parameter or has it
    /// in another shape.
    pub fn new(cfg: &PmpConfig, vb: VarBuilder) -> Result<Self> {
        let (f, relu, linear) = (cfg.feature, NonLinearity::ReLU, NonLinearity::Linear);
        let eye = |part: Part, sensor: Sensor, name: &str| {
            let eye = || Eye::new(sensor, &cfg.picture, f, vb.pp(name));
            cfg.has(part).then(eye).transpose()
        };
        let ralidar = Sensor::Ralidar { ranging: cfg.ranging, radar: cfg.has(Part::Radar) };
        let dense = |from: usize, hidden: &[usize], to: usize, last: NonLinearity, name: &str| {
            Dense::new(&[&[from], hidden, &[to]].concat(), last, vb.pp(name))
        };
        let branch = |part: Part, from: usize, hidden: &[usize], name: &str| {
            cfg.has(part).then(|| dense(from, hidden, f, relu, name)).transpose()
        };
        let head = |from: usize, hidden: &[usize], to: usize, name: &str| {
            Ok::<_, crate::error::Error>(
                dense(from, hidden, to, linear, name)?.with_dropout(cfg.dropout),
            )
        };
        let inputs = [Part::Camera, Part::Ralidar, Part::Velocity, Part::Route];
        let branches = inputs.into_iter().filter(|part| cfg.has(*part)).count();
        let unspoken = branches - usize::from(cfg.has(Part::Velocity));
        let numbers = Mixture::numbers(cfg.mixture, cfg.modes);
        let attention =
            || dense(branches * f, &cfg.attention_hidden, branches, linear, "attention");
        let speed = || head(unspoken * f, &cfg.action_hidden, 1, "speed");
        Ok(Self {
            camera: eye(Part::Camera, Sensor::Camera, "camera")?,
            ralidar: eye(Part::Ralidar, ralidar, "ralidar")?,
            velocity: branch(Part::Velocity, 2, &cfg.velocity_hidden, "velocity")?,
            route: branch(Part::Route, 2 * ROUTE_POINTS, &cfg.route_hidden, "route")?,
            attention: cfg.has(Part::Attention).then(attention).transpose()?,
            action: head(f, &cfg.action_hidden, 3, "action")?,
            gmm: head(branches * f, &cfg.motion_hidden, numbers, "gmm")?,
            speed: (cfg.speed_head && unspoken > 0).then(speed).transpose()?,
            modes: cfg.modes,
            action_range: cfg.action,
            mixture: cfg.mixture,
            residual_speed: cfg.residual_speed,
        })
    }

    /// Names of the branches, in the order of [`Output::attention`].
    pub fn branches(&self) -> Vec<&'static str> {
        let eyes = [(&self.camera, "camera"), (&self.ralidar, "ralidar")];
        let others = [(&self.velocity, "velocity"), (&self.route, "route")];
        let eyes = eyes.into_iter().filter_map(|(eye, name)| eye.as_ref().map(|_| name));
        let others = others.into_iter().filter_map(|(fc, name)| fc.as_ref().map(|_| name));
        eyes.chain(others).collect()
    }

    /// What the network looks at.
    pub fn senses(&self) -> Senses {
        Senses { camera: self.camera.is_some(), ranging: self.ralidar.is_some() }
    }

    /// The layers in the way of the data, for one frame.
    pub fn layers(&self) -> Vec<Layer> {
        let eyes = [&self.camera, &self.ralidar].into_iter().flatten();
        let eyes = eyes.flat_map(|eye| [eye.encoder.layers(), eye.fc.layers()].concat());
        let (velocity, route) = (self.velocity.as_ref(), self.route.as_ref());
        let heads = [velocity, route, self.attention.as_ref(), Some(&self.action)];
        let heads = heads.into_iter().chain([Some(&self.gmm), self.speed.as_ref()]).flatten();
        eyes.chain(heads.flat_map(Dense::layers)).collect()
    }

    /// # Errors
    ///
    /// [`Error::Config`](crate::error::Error::Config) if the batch lacks a picture that the
    /// network has a branch for; [`Error::Tensor`](crate::error::Error::Tensor) if shapes
    /// disagree.
    pub fn forward(&self, inputs: &Inputs, pass: &Pass) -> Result<Output> {
        let always = inputs.present.narrow(1, 0, 1)?.ones_like()?; // [B, 1]
        let (mut features, mut masks) = (vec![], vec![]); // [B, F], [B, 1] each
        let eyes =
            [(&self.camera, &inputs.camera, "camera"), (&self.ralidar, &inputs.ralidar, "ralidar")];
        for (i, (eye, picture, name)) in eyes.into_iter().enumerate() {
            let Some(eye) = eye else { continue };
            let present = inputs.present.narrow(1, i, 1)?;
            let feature = eye.forward(output::picture(picture, name)?, &present, pass)?;
            features.push(feature.broadcast_mul(&present)?);
            masks.push(present);
        }
        let mut unspoken = features.clone();
        if let Some(velocity) = &self.velocity {
            features.push(velocity.forward(&output::scaled_velocity(inputs)?, pass)?.relu()?);
            masks.push(always.clone());
        }
        if let Some(route) = &self.route {
            let feature = route.forward(&output::scaled_route(inputs)?, pass)?.relu()?;
            unspoken.push(feature.clone());
            features.push(feature);
            masks.push(always);
        }

        let joint = Tensor::cat(&features, 1)?; // f_c [B, branches * F]
        let mask = Tensor::cat(&masks, 1)?; // [B, branches]
        let logits = match &self.attention {
            Some(attention) => attention.forward(&joint, pass)?,
            None => mask.zeros_like()?,
        };
        let logits = (logits + ((mask - 1.0)? * 1e9)?)?;
        let attention = softmax(&logits, D::Minus1)?; // [B, branches], paper eq. (2)
        let mut fused = features[0].broadcast_mul(&attention.narrow(1, 0, 1)?)?; // f_f [B, F]
        for (i, feature) in features.iter().enumerate().skip(1) {
            fused = (fused + feature.broadcast_mul(&attention.narrow(1, i, 1)?)?)?;
        }
        let motion = Mixture::new(&self.gmm.forward(&joint, pass)?, self.mixture, self.modes)?;
        let speed = |head: &Dense| head.forward(&Tensor::cat(&unspoken, 1)?, pass);
        Ok(Output {
            action: output::action(&self.action.forward(&fused, pass)?, self.action_range, pass)?,
            attention: Some(attention),
            motion: Some(match self.residual_speed {
                true => motion.from_speed_now(&output::speed_mps(inputs)?)?,
                false => motion,
            }),
            speed: self.speed.as_ref().map(speed).transpose()?,
        })
    }
}

impl Eye {
    fn new(sensor: Sensor, cfg: &PictureConfig, feature: usize, vb: VarBuilder) -> Result<Self> {
        let encoder = Encoder::new(sensor, cfg, vb.clone())?;
        let fc = Dense::new(&[encoder.width, feature], NonLinearity::ReLU, vb)?;
        Ok(Self { encoder, fc })
    }

    /// `[B, H, W, C]` and `[B, 1]` to `[B, F]`.
    fn forward(&self, picture: &Tensor, present: &Tensor, pass: &Pass) -> Result<Tensor> {
        let x = self.encoder.forward(picture, present, pass)?;
        Ok(self.fc.forward(&x, pass)?.relu()?)
    }
}
