//! From the lanes of a plan to a route: 0.4 m waypoints, smooth lane changes, turn commands.

use glam::DVec2;

use crate::{
    frame::Command,
    world::{
        route::{Route, Waypoint},
        streets::{LaneId, Spot, Streets},
    },
};

/// Distance between waypoints, m (paper, equation 1).
pub const SPACING_M: f64 = 0.4;

/// A lane change takes up to this much road, and begins so far into what is left of the lane.
const CHANGE_M: f64 = 35.0;
const CHANGE_BEGINS: f64 = 0.2;

/// A junction is announced this far ahead, m.
const ANNOUNCED_M: f64 = 25.0;

/// Turns of less are straight on, rad.
const STRAIGHT_RAD: f64 = 0.5;

/// A place on a lane on the way.
#[derive(Clone, Copy)]
struct Place {
    position_m: DVec2,
    height_m: f64,
    lane: LaneId,
    s_m: f64,
}

/// The route along lanes each of which the one before leads into, or lies beside, from an arc
/// length on the first to one on the last; `None` if it is shorter than two waypoints.
pub fn route_along(streets: &Streets, lanes: &[LaneId], from_m: f64, to_m: f64) -> Option<Route> {
    let mut places: Vec<Place> = Vec::new();
    let mut s_m = from_m;
    let mut index = 0;
    while index < lanes.len() {
        // Lanes beside each other, all driven on one stretch.
        let mut last = index;
        while last + 1 < lanes.len() && !streets.lanes[lanes[last]].next.contains(&lanes[last + 1])
        {
            last += 1;
        }
        let beside = &lanes[index..=last];
        let first = &streets.lanes[beside[0]];
        let is_goal = last + 1 == lanes.len();
        let goal = &streets.lanes[beside[beside.len() - 1]];
        let end_m = if is_goal { goal.beside_m(to_m, first) } else { first.length_m() };
        stretch(streets, beside, s_m, end_m, &mut places);
        s_m = 0.0;
        index = last + 1;
    }
    let mut waypoints = evenly(&places, streets);
    if waypoints.len() < 2 {
        return None;
    }
    bend(&mut waypoints);
    announce(streets, &mut waypoints);
    Some(Route::new(waypoints, SPACING_M))
}

/// Drive from `from_m` to `to_m` of the first lane while changing over to the last.
fn stretch(streets: &Streets, beside: &[LaneId], from_m: f64, to_m: f64, places: &mut Vec<Place>) {
    let first = &streets.lanes[beside[0]];
    let changes = beside.len() - 1;
    let left_m = (to_m - from_m).max(0.0);
    let change_m = (left_m * 0.7 / changes.max(1) as f64).min(CHANGE_M);
    let steps = (left_m / SPACING_M).ceil().max(1.0);
    for step in 0..=steps as usize {
        let s_m = from_m + left_m * step as f64 / steps;
        let into_m = s_m - from_m - CHANGE_BEGINS * left_m;
        // How many lanes over, with a share of the next change.
        let over = (into_m / change_m.max(1e-6)).clamp(0.0, changes as f64);
        let (now, share) = (over.floor() as usize, over.fract());
        let (now, share) = if now == changes { (changes, 0.0) } else { (now, share) };
        let smooth = share * share * (3.0 - 2.0 * share);
        let at = |index: usize| {
            let lane = &streets.lanes[beside[index]];
            let s_m = first.beside_m(s_m, lane);
            (lane.course.at(s_m), s_m)
        };
        let (here, here_s) = at(now);
        let place = if share > 0.0 {
            let (there, there_s) = at(now + 1);
            let position_m = here.position_m.lerp(there.position_m, smooth);
            Place { position_m, height_m: there.height_m, lane: beside[now + 1], s_m: there_s }
        } else {
            let Spot { position_m, height_m, .. } = here;
            Place { position_m, height_m, lane: beside[now], s_m: here_s }
        };
        places.push(place);
    }
}

/// Waypoints every [`SPACING_M`] along the line through all places.
fn evenly(places: &[Place], streets: &Streets) -> Vec<Waypoint> {
    let mut waypoints = Vec::new();
    let mut next_m = 0.0;
    let mut before_m = 0.0;
    for pair in places.windows(2) {
        let length_m = pair[0].position_m.distance(pair[1].position_m);
        while length_m > 0.0 && next_m <= before_m + length_m {
            let share = (next_m - before_m) / length_m;
            let nearer = if share < 0.5 { &pair[0] } else { &pair[1] };
            let lane = &streets.lanes[nearer.lane];
            waypoints.push(Waypoint {
                position_m: pair[0].position_m.lerp(pair[1].position_m, share),
                height_m: nearer.height_m,
                at_m: next_m,
                lane: nearer.lane,
                s_m: nearer.s_m,
                in_junction: lane.junction.is_some(),
                limit_mps: lane.limit_mps,
                curvature_per_m: 0.0,
                command: Command::Follow,
            });
            next_m += SPACING_M;
        }
        before_m += length_m;
    }
    waypoints
}

/// Curvature from three places 2 m apart.
fn bend(waypoints: &mut [Waypoint]) {
    let reach = (2.0 / SPACING_M) as usize;
    let positions: Vec<DVec2> = waypoints.iter().map(|waypoint| waypoint.position_m).collect();
    for (index, waypoint) in waypoints.iter_mut().enumerate() {
        let (from, to) = (index.saturating_sub(reach), (index + reach).min(positions.len() - 1));
        let (before, after) =
            (positions[index] - positions[from], positions[to] - positions[index]);
        if before.length() > 0.5 && after.length() > 0.5 {
            let turn_rad = before.angle_to(after).abs();
            waypoint.curvature_per_m = turn_rad / (0.5 * (before.length() + after.length()));
        }
    }
}

/// Turns at junctions, said before and throughout.
fn announce(streets: &Streets, waypoints: &mut [Waypoint]) {
    let mut index = 0;
    while index < waypoints.len() {
        if !waypoints[index].in_junction {
            index += 1;
            continue;
        }
        let end = (index..waypoints.len()).find(|i| !waypoints[*i].in_junction);
        let end = end.unwrap_or(waypoints.len());
        let heading = |at: usize| {
            let at = at.clamp(1, waypoints.len() - 1);
            waypoints[at].position_m - waypoints[at - 1].position_m
        };
        let turn_rad = heading(index).angle_to(heading(end));
        let has_choice = waypoints[index..end].iter().any(|waypoint| {
            let before = &streets.lanes[waypoint.lane].previous;
            before.iter().any(|lane| streets.lanes[*lane].next.len() > 1)
        });
        let command = match turn_rad {
            _ if !has_choice => Command::Follow,
            turn if turn > STRAIGHT_RAD => Command::Left,
            turn if turn < -STRAIGHT_RAD => Command::Right,
            _ => Command::Straight,
        };
        let announced = index.saturating_sub((ANNOUNCED_M / SPACING_M) as usize);
        for waypoint in &mut waypoints[announced..end] {
            waypoint.command = command;
        }
        index = end;
    }
}
