//! What the beams of a lidar's turn meet first: triangles drawn onto a grid of columns and beams.
//!
//! All beams of a turn leave one place, and those of one column lie in one upright half-plane of the
//! lidar. A triangle cuts each column that it spans in a line from one elevation to another; the beams
//! in between meet it there, and along the line 1 / distance is linear in the tangent of the elevation.
//! So a turn is drawn as a picture is, column by column, with what is nearest kept: exact as rays are,
//! and several times faster, since the few thousand triangles around a car are gone through once
//! instead of a tree for each beam.

use std::{f32::consts::PI, ops::Range};

use glam::{Mat3, Vec2, Vec3};

use crate::{
    scene::mesh::{Material, Mesh, Triangle},
    sensors::{
        floats::{ceil, least, most, nearest},
        rays::{self, Reach},
    },
};

/// What is nearer to the axis of the lidar than this is not seen, m.
const NEAR_M: f32 = 0.05;

/// [`azimuth_rad`] is right to this, rad.
const ABOUT_RAD: f32 = 1e-4;

/// Into how many steps the tangents of the beams are divided to find them, for each beam: few hold
/// more than one.
const STEPS: usize = 4;

/// The beams of a turn: the same in each column, in the lidar's frame (x forward, y left, z up).
#[derive(Clone, Debug)]
pub struct Fan {
    /// Of the elevations, and infinity after the last.
    tangents: Vec<f32>,
    columns: Vec<Vec2>,
    /// How many beams lie below each step of tangents, from the lowest beam up.
    below: Vec<u32>,
    steps_per_tangent: f32,
}

/// What a beam has met.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Met {
    pub range_m: f32,
    /// Cosine between the beam and the normal of the surface, above 0.
    pub facing: f32,
    pub material: Material,
    /// sRGB.
    pub colour: [u8; 3],
}

/// A turn that has been drawn.
#[derive(Debug)]
pub struct Sweep<'f> {
    fan: &'f Fan,
    /// Of each beam, column by column: 1 / distance on the level, 1/m, and which facet is there.
    nearness: Vec<f32>,
    facet: Vec<u32>,
    facets: Vec<Facet>,
    corners: Vec<Corner>,
}

/// A triangle that has been met.
#[derive(Clone, Copy, Debug)]
struct Facet {
    /// Unit length, lidar frame.
    normal: Vec3,
    material: Material,
    colour: [u8; 3],
}

/// A corner of triangles, in the lidar's frame.
#[derive(Clone, Copy, Debug)]
struct Corner {
    place_m: Vec3,
    /// About where it lies.
    azimuth_rad: f32,
    /// Of its elevation.
    tangent: f32,
}

impl Corner {
    #[inline]
    fn new(place_m: Vec3) -> Corner {
        let level = place_m.truncate();
        let tangent = place_m.z / level.length().max(f32::MIN_POSITIVE);
        Corner { place_m, azimuth_rad: azimuth_rad(level), tangent }
    }
}

impl Fan {
    /// Tangents ascend; columns are unit vectors in equal steps once around to the left, the first
    /// half a step beyond the tail.
    pub fn new(mut tangents: Vec<f32>, columns: Vec<Vec2>) -> Fan {
        let spread =
            tangents.last().zip(tangents.first()).map_or(0.0, |(last, first)| last - first);
        let steps = STEPS * tangents.len();
        let steps_per_tangent = if spread > 0.0 { steps as f32 / spread } else { 0.0 };
        tangents.push(f32::INFINITY);
        let mut fan = Fan { tangents, columns, below: Vec::new(), steps_per_tangent };
        let below = |step: usize| fan.beams().partition_point(|tangent| fan.step(*tangent) < step);
        fan.below = (0..=steps).map(|step| below(step) as u32).collect();
        fan
    }

    /// Tangents of the elevations of the beams.
    #[inline]
    fn beams(&self) -> &[f32] {
        &self.tangents[..self.tangents.len() - 1]
    }

