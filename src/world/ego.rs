//! The ego vehicle: a kinematic bicycle with a slow steering column and two pedals.
//!
//! The ego frame sits on the ground below the middle of the car (CARLA's vehicle frame, with
//! y left as in REP-103). Tyres do not slip, so the rear axle moves where the car points.

use glam::{DAffine3, DQuat, DVec2, DVec3};
use serde::{Deserialize, Serialize};

use crate::{footprint::Footprint, policy::Action};

/// Step of the vehicle model, s.
pub const STEP_S: f64 = 0.01;

/// What is particular to a car.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CarConfig {
    /// Half of the length and width, and height, m.
    pub half_length_m: f64,
    pub half_width_m: f64,
    pub height_m: f64,
    /// From axle to axle; the ego frame is midway between them, m.
    pub wheelbase_m: f64,
    /// Angle of the front wheels at full steering, at rest, rad.
    pub steer_lock_rad: f64,
    /// Share of the lock that is left at a speed: (km/h, share), ascending, straight in between.
    pub steer_curve: [[f64; 2]; 4],
    /// Time constants of the steering column, the engine and the brakes, s.
    pub steer_lag_s: f64,
    pub throttle_lag_s: f64,
    pub brake_lag_s: f64,
    pub mass_kg: f64,
    /// Full throttle at low speed, and full brake, m/s2.
    pub throttle_mps2: f64,
    pub brake_mps2: f64,
    /// What the engine gives at most over the gears, W.
    pub power_w: f64,
    /// Rolling resistance, m/s2, and drag coefficient times frontal area, m2.
    pub rolling_mps2: f64,
    pub drag_area_m2: f64,
}

/// The car of CARLA's examples (`vehicle.*` sedans of 1,850 kg): steering curve, lock, drag and half
/// extents are CARLA's; the power is that of its torque curve (400, 500 and 400 Nm at 0, 1,891 and
/// 5,730 rpm), mean over the upper two, for an automatic gearbox between them.
pub const SEDAN: CarConfig = CarConfig {
    half_length_m: 2.45,
    half_width_m: 0.93,
    height_m: 1.28,
    wheelbase_m: 2.85,
    steer_lock_rad: 70.0 / 180.0 * std::f64::consts::PI,
    steer_curve: [[0.0, 1.0], [20.0, 0.9], [60.0, 0.8], [120.0, 0.7]],
    steer_lag_s: 0.1,
    throttle_lag_s: 0.15,
    brake_lag_s: 0.08,
    mass_kg: 1850.0,
    throttle_mps2: 4.5,
    brake_mps2: 8.0,
    power_w: 450.0 * (1891.0 + 5730.0) / 2.0 * std::f64::consts::TAU / 60.0,
    rolling_mps2: 0.12,
    drag_area_m2: 0.3 * 2.2,
};

/// Air, kg/m3.
const AIR_KGPM3: f64 = 1.2;

impl CarConfig {
    /// Angle of the front wheels for steering in [-1, 1] (positive = right) at a speed, rad,
    /// positive = left.
    pub fn wheel_rad(&self, steer: f64, speed_mps: f64) -> f64 {
        -steer.clamp(-1.0, 1.0) * self.lock_rad(speed_mps)
    }

    /// The steering that turns the front wheels to an angle (positive = left), as far as they go.
    pub fn steer(&self, wheel_rad: f64, speed_mps: f64) -> f64 {
        (-wheel_rad / self.lock_rad(speed_mps)).clamp(-1.0, 1.0)
    }

    fn lock_rad(&self, speed_mps: f64) -> f64 {
        let kmph = speed_mps * 3.6;
        let curve = &self.steer_curve;
        let above = curve.partition_point(|point| point[0] <= kmph).clamp(1, curve.len() - 1);
        let ([x0, y0], [x1, y1]) = (curve[above - 1], curve[above]);
        let share = y0 + (y1 - y0) * ((kmph - x0) / (x1 - x0)).clamp(0.0, 1.0);
        self.steer_lock_rad * share
    }

