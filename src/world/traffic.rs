//! Traffic: vehicles that follow, change lanes, cross junctions in turn and brake for people.

use glam::DVec2;

use crate::{
    noise::Noise,
    world::{
        car_following::Ahead,
        lane_change::better_lane,
        occupancy::{Asker, HORIZON_M, Occupancy, Occupant},
        reservation::{ActorId, Claim, Reservations},
        right_of_way::{self, ASK_M, Way},
        streets::{LEVEL_M, LaneId, Streets},
        vehicle::{Vehicle, View},
    },
};

/// Step of the agents, s.
pub const STEP_S: f64 = 0.1;

/// The ego vehicle's number.
pub const EGO: ActorId = 0;

/// Full braking, m/s2.
const HARDEST_MPS2: f64 = 7.5;

/// How long drivers wait for room before they think of another way, s.
const PATIENCE_S: f64 = 12.0;

/// Between the side of a vehicle and somebody on foot, m.
const CLEARANCE_M: f64 = 0.5;

/// How long ahead others' ways are foreseen, s.
const FORESIGHT_S: f64 = 3.0;

/// Somebody or something on the street that does not keep to lanes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hazard {
    pub actor: ActorId,
    pub position_m: DVec2,
    pub velocity_mps: DVec2,
    pub radius_m: f64,
    /// Of the ground below.
    pub height_m: f64,
}

/// What traffic knows of the ego vehicle.
#[derive(Clone, Debug)]
pub struct EgoOnLanes {
    /// The lanes that its body is on.
    pub bodies: Vec<(LaneId, Occupant)>,
    /// Lanes of the route from here on, and the arc length of the middle on the first of them, m.
    pub way: Vec<LaneId>,
    /// Lanes of the route that the rear has not left, the last one first.
    pub tail: Vec<LaneId>,
    pub s_m: f64,
    pub half_length_m: f64,
    pub speed_mps: f64,
}

/// All vehicles but the ego vehicle.
#[derive(Clone, Debug, Default)]
pub struct Traffic {
    pub vehicles: Vec<Vehicle>,
    pub reservations: Reservations,
    occupancy: Occupancy,
    steps: u64,
}

impl Traffic {
    /// `count` vehicles on lanes outside of junctions, none within `clear_m` of `ego_m`; fewer where
    /// the town has no room for them.
    pub fn spawn(
        streets: &Streets,
        count: usize,
        ego_m: DVec2,
        clear_m: f64,
        noise: &mut Noise,
        actor: impl Fn(ActorId) -> Noise,
    ) -> Traffic {
        const HEADWAY_M: f64 = 16.0;
        /// More than one vehicle on so much lane is a jam from the start, m.
        const LANE_EACH_M: f64 = 32.0;
        let mut traffic = Traffic::default();
        traffic.occupancy.clear(streets.lanes.len());
        let lengths: Vec<f64> = streets.lanes.iter().map(usable_m).collect();
        let total: f64 = lengths.iter().sum();
        let count = count.min((total / LANE_EACH_M) as usize);
        for _ in 0..40 * count {
            if traffic.vehicles.len() == count || total <= 0.0 {
                break;
            }
            let mut left_m = noise.uniform(0.0, total);
            let picked = lengths.iter().position(|length_m| {
                left_m -= length_m;
                left_m < 0.0
            });
            let Some(lane) = picked else { continue };
            let s_m = noise.uniform(6.0, streets.lanes[lane].length_m() - 6.0);
            let is_near = |body: &Occupant| (body.s_m - s_m).abs() < HEADWAY_M;
            let spot = streets.lanes[lane].course.at(s_m);
            if spot.position_m.distance(ego_m) < clear_m
                || traffic.occupancy.on(lane).iter().any(is_near)
            {
                continue;
            }
            let id = EGO + 1 + traffic.vehicles.len() as ActorId;
            let mut vehicle = Vehicle::new(id, actor(id), streets, lane, s_m);
            vehicle.speed_mps = 0.5 * wish_mps(streets, &vehicle);
            traffic.occupancy.insert(lane, body_of(&vehicle));
            traffic.vehicles.push(vehicle);
        }
        traffic
    }

