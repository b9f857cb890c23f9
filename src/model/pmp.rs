//! The PMP network: what the car senses and where it should go in, an action and a plan out.
//!
//! ```text
//! camera   [B,3,H,W] - conv x 4 - fc - f_i [B,F] -+
//! ralidar  [B,4,H,W] - conv x 4 - fc - f_r [B,F] -+- cat -> f_c -+- attention: fc - fc - softmax -> a
//! velocity [B,2] ------- fc - fc ----- f_v [B,F] -+              |
//! route    [B,260] ----- fc - fc ----- f_g [B,F] -+              +- gmm: fc - fc -> mixture over 3 s
//!                                                 |
//!                       f_f = sum of a f [B,F] ---+- action: fc - fc -> steer, throttle, brake
//! ```
//!
//! Cai et al., 2020, §III.C; the sizes are those of [`NetConfig`]. Inputs come in SI units and
//! are scaled here, so that training and driving cannot differ. A sensor that delivered nothing
//! is masked, not invented: its picture is never read, its feature is zero in both sums and its
//! attention is exactly 0. A ReLU follows every layer but the last of each head.

use candle_core::{D, Tensor};
use candle_nn::{
    Linear, Module, VarBuilder,
    init::{NonLinearity, ZERO},
    ops::{sigmoid, softmax},
};

use crate::{
    dataset::batch::Inputs,
    error::{Error, Result},
    frame::{FUTURE_STEPS, ROUTE_POINTS},
    model::{config::NetConfig, conv::conv3x3_stride2, init::kaiming},
};

/// Speeds of the mixture are in units of this, so that they are of the size of its yaw angles.
pub const MOTION_SPEED_UNIT_MPS: f64 = 10.0;

/// Smallest and largest standard deviation of the mixture, normalised units.
pub const STD_RANGE: [f64; 2] = [0.01, 5.0];

/// Velocity inputs are divided by this: the 43 km/h of TCP and CILRS.
const VELOCITY_UNIT_MPS: f64 = 12.0;

/// Waypoints are divided by half of the route's 51.6 m.
const ROUTE_UNIT_M: f64 = 26.0;

/// ImageNet's mean and standard deviation of R, G, B in 0 ... 1.
const CAMERA_MEAN: [f32; 3] = [0.485, 0.456, 0.406];
const CAMERA_STD: [f32; 3] = [0.229, 0.224, 0.225];

/// x, y, z are divided by 50 m, relative speeds by 20 m/s.
const RALIDAR_UNITS: [f32; 4] = [50.0, 50.0, 50.0, 20.0];

/// What the network says.
#[derive(Clone, Debug)]
pub struct Output {
    /// `[B, 3]`: steer in [-1, 1], throttle and brake in [0, 1] (a1 of the paper).
    pub action: Tensor,
    /// `[B, branches]`, each row summing to 1, in the order of [`Pmp::branches`].
    pub attention: Tensor,
    pub motion: Mixture,
}

/// A mixture over the next 3 s: one weight per mode for all steps, so that a mode is one
/// manoeuvre; given the mode, all numbers are independent normals. Normalised units: speed in
/// [`MOTION_SPEED_UNIT_MPS`], yaw change from now in rad. 121 numbers per mode.
#[derive(Clone, Debug)]
pub struct Mixture {
    /// `[B, K]`, unnormalised log weights.
    pub logits: Tensor,
    /// `[B, K, 30, 2]`: speed, yaw change.
    pub mean: Tensor,
    /// `[B, K, 30, 2]`: log of the standard deviations, within [`STD_RANGE`].
    pub log_std: Tensor,
}

/// The network.
#[derive(Clone, Debug)]
pub struct Pmp {
    camera: Option<Encoder>,
    ralidar: Option<Encoder>,
    velocity: Dense,
    route: Dense,
    attention: Dense,
    action: Dense,
    gmm: Dense,
    modes: usize,
}

