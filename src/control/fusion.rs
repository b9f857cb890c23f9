//! Which of two actions to trust: the network's own, or the one that follows its plan.

use serde::{Deserialize, Serialize};

use crate::policy::{Action, ModeStd};

/// Speeds are in units of this where variances are summed, so that they are of the size of yaw
/// angles; the unit of the mixture that is learned.
const SPEED_UNIT_MPS: f32 = 10.0;

/// How a1 (direct) and a2 (of the plan) become one action.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Fusion {
    /// The direct action alone.
    A1,
    /// That of the plan alone.
    A2,
    /// Always the same share of a2.
    Fixed { lambda: f64 },
    /// Paper eq. (3): a2 counts exp(-c1 max(0, S - c2)), S the variance of the plan up to the
    /// target.
    Variance { c1: f64, c2: f64 },
}

impl Fusion {
    /// The share of a2 at a variance; 1 of a plan that claims no variance.
    pub fn lambda(&self, variance: Option<f64>) -> f64 {
        match *self {
            Fusion::A1 => 0.0,
            Fusion::A2 => 1.0,
            Fusion::Fixed { lambda } => lambda,
            Fusion::Variance { c1, c2 } => {
                variance.map_or(1.0, |s| (-c1 * (s - c2).max(0.0)).exp())
            }
        }
    }

    /// Constants of eq. (3) from the variances of plans that were made on frames never trained
    /// on: lambda is 1 for half of them and 0.5 at the 95th percentile.
    ///
    /// `None` of fewer than 20 variances, or if half of them and the 95th percentile are the same.
    pub fn calibrated(variances: &[f64]) -> Option<Self> {
        let mut sorted: Vec<f64> = variances.iter().copied().filter(|s| s.is_finite()).collect();
        if sorted.len() < 20 {
            return None;
        }
        sorted.sort_by(f64::total_cmp);
        let quantile = |q: f64| sorted[((sorted.len() - 1) as f64 * q).round() as usize];
        let (half, high) = (quantile(0.5), quantile(0.95));
        (high > half).then(|| Fusion::Variance { c1: 2f64.ln() / (high - half), c2: half })
    }
}

/// S of eq. (3): variances of speed (in 10 m/s) and yaw (rad) summed over the first `steps`.
pub fn variance(std: &ModeStd, steps: usize) -> f64 {
    let both = std.speed_mps.iter().zip(&std.yaw_rad).take(steps);
    both.map(|(speed, yaw)| f64::from((speed / SPEED_UNIT_MPS).powi(2) + yaw.powi(2))).sum()
}

/// (1 - lambda) a1 + lambda a2.
pub fn fuse(a1: Action, a2: Action, lambda: f64) -> Action {
    let mix = |a: f32, b: f32| (1.0 - lambda as f32) * a + lambda as f32 * b;
    Action {
        steer: mix(a1.steer, a2.steer),
        throttle: mix(a1.throttle, a2.throttle),
        brake: mix(a1.brake, a2.brake),
    }
}
