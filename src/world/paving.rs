//! Streets from a map: what traffic drives on and people walk on.

use std::collections::BTreeMap;

use glam::{DVec2, DVec3};

use crate::{
    map::{
        opendrive::{LaneKind, Road},
        road_map::RoadMap,
    },
    towns::scenery::furniture::KERB_HEIGHT_M,
    world::{
        stop_lines,
        streets::{Course, Lane, Onward, STEP_M, Streets, Walk, WalkId},
    },
};

/// What may be driven where the map sets no limit, m/s (50 km/h, and 20 in junctions).
const LIMIT_MPS: f64 = 50.0 / 3.6;

/// Where a map has no side-walks, people keep this far from the lanes, m.
const VERGE_M: f64 = 1.2;

/// Half of the width that people use of a verge, m.
const VERGE_HALF_M: f64 = 0.5;

/// Ends of walks nearer than this are one place, and up to that far apart people go round the
/// corner, m.
const JOINT_M: f64 = 1.5;
const CORNER_M: f64 = 26.0;

/// Walks shorter than this are not worth walking, m.
const SHORTEST_M: f64 = 2.0;

/// Lanes and walks of a map. The index of a lane is that of the map's lane graph.
pub fn pave(map: &RoadMap) -> Streets {
    let graph = map.graph();
    let mut lanes: Vec<Lane> = (0..graph.lanes().len()).map(|id| lane(map, id)).collect();
    let mut junctions = BTreeMap::new();
    for (id, graph_lane) in graph.lanes().iter().enumerate() {
        // Roads that say that they lead through a junction which the map does not have are each
        // one of their own.
        let key = (graph_lane.junction, graph_lane.junction.map_or(graph_lane.key.road, |_| 0));
        let next = junctions.len();
        let junction = graph_lane.in_junction.then(|| *junctions.entry(key).or_insert(next));
        let lane = &mut lanes[id];
        lane.junction = junction;
        lane.next = graph_lane.successors.clone();
        if lane.next.is_empty() {
            lane.usable_m = usable_m(map, id, lane.length_m());
        }
        lane.left = graph_lane.left.filter(|_| graph_lane.may_change_left);
        lane.right = graph_lane.right.filter(|_| graph_lane.may_change_right);
    }
    let mut streets = Streets::new(lanes, walks(map));
    stop_lines::set_back(&mut streets);
    streets
}

fn lane(map: &RoadMap, id: usize) -> Lane {
    let graph_lane = map.lane(id);
    let (from_m, to_m) = (graph_lane.entry_m(), graph_lane.exit_m());
    let points = along(from_m, to_m, |s_m| map.centre(id, s_m).position_m);
    let middle_m = (from_m + to_m) / 2.0;
    let key = graph_lane.key;
    let limit_mps = map.road(id).speed_limit_mps(key.section, key.lane, middle_m);
    let width_m = map.centre(id, middle_m).width_m;
    Lane::new(map.name(id), Course::through(&points), width_m, limit_mps.unwrap_or(LIMIT_MPS))
}

/// How far along a lane that narrows to nothing a vehicle can stand beside others, m.
fn usable_m(map: &RoadMap, id: usize, length_m: f64) -> f64 {
    const WIDE_M: f64 = 2.8;
    let lane = map.lane(id);
    let s_m = |along_m: f64| lane.entry_m() + (lane.exit_m() - lane.entry_m()) * along_m / length_m;
    let steps = (length_m / STEP_M) as usize;
    let is_narrow = |step: &usize| map.centre(id, s_m(*step as f64 * STEP_M)).width_m < WIDE_M;
    // From the end backwards: it may begin narrow as well.
    let narrow = (0..=steps).rev().take_while(is_narrow).last();
    narrow.map_or(length_m, |step| step as f64 * STEP_M)
}

/// Points from one `s` to another, a [`STEP_M`] apart or less.
fn along(from_m: f64, to_m: f64, place: impl Fn(f64) -> DVec3) -> Vec<DVec3> {
    let steps = ((to_m - from_m).abs() / STEP_M).ceil().max(1.0);
    (0..=steps as usize).map(|step| place(from_m + (to_m - from_m) * step as f64 / steps)).collect()
}

/// A walk before its ends are joined: where it is, and on which side of which road.
struct Strip {
    walk: Walk,
    road: usize,
    is_left: bool,
}

fn walks(map: &RoadMap) -> Vec<Walk> {
    let roads = &map.opendrive().roads;
    let mut strips: Vec<Strip> = Vec::new();
    for (index, road) in roads.iter().enumerate() {
        for section in 0..road.sections.len() {
            side_walks(index, road, section, &mut strips);
        }
    }
    if strips.is_empty() {
        for (index, road) in roads.iter().enumerate().filter(|(_, road)| road.junction.is_none()) {
            for section in 0..road.sections.len() {
                verges(index, road, section, &mut strips);
            }
        }
    }
    join(map, &mut strips);
    strips.into_iter().map(|strip| strip.walk).collect()
}