impl Pmp {
    /// Build with parameters named `camera.conv0.weight`, `route.fc1.bias`, `gmm.fc0.weight`, ...
    ///
    /// # Errors
    ///
    /// [`Error::Tensor`] if the builder lacks a parameter or has it in another shape.
    pub fn new(cfg: &NetConfig, vb: VarBuilder) -> Result<Self> {
        let encoder = |on: bool, channels: usize, name: &str| {
            on.then(|| Encoder::new(channels, cfg, vb.pp(name))).transpose()
        };
        let dense = |sizes: [usize; 3], last: NonLinearity, name: &str| {
            Dense::new(&sizes, last, vb.pp(name))
        };
        let (f, relu, linear) = (cfg.feature, NonLinearity::ReLU, NonLinearity::Linear);
        let branches = 2 + usize::from(cfg.camera) + usize::from(cfg.ralidar);
        let numbers = cfg.modes * (1 + 2 * 2 * FUTURE_STEPS);
        Ok(Self {
            camera: encoder(cfg.camera, 3, "camera")?,
            ralidar: encoder(cfg.ralidar, 4, "ralidar")?,
            velocity: dense([2, cfg.velocity_hidden, f], relu, "velocity")?,
            route: dense([2 * ROUTE_POINTS, cfg.route_hidden, f], relu, "route")?,
            attention: dense([branches * f, cfg.attention_hidden, branches], linear, "attention")?,
            action: dense([f, cfg.action_hidden, 3], linear, "action")?,
            gmm: dense([branches * f, cfg.motion_hidden, numbers], linear, "gmm")?,
            modes: cfg.modes,
        })
    }

    /// Names of the branches, in the order of [`Output::attention`].
    pub fn branches(&self) -> Vec<&'static str> {
        let (camera, ralidar) = (self.camera.as_ref(), self.ralidar.as_ref());
        let sensors = [camera.map(|_| "camera"), ralidar.map(|_| "ralidar")];
        sensors.into_iter().flatten().chain(["velocity", "route"]).collect()
    }

    /// # Errors
    ///
    /// [`Error::Config`] if the batch lacks a picture that the network has a branch for;
    /// [`Error::Tensor`] if shapes disagree.
    pub fn forward(&self, inputs: &Inputs) -> Result<Output> {
        let always = inputs.present.narrow(1, 0, 1)?.ones_like()?; // [B, 1]
        let (mut features, mut masks) = (vec![], vec![]); // [B, F], [B, 1] each
        let sensors = [(&self.camera, &inputs.camera), (&self.ralidar, &inputs.ralidar)];
        for (i, (branch, picture)) in sensors.into_iter().enumerate() {
            let Some(branch) = branch else { continue };
            let Some(picture) = picture else {
                let key = ["net.camera", "net.ralidar"][i].into();
                let what = "the network has this branch, but the batch has no such picture".into();
                return Err(Error::Config { key, what, hint: None });
            };
            let present = inputs.present.narrow(1, i, 1)?;
            features.push(branch.forward(picture, &present)?.broadcast_mul(&present)?);
            masks.push(present);
        }
        features.push(self.velocity.forward(&(&inputs.velocity / VELOCITY_UNIT_MPS)?)?.relu()?);
        features.push(self.route.forward(&(&inputs.route / ROUTE_UNIT_M)?)?.relu()?);
        masks.extend([always.clone(), always]);

        let joint = Tensor::cat(&features, 1)?; // f_c [B, branches * F]
        let mask = Tensor::cat(&masks, 1)?; // [B, branches]
        let logits = (self.attention.forward(&joint)? + ((mask - 1.0)? * 1e9)?)?;
        let attention = softmax(&logits, D::Minus1)?; // [B, branches], paper eq. (2)
        let mut fused = features[0].broadcast_mul(&attention.narrow(1, 0, 1)?)?; // f_f [B, F]
        for (i, feature) in features.iter().enumerate().skip(1) {
            fused = (fused + feature.broadcast_mul(&attention.narrow(1, i, 1)?)?)?;
        }
        let action = self.action.forward(&fused)?; // [B, 3]
        let (steer, pedals) = (action.narrow(1, 0, 1)?.tanh()?, sigmoid(&action.narrow(1, 1, 2)?)?);
        Ok(Output {
            action: Tensor::cat(&[steer, pedals], 1)?,
            attention,
            motion: self.mixture(&self.gmm.forward(&joint)?)?,
        })
    }

    /// `[B, K (1 + 60 + 60)]` to a mixture.
    fn mixture(&self, raw: &Tensor) -> Result<Mixture> {
        let k = self.modes;
        let numbers = |part: usize| {
            let width = k * 2 * FUTURE_STEPS;
            raw.narrow(1, k + part * width, width)?.reshape(((), k, FUTURE_STEPS, 2))
        };
        Ok(Mixture {
            logits: raw.narrow(1, 0, k)?,
            mean: numbers(0)?,
            log_std: bounded_log_std(&numbers(1)?)?,
        })
    }
}

