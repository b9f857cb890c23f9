//! What is asked of the network: the driver's action, and the motion that came of it.
//!
//! Both terms are means over what is known. Each is kept as a sum and a count until the end, so
//! that a validation over many batches is the mean over all of their frames.

use candle_core::{D, Tensor};

use crate::{
    dataset::batch::Targets,
    error::Result,
    model::{
        config::TrainConfig,
        pmp::{MOTION_SPEED_UNIT_MPS, Mixture, Output},
    },
};

/// How the terms are weighed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LossWeights {
    /// Steer, throttle, brake, relative to each other.
    pub action: [f64; 3],
    /// Of the motion term, beside the action term.
    pub motion: f64,
}

impl From<&TrainConfig> for LossWeights {
    fn from(config: &TrainConfig) -> Self {
        Self { action: config.action_weights, motion: config.motion_weight }
    }
}

/// Sums over a batch, with their graphs.
#[derive(Clone, Debug)]
pub struct LossSums {
    /// `[3]`: sum of absolute errors of the known entries of each channel.
    pub action: Tensor,
    /// `[3]`: known entries.
    pub action_known: Tensor,
    /// `[]`: sum of negative log likelihoods per number, over samples with a valid step.
    pub motion: Tensor,
    /// `[]`: samples with a valid step.
    pub motion_known: Tensor,
}

/// [`LossSums`] as numbers, which can be added up over batches.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tally {
    pub action: [f64; 3],
    pub action_known: [f64; 3],
    pub motion: f64,
    pub motion_known: f64,
}

/// The loss by term; `None` where nothing was known.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Terms {
    /// What is minimised: action + weight x motion; an unknown term counts 0.
    pub total: f64,
    /// Weighted mean absolute error of the action.
    pub action: Option<f64>,
    /// Mean absolute errors of the channels.
    pub steer: Option<f64>,
    pub throttle: Option<f64>,
    pub brake: Option<f64>,
    /// Negative log likelihood per number of the motion, nats in normalised units.
    pub motion: Option<f64>,
}

impl Terms {
    /// The first term that is not finite, if any.
    pub fn broken(&self) -> Option<&'static str> {
        let terms = [("action loss", self.action), ("motion loss", self.motion)];
        let total = ("loss", Some(self.total));
        let broken = |(_, value): &(_, Option<f64>)| value.is_some_and(|v| !v.is_finite());
        terms.into_iter().chain([total]).find(broken).map(|(name, _)| name)
    }
}

impl LossSums {
    /// # Errors
    ///
    /// [`Error::Tensor`](crate::error::Error::Tensor) if shapes disagree.
    pub fn new(output: &Output, targets: &Targets) -> Result<Self> {
        let (action, action_known) =
            action_sums(&output.action, &targets.action, &targets.action_known)?;
        let (motion, motion_known) =
            motion_sums(&output.motion, &targets.motion, &targets.motion_valid)?;
        Ok(Self { action, action_known, motion, motion_known })
    }

    /// The scalar to minimise, `[]`.
    ///
    /// # Errors
    ///
    /// [`Error::Tensor`](crate::error::Error::Tensor) if the device refuses.
    pub fn total(&self, weights: &LossWeights) -> Result<Tensor> {
        let action = weighted_mean(&self.action, &self.action_known, weights.action)?;
        let motion = (&self.motion / self.motion_known.maximum(1.0)?)?;
        Ok((action + (motion * weights.motion)?)?)
    }

    /// Wait for the device and read the numbers.
    ///
    /// # Errors
    ///
    /// [`Error::Tensor`](crate::error::Error::Tensor) if the device refuses.
    pub fn read(&self) -> Result<Tally> {
        let motion = Tensor::stack(&[&self.motion, &self.motion_known], 0)?;
        let all = Tensor::cat(&[&self.action, &self.action_known, &motion], 0)?.to_vec1::<f32>()?;
        let n = |i: usize| f64::from(all[i]);
        Ok(Tally {
            action: [n(0), n(1), n(2)],
            action_known: [n(3), n(4), n(5)],
            motion: n(6),
            motion_known: n(7),
        })
    }
}

impl Tally {
    /// Add those of another batch.
    pub fn add(&mut self, other: &Tally) {
        for i in 0..3 {
            self.action[i] += other.action[i];
            self.action_known[i] += other.action_known[i];
        }
        self.motion += other.motion;
        self.motion_known += other.motion_known;
    }

    /// Sums over counts.
    pub fn terms(&self, weights: &LossWeights) -> Terms {
        let mean = |sum: f64, count: f64| (count > 0.0).then(|| sum / count);
        let weigh = |values: &[f64; 3]| (0..3).map(|i| values[i] * weights.action[i]).sum::<f64>();
        let action = mean(weigh(&self.action), weigh(&self.action_known));
        let motion = mean(self.motion, self.motion_known);
        let [steer, throttle, brake] =
            std::array::from_fn(|i| mean(self.action[i], self.action_known[i]));
        let total = action.unwrap_or(0.0) + weights.motion * motion.unwrap_or(0.0);
        Terms { total, action, steer, throttle, brake, motion }
    }
}

