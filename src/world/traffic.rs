//! Traffic: vehicles that follow, change lanes, cross junctions in turn and brake for people.

use glam::DVec2;

use crate::{
    noise::Noise,
    world::{
        car_following::{Ahead, Change, Idm, MOBIL},
        kind::REST_GAP_M,
        occupancy::{Asker, Occupancy, Occupant},
        reservation::{ActorId, Claim, Reservations},
        streets::{LEVEL_M, LaneId, Streets},
        vehicle::{ASIDE_MPS, ASIDE_PER_SPEED, Vehicle, View},
    },
};

/// Step of the agents, s.
pub const STEP_S: f64 = 0.1;

/// The ego vehicle's number.
pub const EGO: ActorId = 0;

/// How far ahead drivers look, m.
const HORIZON_M: f64 = 120.0;

/// Full braking, m/s2.
const HARDEST_MPS2: f64 = 7.5;

/// Where vehicles stop before a junction, m from its edge.
const LINE_M: f64 = 0.5;

/// A claim is asked for at this distance from the junction at the latest, and where braking to the
/// line would still be comfortable, m.
const ASK_M: f64 = 20.0;

/// Longer than twice this, a vehicle needs more room in bends than cars do, m.
const WIDE_M: f64 = 3.2;

/// Least room behind a junction, beyond the own length, m.
const ROOM_M: f64 = 3.0;

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
        self.settle_claims(streets, &ways);
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
        };
        let ego = ego.map(|ego| Way {
            actor: EGO,
            lanes: ego.way.clone(),
            tail: ego.tail.clone(),
            s_m: ego.s_m,
            half_length_m: ego.half_length_m,
            speed_mps: ego.speed_mps,
            ask_m: ASK_M + ego.speed_mps.powi(2) / 4.0,
        });
        self.vehicles.iter().map(way).chain(ego).collect()
    }

    fn settle_claims(&mut self, streets: &Streets, ways: &[Way]) {
        for way in ways {
            let through = way.through(streets);
            self.reservations.forget(way.actor, |claim| {
                let is_next = through.as_ref().is_some_and(|(lanes, _)| claim.lanes[0] == lanes[0]);
                is_next || way.is_on(&claim.lanes)
            });
            if let Some((lanes, distance_m)) = through
                && distance_m < way.ask_m
            {
                self.reservations.ask(Claim {
                    actor: way.actor,
                    lanes,
                    since: self.steps,
                    is_taken: distance_m <= 0.0,
                    has_room: false,
                    is_wide: way.half_length_m > WIDE_M,
                    length_m: 2.0 * way.half_length_m,
                    speed_mps: way.speed_mps,
                    rear: (0, 0.0),
                });
            }
            let may_go = |lanes: &[LaneId]| {
                self.is_at_the_head(streets, way, lanes) && self.has_room(streets, way, lanes)
            };
            let updates: Vec<(usize, (usize, f64), bool)> = self
                .reservations
                .claims()
                .iter()
                .enumerate()
                .filter(|(_, claim)| claim.actor == way.actor)
                .map(|(index, claim)| {
                    let rear = way.rear_among(&claim.lanes, streets);
                    (index, rear, claim.is_taken || may_go(&claim.lanes))
                })
                .collect();
            for (index, rear, has_room) in updates {
                let claim: &mut Claim = &mut self.reservations.claims_mut()[index];
                claim.rear = rear;
                claim.speed_mps = way.speed_mps;
                claim.has_room = has_room;
            }
        }
        self.reservations.settle(streets);
    }

    /// Whether all who are between an actor and its junction may enter themselves: a way that is
    /// taken by somebody who cannot move would be lost to all.
    fn is_at_the_head(&self, streets: &Streets, way: &Way, through: &[LaneId]) -> bool {
        let before = way.lanes.iter().take_while(|lane| Some(*lane) != through.first());
        let Some(approach) = before.clone().last() else { return true };
        let leads_in = |lane: &LaneId| streets.lanes[*approach].next.contains(lane);
        let has_way = |actor: ActorId| {
            let mut claims = self.reservations.claims().iter();
            claims.any(|c| c.actor == actor && c.is_taken && c.lanes.iter().any(leads_in))
        };
        before.enumerate().all(|(index, lane)| {
            let from_m = if index == 0 { way.s_m } else { f64::NEG_INFINITY };
            let mut ahead = self.occupancy.on(*lane).iter().filter(|body| body.s_m > from_m);
            ahead.all(|body| body.actor == way.actor || has_way(body.actor))
        })
    }

    /// Whether a vehicle could stand behind the junction, with all who are on their way there: now,
    /// and when all of them queue at the next one.
    fn has_room(&self, streets: &Streets, way: &Way, through: &[LaneId]) -> bool {
        let Some(last) = through.last() else { return true };
        let Some(at) = way.lanes.iter().position(|lane| lane == last) else { return true };
        let beyond = &way.lanes[at + 1..];
        let Some(exit) = beyond.first() else { return true };
        let on_their_way = self.reservations.claims().iter().filter(|claim| {
            claim.is_taken
                && claim.actor != way.actor
                && claim.lanes.last().is_some_and(|lane| streets.lanes[*lane].next.contains(exit))
        });
        let theirs_m: f64 = on_their_way.map(|claim| claim.length_m + REST_GAP_M).sum();
        let needed_m = 2.0 * way.half_length_m + ROOM_M + theirs_m;

        let asker = Asker { actor: way.actor, s_m: 0.0, half_length_m: 0.0 };
        let ahead = self.occupancy.ahead(streets, beyond.iter().copied(), asker, HORIZON_M);
        // Who moves on will have made room.
        let has_now = |ahead: Ahead| ahead.gap_m + 3.0 * ahead.speed_mps > needed_m;
        let queue = || beyond.iter().take_while(|lane| streets.lanes[**lane].junction.is_none());
        let length_m: f64 = queue().map(|lane| streets.lanes[*lane].length_m()).sum();
        let bodies = queue().flat_map(|lane| self.occupancy.on(*lane));
        let others = bodies.filter(|body| body.actor != way.actor);
        let taken_m: f64 = others.map(|body| 2.0 * body.half_length_m + REST_GAP_M).sum();
        ahead.is_none_or(has_now) && length_m - taken_m > needed_m
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
        let mut start_m = -vehicle.s_m;
        for (index, lane) in vehicle.way().enumerate() {
            let is_inside = streets.lanes[lane].junction.is_some();
            if index > 0 && is_inside && !self.reservations.may_enter(vehicle.id, lane) {
                let gap_m = start_m - vehicle.half_m.x - LINE_M + vehicle.model.idm().rest_gap_m;
                return Some(Ahead::standing(gap_m));
            }
            start_m += streets.lanes[lane].length_m();
            if start_m > HORIZON_M {
                break;
            }
        }
        // The end of a lane that leads nowhere.
        let last = vehicle.way().last()?;
        (start_m < HORIZON_M && streets.lanes[last].next.is_empty())
            .then(|| Ahead::standing(start_m - vehicle.half_m.x))
    }

    /// Whoever has stood before a full street for long takes another one, if there is any.
    fn look_for_other_ways(&mut self, streets: &Streets) {
        for vehicle in &mut self.vehicles {
            let waits =
                |claim: &Claim| claim.actor == vehicle.id && !claim.is_taken && !claim.has_room;
            let for_long = vehicle.standing_s > PATIENCE_S
                && (vehicle.standing_s / STEP_S).round() as u64 % (PATIENCE_S / STEP_S) as u64 == 0;
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
            if (self.steps + u64::from(vehicle.id)) % 10 != 0 || vehicle.leaving.is_some() {
                continue;
            }
            if let Some(to) = self.better_lane(streets, vehicle) {
                let vehicle = &mut self.vehicles[index];
                vehicle.change_lane(streets, to);
                self.occupancy.insert(to, body_of(vehicle));
            }
        }
    }

    /// A neighbouring lane that is worth a change.
    fn better_lane(&self, streets: &Streets, vehicle: &Vehicle) -> Option<LaneId> {
        let lane = &streets.lanes[vehicle.lane];
        let left_m = lane.length_m() - vehicle.s_m;
        if lane.junction.is_some() || vehicle.s_m < 8.0 || vehicle.speed_mps < 2.0 {
            return None;
        }
        let leads_nowhere = lane.next.is_empty();
        // Not right before a junction, unless the lane ends there.
        if !leads_nowhere && left_m < 25.0 + 2.0 * vehicle.speed_mps {
            return None;
        }
        let bias = if leads_nowhere { 4.0 * (1.0 - left_m / 150.0).clamp(0.0, 1.0) } else { 0.0 };
        let idm = vehicle.model.idm();
        let wish = wish_mps(streets, vehicle);
        let own = |way: &mut dyn Iterator<Item = LaneId>, asker| {
            let ahead = self.occupancy.ahead(streets, way, asker, HORIZON_M);
            idm.acceleration_mps2(vehicle.speed_mps, wish, ahead)
        };
        let ahead = self.occupancy.ahead(streets, vehicle.way(), vehicle.asker(), HORIZON_M);
        let before = idm.acceleration_mps2(vehicle.speed_mps, wish, ahead);
        if ahead.is_some_and(|ahead| !comes_clear_of(vehicle, lane.width_m, ahead)) {
            return None;
        }
        let is_wanted = |to: &LaneId| {
            let target = &streets.lanes[*to];
            let asker = Asker { s_m: lane.beside_m(vehicle.s_m, target), ..vehicle.asker() };
            let mut way = std::iter::once(*to).chain(target.next.first().copied());
            let after = own(&mut way, asker);
            let follower = self.occupancy.behind(streets, *to, asker, 60.0);
            // The manners of others are not known: those of cars are assumed.
            let theirs = follower.map(|(distance_m, body)| {
                let gap_m = distance_m - body.half_length_m - vehicle.half_m.x;
                let squeezed = Ahead { gap_m, speed_mps: vehicle.speed_mps };
                let follow =
                    |ahead| FOLLOWER.acceleration_mps2(body.speed_mps, target.limit_mps, ahead);
                [follow(None), follow(Some(squeezed))]
            });
            let change = Change {
                own_before_mps2: before,
                own_after_mps2: after,
                follower_mps2: theirs,
                old_follower_mps2: None,
            };
            let room = follower.is_none_or(|(distance_m, body)| {
                distance_m > body.half_length_m + vehicle.half_m.x + 1.5
            });
            room && MOBIL.wants(&change, bias)
        };
        let leads_on = |to: &LaneId| !leads_nowhere || !streets.lanes[*to].next.is_empty();
        [lane.left, lane.right].into_iter().flatten().filter(leads_on).find(is_wanted)
    }
}

