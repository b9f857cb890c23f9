//! Paint on the road: lines along and between lanes, crosswalks, lines to stop at.

use glam::DVec2;

use crate::{
    footprint::Footprint,
    map::{
        graph::GraphLane,
        opendrive::{Crosswalk, MarkKind, Road, RoadMark, Section},
        road_map::RoadMap,
    },
    scene::{
        course::{Cut, cuts},
        driven::Driven,
        mesh::{Material, Mesh},
        solids::{Paint, paint},
    },
};

const WHITE: Paint = paint(Material::Marking, [226, 226, 220]);
const YELLOW: Paint = paint(Material::Marking, [222, 176, 52]);

/// Paint lies so high above the road, m: visible from afar, and lower than any return tells.
const ABOVE_M: f64 = 0.012;

/// Widths of lines that the file leaves open, and at least, m.
const WIDTH_M: f64 = 0.12;
const NARROWEST_M: f64 = 0.1;

/// Gap between the two lines of a double one, over their width.
const DOUBLE_GAP: f64 = 1.0;

/// A dash and the gap after it, m: in towns and on motorways (StVO's rules on markings, RMS 1).
const DASH_M: f64 = 3.0;
const GAP_M: f64 = 6.0;
const MOTORWAY_GAP_M: f64 = 9.0;

/// Limits from here on are those of motorways, m/s (75 km/h).
const MOTORWAY_MPS: f64 = 75.0 / 3.6;

/// Lines beside a kerb keep so far from it, m.
const FROM_KERB_M: f64 = 0.1;

/// Longest pieces of lines, m.
const LONGEST_M: f64 = 40.0;

/// Bars of a crosswalk and the gaps between them, m.
const BAR_M: f64 = 0.5;

/// Lines to stop at: their width, and how far they keep from the crosswalk or the junction, m.
const STOP_M: f64 = 0.4;
const BEFORE_CROSSWALK_M: f64 = 0.8;

/// A crosswalk this near to a lane's end makes those who leave the lane stop before it, m.
const CROSSWALK_REACH_M: f64 = 9.0;

/// All paint on the roads of a map.
pub fn draw(map: &RoadMap, driven: &Driven, mesh: &mut Mesh) {
    for road in &map.opendrive().roads {
        for section in 0..road.sections.len() {
            lines(road, section, mesh);
        }
        for crosswalk in &road.crosswalks {
            bars(road, crosswalk, driven, mesh);
        }
    }
    for lane in map.graph().lanes() {
        let enters = |next: &usize| map.lane(*next).in_junction;
        if !lane.in_junction && lane.successors.iter().any(enters) {
            stop_line(&map.opendrive().roads[lane.key.road], lane, mesh);
        }
    }
}

/// One painted line: where it lies beside its border, and which stretches are painted.
struct Line<'a> {
    road: &'a Road,
    section: usize,
    cuts: &'a [Cut],
    /// Place of the border, from the left.
    border: usize,
    aside_m: f64,
    width_m: f64,
    paint: Paint,
}

fn lines(road: &Road, section: usize, mesh: &mut Mesh) {
    let (from_m, to_m) = road.section_range_m(section);
    let cuts = cuts(road, section, LONGEST_M);
    if cuts.is_empty() {
        return;
    }
    let limit_mps = road.speed_limit_mps(section, 0, from_m);
    let is_motorway = limit_mps.is_some_and(|mps| mps > MOTORWAY_MPS);
    let gap_m = if is_motorway { MOTORWAY_GAP_M } else { GAP_M };
    for (id, border) in borders(&road.sections[section]) {
        let marks = road.sections[section].marks(id);
        for (place, mark) in marks.iter().enumerate() {
            let until_m = marks.get(place + 1).map_or(to_m, |next| from_m + next.start_m);
            let range_m = [from_m + mark.start_m.max(0.0), until_m.min(to_m)];
            for (line, is_broken) in painted(road, section, &cuts, (id, border), mark) {
                for [start_m, end_m] in stretches(range_m, is_broken.then_some(gap_m)) {
                    line.draw(start_m, end_m, mesh);
                }
            }
        }
    }
}

