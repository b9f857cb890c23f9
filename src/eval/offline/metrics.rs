//! What a plan got wrong at one frame: pure functions, no state, no files.
//!
//! A frame counts at a horizon only if its future is recorded up to that horizon, so that every
//! number of a horizon is over the same frames whatever the policy.

use crate::{
    control::driver::Decision,
    eval::offline::{
        horizons::{HORIZON_STEPS, HORIZONS, difference, wrapped_rad},
        mixture_errors::MixtureErrors,
        pedals::Onset,
    },
    frame::{FUTURE_STEPS, Frame, signed_speed_mps},
    policy::{Action, Plan},
};

/// Actions that a plan leads to: a1, its own; a2, which follows its motion; and both fused by
/// eq. (3), where its constants are known.
pub const SOURCES: [&str; 3] = ["a1", "a2", "fused"];

/// What a plan got wrong at one frame; `None` where the frame or the plan has nothing to compare.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FrameErrors {
    /// What would have been done, by [`SOURCES`].
    pub planned: [Option<Action>; 3],
    /// Mean displacement up to each horizon, m.
    pub ade_m: [Option<f64>; HORIZONS],
    /// Displacement at each horizon, m.
    pub fde_m: [Option<f64>; HORIZONS],
    /// Least mean displacement up to 3 s, and least displacement at 3 s, of any mode, m.
    pub min_ade_m: Option<f64>,
    pub min_fde_m: Option<f64>,
    /// Greatest displacement within 3 s, m; and the least that this is of any mode.
    pub largest_m: Option<f64>,
    pub min_largest_m: Option<f64>,
    /// Planned minus recorded speed at each horizon, m/s.
    pub speed_mps: [Option<f64>; HORIZONS],
    /// |planned - recorded| yaw change at each horizon, rad in [0, pi].
    pub heading_rad: [Option<f64>; HORIZONS],
    /// Mean of that over the steps up to 3 s.
    pub mean_heading_rad: Option<f64>,
    pub mixture: Option<Box<MixtureErrors>>,
    /// S of eq. (3): the variance of the plan up to its target, 5 m ahead.
    pub variance: Option<f64>,
    /// Share of a2 in the fused action.
    pub lambda: Option<f64>,
    /// Displacement at the target, and its mean up to there, m.
    pub target_m: Option<f64>,
    pub target_ade_m: Option<f64>,
    /// By branch of the policy.
    pub attention: Vec<f32>,
    /// By [`SOURCES`]: see [`steer_way_m`](crate::eval::offline::steering::steer_way_m), over the
    /// frames up to this one.
    pub steer_way_m: [Option<f64>; 3],
    /// By [`SOURCES`], where the driver began to brake.
    pub brake_onset: [Option<Onset>; 3],
}

impl FrameErrors {
    /// Compare a plan with what the recorded driver did.
    ///
    /// Displacements, speed and heading are of the strongest mode. The mixture metrics need the
    /// whole 3 s.
    pub fn of(plan: &Plan, frame: &Frame) -> Self {
        let mut errors = FrameErrors {
            planned: [plan.action, None, None],
            attention: plan.attention.iter().map(|(_, share)| *share).collect(),
            ..FrameErrors::default()
        };
        let (Some(mode), future) = (plan.strongest(), &frame.future) else { return errors };
        let now_mps = signed_speed_mps(frame.velocity_mps);
        let positions = mode.positions_m(now_mps);
        let heading = |steps| wrapped_rad(difference(&mode.yaw_rad, &future.yaw_rad, steps)).abs();
        for (i, steps) in HORIZON_STEPS.into_iter().enumerate() {
            if usize::from(future.len) < steps {
                continue;
            }
            errors.ade_m[i] = Some(ade_m(&positions, &future.xy_m, steps));
            errors.fde_m[i] = Some(displacement_m(&positions, &future.xy_m, steps - 1));
            errors.speed_mps[i] = Some(difference(&mode.speed_mps, &future.speed_mps, steps));
            errors.heading_rad[i] = Some(heading(steps));
        }
        if usize::from(future.len) == FUTURE_STEPS {
            let least = |of: fn(&[[f64; 2]], &[f32]) -> f64| {
                let modes = plan.motion.iter().map(|mode| mode.positions_m(now_mps));
                modes.map(|positions| of(&positions, &future.xy_m)).reduce(f64::min)
            };
            errors.min_ade_m = least(|planned, driven| ade_m(planned, driven, FUTURE_STEPS));
            errors.min_fde_m =
                least(|planned, driven| displacement_m(planned, driven, FUTURE_STEPS - 1));
            errors.min_largest_m = least(largest_m);
            errors.largest_m = Some(largest_m(&positions, &future.xy_m));
            let sum: f64 = (1..=FUTURE_STEPS).map(heading).sum();
            errors.mean_heading_rad = Some(sum / FUTURE_STEPS as f64);
            errors.mixture = MixtureErrors::of(&plan.motion, future).map(Box::new);
        }
        errors
    }

    /// Add what a driver made of the plan. Whether the fused action is kept, and the share of a2
    /// in it, is up to `knows_fusion`: without constants of eq. (3) it is no action of the policy.
    pub fn decided(
        mut self,
        decision: &Decision,
        knows_fusion: bool,
        plan: &Plan,
        frame: &Frame,
    ) -> Self {
        self.planned[1] = decision.a2;
        self.variance = decision.variance;
        if knows_fusion && decision.a1.is_some() && decision.a2.is_some() {
            self.planned[2] = Some(decision.action);
            self.lambda = Some(decision.lambda);
        }
        if let (Some(mode), Some(target)) = (plan.strongest(), decision.target)
            && usize::from(frame.future.len) >= target.step
        {
            let positions = mode.positions_m(signed_speed_mps(frame.velocity_mps));
            let driven = &frame.future.xy_m;
            self.target_m = Some(displacement_m(&positions, driven, target.step - 1));
            self.target_ade_m = Some(ade_m(&positions, driven, target.step));
        }
        self
    }
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

/// Greatest distance in metres between planned and driven positions at the same step.
fn largest_m(planned_m: &[[f64; 2]], driven_xy_m: &[f32]) -> f64 {
    let distances = (0..planned_m.len()).map(|i| displacement_m(planned_m, driven_xy_m, i));
    distances.fold(0.0, f64::max)
}