    /// Let [`STEP_S`] pass.
    pub fn step(&mut self, streets: &Streets, ego: Option<&EgoOnLanes>, hazards: &[Hazard]) {
        self.steps += 1;
        let ways = self.ways(streets, ego);
        self.place_bodies(streets, ego, &ways);
        right_of_way::settle(&mut self.reservations, &self.occupancy, streets, &ways, self.steps);
        let views: Vec<View> =
            self.vehicles.iter().map(|vehicle| self.view(streets, vehicle, hazards)).collect();
        for (vehicle, view) in self.vehicles.iter_mut().zip(views) {
            vehicle.view = view;
            vehicle.advance(streets, view.wanted_mps2, STEP_S);
        }
        self.change_lanes(streets);
        self.look_for_other_ways(streets);
    }

    /// The next body along a way of lanes, as of the last step.
    pub fn ahead(
        &self,
        streets: &Streets,
        way: impl Iterator<Item = LaneId>,
        asker: Asker,
        horizon_m: f64,
    ) -> Option<Ahead> {
        self.occupancy.ahead(streets, way, asker, horizon_m)
    }

    fn place_bodies(&mut self, streets: &Streets, ego: Option<&EgoOnLanes>, ways: &[Way]) {
        self.occupancy.clear(streets.lanes.len());
        for vehicle in &self.vehicles {
            let body = body_of(vehicle);
            self.occupancy.insert(vehicle.lane, body);
            if let Some(leaving) = vehicle.leaving {
                let (here, left) = (&streets.lanes[vehicle.lane], &streets.lanes[leaving]);
                let s_m = here.beside_m(body.s_m, left);
                self.occupancy.insert(leaving, Occupant { s_m, ..body });
            }
        }
        for (lane, body) in ego.iter().flat_map(|ego| &ego.bodies) {
            self.occupancy.insert(*lane, *body);
        }
        for way in ways {
            for claim in self.reservations.claims() {
                if claim.actor != way.actor || !claim.is_taken {
                    continue;
                }
                let mut start_m = -way.s_m;
                for (index, lane) in way.lanes.iter().enumerate() {
                    if index > 0 && claim.lanes.contains(lane) {
                        self.occupancy.insert(*lane, Occupant { s_m: -start_m, ..way.body() });
                    }
                    start_m += streets.lanes[*lane].length_m();
                }
            }
        }
    }

    /// Where everybody goes.
    fn ways(&self, streets: &Streets, ego: Option<&EgoOnLanes>) -> Vec<Way> {
        let way = |vehicle: &Vehicle| Way {
            actor: vehicle.id,
            lanes: vehicle.way().collect(),
            tail: vehicle.tail(streets).collect(),
            s_m: vehicle.s_m,
            half_length_m: vehicle.half_m.x,
            speed_mps: vehicle.speed_mps,
            ask_m: ASK_M + vehicle.speed_mps.powi(2) / (2.0 * vehicle.model.comfort_mps2),
            stood: (vehicle.standing_s / STEP_S).round() as u64,
        };
        let ego = ego.map(|ego| Way {
            actor: EGO,
            lanes: ego.way.clone(),
            tail: ego.tail.clone(),
            s_m: ego.s_m,
            half_length_m: ego.half_length_m,
            speed_mps: ego.speed_mps,
            ask_m: ASK_M + ego.speed_mps.powi(2) / 4.0,
            stood: 0,
        });
        self.vehicles.iter().map(way).chain(ego).collect()
    }

    /// What a driver sees, and makes of it.
    fn view(&self, streets: &Streets, vehicle: &Vehicle, hazards: &[Hazard]) -> View {
        let idm = vehicle.model.idm();
        let wish_mps = wish_mps(streets, vehicle);
        let wants = |ahead| idm.acceleration_mps2(vehicle.speed_mps, wish_mps, ahead);
        let ahead = self.occupancy.ahead(streets, vehicle.way(), vehicle.asker(), HORIZON_M);
        let line = self.line_ahead(streets, vehicle);
        let on_lanes = wants(None).min(wants(ahead)).min(wants(line));
        let hazard = hazard_ahead(streets, vehicle, hazards);
        let for_hazard = hazard.map_or(f64::INFINITY, |(_, ahead)| wants(Some(ahead)));
        View {
            wish_mps,
            ahead,
            yields_to: hazard.filter(|_| for_hazard < on_lanes).map(|(actor, _)| actor),
            wanted_mps2: on_lanes.min(for_hazard).max(-HARDEST_MPS2),
        }
    }

