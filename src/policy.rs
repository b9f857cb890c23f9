//! The policy: what drives, whatever it is made of.
//!
//! Second waist of the toolkit: a trained run, an expert, a baseline and a recorded human are
//! all a [`Policy`], and both evaluations take any of them.

use crate::{
    error::Result,
    frame::{FUTURE_STEP_S, FUTURE_STEPS, Frame},
};

/// Steering and pedals, as CARLA's vehicle control takes them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Action {
    /// In [-1, 1], positive = right.
    pub steer: f32,
    /// In [0, 1].
    pub throttle: f32,
    /// In [0, 1].
    pub brake: f32,
}

impl Action {
    /// Why it is none, if it is none.
    pub fn fault(&self) -> Option<&'static str> {
        let is_finite = [self.steer, self.throttle, self.brake].iter().all(|v| v.is_finite());
        (!is_finite).then_some("planned an action that is not finite")
    }
}

/// One manoeuvre over the next 3 s: independent normals per step for speed and yaw change.
#[derive(Clone, Debug, PartialEq)]
pub struct Mode {
    /// Probability of this mode.
    pub weight: f32,
    /// Means: speed in m/s.
    pub speed_mps: [f32; FUTURE_STEPS],
    /// Means: yaw change from now, rad.
    pub yaw_rad: [f32; FUTURE_STEPS],
    /// Standard deviations of speed (m/s) and yaw (rad); `None` for a policy that claims none.
    pub std: Option<ModeStd>,
}

/// Standard deviations of a [`Mode`].
#[derive(Clone, Debug, PartialEq)]
pub struct ModeStd {
    pub speed_mps: [f32; FUTURE_STEPS],
    pub yaw_rad: [f32; FUTURE_STEPS],
}

/// What a policy wants. Either part may be absent: a baseline may plan motion and no action.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Plan {
    /// The direct action (a1 of the paper).
    pub action: Option<Action>,
    /// The planned motion: modes of a mixture, weights summing to 1; empty if none is planned.
    pub motion: Vec<Mode>,
    /// Names of the branches that a policy looks through, and the share that each has in what it
    /// does, summing to 1; empty of a policy that has none (`a` of the paper's eq. (2)).
    pub attention: Vec<(&'static str, f32)>,
}

impl Plan {
    /// The mode of the highest weight, the first of equals.
    pub fn strongest(&self) -> Option<&Mode> {
        self.motion.iter().reduce(|best, mode| if mode.weight > best.weight { mode } else { best })
    }

    /// Why a plan is none, if it is none. A value that is not finite would spread into every mean,
    /// and leaving its frame out would flatter the policy.
    pub fn fault(&self) -> Option<&'static str> {
        let finite = |mode: &Mode| {
            mode.weight.is_finite()
                && mode.speed_mps.iter().chain(&mode.yaw_rad).all(|value| value.is_finite())
        };
        let positive = |mode: &Mode| {
            mode.std.as_ref().is_none_or(|std| {
                std.speed_mps
                    .iter()
                    .chain(&std.yaw_rad)
                    .all(|value| value.is_normal() && *value > 0.0)
            })
        };
        let action = self.action.unwrap_or_default();
        let weights: f32 = self.motion.iter().map(|mode| mode.weight).sum();
        if let Some(fault) = action.fault() {
            Some(fault)
        } else if !self.motion.iter().all(finite) {
            Some("planned a motion that is not finite")
        } else if !self.motion.iter().all(positive) {
            Some("planned a standard deviation that is not positive and finite")
        } else if self.motion.iter().any(|mode| mode.weight < 0.0)
            || (!self.motion.is_empty() && (weights - 1.0).abs() > 1e-3)
        {
            Some("planned modes whose weights are no probabilities")
        } else {
            None
        }
    }
}

impl Mode {
    /// Positions after each step, metres in the ego frame of now, by integrating the means.
    ///
    /// `speed_now_mps` is the speed at t = 0. Trapezium rule: within a step, speed and heading
    /// are the means of both ends.
    pub fn positions_m(&self, speed_now_mps: f32) -> [[f64; 2]; FUTURE_STEPS] {
        let (mut x, mut y) = (0.0, 0.0);
        let (mut speed, mut yaw) = (f64::from(speed_now_mps), 0.0);
        std::array::from_fn(|i| {
            let (next_speed, next_yaw) = (f64::from(self.speed_mps[i]), f64::from(self.yaw_rad[i]));
            let (v, heading) = ((speed + next_speed) / 2.0, (yaw + next_yaw) / 2.0);
            x += v * heading.cos() * FUTURE_STEP_S;
            y += v * heading.sin() * FUTURE_STEP_S;
            (speed, yaw) = (next_speed, next_yaw);
            [x, y]
        })
    }
}

/// Sensors that a policy looks at. Velocity, route and command are always there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Senses {
    pub camera: bool,
    /// Lidar and radar.
    pub ranging: bool,
}

impl Senses {
    pub const ALL: Senses = Senses { camera: true, ranging: true };
    pub const NONE: Senses = Senses { camera: false, ranging: false };
}

/// Something that drives.
///
/// A policy looks at what the car sensed, its state, its route and its command. It must not look
/// at `action`, `future` or anything else that is only known afterwards, unless
/// [`sees_the_future`](Policy::sees_the_future) says so.
pub trait Policy {
    /// Name in tables.
    fn name(&self) -> &str;

    /// Forget the episode so far.
    fn reset(&mut self);

    /// What to do now.
    ///
    /// # Errors
    ///
    /// If the frame cannot be used: a picture that cannot be decoded, a tensor operation that
    /// fails.
    fn plan(&mut self, frame: &Frame) -> Result<Plan>;

    /// What the policy looks at; the rest of a frame need not be there.
    fn senses(&self) -> Senses {
        Senses::ALL
    }

    /// Whether the policy reads what the recorded driver did next: an oracle, not a driver.
    fn sees_the_future(&self) -> bool {
        false
    }
}
