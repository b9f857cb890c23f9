//! How fast to drive: free road, curves, the car in front, stop lines.
//!
//! The intelligent driver model (Treiber, Hennecke and Helbing, 2000), with curves as a lower
//! wish and a stop line as a standing car.

use crate::{
    sim::road::Road,
    world::car_following::{Ahead, Idm},
};

/// A calm driver.
const FOLLOW: Idm =
    Idm { acceleration_mps2: 1.8, comfort_mps2: 2.0, time_gap_s: 1.4, rest_gap_m: 2.5 };

/// The brakes can do more, but nothing on this road calls for it.
const HARDEST_MPS2: f64 = 6.0;

/// How far ahead curves and stop lines count, m.
const HORIZON_M: f64 = 70.0;

/// How long a car waits at a stop line, s, and how far before it, m.
const WAIT_S: f64 = 2.0;
const LINE_GAP_M: f64 = 1.0;

/// Nearer to the line and slower than this, a driver calls it stopped and holds the car.
const NEAR_LINE_M: f64 = 4.0;
const CREEP_MPS: f64 = 1.0;
const HOLD_MPS2: f64 = 1.5;

/// The part of a driver that minds the pedals; remembers which stop lines are behind it.
#[derive(Clone, Debug, Default)]
pub struct Cruise {
    lines_passed: usize,
    waited_s: f64,
}

impl Cruise {
    /// The acceleration to ask for, m/s2, for a front bumper at arc length `front_m`; `dt_s` has
    /// passed since the last call.
    pub fn acceleration_mps2(
        &mut self,
        road: &Road,
        front_m: f64,
        speed_mps: f64,
        wish_mps: f64,
        ahead: Option<Ahead>,
        dt_s: f64,
    ) -> f64 {
        let line = self.line_ahead(road, front_m, speed_mps, dt_s);
        if self.waited_s > 0.0 {
            // The model alone would creep on for seconds.
            return -HOLD_MPS2;
        }
        let wish_mps = wish_mps.min(allowed_mps(road, front_m));
        let follow = |ahead| FOLLOW.acceleration_mps2(speed_mps, wish_mps, ahead);
        let following = [ahead, line].into_iter().flatten().map(|ahead| follow(Some(ahead)));
        following.fold(follow(None), f64::min).max(-HARDEST_MPS2)
    }

    /// The next stop line as a standing car, until the wait in front of it is over.
    fn line_ahead(
        &mut self,
        road: &Road,
        front_m: f64,
        speed_mps: f64,
        dt_s: f64,
    ) -> Option<Ahead> {
        let line_m = *road.stop_lines_m().get(self.lines_passed)?;
        let to_line_m = line_m - front_m;
        if to_line_m > HORIZON_M {
            return None;
        }
        let waiting = to_line_m < NEAR_LINE_M && speed_mps < CREEP_MPS;
        self.waited_s += if waiting { dt_s } else { 0.0 };
        if self.waited_s >= WAIT_S || to_line_m < -1.0 {
            (self.lines_passed, self.waited_s) = (self.lines_passed + 1, 0.0);
            return None;
        }
        Some(Ahead { gap_m: to_line_m - LINE_GAP_M + FOLLOW.rest_gap_m, speed_mps: 0.0 })
    }
}

/// The speed from which every limit ahead can be met by comfortable braking.
fn allowed_mps(road: &Road, from_m: f64) -> f64 {
    const LOOK_EVERY_M: f64 = 3.0;
    (0..(HORIZON_M / LOOK_EVERY_M) as usize)
        .map(|i| {
            let ahead_m = i as f64 * LOOK_EVERY_M;
            let limit = road.speed_limit_mps(from_m + ahead_m);
            (limit * limit + 2.0 * FOLLOW.comfort_mps2 * 0.7 * ahead_m).sqrt()
        })
        .fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::road::Piece;

    const DT_S: f64 = 0.05;

    /// Speeds and places of a car that starts at rest, behind `ahead` if there is one.
    fn drive(
        road: &Road,
        seconds: f64,
        ahead: impl Fn(f64) -> Option<(f64, f64)>,
    ) -> Vec<(f64, f64)> {
        let (mut cruise, mut s, mut speed) = (Cruise::default(), 0.0, 0.0);
        (0..(seconds / DT_S) as usize)
            .map(|i| {
                let ahead = ahead(i as f64 * DT_S)
                    .map(|(at, speed_mps)| Ahead { gap_m: at - s, speed_mps });
                let a = cruise.acceleration_mps2(road, s, speed, 11.0, ahead, DT_S);
                speed = (speed + a * DT_S).max(0.0);
                s += speed * DT_S;
                (s, speed)
            })
            .collect()
    }

    fn straight() -> Road {
        Road::from_pieces(&[Piece { length_m: 2000.0, start_per_m: 0.0, end_per_m: 0.0 }])
    }

    #[test]
    fn a_free_road_is_driven_at_the_speed_that_was_wished_for() {
        let end = *drive(&straight(), 60.0, |_| None).last().unwrap();
        assert!((end.1 - 11.0).abs() < 0.1, "{end:?}");
    }

    #[test]
    fn a_slower_car_is_followed_at_its_speed_and_the_time_gap() {
        let lead = |t: f64| (40.0 + 6.0 * t, 6.0);
        let (s, speed) = *drive(&straight(), 90.0, |t| Some(lead(t))).last().unwrap();
        let gap = lead(90.0 - DT_S).0 - s;
        assert!((speed - 6.0).abs() < 0.05, "{speed}");
        // At equilibrium the model's gap is the wanted one, widened by the free term.
        let wanted =
            (FOLLOW.rest_gap_m + 6.0 * FOLLOW.time_gap_s) / (1.0 - (6.0_f64 / 11.0).powi(4)).sqrt();
        assert!((gap - wanted).abs() < 0.5, "{gap} {wanted}");
    }

    #[test]
    fn a_standing_car_is_never_touched() {
        let track = drive(&straight(), 60.0, |_| Some((150.0, 0.0)));
        assert!(track.iter().all(|(s, _)| *s < 150.0 - 1.0));
        assert!(track.last().unwrap().1 < 0.1);
    }
}