/// Keep a log standard deviation strictly within [`STD_RANGE`], any shape to the same shape.
///
/// A hard clamp has no gradient outside of its range: a number that strays there is never heard
/// of again. This is a tanh around the middle of the range: slope 1 there, 0.42 at a nominal end
/// of the range and still 0.01 at three times that distance, so the way back stays open, and
/// Adam, which divides by the size of the gradient, takes it.
fn bounded_log_std(raw: &Tensor) -> Result<Tensor> {
    let [low, high] = STD_RANGE.map(f64::ln);
    let (centre, half) = ((low + high) / 2.0, (high - low) / 2.0);
    Ok(((raw - centre)? / half)?.tanh()?.affine(half, centre)?)
}

/// Fully connected layers `fc0`, `fc1`, ...
#[derive(Clone, Debug)]
struct Dense(Vec<Linear>);

impl Dense {
    /// `last` is what the caller does to the output.
    fn new(sizes: &[usize], last: NonLinearity, vb: VarBuilder) -> Result<Self> {
        let mut layers = vec![];
        for (i, pair) in sizes.windows(2).enumerate() {
            let after = if i + 2 < sizes.len() { NonLinearity::ReLU } else { last };
            let vb = vb.pp(format!("fc{i}"));
            let weight = vb.get_with_hints((pair[1], pair[0]), "weight", kaiming(after))?;
            let bias = vb.get_with_hints(pair[1], "bias", ZERO)?;
            layers.push(Linear::new(weight, Some(bias)));
        }
        Ok(Self(layers))
    }

    /// `[B, sizes[0]]` to `[B, sizes.last]`, a ReLU between layers and none after the last.
    fn forward(&self, x: &Tensor) -> Result<Tensor> {
        let mut x = x.clone();
        for (i, layer) in self.0.iter().enumerate() {
            x = layer.forward(&if i > 0 { x.relu()? } else { x })?;
        }
        Ok(x)
    }
}

/// A picture to a feature: 3 x 3 convolutions of stride 2, then one fully connected layer.
#[derive(Clone, Debug)]
struct Encoder {
    /// `[1, C, 1, 1]`: the input is scaled to (x - mean) / unit.
    mean: Tensor,
    unit: Tensor,
    /// Weight and bias of each.
    convs: Vec<(Tensor, Tensor)>,
    fc: Dense,
}

impl Encoder {
    fn new(channels: usize, cfg: &NetConfig, vb: VarBuilder) -> Result<Self> {
        let (mut convs, mut c_in) = (vec![], channels);
        for (i, &c_out) in cfg.channels.iter().enumerate() {
            let vb = vb.pp(format!("conv{i}"));
            let start = kaiming(NonLinearity::ReLU);
            let weight = vb.get_with_hints((c_out, c_in, 3, 3), "weight", start)?;
            let bias = vb.get_with_hints(c_out, "bias", ZERO)?;
            convs.push((weight, bias));
            c_in = c_out;
        }
        let halved = |side: usize| side >> cfg.channels.len();
        let flat = c_in * halved(cfg.height) * halved(cfg.width);
        let per_channel = |values: &[f32]| {
            Tensor::new(values, vb.device())?.reshape((1, channels, 1, 1))?.to_dtype(vb.dtype())
        };
        let camera = channels == CAMERA_MEAN.len();
        Ok(Self {
            mean: per_channel(if camera { &CAMERA_MEAN } else { &[0.0; 4] })?,
            unit: per_channel(if camera { &CAMERA_STD } else { &RALIDAR_UNITS })?,
            convs,
            fc: Dense::new(&[flat, cfg.feature], NonLinearity::ReLU, vb.clone())?,
        })
    }

    /// `[B, C, H, W]` and `[B, 1]` to `[B, F]`. Where not present, the picture is not looked at:
    /// not even an infinity in it comes through.
    fn forward(&self, picture: &Tensor, present: &Tensor) -> Result<Tensor> {
        let scaled = picture.broadcast_sub(&self.mean)?.broadcast_div(&self.unit)?;
        let present = present.reshape(((), 1, 1, 1))?.gt(0.0)?.broadcast_as(scaled.shape())?;
        let mut x = present.where_cond(&scaled, &scaled.zeros_like()?)?;
        x = x.transpose(0, 1)?; // [C, B, H, W]
        for (weight, bias) in &self.convs {
            x = conv3x3_stride2(&x, weight, bias)?.relu()?; // [C, B, H/2, W/2]
        }
        Ok(self.fc.forward(&x.transpose(0, 1)?.flatten_from(1)?)?.relu()?)
    }
}