/// Mean absolute error of the action over the entries that are known, channels weighed.
///
/// # Shapes and units
///
/// | name      | shape    | dtype | meaning                                             |
/// |-----------|----------|-------|-----------------------------------------------------|
/// | `pred`    | `[B, 3]` | f32   | steer in [-1, 1], throttle and brake in [0, 1]      |
/// | `target`  | `[B, 3]` | f32   | same; finite even where not known                   |
/// | `known`   | `[B, 3]` | f32   | 1 where `target` exists, else 0                     |
/// | `weights` |          |       | of the channels; only their ratios matter           |
/// | returns   | `[]`     | f32   | sum of w k abs(pred - target) over sum of w k       |
///
/// # Errors
///
/// [`Error::Tensor`](crate::error::Error::Tensor) if the shapes disagree. A batch where nothing
/// is known is not an error: its loss and its gradient are 0.
///
/// # Source
///
/// L1 as in paper §III.C3; the mask and its normalisation are ours, for logs without pedals.
///
/// # Example
///
/// ```
/// use candle_core::{Device::Cpu, Tensor};
/// use pmp::model::loss::action_l1;
///
/// let pred = Tensor::new(&[[0.5f32, 0.0, 0.9]], &Cpu)?;
/// let target = Tensor::new(&[[0.0f32, 1.0, 0.0]], &Cpu)?;
/// let known = Tensor::new(&[[1.0f32, 1.0, 0.0]], &Cpu)?; // this log has no brake
/// let loss = action_l1(&pred, &target, &known, [1.0; 3])?.to_scalar::<f32>()?;
/// assert_eq!(loss, 0.75); // the mean of 0.5 and 1
/// # Ok::<(), pmp::error::Error>(())
/// ```
pub fn action_l1(
    pred: &Tensor,
    target: &Tensor,
    known: &Tensor,
    weights: [f64; 3],
) -> Result<Tensor> {
    let (sums, counts) = action_sums(pred, target, known)?;
    weighted_mean(&sums, &counts, weights)
}

/// Negative log likelihood of a motion under a mixture, per number that is valid.
///
/// For each sample −logsumexp over modes of (log weight + sum over valid steps and both
/// dimensions of log N), divided by the valid numbers (60 when all are); then the mean over the
/// samples with any valid step.
///
/// # Shapes and units
///
/// | name     | shape        | dtype | meaning                                            |
/// |----------|--------------|-------|----------------------------------------------------|
/// | `target` | `[B, 30, 2]` | f32   | speed (m/s), yaw change (rad); finite everywhere   |
/// | `valid`  | `[B, 30]`    | f32   | 1 where `target` exists, else 0                    |
/// | returns  | `[]`         | f32   | nats per number, in the mixture's normalised units |
///
/// # Errors
///
/// [`Error::Tensor`](crate::error::Error::Tensor) if the shapes disagree. A batch without a valid
/// step is not an error: its loss and its gradient are 0.
///
/// # Source
///
/// Paper §III.C4; soft assignment and the division by the numbers are ours, so that the weight of
/// the term does not depend on the horizon.
pub fn motion_nll(mixture: &Mixture, target: &Tensor, valid: &Tensor) -> Result<Tensor> {
    let (sum, count) = motion_sums(mixture, target, valid)?;
    Ok((sum / count.maximum(1.0)?)?)
}

/// `[3]` sums of absolute errors and `[3]` counts, over the batch.
fn action_sums(pred: &Tensor, target: &Tensor, known: &Tensor) -> Result<(Tensor, Tensor)> {
    let errors = ((pred - target)?.abs()? * known)?; // [B, 3]
    Ok((errors.sum(0)?, known.sum(0)?))
}

/// `[3]` sums over `[3]` counts, channels weighed: `[]`, 0 where the counts are.
fn weighted_mean(sums: &Tensor, counts: &Tensor, weights: [f64; 3]) -> Result<Tensor> {
    let weights = Tensor::new(&weights, sums.device())?.to_dtype(sums.dtype())?;
    let count = (counts * &weights)?.sum_all()?.maximum(f64::from(f32::MIN_POSITIVE))?;
    Ok(((sums * weights)?.sum_all()? / count)?)
}

/// `[]` sum of likelihoods per number and `[]` count, over samples with a valid step.
fn motion_sums(mixture: &Mixture, target: &Tensor, valid: &Tensor) -> Result<(Tensor, Tensor)> {
    let units = Tensor::new(&[MOTION_SPEED_UNIT_MPS, 1.0], target.device())?;
    let target = target.broadcast_div(&units.to_dtype(target.dtype())?)?.unsqueeze(1)?; // [B, 1, 30, 2]
    let z = (target.broadcast_sub(&mixture.mean)? * mixture.log_std.neg()?.exp()?)?;
    let half_log_2pi = (2.0 * std::f64::consts::PI).ln() / 2.0;
    let log_normal = ((z.sqr()? * -0.5)? - &mixture.log_std)? - half_log_2pi; // [B, K, 30, 2]
    let per_step = log_normal?.sum(D::Minus1)?.broadcast_mul(&valid.unsqueeze(1)?)?; // [B, K, 30]
    let log_weight = candle_nn::ops::log_softmax(&mixture.logits, D::Minus1)?; // [B, K]
    let log_joint = (log_weight + per_step.sum(D::Minus1)?)?; // [B, K]
    // The largest is taken out as a constant: what is left of the sum is at least 1.
    let largest = log_joint.max_keepdim(D::Minus1)?.detach(); // [B, 1]
    let rest = log_joint.broadcast_sub(&largest)?.exp()?.sum_keepdim(D::Minus1)?.log()?;
    let nll = (rest + largest)?.neg()?.squeeze(1)?; // [B]
    let steps = valid.sum(1)?; // [B]
    let counted = steps.minimum(1.0)?; // [B], 1 with any valid step, else 0
    let per_number = (nll / (steps * 2.0)?.maximum(2.0)?)?;
    // A sample without a valid step has -logsumexp of log weights, which is 0 up to rounding.
    Ok(((per_number * &counted)?.sum_all()?, counted.sum_all()?))
}
