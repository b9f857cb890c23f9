//! The shortest way from lane to lane: A* over metres and lane changes.

use std::{
    cmp::Reverse,
    collections::{BTreeMap, BinaryHeap},
};

use glam::DVec3;

use crate::map::{
    graph::{GraphLane, LaneId},
    road_map::RoadMap,
};

/// A place to start from or to go to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LanePlace {
    pub lane: LaneId,
    /// Of the road, m.
    pub s_m: f64,
}

/// Lanes to drive in, in order.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    pub lanes: Vec<LaneId>,
    /// Metres between the starts of the lanes that are followed, and what the lane changes cost;
    /// lengths as [`GraphLane::waypoint_length_m`].
    pub cost_m: f64,
}

/// Searches one map.
#[derive(Clone, Debug)]
pub struct Planner<'map> {
    map: &'map RoadMap,
    lane_change_m: f64,
    entries_m: Vec<DVec3>,
    /// The straight line between two places, times this, is never more than the way costs.
    straight_share: f64,
}

impl<'map> Planner<'map> {
    /// `lane_change_m` is what a lane change costs beside the way; nothing below 0.
    pub fn new(map: &'map RoadMap, lane_change_m: f64) -> Self {
        let lane_change_m = lane_change_m.max(0.0);
        let lanes = map.graph().lanes();
        let entries_m: Vec<DVec3> = (0..lanes.len()).map(|id| map.entry_m(id)).collect();
        // Lanes are counted up to a metre short, and a change moves sideways for its price
        // alone: the straight line is a bound only as far as the cheapest edge allows.
        let mut straight_share = 1.0_f64;
        for (id, lane) in lanes.iter().enumerate() {
            for (next, cost_m) in edges(lane, lane_change_m) {
                let straight_m = entries_m[id].distance(entries_m[next]);
                if straight_m > 0.0 {
                    straight_share = straight_share.min(cost_m / straight_m);
                }
            }
        }
        Planner { map, lane_change_m, entries_m, straight_share }
    }

    pub fn map(&self) -> &'map RoadMap {
        self.map
    }

    /// The cheapest way from the start of a lane of `starts` to the start of one of `goals`;
    /// none if there is no way.
    pub fn between_lanes(&self, starts: &[LaneId], goals: &[LaneId]) -> Option<Plan> {
        let mut search = Search::new(self, goals);
        for start in starts {
            search.offer(*start, 0.0, None);
        }
        search.run()
    }

    /// The cheapest way between two places; none if there is no way.
    ///
    /// A goal behind the start in the same lane is reached round the block.
    pub fn between_places(&self, start: LanePlace, goal: LanePlace) -> Option<Plan> {
        let goals = [goal.lane];
        let to_goal_m = self.driven_m(goal);
        let mut search = Search::new(self, &goals);
        let mut first_lanes = BTreeMap::new();
        for beside in self.reached_by_changes(start.lane) {
            let lane = beside[beside.len() - 1];
            let changes_m = (beside.len() - 1) as f64 * self.lane_change_m;
            let driven_m = self.driven_m(LanePlace { lane, s_m: start.s_m });
            if lane == goal.lane && to_goal_m >= driven_m {
                return Some(Plan { lanes: beside, cost_m: changes_m + to_goal_m - driven_m });
            }
            let cost_m = changes_m + self.map.lane(lane).waypoint_length_m - driven_m;
            for next in &self.map.lane(lane).successors {
                if search.offer(*next, cost_m, None) {
                    first_lanes.insert(*next, beside.clone());
                }
            }
        }
        let plan = search.run()?;
        let mut lanes = first_lanes.remove(&plan.lanes[0])?;
        lanes.extend(plan.lanes);
        Some(Plan { lanes, cost_m: plan.cost_m + to_goal_m })
    }

    /// The way from the start of the lane to a place in it, m.
    fn driven_m(&self, place: LanePlace) -> f64 {
        let lane = self.map.lane(place.lane);
        let share =
            (place.s_m - lane.entry_m()).abs() / (lane.to_m - lane.from_m).max(f64::EPSILON);
        share.min(1.0) * lane.waypoint_length_m
    }

    /// Ways from a lane into those beside it, by lane changes alone; first the lane itself.
    fn reached_by_changes(&self, start: LaneId) -> Vec<Vec<LaneId>> {
        let mut ways = vec![vec![start]];
        let mut next = 0;
        while next < ways.len() {
            let way = ways[next].clone();
            for beside in self.map.lane(way[way.len() - 1]).changes() {
                if ways.iter().all(|other| other[other.len() - 1] != beside) {
                    ways.push(way.iter().copied().chain([beside]).collect());
                }
            }
            next += 1;
        }
        ways
    }
}

