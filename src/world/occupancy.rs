//! Who is on which lane, in order: what a driver finds ahead and behind.

use crate::world::{
    car_following::Ahead,
    reservation::ActorId,
    streets::{LaneId, Streets},
};

/// How far ahead drivers look, m.
pub const HORIZON_M: f64 = 120.0;

/// A body on a lane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Occupant {
    pub actor: ActorId,
    /// Arc length of its middle, m; negative if it is on its way there and may enter, so that those
    /// who merge see it in time.
    pub s_m: f64,
    pub half_length_m: f64,
    /// Along the lane, m/s.
    pub speed_mps: f64,
}

/// Bodies by lane, ascending by arc length.
#[derive(Clone, Debug, Default)]
pub struct Occupancy {
    by_lane: Vec<Vec<Occupant>>,
    used: Vec<LaneId>,
}

/// A body that asks what is around it.
#[derive(Clone, Copy, Debug)]
pub struct Asker {
    pub actor: ActorId,
    pub s_m: f64,
    pub half_length_m: f64,
}

impl Occupancy {
    /// Nobody on any of so many lanes.
    pub fn clear(&mut self, lanes: usize) {
        self.by_lane.resize_with(lanes, Vec::new);
        for lane in self.used.drain(..) {
            self.by_lane[lane].clear();
        }
    }

    /// Put a body on a lane, in its place of the order.
    pub fn insert(&mut self, lane: LaneId, body: Occupant) {
        let bodies = &mut self.by_lane[lane];
        if bodies.is_empty() {
            self.used.push(lane);
        }
        let key = |other: &Occupant| (other.s_m, other.actor);
        let place = bodies.partition_point(|other| key(other) < key(&body));
        bodies.insert(place, body);
    }

    pub fn on(&self, lane: LaneId) -> &[Occupant] {
        &self.by_lane[lane]
    }

    /// The next body along a way of lanes, of which the asker is on the first, up to `horizon_m`.
    pub fn ahead(
        &self,
        streets: &Streets,
        way: impl Iterator<Item = LaneId>,
        asker: Asker,
        horizon_m: f64,
    ) -> Option<Ahead> {
        // From the asker's middle to the start of the lane.
        let mut start_m = -asker.s_m;
        let mut nearest: Option<(f64, &Occupant)> = None;
        for lane in way {
            let mut meet = |at_m: f64, body| {
                if nearest.is_none_or(|(best, _)| at_m < best) {
                    nearest = Some((at_m, body));
                }
            };
            let is_ahead = |at_m: f64, body: &Occupant| {
                body.actor != asker.actor && (at_m, body.actor) > (0.0, asker.actor)
            };
            for body in &self.by_lane[lane] {
                if is_ahead(start_m + body.s_m, body) {
                    meet(start_m + body.s_m, body);
                    break;
                }
            }
            for &(sibling, together_m) in streets.siblings(lane) {
                for body in &self.by_lane[sibling] {
                    let at_m = start_m + body.s_m;
                    let is_together = body.s_m - body.half_length_m < together_m;
                    if body.s_m >= 0.0 && is_together && is_ahead(at_m, body) {
                        meet(at_m, body);
                        break;
                    }
                }
            }
            // Of two that merge, the one nearer to where the lanes are one goes first.
            let length_m = streets.lanes[lane].length_m();
            for &other in streets.merging(lane) {
                let shift_m = length_m - streets.lanes[other].length_m();
                for body in &self.by_lane[other] {
                    let at_m = start_m + body.s_m + shift_m;
                    if is_ahead(at_m, body) {
                        meet(at_m, body);
                        break;
                    }
                }
            }
            start_m += length_m;
            if nearest.is_some() || start_m > horizon_m {
                break;
            }
        }
        let (at_m, body) = nearest.filter(|(at_m, _)| *at_m <= horizon_m)?;
        let gap_m = at_m - asker.half_length_m - body.half_length_m;
        Some(Ahead { gap_m, speed_mps: body.speed_mps })
    }

    /// The next body behind an arc length of a lane, up to `horizon_m`, and its distance from there,
    /// middle to middle, m.
    pub fn behind(
        &self,
        streets: &Streets,
        lane: LaneId,
        asker: Asker,
        horizon_m: f64,
    ) -> Option<(f64, &Occupant)> {
        let others = |body: &&Occupant| body.actor != asker.actor;
        let here = self.by_lane[lane].iter().filter(others).rev().find(|b| b.s_m <= asker.s_m);
        if let Some(body) = here {
            return Some((asker.s_m - body.s_m, body)).filter(|(gap, _)| *gap <= horizon_m);
        }
        let last = |before: &LaneId| {
            let length_m = streets.lanes[*before].length_m();
            let body = self.by_lane[*before].iter().rfind(others)?;
            Some((asker.s_m + length_m - body.s_m, body))
        };
        let behind = streets.lanes[lane].previous.iter().filter_map(last);
        behind.min_by(|a, b| a.0.total_cmp(&b.0)).filter(|(gap, _)| *gap <= horizon_m)
    }
}
