//! Many drives of the expert, to know that the world can be driven in: who arrives, and why not.

use std::{ops::Range, sync::Arc};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::{
    map::{planner::Planner, road_map::RoadMap, route::MapRoute},
    noise::{Noise, Purpose},
    towns::scenery::{collection::Scenery, things::Thing},
    world::{
        density::{Counts, Density},
        ego::{Car, SEDAN},
        episode::{Outcome, drive},
        expert::{Expert, ExpertConfig},
        footprint::Footprint,
        obstacles::Obstacles,
        paving::pave,
        route::Route,
        streets::Streets,
        walkers::Crossings,
        world::{Start, World},
    },
};

/// Lengths of routes, m (paper, section III.B).
pub const LENGTHS_M: Range<f64> = 350.0..1500.0;

/// What a lane change costs the planner, m.
const LANE_CHANGE_M: f64 = 30.0;

/// A town, ready to be driven in.
#[derive(Clone, Debug)]
pub struct Town {
    pub name: String,
    pub map: Arc<RoadMap>,
    pub streets: Arc<Streets>,
    pub obstacles: Arc<Obstacles>,
}

impl Town {
    /// A town with scenery by seed.
    pub fn new(name: String, map: RoadMap, seed: u64) -> Town {
        let streets = Arc::new(pave(&map));
        let scenery = Scenery::derive(&map, seed);
        let standing = scenery.things().iter().filter(|thing| thing.kind.is_obstacle());
        let footprint = |thing: &Thing| {
            let Thing { footprint, .. } = thing;
            Footprint::new(footprint.centre_m, footprint.heading_rad, footprint.half_m)
        };
        let obstacles = Arc::new(Obstacles::new(standing.map(footprint).collect()));
        Town { name, map: Arc::new(map), streets, obstacles }
    }
}

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
    let planner = Planner::new(&town.map, LANE_CHANGE_M);
    let draw = drill.seed << 32 | u64::from(episode);
    let route = MapRoute::random(&planner, draw, drill.lengths_m.clone())?;
    let route = Arc::new(Route::new(&route, &town.streets)?);
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
