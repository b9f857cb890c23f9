//! Where a planned motion leads: the place some metres ahead, and the speed there.

use crate::{frame::FUTURE_STEPS, policy::Mode};

/// What to steer and accelerate to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Target {
    /// Step of the motion that it is, from 1: k of the paper's eq. (3).
    pub step: usize,
    /// Angle from straight ahead, rad, positive = left.
    pub bearing_rad: f64,
    pub speed_mps: f64,
    /// Length of the whole planned way, m.
    pub path_m: f64,
}

/// A plan that goes less far than this in 3 s stands, m: its direction says nothing.
pub const STANDS_M: f64 = 0.3;

impl Target {
    /// The first step of a mode's means that is `ahead_m` or more along the way, else the last.
    ///
    /// Source: paper §III.C4 ("the point 5 m ahead by integrating the mean values").
    pub fn of(mode: &Mode, speed_now_mps: f32, ahead_m: f64) -> Self {
        let places = mode.positions_m(speed_now_mps);
        let (mut path_m, mut at, mut found) = (0.0, [0.0; 2], None);
        for (i, place) in places.into_iter().enumerate() {
            path_m += (place[0] - at[0]).hypot(place[1] - at[1]);
            at = place;
            if path_m >= ahead_m && found.is_none() {
                found = Some(i);
            }
        }
        let i = found.unwrap_or(FUTURE_STEPS - 1);
        let bearing_rad = if path_m < STANDS_M { 0.0 } else { places[i][1].atan2(places[i][0]) };
        Self { step: i + 1, bearing_rad, speed_mps: f64::from(mode.speed_mps[i]), path_m }
    }
}
