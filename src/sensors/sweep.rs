//! What the beams of a lidar's turn meet first: triangles drawn onto a grid of columns and beams.
//!
//! All beams of a turn leave one place, and those of one column lie in one upright half-plane of the
//! lidar. On it an edge of a triangle is a point whose tangent of elevation is linear in the direction
//! of the column, and 1 / distance to the triangle is linear in both. So a turn is drawn as a picture
//! is, column by column, with what is nearest kept: exact as rays are, and several times faster, since
//! the few thousand triangles around a car are gone through once instead of a tree for each beam.

use std::{f32::consts::PI, ops::Range};

use glam::{Mat3, Vec2, Vec3};

use crate::{
    scene::mesh::{Material, Mesh, Triangle, Vertex},
    sensors::{
        fan::Fan,
        floats::{ceil, least, most},
        rays::{self, Reach},
    },
};

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
    /// About where it lies, and the first column at or beyond it.
    azimuth_rad: f32,
    column: i32,
    /// Of its elevation.
    tangent: f32,
}

impl Corner {
    #[inline]
    fn new(place_m: Vec3, columns: f32) -> Corner {
        let level = place_m.truncate();
        let azimuth_rad = azimuth_rad(level);
        let column = ceil((azimuth_rad * (0.5 / PI) + 0.5) * columns - 0.5);
        Corner { place_m, azimuth_rad, column, tangent: place_m.z / level.length() }
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
        let columns = self.fan.columns.len() as f32;
        let corner = |vertex: &Vertex| Corner::new(seen_m(vertex.position_m), columns);
        let places = mesh.vertices.iter().map(corner);
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
        let [a, b, c] = corners;
        let low = least(a.tangent, least(b.tangent, c.tangent));
        let high = most(a.tangent, most(b.tangent, c.tangent));
        let (Some(lowest), Some(highest)) = (fan.beams().first(), fan.beams().last()) else {
            return false;
        };
        // A cone is convex: what has its corners in it lies in it.
        if (*highest >= 0.0 && low > *highest) || (*lowest <= 0.0 && high < *lowest) {
            return false;
        }
        // From the first corner, the short way around.
        let count = fan.columns.len() as i32;
        let from_first = |corner: &Corner| {
            let turn = corner.azimuth_rad - a.azimuth_rad;
            if turn > PI {
                (turn - 2.0 * PI, corner.column - count)
            } else if turn < -PI {
                (turn + 2.0 * PI, corner.column + count)
            } else {
                (turn, corner.column)
            }
        };
        let ((turn_b, column_b), (turn_c, column_c)) = (from_first(b), from_first(c));
        let span_rad = most(0.0, most(turn_b, turn_c)) - least(0.0, least(turn_b, turn_c));
        let is_around = span_rad > PI;
        let columns =
            if is_around { [a.column, b.column, c.column] } else { [a.column, column_b, column_c] };
        let [first, middle, last] =
            sorted([(columns[0], a.place_m), (columns[1], b.place_m), (columns[2], c.place_m)]);
        if first.0 == last.0 && !is_around {
            return false;
        }
        // Along an edge tangents and nearness are parts of sines, and no larger than this anywhere.
        let half = 0.5 * span_rad;
        let swell = if half < 0.5 { 1.0 / (1.0 - 0.5 * half * half) } else { f32::INFINITY };
        if half < 0.5
            && fan.tangents[fan.below(least(low, low * swell))] >= most(high, high * swell)
        {
            return false;
        }
        let normal = (b.place_m - a.place_m).cross(c.place_m - a.place_m);
        let square = |corner: &Corner| corner.place_m.truncate().length_squared();
        let nearest = least(square(a), least(square(b), square(c))).sqrt();
        let surface = Surface { plane: normal / normal.dot(a.place_m), most: swell / nearest };
        let short = [Edge::new(first.1, middle.1), Edge::new(middle.1, last.1)];
        let long = Edge::new(first.1, last.1);
        // All of them, whatever the others say.
        if is_around {
            // At its axis the lidar sees no end of it.
            let end = if surface.plane.z < 0.0 { f32::NEG_INFINITY } else { f32::INFINITY };
            self.fill_columns(first.0..middle.0, &surface, &short[0], |_| end)
                | self.fill_columns(middle.0..last.0, &surface, &short[1], |_| end)
                | self.fill_columns(last.0..first.0 + count, &surface, &long, |_| end)
        } else {
            self.fill_columns(first.0..middle.0, &surface, &short[0], |axis| long.tangent(axis))
                | self
                    .fill_columns(middle.0..last.0, &surface, &short[1], |axis| long.tangent(axis))
        }
    }

    /// Fill the beams between an edge and another end.
    #[inline]
    fn fill_columns(
        &mut self,
        columns: Range<i32>,
        surface: &Surface,
        edge: &Edge,
        other: impl Fn(Vec2) -> f32,
    ) -> bool {
        let fan = self.fan;
        let count = fan.columns.len() as i32;
        let mut is_met = false;
        for column in columns {
            let column = if column < 0 { column + count } else { column };
            let column = if column >= count { column - count } else { column } as usize;
            let axis = fan.columns[column];
            let (one, other) = (edge.tangent(axis), other(axis));
            let (from, to) = if one < other { (one, other) } else { (other, one) };
            let mut beam = fan.below(from);
            let mut tangent = fan.tangents[beam];
            if tangent >= to {
                continue;
            }
            let base = surface.plane.x * axis.x + surface.plane.y * axis.y;
            let start = column * fan.beams().len();
            while tangent < to {
                let nearness = least(base + surface.plane.z * tangent, surface.most);
                if nearness > self.nearness[start + beam] {
                    self.nearness[start + beam] = nearness;
                    self.facet[start + beam] = self.facets.len() as u32;
                    is_met = true;
                }
                beam += 1;
                tangent = fan.tangents[beam];
            }
        }
        is_met
    }
}

/// 1 / distance on the level, linear in the direction of a beam (1 m on the level), and where it is
/// greatest: what rounding adds on slim triangles stays below that.
struct Surface {
    plane: Vec3,
    most: f32,
}

/// The tangent of an edge's elevation, linear in the direction of a column.
struct Edge(Vec2);

impl Edge {
    #[inline]
    fn new(a_m: Vec3, b_m: Vec3) -> Edge {
        let normal = a_m.cross(b_m);
        Edge(-normal.truncate() / normal.z)
    }

    #[inline]
    fn tangent(&self, axis: Vec2) -> f32 {
        self.0.x * axis.x + self.0.y * axis.y
    }
}

/// By their columns.
#[inline]
fn sorted([mut first, mut middle, mut last]: [(i32, Vec3); 3]) -> [(i32, Vec3); 3] {
    if middle.0 < first.0 {
        std::mem::swap(&mut first, &mut middle);
    }
    if last.0 < middle.0 {
        std::mem::swap(&mut middle, &mut last);
    }
    if middle.0 < first.0 {
        std::mem::swap(&mut first, &mut middle);
    }
    [first, middle, last]
}

/// Length of a beam for each metre on the level.
#[inline]
fn stretch(tangent: f32) -> f32 {
    (1.0 + tangent * tangent).sqrt()
}

/// Azimuth of a place on the level, rad in [-pi, pi], positive = left; to 2e-5.
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
        // Half a turn to the right is half a turn to the left.
        for step in 1..10_000 {
            let wanted = (step as f32 / 5000.0 - 1.0) * PI;
            let azimuth = azimuth_rad(Vec2::from_angle(wanted) * (0.1 + step as f32));
            assert!((azimuth - wanted).abs() < 2e-5, "{azimuth}, not {wanted}");
        }
    }
}
