//! What a map looks like from above: surfaces, marks, crossings and arrows as outlines.

use glam::DVec2;

use crate::map::{
    canvas::Colour,
    graph::GraphLane,
    opendrive::{LaneKind, MarkKind, Road},
    road_map::RoadMap,
};

pub const BACKGROUND: Colour = [214, 219, 201];
const ASPHALT: Colour = [92, 95, 102];
const JUNCTION: Colour = [112, 108, 110];
const SHOULDER: Colour = [126, 128, 131];
const SIDEWALK: Colour = [186, 182, 174];
const BIKING: Colour = [150, 104, 92];
const PARKING: Colour = [104, 112, 130];
const MEDIAN: Colour = [160, 176, 136];
const KERB: Colour = [158, 155, 149];
const WHITE: Colour = [240, 240, 236];
const YELLOW: Colour = [238, 196, 68];
const CROSSING: Colour = [222, 222, 216];
const ARROW: Colour = [172, 190, 212];

/// Marks are drawn at least this wide, so that they can be seen, m.
const MARK_M: f64 = 0.3;

/// A dash of a broken mark and its repetition, m.
const DASH_M: f64 = 3.0;
const DASH_PERIOD_M: f64 = 9.0;

/// Distance between the arrows of a lane, and the shortest lane that has one, m.
const ARROW_PERIOD_M: f64 = 40.0;
const ARROW_LANE_M: f64 = 12.0;

/// Length of straight edges along bent borders, m.
const EDGE_M: f64 = 2.0;

/// Border points that lie this near to the chord need no edges of their own, m.
const STRAIGHT_M: f64 = 0.01;

/// Difference in height that lets one road pass over another, m.
const STOREY_M: f64 = 3.0;

/// Painted later is painted over.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Layer {
    Beside,
    Lane,
    Crossing,
    Mark,
    Arrow,
    Thing,
}

/// A filled outline in the map's frame, m.
#[derive(Clone, Debug)]
pub struct Shape {
    pub outline_m: Vec<DVec2>,
    pub colour: Colour,
    storey: i64,
    layer: Layer,
}

impl Shape {
    /// A thing on the ground, painted over the roads.
    pub fn thing(outline_m: Vec<DVec2>, colour: Colour) -> Shape {
        Shape { outline_m, colour, storey: 0, layer: Layer::Thing }
    }
}

/// All that is to be painted, in that order.
pub fn shapes(map: &RoadMap) -> Vec<Shape> {
    let mut shapes = Vec::new();
    for road in &map.opendrive().roads {
        for section in 0..road.sections.len() {
            surfaces(road, section, &mut shapes);
            marks(road, section, &mut shapes);
        }
        crosswalks(road, &mut shapes);
    }
    for lane in map.graph().lanes() {
        arrows(&map.opendrive().roads[lane.key.road], lane, &mut shapes);
    }
    shapes.sort_by_key(|shape| (shape.storey, shape.layer));
    shapes
}

fn shape(road: &Road, s_m: f64, layer: Layer, colour: Colour, outline_m: Vec<DVec2>) -> Shape {
    let storey = (road.elevation.at(s_m) / STOREY_M).floor() as i64;
    Shape { outline_m, colour, storey, layer }
}

fn surfaces(road: &Road, section: usize, shapes: &mut Vec<Shape>) {
    for (index, lane) in road.sections[section].lanes.iter().enumerate() {
        let in_junction = road.junction.is_some();
        let (layer, colour) = match lane.kind {
            LaneKind::Driving if in_junction => (Layer::Lane, JUNCTION),
            LaneKind::Driving => (Layer::Lane, ASPHALT),
            LaneKind::Shoulder | LaneKind::Border => (Layer::Beside, SHOULDER),
            LaneKind::Sidewalk => (Layer::Beside, SIDEWALK),
            LaneKind::Biking => (Layer::Beside, BIKING),
            LaneKind::Parking => (Layer::Beside, PARKING),
            LaneKind::Median => (Layer::Beside, MEDIAN),
            LaneKind::Curb => (Layer::Beside, KERB),
            LaneKind::Other => continue,
        };
        let borders = |s_m: f64| {
            let borders = road.borders(section, index, s_m);
            (borders.inner_t_m, borders.outer_t_m)
        };
        // Cut at every break, so that a road that climbs is drawn storey by storey.
        for ends in road.breaks_m(section).windows(2) {
            let outline_m = strip(road, ends[0], ends[1], borders);
            shapes.push(shape(road, 0.5 * (ends[0] + ends[1]), layer, colour, outline_m));
        }
    }
}

