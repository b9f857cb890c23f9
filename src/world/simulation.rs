//! A drive in a town: the ego vehicle on its way, everybody else, and the first contact.

use std::sync::Arc;

use glam::DVec2;

use crate::{
    noise::{Noise, Purpose},
    policy::Action,
    towns::scenery::collection::Scenery,
    world::{
        car_following::Ahead,
        contact::{Body, Contact, Other, contact},
        density::Counts,
        ego::{self, Car},
        occupancy::{Asker, Occupant},
        reservation::ActorId,
        route::Route,
        snapshot::{Snapshot, VehicleState, vehicle_states, walker_states},
        streets::{LEVEL_M, LaneId, Streets},
        traffic::{EGO, EgoOnLanes, Hazard, STEP_S, Traffic},
        walkers::{Seen, Walkers},
    },
};

/// Steps of the ego vehicle to one of the agents.
pub const SUBSTEPS: u64 = (STEP_S / ego::STEP_S) as u64;

/// No vehicle begins nearer to the ego vehicle than this, m.
const CLEAR_M: f64 = 25.0;

/// Bodies further from the ego vehicle than this cannot touch it within a step, m.
const NEAR_M: f64 = 12.0;

/// How far ahead on its route the ego vehicle is announced to others, m.
const ANNOUNCED_M: f64 = 90.0;

/// What a drive is made from.
#[derive(Clone, Debug)]
pub struct Start {
    pub streets: Arc<Streets>,
    pub scenery: Arc<Scenery>,
    pub route: Arc<Route>,
    pub ego: Car,
    pub counts: Counts,
    pub seed: u64,
    pub episode: u32,
}

/// A town in motion.
#[derive(Clone, Debug)]
pub struct World {
    pub streets: Arc<Streets>,
    pub route: Arc<Route>,
    pub traffic: Traffic,
    pub walkers: Walkers,
    scenery: Arc<Scenery>,
    ego: Car,
    /// Metres along the route that the ego vehicle has come.
    progress_m: f64,
    /// Agents at the last of their steps and at the next.
    before: Snapshot,
    after: Snapshot,
    steps: u64,
    contact: Option<Contact>,
}

impl World {
    /// The world of a drive, before its first step.
    pub fn new(start: Start) -> World {
        let Start { streets, scenery, route, ego, counts, seed, episode } = start;
        let mut noise = Noise::new(seed, episode, Purpose::Traffic);
        let actor = |id: ActorId| Noise::of_actor(seed, episode, id);
        let vehicles = counts.vehicles;
        let traffic =
            Traffic::spawn(&streets, vehicles, ego.position_m, CLEAR_M, &mut noise, actor);
        let walkers = Walkers::spawn(&streets, counts.walkers, &mut noise, actor);
        let empty = Snapshot {
            time_s: 0.0,
            ego,
            ego_ground_m: route.at(0.0).height_m,
            vehicles: Vec::new(),
            walkers: Vec::new(),
        };
        let mut world = World {
            streets,
            route,
            traffic,
            walkers,
            scenery,
            ego,
            progress_m: 0.0,
            before: empty.clone(),
            after: empty,
            steps: 0,
            contact: None,
        };
        world.after = world.agents(0.0);
        world.before = world.after.clone();
        world
    }

    /// Agents that there are, which may be fewer than were asked for.
    pub fn counts(&self) -> Counts {
        Counts { vehicles: self.traffic.vehicles.len(), walkers: self.walkers.walkers.len() }
    }

    /// Let [`ego::STEP_S`] pass with an action.
    pub fn step(&mut self, action: Action) {
        if self.steps.is_multiple_of(SUBSTEPS) {
            self.step_agents();
        }
        self.ego = self.ego.step(action);
        self.steps += 1;
        self.progress_m = self.route.progress_m(self.ego.position_m, self.progress_m);
        if self.contact.is_none() {
            self.contact = self.touch();
        }
    }

    fn step_agents(&mut self) {
        let announced = self.ego_on_lanes();
        let mut hazards: Vec<Hazard> = self.walkers.hazards().collect();
        hazards.extend(discs(&self.ego, self.ground_m()));
        let mut seen: Vec<Seen> = self.after.vehicles.iter().map(VehicleState::seen).collect();
        seen.push(Seen {
            footprint: self.ego.footprint(),
            height_m: self.ground_m(),
            speed_mps: self.ego.speed_mps,
        });
        self.traffic.step(&self.streets, Some(&announced), &hazards);
        self.walkers.step(&self.streets, &seen);
        let time_s = (self.steps + SUBSTEPS) as f64 * ego::STEP_S;
        let next = self.agents(time_s);
        self.before = std::mem::replace(&mut self.after, next);
    }

    /// Agents as they are after their last step.
    fn agents(&self, time_s: f64) -> Snapshot {
        Snapshot {
            time_s,
            ego: self.ego,
            ego_ground_m: self.ground_m(),
            vehicles: vehicle_states(&self.streets, &self.traffic),
            walkers: walker_states(&self.walkers),
        }
    }

    /// The world as it is now.
    pub fn snapshot(&self) -> Snapshot {
        let into = self.steps % SUBSTEPS;
        let share = if into == 0 && self.steps > 0 { 1.0 } else { into as f64 / SUBSTEPS as f64 };
        Snapshot {
            time_s: self.time_s(),
            ego: self.ego,
            ego_ground_m: self.ground_m(),
            ..self.before.towards(&self.after, share)
        }
    }

