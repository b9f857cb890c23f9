//! A plan that is known to be right, for the controller to follow: what it fails at, the controller
//! fails at.

use glam::DVec2;

use crate::{
    closed_loop::pilot::{Act, Pilot},
    control::{
        driver::{ControlConfig, Driver},
        fusion::Fusion,
    },
    dataset::ego::wrap_angle,
    error::Result,
    frame::{FUTURE_STEP_S, FUTURE_STEPS, Frame},
    policy::{Mode, Plan, Senses},
    sim::plan::Episode,
    world::{ego::Car, expert::ExpertConfig, route::Route, simulation::World, traffic::STEP_S},
};

/// The plan heads for a place this far ahead on the route, m.
const AIM_M: f64 = 3.0;

/// Bends of the plan are no tighter than this, m.
const TIGHTEST_M: f64 = 4.0;

/// Change of speed in the plan, m/s2: what the expert drives with, and brakes with where it has to.
const ACCELERATION_MPS2: f64 = 2.0;
const BRAKING_MPS2: f64 = 3.0;

/// Follows the true route at the expert's speeds, through a controller; blind to everybody else.
pub struct OraclePilot {
    driver: Driver,
}

impl OraclePilot {
    pub fn new(config: ControlConfig) -> OraclePilot {
        OraclePilot { driver: Driver::new(config, Fusion::A2, STEP_S) }
    }
}

impl Pilot for OraclePilot {
    fn senses(&self) -> Senses {
        Senses::NONE
    }

    fn begin(&mut self, _: &Episode) {
        self.driver.reset();
    }

    fn act(&mut self, world: &World, _: &Frame) -> Result<Act> {
        let ego = world.ego();
        let mode = along(&world.route, world.progress_m(), ego);
        let plan = Plan { motion: vec![mode], ..Plan::default() };
        let decision = self.driver.decide(&plan, ego.speed_mps as f32);
        Ok(Act { action: decision.action, plan, decision: Some(decision) })
    }
}

/// The next 3 s of a car that keeps to a route at the expert's speeds.
fn along(route: &Route, at_m: f64, ego: &Car) -> Mode {
    let expert = ExpertConfig::default();
    let (mut at_m, mut speed_mps) = (at_m, ego.speed_mps);
    let (mut place_m, mut yaw_rad) = (ego.position_m, ego.yaw_rad);
    let (mut speeds_mps, mut yaws_rad) = ([0.0; FUTURE_STEPS], [0.0; FUTURE_STEPS]);
    for (speed, yaw) in speeds_mps.iter_mut().zip(&mut yaws_rad) {
        let wanted_mps2 = (expert.wish_mps(route, at_m) - speed_mps) / FUTURE_STEP_S;
        let next_mps =
            speed_mps + wanted_mps2.clamp(-BRAKING_MPS2, ACCELERATION_MPS2) * FUTURE_STEP_S;
        let step_m = (speed_mps + next_mps) / 2.0 * FUTURE_STEP_S;
        let aim_m = at_m + AIM_M;
        let beyond_m = (aim_m - route.length_m()).max(0.0);
        let aim = route.at(aim_m).position_m + route.forward(aim_m) * beyond_m;
        let sharpest_rad = step_m / TIGHTEST_M;
        let turn_rad = wrap_angle((aim - place_m).to_angle() - yaw_rad);
        let next_rad = yaw_rad + turn_rad.clamp(-sharpest_rad, sharpest_rad);
        place_m += DVec2::from_angle((yaw_rad + next_rad) / 2.0) * step_m;
        (at_m, speed_mps, yaw_rad) = (at_m + step_m, next_mps, next_rad);
        (*speed, *yaw) = (speed_mps as f32, wrap_angle(yaw_rad - ego.yaw_rad) as f32);
    }
    Mode { weight: 1.0, speed_mps: speeds_mps, yaw_rad: yaws_rad, std: None }
}
