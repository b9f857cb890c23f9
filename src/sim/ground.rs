//! The ground of the picture: grass, asphalt and markings by inverse projection of each pixel.
//!
//! A pixel's ground point is exact. Its place on the road is computed at every eighth column and
//! interpolated between, since along so short a row it is as good as linear; where two
//! neighbours lie on different parts of the road, each pixel is looked up by itself. Markings
//! are averaged over the pixel's footprint, so that they fade with distance and do not flicker.

use glam::DVec2;

use crate::sim::road::{
    DASH_M, DASH_PERIOD_M, LANE_WIDTH_M, LINE_WIDTH_M, Road, SHOULDER_M, STOP_LINE_DEPTH_M,
};

/// Columns between two places that are looked up.
const NODE_COLUMNS: usize = 8;

/// Beyond this the ground is all grass and haze, m.
const FAR_M: f64 = 240.0;

/// Distance between the points of the road that a look-up starts from, m.
const COARSE_M: f64 = 4.0;

/// Half width of what is painted by the road, m.
const HALF_ROAD_M: f64 = LANE_WIDTH_M + SHOULDER_M;

/// The eye above flat ground, looking level.
#[derive(Clone, Copy, Debug)]
pub struct Eye {
    /// World frame, m.
    pub position_m: DVec2,
    pub height_m: f64,
    /// Unit vector of the line of sight, world frame.
    pub forward: DVec2,
}

/// The road near the eye, ready to be looked up.
pub struct Ground<'a> {
    road: &'a Road,
    eye: Eye,
    coarse: Vec<(f64, DVec2)>,
    stop_lines_m: Vec<f64>,
    /// Subtracted from arc lengths before they become `f32`; a whole number of dashes.
    base_m: f64,
}

/// A place of the ground and how much of it a pixel covers.
#[derive(Clone, Copy, Debug, Default)]
struct Place {
    /// Along the road from the base, and beside it, m.
    s_m: f32,
    lateral_m: f32,
    /// Footprint of a pixel in both, m.
    span_s_m: f32,
    span_lateral_m: f32,
}

impl<'a> Ground<'a> {
    /// `s_m` is the arc length at the eye, about.
    pub fn new(road: &'a Road, eye: Eye, s_m: f64) -> Self {
        let from_m = s_m - 16.0;
        let coarse = (0..((FAR_M + 40.0) / COARSE_M) as usize)
            .map(|i| from_m + COARSE_M * i as f64)
            .map(|s| (s, road.at(s).position_m))
            .collect();
        let base_m = (s_m / DASH_PERIOD_M).floor() * DASH_PERIOD_M;
        let near = |line: &f64| (line - s_m).abs() < FAR_M;
        let stop_lines_m = road.stop_lines_m().iter().copied().filter(near).collect();
        Ground { road, eye, coarse, stop_lines_m, base_m }
    }

    /// One row of the picture below the horizon: red, green and blue in [0, 255], before haze.
    ///
    /// `below` is the row's distance from the horizon in focal lengths, `across` the tangent of
    /// the first pixel's direction to the left, `per_column` its change from column to column.
    pub fn paint_row(&self, row: &mut [[f32; 3]], below: f64, across: f64, per_column: f64) {
        let depth_m = self.eye.height_m / below;
        if depth_m > FAR_M {
            row.fill(GRASS);
            return;
        }
        let left = self.eye.forward.perp();
        let first_m = self.eye.position_m + depth_m * (self.eye.forward + across * left);
        let step_m = depth_m * per_column * left;
        let at = |column: usize| first_m + step_m * column as f64;
        let pixel_m = step_m.length();
        // One row further down, the same column's ground point comes nearer by this share.
        let row_share = -per_column / below;

        let mut node = self.nearest(at(0));
        for start in (0..row.len()).step_by(NODE_COLUMNS) {
            let next = self.nearest(at(start + NODE_COLUMNS));
            let pixels = start..(start + NODE_COLUMNS).min(row.len());
            let texture = Texture::new(at(start), step_m, pixel_m, row_share * depth_m);
            let reach_m = HALF_ROAD_M + COARSE_M + pixel_m * NODE_COLUMNS as f64;
            let off_road = node.0.min(next.0) > reach_m * reach_m;
            let ends = (!off_road).then(|| {
                let look_up = |column: usize, guess_m: f64| {
                    self.place(at(column), guess_m, step_m, row_share)
                };
                (look_up(start, node.1), look_up(start + NODE_COLUMNS, next.1))
            });
            let split = ends.is_some_and(|(from, to)| {
                let apart_m = f64::from((to.s_m - from.s_m).abs());
                apart_m > 1.0 + 3.0 * pixel_m * NODE_COLUMNS as f64
            });
            for (i, pixel) in row[pixels].iter_mut().enumerate() {
                *pixel = texture.grass(i);
                let Some((from, to)) = ends else { continue };
                let place = if split {
                    let point = at(start + i);
                    self.place(point, self.nearest(point).1, step_m, row_share)
                } else {
                    from.towards(&to, i as f32 / NODE_COLUMNS as f32)
                };
                self.paint_road(pixel, &place, texture.grain(i));
            }
            node = next;
        }
    }

