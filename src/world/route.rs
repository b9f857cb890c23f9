//! The ego vehicle's way through the streets, as the world and the expert follow it.

use glam::DVec2;

use crate::{frame::Command, world::streets::LaneId};

/// A waypoint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Waypoint {
    pub position_m: DVec2,
    /// Of the ground.
    pub height_m: f64,
    /// From the start of the route, m.
    pub at_m: f64,
    /// The lane that it belongs to; in the middle of a lane change that of the target.
    pub lane: LaneId,
    /// Arc length on the lane, m.
    pub s_m: f64,
    pub in_junction: bool,
    pub limit_mps: f64,
    /// Without sign, 1/m.
    pub curvature_per_m: f64,
    pub command: Command,
}

/// Waypoints in order, evenly spaced.
#[derive(Clone, Debug)]
pub struct Route {
    waypoints: Vec<Waypoint>,
    step_m: f64,
}

/// How far back and ahead of the last place the nearest waypoint is looked for, m.
const BACK_M: f64 = 5.0;
const AHEAD_M: f64 = 30.0;

impl Route {
    /// Waypoints every `step_m`, two at least.
    pub fn new(waypoints: Vec<Waypoint>, step_m: f64) -> Route {
        Route { waypoints, step_m }
    }

    pub fn waypoints(&self) -> &[Waypoint] {
        &self.waypoints
    }

    pub fn length_m(&self) -> f64 {
        (self.waypoints.len() - 1) as f64 * self.step_m
    }

    pub fn goal_m(&self) -> DVec2 {
        self.waypoints[self.waypoints.len() - 1].position_m
    }

    /// Index of the waypoint at a distance from the start.
    pub fn index_at(&self, at_m: f64) -> usize {
        ((at_m / self.step_m).round().max(0.0) as usize).min(self.waypoints.len() - 1)
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
        let along = self.forward(index as f64 * self.step_m);
        let beyond = along.dot(position_m - self.waypoints[index].position_m);
        let at_m = index as f64 * self.step_m + beyond.clamp(-self.step_m, self.step_m);
        at_m.clamp(0.0, self.length_m())
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
