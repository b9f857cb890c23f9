//! How vehicles follow and change lanes: the intelligent driver model and MOBIL.
//!
//! IDM: Treiber, Hennecke and Helbing, Congested traffic states in empirical observations and
//! microscopic simulations (2000). MOBIL: Kesting, Treiber and Helbing, General lane-changing
//! model MOBIL for car-following models (2007).

/// Parameters of the intelligent driver model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Idm {
    /// Strongest wanted acceleration, m/s2.
    pub acceleration_mps2: f64,
    /// Comfortable braking, m/s2, positive.
    pub comfort_mps2: f64,
    /// Time gap to the vehicle ahead, s.
    pub time_gap_s: f64,
    /// Gap at rest, m.
    pub rest_gap_m: f64,
}

/// What is in front.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ahead {
    /// From bumper to bumper, m.
    pub gap_m: f64,
    /// Along the own way, m/s.
    pub speed_mps: f64,
}

impl Ahead {
    /// Something that stands.
    pub fn standing(gap_m: f64) -> Ahead {
        Ahead { gap_m, speed_mps: 0.0 }
    }
}

/// Smallest gap that is reckoned with, m: the model divides by it.
const LEAST_GAP_M: f64 = 0.1;

impl Idm {
    /// The acceleration that the model wants, m/s2.
    pub fn acceleration_mps2(&self, speed_mps: f64, wish_mps: f64, ahead: Option<Ahead>) -> f64 {
        let a = self.acceleration_mps2;
        // Above the wish the model would brake with the fourth power of the speed.
        let free = if speed_mps <= wish_mps {
            a * (1.0 - (speed_mps / wish_mps.max(LEAST_GAP_M)).powi(4))
        } else {
            -self.comfort_mps2 * (1.0 - (wish_mps / speed_mps).powf(2.0 * a / self.comfort_mps2))
        };
        let Some(ahead) = ahead else { return free };
        let wanted = self.wanted_gap_m(speed_mps, ahead.speed_mps);
        let interaction = a * (wanted / ahead.gap_m.max(LEAST_GAP_M)).powi(2);
        free - interaction
    }

    /// The gap that a driver wants behind a vehicle, m.
    pub fn wanted_gap_m(&self, speed_mps: f64, ahead_mps: f64) -> f64 {
        let brake = 2.0 * (self.acceleration_mps2 * self.comfort_mps2).sqrt();
        let approach = speed_mps * (speed_mps - ahead_mps) / brake;
        self.rest_gap_m + (speed_mps * self.time_gap_s + approach).max(0.0)
    }

    /// The gap of steady traffic at a speed, m (Treiber and Kesting, equation 11.14 in the limit of
    /// an unreachable wish).
    pub fn steady_gap_m(&self, speed_mps: f64, wish_mps: f64) -> f64 {
        let free = 1.0 - (speed_mps / wish_mps).powi(4);
        self.wanted_gap_m(speed_mps, speed_mps) / free.max(1e-9).sqrt()
    }
}

/// Parameters of MOBIL.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mobil {
    /// How much others' disadvantage counts, in [0, 1].
    pub politeness: f64,
    /// Least advantage of a change, m/s2.
    pub threshold_mps2: f64,
    /// Hardest braking that a change may force on the one behind, m/s2, positive.
    pub safe_mps2: f64,
}

/// Town traffic: polite, and slow to change.
pub const MOBIL: Mobil = Mobil { politeness: 0.3, threshold_mps2: 0.25, safe_mps2: 2.0 };

/// Accelerations before and after a possible change, m/s2.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Change {
    pub own_before_mps2: f64,
    pub own_after_mps2: f64,
    /// Of the vehicle that would be behind; `None` where there is none.
    pub follower_mps2: Option<[f64; 2]>,
    /// Of the vehicle that is behind now.
    pub old_follower_mps2: Option<[f64; 2]>,
}

impl Mobil {
    /// Whether the change is safe and worth while; `bias_mps2` favours it (towards where the way
    /// goes, or back to the right).
    pub fn wants(&self, change: &Change, bias_mps2: f64) -> bool {
        self.is_safe(change) && {
            let gain = |pair: Option<[f64; 2]>| pair.map_or(0.0, |[before, after]| after - before);
            let others = gain(change.follower_mps2) + gain(change.old_follower_mps2);
            let own = change.own_after_mps2 - change.own_before_mps2;
            own + self.politeness * others + bias_mps2 > self.threshold_mps2
        }
    }

    /// Whether neither the one behind nor oneself would have to brake too hard.
    pub fn is_safe(&self, change: &Change) -> bool {
        let follower = change.follower_mps2.is_none_or(|[_, after]| after > -self.safe_mps2);
        follower && change.own_after_mps2 > -self.safe_mps2
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CAR: Idm =
        Idm { acceleration_mps2: 1.5, comfort_mps2: 2.0, time_gap_s: 1.2, rest_gap_m: 2.0 };

    #[test]
    fn the_gap_of_steady_traffic_asks_for_no_acceleration() {
        for speed_mps in [0.5, 3.0, 8.0, 12.0] {
            let gap_m = CAR.steady_gap_m(speed_mps, 13.9);
            let ahead = Some(Ahead { gap_m, speed_mps });
            let a = CAR.acceleration_mps2(speed_mps, 13.9, ahead);
            assert!(a.abs() < 1e-9, "{speed_mps}: {a}");
        }
    }

    /// Stopping behind a standing car from 50 km/h takes no more than one and a half times the
    /// comfortable braking, and ends at the gap at rest.
    #[test]
    fn a_standing_car_is_approached_gently_and_never_reached() {
        let (mut gap_m, mut speed_mps, mut hardest) = (120.0, 13.9, 0.0_f64);
        for _ in 0..6000 {
            let a = CAR.acceleration_mps2(speed_mps, 13.9, Some(Ahead::standing(gap_m)));
            hardest = hardest.min(a);
            let next = (speed_mps + a * 0.01_f64).max(0.0);
            gap_m -= (speed_mps + next) / 2.0 * 0.01;
            speed_mps = next;
        }
        assert!(speed_mps < 0.1 && gap_m > 1.8 && gap_m < 3.5, "{speed_mps} m/s, {gap_m} m");
        assert!(hardest > -1.5 * CAR.comfort_mps2, "{hardest}");
    }

    #[test]
    fn nobody_changes_in_front_of_who_would_have_to_brake() {
        let free = Change {
            own_before_mps2: -0.5,
            own_after_mps2: 1.0,
            follower_mps2: None,
            old_follower_mps2: None,
        };
        assert!(MOBIL.wants(&free, 0.0));
        assert!(!MOBIL.wants(&Change { follower_mps2: Some([0.5, -3.0]), ..free }, 0.0));
        let polite = Change { own_after_mps2: -0.3, follower_mps2: Some([0.5, -0.5]), ..free };
        assert!(!MOBIL.wants(&polite, 0.0), "a small gain at a large cost of another");
    }
}
