//! The planned motion: a Gaussian mixture over the next 3 s (paper §III.C4).

use candle_core::{D, Tensor};
use candle_nn::ops::log_softmax;

use crate::{error::Result, frame::FUTURE_STEPS, model::net_config::MixtureKind};

/// Speeds of the mixture are in units of this, so that they are of the size of its yaw angles.
pub const MOTION_SPEED_UNIT_MPS: f64 = 10.0;

/// Smallest and largest standard deviation of the mixture, normalised units.
pub const STD_RANGE: [f64; 2] = [0.01, 5.0];

/// Means and standard deviations of a mode: speed and yaw change at each step.
const NUMBERS: usize = 2 * FUTURE_STEPS;

/// A mixture. Given the mode, all numbers are independent normals. Normalised units: speed in
/// [`MOTION_SPEED_UNIT_MPS`], yaw change from now in rad.
#[derive(Clone, Debug)]
pub struct Mixture {
    /// Unnormalised log weights: `[B, K, 1]` of manoeuvres, `[B, K, 30]` of a mixture at each step.
    pub logits: Tensor,
    /// `[B, K, 30, 2]`: speed, yaw change.
    pub mean: Tensor,
    /// `[B, K, 30, 2]`: log of the standard deviations, within [`STD_RANGE`].
    pub log_std: Tensor,
}

impl Mixture {
    /// Numbers that a network has to say for so many modes.
    pub fn numbers(kind: MixtureKind, modes: usize) -> usize {
        modes * (weights(kind) + 2 * NUMBERS)
    }

    /// From what a network says, `[B, numbers]`: all log weights, all means, all log standard
    /// deviations.
    ///
    /// # Errors
    ///
    /// [`Error::Tensor`](crate::error::Error::Tensor) if there are not so many numbers.
    pub fn new(raw: &Tensor, kind: MixtureKind, modes: usize) -> Result<Self> {
        let weights = modes * weights(kind);
        let numbers = |part: usize| {
            let all = raw.narrow(1, weights + part * modes * NUMBERS, modes * NUMBERS)?;
            all.reshape(((), modes, FUTURE_STEPS, 2))
        };
        Ok(Self {
            logits: raw.narrow(1, 0, weights)?.reshape(((), modes, self::weights(kind)))?,
            mean: numbers(0)?,
            log_std: bounded_log_std(&numbers(1)?)?,
        })
    }

    /// The same with speeds that are added to the speed of now, `[B, 1]` in m/s.
    ///
    /// # Errors
    ///
    /// [`Error::Tensor`](crate::error::Error::Tensor) if shapes disagree.
    pub fn from_speed_now(self, speed_mps: &Tensor) -> Result<Self> {
        let speed = (speed_mps / MOTION_SPEED_UNIT_MPS)?.reshape(((), 1, 1, 1))?;
        let change = Tensor::cat(&[&speed, &speed.zeros_like()?], D::Minus1)?; // [B, 1, 1, 2]
        Ok(Self { mean: self.mean.broadcast_add(&change)?, ..self })
    }

    /// Log of the weights, shaped as `logits`.
    ///
    /// # Errors
    ///
    /// [`Error::Tensor`](crate::error::Error::Tensor) if memory runs out.
    pub fn log_weights(&self) -> Result<Tensor> {
        Ok(log_softmax(&self.logits, 1)?)
    }
}

/// Weights of a mode.
fn weights(kind: MixtureKind) -> usize {
    match kind {
        MixtureKind::Manoeuvre => 1,
        MixtureKind::Step => FUTURE_STEPS,
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