fn side_walks(index: usize, road: &Road, section: usize, strips: &mut Vec<Strip>) {
    for (place, lane) in road.sections[section].lanes.iter().enumerate() {
        if lane.kind != LaneKind::Sidewalk {
            continue;
        }
        let (from_m, to_m) = road.section_range_m(section);
        let points = along(from_m, to_m, |s_m| road.centre(section, place, s_m).position_m);
        let width_m = road.centre(section, place, (from_m + to_m) / 2.0).width_m;
        let half_width_m = (width_m / 2.0 - 0.3).max(0.1);
        strips.extend(strip(index, lane.id > 0, &points, half_width_m, KERB_HEIGHT_M));
    }
}

/// The edges of a road beside its outermost lanes.
fn verges(index: usize, road: &Road, section: usize, strips: &mut Vec<Strip>) {
    let lanes = &road.sections[section].lanes;
    let is_driving = |lane: &&crate::map::opendrive::Lane| lane.kind == LaneKind::Driving;
    if !lanes.iter().any(|lane| is_driving(&lane)) {
        return;
    }
    let (from_m, to_m) = road.section_range_m(section);
    for is_left in [true, false] {
        // From left to right, the first border is the outermost left one.
        let place = if is_left { 0 } else { lanes.len() - 1 };
        let points = along(from_m, to_m, |s_m| {
            let borders = road.borders(section, place, s_m);
            let t_m = match is_left {
                true => borders.inner_t_m.max(borders.outer_t_m) + VERGE_M,
                false => borders.inner_t_m.min(borders.outer_t_m) - VERGE_M,
            };
            road.place(s_m, t_m)
        });
        strips.extend(strip(index, is_left, &points, VERGE_HALF_M, 0.0));
    }
}

fn strip(
    road: usize,
    is_left: bool,
    points: &[DVec3],
    half_width_m: f64,
    kerb_m: f64,
) -> Option<Strip> {
    let course = Course::through(points);
    let is_long = course.length_m() >= SHORTEST_M;
    let onward = [Vec::new(), Vec::new()];
    let walk = Walk { course, half_width_m, kerb_m, onward, opposite: None };
    is_long.then_some(Strip { walk, road, is_left })
}

/// Which walks lead on from which, and which lie across a street.
fn join(map: &RoadMap, strips: &mut [Strip]) {
    let ends: Vec<[DVec2; 2]> = strips
        .iter()
        .map(|strip| {
            let points = strip.walk.course.points_m();
            [points[0], points[points.len() - 1]]
        })
        .collect();
    for id in 0..strips.len() {
        for end in 0..2 {
            let here = ends[id][end];
            let mut onward: Vec<(f64, Onward)> = Vec::new();
            for (other, other_ends) in ends.iter().enumerate().filter(|(other, _)| *other != id) {
                for (other_end, there) in other_ends.iter().enumerate() {
                    let distance_m = here.distance(*there);
                    if distance_m < CORNER_M {
                        let crosses = crosses_street(map, here, *there);
                        let onward_there = Onward { walk: other, at_end: other_end == 1, crosses };
                        onward.push((distance_m, onward_there));
                    }
                }
            }
            onward.sort_by(|a, b| a.0.total_cmp(&b.0));
            // What goes straight on is taken before what lies round the corner.
            let is_joint = onward.first().is_some_and(|(distance_m, _)| *distance_m < JOINT_M);
            let most_m = if is_joint { JOINT_M } else { CORNER_M };
            onward.retain(|(distance_m, _)| *distance_m < most_m);
            onward.truncate(4);
            strips[id].walk.onward[end] = onward.into_iter().map(|(_, onward)| onward).collect();
        }
        strips[id].walk.opposite = opposite(strips, id);
    }
}

/// Whether a straight line leads over a driving lane.
fn crosses_street(map: &RoadMap, from: DVec2, to: DVec2) -> bool {
    let steps = (from.distance(to) / 1.0).ceil().max(1.0) as usize;
    (1..steps).any(|step| {
        let place = from.lerp(to, step as f64 / steps as f64);
        map.nearest(place).is_some_and(|on_lane| on_lane.is_within())
    })
}

/// The walk on the other side of the same road, beside this one's middle.
fn opposite(strips: &[Strip], id: WalkId) -> Option<WalkId> {
    let strip = &strips[id];
    let middle = strip.walk.course.at(strip.walk.course.length_m() / 2.0).position_m;
    let others = strips
        .iter()
        .enumerate()
        .filter(|(_, other)| other.road == strip.road && other.is_left != strip.is_left);
    let distance = |other: &Strip| {
        let (s_m, aside_m) = other.walk.course.project(middle);
        let is_beside = s_m > 0.0 && s_m < other.walk.course.length_m();
        is_beside.then_some(aside_m.abs())
    };
    others
        .filter_map(|(other, strip)| Some((distance(strip)?, other)))
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, other)| other)
}