/// The outline of what lies between two borders, given as `t` over `s`.
fn strip(road: &Road, from_m: f64, to_m: f64, borders: impl Fn(f64) -> (f64, f64)) -> Vec<DVec2> {
    let at = |s_m: f64| {
        let (one, other) = borders(s_m);
        (road.place(s_m, one).truncate(), road.place(s_m, other).truncate())
    };
    let (start, end) = (at(from_m), at(to_m));
    // Off the middle, where an S would cross its chord.
    const PROBE: f64 = 0.3;
    let probe = at(from_m + PROBE * (to_m - from_m));
    let bend_m =
        start.0.lerp(end.0, PROBE).distance(probe.0) + start.1.lerp(end.1, PROBE).distance(probe.1);
    let is_straight = bend_m < STRAIGHT_M;
    let edges = if is_straight { 1.0 } else { ((to_m - from_m) / EDGE_M).ceil().max(1.0) };
    let points: Vec<(DVec2, DVec2)> = (0..=edges as usize)
        .map(|edge| at(from_m + (to_m - from_m) * edge as f64 / edges))
        .collect();
    let there = points.iter().map(|point| point.0);
    there.chain(points.iter().rev().map(|point| point.1)).collect()
}

fn marks(road: &Road, section: usize, shapes: &mut Vec<Shape>) {
    let (from_m, to_m) = road.section_range_m(section);
    let lanes = &road.sections[section].lanes;
    let middle = lanes.iter().position(|lane| lane.id.abs() == 1);
    let borders = lanes.iter().enumerate().map(|(index, lane)| (lane.id, index));
    for (id, index) in borders.chain(middle.map(|index| (0, index))) {
        let marks = road.sections[section].marks(id);
        for (place, mark) in marks.iter().enumerate() {
            let until_m = marks.get(place + 1).map_or(to_m, |next| from_m + next.start_m);
            let (start_m, end_m) = ((from_m + mark.start_m).max(from_m), until_m.min(to_m));
            let (lines, colour): (&[(f64, bool)], Colour) = match mark.kind {
                MarkKind::None => continue,
                MarkKind::Curb => (&[(0.0, false)], KERB),
                MarkKind::Solid => (&[(0.0, false)], WHITE),
                MarkKind::Broken => (&[(0.0, true)], WHITE),
                MarkKind::Double { inner_broken, outer_broken } => {
                    (&[(-1.0, inner_broken), (1.0, outer_broken)], WHITE)
                }
            };
            let colour = if mark.yellow { YELLOW } else { colour };
            let width_m = mark.width_m.max(MARK_M);
            for (side, broken) in lines {
                let outwards = if id < 0 { -1.0 } else { 1.0 };
                let line = |s_m: f64| {
                    let borders = road.borders(section, index, s_m);
                    let t_m = if id == 0 { borders.inner_t_m } else { borders.outer_t_m };
                    let t_m = t_m + outwards * side * width_m;
                    (t_m - 0.5 * width_m, t_m + 0.5 * width_m)
                };
                for (a, b) in dashes(start_m, end_m, *broken) {
                    let outline_m = strip(road, a, b, line);
                    shapes.push(shape(road, 0.5 * (a + b), Layer::Mark, colour, outline_m));
                }
            }
        }
    }
}

/// The painted stretches of a mark; dashes keep step along the road.
fn dashes(from_m: f64, to_m: f64, broken: bool) -> Vec<(f64, f64)> {
    let (length_m, period_m) = if broken { (DASH_M, DASH_PERIOD_M) } else { (EDGE_M, EDGE_M) };
    let mut dashes = Vec::new();
    let mut start_m = (from_m / period_m).floor() * period_m;
    while start_m < to_m {
        let (a, b) = (start_m.max(from_m), (start_m + length_m).min(to_m));
        if b > a {
            dashes.push((a, b));
        }
        start_m += period_m;
    }
    dashes
}

fn crosswalks(road: &Road, shapes: &mut Vec<Shape>) {
    for crosswalk in &road.crosswalks {
        let outline_m = road.crosswalk_m(crosswalk);
        shapes.push(shape(road, crosswalk.s_m, Layer::Crossing, CROSSING, outline_m));
    }
}

/// Arrow heads that point where traffic goes.
fn arrows(road: &Road, lane: &GraphLane, shapes: &mut Vec<Shape>) {
    if lane.in_junction || lane.length_m < ARROW_LANE_M {
        return;
    }
    const HEAD_M: [[f64; 2]; 4] = [[1.8, 0.0], [-1.2, 0.9], [-0.5, 0.0], [-1.2, -0.9]];
    let count = (lane.length_m / ARROW_PERIOD_M).ceil();
    for arrow in 0..count as usize {
        let s_m = lane.from_m + (lane.to_m - lane.from_m) * (arrow as f64 + 0.5) / count;
        let centre = lane.centre(road, s_m);
        let ahead = DVec2::from_angle(centre.heading_rad) * if lane.along_s { 1.0 } else { -1.0 };
        let place = |corner| centre.position_m.truncate() + ahead.rotate(DVec2::from(corner));
        let outline_m = HEAD_M.map(place).to_vec();
        shapes.push(shape(road, s_m, Layer::Arrow, ARROW, outline_m));
    }
}
