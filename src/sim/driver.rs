//! The driver of recorded drives: pure pursuit of the lane, cruise of the pedals.
//!
//! Now and then the steering is disturbed for a second, so that recovery is in the data. What
//! is recorded as control is what the driver wanted, not what the disturbance made of it.

use glam::DVec2;

use crate::{
    noise::Noise,
    policy::Action,
    sim::{
        cruise::Cruise,
        road::{OWN_LANE_M, Road},
    },
    world::car_following::Ahead,
    world::ego::{Car, SEDAN},
};

/// Time between two decisions, s.
pub const DECISION_S: f64 = 0.05;

/// Pure pursuit aims this far ahead of the rear axle: seconds of driving, and at least metres.
const AIM_S: f64 = 0.8;
const AIM_MIN_M: f64 = 4.0;

/// Slower than this the steering is left alone: nothing would come of a burst, m/s.
const BURST_MIN_MPS: f64 = 6.0;

/// A burst never pulls the car aside harder than this, m/s2.
const BURST_MAX_MPS2: f64 = 2.5;

/// A decision: what the driver wants, and what reaches the car.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Decision {
    pub wanted: Action,
    pub applied: Action,
}

/// What the driver sees of the road and of other cars.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Arc length of the ego frame's origin, m.
    pub s_m: f64,
    pub ahead: Option<Ahead>,
    /// Whether an oncoming car is near: then nobody plays with the wheel.
    pub oncoming: bool,
}

/// A disturbance of the steering: a triangular pulse.
#[derive(Clone, Copy, Debug)]
struct Burst {
    peak: f64,
    duration_s: f64,
    age_s: f64,
}

pub struct Driver {
    cruise: Cruise,
    noise: Noise,
    wish_mps: f64,
    burst: Option<Burst>,
    calm_s: f64,
}

impl Driver {
    pub fn new(mut noise: Noise) -> Self {
        let wish_mps = noise.uniform(36.0, 44.0) / 3.6;
        let calm_s = noise.uniform(6.0, 12.0);
        Driver { cruise: Cruise::default(), noise, wish_mps, burst: None, calm_s }
    }

    /// The next decision; to be asked for every [`DECISION_S`].
    pub fn decide(&mut self, road: &Road, ego: &Car, view: View) -> Decision {
        let front_m = view.s_m + SEDAN.half_length_m;
        let acceleration = self.cruise.acceleration_mps2(
            road,
            front_m,
            ego.speed_mps,
            self.wish_mps,
            view.ahead,
            DECISION_S,
        );
        let (throttle, brake) = ego.config.pedals(acceleration, ego.speed_mps);
        let steer = ego.config.steer(pursuit_rad(road, ego, view.s_m), ego.speed_mps) as f32;
        let wanted = Action { steer, throttle, brake };
        let pull = self.disturbance(ego.speed_mps, view.oncoming) as f32;
        Decision { wanted, applied: Action { steer: (steer + pull).clamp(-1.0, 1.0), ..wanted } }
    }

    /// What to add to the steering now.
    fn disturbance(&mut self, speed_mps: f64, oncoming: bool) -> f64 {
        let Some(burst) = &mut self.burst else {
            self.calm_s -= DECISION_S;
            if self.calm_s <= 0.0 && speed_mps > BURST_MIN_MPS && !oncoming {
                let duration_s = self.noise.uniform(0.7, 1.3);
                let push_m = self.noise.uniform(0.3, 0.7);
                // By its end the pulse alone would push the car aside by its peak, integrated
                // twice over a triangle; the driver fights it.
                let pull_mps2 = (4.0 * push_m / duration_s.powi(2)).min(BURST_MAX_MPS2);
                let side = self.noise.pick(&[-1.0, 1.0]);
                let angle_rad = side * pull_mps2 * SEDAN.wheelbase_m / speed_mps.powi(2);
                let peak = SEDAN.steer(-angle_rad, speed_mps);
                self.burst = Some(Burst { peak, duration_s, age_s: 0.0 });
            }
            return 0.0;
        };
        burst.age_s += DECISION_S;
        if burst.age_s >= burst.duration_s {
            self.burst = None;
            self.calm_s = self.noise.uniform(6.0, 14.0);
            return 0.0;
        }
        burst.peak * (1.0 - (2.0 * burst.age_s / burst.duration_s - 1.0).abs())
    }
}

/// The front wheels' angle that takes the rear axle to a point ahead on the lane (Coulter, 1992).
fn pursuit_rad(road: &Road, ego: &Car, s_m: f64) -> f64 {
    let axle_m = ego.rear_axle_m();
    let (axle_s, _) = road.project_near(axle_m, s_m - SEDAN.wheelbase_m / 2.0);
    let aim_m = (AIM_S * ego.speed_mps).max(AIM_MIN_M);
    let target = road.place(axle_s + aim_m, OWN_LANE_M) - axle_m;
    let aside_m = DVec2::from_angle(ego.yaw_rad).perp_dot(target);
    (2.0 * SEDAN.wheelbase_m * aside_m / target.length_squared()).atan()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::Purpose;
    use crate::world::ego::STEP_S;

    #[test]
    fn the_lane_is_kept_through_bursts_and_curves_and_bursts_are_there() {
        let road = Road::generate(&mut Noise::new(5, 0, Purpose::Road), 2500.0);
        let mut driver = Driver::new(Noise::new(5, 0, Purpose::Driver));
        let mut ego = Car { position_m: road.place(20.0, OWN_LANE_M), ..Default::default() };
        ego.yaw_rad = road.at(20.0).heading_rad;
        let (mut s, mut decision) = (20.0, Decision::default());
        let (mut worst, mut disturbed, mut stops) = (0.0_f64, 0, 0);
        for step in 0..18_000 {
            let lateral;
            (s, lateral) = road.project_near(ego.position_m, s);
            worst = worst.max((lateral - OWN_LANE_M).abs());
            if step % (DECISION_S / STEP_S) as usize == 0 {
                let view = View { s_m: s, ahead: None, oncoming: false };
                decision = driver.decide(&road, &ego, view);
                disturbed += usize::from(decision.wanted != decision.applied);
            }
            let next = ego.step(decision.applied);
            stops += usize::from(next.speed_mps == 0.0 && ego.speed_mps > 0.0);
            ego = next;
        }
        assert!(worst > 0.2 && worst < 1.2, "furthest from the middle of the lane: {worst} m");
        assert!(disturbed > 60, "{disturbed}");
        assert!(stops > 1 && s > 1000.0, "{stops} stops in {s} m");
    }
}