/// Whether a vehicle is out of its lane before it reaches who is ahead there, if it changes now.
fn comes_clear_of(vehicle: &Vehicle, width_m: f64, ahead: Ahead) -> bool {
    /// It may speed up so much meanwhile, as a share of its speed.
    const FASTER: f64 = 1.25;
    let speed_mps = vehicle.speed_mps;
    // Bodies in the middle of their lanes are clear of each other when one is half a lane aside
    // and half its own width.
    let aside_m = width_m / 2.0 + vehicle.half_m.y;
    let clear_s = aside_m / ASIDE_MPS.min(ASIDE_PER_SPEED * speed_mps);
    ahead.gap_m > (FASTER * speed_mps - ahead.speed_mps).max(0.0) * clear_s + 1.0
}

/// How the one behind is taken to follow, when a lane is changed.
const FOLLOWER: Idm =
    Idm { acceleration_mps2: 1.5, comfort_mps2: 2.0, time_gap_s: 1.2, rest_gap_m: 2.0 };

/// An actor on its way to a junction.
struct Way {
    actor: ActorId,
    lanes: Vec<LaneId>,
    s_m: f64,
    half_length_m: f64,
    speed_mps: f64,
    /// Lanes that its rear has not left, the last one first.
    tail: Vec<LaneId>,
    /// From where on it asks, m before the junction.
    ask_m: f64,
}

