//! What is asked of the network: the driver's action, and the motion that came of it.
//!
//! Every term is a mean over what is known. Each is kept as a sum until the end, beside the counts
//! that the labels alone tell, so that a step in micro-batches minimises the mean over all of its
//! frames, and a validation over many batches is the mean over all of theirs.

use candle_core::{D, DType, Tensor};

use crate::{
    dataset::batch::Targets,
    error::Result,
    model::{
        config::{Assign, LossConfig},
        mixture::{MOTION_SPEED_UNIT_MPS, Mixture},
        output::{Output, VELOCITY_UNIT_MPS},
    },
};

/// How much of a batch is known: what the sums are divided by.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Known {
    /// Entries of steer, throttle, brake.
    pub action: [f64; 3],
    /// Samples with a valid step of motion.
    pub motion: f64,
    /// Samples.
    pub samples: f64,
}

/// Sums over a batch, with their graphs.
#[derive(Clone, Debug)]
pub struct LossSums {
    /// `[3]`: sum of absolute errors of the known entries of each channel.
    pub action: Tensor,
    /// `[]`: sum of negative log likelihoods per number, over samples with a valid step.
    pub motion: Option<Tensor>,
    /// `[]`: sum of the entropies of the mixtures' weights, nats, over all samples.
    pub entropy: Option<Tensor>,
    /// `[]`: sum of absolute errors of the guessed speed, in [`VELOCITY_UNIT_MPS`].
    pub speed: Option<Tensor>,
    pub known: Known,
}

/// [`LossSums`] as numbers, which can be added up over batches.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tally {
    pub action: [f64; 3],
    pub motion: Option<f64>,
    pub entropy: Option<f64>,
    pub speed: Option<f64>,
    pub known: Known,
}

/// The loss by term; `None` where nothing was known, or nothing is said by the network.
#[derive(Clone, Copy, Debug, PartialEq, serde::Deserialize, serde::Serialize)]
pub struct Terms {
    /// What is minimised; an unknown term counts 0.
    pub total: f64,
    /// Weighted mean absolute error of the action.
    pub action: Option<f64>,
    /// Mean absolute errors of the channels.
    pub steer: Option<f64>,
    pub throttle: Option<f64>,
    pub brake: Option<f64>,
    /// Negative log likelihood per number of the motion, nats in normalised units.
    pub motion: Option<f64>,
    /// Mean entropy of the mixture's weights, nats.
    pub entropy: Option<f64>,
    /// Mean absolute error of the guessed speed, in units of 12 m/s.
    pub speed: Option<f64>,
}

impl Terms {
    /// The first term that is not finite, if any.
    pub fn broken(&self) -> Option<&'static str> {
        let terms = [
            ("action loss", self.action),
            ("motion loss", self.motion),
            ("entropy", self.entropy),
            ("speed loss", self.speed),
            ("loss", Some(self.total)),
        ];
        let broken = |(_, value): &(_, Option<f64>)| value.is_some_and(|v| !v.is_finite());
        terms.into_iter().find(broken).map(|(name, _)| name)
    }
}

impl Known {
    /// Count what the labels of a batch tell.
    ///
    /// # Errors
    ///
    /// [`Error::Tensor`](crate::error::Error::Tensor) if shapes disagree.
    pub fn of(targets: &Targets) -> Result<Self> {
        let numbers = |t: &Tensor| t.to_dtype(DType::F64)?.to_vec1::<f64>();
        let action = numbers(&targets.action_known.sum(0)?)?;
        let steps = numbers(&targets.motion_valid.sum(1)?)?;
        Ok(Self {
            action: [action[0], action[1], action[2]],
            motion: steps.iter().filter(|steps| **steps > 0.0).count() as f64,
            samples: steps.len() as f64,
        })
    }

    fn plus(&self, other: &Known) -> Known {
        Known {
            action: std::array::from_fn(|i| self.action[i] + other.action[i]),
            motion: self.motion + other.motion,
            samples: self.samples + other.samples,
        }
    }
}

impl LossSums {
    /// # Errors
    ///
    /// [`Error::Tensor`](crate::error::Error::Tensor) if shapes disagree.
    pub fn new(output: &Output, targets: &Targets, assign: Assign) -> Result<Self> {
        let motion =
            |mixture: &Mixture| motion_sum(mixture, &targets.motion, &targets.motion_valid, assign);
        let speed = |guess: &Tensor| -> Result<Tensor> {
            let now = (targets.speed_mps.unsqueeze(1)? / VELOCITY_UNIT_MPS)?;
            Ok((guess - now)?.abs()?.sum_all()?)
        };
        Ok(Self {
            action: action_sums(&output.action, &targets.action, &targets.action_known)?,
            motion: output.motion.as_ref().map(motion).transpose()?,
            entropy: output.motion.as_ref().map(entropy_sum).transpose()?,
            speed: output.speed.as_ref().map(speed).transpose()?,
            known: Known::of(targets)?,
        })
    }

