//! Policies that learn nothing: what a trained one has to beat, and what it cannot.

use crate::{
    error::Result,
    frame::{FUTURE_STEPS, Frame, signed_speed_mps},
    policy::{Action, Mode, Plan, Policy, Senses},
};

/// Names that [`baseline`] knows.
pub const NAMES: [&str; 3] = ["constant-velocity", "stand-still", "recorded"];

/// The baseline that every report compares with.
pub const REFERENCE: &str = "constant-velocity";

/// The baseline of that name.
pub fn baseline(name: &str) -> Option<Box<dyn Policy>> {
    match name {
        "constant-velocity" => Some(Box::new(ConstantVelocity)),
        "stand-still" => Some(Box::new(StandStill)),
        "recorded" => Some(Box::new(Recorded)),
        _ => None,
    }
}

/// Keeps speed and heading for 3 s, and says nothing about pedals: which ones keep a speed
/// depends on the car, so its action errors stay empty rather than invented.
struct ConstantVelocity;

impl Policy for ConstantVelocity {
    fn name(&self) -> &str {
        "constant-velocity"
    }

    fn reset(&mut self) {}

    fn senses(&self) -> Senses {
        Senses::NONE
    }

    fn plan(&mut self, frame: &Frame) -> Result<Plan> {
        let speed_mps = signed_speed_mps(frame.velocity_mps);
        let motion = vec![certain([speed_mps; FUTURE_STEPS], [0.0; FUTURE_STEPS])];
        Ok(Plan { motion, ..Plan::default() })
    }
}

/// Zero speed from the next step on, and the full brake that goes with it, so that in a closed
/// loop it stands. No car stops within 0.1 s: the plan is the lower bound of speed, not a
/// manoeuvre.
struct StandStill;

impl Policy for StandStill {
    fn name(&self) -> &str {
        "stand-still"
    }

    fn reset(&mut self) {}

    fn senses(&self) -> Senses {
        Senses::NONE
    }

    fn plan(&mut self, _: &Frame) -> Result<Plan> {
        let action = Action { steer: 0.0, throttle: 0.0, brake: 1.0 };
        let motion = vec![certain([0.0; FUTURE_STEPS], [0.0; FUTURE_STEPS])];
        Ok(Plan { action: Some(action), motion, ..Plan::default() })
    }
}

/// Repeats what the recorded driver did: the floor of every metric, not a driver.
///
/// Its speed and yaw are exact, so its displacement is not 0 but what integrating speed and yaw
/// at 10 Hz loses against the recorded positions (side slip, acceleration within a step, noise
/// of the positions): the least that any plan in speed and yaw can reach on these data.
struct Recorded;

impl Policy for Recorded {
    fn name(&self) -> &str {
        "recorded"
    }

    fn reset(&mut self) {}

    fn senses(&self) -> Senses {
        Senses::NONE
    }

    fn plan(&mut self, frame: &Frame) -> Result<Plan> {
        let recorded = frame.action;
        let known = [recorded.steer, recorded.throttle, recorded.brake];
        let action = known.iter().any(Option::is_some).then(|| Action {
            steer: recorded.steer.unwrap_or_default(),
            throttle: recorded.throttle.unwrap_or_default(),
            brake: recorded.brake.unwrap_or_default(),
        });
        // A plan always spans 3 s. Past the recording the last known value is held, and no
        // metric looks there; with nothing recorded there is no plan.
        let Some(last) = usize::from(frame.future.len).checked_sub(1) else {
            return Ok(Plan { action, ..Plan::default() });
        };
        let held = |values: &[f32; FUTURE_STEPS]| std::array::from_fn(|i| values[i.min(last)]);
        let motion = vec![certain(held(&frame.future.speed_mps), held(&frame.future.yaw_rad))];
        Ok(Plan { action, motion, ..Plan::default() })
    }

    fn sees_the_future(&self) -> bool {
        true
    }
}

/// The only mode of a policy that claims no deviations.
fn certain(speed_mps: [f32; FUTURE_STEPS], yaw_rad: [f32; FUTURE_STEPS]) -> Mode {
    Mode { weight: 1.0, speed_mps, yaw_rad, std: None }
}
