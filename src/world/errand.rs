//! Somewhere to go: a start and a goal in a town, and the route between them.

use std::ops::RangeInclusive;

use crate::{
    map::{
        planner::{LanePlace, Planner},
        road_map::RoadMap,
    },
    noise::Noise,
    world::{
        itinerary::route_along,
        route::Route,
        streets::{LaneId, Streets},
    },
};

/// Lengths of routes, m (paper, section III.B).
pub const LENGTHS_M: RangeInclusive<f64> = 350.0..=1500.0;

/// What a lane change costs the planner, m.
pub const LANE_CHANGE_M: f64 = 30.0;

/// Starts and goals keep this far from the ends of their lanes, m.
const MARGIN_M: f64 = 8.0;

/// Draws before a town counts as one that has no such route.
const TRIES: usize = 400;

/// Stops on the way to make a route longer where a town is small.
const MOST_STOPS: usize = 4;

/// A route of a length in the range, drawn at random: to a place that far away, or by way of
/// others where the town is too small; `None` where there is none.
pub fn draw_route(
    map: &RoadMap,
    streets: &Streets,
    noise: &mut Noise,
    lengths_m: &RangeInclusive<f64>,
) -> Option<Route> {
    let planner = Planner::new(map, LANE_CHANGE_M);
    // Only where one comes from and goes on from.
    let connected = map.graph().strongly_connected();
    let usable: Vec<LaneId> = connected
        .into_iter()
        .filter(|id| {
            let lane = &streets.lanes[*id];
            lane.junction.is_none() && lane.length_m() > 2.0 * MARGIN_M + 4.0
        })
        .collect();
    if usable.is_empty() {
        return None;
    }
    let wanted_m = noise.uniform(*lengths_m.start(), *lengths_m.end());
    let mut best: Option<Route> = None;
    for _ in 0..TRIES {
        let (mut lanes, start_m) = (Vec::new(), MARGIN_M);
        let mut at = LanePlaceOnStreet { lane: noise.pick(&usable), s_m: start_m };
        for _ in 0..=MOST_STOPS {
            let lane = noise.pick(&usable);
            let goal = LanePlaceOnStreet { lane, s_m: streets.lanes[lane].length_m() - MARGIN_M };
            let plan = planner.between_places(at.on_map(map, streets), goal.on_map(map, streets));
            let Some(plan) = plan else { break };
            // The first lane is the last one of the way so far.
            lanes.extend(plan.lanes.into_iter().skip(usize::from(!lanes.is_empty())));
            at = goal;
            let Some(route) = route_along(streets, &lanes, start_m, at.s_m) else { break };
            let length_m = route.length_m();
            let misses = |route: &Route| (route.length_m() - wanted_m).abs();
            let is_better = best.as_ref().is_none_or(|best| misses(&route) < misses(best));
            if lengths_m.contains(&length_m) && is_better {
                best = Some(route);
            }
            if length_m > wanted_m {
                break;
            }
        }
        if best.as_ref().is_some_and(|best| (best.length_m() - wanted_m).abs() < 0.1 * wanted_m) {
            break;
        }
    }
    best
}

/// A place on a lane by its arc length, where the map has one by the road's `s`.
#[derive(Clone, Copy)]
struct LanePlaceOnStreet {
    lane: LaneId,
    s_m: f64,
}

impl LanePlaceOnStreet {
    fn on_map(self, map: &RoadMap, streets: &Streets) -> LanePlace {
        let lane = map.lane(self.lane);
        let share = self.s_m / streets.lanes[self.lane].length_m();
        let s_m = lane.entry_m() + (lane.exit_m() - lane.entry_m()) * share;
        LanePlace { lane: self.lane, s_m }
    }
}
