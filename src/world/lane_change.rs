//! Changing lanes: what is worth it and does nobody harm.

use crate::world::{
    car_following::{Ahead, Change, Idm, MOBIL},
    occupancy::{Asker, HORIZON_M, Occupancy},
    streets::{LaneId, Streets},
    vehicle::{ASIDE_MPS, ASIDE_PER_SPEED, Vehicle},
};

/// How the one behind is taken to follow, when a lane is changed.
const FOLLOWER: Idm =
    Idm { acceleration_mps2: 1.5, comfort_mps2: 2.0, time_gap_s: 1.2, rest_gap_m: 2.0 };

/// A neighbouring lane that is worth a change.
pub fn better_lane(occupancy: &Occupancy, streets: &Streets, vehicle: &Vehicle) -> Option<LaneId> {
    let lane = &streets.lanes[vehicle.lane];
    let left_m = lane.dead_end_m.unwrap_or(lane.length_m()) - vehicle.s_m;
    let leads_nowhere = lane.dead_end_m.is_some();
    // Who stands at the end of a lane has to get out of it; others change on the move.
    let is_too_early = vehicle.s_m < 8.0 || vehicle.speed_mps < 2.0;
    if lane.junction.is_some() || is_too_early && !leads_nowhere {
        return None;
    }
    // Not right before a junction, unless the lane ends there.
    if !leads_nowhere && left_m < 25.0 + 2.0 * vehicle.speed_mps {
        return None;
    }
    let bias = if leads_nowhere { 4.0 * (1.0 - left_m / 150.0).clamp(0.0, 1.0) } else { 0.0 };
    let idm = vehicle.model.idm();
    let wish = vehicle.view.wish_mps;
    let own = |way: &mut dyn Iterator<Item = LaneId>, asker| {
        let ahead = occupancy.ahead(streets, way, asker, HORIZON_M);
        idm.acceleration_mps2(vehicle.speed_mps, wish, ahead)
    };
    let ahead = occupancy.ahead(streets, vehicle.way(), vehicle.asker(), HORIZON_M);
    let before = idm.acceleration_mps2(vehicle.speed_mps, wish, ahead);
    if ahead.is_some_and(|ahead| !comes_clear_of(vehicle, lane.width_m, ahead)) {
        return None;
    }
    let is_wanted = |to: &LaneId| {
        let target = &streets.lanes[*to];
        let asker = Asker { s_m: lane.beside_m(vehicle.s_m, target), ..vehicle.asker() };
        let mut way = std::iter::once(*to).chain(target.next.first().copied());
        let after = own(&mut way, asker);
        let follower = occupancy.behind(streets, *to, asker, HORIZON_M);
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
    let leads_on = |to: &LaneId| streets.lanes[*to].dead_end_m.is_none();
    [lane.left, lane.right].into_iter().flatten().filter(leads_on).find(is_wanted)
}

/// Whether a vehicle is out of its lane before it reaches who is ahead there, if it changes now.
fn comes_clear_of(vehicle: &Vehicle, width_m: f64, ahead: Ahead) -> bool {
    /// It may speed up so much meanwhile, as a share of its speed; who stands will move off.
    const FASTER: f64 = 1.25;
    const MOVED_OFF_MPS: f64 = 1.0;
    let speed_mps = vehicle.speed_mps.max(MOVED_OFF_MPS);
    let closing_mps = (FASTER * speed_mps - ahead.speed_mps).max(0.0);
    // Bodies in the middle of their lanes are clear of each other when one is half a lane aside
    // and half its own width.
    let aside_m = width_m / 2.0 + vehicle.half_m.y;
    let clear_s = aside_m / ASIDE_MPS.min(ASIDE_PER_SPEED * speed_mps);
    ahead.gap_m > closing_mps * clear_s + 1.0
}