/// What can be reached from the start of a lane, and for how much.
fn edges(lane: &GraphLane, lane_change_m: f64) -> impl Iterator<Item = (LaneId, f64)> + '_ {
    let ahead = lane.successors.iter().map(|next| (*next, lane.waypoint_length_m));
    ahead.chain(lane.changes().map(move |beside| (beside, lane_change_m)))
}

/// A lane that could be visited next: what the whole way would cost at least, then its number,
/// so that ties are broken the same way every time.
#[derive(Clone, Copy, PartialEq)]
struct Open {
    estimate_m: f64,
    cost_m: f64,
    lane: LaneId,
}

impl Eq for Open {}

impl Ord for Open {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.estimate_m.total_cmp(&other.estimate_m).then(self.lane.cmp(&other.lane))
    }
}

impl PartialOrd for Open {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

/// One run of A*.
struct Search<'planner, 'map> {
    planner: &'planner Planner<'map>,
    goals: &'planner [LaneId],
    /// The least known cost of each lane and the lane it is reached from.
    best: Vec<(f64, Option<LaneId>)>,
    open: BinaryHeap<Reverse<Open>>,
}

impl<'planner, 'map> Search<'planner, 'map> {
    fn new(planner: &'planner Planner<'map>, goals: &'planner [LaneId]) -> Self {
        let best = vec![(f64::INFINITY, None); planner.entries_m.len()];
        Search { planner, goals, best, open: BinaryHeap::new() }
    }

    /// Note a way to the start of a lane, if it is the cheapest so far; says whether it is.
    fn offer(&mut self, lane: LaneId, cost_m: f64, from: Option<LaneId>) -> bool {
        let is_better = cost_m < self.best[lane].0;
        if is_better {
            self.best[lane] = (cost_m, from);
            let estimate_m = cost_m + self.at_least_m(lane);
            self.open.push(Reverse(Open { estimate_m, cost_m, lane }));
        }
        is_better
    }

    /// What the way from the start of a lane to the nearest goal costs at least.
    fn at_least_m(&self, lane: LaneId) -> f64 {
        let Planner { entries_m, straight_share, .. } = self.planner;
        let distances = self.goals.iter().map(|goal| entries_m[lane].distance(entries_m[*goal]));
        straight_share * distances.fold(f64::INFINITY, f64::min)
    }

    fn run(mut self) -> Option<Plan> {
        while let Some(Reverse(Open { cost_m, lane, .. })) = self.open.pop() {
            if cost_m > self.best[lane].0 {
                continue;
            }
            if self.goals.contains(&lane) {
                let mut lanes = vec![lane];
                while let Some(from) = lanes.last().and_then(|last| self.best[*last].1) {
                    lanes.push(from);
                }
                lanes.reverse();
                return Some(Plan { lanes, cost_m });
            }
            let graph_lane = self.planner.map.lane(lane);
            for (next, edge_m) in edges(graph_lane, self.planner.lane_change_m) {
                self.offer(next, cost_m + edge_m, Some(lane));
            }
        }
        None
    }
}
