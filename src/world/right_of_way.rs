//! Who comes near a junction asks for its way; who may go is let in.
//!
//! The rules between claims are in [`crate::world::reservation`]; here they are brought up to date
//! with where everybody is.

use crate::world::{
    car_following::Ahead,
    kind::REST_GAP_M,
    occupancy::{Asker, HORIZON_M, Occupancy, Occupant},
    reservation::{ActorId, Claim, Reservations},
    streets::{LaneId, Streets},
};

/// A claim is asked for at this distance from the junction at the latest, and where braking to the
/// line would still be comfortable, m.
pub const ASK_M: f64 = 20.0;

/// Longer than twice this, a vehicle needs more room in bends than cars do, m.
const WIDE_M: f64 = 3.2;

/// Least room behind a junction, beyond the own length, m.
const ROOM_M: f64 = 3.0;

/// An actor on its way to a junction.
pub struct Way {
    pub actor: ActorId,
    pub lanes: Vec<LaneId>,
    pub s_m: f64,
    pub half_length_m: f64,
    pub speed_mps: f64,
    /// Lanes that its rear has not left, the last one first.
    pub tail: Vec<LaneId>,
    /// From where on it asks, m before the junction.
    pub ask_m: f64,
    /// Steps for which it has stood: who thinks of another way meanwhile keeps its turn.
    pub stood: u64,
}

impl Way {
    pub fn body(&self) -> Occupant {
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

/// Bring everybody's claims up to date at a step, and let in whoever may go.
pub fn settle(
    reservations: &mut Reservations,
    occupancy: &Occupancy,
    streets: &Streets,
    ways: &[Way],
    step: u64,
) {
    for way in ways {
        let through = way.through(streets);
        reservations.forget(way.actor, |claim| {
            let is_next = through.as_ref().is_some_and(|(lanes, _)| claim.lanes[0] == lanes[0]);
            is_next || way.is_on(&claim.lanes)
        });
        if let Some((lanes, distance_m)) = through
            && distance_m < way.ask_m
        {
            reservations.ask(Claim {
                actor: way.actor,
                lanes,
                since: step.saturating_sub(way.stood),
                is_taken: distance_m <= 0.0,
                has_room: false,
                is_wide: way.half_length_m > WIDE_M,
                length_m: 2.0 * way.half_length_m,
                speed_mps: way.speed_mps,
                rear: (0, 0.0),
            });
        }
        let may_go = |lanes: &[LaneId]| {
            is_at_the_head(reservations, occupancy, streets, way, lanes)
                && has_room(reservations, occupancy, streets, way, lanes)
        };
        let updates: Vec<(usize, (usize, f64), bool)> = reservations
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
            let claim: &mut Claim = &mut reservations.claims_mut()[index];
            claim.rear = rear;
            claim.speed_mps = way.speed_mps;
            claim.has_room = has_room;
        }
    }
    reservations.settle(streets);
}

/// Whether all who are between an actor and its junction may enter themselves: a way that is
/// taken by somebody who cannot move would be lost to all.
fn is_at_the_head(
    reservations: &Reservations,
    occupancy: &Occupancy,
    streets: &Streets,
    way: &Way,
    through: &[LaneId],
) -> bool {
    let before = way.lanes.iter().take_while(|lane| Some(*lane) != through.first());
    let Some(approach) = before.clone().last() else { return true };
    let leads_in = |lane: &LaneId| streets.lanes[*approach].next.contains(lane);
    let has_way = |actor: ActorId| {
        let mut claims = reservations.claims().iter();
        claims.any(|c| c.actor == actor && c.is_taken && c.lanes.iter().any(leads_in))
    };
    before.enumerate().all(|(index, lane)| {
        let from_m = if index == 0 { way.s_m } else { f64::NEG_INFINITY };
        let mut ahead = occupancy.on(*lane).iter().filter(|body| body.s_m > from_m);
        ahead.all(|body| body.actor == way.actor || has_way(body.actor))
    })
}

/// Whether a vehicle could stand behind the junction, with all who are on their way there: now,
/// and when all of them queue at the next one.
fn has_room(
    reservations: &Reservations,
    occupancy: &Occupancy,
    streets: &Streets,
    way: &Way,
    through: &[LaneId],
) -> bool {
    let Some(last) = through.last() else { return true };
    let Some(at) = way.lanes.iter().position(|lane| lane == last) else { return true };
    let beyond = &way.lanes[at + 1..];
    let Some(exit) = beyond.first() else { return true };
    let on_their_way = reservations.claims().iter().filter(|claim| {
        claim.is_taken
            && claim.actor != way.actor
            && claim.lanes.last().is_some_and(|lane| streets.lanes[*lane].next.contains(exit))
    });
    let theirs_m: f64 = on_their_way.map(|claim| claim.length_m + REST_GAP_M).sum();
    let needed_m = 2.0 * way.half_length_m + ROOM_M + theirs_m;

    let asker = Asker { actor: way.actor, s_m: 0.0, half_length_m: 0.0 };
    let ahead = occupancy.ahead(streets, beyond.iter().copied(), asker, HORIZON_M);
    // Who moves on will have made room.
    let has_now = |ahead: Ahead| ahead.gap_m + 3.0 * ahead.speed_mps > needed_m;
    // Up to the next junction; a way that ends before it, as a route does, has no end of its own.
    let Some(end) = beyond.iter().position(|lane| streets.lanes[*lane].junction.is_some()) else {
        return ahead.is_none_or(has_now);
    };
    let queue = &beyond[..end];
    let line_m = queue.last().map_or(0.0, |lane| streets.lanes[*lane].line_m);
    let length_m: f64 = queue.iter().map(|lane| streets.lanes[*lane].length_m()).sum();
    let bodies = queue.iter().flat_map(|lane| occupancy.on(*lane));
    let others = bodies.filter(|body| body.actor != way.actor);
    let taken_m: f64 = others.map(|body| 2.0 * body.half_length_m + REST_GAP_M).sum();
    ahead.is_none_or(has_now) && length_m - line_m - taken_m > needed_m
}