    /// The line before a junction that the vehicle may not enter yet.
    fn line_ahead(&self, streets: &Streets, vehicle: &Vehicle) -> Option<Ahead> {
        let (mut start_m, mut line_m) = (-vehicle.s_m, 0.0);
        for (index, lane) in vehicle.way().enumerate() {
            let is_inside = streets.lanes[lane].junction.is_some();
            if index > 0 && is_inside && !self.reservations.may_enter(vehicle.id, lane) {
                let gap_m = start_m - vehicle.half_m.x - line_m + vehicle.model.idm().rest_gap_m;
                return Some(Ahead::standing(gap_m));
            }
            start_m += streets.lanes[lane].length_m();
            line_m = streets.lanes[lane].line_m;
            if start_m > HORIZON_M {
                break;
            }
        }
        // The end of a lane that leads nowhere.
        let last = vehicle.way().last()?;
        let lane = &streets.lanes[last];
        let end_m = start_m - (lane.length_m() - lane.usable_m);
        (start_m < HORIZON_M && lane.next.is_empty())
            .then(|| Ahead::standing(end_m - vehicle.half_m.x))
    }

    /// Whoever has stood before a full street for long takes another one, if there is any.
    fn look_for_other_ways(&mut self, streets: &Streets) {
        for vehicle in &mut self.vehicles {
            let waits =
                |claim: &Claim| claim.actor == vehicle.id && !claim.is_taken && !claim.has_room;
            let stood = (vehicle.standing_s / STEP_S).round() as u64;
            let for_long = stood > 0 && stood.is_multiple_of((PATIENCE_S / STEP_S) as u64);
            if for_long && self.reservations.claims().iter().any(waits) {
                self.reservations.forget(vehicle.id, |_| false);
                vehicle.plan_anew(streets);
            }
        }
    }

    fn change_lanes(&mut self, streets: &Streets) {
        for index in 0..self.vehicles.len() {
            let vehicle = &self.vehicles[index];
            // Once a second, not all in the same step.
            if !(self.steps + u64::from(vehicle.id)).is_multiple_of(10) || vehicle.leaving.is_some()
            {
                continue;
            }
            if let Some(to) = better_lane(&self.occupancy, streets, vehicle) {
                let vehicle = &mut self.vehicles[index];
                vehicle.change_lane(streets, to);
                self.occupancy.insert(to, body_of(vehicle));
            }
        }
    }
}

fn usable_m(lane: &crate::world::streets::Lane) -> f64 {
    let is_usable = lane.junction.is_none() && lane.length_m() > 20.0;
    if is_usable { lane.length_m() } else { 0.0 }
}

fn body_of(vehicle: &Vehicle) -> Occupant {
    Occupant {
        actor: vehicle.id,
        s_m: vehicle.s_m,
        half_length_m: vehicle.half_m.x,
        speed_mps: vehicle.speed_mps,
    }
}

/// The speed that a driver wants here: the limit, and what the bends ahead allow, m/s.
fn wish_mps(streets: &Streets, vehicle: &Vehicle) -> f64 {
    const LOOK_M: f64 = 3.0;
    let model = vehicle.model;
    let limit = streets.lanes[vehicle.lane].limit_mps * vehicle.haste;
    let mut wish = limit.min(model.fastest_mps);
    let reach_m = vehicle.speed_mps.powi(2) / (2.0 * model.comfort_mps2) + 10.0;
    let mut start_m = -vehicle.s_m;
    for lane in vehicle.way() {
        let lane = &streets.lanes[lane];
        let mut at_m = start_m.max(0.0);
        let end_m = (start_m + lane.length_m()).min(reach_m);
        while at_m < end_m {
            let curvature = lane.curvature_per_m(at_m - start_m).max(1e-6);
            let bend = (model.lateral_mps2 * vehicle.haste / curvature).min(lane.limit_mps.powi(2));
            wish = wish.min((bend + 2.0 * model.comfort_mps2 * at_m).sqrt());
            at_m += LOOK_M;
        }
        start_m += lane.length_m();
        if start_m > reach_m {
            break;
        }
    }
    wish.max(1.0)
}

