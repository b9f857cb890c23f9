//! What a plan got wrong at one frame: pure functions, no state, no files.
//!
//! A frame counts at a horizon only if its future is recorded up to that horizon, so that every
//! number of a horizon is over the same frames whatever the policy.

use std::f64::consts::{PI, SQRT_2, TAU};

use crate::{
    frame::{FUTURE_STEPS, Frame, Future, RecordedAction, signed_speed_mps},
    policy::{Action, Mode, Plan},
};

/// Steps of the horizons that are reported: 1, 2 and 3 s.
pub const HORIZON_STEPS: [usize; 3] = [10, 20, 30];

/// Central intervals of which the coverage is reported.
pub const CENTRAL_SHARES: [f64; 3] = [0.5, 0.8, 0.95];

/// Speed is likened to yaw in this unit: 10 m/s is 1. The paper does not say its units.
pub const SPEED_UNIT_MPS: f64 = 10.0;

/// What a plan got wrong at one frame; `None` where the frame or the plan has nothing to compare.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FrameErrors {
    /// |planned - recorded|, dimensionless.
    pub steer: Option<f64>,
    pub throttle: Option<f64>,
    pub brake: Option<f64>,
    /// Mean displacement up to 1, 2, 3 s, m.
    pub ade_m: [Option<f64>; 3],
    /// Displacement at 1, 2, 3 s, m.
    pub fde_m: [Option<f64>; 3],
    /// Least mean displacement of any mode up to 3 s, m.
    pub min_ade_m: Option<f64>,
    /// |planned - recorded| speed at 1, 2, 3 s, m/s.
    pub speed_mps: [Option<f64>; 3],
    /// |planned - recorded| yaw change at 3 s, rad in [0, pi].
    pub heading_rad: Option<f64>,
    /// Negative log-likelihood per number, nats; see [`nll_nats`].
    pub nll_nats: Option<f64>,
    /// Share of the recorded numbers inside the central 50, 80, 95 %.
    pub inside: [Option<f64>; 3],
}

impl FrameErrors {
    /// Compare a plan with what the recorded driver did.
    ///
    /// Displacements, speed and heading are of the strongest mode. The mixture metrics need the
    /// whole 3 s.
    pub fn of(plan: &Plan, frame: &Frame) -> Self {
        let mut errors = FrameErrors::default();
        if let Some(action) = plan.action {
            [errors.steer, errors.throttle, errors.brake] = action_l1(action, frame.action);
        }
        let (Some(mode), future) = (plan.strongest(), &frame.future) else { return errors };
        let now_mps = signed_speed_mps(frame.velocity_mps);
        let positions = mode.positions_m(now_mps);
        for (i, steps) in HORIZON_STEPS.into_iter().enumerate() {
            if usize::from(future.len) < steps {
                continue;
            }
            errors.ade_m[i] = Some(ade_m(&positions, &future.xy_m, steps));
            errors.fde_m[i] = Some(displacement_m(&positions, &future.xy_m, steps - 1));
            errors.speed_mps[i] = Some(difference(&mode.speed_mps, &future.speed_mps, steps).abs());
        }
        if usize::from(future.len) == FUTURE_STEPS {
            let ades = plan
                .motion
                .iter()
                .map(|mode| ade_m(&mode.positions_m(now_mps), &future.xy_m, FUTURE_STEPS));
            errors.min_ade_m = ades.reduce(f64::min);
            errors.heading_rad =
                Some(wrapped_rad(difference(&mode.yaw_rad, &future.yaw_rad, FUTURE_STEPS)).abs());
            errors.nll_nats = nll_nats(&plan.motion, future);
            errors.inside = CENTRAL_SHARES.map(|share| inside(&plan.motion, future, share));
        }
        errors
    }
}

/// Absolute errors of steer, throttle and brake (dimensionless), where the log has the channel.
///
/// L1 of the paper's direct action (§III.C3).
pub fn action_l1(planned: Action, recorded: RecordedAction) -> [Option<f64>; 3] {
    [
        (planned.steer, recorded.steer),
        (planned.throttle, recorded.throttle),
        (planned.brake, recorded.brake),
    ]
    .map(|(planned, recorded)| Some((f64::from(planned) - f64::from(recorded?)).abs()))
}

/// Mean distance in metres between planned and driven positions over the first `steps` steps.
///
/// `driven_xy_m` is x1, y1, x2, y2, ... in the same frame as `planned_m`.
pub fn ade_m(planned_m: &[[f64; 2]], driven_xy_m: &[f32], steps: usize) -> f64 {
    (0..steps).map(|i| displacement_m(planned_m, driven_xy_m, i)).sum::<f64>() / steps as f64
}

/// Distance in metres between the planned and the driven position at one step, from 0.
pub fn displacement_m(planned_m: &[[f64; 2]], driven_xy_m: &[f32], step: usize) -> f64 {
    let [x, y] = planned_m[step];
    let (driven_x, driven_y) = (driven_xy_m[2 * step], driven_xy_m[2 * step + 1]);
    (x - f64::from(driven_x)).hypot(y - f64::from(driven_y))
}

/// An angle in radians brought into (-pi, pi].
pub fn wrapped_rad(angle_rad: f64) -> f64 {
    PI - (PI - angle_rad).rem_euclid(TAU)
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

/// Share of the recorded numbers inside the central interval of that share of the mixture.
///
/// Every step's speed and yaw is one number, judged by its marginal: inside if the mixture's
/// distribution function lies within `share / 2` of one half. `None` as for [`nll_nats`]. A
/// calibrated policy has on average as many inside as `share` says.
pub fn inside(modes: &[Mode], future: &Future, share: f64) -> Option<f64> {
    let steps = usize::from(future.len);
    if steps == 0 || modes.is_empty() || modes.iter().any(|mode| mode.std.is_none()) {
        return None;
    }
    let normal = |z: f64| libm::erfc(-z / SQRT_2) / 2.0;
    let mut count = 0;
    for t in 0..steps {
        let (mut speed, mut yaw) = (0.0, 0.0);
        for mode in modes {
            let deviations = mode.std.as_ref()?;
            let weight = f64::from(mode.weight);
            let above = -difference(&mode.speed_mps, &future.speed_mps, t + 1);
            speed += weight * normal(above / f64::from(deviations.speed_mps[t]));
            let above = -wrapped_rad(difference(&mode.yaw_rad, &future.yaw_rad, t + 1));
            yaw += weight * normal(above / f64::from(deviations.yaw_rad[t]));
        }
        count += [speed, yaw].into_iter().filter(|u| (u - 0.5).abs() <= share / 2.0).count();
    }
    Some(count as f64 / (2 * steps) as f64)
}

/// Planned minus recorded after that many steps.
fn difference(planned: &[f32], recorded: &[f32], steps: usize) -> f64 {
    f64::from(planned[steps - 1]) - f64::from(recorded[steps - 1])
}
