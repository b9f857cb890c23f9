//! The ego vehicle: a kinematic bicycle with a slow steering column and two pedals.
//!
//! The ego frame sits on the ground below the middle of the car (CARLA's vehicle frame, with
//! y left as in REP-103). Tyres do not slip, so the rear axle moves where the car points.

use glam::{DAffine3, DQuat, DVec2, DVec3};

use crate::policy::Action;

/// Step of the vehicle model, s.
pub const STEP_S: f64 = 0.01;

/// The car of CARLA's examples: distance between the axles, and how far the wheels turn.
pub const WHEELBASE_M: f64 = 2.89;
pub const STEER_LOCK_RAD: f64 = 70.0 / 180.0 * std::f64::consts::PI;

/// From the ego frame back to the rear axle, m.
pub const REAR_AXLE_M: f64 = WHEELBASE_M / 2.0;

/// Half of the car's length and width, m.
pub const HALF_LENGTH_M: f64 = 2.45;
pub const HALF_WIDTH_M: f64 = 0.93;

/// Time constant of the steering, s.
const STEER_LAG_S: f64 = 0.1;

/// Full throttle at low speed and full brake, m/s2.
const THROTTLE_MPS2: f64 = 4.5;
const BRAKE_MPS2: f64 = 8.0;

/// Engine power per mass, W/kg: limits the throttle at speed (60 kW, 1850 kg).
const POWER_W_PER_KG: f64 = 60e3 / 1850.0;

/// Rolling resistance, m/s2, and air drag, 1/m (0.5 rho cd A / m for cd 0.3, 2.2 m2).
const ROLLING_MPS2: f64 = 0.12;
const AIR_DRAG_PER_M: f64 = 0.5 * 1.2 * 0.3 * 2.2 / 1850.0;

/// Where the car is and how it moves.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct VehicleState {
    /// Of the ego frame in the world frame, m.
    pub position_m: DVec2,
    /// Of the ego frame in the world frame, rad, not wrapped.
    pub yaw_rad: f64,
    /// Along the car, m/s; never negative.
    pub speed_mps: f64,
    /// Angle of the front wheels, rad, positive = left.
    pub steer_rad: f64,
    /// Change of `speed_mps` over the last step, m/s2.
    pub acceleration_mps2: f64,
}

impl VehicleState {
    /// The state one [`STEP_S`] later.
    pub fn step(&self, action: Action) -> Self {
        let wanted_rad = -f64::from(action.steer.clamp(-1.0, 1.0)) * STEER_LOCK_RAD;
        let steer_rad = wanted_rad + (self.steer_rad - wanted_rad) * (-STEP_S / STEER_LAG_S).exp();
        let push = f64::from(action.throttle.clamp(0.0, 1.0)) * full_throttle_mps2(self.speed_mps);
        let hold = f64::from(action.brake.clamp(0.0, 1.0)) * BRAKE_MPS2 + drag_mps2(self.speed_mps);
        // Brakes and drag stop the car, they do not push it back.
        let speed_mps = (self.speed_mps + (push - hold) * STEP_S).max(0.0);
        let mean_mps = (self.speed_mps + speed_mps) / 2.0;

        // The rear axle follows an arc: its chord points along the middle of both headings.
        let turn_rad = mean_mps * steer_rad.tan() / WHEELBASE_M * STEP_S;
        let half = turn_rad / 2.0;
        let shortening = if half.abs() < 1e-9 { 1.0 } else { half.sin() / half };
        let chord = mean_mps * STEP_S * shortening * DVec2::from_angle(self.yaw_rad + half);
        let yaw_rad = self.yaw_rad + turn_rad;
        let axle_m = self.rear_axle_m() + chord;
        VehicleState {
            position_m: axle_m + REAR_AXLE_M * DVec2::from_angle(yaw_rad),
            yaw_rad,
            speed_mps,
            steer_rad,
            acceleration_mps2: (speed_mps - self.speed_mps) / STEP_S,
        }
    }

    /// Rate of turn, rad/s, positive = left.
    pub fn yaw_rate_radps(&self) -> f64 {
        self.speed_mps * self.steer_rad.tan() / WHEELBASE_M
    }