    /// The pedals (throttle, brake) that give an acceleration at a speed, as far as the car can.
    pub fn pedals(&self, acceleration_mps2: f64, speed_mps: f64) -> (f32, f32) {
        let force = acceleration_mps2 + self.drag_mps2(speed_mps.max(0.1));
        if force >= 0.0 {
            ((force / self.full_throttle_mps2(speed_mps)).min(1.0) as f32, 0.0)
        } else {
            (0.0, (-force / self.brake_mps2).min(1.0) as f32)
        }
    }

    fn full_throttle_mps2(&self, speed_mps: f64) -> f64 {
        self.throttle_mps2.min(self.power_w / self.mass_kg / speed_mps.max(1.0))
    }

    fn drag_mps2(&self, speed_mps: f64) -> f64 {
        let air = 0.5 * AIR_KGPM3 * self.drag_area_m2 / self.mass_kg;
        if speed_mps > 0.0 { self.rolling_mps2 + air * speed_mps * speed_mps } else { 0.0 }
    }

    /// From the ego frame back to the rear axle, m.
    fn rear_axle_m(&self) -> f64 {
        self.wheelbase_m / 2.0
    }
}

/// Where the car is and how it moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Car {
    pub config: CarConfig,
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
    /// Pedals as they work by now, in [0, 1].
    pub throttle: f64,
    pub brake: f64,
}

impl Default for Car {
    fn default() -> Car {
        Car::at_rest(SEDAN, DVec2::ZERO, 0.0)
    }
}

impl Car {
    /// A car that stands.
    pub fn at_rest(config: CarConfig, position_m: DVec2, yaw_rad: f64) -> Car {
        Car {
            config,
            position_m,
            yaw_rad,
            speed_mps: 0.0,
            steer_rad: 0.0,
            acceleration_mps2: 0.0,
            throttle: 0.0,
            brake: 0.0,
        }
    }

    /// The state one [`STEP_S`] later.
    pub fn step(&self, action: Action) -> Self {
        let config = &self.config;
        let towards =
            |now: f64, wanted: f64, lag_s: f64| wanted + (now - wanted) * (-STEP_S / lag_s).exp();
        let wanted_rad = config.wheel_rad(f64::from(action.steer), self.speed_mps);
        let steer_rad = towards(self.steer_rad, wanted_rad, config.steer_lag_s);
        let pedal = |value: f32| f64::from(value.clamp(0.0, 1.0));
        let throttle = towards(self.throttle, pedal(action.throttle), config.throttle_lag_s);
        let brake = towards(self.brake, pedal(action.brake), config.brake_lag_s);
        let push = throttle * config.full_throttle_mps2(self.speed_mps);
        let hold = brake * config.brake_mps2 + config.drag_mps2(self.speed_mps);
        // Brakes and drag stop the car, they do not push it back.
        let speed_mps = (self.speed_mps + (push - hold) * STEP_S).max(0.0);
        let mean_mps = (self.speed_mps + speed_mps) / 2.0;

        // The rear axle follows an arc: its chord points along the middle of both headings.
        let turn_rad = mean_mps * steer_rad.tan() / config.wheelbase_m * STEP_S;
        let half = turn_rad / 2.0;
        let shortening = if half.abs() < 1e-9 { 1.0 } else { half.sin() / half };
        let chord = mean_mps * STEP_S * shortening * DVec2::from_angle(self.yaw_rad + half);
        let yaw_rad = self.yaw_rad + turn_rad;
        let axle_m = self.rear_axle_m() + chord;
        Car {
            config: *config,
            position_m: axle_m + config.rear_axle_m() * DVec2::from_angle(yaw_rad),
            yaw_rad,
            speed_mps,
            steer_rad,
            acceleration_mps2: (speed_mps - self.speed_mps) / STEP_S,
            throttle,
            brake,
        }
    }