/// Lane ids whose marks lie on borders, with the place of the border from the left.
fn borders(section: &Section) -> Vec<(i32, usize)> {
    let lanes = &section.lanes;
    let outer = |(index, lane): (usize, &crate::map::opendrive::Lane)| {
        (lane.id, if lane.id > 0 { index } else { index + 1 })
    };
    let middle = lanes.iter().take_while(|lane| lane.id > 0).count();
    let has_middle = !lanes.is_empty();
    lanes.iter().enumerate().map(outer).chain(has_middle.then_some((0, middle))).collect()
}

/// The lines of a mark, and whether each is broken.
fn painted<'a>(
    road: &'a Road,
    section: usize,
    cuts: &'a [Cut],
    (id, border): (i32, usize),
    mark: &RoadMark,
) -> Vec<(Line<'a>, bool)> {
    let width_m = if mark.width_m > 0.0 { mark.width_m.max(NARROWEST_M) } else { WIDTH_M };
    let paint = if mark.yellow { YELLOW } else { WHITE };
    let line = |aside_m: f64| Line { road, section, cuts, border, aside_m, width_m, paint };
    // Of double lines, the inner one lies towards the middle of the road.
    let inwards = if id > 0 { -1.0 } else { 1.0 };
    let apart_m = 0.5 * (1.0 + DOUBLE_GAP) * width_m;
    let from_kerb_m = from_kerb(&road.sections[section], border) * (FROM_KERB_M + 0.5 * width_m);
    match mark.kind {
        MarkKind::None | MarkKind::Curb => Vec::new(),
        MarkKind::Solid => vec![(line(from_kerb_m), false)],
        MarkKind::Broken => vec![(line(from_kerb_m), true)],
        MarkKind::Double { inner_broken, outer_broken } => {
            vec![(line(inwards * apart_m), inner_broken), (line(-inwards * apart_m), outer_broken)]
        }
    }
}

/// The direction away from a raised strip on one side of a border: 1 is left, 0 where both sides
/// are level.
fn from_kerb(section: &Section, border: usize) -> f64 {
    use crate::map::opendrive::LaneKind::{Curb, Median, Sidewalk};
    let is_raised = |index: Option<usize>| {
        let lane = index.and_then(|index| section.lanes.get(index));
        lane.is_some_and(|lane| matches!(lane.kind, Curb | Median | Sidewalk))
    };
    match (is_raised(border.checked_sub(1)), is_raised(Some(border))) {
        (true, false) => -1.0,
        (false, true) => 1.0,
        _ => 0.0,
    }
}

/// The painted stretches of a line; dashes keep step along the road.
fn stretches(range_m: [f64; 2], gap_m: Option<f64>) -> Vec<[f64; 2]> {
    let Some(gap_m) = gap_m else { return vec![range_m] };
    let period_m = DASH_M + gap_m;
    let first = (range_m[0] / period_m).floor() as i64;
    let last = (range_m[1] / period_m).ceil() as i64;
    let dash = |index: i64| {
        let start_m = index as f64 * period_m;
        [start_m.max(range_m[0]), (start_m + DASH_M).min(range_m[1])]
    };
    (first..=last).map(dash).filter(|[start_m, end_m]| end_m - start_m > 0.1).collect()
}

impl Line<'_> {
    fn draw(&self, from_m: f64, to_m: f64, mesh: &mut Mesh) {
        let after = |s_m: f64| self.cuts.partition_point(|cut| cut.s_m <= s_m);
        let (first, last) = (after(from_m + 1e-3), after(to_m - 1e-3));
        let between = self.cuts[first..last.max(first)].iter().cloned();
        let end = |s_m: f64| Cut::new(self.road, self.section, s_m);
        let cuts: Vec<Cut> = [end(from_m)].into_iter().chain(between).chain([end(to_m)]).collect();
        for pair in cuts.windows(2) {
            let at = |end: usize, side: f64| {
                let t_m = pair[end].borders_t_m[self.border] + self.aside_m;
                pair[end].place(t_m + side * 0.5 * self.width_m, ABOVE_M).as_vec3()
            };
            mesh.ground_face(&[at(0, -1.0), at(1, -1.0), at(1, 1.0), at(0, 1.0)], self.paint);
        }
    }
}

