//! Many drives of the expert, to know that the world can be driven in: who arrives, and why not.

use std::{collections::BTreeMap, fmt, ops::Range};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::{
    noise::{Noise, Purpose},
    world::{
        density::{Counts, Density},
        episode::{End, Outcome, drive},
        expert::{Expert, ExpertConfig},
        town::Town,
        walkers::Crossings,
    },
};

/// Which drives.
#[derive(Clone, Debug)]
pub struct Drill {
    pub densities: Vec<Density>,
    /// Of each town and density.
    pub episodes: u32,
    pub lengths_m: Range<f64>,
    pub seed: u64,
    pub expert: ExpertConfig,
}

/// A drive of the drill.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Drive {
    pub town: String,
    pub traffic: Density,
    pub episode: u32,
    pub seed: u64,
    pub counts: Counts,
    #[serde(flatten)]
    pub outcome: Outcome,
    /// How often it began to brake harder than for comfort.
    pub emergencies: u64,
    pub crossings: Crossings,
    /// Hash of the last state.
    pub hash: u64,
}

/// Run all drives, on as many threads as the current rayon pool has; `on` hears of each. A town in
/// which no route of such a length exists has no drives.
pub fn run(towns: &[Town], drill: &Drill, on: &(dyn Fn(&Drive) + Sync)) -> Vec<Drive> {
    let mut tasks = Vec::new();
    for town in towns {
        for density in &drill.densities {
            tasks.extend((0..drill.episodes).map(|episode| (town, *density, episode)));
        }
    }
    let drive = |(town, density, episode): &(&Town, Density, u32)| {
        let drive = one(town, *density, *episode, drill)?;
        on(&drive);
        Some(drive)
    };
    tasks.par_iter().filter_map(drive).collect()
}

fn one(town: &Town, traffic: Density, episode: u32, drill: &Drill) -> Option<Drive> {
    // The same routes whatever the traffic, and others in each town and level for all else.
    let route = town.route(drill.seed, episode, drill.lengths_m.clone())?;
    let stream = episode << 2 | traffic as u32;
    let counts = traffic.draw(&mut Noise::new(drill.seed, stream, Purpose::Scenery));
    let mut world = town.world(route, counts, drill.seed, stream);
    let mut expert = Expert::new(drill.expert, drill.seed, stream);
    let (mut emergencies, mut was_emergency) = (0, false);
    let counts = world.counts();
    let outcome = drive(&mut world, &mut |world| {
        let decision = expert.decide(world);
        emergencies += u64::from(decision.is_emergency && !was_emergency);
        was_emergency = decision.is_emergency;
        decision.applied
    });
    Some(Drive {
        town: town.name.clone(),
        traffic,
        episode,
        seed: drill.seed,
        counts,
        outcome,
        emergencies,
        crossings: world.walkers.crossings,
        hash: world.snapshot().hash(),
    })
}

/// All drives, for people and for programs.
#[derive(Clone, Debug)]
pub struct Report {
    drives: Vec<Drive>,
}

impl Report {
    pub fn new(drives: Vec<Drive>) -> Report {
        Report { drives }
    }

    /// One JSON object a line and drive.
    pub fn json_lines(&self) -> String {
        let line = |drive: &Drive| serde_json::to_string(drive).unwrap_or_default() + "\n";
        self.drives.iter().map(line).collect()
    }

    /// By town and level, in order.
    fn tasks(&self) -> BTreeMap<(&str, Density), Vec<&Drive>> {
        let mut tasks: BTreeMap<(&str, Density), Vec<&Drive>> = BTreeMap::new();
        for drive in &self.drives {
            tasks.entry((&drive.town, drive.traffic)).or_default().push(drive);
        }
        tasks
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        for drive in self.drives.iter().filter(|drive| drive.outcome.end != End::Goal) {
            let Drive { town, traffic, episode, outcome, .. } = drive;
            let (at_m, route_m) = (outcome.progress_m, outcome.route_m);
            let end = match &outcome.end {
                End::Contact(contact) => format!(
                    "{:?} touched at {:.1} m/s, {:?} at fault",
                    contact.other, contact.relative_speed_mps, contact.fault
                ),
                other => format!("{other:?}"),
            };
            let traffic = traffic.name();
            writeln!(f, "{town} {traffic} {episode}: {end}, {at_m:.0} of {route_m:.0} m")?;
        }
        let header = ["town", "traffic", "arrived", "km", "km/h", "wrong lane %", "overspeed %"];
        let more = ["standing %", "emergency braking /km", "jaywalkers"];
        let header: Vec<&str> = header.into_iter().chain(more).collect();
        writeln!(f, "| {} |\n|{}", header.join(" | "), "---|".repeat(header.len()))?;
        let all = (("all", ""), self.drives.iter().collect());
        let tasks = self.tasks().into_iter();
        let tasks = tasks.map(|((town, density), drives)| ((town, density.name()), drives));
        for ((town, traffic), drives) in tasks.chain(std::iter::once(all)) {
            let drives: Vec<&Drive> = drives;
            let sum = |value: &dyn Fn(&Drive) -> f64| drives.iter().map(|d| value(d)).sum::<f64>();
            let driven_s = sum(&|d| d.outcome.sums.driven_s).max(f64::MIN_POSITIVE);
            let km = sum(&|d| d.outcome.sums.driven_m) / 1e3;
            let share = |seconds: f64| 100.0 * seconds / driven_s;
            let arrived = drives.iter().filter(|d| d.outcome.end == End::Goal).count();
            writeln!(
                f,
                "| {town} | {traffic} | {arrived}/{} | {km:.1} | {:.1} | {:.2} | {:.2} | {:.1} | {:.2} | {} |",
                drives.len(),
                km / driven_s * 3600.0,
                share(sum(&|d| d.outcome.sums.wrong_lane_s)),
                share(sum(&|d| d.outcome.sums.overspeed_s)),
                share(sum(&|d| d.outcome.sums.standing_s)),
                sum(&|d| d.emergencies as f64) / km.max(f64::MIN_POSITIVE),
                drives.iter().map(|d| d.crossings.without_notice).sum::<u64>(),
            )?;
        }
        Ok(())
    }
}