    /// Squared distance to the nearest coarse point of the road, and that point's arc length.
    fn nearest(&self, point: DVec2) -> (f64, f64) {
        let mut best = (f64::INFINITY, 0.0);
        for (s, position_m) in &self.coarse {
            let distance = position_m.distance_squared(point);
            if distance < best.0 {
                best = (distance, *s);
            }
        }
        best
    }

    fn place(&self, point: DVec2, guess_m: f64, step_m: DVec2, row_share: f64) -> Place {
        let (s, lateral) = self.road.project_near(point, guess_m);
        let along = DVec2::from_angle(self.road.at(s).heading_rad);
        let down = row_share * (point - self.eye.position_m);
        Place {
            s_m: (s - self.base_m) as f32,
            lateral_m: lateral as f32,
            span_s_m: (along.dot(step_m).abs() + along.dot(down).abs()) as f32,
            span_lateral_m: (along.perp_dot(step_m).abs() + along.perp_dot(down).abs()) as f32,
        }
    }

    fn paint_road(&self, pixel: &mut [f32; 3], at: &Place, grain: f32) {
        const HALF: f32 = HALF_ROAD_M as f32;
        const EDGE: f32 = LANE_WIDTH_M as f32;
        const LINE: f32 = LINE_WIDTH_M as f32;
        let asphalt = covered(at.lateral_m, at.span_lateral_m, -HALF, HALF);
        if asphalt <= 0.0 {
            return;
        }
        // Wheels polish two tracks in each lane.
        let in_lane = (at.lateral_m.abs() - EDGE / 2.0).abs() - 0.8;
        let worn = 6.0 * (1.0 - (in_lane * 2.0).abs()).max(0.0);
        mix(pixel, ASPHALT.map(|c| c + grain - worn), asphalt);
        let line = |middle: f32| {
            covered(at.lateral_m, at.span_lateral_m, middle - LINE / 2.0, middle + LINE / 2.0)
        };
        let dash = line(0.0) * dashes(at.s_m, at.span_s_m);
        let mut marking = line(EDGE) + line(-EDGE) + dash;
        for stop_m in &self.stop_lines_m {
            let from = (stop_m - self.base_m) as f32;
            let along = covered(at.s_m, at.span_s_m, from, from + STOP_LINE_DEPTH_M as f32);
            if along > 0.0 {
                marking += along * covered(at.lateral_m, at.span_lateral_m, -EDGE, 0.0);
            }
        }
        mix(pixel, MARKING.map(|c| c + 0.5 * grain), marking.min(1.0));
    }
}

impl Place {
    fn towards(&self, to: &Place, share: f32) -> Place {
        let between = |a: f32, b: f32| a + (b - a) * share;
        Place {
            s_m: between(self.s_m, to.s_m),
            lateral_m: between(self.lateral_m, to.lateral_m),
            span_s_m: between(self.span_s_m, to.span_s_m),
            span_lateral_m: between(self.span_lateral_m, to.span_lateral_m),
        }
    }
}

const GRASS: [f32; 3] = [92.0, 122.0, 62.0];
const ASPHALT: [f32; 3] = [92.0, 93.0, 97.0];
const MARKING: [f32; 3] = [226.0, 226.0, 220.0];

/// Blades and patches of grass, grains of asphalt: noise fixed to the world.
struct Texture {
    first_m: [f32; 2],
    step_m: [f32; 2],
    patch: f32,
    patch_step: f32,
    /// How much of the fine noise a pixel still shows.
    fine: f32,
}

impl Texture {
    const PATCH_M: f64 = 7.0;
    const BLADE_M: f32 = 0.07;