    /// Rate of turn, rad/s, positive = left.
    pub fn yaw_rate_radps(&self) -> f64 {
        self.speed_mps * self.steer_rad.tan() / self.config.wheelbase_m
    }

    /// Velocity of the ego frame's origin, in the ego frame, m/s.
    pub fn velocity_ego_mps(&self) -> DVec2 {
        DVec2::new(self.speed_mps, self.config.rear_axle_m() * self.yaw_rate_radps())
    }

    /// Velocity of the ego frame's origin, in the world frame, m/s.
    pub fn velocity_world_mps(&self) -> DVec2 {
        DVec2::from_angle(self.yaw_rad).rotate(self.velocity_ego_mps())
    }

    /// The middle of the rear axle in the world frame, m.
    pub fn rear_axle_m(&self) -> DVec2 {
        self.position_m - self.config.rear_axle_m() * DVec2::from_angle(self.yaw_rad)
    }

    /// The ego frame in the world, on ground of a height, m.
    pub fn world_from_ego(&self, ground_m: f64) -> DAffine3 {
        DAffine3::from_rotation_translation(self.orientation(), self.position_m.extend(ground_m))
    }

    /// Of the ego frame in the world frame.
    pub fn orientation(&self) -> DQuat {
        DQuat::from_axis_angle(DVec3::Z, self.yaw_rad)
    }

    /// What it covers of the ground.
    pub fn footprint(&self) -> Footprint {
        let half_m = DVec2::new(self.config.half_length_m, self.config.half_width_m);
        Footprint::new(self.position_m, self.yaw_rad, half_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_held_wheel_draws_the_circle_of_the_bicycle_in_closed_form() {
        let action = Action { steer: -0.2, throttle: 0.0, brake: 0.0 };
        let config = CarConfig { steer_curve: SEDAN.steer_curve.map(|[at, _]| [at, 1.0]), ..SEDAN };
        let steer_rad = config.wheel_rad(-0.2_f32 as f64, 8.0);
        let start = Car { config, speed_mps: 8.0, steer_rad, ..Car::default() };
        let radius_m = SEDAN.wheelbase_m / steer_rad.tan();
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
        let mut state = Car { speed_mps: 6.0, ..Car::default() };
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
            let (throttle, brake) = SEDAN.pedals(wanted, speed_mps);
            let settled = (f64::from(throttle), f64::from(brake));
            let state = Car { speed_mps, throttle: settled.0, brake: settled.1, ..Car::default() };
            let got = state.step(Action { steer: 0.0, throttle, brake }).acceleration_mps2;
            assert!((got - wanted).abs() < 1e-5, "{wanted} {got}");
        }
    }

    #[test]
    fn the_wheels_turn_less_the_faster_the_car_is() {
        let at = |kmph: f64| -SEDAN.wheel_rad(1.0, kmph / 3.6).to_degrees();
        for (kmph, degrees) in
            [(0.0, 70.0), (10.0, 66.5), (20.0, 63.0), (60.0, 56.0), (150.0, 49.0)]
        {
            assert!((at(kmph) - degrees).abs() < 1e-9, "{kmph} km/h: {}", at(kmph));
        }
        assert!((SEDAN.steer(SEDAN.wheel_rad(-0.3, 12.0), 12.0) + 0.3).abs() < 1e-12);
    }

    #[test]
    fn from_rest_to_100_kmph_takes_the_time_of_such_a_car() {
        let mut state = Car::default();
        let mut steps = 0;
        while state.speed_mps < 100.0 / 3.6 {
            state = state.step(Action { steer: 0.0, throttle: 1.0, brake: 0.0 });
            steps += 1;
        }
        let seconds = f64::from(steps) * STEP_S;
        assert!((6.0..9.0).contains(&seconds), "{seconds}");
    }

    #[test]
    fn the_brake_holds_a_standing_car() {
        let state = Car::default();
        let next = state.step(Action { steer: 0.0, throttle: 0.0, brake: 1.0 });
        assert_eq!(next.position_m, state.position_m);
    }
}
