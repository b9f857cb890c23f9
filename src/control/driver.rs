//! From plan to action, moment after moment.

use serde::{Deserialize, Serialize};

use crate::{
    control::{
        fusion::{Fusion, fuse, variance},
        pid::{Pid, PidConfig},
        target::{STANDS_M, Target},
    },
    policy::{Action, Plan},
};

/// Gains and limits, for one kind of vehicle.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct ControlConfig {
    /// From the target's bearing, rad, to steering.
    pub lateral: PidConfig,
    /// From the lack of speed, m/s, to pedals: throttle above 0, brake below.
    pub longitudinal: PidConfig,
    /// Where the target lies on the planned way, m.
    pub ahead_m: f64,
    pub max_throttle: f64,
    /// A target slower than this is to stop, m/s: the brake is pressed down.
    pub stop_mps: f64,
    /// Brakes below this are none, and a throttle above the brake takes it away (CIL's agent).
    pub min_brake: f64,
}

impl Default for ControlConfig {
    /// Gains of the paper's table III; units and windows are those with which a perfect plan
    /// drives.
    fn default() -> Self {
        Self {
            lateral: PidConfig { p: 0.70, i: 0.0, d: 0.0, window: 10 },
            longitudinal: PidConfig { p: 0.25, i: 0.20, d: 0.0, window: 10 },
            ahead_m: 5.0,
            max_throttle: 0.75,
            stop_mps: 0.4,
            min_brake: 0.1,
        }
    }
}

/// What was decided, and why.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Decision {
    /// What to do.
    pub action: Action,
    /// The direct action, of a policy that has one.
    pub a1: Option<Action>,
    /// The action that follows the plan, of a policy that plans.
    pub a2: Option<Action>,
    pub target: Option<Target>,
    /// S of eq. (3), of a plan with standard deviations.
    pub variance: Option<f64>,
    /// Share of a2.
    pub lambda: f64,
}

/// Drives by plans.
#[derive(Clone, Debug)]
pub struct Driver {
    config: ControlConfig,
    fusion: Fusion,
    lateral: Pid,
    longitudinal: Pid,
}

impl Driver {
    /// A driver that is given a plan every `step_s` seconds.
    pub fn new(config: ControlConfig, fusion: Fusion, step_s: f64) -> Self {
        let [lateral, longitudinal] =
            [config.lateral, config.longitudinal].map(|pid| Pid::new(pid, step_s));
        Self { config, fusion, lateral, longitudinal }
    }

    /// Forget the drive so far.
    pub fn reset(&mut self) {
        self.lateral.reset();
        self.longitudinal.reset();
    }

    /// What to do about a plan at a speed. A policy that says only one of a1 and a plan is driven by
    /// that; one that says nothing stops.
    pub fn decide(&mut self, plan: &Plan, speed_mps: f32) -> Decision {
        let mode = plan.strongest();
        let target = mode.map(|mode| Target::of(mode, speed_mps, self.config.ahead_m));
        let a2 = target.map(|target| self.follow(&target, speed_mps));
        let std = mode.and_then(|mode| mode.std.as_ref());
        let variance = std.zip(target).map(|(std, target)| variance(std, target.step));
        let (action, lambda) = match (plan.action, a2) {
            (Some(a1), Some(a2)) => {
                let lambda = self.fusion.lambda(variance);
                (fuse(a1, a2, lambda), lambda)
            }
            (Some(a1), None) => (a1, 0.0),
            (None, Some(a2)) => (a2, 1.0),
            (None, None) => (Action { brake: 1.0, ..Action::default() }, 0.0),
        };
        let action = self.one_pedal(action);
        Decision { action, a1: plan.action, a2, target, variance, lambda }
    }

    /// a2: steer to the target, and reach its speed.
    fn follow(&mut self, target: &Target, speed_mps: f32) -> Action {
        let config = &self.config;
        let steer = -self.lateral.step(target.bearing_rad); // positive is right, bearings are left
        let pedals = self.longitudinal.step(target.speed_mps - f64::from(speed_mps));
        let stops = target.speed_mps < config.stop_mps || target.path_m < STANDS_M;
        let (throttle, brake) = match pedals {
            _ if stops => (0.0, 1.0),
            pedals if pedals > 0.0 => (pedals.min(config.max_throttle), 0.0),
            pedals => (0.0, (-pedals).min(1.0)),
        };
        Action {
            steer: steer.clamp(-1.0, 1.0) as f32,
            throttle: throttle as f32,
            brake: brake as f32,
        }
    }

    /// Never both pedals, and no brushing of the brake.
    fn one_pedal(&self, action: Action) -> Action {
        let faint = f64::from(action.brake) < self.config.min_brake;
        match faint || action.throttle > action.brake {
            true => Action { brake: 0.0, ..action },
            false => Action { throttle: 0.0, ..action },
        }
    }
}
