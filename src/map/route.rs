//! A way to drive as points at equal distances, with the command that each of them is under.

use std::ops::Range;

use glam::DVec3;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use crate::{
    dataset::ego::wrap_angle,
    frame::{Command, ROUTE_POINTS, ROUTE_SPACING_M},
    map::{
        graph::LaneId,
        planner::{LanePlace, Planner},
        road_map::RoadMap,
    },
};

/// Spacing of the points that a way is laid out with before it is resampled, m.
const FINE_M: f64 = 0.2;

/// Longest stretch that a lane change is spread over, m.
const CHANGE_M: f64 = 40.0;

/// Where there is less room than this for a lane change, it goes on into the next lanes, m.
const SHORTEST_CHANGE_M: f64 = 12.0;

/// Lanes that do not meet are joined over this many times the gap, at least `JOIN_M`.
const JOIN_SHARE: f64 = 15.0;
const JOIN_M: f64 = 5.0;

/// A junction that turns a driver by less is driven straight on, rad (35 degrees, as CARLA's).
const STRAIGHT_RAD: f64 = 35.0 * std::f64::consts::PI / 180.0;

/// A command is given this far before the junction, m: as far as the local route shows.
const AHEAD_M: f64 = (ROUTE_POINTS - 1) as f64 * ROUTE_SPACING_M;

/// Ways that are tried before a random route is given up.
const ATTEMPTS: usize = 64;

/// A point of a route.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RoutePoint {
    /// Map frame, m.
    pub position_m: DVec3,
    /// The lane that is driven in there; during a lane change the one nearer by.
    pub lane: LaneId,
    pub command: Command,
}

/// Points [`ROUTE_SPACING_M`] apart along the way, seen from above.
#[derive(Clone, Debug, PartialEq)]
pub struct MapRoute {
    pub points: Vec<RoutePoint>,
    /// Turns at junctions, in order.
    pub turns: Vec<Command>,
}

impl MapRoute {
    /// Arc length, m.
    pub fn length_m(&self) -> f64 {
        self.points.len().saturating_sub(1) as f64 * ROUTE_SPACING_M
    }

    /// The cheapest way through places in their order; the error is the index of the first that
    /// cannot be reached from the one before.
    pub fn through(planner: &Planner, places: &[LanePlace]) -> Result<Self, usize> {
        let mut lanes: Vec<LaneId> = Vec::new();
        for (index, pair) in places.windows(2).enumerate() {
            let plan = planner.between_places(pair[0], pair[1]).ok_or(index + 1)?;
            lanes.extend(&plan.lanes[usize::from(!lanes.is_empty())..]);
        }
        let [start, .., goal] = places else { return Err(0) };
        Ok(MapRoute::along(planner.map(), &lanes, start.s_m, goal.s_m))
    }

    /// A route in given lanes, each of which follows the one before or lies beside it, from and
    /// to an `s` of the first and the last road.
    pub fn along(map: &RoadMap, lanes: &[LaneId], from_m: f64, to_m: f64) -> Self {
        let mut way = Vec::new();
        let stretches = stretches(map, lanes);
        for (index, stretch) in stretches.iter().enumerate() {
            let (first, last) = (map.lane(lanes[stretch.start]), map.lane(lanes[stretch.end - 1]));
            let start_m = if index == 0 { from_m } else { first.entry_m() };
            let end_m = if index + 1 == stretches.len() { to_m } else { last.exit_m() };
            lay_out(map, &lanes[stretch.clone()], start_m, end_m, &mut way);
        }
        let mut points = resampled(&way);
        let turns = command(map, &mut points);
        MapRoute { points, turns }
    }

    /// A random route with a length within `length_m`, that begins and ends outside of junctions;
    /// it leads through via-points where the map is small. None if no such route is found.
    pub fn random(planner: &Planner, seed: u64, length_m: Range<f64>) -> Option<Self> {
        let map = planner.map();
        let connected = map.graph().strongly_connected();
        let open: Vec<LaneId> =
            connected.into_iter().filter(|lane| !map.lane(*lane).in_junction).collect();
        if open.is_empty() {
            return None;
        }
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let wanted_m = length_m.start + (length_m.end - length_m.start) * random.random::<f64>();
        let mut place = || {
            let lane = open[random.random_range(0..open.len())];
            let (from_m, to_m) = (map.lane(lane).from_m, map.lane(lane).to_m);
            LanePlace { lane, s_m: from_m + (to_m - from_m) * random.random::<f64>() }
        };
        let mut places = vec![place()];
        for _ in 0..ATTEMPTS {
            places.push(place());
            let Ok(mut route) = MapRoute::through(planner, &places) else {
                places.pop();
                continue;
            };
            if route.length_m() < wanted_m {
                continue;
            }
            route.points.truncate((wanted_m / ROUTE_SPACING_M) as usize + 1);
            while route.points.pop_if(|last| map.lane(last.lane).in_junction).is_some() {}
            if length_m.contains(&route.length_m()) {
                route.turns = command(map, &mut route.points);
                return Some(route);
            }
            places.truncate(1);
        }
        None
    }
}

