//! The lane graph: where a driver can go on from each lane, straight ahead or by changing lanes.

use std::collections::BTreeMap;

use glam::DVec3;

use crate::map::{
    contraction::Contraction,
    links::{BrokenLinks, DEGENERATE_M, LaneKey, Links},
    opendrive::{LaneKind, OpenDrive, Road},
    road::CentrePoint,
};

/// Distance between the points that lane lengths are counted by, m of the road's `s`.
const WAYPOINT_M: f64 = 0.5;

/// Points and weights of Gauss-Legendre quadrature with 3 points on [0, 1].
const GAUSS: [(f64, f64); 3] = [
    (0.112_701_665_379_258_3, 5.0 / 18.0),
    (0.5, 8.0 / 18.0),
    (0.887_298_334_620_741_7, 5.0 / 18.0),
];

/// Index of a lane in [`LaneGraph::lanes`].
pub type LaneId = usize;

/// A driving lane within one section of a road.
#[derive(Clone, Debug)]
pub struct GraphLane {
    pub key: LaneKey,
    /// Place of the lane in its section, from the left.
    pub index: usize,
    /// Traffic runs towards higher `s`.
    pub along_s: bool,
    /// Range of the section, m of the road's `s`.
    pub from_m: f64,
    pub to_m: f64,
    /// Arc length of the centre line, m.
    pub length_m: f64,
    /// Length between the first and the last half metre of the road's `s` within the lane, m.
    ///
    /// CARLA's waypoints are measured so; costs of routes are counted in it, so that they can be
    /// held against CARLA's. It is up to 1 m less than `length_m`.
    pub waypoint_length_m: f64,
    /// Where traffic goes on, ascending.
    pub successors: Vec<LaneId>,
    /// Where traffic comes from, ascending.
    pub predecessors: Vec<LaneId>,
    /// The lane beside, as seen by the driver, if it has the same direction.
    pub left: Option<LaneId>,
    pub right: Option<LaneId>,
    /// The road mark half-way along the lane allows to change into the lane beside.
    pub may_change_left: bool,
    pub may_change_right: bool,
    /// Index of the junction in the map, if the road leads through one that the map has.
    pub junction: Option<usize>,
    /// The road leads through a junction.
    pub in_junction: bool,
}

impl GraphLane {
    /// The centre line at `s_m`; `road` is the lane's.
    pub fn centre(&self, road: &Road, s_m: f64) -> CentrePoint {
        road.centre(self.key.section, self.index, s_m)
    }

    /// `s` where traffic comes in, m.
    pub fn entry_m(&self) -> f64 {
        if self.along_s { self.from_m } else { self.to_m }
    }

    /// `s` where traffic goes out, m.
    pub fn exit_m(&self) -> f64 {
        if self.along_s { self.to_m } else { self.from_m }
    }

    /// The lanes that a driver may change into, left first.
    pub fn changes(&self) -> impl Iterator<Item = LaneId> + '_ {
        let left = self.left.filter(|_| self.may_change_left);
        left.into_iter().chain(self.right.filter(|_| self.may_change_right))
    }
}

/// All driving lanes of a map; degenerate ones are contracted.
#[derive(Clone, Debug)]
pub struct LaneGraph {
    lanes: Vec<GraphLane>,
    /// Lanes of the file, and what they are here: a contracted one is those that it leads into.
    by_key: BTreeMap<LaneKey, Vec<LaneId>>,
    broken: BrokenLinks,
}

