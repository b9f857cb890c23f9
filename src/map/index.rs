//! The driving lane nearest to a place, by an r-tree over short pieces of the centre lines.

use std::f64::consts::PI;

use glam::DVec2;
use rstar::{
    RTree,
    primitives::{GeomWithData, Line},
};

use crate::{
    dataset::ego::wrap_angle,
    map::{
        graph::{LaneGraph, LaneId},
        opendrive::OpenDrive,
    },
};

/// Length of the pieces, m of `s`.
const PIECE_M: f64 = 1.0;

/// A centre line bends away from its piece by less than this, m: 1 m of a curve of 1.25 m radius.
const SAGITTA_M: f64 = 0.1;

/// Steps towards the foot of a place: halving 3 m comes below 1e-7 m with these.
const ITERATIONS: usize = 26;

/// A lane and the `s` at which its piece begins, and the piece's extent in `s`.
#[derive(Clone, Copy, Debug)]
struct PieceOf {
    lane: LaneId,
    from_m: f64,
    to_m: f64,
}

/// Where a place lies on a lane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OnLane {
    pub lane: LaneId,
    /// The point of the centre line nearest to the place, m of the road's `s`.
    pub s_m: f64,
    /// Of the place, from the reference line, positive left in the direction of `s`, m.
    pub t_m: f64,
    /// Of the place, from the centre of the lane, positive to the driver's left, m.
    pub left_of_centre_m: f64,
    /// From the place to the centre line, m.
    pub distance_m: f64,
    /// Where the driver looks there, rad.
    pub heading_rad: f64,
    /// Of the lane there, m.
    pub width_m: f64,
}

impl OnLane {
    /// The place lies between the borders of the lane.
    pub fn is_within(&self) -> bool {
        self.distance_m <= 0.5 * self.width_m
    }
}

/// All centre lines, ready to be searched.
#[derive(Clone, Debug)]
pub struct LaneIndex {
    pieces: RTree<GeomWithData<Line<[f64; 2]>, PieceOf>>,
}

impl LaneIndex {
    pub fn new(map: &OpenDrive, graph: &LaneGraph) -> Self {
        let mut pieces = Vec::new();
        for (id, lane) in graph.lanes().iter().enumerate() {
            let road = &map.roads[lane.key.road];
            for breaks in road.breaks_m(lane.key.section).windows(2) {
                let (from_m, length_m) = (breaks[0], breaks[1] - breaks[0]);
                let steps = (length_m / PIECE_M).ceil().max(1.0);
                let ends: Vec<f64> = (0..=steps as usize)
                    .map(|step| from_m + length_m * step as f64 / steps)
                    .collect();
                let points: Vec<[f64; 2]> = ends
                    .iter()
                    .map(|s| lane.centre(road, *s).position_m.truncate().to_array())
                    .collect();
                for (s, ends) in ends.windows(2).zip(points.windows(2)) {
                    let piece = PieceOf { lane: id, from_m: s[0], to_m: s[1] };
                    pieces.push(GeomWithData::new(Line::new(ends[0], ends[1]), piece));
                }
            }
        }
        LaneIndex { pieces: RTree::bulk_load(pieces) }
    }

    /// The nearest lane, exact in `s`; none in a map without driving lanes.
    ///
    /// Of lanes equally near, as where ways through a junction begin together, the last of the
    /// graph: exports write connecting roads after those that they connect.
    pub fn nearest(&self, map: &OpenDrive, graph: &LaneGraph, place_m: DVec2) -> Option<OnLane> {
        let mut best: Option<OnLane> = None;
        for (piece, distance2) in
            self.pieces.nearest_neighbor_iter_with_distance_2(place_m.to_array())
        {
            if best.is_some_and(|best| distance2.sqrt() > best.distance_m + SAGITTA_M) {
                break;
            }
            let found = locate(map, graph, piece.data, place_m);
            let is_nearer = |best: OnLane| {
                let (gain_m, same) = (best.distance_m - found.distance_m, 1e-9);
                gain_m > same || (gain_m > -same && found.lane > best.lane)
            };
            if best.is_none_or(is_nearer) {
                best = Some(found);
            }
        }
        best
    }

    /// All lanes whose centre line comes within `radius_m` of a place, nearest first.
    pub fn within(
        &self,
        map: &OpenDrive,
        graph: &LaneGraph,
        place_m: DVec2,
        radius_m: f64,
    ) -> Vec<OnLane> {
        let mut found: Vec<OnLane> = Vec::new();
        let reach2 = (radius_m + SAGITTA_M).powi(2);
        for (piece, distance2) in
            self.pieces.nearest_neighbor_iter_with_distance_2(place_m.to_array())
        {
            if distance2 > reach2 {
                break;
            }
            let on_lane = locate(map, graph, piece.data, place_m);
            match found.iter_mut().find(|other| other.lane == on_lane.lane) {
                Some(other) if on_lane.distance_m < other.distance_m => *other = on_lane,
                Some(_) => {}
                None => found.push(on_lane),
            }
        }
        found.retain(|on_lane| on_lane.distance_m <= radius_m);
        found.sort_by(|a, b| a.distance_m.total_cmp(&b.distance_m).then(a.lane.cmp(&b.lane)));
        found
    }
}

/// The exact foot of a place on the centre line, near a piece of it.
fn locate(map: &OpenDrive, graph: &LaneGraph, piece: PieceOf, place_m: DVec2) -> OnLane {
    let lane = &graph.lanes()[piece.lane];
    let road = &map.roads[lane.key.road];
    // The foot may lie a little beyond the piece, where the next one turns away.
    let (mut low_m, mut high_m) =
        ((piece.from_m - PIECE_M).max(lane.from_m), (piece.to_m + PIECE_M).min(lane.to_m));
    let mut s_m = 0.5 * (piece.from_m + piece.to_m);
    let mut centre = lane.centre(road, s_m);
    for _ in 0..ITERATIONS {
        let offset_m = place_m - centre.position_m.truncate();
        let ahead_m = DVec2::from_angle(centre.heading_rad).dot(offset_m);
        // Newton's step where it stays between what is known to be before and behind the foot.
        (low_m, high_m) = if ahead_m > 0.0 { (s_m, high_m) } else { (low_m, s_m) };
        let step_m = ahead_m / centre.stretch.max(1e-3);
        let next_m = s_m + step_m;
        let next_m =
            if (low_m..=high_m).contains(&next_m) { next_m } else { 0.5 * (low_m + high_m) };
        if (next_m - s_m).abs() < 1e-7 {
            break;
        }
        s_m = next_m;
        centre = lane.centre(road, s_m);
    }
    let offset_m = place_m - centre.position_m.truncate();
    let left_m = DVec2::from_angle(centre.heading_rad).perp_dot(offset_m);
    let (turn_rad, side) = if lane.along_s { (0.0, 1.0) } else { (PI, -1.0) };
    OnLane {
        lane: piece.lane,
        s_m,
        t_m: road.lateral_m(s_m, place_m),
        left_of_centre_m: side * left_m,
        distance_m: offset_m.length(),
        heading_rad: wrap_angle(centre.heading_rad + turn_rad),
        width_m: centre.width_m,
    }
}
