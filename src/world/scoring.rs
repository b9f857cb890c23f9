//! What is counted of a drive, in steps of 0.1 s (the paper's IV.B1).

use glam::DVec2;
use serde::{Deserialize, Serialize};

use crate::world::{ego::Car, route::Route, streets::Streets, traffic::STEP_S};

/// Limits of the overspeed metric, m/s: in junctions and elsewhere.
pub const JUNCTION_LIMIT_MPS: f64 = 20.0 / 3.6;
pub const LIMIT_MPS: f64 = 50.0 / 3.6;

/// The centre may be this far beyond the edge of a lane, m.
const EDGE_M: f64 = 0.5;

/// Directions further apart than this oppose each other, rad.
const OPPOSED_RAD: f64 = 120.0 / 180.0 * std::f64::consts::PI;

/// Sums over a drive; times in seconds, ways in metres.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Sums {
    pub steps: u64,
    pub driven_s: f64,
    pub driven_m: f64,
    /// Outside junctions on no lane, or on lanes against the route's direction alone.
    pub wrong_lane_s: f64,
    pub wrong_lane_m: f64,
    /// Outside junctions on no lane of the route.
    pub wrong_lane_strict_s: f64,
    pub overspeed_s: f64,
    pub overspeed_m: f64,
    pub junction_s: f64,
    pub standing_s: f64,
}

impl Sums {
    /// Take a step of [`STEP_S`] into account, by the state at its end.
    pub fn add(&mut self, streets: &Streets, route: &Route, progress_m: f64, ego: &Car) {
        let step_m = ego.speed_mps * STEP_S;
        self.steps += 1;
        self.driven_s += STEP_S;
        self.driven_m += step_m;
        self.standing_s += if ego.speed_mps < 0.1 { STEP_S } else { 0.0 };
        let waypoint = route.at(progress_m);
        let limit_mps = if waypoint.in_junction { JUNCTION_LIMIT_MPS } else { LIMIT_MPS };
        if ego.speed_mps > limit_mps {
            self.overspeed_s += STEP_S;
            self.overspeed_m += step_m;
        }
        if waypoint.in_junction {
            self.junction_s += STEP_S;
            return;
        }
        let (is_right, is_on_route) = on_lanes(streets, route, progress_m, ego.position_m);
        if !is_right {
            self.wrong_lane_s += STEP_S;
            self.wrong_lane_m += step_m;
        }
        if !is_on_route {
            self.wrong_lane_strict_s += STEP_S;
        }
    }
}

/// Whether a place lies on a lane of the route's direction, and on one of the route itself.
fn on_lanes(streets: &Streets, route: &Route, at_m: f64, place_m: DVec2) -> (bool, bool) {
    const NEAR_M: f64 = 10.0;
    let (from, to) = (route.index_at(at_m - NEAR_M), route.index_at(at_m + NEAR_M));
    let near = &route.waypoints()[from..=to];
    let forward = route.forward(at_m);
    let (mut is_right, mut is_on_route) = (false, false);
    for id in streets.lanes_near(place_m, 4.0) {
        let lane = &streets.lanes[id];
        let (s_m, aside_m) = lane.course.project(place_m);
        let is_beside = s_m > 0.0 && s_m < lane.length_m();
        if !is_beside || aside_m.abs() > lane.width_m / 2.0 + EDGE_M {
            continue;
        }
        is_right |= lane.course.at(s_m).forward.angle_to(forward).abs() < OPPOSED_RAD;
        is_on_route |= near.iter().any(|waypoint| waypoint.lane == id);
    }
    // Between two lanes that follow each other a place projects onto neither.
    let between = route.aside_m(place_m, at_m).abs() < EDGE_M;
    (is_right || between, is_on_route || between)
}
