//! An episode being driven, step by step, for whoever looks on.

use crate::{
    error::{Error, Result},
    noise::{Noise, Purpose},
    sim::plan::Episode,
    world::{
        density::Counts,
        episode::{End, Rules, Watch},
        expert::{Decision, Expert, ExpertConfig},
        simulation::{SUBSTEPS, World},
        town::{LENGTHS_M, Town},
    },
};

/// A drive that goes on, or is over. Whoever drives decides every 0.1 s.
#[derive(Clone, Debug)]
pub struct Drive {
    pub world: World,
    watch: Watch,
    decision: Decision,
    is_due: bool,
    steps: u64,
    end: Option<End>,
}

impl Drive {
    /// The drive before its first step, with nothing decided.
    pub fn new(world: World, rules: Rules) -> Drive {
        let watch = Watch::new(&world, rules);
        Drive { world, watch, decision: Decision::default(), is_due: true, steps: 0, end: None }
    }

    /// Steps of the world so far.
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// Whether to decide anew, before the next step.
    pub fn is_due(&self) -> bool {
        self.is_due
    }

    /// Decide for the next 0.1 s.
    pub fn decide(&mut self, decision: Decision) {
        self.decision = decision;
        self.is_due = false;
    }

    /// What is decided for now.
    pub fn decision(&self) -> &Decision {
        &self.decision
    }

    /// Let one step of the world pass.
    pub fn step(&mut self) {
        self.world.step(self.decision.applied);
        self.steps += 1;
        let is_tenth = self.steps.is_multiple_of(SUBSTEPS);
        if is_tenth || self.world.contact().is_some() {
            self.end = self.watch.look(&self.world);
        }
        self.is_due = is_tenth && self.end.is_none();
    }

    /// Who counts, and says when it is over.
    pub fn watch(&self) -> &Watch {
        &self.watch
    }

    /// How the drive ended; `None` while it goes on.
    pub fn end(&self) -> Option<&End> {
        self.end.as_ref()
    }

    pub fn is_over(&self) -> bool {
        self.end.is_some()
    }
}

/// A drive of the expert.
#[derive(Clone, Debug)]
pub struct Demonstration {
    pub drive: Drive,
    expert: Expert,
}

impl Demonstration {
    /// The drive before its first step, decided what to do in it. `burst_chance` is that of a
    /// steering burst in each decision.
    ///
    /// # Errors
    ///
    /// [`Error::Config`] if the town has no route of the usual lengths.
    pub fn new(town: &Town, episode: &Episode, burst_chance: f64) -> Result<Demonstration> {
        let Episode { seed, number, .. } = *episode;
        let route = town.route(seed, number, LENGTHS_M).ok_or_else(|| Error::Config {
            key: "--town".into(),
            what: format!(
                "{} has no route of {} to {} m",
                town.name, LENGTHS_M.start, LENGTHS_M.end
            ),
            hint: Some("leave the town out with --town".into()),
        })?;
        let counts: Counts = episode.traffic.draw(&mut Noise::new(seed, number, Purpose::Scenery));
        let config = ExpertConfig { burst_chance, ..ExpertConfig::default() };
        let drive = Drive::new(town.world(route, counts, seed, number), Rules::default());
        let mut demonstration = Demonstration { drive, expert: Expert::new(config, seed, number) };
        demonstration.decide();
        Ok(demonstration)
    }

    /// Let one step of the world pass, and decide anew where a tenth of a second is over.
    pub fn step(&mut self) {
        self.drive.step();
        if self.drive.is_due() {
            self.decide();
        }
    }

    fn decide(&mut self) {
        self.drive.decide(self.expert.decide(&self.drive.world));
    }
}
