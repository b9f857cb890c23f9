//! Many drives of the expert, to know that the world can be driven in: who arrives, and why not.

use std::{ops::RangeInclusive, sync::Arc};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::{
    map::road_map::RoadMap,
    noise::{Noise, Purpose},
    world::{
        density::{Counts, Density},
        ego::{Car, SEDAN},
        episode::{Outcome, drive},
        errand::draw_route,
        expert::{Expert, ExpertConfig},
        obstacles::Obstacles,
        paving::pave,
        route::Route,
        streets::Streets,
        walkers::Crossings,
        world::{Start, World},
    },
};

/// A town, ready to be driven in.
#[derive(Clone, Debug)]
pub struct Town {
    pub name: String,
    pub map: Arc<RoadMap>,
    pub streets: Arc<Streets>,
    pub obstacles: Arc<Obstacles>,
}

impl Town {
    pub fn new(name: String, map: RoadMap, obstacles: Obstacles) -> Town {
        let streets = Arc::new(pave(&map));
        Town { name, map: Arc::new(map), streets, obstacles: Arc::new(obstacles) }
    }
}

/// Which drives.
#[derive(Clone, Debug)]
pub struct Drill {
    pub densities: Vec<Density>,
    /// Of each town and density.
    pub episodes: u32,
    pub lengths_m: RangeInclusive<f64>,
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
    /// Decisions to brake harder than for comfort.
    pub emergency_steps: u64,
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
    let mut noise = Noise::new(drill.seed, episode, Purpose::Road);
    let route = Arc::new(draw_route(&town.map, &town.streets, &mut noise, &drill.lengths_m)?);
    let stream = episode << 2 | traffic as u32;
    let counts = traffic.draw(&mut Noise::new(drill.seed, stream, Purpose::Scenery));
    let mut world = World::new(Start {
        streets: town.streets.clone(),
        obstacles: town.obstacles.clone(),
        ego: at_start(&route),
        route,
        counts,
        seed: drill.seed,
        episode: stream,
    });
    let mut expert = Expert::new(drill.expert, drill.seed, stream);
    let mut emergency_steps = 0;
    let counts = world.counts();
    let outcome = drive(&mut world, &mut |world| {
        let decision = expert.decide(world);
        emergency_steps += u64::from(decision.is_emergency);
        decision.applied
    });
    Some(Drive {
        town: town.name.clone(),
        traffic,
        episode,
        seed: drill.seed,
        counts,
        outcome,
        emergency_steps,
        crossings: world.walkers.crossings,
        hash: world.snapshot().hash(),
    })
}

/// A car at rest on the first waypoint.
fn at_start(route: &Route) -> Car {
    Car::at_rest(SEDAN, route.waypoints()[0].position_m, route.forward(0.0).to_angle())
}
