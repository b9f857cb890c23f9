//! Who drives in the closed loop: a policy with a controller, or somebody who knows the world.

use crate::{
    control::driver::{self, ControlConfig, Driver},
    control::fusion::Fusion,
    error::Result,
    frame::{Frame, signed_speed_mps},
    policy::{Action, Plan, Policy, Senses},
    sim::plan::Episode,
    world::{
        expert::{Expert, ExpertConfig},
        simulation::World,
        traffic::STEP_S,
    },
};

/// Drives one episode after the other; asked every 0.1 s.
pub trait Pilot {
    /// What has to be sensed for it.
    fn senses(&self) -> Senses;

    /// Forget everything: an episode begins.
    fn begin(&mut self, episode: &Episode);

    /// What to do now. A policy decides by the frame alone.
    ///
    /// # Errors
    ///
    /// As [`Policy::plan`].
    fn act(&mut self, world: &World, frame: &Frame) -> Result<Act>;
}

/// What a pilot does, and why.
#[derive(Clone, Debug)]
pub struct Act {
    pub action: Action,
    /// What it had in mind, of a pilot that plans.
    pub plan: Plan,
    /// How the plan became the action.
    pub decision: Option<driver::Decision>,
}

/// A policy at the wheel.
pub struct PolicyPilot {
    policy: Box<dyn Policy>,
    driver: Driver,
}

impl PolicyPilot {
    pub fn new(policy: Box<dyn Policy>, config: ControlConfig, fusion: Fusion) -> PolicyPilot {
        PolicyPilot { policy, driver: Driver::new(config, fusion, STEP_S) }
    }
}

impl Pilot for PolicyPilot {
    fn senses(&self) -> Senses {
        self.policy.senses()
    }

    fn begin(&mut self, _: &Episode) {
        self.policy.reset();
        self.driver.reset();
    }

    fn act(&mut self, _: &World, frame: &Frame) -> Result<Act> {
        let plan = self.policy.plan(frame)?;
        let decision = self.driver.decide(&plan, signed_speed_mps(frame.velocity_mps));
        Ok(Act { action: decision.action, plan, decision: Some(decision) })
    }
}

/// The expert, who sees the state of the world.
pub struct ExpertPilot(Expert);

impl Default for ExpertPilot {
    fn default() -> ExpertPilot {
        ExpertPilot(Expert::new(ExpertConfig::default(), 0, 0))
    }
}

impl Pilot for ExpertPilot {
    fn senses(&self) -> Senses {
        Senses::NONE
    }

    fn begin(&mut self, episode: &Episode) {
        self.0 = Expert::new(ExpertConfig::default(), episode.seed, episode.number);
    }

    fn act(&mut self, world: &World, _: &Frame) -> Result<Act> {
        let action = self.0.decide(world).applied;
        Ok(Act { action, plan: Plan::default(), decision: None })
    }
}