/// Somebody on the vehicle's way, now or when it will be there.
fn hazard_ahead(
    streets: &Streets,
    vehicle: &Vehicle,
    hazards: &[Hazard],
) -> Option<(ActorId, Ahead)> {
    const STEP_M: f64 = 1.5;
    let reach_m = vehicle.half_m.x + vehicle.speed_mps.powi(2) / 8.0 + 10.0;
    let here = vehicle.spot(streets, 0.0);
    let is_near = |hazard: &&Hazard| {
        let from = hazard.position_m - here.position_m;
        let is_level = (hazard.height_m - here.height_m).abs() < LEVEL_M;
        is_level && from.length() < reach_m + 10.0 && from.dot(here.forward) > -vehicle.half_m.x
    };
    let near: Vec<&Hazard> = hazards.iter().filter(is_near).collect();
    if near.is_empty() {
        return None;
    }
    let mut at_m = vehicle.half_m.x;
    while at_m < reach_m {
        let spot = vehicle.spot(streets, at_m);
        let is_there = |hazard: &&&Hazard| {
            let arrival_s =
                ((at_m - vehicle.half_m.x) / vehicle.speed_mps.max(1.0)).min(FORESIGHT_S);
            let side_m = vehicle.half_m.y + hazard.radius_m + CLEARANCE_M;
            [0.0, arrival_s].iter().any(|after_s| {
                let from = hazard.position_m + hazard.velocity_mps * *after_s - spot.position_m;
                from.perp_dot(spot.forward).abs() < side_m && from.dot(spot.forward).abs() < STEP_M
            })
        };
        if let Some(hazard) = near.iter().find(is_there) {
            let along = hazard.velocity_mps.dot(spot.forward).max(0.0);
            let gap_m = at_m - vehicle.half_m.x - hazard.radius_m;
            return Some((hazard.actor, Ahead { gap_m, speed_mps: along }));
        }
        at_m += STEP_M;
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        noise::Purpose,
        world::streets::{Course, Lane},
    };

    const RING_M: f64 = 1000.0;
    const LIMIT_MPS: f64 = 50.0 / 3.6;

    /// A round street of four lanes in a row.
    fn ring() -> Streets {
        let radius_m = RING_M / std::f64::consts::TAU;
        let lane = |quarter: usize| {
            let at = |i: i32| {
                let angle = (quarter as f64 + f64::from(i) / 250.0) * std::f64::consts::FRAC_PI_2;
                (radius_m * DVec2::from_angle(angle)).extend(0.0)
            };
            let points: Vec<_> = (0..=250).map(at).collect();
            let course = Course::through(&points);
            let mut lane = Lane::new(format!("{quarter}/0/-1"), course, 3.5, LIMIT_MPS);
            lane.next = vec![(quarter + 1) % 4];
            lane
        };
        Streets::new((0..4).map(lane).collect(), Vec::new())
    }

    #[test]
    fn a_car_stops_for_who_steps_out_and_goes_on_afterwards() {
        let streets = ring();
        let actor = |id| Noise::of_actor(3, 0, id);
        let mut noise = Noise::new(3, 0, Purpose::Traffic);
        let mut traffic = Traffic::spawn(&streets, 1, DVec2::splat(1e6), 0.0, &mut noise, actor);
        for _ in 0..300 {
            traffic.step(&streets, None, &[]);
        }
        let vehicle = &traffic.vehicles[0];
        let stop_m = vehicle.half_m.x + vehicle.speed_mps.powi(2) / (2.0 * 4.0) + 3.0;
        let position_m = vehicle.spot(&streets, stop_m).position_m;
        let hazard = Hazard {
            actor: EGO,
            position_m,
            velocity_mps: DVec2::ZERO,
            radius_m: 0.3,
            height_m: 0.0,
        };
        for _ in 0..100 {
            traffic.step(&streets, None, &[hazard]);
            let footprint = traffic.vehicles[0].footprint(&streets);
            assert!(footprint.distance_m(position_m) > 0.5, "{footprint:?}");
        }
        assert!(traffic.vehicles[0].speed_mps < 0.3);
        for _ in 0..100 {
            traffic.step(&streets, None, &[]);
        }
        assert!(traffic.vehicles[0].speed_mps > 3.0);
    }
}