impl Way {
    fn body(&self) -> Occupant {
        let Way { actor, s_m, half_length_m, speed_mps, .. } = *self;
        Occupant { actor, s_m, half_length_m, speed_mps }
    }

    /// Whether any part of the body is on one of `lanes`.
    fn is_on(&self, lanes: &[LaneId]) -> bool {
        lanes.contains(&self.lanes[0]) || self.tail.iter().any(|lane| lanes.contains(lane))
    }

    /// Which of `lanes` the rear is on, and its arc length there, m; the first and a negative one
    /// if it has yet to come there.
    fn rear_among(&self, lanes: &[LaneId], streets: &Streets) -> (usize, f64) {
        let mut rear_m = self.s_m - self.half_length_m;
        let mut at = self.lanes[0];
        for lane in &self.tail {
            at = *lane;
            rear_m += streets.lanes[at].length_m();
        }
        if let Some(index) = lanes.iter().position(|lane| *lane == at) {
            return (index, rear_m);
        }
        let before = self.lanes.iter().take_while(|lane| Some(*lane) != lanes.first());
        let to_first_m: f64 = before.map(|lane| streets.lanes[*lane].length_m()).sum();
        (0, self.s_m - self.half_length_m - to_first_m)
    }

    /// The lanes through the next junction, and on to where there is room to stand between two
    /// junctions; and the distance of the front from the first of them, m.
    fn through(&self, streets: &Streets) -> Option<(Vec<LaneId>, f64)> {
        let is_inside = |lane: &LaneId| streets.lanes[*lane].junction.is_some();
        let first = self.lanes.iter().position(is_inside)?;
        let before = self.lanes[..first].iter().map(|lane| streets.lanes[*lane].length_m());
        let distance_m = before.sum::<f64>() - self.s_m - self.half_length_m;
        let mut lanes: Vec<LaneId> = self.lanes[first..]
            .iter()
            .take_while(|lane| !streets.lanes[**lane].is_waiting_place())
            .copied()
            .collect();
        while lanes.last().is_some_and(|lane| !is_inside(lane)) {
            lanes.pop();
        }
        Some((lanes, distance_m))
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
        world::{
            kind::VEHICLES,
            streets::{Course, Lane},
        },
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

    /// The same cars on a ring end up at the speed at which the model's gap of steady traffic is
    /// the one that they have.
    #[test]
    fn cars_on_a_ring_settle_at_the_speed_of_the_models_own_theory() {
        let streets = ring();
        for cars in [20, 40, 60] {
            let actor = |id| Noise::of_actor(1, 0, id);
            let mut traffic = Traffic::default();
            for index in 0..cars {
                let s_m = RING_M * index as f64 / cars as f64;
                let (lane, id) = ((s_m / 250.0) as usize, 1 + index as ActorId);
                let mut vehicle = Vehicle::new(id, actor(id), &streets, lane, s_m % 250.0);
                (vehicle.model, vehicle.half_m) = (&VEHICLES[0], VEHICLES[0].half_m);
                (vehicle.haste, vehicle.aside_m, vehicle.keeps_aside_m) = (1.0, 0.0, 0.0);
                // A jolt, which has to fade.
                vehicle.speed_mps = if index % 5 == 0 { 2.0 } else { 6.0 };
                traffic.vehicles.push(vehicle);
            }
            for _ in 0..6000 {
                traffic.step(&streets, None, &[]);
            }
            let gap_m = RING_M / cars as f64 - 2.0 * VEHICLES[0].half_m.x;
            let idm = VEHICLES[0].idm();
            let (mut low, mut high) = (0.0, LIMIT_MPS);
            for _ in 0..60 {
                let middle = (low + high) / 2.0;
                let is_low = idm.steady_gap_m(middle, LIMIT_MPS) < gap_m;
                (low, high) = if is_low { (middle, high) } else { (low, middle) };
            }
            for vehicle in &traffic.vehicles {
                let off = (vehicle.speed_mps - low).abs();
                assert!(off < 0.02 * low, "{cars} cars: {} and not {low}", vehicle.speed_mps);
            }
        }
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
