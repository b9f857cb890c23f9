//! The recorded motion under the planned mixture: pure functions of one frame and one plan.

use std::f64::consts::TAU;

use crate::{
    eval::{
        offline::horizons::{HORIZON_STEPS, HORIZONS, difference, wrapped_rad},
        statistics::mixture::{Normal, cdf, central_width, crps},
    },
    frame::{FUTURE_STEPS, Future},
    policy::Mode,
};

/// Central intervals whose coverage and width are reported.
pub const CENTRAL_SHARES: [f64; 3] = [0.5, 0.8, 0.95];

/// Speed is likened to yaw in this unit: 10 m/s is 1. The paper does not say its units.
pub const SPEED_UNIT_MPS: f64 = 10.0;

/// Speed and yaw, in this order, wherever there are two.
pub const DIMENSIONS: usize = 2;

/// What a mixture said of the 3 s that were recorded.
#[derive(Clone, Debug, PartialEq)]
pub struct MixtureErrors {
    /// See [`nll_nats`].
    pub nll_nats: f64,
    /// See [`pit`], each as a share in [0, 1].
    pub pit: [[f32; FUTURE_STEPS]; DIMENSIONS],
    /// Share of the recorded numbers inside the central 50, 80, 95 %.
    pub inside: [f64; 3],
    /// Mean of the continuous ranked probability score over the steps, m/s and rad.
    pub crps: [f64; DIMENSIONS],
    /// The score at each horizon.
    pub crps_at: [[f64; HORIZONS]; DIMENSIONS],
    /// Widths of the central 50, 80, 95 % at each horizon, m/s and rad.
    pub width_at: [[[f64; HORIZONS]; 3]; DIMENSIONS],
}

impl MixtureErrors {
    /// `None` without the whole 3 s, and of modes that claim no deviations.
    pub fn of(modes: &[Mode], future: &Future) -> Option<Self> {
        if usize::from(future.len) < FUTURE_STEPS {
            return None;
        }
        let pits = pit(modes, future)?;
        let mut errors = MixtureErrors {
            nll_nats: nll_nats(modes, future)?,
            pit: [0, 1].map(|d| std::array::from_fn(|t| pits[t][d] as f32)),
            inside: CENTRAL_SHARES.map(|share| inside(&pits, share)),
            crps: [0.0; DIMENSIONS],
            crps_at: [[0.0; HORIZONS]; DIMENSIONS],
            width_at: [[[0.0; HORIZONS]; 3]; DIMENSIONS],
        };
        for t in 0..FUTURE_STEPS {
            let mixtures = marginals(modes, future, t)?;
            let horizon = HORIZON_STEPS.iter().position(|steps| *steps == t + 1);
            for (d, mixture) in mixtures.iter().enumerate() {
                let score = crps(mixture, 0.0);
                errors.crps[d] += score / FUTURE_STEPS as f64;
                let Some(horizon) = horizon else { continue };
                errors.crps_at[d][horizon] = score;
                for (i, share) in CENTRAL_SHARES.into_iter().enumerate() {
                    errors.width_at[d][i][horizon] = central_width(mixture, share);
                }
            }
        }
        Some(errors)
    }

    /// Whether speed or yaw at a horizon was inside a central interval, 1 or 0.
    pub fn inside_at(&self, dimension: usize, share: usize, horizon: usize) -> f64 {
        let u = f64::from(self.pit[dimension][HORIZON_STEPS[horizon] - 1]);
        f64::from((u - 0.5).abs() <= CENTRAL_SHARES[share] / 2.0)
    }
}

/// Mixtures of speed (m/s) and yaw (rad) at a step, from 0, with what was recorded at 0: yaw
/// residuals go the short way round. `None` where a mode claims no deviations.
fn marginals(modes: &[Mode], future: &Future, step: usize) -> Option<[Vec<Normal>; DIMENSIONS]> {
    let (mut speed, mut yaw) = (Vec::new(), Vec::new());
    for mode in modes {
        let deviations = mode.std.as_ref()?;
        let weight = f64::from(mode.weight);
        speed.push(Normal {
            weight,
            mean: difference(&mode.speed_mps, &future.speed_mps, step + 1),
            std: f64::from(deviations.speed_mps[step]),
        });
        yaw.push(Normal {
            weight,
            mean: wrapped_rad(difference(&mode.yaw_rad, &future.yaw_rad, step + 1)),
            std: f64::from(deviations.yaw_rad[step]),
        });
    }
    Some([speed, yaw])
}

/// Negative log-likelihood of the recorded motion under the mixture, nats per number.
///
/// `-log sum_k w_k prod_t N(v_t) N(yaw_t)` over the valid steps, divided by twice their count.
/// One weight per mode for the whole manoeuvre; speed in units of 10 m/s ([`SPEED_UNIT_MPS`])
/// and yaw in rad, so a density and not a probability: it may be negative. Yaw residuals are
/// wrapped. `None` without modes, without a valid step, or where a mode claims no deviations.
/// Source: paper §III.C4, which leaves open that a weight holds for the whole manoeuvre.
pub fn nll_nats(modes: &[Mode], future: &Future) -> Option<f64> {
    let steps = usize::from(future.len);
    if steps == 0 || modes.is_empty() {
        return None;
    }
    let half_log_tau = TAU.ln() / 2.0;
    let mut logs = Vec::with_capacity(modes.len());
    for mode in modes {
        let deviations = mode.std.as_ref()?;
        let mut log = f64::from(mode.weight).ln();
        for t in 0..steps {
            let speed = difference(&mode.speed_mps, &future.speed_mps, t + 1);
            let yaw = wrapped_rad(difference(&mode.yaw_rad, &future.yaw_rad, t + 1));
            let speed_std = f64::from(deviations.speed_mps[t]);
            let yaw_std = f64::from(deviations.yaw_rad[t]);
            log -= (speed / speed_std).powi(2) / 2.0 + (speed_std / SPEED_UNIT_MPS).ln();
            log -= (yaw / yaw_std).powi(2) / 2.0 + yaw_std.ln() + 2.0 * half_log_tau;
        }
        logs.push(log);
    }
    // The largest is taken out first: sixty small densities multiplied underflow.
    let largest = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let sum: f64 = logs.iter().map(|log| (log - largest).exp()).sum();
    Some(-(largest + sum.ln()) / (2 * steps) as f64)
}

/// Probability integral transform of the recorded motion: at each valid step, the share of the
/// mixture of speed, and of yaw, that lies at or below what was recorded.
///
/// If the mixtures are right, these are uniform in [0, 1]. Every step and dimension is judged by
/// its marginal. `None` as for [`nll_nats`].
pub fn pit(modes: &[Mode], future: &Future) -> Option<Vec<[f64; DIMENSIONS]>> {
    if future.len == 0 || modes.is_empty() {
        return None;
    }
    let at = |t| Some(marginals(modes, future, t)?.map(|mixture| cdf(&mixture, 0.0)));
    (0..usize::from(future.len)).map(at).collect()
}

/// Share of the recorded numbers inside the central interval of that share of the mixture, from
/// their [`pit`]: inside is what lies within `share / 2` of one half.
pub fn inside(pits: &[[f64; DIMENSIONS]], share: f64) -> f64 {
    let all = pits.as_flattened();
    all.iter().filter(|u| (**u - 0.5).abs() <= share / 2.0).count() as f64 / all.len() as f64
}