    /// The step that a tangent lies in.
    #[inline]
    fn step(&self, tangent: f32) -> usize {
        let steps = (STEPS * self.beams().len()) as f32;
        let step = (tangent - self.tangents[0]) * self.steps_per_tangent;
        nearest(least(most(step, 0.0), steps)) as usize
    }

    /// How many beams have lesser tangents.
    #[inline]
    fn below(&self, tangent: f32) -> usize {
        let mut count = self.below[self.step(tangent)] as usize;
        // Mostly there is at most one to ask: a sum is quicker than a branch.
        count += usize::from(self.tangents[count] < tangent);
        while self.tangents[count] < tangent {
            count += 1;
        }
        count
    }
}

impl<'f> Sweep<'f> {
    /// What lies within `range_m` of a lidar at `origin_m` (world frame).
    pub fn new(
        fan: &'f Fan,
        reach: &Reach,
        lidar_from_world: Mat3,
        origin_m: Vec3,
        range_m: f32,
    ) -> Sweep<'f> {
        let beams = fan.beams().len() * fan.columns.len();
        // Nothing further away is kept.
        let furthest = fan.beams().iter().map(|tangent| stretch(*tangent) / range_m);
        let nearness = furthest.cycle().take(beams).collect();
        let facet = vec![u32::MAX; beams];
        let (facets, corners) = (Vec::new(), Vec::new());
        let mut sweep = Sweep { fan, nearness, facet, facets, corners };
        for tile in reach.tiles() {
            let colour = |triangle: &Triangle| triangle.colour;
            sweep.draw(&tile.mesh, &|at_m| lidar_from_world * (at_m - origin_m), &colour);
        }
        for (_, body) in reach.bodies() {
            let world_from_body = body.world_from_body;
            let turn = lidar_from_world * Mat3::from(world_from_body.matrix3);
            let shift = lidar_from_world * (Vec3::from(world_from_body.translation) - origin_m);
            let colour = |triangle: &Triangle| rays::colour(triangle, Some(body));
            sweep.draw(&body.mesh, &|at_m| turn * at_m + shift, &colour);
        }
        sweep
    }

    /// What a beam meets first.
    pub fn met(&self, column: usize, beam: usize) -> Option<Met> {
        let place = column * self.fan.beams().len() + beam;
        let facet = self.facets.get(self.facet[place] as usize)?;
        let (tangent, level) = (self.fan.tangents[beam], self.fan.columns[column]);
        let stretch = stretch(tangent);
        Some(Met {
            range_m: stretch / self.nearness[place],
            facing: (facet.normal.dot(level.extend(tangent)) / stretch).abs(),
            material: facet.material,
            colour: facet.colour,
        })
    }

    fn draw(
        &mut self,
        mesh: &Mesh,
        seen_m: &impl Fn(Vec3) -> Vec3,
        colour: &impl Fn(&Triangle) -> [u8; 3],
    ) {
        self.corners.clear();
        let places = mesh.vertices.iter().map(|vertex| Corner::new(seen_m(vertex.position_m)));
        self.corners.extend(places);
        for triangle in &mesh.triangles {
            let [a, b, c] = triangle.corners;
            let (a, b, c) = (a as usize, b as usize, c as usize);
            let corners = [self.corners[a], self.corners[b], self.corners[c]];
            if self.fill(&corners) {
                let [a, b, c] = corners.map(|corner| corner.place_m);
                let normal = (b - a).cross(c - a).normalize_or_zero();
                let (material, colour) = (triangle.material, colour(triangle));
                self.facets.push(Facet { normal, material, colour });
            }
        }
    }

    /// Fill the beams that meet a triangle first so far. Tells whether there are any.
    fn fill(&mut self, corners: &[Corner; 3]) -> bool {
        let fan = self.fan;
        let [a, b, c] = corners.map(|corner| corner.tangent);
        let (low, high) = (least(a, least(b, c)), most(a, most(b, c)));
        let (Some(lowest), Some(highest)) = (fan.beams().first(), fan.beams().last()) else {
            return false;
        };
        // A cone is convex: what has its corners in it lies in it.
        if (*highest >= 0.0 && low > *highest) || (*lowest <= 0.0 && high < *lowest) {
            return false;
        }
        let Some((first_rad, last_rad)) = span_rad(corners) else {
            return self.fill_columns(0..fan.columns.len(), corners);
        };
        let count = fan.columns.len() as i32;
        let column = |azimuth_rad: f32| (azimuth_rad / (2.0 * PI) + 0.5) * count as f32 - 0.5;
        let (first, end) = (ceil(column(first_rad)), ceil(column(last_rad)));
        if first >= end {
            return false;
        }
        // Along an edge the tangent is a part of a sine, and no larger than this anywhere.
        let half = 0.5 * (last_rad - first_rad);
        let swell = 1.0 / (1.0 - 0.5 * half * half);
        let first_beam = fan.below(least(low, low * swell));
        if half < 0.5 && fan.tangents[first_beam] >= most(high, high * swell) {
            return false;
        }
        let range = |from: i32, to: i32| from.clamp(0, count) as usize..to.clamp(0, count) as usize;
        // Once around at most.
        let (main, beyond) = if first < 0 {
            (range(0, end), range(first + count, count))
        } else {
            (range(first, end), range(0, end - count))
        };
        // Both, whatever the first says.
        self.fill_columns(main, corners) | self.fill_columns(beyond, corners)
    }

    fn fill_columns(&mut self, columns: Range<usize>, corners: &[Corner; 3]) -> bool {
        let places_m = corners.map(|corner| corner.place_m);
        let mut is_met = false;
        for column in columns {
            if let Some(cut) = Cut::new(&places_m, self.fan.columns[column]) {
                is_met |= self.fill_column(column, &cut);
            }
        }
        is_met
    }

    #[inline]
    fn fill_column(&mut self, column: usize, cut: &Cut) -> bool {
        let mut beam = self.fan.below(cut.from);
        let mut tangent = self.fan.tangents[beam];
        if tangent >= cut.to {
            return false;
        }
        let start = column * self.fan.beams().len();
        let growth = (cut.nearness_to - cut.nearness_from) / (cut.to - cut.from);
        let mut is_met = false;
        while tangent < cut.to {
            let nearness = cut.nearness_from + growth * (tangent - cut.from);
            if nearness > self.nearness[start + beam] {
                self.nearness[start + beam] = nearness;
                self.facet[start + beam] = self.facets.len() as u32;
                is_met = true;
            }
            beam += 1;
            tangent = self.fan.tangents[beam];
        }
        is_met
    }
}