/// Ranges of lanes that lie beside each other: within each, only lane changes.
fn stretches(map: &RoadMap, lanes: &[LaneId]) -> Vec<Range<usize>> {
    let mut stretches: Vec<Range<usize>> = Vec::new();
    for (index, lane) in lanes.iter().enumerate() {
        let is_change = index > 0 && map.lane(lanes[index - 1]).changes().any(|id| id == *lane);
        match stretches.last_mut() {
            Some(stretch) if is_change => stretch.end = index + 1,
            _ => stretches.push(index..index + 1),
        }
    }
    stretches
}

/// Add a stretch to a way: its lane changes are spread evenly over it, and it leads on from
/// where the way ends.
fn lay_out(
    map: &RoadMap,
    lanes: &[LaneId],
    from_m: f64,
    to_m: f64,
    way: &mut Vec<(DVec3, LaneId)>,
) {
    let length_m = (to_m - from_m).abs();
    let start_m =
        way.last().map_or_else(|| map.centre(lanes[0], from_m).position_m, |(last_m, _)| *last_m);
    let room_m = length_m / (lanes.len() - 1).max(1) as f64;
    let lanes = if room_m < SHORTEST_CHANGE_M { &lanes[lanes.len() - 1..] } else { lanes };
    let changes = lanes.len() - 1;
    let share_m = length_m / changes.max(1) as f64;
    let change_m = share_m.min(CHANGE_M);
    let at = |driven_m: f64| {
        let s_m = from_m + (to_m - from_m).signum() * driven_m;
        let index = ((driven_m / share_m.max(f64::EPSILON)) as usize).min(changes.max(1) - 1);
        let place = |index: usize| map.centre(lanes[index], s_m).position_m;
        if changes == 0 {
            return (place(0), lanes[0]);
        }
        let middle_m = (index as f64 + 0.5) * share_m;
        let across = smooth((driven_m - middle_m) / change_m.max(f64::EPSILON) + 0.5);
        let lane = lanes[index + usize::from(across > 0.5)];
        (place(index).lerp(place(index + 1), across), lane)
    };
    let gap_m = start_m - at(0.0).0;
    let join_m = (JOIN_SHARE * gap_m.length()).max(JOIN_M);
    let steps = (length_m / FINE_M).ceil().max(1.0);
    for step in 0..=steps as usize {
        let driven_m = length_m * step as f64 / steps;
        let (position_m, lane) = at(driven_m);
        way.push((position_m + gap_m * (1.0 - smooth(driven_m / join_m)), lane));
    }
}

/// From 0 to 1 without a jump of slope or curvature.
fn smooth(share: f64) -> f64 {
    let x = share.clamp(0.0, 1.0);
    x * x * x * (10.0 - 15.0 * x + 6.0 * x * x)
}

/// Points at equal distances along a way; what is left over at the end is cut off.
fn resampled(way: &[(DVec3, LaneId)]) -> Vec<RoutePoint> {
    let point = |position_m, lane| RoutePoint { position_m, lane, command: Command::Follow };
    let Some((first_m, lane)) = way.first() else { return Vec::new() };
    let mut points = vec![point(*first_m, *lane)];
    let mut until_next_m = ROUTE_SPACING_M;
    for pair in way.windows(2) {
        let ((from_m, _), (to_m, lane)) = (pair[0], pair[1]);
        let step_m = (to_m - from_m).truncate().length();
        let mut along_m = until_next_m;
        while along_m <= step_m {
            points.push(point(from_m.lerp(to_m, along_m / step_m), lane));
            along_m += ROUTE_SPACING_M;
        }
        until_next_m = along_m - step_m;
    }
    points
}

/// Put every point under the command of the junction it is in or before; the turns in order.
fn command(map: &RoadMap, points: &mut [RoutePoint]) -> Vec<Command> {
    let junction = |point: &RoutePoint| {
        let lane = map.lane(point.lane);
        lane.in_junction.then_some(lane.junction)
    };
    let mut turns = Vec::new();
    let (mut start, mut passed) = (0, 0);
    while start < points.len() {
        let here = junction(&points[start]);
        let same = points[start..].iter().take_while(|point| junction(point) == here).count();
        let end = start + same;
        if here.is_some() {
            let turn = turn(points, start..end);
            let ahead = (AHEAD_M / ROUTE_SPACING_M) as usize;
            for point in &mut points[passed.max(start.saturating_sub(ahead))..end] {
                point.command = turn;
            }
            turns.push(turn);
            passed = end;
        }
        start = end;
    }
    turns
}

/// Which way a stretch of points turns.
fn turn(points: &[RoutePoint], range: Range<usize>) -> Command {
    // From before the junction to behind it, where the roads have their directions.
    let around = range.start.saturating_sub(1)..(range.end + 1).min(points.len());
    let headings: Vec<f64> = points[around]
        .windows(2)
        .map(|pair| (pair[1].position_m - pair[0].position_m).truncate().to_angle())
        .collect();
    // Summed up step by step: a loop turns by more than half a circle.
    let turned_rad: f64 = headings.windows(2).map(|pair| wrap_angle(pair[1] - pair[0])).sum();
    match turned_rad {
        turned if turned > STRAIGHT_RAD => Command::Left,
        turned if turned < -STRAIGHT_RAD => Command::Right,
        _ => Command::Straight,
    }
}