    /// The scalar to minimise, `[]`: this batch's share of the mean over what is known in `all`,
    /// which is this batch or the step that it is a part of.
    ///
    /// # Errors
    ///
    /// [`Error::Tensor`](crate::error::Error::Tensor) if the device refuses.
    pub fn total(&self, weights: &LossConfig, all: &Known) -> Result<Tensor> {
        let mut total = weighted_mean(&self.action, &all.action, &weights.action_weights)?;
        let terms = [
            (&self.motion, weights.motion_weight, all.motion),
            (&self.entropy, -weights.entropy_weight, all.samples),
            (&self.speed, weights.speed_weight, all.samples),
        ];
        for (sum, weight, count) in terms {
            if let Some(sum) = sum
                && weight != 0.0
            {
                total = (total + (sum * (weight / count.max(1.0)))?)?;
            }
        }
        Ok(total)
    }

    /// Wait for the device and read the numbers.
    ///
    /// # Errors
    ///
    /// [`Error::Tensor`](crate::error::Error::Tensor) if the device refuses.
    pub fn read(&self) -> Result<Tally> {
        let some = [&self.motion, &self.entropy, &self.speed];
        let mut parts = vec![self.action.clone()];
        for sum in some.into_iter().flatten() {
            parts.push(sum.reshape(1)?);
        }
        let all = Tensor::cat(&parts, 0)?.to_dtype(DType::F64)?.to_vec1::<f64>()?;
        let mut rest = all[3..].iter().copied();
        let [motion, entropy, speed] = some.map(|sum| sum.as_ref().and_then(|_| rest.next()));
        let action = [all[0], all[1], all[2]];
        Ok(Tally { action, motion, entropy, speed, known: self.known })
    }
}

impl Tally {
    /// Add those of another batch.
    pub fn add(&mut self, other: &Tally) {
        let sum = |a: Option<f64>, b: Option<f64>| match (a, b) {
            (Some(a), Some(b)) => Some(a + b),
            (a, b) => a.or(b),
        };
        *self = Tally {
            action: std::array::from_fn(|i| self.action[i] + other.action[i]),
            motion: sum(self.motion, other.motion),
            entropy: sum(self.entropy, other.entropy),
            speed: sum(self.speed, other.speed),
            known: self.known.plus(&other.known),
        };
    }

