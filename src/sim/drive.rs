//! An episode being driven by the expert, step by step, for whoever looks on.

use crate::{
    error::{Error, Result},
    noise::{Noise, Purpose},
    sim::plan::Episode,
    world::{
        density::Counts,
        episode::{End, Watch},
        expert::{Decision, Expert, ExpertConfig},
        simulation::{SUBSTEPS, World},
        town::{LENGTHS_M, Town},
    },
};

/// A drive that goes on, or is over.
#[derive(Clone, Debug)]
pub struct Drive {
    pub world: World,
    expert: Expert,
    watch: Watch,
    decision: Decision,
    steps: u64,
    end: Option<End>,
}

impl Drive {
    /// The drive before its first step, decided what to do in it. `burst_chance` is that of a
    /// steering burst in each decision.
    ///
    /// # Errors
    ///
    /// [`Error::Config`] if the town has no route of the usual lengths.
    pub fn new(town: &Town, episode: &Episode, burst_chance: f64) -> Result<Drive> {
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
        let world = town.world(route, counts, seed, number);
        let config = ExpertConfig { burst_chance, ..ExpertConfig::default() };
        let mut expert = Expert::new(config, seed, number);
        let decision = expert.decide(&world);
        let watch = Watch::new(&world);
        Ok(Drive { world, expert, watch, decision, steps: 0, end: None })
    }

    /// Steps of the world so far.
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// What the expert has decided for now.
    pub fn decision(&self) -> &Decision {
        &self.decision
    }

    /// Let one step of the world pass, and decide anew where a tenth of a second is over.
    pub fn step(&mut self) {
        self.world.step(self.decision.applied);
        self.steps += 1;
        let is_tenth = self.steps.is_multiple_of(SUBSTEPS);
        if is_tenth || self.world.contact().is_some() {
            self.end = self.watch.look(&self.world);
        }
        if is_tenth && self.end.is_none() {
            self.decision = self.expert.decide(&self.world);
        }
    }

    /// How the drive ended; `None` while it goes on.
    pub fn end(&self) -> Option<&End> {
        self.end.as_ref()
    }

    pub fn is_over(&self) -> bool {
        self.end.is_some()
    }
}
