//! How comfortable a drive was: nuPlan's bounds on accelerations, turning and jerk.
//!
//! Speeds and yaw rates of every 0.1 s are smoothed by a parabola through seven of them (Savitzky and
//! Golay, 1964), which also gives their derivatives. The first and the last three have no seven
//! around them and are not judged.

/// Between two samples, s.
const STEP_S: f64 = 0.1;

/// Samples on each side.
const REACH: usize = 3;

/// nuPlan's bounds: acceleration along the car (braking, accelerating) and across, m/s2; yaw rate,
/// rad/s; its change, rad/s2; change of the acceleration along the car, and of all of it, m/s3.
const LONGITUDINAL_MPS2: [f64; 2] = [-4.05, 2.40];
const LATERAL_MPS2: f64 = 4.89;
const YAW_RATE_RADPS: f64 = 0.95;
const YAW_ACCELERATION_RADPS2: f64 = 1.93;
const LONGITUDINAL_JERK_MPS3: f64 = 4.13;
const JERK_MPS3: f64 = 8.37;

/// Times outside the bounds, s, and how much jerk there was.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Comfort {
    pub longitudinal_s: f64,
    pub lateral_s: f64,
    pub yaw_rate_s: f64,
    pub yaw_acceleration_s: f64,
    pub longitudinal_jerk_s: f64,
    pub jerk_s: f64,
    /// Outside at least one of them.
    pub any_s: f64,
    /// Integral of the absolute jerk along the car, m/s2.
    pub longitudinal_jerk_mps2: f64,
}

/// Value, slope and change of slope in the middle of seven samples, by the parabola that is nearest to
/// them.
pub fn smoothed(samples: &[f64; 2 * REACH + 1]) -> [f64; 3] {
    const VALUE: [f64; 7] = [-2.0, 3.0, 6.0, 7.0, 6.0, 3.0, -2.0];
    const SLOPE: [f64; 7] = [-3.0, -2.0, -1.0, 0.0, 1.0, 2.0, 3.0];
    const BEND: [f64; 7] = [5.0, 0.0, -3.0, -4.0, -3.0, 0.0, 5.0];
    let sum = |weights: [f64; 7]| weights.iter().zip(samples).map(|(w, s)| w * s).sum::<f64>();
    [sum(VALUE) / 21.0, sum(SLOPE) / (28.0 * STEP_S), sum(BEND) / (42.0 * STEP_S * STEP_S)]
}

/// Judge a drive by the speed (m/s) and the yaw rate (rad/s) of every 0.1 s.
pub fn judge(motion: &[[f64; 2]]) -> Comfort {
    let mut comfort = Comfort::default();
    for window in motion.windows(2 * REACH + 1) {
        let of = |value: &dyn Fn(&[f64; 2]) -> f64| {
            smoothed(&std::array::from_fn(|at| value(&window[at])))
        };
        let [_, acceleration, jerk] = of(&|[speed, _]| *speed);
        let [yaw_rate, yaw_acceleration, _] = of(&|[_, rate]| *rate);
        let [lateral, lateral_jerk, _] = of(&|[speed, rate]| speed * rate);
        let [brake, push] = LONGITUDINAL_MPS2;
        let outside = [
            (acceleration < brake || acceleration > push, &mut comfort.longitudinal_s),
            (lateral.abs() > LATERAL_MPS2, &mut comfort.lateral_s),
            (yaw_rate.abs() > YAW_RATE_RADPS, &mut comfort.yaw_rate_s),
            (yaw_acceleration.abs() > YAW_ACCELERATION_RADPS2, &mut comfort.yaw_acceleration_s),
            (jerk.abs() > LONGITUDINAL_JERK_MPS3, &mut comfort.longitudinal_jerk_s),
            (jerk.hypot(lateral_jerk) > JERK_MPS3, &mut comfort.jerk_s),
        ];
        let mut is_any = false;
        for (is_outside, sum_s) in outside {
            is_any |= is_outside;
            *sum_s += if is_outside { STEP_S } else { 0.0 };
        }
        comfort.any_s += if is_any { STEP_S } else { 0.0 };
        comfort.longitudinal_jerk_mps2 += jerk.abs() * STEP_S;
    }
    comfort
}
