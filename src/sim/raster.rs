//! Polygons onto a picture, nearest first, by the plane each of them lies in.

use glam::DVec3;

use crate::{projection::Camera, sim::scene::Rgb};

/// Nearest depth that is drawn, m.
const NEAR_M: f64 = 0.2;

/// A picture with the depth of what has been drawn so far.
#[derive(Clone, Debug)]
pub struct Canvas {
    pub width: usize,
    pub height: usize,
    /// Row by row, 3 bytes a pixel.
    pub rgb: Vec<u8>,
    /// 1 / depth, 1/m; 0 where nothing but ground and sky has been drawn.
    nearness_per_m: Vec<f32>,
}

/// How a polygon covers what is behind it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Cover {
    /// Paint, hidden by what is nearer.
    Solid(Rgb),
    /// Darken the ground to this share; depth plays no part.
    Shadow(f32),
}

impl Canvas {
    pub fn new(width: usize, height: usize) -> Self {
        let pixels = width * height;
        Canvas { width, height, rgb: vec![0; 3 * pixels], nearness_per_m: vec![0.0; pixels] }
    }

    /// Draw a convex polygon given in the camera's optical frame, m.
    ///
    /// Lens distortion is not drawn: the simulated camera has none.
    pub fn polygon(&mut self, camera: &Camera, corners_m: &[DVec3], cover: Cover) {
        let corners_m = clip(corners_m);
        let [a, b, c, ..] = corners_m[..] else { return };
        let normal = (b - a).cross(c - a);
        let distance = normal.dot(a);
        if distance.abs() < 1e-12 {
            return;
        }
        let outline: Vec<[f64; 2]> = corners_m
            .iter()
            .map(|p| [camera.fx * p.x / p.z + camera.cx, camera.fy * p.y / p.z + camera.cy])
            .collect();
        let top = outline.iter().map(|p| p[1]).fold(f64::INFINITY, f64::min);
        let bottom = outline.iter().map(|p| p[1]).fold(f64::NEG_INFINITY, f64::max);
        let rows = pixels_between(top, bottom, self.height);
        // On the plane, 1 / z is linear in the picture: n . (x / z, y / z, 1) / d.
        let per_column = normal.x / camera.fx / distance;
        for row in rows {
            let v = row as f64 + 0.5;
            let Some((left, right)) = span(&outline, v) else { continue };
            let columns = pixels_between(left, right, self.width);
            let x = (columns.start as f64 + 0.5 - camera.cx) / camera.fx;
            let y = (v - camera.cy) / camera.fy;
            let start = (normal.x * x + normal.y * y + normal.z) / distance;
            self.row(row, columns, start as f32, per_column as f32, cover);
        }
    }

    fn row(
        &mut self,
        row: usize,
        columns: std::ops::Range<usize>,
        start_per_m: f32,
        per_column: f32,
        cover: Cover,
    ) {
        let from = row * self.width + columns.start;
        let to = from + columns.len();
        let pixels = self.rgb[3 * from..3 * to].chunks_exact_mut(3);
        let depths = &mut self.nearness_per_m[from..to];
        for (i, (pixel, depth)) in pixels.zip(depths).enumerate() {
            match cover {
                Cover::Solid(rgb) => {
                    let nearness = start_per_m + per_column * i as f32;
                    if nearness >= *depth {
                        *depth = nearness;
                        pixel.copy_from_slice(&rgb);
                    }
                }
                Cover::Shadow(light) => {
                    for channel in pixel {
                        *channel = (f32::from(*channel) * light) as u8;
                    }
                }
            }
        }
    }
}

/// Pixels whose middles lie between two places.
fn pixels_between(from: f64, to: f64, size: usize) -> std::ops::Range<usize> {
    let pixel = |x: f64| (x - 0.5).ceil().clamp(0.0, size as f64) as usize;
    pixel(from)..pixel(to).max(pixel(from))
}

/// Where a convex outline meets a row.
fn span(outline: &[[f64; 2]], v: f64) -> Option<(f64, f64)> {
    let (mut left, mut right) = (f64::INFINITY, f64::NEG_INFINITY);
    for (i, [u0, v0]) in outline.iter().enumerate() {
        let [u1, v1] = outline[(i + 1) % outline.len()];
        if (*v0 <= v) != (v1 <= v) {
            let u = u0 + (u1 - u0) * (v - v0) / (v1 - v0);
            (left, right) = (left.min(u), right.max(u));
        }
    }
    (left < right).then_some((left, right))
}

/// The part of a convex polygon beyond the near plane (Sutherland and Hodgman).
fn clip(corners_m: &[DVec3]) -> Vec<DVec3> {
    if corners_m.iter().all(|p| p.z >= NEAR_M) {
        return corners_m.to_vec();
    }
    let mut kept = Vec::with_capacity(corners_m.len() + 1);
    for (i, a) in corners_m.iter().enumerate() {
        let b = &corners_m[(i + 1) % corners_m.len()];
        if a.z >= NEAR_M {
            kept.push(*a);
        }
        if (a.z >= NEAR_M) != (b.z >= NEAR_M) {
            kept.push(a.lerp(*b, (NEAR_M - a.z) / (b.z - a.z)));
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(z: f64) -> [DVec3; 4] {
        [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| DVec3::new(x, y, z))
    }

    #[test]
    fn the_nearer_of_two_polygons_is_seen_in_either_order() {
        let camera = Camera::from_fov(40, 40, 1.5);
        for order in [[4.0, 8.0], [8.0, 4.0]] {
            let mut canvas = Canvas::new(40, 40);
            for z in order {
                canvas.polygon(&camera, &square(z), Cover::Solid([z as u8; 3]));
            }
            assert_eq!(canvas.rgb[3 * (20 * 40 + 20)], 4);
        }
    }

    #[test]
    fn a_polygon_covers_the_pixels_that_its_points_project_to() {
        let camera = Camera::from_fov(40, 40, 1.5);
        let mut canvas = Canvas::new(40, 40);
        canvas.polygon(&camera, &square(3.0), Cover::Solid([9; 3]));
        let inside = camera.pixel([0.9, -0.9, 3.0]).unwrap() as usize;
        let outside = camera.pixel([1.2, -0.9, 3.0]).unwrap() as usize;
        assert_eq!((canvas.rgb[3 * inside], canvas.rgb[3 * outside]), (9, 0));
    }

    #[test]
    fn what_reaches_behind_the_camera_is_cut_and_not_mirrored() {
        let camera = Camera::from_fov(40, 40, 1.5);
        let mut canvas = Canvas::new(40, 40);
        let floor = [(-5.0, -9.0), (5.0, -9.0), (5.0, 9.0), (-5.0, 9.0)];
        let floor = floor.map(|(x, z)| DVec3::new(x, 1.0, z));
        canvas.polygon(&camera, &floor, Cover::Solid([9; 3]));
        assert!(canvas.rgb[..3 * 20 * 40].iter().all(|c| *c == 0), "above the horizon");
        assert_eq!(canvas.rgb[3 * (39 * 40 + 20)], 9);
    }
}
