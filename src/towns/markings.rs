//! Road marks: which lines a road has, and where they may be crossed.

use crate::towns::{
    network::Road,
    profile::{Lane, Section, Use},
};

/// Lanes are kept for this long before a junction, m, in sections that are at least so long.
const KEEP_LANE_M: f64 = 15.0;
const KEEP_LANE_SECTION_M: f64 = 60.0;

/// A mark from `start_m` of its section on, in OpenDRIVE's words.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mark {
    pub start_m: f64,
    pub kind: &'static str,
    pub colour: &'static str,
    /// Over which sides lanes may be changed: `both` or `none`.
    pub change: &'static str,
}

const NONE: Mark = Mark { start_m: 0.0, kind: "none", colour: "white", change: "none" };
const DASHED: Mark = Mark { kind: "broken", change: "both", ..NONE };
const SOLID: Mark = Mark { kind: "solid", ..NONE };
const KERB: Mark = Mark { kind: "curb", ..NONE };
const MIDDLE: Mark = Mark { kind: "solid", colour: "yellow", ..NONE };

/// The marks of a lane's outer border.
pub fn outer(road: &Road, index: usize, is_left: bool, place: usize) -> Vec<Mark> {
    let section = &road.sections[index];
    let lanes = if is_left { &section.left } else { &section.right };
    let beside = lanes.get(place + 1).map(|lane| lane.used_for);
    let in_junction = road.junction.is_some();
    match (lanes[place].used_for, beside) {
        (Use::Shoulder, Some(Use::Verge | Use::Sidewalk)) => vec![KERB],
        _ if in_junction => vec![NONE],
        (Use::Driving, Some(Use::Driving)) => between_lanes(road, index, is_left),
        (Use::Driving, _) => vec![SOLID],
        (Use::Median, _) => vec![MIDDLE],
        _ => vec![NONE],
    }
}

/// Between lanes of one direction: nobody changes lanes shortly before a junction.
fn between_lanes(road: &Road, index: usize, is_left: bool) -> Vec<Mark> {
    let length_m = road.sections[index].length_m;
    let last = if is_left { 0 } else { road.sections.len() - 1 };
    match is_left {
        _ if index != last || length_m < KEEP_LANE_SECTION_M => vec![DASHED],
        true => vec![SOLID, Mark { start_m: KEEP_LANE_M, ..DASHED }],
        false => vec![DASHED, Mark { start_m: length_m - KEEP_LANE_M, ..SOLID }],
    }
}

/// The mark between the directions.
pub fn centre(road: &Road, section: &Section) -> Mark {
    let driving =
        |lanes: &[Lane]| lanes.iter().filter(|lane| lane.used_for == Use::Driving).count();
    let has_median = section.right.iter().any(|lane| lane.used_for == Use::Median);
    match (driving(&section.left), driving(&section.right)) {
        _ if road.junction.is_some() || has_median => NONE,
        (0, _) => MIDDLE,
        (1, 1) => Mark { kind: "broken", ..MIDDLE },
        _ => Mark { kind: "solid solid", ..MIDDLE },
    }
}