impl LaneGraph {
    pub fn new(map: &OpenDrive) -> Self {
        let mut links = Links::new(map);
        let keys = links.driving_lanes();
        let index: BTreeMap<LaneKey, usize> =
            keys.iter().enumerate().map(|(i, key)| (*key, i)).collect();
        let degenerate: Vec<bool> = keys.iter().map(|key| links.is_degenerate(*key)).collect();
        let successors: Vec<Vec<usize>> = keys
            .iter()
            .map(|key| links.successors(*key).iter().map(|next| index[next]).collect())
            .collect();
        let Contraction { kept, stands_for } = Contraction::new(&degenerate, &successors);
        let id_of = |lane: &usize| kept.binary_search(lane).ok();
        let ids = |lanes: &[usize]| lanes.iter().filter_map(id_of).collect::<Vec<LaneId>>();
        let by_key: BTreeMap<LaneKey, Vec<LaneId>> =
            keys.iter().zip(&stands_for).map(|(key, lanes)| (*key, ids(lanes))).collect();
        let junctions: BTreeMap<&str, usize> =
            map.junctions.iter().enumerate().map(|(i, j)| (j.id.as_str(), i)).collect();
        let mut lanes: Vec<GraphLane> = Vec::with_capacity(kept.len());
        for lane in &kept {
            let road = &map.roads[keys[*lane].road];
            let Some(index) = road.sections[keys[*lane].section].index_of(keys[*lane].lane) else {
                continue;
            };
            let mut graph_lane = measured(road, keys[*lane], index);
            let next = successors[*lane].iter().flat_map(|next| ids(&stands_for[*next]));
            graph_lane.successors = next.collect();
            graph_lane.successors.sort_unstable();
            graph_lane.successors.dedup();
            graph_lane.junction =
                road.junction.as_deref().and_then(|id| junctions.get(id)).copied();
            beside(road, &mut graph_lane, &by_key);
            lanes.push(graph_lane);
        }
        for id in 0..lanes.len() {
            for next in lanes[id].successors.clone() {
                lanes[next].predecessors.push(id);
            }
        }
        LaneGraph { lanes, by_key, broken: links.broken() }
    }

    pub fn lanes(&self) -> &[GraphLane] {
        &self.lanes
    }

    /// What a driving lane of the file is here: itself, or the lanes that stand for it if its
    /// section was contracted; empty if it is no driving lane.
    pub fn find(&self, key: LaneKey) -> &[LaneId] {
        self.by_key.get(&key).map_or(&[], Vec::as_slice)
    }

    /// Driving lanes of the file, contracted or not.
    pub fn keys(&self) -> impl Iterator<Item = LaneKey> + '_ {
        self.by_key.keys().copied()
    }

    /// Driving lanes of the file that were contracted.
    pub fn contracted(&self) -> usize {
        self.by_key.len() - self.lanes.len()
    }

    pub fn broken_links(&self) -> BrokenLinks {
        self.broken
    }

    /// The largest set of lanes that can all be reached from each other, ascending.
    pub fn strongly_connected(&self) -> Vec<LaneId> {
        let mut component = vec![usize::MAX; self.lanes.len()];
        let mut largest = Vec::new();
        for seed in 0..self.lanes.len() {
            if component[seed] != usize::MAX {
                continue;
            }
            let ahead = self.reached(seed, |lane| {
                lane.successors.iter().copied().chain(lane.changes()).collect()
            });
            let behind = self.reached(seed, |lane| {
                let beside = [lane.left, lane.right].into_iter().flatten();
                let from_beside = beside.filter(|other| {
                    self.lanes[*other].changes().any(|id| self.lanes[id].key == lane.key)
                });
                lane.predecessors.iter().copied().chain(from_beside).collect()
            });
            let both: Vec<LaneId> =
                (0..self.lanes.len()).filter(|id| ahead[*id] && behind[*id]).collect();
            for id in &both {
                component[*id] = seed;
            }
            if both.len() > largest.len() {
                largest = both;
            }
        }
        largest
    }

    fn reached(&self, from: LaneId, next: impl Fn(&GraphLane) -> Vec<LaneId>) -> Vec<bool> {
        let (mut reached, mut open) = (vec![false; self.lanes.len()], vec![from]);
        reached[from] = true;
        while let Some(id) = open.pop() {
            for next in next(&self.lanes[id]) {
                if !std::mem::replace(&mut reached[next], true) {
                    open.push(next);
                }
            }
        }
        reached
    }
}

