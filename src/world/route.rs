//! The ego vehicle's way through the streets, as the world and the expert follow it.

use glam::{DVec2, DVec3};

use crate::{
    dataset::{ego::EgoState, route::Path},
    frame::{self, Command, ROUTE_POINTS, ROUTE_SPACING_M},
    map::route::{MapRoute, RoutePoint},
    world::streets::{LaneId, Streets},
};

/// A waypoint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Waypoint {
    pub position_m: DVec2,
    /// Of the ground.
    pub height_m: f64,
    /// From the start of the route, m.
    pub at_m: f64,
    /// The lane that it belongs to; during a lane change the one nearer by.
    pub lane: LaneId,
    /// Arc length on the lane, m.
    pub s_m: f64,
    pub in_junction: bool,
    pub limit_mps: f64,
    /// Without sign, 1/m.
    pub curvature_per_m: f64,
    pub command: Command,
}

/// Waypoints in order, [`ROUTE_SPACING_M`] apart.
#[derive(Clone, Debug)]
pub struct Route {
    waypoints: Vec<Waypoint>,
    lane_changes: Vec<LaneChange>,
    strays: bool,
}

/// A stretch on which the route goes over from one lane to another beside it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LaneChange {
    /// From the start of the route, m.
    pub from_m: f64,
    pub to_m: f64,
    /// The lane that is changed into.
    pub into: LaneId,
}

/// A waypoint further beyond the edge of its lane than this strays, m.
const EDGE_M: f64 = 0.2;

/// How far back and ahead of the last place the nearest waypoint is looked for, m.
const BACK_M: f64 = 5.0;
const AHEAD_M: f64 = 30.0;

impl Route {
    /// A route over the map that the streets were paved from; `None` if it has no two points.
    pub fn new(route: &MapRoute, streets: &Streets) -> Option<Route> {
        let points = &route.points;
        let positions: Vec<DVec2> = points.iter().map(|p| p.position_m.truncate()).collect();
        let waypoint = |(index, point): (usize, &RoutePoint)| {
            let lane = &streets.lanes[point.lane];
            Waypoint {
                position_m: positions[index],
                height_m: point.position_m.z,
                at_m: index as f64 * ROUTE_SPACING_M,
                lane: point.lane,
                s_m: lane.course.project(positions[index]).0,
                in_junction: lane.junction.is_some(),
                limit_mps: lane.limit_mps,
                curvature_per_m: curvature_per_m(&positions, index),
                command: point.command,
            }
        };
        let waypoints: Vec<Waypoint> = points.iter().enumerate().map(waypoint).collect();
        if waypoints.len() < 2 {
            return None;
        }
        let lane_changes = lane_changes(&waypoints, streets);
        let strays = waypoints.iter().any(|waypoint| {
            let lane = &streets.lanes[waypoint.lane];
            lane.course.project(waypoint.position_m).1.abs() > lane.width_m / 2.0 + EDGE_M
        });
        Some(Route { waypoints, lane_changes, strays })
    }

    /// Lane changes, in order.
    pub fn lane_changes(&self) -> &[LaneChange] {
        &self.lane_changes
    }

    /// Whether it leads beside its lanes somewhere: a lane change had no room before a junction.
    pub fn strays(&self) -> bool {
        self.strays
    }

    pub fn waypoints(&self) -> &[Waypoint] {
        &self.waypoints
    }

    pub fn length_m(&self) -> f64 {
        (self.waypoints.len() - 1) as f64 * ROUTE_SPACING_M
    }

    pub fn goal_m(&self) -> DVec2 {
        self.waypoints[self.waypoints.len() - 1].position_m
    }

    /// Index of the waypoint at a distance from the start.
    pub fn index_at(&self, at_m: f64) -> usize {
        ((at_m / ROUTE_SPACING_M).round().max(0.0) as usize).min(self.waypoints.len() - 1)
    }

    /// The waypoint at a distance from the start.
    pub fn at(&self, at_m: f64) -> &Waypoint {
        &self.waypoints[self.index_at(at_m)]
    }

    /// Direction of the route at a distance from its start, as a unit vector.
    pub fn forward(&self, at_m: f64) -> DVec2 {
        let index = self.index_at(at_m).min(self.waypoints.len() - 2);
        let pair = &self.waypoints[index..index + 2];
        (pair[1].position_m - pair[0].position_m).normalize_or(DVec2::X)
    }