    /// Sums over counts.
    pub fn terms(&self, weights: &LossConfig) -> Terms {
        let known = &self.known;
        let mean = |sum: f64, count: f64| (count > 0.0).then(|| sum / count);
        let weigh =
            |values: &[f64; 3]| (0..3).map(|i| values[i] * weights.action_weights[i]).sum::<f64>();
        let action = mean(weigh(&self.action), weigh(&known.action));
        let motion = self.motion.and_then(|sum| mean(sum, known.motion));
        let entropy = self.entropy.and_then(|sum| mean(sum, known.samples));
        let speed = self.speed.and_then(|sum| mean(sum, known.samples));
        let [steer, throttle, brake] =
            std::array::from_fn(|i| mean(self.action[i], known.action[i]));
        let total = action.unwrap_or(0.0) + weights.motion_weight * motion.unwrap_or(0.0)
            - weights.entropy_weight * entropy.unwrap_or(0.0)
            + weights.speed_weight * speed.unwrap_or(0.0);
        Terms { total, action, steer, throttle, brake, motion, entropy, speed }
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
    let counts = known.sum(0)?.to_dtype(DType::F64)?.to_vec1::<f64>()?;
    let sums = action_sums(pred, target, known)?;
    weighted_mean(&sums, &[counts[0], counts[1], counts[2]], &weights)
}

/// Negative log likelihood of a motion under a mixture, per number that is valid.
///
/// Of manoeuvres, for each sample -logsumexp over modes of (log weight + sum over valid steps and
/// both dimensions of log N); of mixtures at each step, the sum of theirs over valid steps. Both
/// divided by the valid numbers (60 when all are); then the mean over the samples with any valid
/// step. [`Assign::Nearest`] has the one mode whose means are nearest in place of the logsumexp.
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
pub fn motion_nll(
    mixture: &Mixture,
    target: &Tensor,
    valid: &Tensor,
    assign: Assign,
) -> Result<Tensor> {
    let count = valid.sum(1)?.minimum(1.0)?.sum_all()?; // samples with any valid step
    Ok((motion_sum(mixture, target, valid, assign)? / count.maximum(1.0)?)?)
}

/// `[3]` sums of absolute errors, over the batch.
fn action_sums(pred: &Tensor, target: &Tensor, known: &Tensor) -> Result<Tensor> {
    Ok(((pred - target)?.abs()? * known)?.sum(0)?)
}

/// `[3]` sums over counts, channels weighed: `[]`, 0 where the counts are.
fn weighted_mean(sums: &Tensor, counts: &[f64; 3], weights: &[f64; 3]) -> Result<Tensor> {
    let count = counts.iter().zip(weights).map(|(count, weight)| count * weight).sum::<f64>();
    let weights = Tensor::new(weights, sums.device())?.to_dtype(sums.dtype())?;
    Ok(((sums * weights)?.sum_all()? / count.max(f64::from(f32::MIN_POSITIVE)))?)
}

/// `[]` sum of likelihoods per number, over samples with a valid step.
fn motion_sum(
    mixture: &Mixture,
    target: &Tensor,
    valid: &Tensor,
    assign: Assign,
) -> Result<Tensor> {
    let units = Tensor::new(&[MOTION_SPEED_UNIT_MPS, 1.0], target.device())?;
    let target = target.broadcast_div(&units.to_dtype(target.dtype())?)?.unsqueeze(1)?; // [B, 1, 30, 2]
    let off = target.broadcast_sub(&mixture.mean)?; // [B, K, 30, 2]
    let z = (&off * mixture.log_std.neg()?.exp()?)?;
    let half_log_2pi = (2.0 * std::f64::consts::PI).ln() / 2.0;
    let log_normal = ((z.sqr()? * -0.5)? - &mixture.log_std)? - half_log_2pi;
    let log_normal = log_normal?.sum(D::Minus1)?; // [B, K, 30]

    // S is 1 for manoeuvres, whose steps belong together, and 30 for mixtures at each step.
    let at_each_step = mixture.logits.dim(2)? > 1;
    let over_steps = |x: Tensor| -> Result<Tensor> {
        let x = x.broadcast_mul(&valid.unsqueeze(1)?)?; // [B, K, 30]
        Ok(if at_each_step { x } else { x.sum_keepdim(2)? }) // [B, K, S]
    };
    let log_joint = (mixture.log_weights()? + over_steps(log_normal)?)?; // [B, K, S]
    let log_likelihood = match assign {
        Assign::Soft => log_sum_exp(&log_joint)?, // [B, S]
        Assign::Nearest => {
            let nearest = over_steps(off.detach().sqr()?.sum(D::Minus1)?)?.argmin(1)?; // [B, S]
            log_joint.gather(&nearest.unsqueeze(1)?.contiguous()?, 1)?.squeeze(1)?
        }
    };
    let log_likelihood = match at_each_step {
        true => (log_likelihood * valid)?.sum(1)?,
        false => log_likelihood.squeeze(1)?,
    }; // [B]
    let steps = valid.sum(1)?; // [B]
    let counted = steps.minimum(1.0)?; // [B], 1 with any valid step, else 0
    let per_number = (log_likelihood.neg()? / (steps * 2.0)?.maximum(2.0)?)?;
    // A sample without a valid step has the sum of its weights left, or one of them: not counted.
    Ok((per_number * &counted)?.sum_all()?)
}

/// `[B, K, S]` to `[B, S]`. The largest is taken out as a constant: what is left of the sum is at
/// least 1.
fn log_sum_exp(x: &Tensor) -> Result<Tensor> {
    let largest = x.max_keepdim(1)?.detach(); // [B, 1, S]
    let rest = x.broadcast_sub(&largest)?.exp()?.sum_keepdim(1)?.log()?;
    Ok((rest + largest)?.squeeze(1)?)
}

/// `[]` sum over samples of the entropy of the weights, nats, the mean over steps of mixtures at
/// each step.
fn entropy_sum(mixture: &Mixture) -> Result<Tensor> {
    let log_weights = mixture.log_weights()?; // [B, K, S]
    let entropy = (log_weights.exp()? * log_weights)?.sum(1)?.neg()?; // [B, S]
    Ok(entropy.mean(1)?.sum_all()?)
}