/// A lane with its lengths, not yet linked.
fn measured(road: &Road, key: LaneKey, index: usize) -> GraphLane {
    let (from_m, to_m) = road.section_range_m(key.section);
    GraphLane {
        key,
        index,
        along_s: road.runs_along_s(key.lane),
        from_m,
        to_m,
        length_m: arc_length_m(road, key.section, index),
        waypoint_length_m: waypoint_length_m(road, key.section, index),
        successors: Vec::new(),
        predecessors: Vec::new(),
        left: None,
        right: None,
        may_change_left: false,
        may_change_right: false,
        junction: None,
        in_junction: road.junction.is_some(),
    }
}

fn arc_length_m(road: &Road, section: usize, index: usize) -> f64 {
    const STEP_M: f64 = 4.0;
    let stretch = |s_m| road.centre(section, index, s_m).stretch;
    let mut length_m = 0.0;
    for pair in road.breaks_m(section).windows(2) {
        let steps = ((pair[1] - pair[0]) / STEP_M).ceil().max(1.0);
        let step_m = (pair[1] - pair[0]) / steps;
        for step in 0..steps as u32 {
            let start_m = pair[0] + f64::from(step) * step_m;
            let mean: f64 = GAUSS.iter().map(|(x, w)| w * stretch(start_m + x * step_m)).sum();
            length_m += mean * step_m;
        }
    }
    length_m
}

fn waypoint_length_m(road: &Road, section: usize, index: usize) -> f64 {
    let (mut length_m, mut last): (f64, Option<DVec3>) = (0.0, None);
    for s_m in waypoints_m(road, section) {
        let position_m = road.centre(section, index, s_m).position_m;
        length_m += last.map_or(0.0, |last| position_m.distance(last));
        last = Some(position_m);
    }
    length_m
}

/// Whole half metres of `s` in a section; one on a border belongs to the section beyond it.
pub fn waypoints_m(road: &Road, section: usize) -> impl Iterator<Item = f64> {
    let (from_m, to_m) = road.section_range_m(section);
    let first = (from_m / WAYPOINT_M).ceil();
    let count = (to_m / WAYPOINT_M).ceil() - first;
    (0..count.max(0.0) as u64).map(move |waypoint| (first + waypoint as f64) * WAYPOINT_M)
}

/// Fill in the lanes beside and whether they may be changed into.
fn beside(road: &Road, lane: &mut GraphLane, by_key: &BTreeMap<LaneKey, Vec<LaneId>>) {
    if lane.to_m - lane.from_m < DEGENERATE_M {
        return;
    }
    let section = &road.sections[lane.key.section];
    let neighbours = [lane.index.checked_sub(1), Some(lane.index + 1)];
    for neighbour in neighbours.into_iter().flatten().filter_map(|i| section.lanes.get(i)) {
        let id = neighbour.id;
        let same_direction = id.signum() == lane.key.lane.signum();
        if !same_direction || neighbour.kind != LaneKind::Driving {
            continue;
        }
        let key = LaneKey { lane: id, ..lane.key };
        let [other] = by_key[&key][..] else { continue };
        let higher = id > lane.key.lane;
        // The border between two lanes is the outer one of the inner lane.
        let inner = if id.abs() < lane.key.lane.abs() { id } else { lane.key.lane };
        // A route lays a change around the middle of the lane, so the mark there decides.
        let middle_m = 0.5 * (lane.to_m - lane.from_m);
        let mark = section.marks(inner).iter().rfind(|mark| mark.start_m <= middle_m);
        let may_change = mark.is_some_and(|mark| mark.change.allows(higher));
        if higher == lane.along_s {
            (lane.left, lane.may_change_left) = (Some(other), may_change);
        } else {
            (lane.right, lane.may_change_right) = (Some(other), may_change);
        }
    }
}