    /// Where along the route a place is, m, near where one was before. A route that comes by a
    /// place twice is so followed in its order.
    pub fn progress_m(&self, position_m: DVec2, before_m: f64) -> f64 {
        let (from, to) = (self.index_at(before_m - BACK_M), self.index_at(before_m + AHEAD_M));
        let distance = |index: usize| self.waypoints[index].position_m.distance_squared(position_m);
        let nearest = (from..=to).min_by(|a, b| distance(*a).total_cmp(&distance(*b)));
        let index = nearest.unwrap_or(from);
        let along = self.forward(index as f64 * ROUTE_SPACING_M);
        let beyond = along.dot(position_m - self.waypoints[index].position_m);
        let at_m = index as f64 * ROUTE_SPACING_M + beyond.clamp(-ROUTE_SPACING_M, ROUTE_SPACING_M);
        at_m.clamp(0.0, self.length_m())
    }

    /// The local route of a car that has come `at_m` and believes itself to be `now` (paper, equation
    /// 1), by the code that ingest uses for routes in logs.
    pub fn local(&self, at_m: f64, now: &EgoState) -> Option<frame::Route> {
        const SPAN_M: f64 = ROUTE_POINTS as f64 * ROUTE_SPACING_M;
        let (from, to) = (self.index_at(at_m - BACK_M), self.index_at(at_m + BACK_M + SPAN_M));
        let near = self.waypoints[from..=to].iter();
        let points_m: Vec<DVec3> = near.map(|w| w.position_m.extend(w.height_m)).collect();
        Path::planned(&points_m).ahead_on_route(now)
    }

    /// Distance of a place from the route at `at_m`, positive left, m.
    pub fn aside_m(&self, position_m: DVec2, at_m: f64) -> f64 {
        self.forward(at_m).perp_dot(position_m - self.at(at_m).position_m)
    }

    /// The lanes from `at_m` on, up to `ahead_m`, and the arc length on the first of them.
    pub fn lanes_ahead(&self, at_m: f64, ahead_m: f64) -> (Vec<LaneId>, f64) {
        let (from, to) = (self.index_at(at_m), self.index_at(at_m + ahead_m));
        let mut lanes: Vec<LaneId> = Vec::new();
        for waypoint in &self.waypoints[from..=to] {
            if lanes.last() != Some(&waypoint.lane) {
                lanes.push(waypoint.lane);
            }
        }
        (lanes, self.waypoints[from].s_m)
    }
}

/// Stretches around every step from a lane to one beside it, as far as the route is not in the
/// middle of either.
fn lane_changes(waypoints: &[Waypoint], streets: &Streets) -> Vec<LaneChange> {
    const MIDDLE_M: f64 = 0.25;
    let is_aside = |index: &usize| {
        let waypoint = &waypoints[*index];
        let lane = &streets.lanes[waypoint.lane];
        lane.course.project(waypoint.position_m).1.abs() > MIDDLE_M
    };
    let steps = (1..waypoints.len()).filter(|index| {
        let (before, lane) = (waypoints[index - 1].lane, waypoints[*index].lane);
        before != lane && !streets.lanes[before].next.contains(&lane)
    });
    let change = |index: usize| {
        let from = (0..index).rev().find(|index| !is_aside(index)).unwrap_or(0);
        let to = (index..waypoints.len()).find(|index| !is_aside(index));
        let to = to.unwrap_or(waypoints.len() - 1);
        let (from_m, to_m) = (waypoints[from].at_m, waypoints[to].at_m);
        LaneChange { from_m, to_m, into: waypoints[index].lane }
    };
    steps.map(change).collect()
}

/// Curvature from two chords of 2 m, 1/m, without sign.
fn curvature_per_m(positions: &[DVec2], index: usize) -> f64 {
    const CHORD_M: f64 = 2.0;
    let reach = (CHORD_M / ROUTE_SPACING_M) as usize;
    let (from, to) = (index.saturating_sub(reach), (index + reach).min(positions.len() - 1));
    let (before, after) = (positions[index] - positions[from], positions[to] - positions[index]);
    let length_m = 0.5 * (before.length() + after.length());
    let is_end = from == index || to == index;
    if is_end { 0.0 } else { before.angle_to(after).abs() / length_m.max(ROUTE_SPACING_M) }
}