    pub fn time_s(&self) -> f64 {
        self.steps as f64 * ego::STEP_S
    }

    /// Height of the ground below the ego vehicle, m.
    pub fn ground_m(&self) -> f64 {
        self.route.at(self.progress_m).height_m
    }

    pub fn ego(&self) -> &Car {
        &self.ego
    }

    /// Put the ego vehicle somewhere else, as no action could.
    pub fn place_ego(&mut self, ego: Car) {
        self.ego = ego;
    }

    /// Metres along the route that the ego vehicle has come.
    pub fn progress_m(&self) -> f64 {
        self.progress_m
    }

    /// The first contact of the ego vehicle.
    pub fn contact(&self) -> Option<&Contact> {
        self.contact.as_ref()
    }

    /// Whether others let the ego vehicle into a lane of a junction.
    pub fn may_enter(&self, lane: LaneId) -> bool {
        self.traffic.reservations.may_enter(EGO, lane)
    }

    /// What is ahead of the ego vehicle on the lanes of its route, those that merge into them too.
    pub fn ahead_of_ego(&self, horizon_m: f64) -> Option<Ahead> {
        let (way, s_m) = self.route.lanes_ahead(self.progress_m, horizon_m);
        let half_length_m = self.ego.config.half_length_m;
        let asker = Asker { actor: EGO, s_m, half_length_m };
        self.traffic.ahead(&self.streets, way.into_iter(), asker, horizon_m)
    }

    fn touch(&self) -> Option<Contact> {
        let footprint = self.ego.footprint();
        let ego = Body {
            other: Other::Static,
            actor: Some(EGO),
            footprint,
            velocity_mps: self.ego.velocity_world_mps(),
        };
        let is_level = |ground_m: f64| (ground_m - self.ground_m()).abs() < LEVEL_M;
        let into = (self.steps - 1) % SUBSTEPS + 1;
        let share = into as f64 / SUBSTEPS as f64;
        let near = |a: &DVec2, b: &DVec2| {
            a.lerp(*b, share).distance_squared(footprint.centre_m) < NEAR_M * NEAR_M
        };
        let vehicles = self.before.vehicles.iter().zip(&self.after.vehicles);
        let vehicles = vehicles
            .filter(|(_, b)| is_level(b.ground_m))
            .filter(|(a, b)| near(&a.footprint.centre_m, &b.footprint.centre_m))
            .map(|(a, b)| Body {
                other: Other::Vehicle(b.kind),
                actor: Some(b.id),
                footprint: a.footprint.towards(&b.footprint, share),
                velocity_mps: b.velocity_mps,
            });
        let walkers = self.before.walkers.iter().zip(&self.after.walkers);
        let walkers = walkers
            .filter(|(_, b)| is_level(b.ground_m))
            .filter(|(a, b)| near(&a.footprint.centre_m, &b.footprint.centre_m))
            .map(|(a, b)| Body {
                other: Other::Walker(b.kind),
                actor: Some(b.id),
                footprint: a.footprint.towards(&b.footprint, share),
                velocity_mps: b.velocity_mps,
            });
        let standing = self.scenery.touched_by(&footprint).map(|thing| Body {
            other: Other::Static,
            actor: None,
            footprint: thing.footprint,
            velocity_mps: DVec2::ZERO,
        });
        let time_s = self.time_s();
        vehicles.chain(walkers).chain(standing).find_map(|body| contact(&ego, &body, time_s))
    }

    /// The ego vehicle as others on the lanes see it: where its body is, and where it will go.
    fn ego_on_lanes(&self) -> EgoOnLanes {
        let config = &self.ego.config;
        let forward = DVec2::from_angle(self.ego.yaw_rad);
        let mut bodies = Vec::new();
        for id in self.streets.lanes_near(self.ego.position_m, 6.0) {
            let lane = &self.streets.lanes[id];
            let (s_m, aside_m) = lane.course.project(self.ego.position_m);
            let spot = lane.course.at(s_m);
            let along = spot.forward;
            let inside = s_m > 0.0 && s_m < lane.length_m();
            let reaches_in = aside_m.abs() < lane.width_m / 2.0 + 0.5 * config.half_width_m;
            let is_level = (spot.height_m - self.ground_m()).abs() < LEVEL_M;
            if inside && is_level && reaches_in && along.dot(forward) > 0.3 {
                let speed_mps = self.ego.speed_mps * along.dot(forward);
                let half_length_m = config.half_length_m;
                bodies.push((id, Occupant { actor: EGO, s_m, half_length_m, speed_mps }));
            }
        }
        let (way, s_m) = self.route.lanes_ahead(self.progress_m, ANNOUNCED_M);
        let half_length_m = config.half_length_m;
        let (mut tail, _) = self.route.lanes_ahead(self.progress_m - half_length_m, half_length_m);
        tail.retain(|lane| !way.contains(lane));
        tail.reverse();
        EgoOnLanes { bodies, way, tail, s_m, half_length_m, speed_mps: self.ego.speed_mps }
    }
}

/// The ego vehicle as three discs: what crosses its way sees where it is, whatever its lane.
fn discs(ego: &Car, height_m: f64) -> [Hazard; 3] {
    let forward = DVec2::from_angle(ego.yaw_rad);
    let velocity_mps = ego.velocity_world_mps();
    [-1.5, 0.0, 1.5].map(|along_m| Hazard {
        actor: EGO,
        position_m: ego.position_m + forward * along_m,
        velocity_mps,
        radius_m: ego.config.half_width_m,
        height_m,
    })
}