/// Where a triangle and the half-plane of a column meet.
struct Cut {
    /// Tangents of its elevations, and how near its ends are on the level, 1/m.
    from: f32,
    to: f32,
    nearness_from: f32,
    nearness_to: f32,
}

impl Cut {
    #[inline]
    fn new(places_m: &[Vec3; 3], column: Vec2) -> Option<Cut> {
        let aside = places_m.map(|at_m| column.x * at_m.y - column.y * at_m.x);
        let ahead = places_m.map(|at_m| column.x * at_m.x + column.y * at_m.y);
        let is_left = aside.map(|aside| aside >= 0.0);
        // The corner that is alone on its side.
        let alone = match is_left {
            [a, b, c] if b == c && a != b => 0,
            [a, b, c] if a == c && b != a => 1,
            [a, b, c] if a == b && c != a => 2,
            _ => return None,
        };
        let ends = [(alone + 1) % 3, (alone + 2) % 3].map(|other| {
            // From the same end in both triangles at this edge.
            let (left, right) = if is_left[alone] { (alone, other) } else { (other, alone) };
            let share = aside[left] / (aside[left] - aside[right]);
            let between = |left: f32, right: f32| left + share * (right - left);
            [between(ahead[left], ahead[right]), between(places_m[left].z, places_m[right].z)]
        });
        let [one, other] = ends;
        let [one, other] = [clip(one, other)?, clip(other, one)?];
        let [[from, nearness_from], [to, nearness_to]] = [one, other].map(|[ahead_m, up_m]| {
            let nearness = 1.0 / ahead_m;
            [up_m * nearness, nearness]
        });
        Some(if from <= to {
            Cut { from, to, nearness_from, nearness_to }
        } else {
            Cut { from: to, to: from, nearness_from: nearness_to, nearness_to: nearness_from }
        })
    }
}