    fn new(first_m: DVec2, step_m: DVec2, pixel_m: f64, row_m: f64) -> Self {
        let patch = |point: DVec2| {
            let cell = (point / Self::PATCH_M).floor();
            let [x, y] = (point / Self::PATCH_M - cell).to_array().map(|t| t as f32);
            let corner = |dx: i32, dy: i32| grain(cell.x as i32 + dx, cell.y as i32 + dy);
            let (near, far) = (
                corner(0, 0) + (corner(1, 0) - corner(0, 0)) * x,
                corner(0, 1) + (corner(1, 1) - corner(0, 1)) * x,
            );
            near + (far - near) * y
        };
        let from = patch(first_m);
        let to = patch(first_m + step_m * NODE_COLUMNS as f64);
        let footprint_m = (pixel_m + row_m.abs()) as f32;
        Texture {
            // Kept small, so that `f32` still tells blades apart kilometres from the origin.
            first_m: first_m.to_array().map(|x| x.rem_euclid(1024.0) as f32),
            step_m: step_m.to_array().map(|x| x as f32),
            patch: from,
            patch_step: (to - from) / NODE_COLUMNS as f32,
            fine: 1.0 / (1.0 + footprint_m / Self::BLADE_M),
        }
    }

    fn grass(&self, column: usize) -> [f32; 3] {
        let patch = 26.0 * (self.patch + self.patch_step * column as f32 - 0.5);
        let blade = 1.6 * self.grain(column);
        [GRASS[0] + 1.1 * patch + blade, GRASS[1] + patch + blade, GRASS[2] + 0.5 * patch + blade]
    }

    fn grain(&self, column: usize) -> f32 {
        let i = column as f32;
        let cell =
            |axis: usize| ((self.first_m[axis] + self.step_m[axis] * i) / Self::BLADE_M) as i32;
        30.0 * self.fine * (grain(cell(0), cell(1)) - 0.5)
    }
}

/// A number in [0, 1) that belongs to a cell of a grid.
fn grain(x: i32, y: i32) -> f32 {
    let mut h = (x as u32).wrapping_mul(0x9E37_79B1) ^ (y as u32).wrapping_mul(0x85EB_CA77);
    h = (h ^ (h >> 15)).wrapping_mul(0x2C1B_3C6D);
    ((h ^ (h >> 13)) >> 8) as f32 / (1 << 24) as f32
}

/// Share of a footprint of `span` around `at` that lies between `from` and `to`.
fn covered(at: f32, span: f32, from: f32, to: f32) -> f32 {
    let span = span.max(1e-4);
    let overlap = (at + span / 2.0).min(to) - (at - span / 2.0).max(from);
    (overlap / span).clamp(0.0, 1.0)
}

/// Share of a footprint along the road that is dash and not gap.
fn dashes(s: f32, span: f32) -> f32 {
    const PERIOD: f32 = DASH_PERIOD_M as f32;
    const DASH: f32 = DASH_M as f32;
    let painted_before = |s: f32| {
        let periods = (s / PERIOD).floor();
        periods * DASH + (s - periods * PERIOD).min(DASH)
    };
    let span = span.max(1e-3);
    (painted_before(s + span / 2.0) - painted_before(s - span / 2.0)) / span
}

/// Lay `paint` over `pixel`, covering `share` of it.
#[inline(always)] // 100,000 times a picture, also in unoptimised builds
pub fn mix(pixel: &mut [f32; 3], paint: [f32; 3], share: f32) {
    // Written out because iterators are not free in the dev profile.
    pixel[0] += (paint[0] - pixel[0]) * share;
    pixel[1] += (paint[1] - pixel[1]) * share;
    pixel[2] += (paint[2] - pixel[2]) * share;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_footprint_over_many_dashes_sees_their_share() {
        assert!((dashes(123.0, 90.0) - (DASH_M / DASH_PERIOD_M) as f32).abs() < 1e-4);
        assert!((dashes(1.5, 0.1) - 1.0).abs() < 1e-4 && dashes(6.0, 0.1).abs() < 1e-4);
    }

    #[test]
    fn coverage_is_the_overlap_of_footprint_and_line() {
        assert_eq!(covered(0.0, 2.0, -0.5, 0.5), 0.5);
        assert_eq!(covered(5.0, 2.0, -0.5, 0.5), 0.0);
        assert_eq!(covered(0.1, 0.01, -0.5, 0.5), 1.0);
    }
}
