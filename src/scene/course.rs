//! Cuts along a road, so close that straight edges between them follow its bends and slopes.

use glam::{DVec2, DVec3};

use crate::map::opendrive::Road;

/// How far an edge may run off the border that it stands for, m: on the ground, and in height.
const OFF_M: f64 = 0.03;
const OFF_HEIGHT_M: f64 = 0.006;

/// Cuts nearer than this are not halved again, m.
const SHORTEST_M: f64 = 0.25;

/// Sections shorter than this have no surface, m.
pub const DEGENERATE_M: f64 = 0.002;

/// A cut across a section of a road.
#[derive(Clone, Debug)]
pub struct Cut {
    pub s_m: f64,
    origin_m: DVec3,
    left: DVec2,
    /// Of the borders of the lanes, from left to right: one more than there are lanes.
    pub borders_t_m: Vec<f64>,
}

impl Cut {
    pub fn new(road: &Road, section: usize, s_m: f64) -> Cut {
        let lanes = &road.sections[section].lanes;
        let mut borders_t_m = Vec::with_capacity(lanes.len() + 1);
        for (index, lane) in lanes.iter().enumerate() {
            let borders = road.borders(section, index, s_m);
            let (left, right) = match lane.id > 0 {
                true => (borders.outer_t_m, borders.inner_t_m),
                false => (borders.inner_t_m, borders.outer_t_m),
            };
            borders_t_m.push(left);
            if index + 1 == lanes.len() {
                borders_t_m.push(right);
            }
        }
        let line = road.reference_line.at(s_m);
        let left = DVec2::from_angle(line.heading_rad).perp();
        let origin_m = line.position_m.extend(road.elevation.at(s_m));
        Cut { s_m, origin_m, left, borders_t_m }
    }

    /// A place of the cut, raised above the road, world frame, m.
    pub fn place(&self, t_m: f64, above_m: f64) -> DVec3 {
        self.origin_m + (t_m * self.left).extend(above_m)
    }

    /// Unit vector to the left.
    pub fn left(&self) -> DVec2 {
        self.left
    }

    /// Of the road's surface, m.
    pub fn height_m(&self) -> f64 {
        self.origin_m.z
    }
}

/// The cuts of a section, both ends included, none further apart than `longest_m`; empty where
/// there is no surface.
pub fn cuts(road: &Road, section: usize, longest_m: f64) -> Vec<Cut> {
    let (from_m, to_m) = road.section_range_m(section);
    if to_m - from_m < DEGENERATE_M || road.sections[section].lanes.is_empty() {
        return Vec::new();
    }
    let mut cuts: Vec<Cut> = Vec::new();
    for s_m in road.breaks_m(section) {
        let next = Cut::new(road, section, s_m);
        match cuts.last().cloned() {
            Some(before) => add_between(road, section, before, next, longest_m, &mut cuts),
            None => cuts.push(next),
        }
    }
    cuts
}

fn add_between(
    road: &Road,
    section: usize,
    from: Cut,
    to: Cut,
    longest_m: f64,
    cuts: &mut Vec<Cut>,
) {
    let length_m = to.s_m - from.s_m;
    let at = |share: f64| Cut::new(road, section, from.s_m + share * length_m);
    // Off the middle as well, where an S would cross its chord.
    let is_near = |share: f64| {
        let cut = at(share);
        let borders = cut.borders_t_m.iter().zip(&from.borders_t_m).zip(&to.borders_t_m);
        let mut borders = borders.map(|((t, a), b)| (*t, *a, *b));
        borders.all(|(t_m, from_t_m, to_t_m)| {
            let chord_m = from.place(from_t_m, 0.0).lerp(to.place(to_t_m, 0.0), share);
            let off_m = cut.place(t_m, 0.0) - chord_m;
            off_m.z.abs() < OFF_HEIGHT_M && off_m.truncate().length() < OFF_M
        })
    };
    let is_done = length_m < SHORTEST_M || (length_m <= longest_m && is_near(0.5) && is_near(0.25));
    if is_done {
        cuts.push(to);
        return;
    }
    let middle = at(0.5);
    add_between(road, section, from, middle.clone(), longest_m, cuts);
    add_between(road, section, middle, to, longest_m, cuts);
}