/// The bars of a crosswalk, along the way of those who drive.
fn bars(road: &Road, crosswalk: &Crosswalk, driven: &Driven, mesh: &mut Mesh) {
    let outline_m = road.crosswalk_m(crosswalk);
    let longest = (0..outline_m.len())
        .map(|k| outline_m[(k + 1) % outline_m.len()] - outline_m[k])
        .max_by(|a, b| a.length_squared().total_cmp(&b.length_squared()));
    let Some(across) = longest.and_then(DVec2::try_normalize) else { return };
    let along = across.perp();
    let span = |axis: DVec2| {
        let reach = outline_m.iter().map(|corner| corner.dot(axis));
        reach
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), at| (low.min(at), high.max(at)))
    };
    let ((from_m, to_m), (near_m, far_m)) = (span(across), span(along));
    let height_m = road.elevation.at(crosswalk.s_m);
    let half_m = 0.5 * DVec2::new(BAR_M, far_m - near_m);
    let count = ((to_m - from_m + BAR_M) / (2.0 * BAR_M)).floor().max(1.0);
    let first_m = 0.5 * (from_m + to_m) - (count - 1.0) * BAR_M;
    for bar in 0..count as usize {
        let at_m = first_m + 2.0 * BAR_M * bar as f64;
        let centre_m = across * at_m + along * 0.5 * (near_m + far_m);
        let footprint = Footprint::new(centre_m, across.to_angle(), half_m);
        let core = Footprint { half_m: 0.6 * half_m, ..footprint };
        if driven.covers(&core, height_m) {
            // Front left, rear left, rear right, front right: counter-clockwise.
            let corners = footprint.corners_m();
            let outline = corners.map(|corner| corner.extend(height_m + ABOVE_M).as_vec3());
            mesh.ground_face(&outline, WHITE);
        }
    }
}

/// A line across a lane before the crosswalk at its end.
fn stop_line(road: &Road, lane: &GraphLane, mesh: &mut Mesh) {
    let backwards = if lane.along_s { -1.0 } else { 1.0 };
    let exit_m = lane.exit_m();
    let before_m = |crosswalk: &Crosswalk| (exit_m - crosswalk.s_m).abs();
    let at_end = road.crosswalks.iter().filter(|crosswalk| before_m(crosswalk) < CROSSWALK_REACH_M);
    let Some(crosswalk) = at_end.max_by(|a, b| before_m(a).total_cmp(&before_m(b))) else { return };
    let line = road.reference_line.at(crosswalk.s_m);
    let along = DVec2::from_angle(line.heading_rad) * backwards;
    let reach = road.crosswalk_m(crosswalk).into_iter();
    let reach_m = reach.map(|corner| (corner - line.position_m).dot(along)).fold(0.0, f64::max);
    let near_m = crosswalk.s_m + backwards * (reach_m + BEFORE_CROSSWALK_M);
    let far_m = near_m + backwards * STOP_M;
    if near_m.min(far_m) < lane.from_m || near_m.max(far_m) > lane.to_m {
        return;
    }
    let ends = [near_m.min(far_m), near_m.max(far_m)];
    let cut = ends.map(|s_m| Cut::new(road, lane.key.section, s_m));
    let at = |end: usize, border: usize, inwards: f64| {
        let t_m = cut[end].borders_t_m[lane.index + border];
        cut[end].place(t_m + inwards * 0.15, ABOVE_M).as_vec3()
    };
    mesh.ground_face(&[at(0, 1, 1.0), at(1, 1, 1.0), at(1, 0, -1.0), at(0, 0, -1.0)], WHITE);
}
