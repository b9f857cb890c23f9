//! How far ahead a plan is judged, and what planned minus recorded is.

use std::f64::consts::{PI, TAU};

use crate::frame::FUTURE_STEP_S;

/// Horizons that are reported.
pub const HORIZONS: usize = 6;

/// Steps of the horizons: every half second.
pub const HORIZON_STEPS: [usize; HORIZONS] = [5, 10, 15, 20, 25, 30];

/// Places of 1, 2 and 3 s in [`HORIZON_STEPS`].
pub const WHOLE_SECONDS: [usize; 3] = [1, 3, 5];

/// The horizons in seconds.
pub fn horizons_s() -> [f64; HORIZONS] {
    HORIZON_STEPS.map(|steps| steps as f64 * FUTURE_STEP_S)
}

/// Planned minus recorded after that many steps.
pub fn difference(planned: &[f32], recorded: &[f32], steps: usize) -> f64 {
    f64::from(planned[steps - 1]) - f64::from(recorded[steps - 1])
}

/// An angle in radians brought into (-pi, pi].
pub fn wrapped_rad(angle_rad: f64) -> f64 {
    PI - (PI - angle_rad).rem_euclid(TAU)
}