/// An end of a line, ahead and up, m, or where the line comes out of what is too near.
#[inline]
fn clip(end: [f32; 2], other: [f32; 2]) -> Option<[f32; 2]> {
    if end[0] >= NEAR_M {
        return Some(end);
    }
    if other[0] < NEAR_M {
        return None;
    }
    let share = (NEAR_M - end[0]) / (other[0] - end[0]);
    Some([NEAR_M, end[1] + share * (other[1] - end[1])])
}

/// The azimuths that a triangle spans, about, rad; `None` if it may stand around the axis.
#[inline]
fn span_rad(corners: &[Corner; 3]) -> Option<(f32, f32)> {
    let [a, b, c] = corners.map(|corner| corner.azimuth_rad);
    // From the first corner, the short way around.
    let [b, c] = [b - a, c - a].map(|turn| {
        if turn > PI {
            turn - 2.0 * PI
        } else if turn < -PI {
            turn + 2.0 * PI
        } else {
            turn
        }
    });
    let first = least(0.0, least(b, c)) - ABOUT_RAD;
    let last = most(0.0, most(b, c)) + ABOUT_RAD;
    (last - first < PI).then_some((a + first, a + last))
}

/// Length of a beam for each metre on the level.
#[inline]
fn stretch(tangent: f32) -> f32 {
    (1.0 + tangent * tangent).sqrt()
}

/// Azimuth of a place on the level, rad in [-pi, pi], positive = left; to [`ABOUT_RAD`].
#[inline]
fn azimuth_rad(level: Vec2) -> f32 {
    let (ahead, aside) = (level.x.abs(), level.y.abs());
    let tangent = ahead.min(aside) / ahead.max(aside).max(f32::MIN_POSITIVE);
    // The arc tangent by Abramowitz and Stegun, 4.4.49.
    let square = tangent * tangent;
    let series = 0.999_866
        + square
            * (-0.330_299_5 + square * (0.180_141 + square * (-0.085_133 + square * 0.020_835_1)));
    let turn = tangent * series;
    let turn = if aside > ahead { 0.5 * PI - turn } else { turn };
    let turn = if level.x < 0.0 { PI - turn } else { turn };
    if level.y < 0.0 { -turn } else { turn }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn azimuths_are_about_right() {
        for step in 0..10_000 {
            let wanted = (step as f32 / 5000.0 - 1.0) * PI;
            let azimuth = azimuth_rad(Vec2::from_angle(wanted) * (0.1 + step as f32));
            assert!((azimuth - wanted).abs() < 0.5 * ABOUT_RAD, "{azimuth}, not {wanted}");
        }
    }

    #[test]
    fn beams_are_found_by_their_tangents() {
        let tangents = vec![-0.6, -0.3, -0.1, -0.05, 0.0, 0.2];
        let fan = Fan::new(tangents.clone(), Vec::new());
        for step in -100..100 {
            let tangent = step as f32 / 100.0;
            let below = tangents.iter().filter(|other| **other < tangent).count();
            assert_eq!(fan.below(tangent), below, "{tangent}");
        }
    }
}