    /// Velocity of the ego frame's origin, in the ego frame, m/s.
    pub fn velocity_ego_mps(&self) -> DVec2 {
        DVec2::new(self.speed_mps, REAR_AXLE_M * self.yaw_rate_radps())
    }

    /// Velocity of the ego frame's origin, in the world frame, m/s.
    pub fn velocity_world_mps(&self) -> DVec2 {
        DVec2::from_angle(self.yaw_rad).rotate(self.velocity_ego_mps())
    }

    /// The middle of the rear axle in the world frame, m.
    pub fn rear_axle_m(&self) -> DVec2 {
        self.position_m - REAR_AXLE_M * DVec2::from_angle(self.yaw_rad)
    }

    pub fn world_from_ego(&self) -> DAffine3 {
        DAffine3::from_rotation_translation(self.orientation(), self.position_m.extend(0.0))
    }

    /// Of the ego frame in the world frame.
    pub fn orientation(&self) -> DQuat {
        DQuat::from_axis_angle(DVec3::Z, self.yaw_rad)
    }
}

/// The pedals that give an acceleration at a speed, as far as the car can.
pub fn pedals(acceleration_mps2: f64, speed_mps: f64) -> (f32, f32) {
    let force = acceleration_mps2 + drag_mps2(speed_mps.max(0.1));
    if force >= 0.0 {
        ((force / full_throttle_mps2(speed_mps)).min(1.0) as f32, 0.0)
    } else {
        (0.0, (-force / BRAKE_MPS2).min(1.0) as f32)
    }
}

fn full_throttle_mps2(speed_mps: f64) -> f64 {
    THROTTLE_MPS2.min(POWER_W_PER_KG / speed_mps.max(1.0))
}

fn drag_mps2(speed_mps: f64) -> f64 {
    if speed_mps > 0.0 { ROLLING_MPS2 + AIR_DRAG_PER_M * speed_mps * speed_mps } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_held_wheel_draws_the_circle_of_the_bicycle_in_closed_form() {
        let action = Action { steer: -0.2, throttle: 0.0, brake: 0.0 };
        let steer_rad = 0.2_f32 as f64 * STEER_LOCK_RAD;
        let start = VehicleState { speed_mps: 8.0, steer_rad, ..VehicleState::default() };
        let radius_m = WHEELBASE_M / steer_rad.tan();
        let centre_m = start.rear_axle_m() + DVec2::new(0.0, radius_m);
        let mut state = start;
        let mut driven_m = 0.0;
        for _ in 0..500 {
            let next = state.step(action);
            driven_m += (state.speed_mps + next.speed_mps) / 2.0 * STEP_S;
            state = next;
        }
        assert!((state.rear_axle_m().distance(centre_m) - radius_m).abs() < 1e-9);
        assert!((state.yaw_rad - driven_m / radius_m).abs() < 1e-9);
        assert!(state.speed_mps < 8.0, "drag slows a coasting car");
    }

    #[test]
    fn velocity_of_the_ego_frame_is_the_change_of_its_position() {
        let action = Action { steer: 0.3, throttle: 0.4, brake: 0.0 };
        let mut state = VehicleState { speed_mps: 6.0, ..VehicleState::default() };
        for _ in 0..100 {
            state = state.step(action);
        }
        let next = state.step(action);
        let world = (next.position_m - state.position_m) / STEP_S;
        let said = state.velocity_world_mps();
        assert!(world.distance(said) < 0.05, "{world} {said}");
        assert!(next.yaw_rad < state.yaw_rad, "positive steer turns right");
    }

    #[test]
    fn pedals_give_the_acceleration_that_was_asked_for() {
        for wanted in [-6.0, -1.0, 0.0, 1.5] {
            let speed_mps = 9.0;
            let (throttle, brake) = pedals(wanted, speed_mps);
            let state = VehicleState { speed_mps, ..VehicleState::default() };
            let got = state.step(Action { steer: 0.0, throttle, brake }).acceleration_mps2;
            assert!((got - wanted).abs() < 1e-5, "{wanted} {got}");
        }
    }

    #[test]
    fn the_brake_holds_a_standing_car() {
        let state = VehicleState::default();
        let next = state.step(Action { steer: 0.0, throttle: 0.0, brake: 1.0 });
        assert_eq!(next.position_m, state.position_m);
    }
}
