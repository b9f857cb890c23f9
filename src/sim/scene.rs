//! What sensors see: convex solids on flat ground, as they stand at one instant.
//!
//! All three sensors take the same scene, so a return lies where the picture shows it.

use glam::{DAffine3, DVec3};

/// Colour as the camera records it, sRGB.
pub type Rgb = [u8; 3];

/// A box or a frustum: two rectangles, one above the other, and four sides.
#[derive(Clone, Debug)]
pub struct Solid {
    /// World frame, m: the lower rectangle, then the upper one, each front left, rear left, rear
    /// right, front right.
    pub corners_m: [DVec3; 8],
    /// Outward normals in the order of [`FACES`], and their distances from the origin.
    planes: [(DVec3, f64); 6],
    pub paint: Paint,
    /// Of the whole solid in the world frame, m/s.
    pub velocity_mps: DVec3,
    /// Share of lidar light that comes back, in [0, 1].
    pub reflectivity: f64,
}

/// Colours of the faces.
#[derive(Clone, Copy, Debug)]
pub struct Paint {
    pub top: Rgb,
    pub sides: Rgb,
}

/// Corners of the faces, counter-clockwise from outside: top, front, left, rear, right, bottom.
pub const FACES: [[usize; 4]; 6] =
    [[4, 5, 6, 7], [3, 0, 4, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 2, 1, 0]];

/// Size and place of a solid in the frame of what it belongs to, m.
#[derive(Clone, Copy, Debug)]
pub struct Shape {
    /// Middle of the lower rectangle.
    pub foot_m: DVec3,
    pub height_m: f64,
    /// Half extents (x, y) of the lower and upper rectangle.
    pub lower_m: [f64; 2],
    pub upper_m: [f64; 2],
    /// How far the upper rectangle stands ahead of the lower one.
    pub lean_m: f64,
}

impl Shape {
    /// An upright box on `foot_m`.
    pub fn block(foot_m: DVec3, half_m: [f64; 2], height_m: f64) -> Self {
        Shape { foot_m, height_m, lower_m: half_m, upper_m: half_m, lean_m: 0.0 }
    }
}

impl Solid {
    pub fn new(world_from_body: &DAffine3, shape: Shape, paint: Paint, reflectivity: f64) -> Self {
        const SIGNS: [[f64; 2]; 4] = [[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]];
        let corners_m = std::array::from_fn(|i| {
            let [sx, sy] = SIGNS[i % 4];
            let ([hx, hy], up) = if i < 4 {
                (shape.lower_m, DVec3::ZERO)
            } else {
                (shape.upper_m, DVec3::new(shape.lean_m, 0.0, shape.height_m))
            };
            let local = shape.foot_m + up + DVec3::new(sx * hx, sy * hy, 0.0);
            world_from_body.transform_point3(local)
        });
        let planes = FACES.map(|[a, b, c, _]| {
            let [a, b, c]: [DVec3; 3] = [corners_m[a], corners_m[b], corners_m[c]];
            let normal = (b - a).cross(c - b).normalize();
            (normal, normal.dot(a))
        });
        Solid { corners_m, planes, paint, velocity_mps: DVec3::ZERO, reflectivity }
    }

    /// The same solid on the move, world frame, m/s.
    pub fn moving(self, velocity_mps: DVec3) -> Self {
        Solid { velocity_mps, ..self }
    }

    /// Outward normal of a face of [`FACES`], world frame.
    pub fn normal(&self, face: usize) -> DVec3 {
        self.planes[face].0
    }

    /// Mean of the corners, world frame, m.
    pub fn centre_m(&self) -> DVec3 {
        self.corners_m.iter().sum::<DVec3>() / 8.0
    }

    /// Where a ray enters: distance in lengths of `direction`, and the face's normal. `None` if
    /// it misses, or starts inside.
    pub fn hit(&self, origin_m: DVec3, direction: DVec3) -> Option<(f64, DVec3)> {
        let (mut enter, mut leave) = ((0.0, None), f64::INFINITY);
        for (normal, distance) in self.planes {
            let (ahead, along) = (distance - normal.dot(origin_m), normal.dot(direction));
            if along == 0.0 {
                if ahead < 0.0 {
                    return None;
                }
            } else if along < 0.0 {
                if ahead / along > enter.0 {
                    enter = (ahead / along, Some(normal));
                }
            } else {
                leave = leave.min(ahead / along);
            }
        }
        (enter.0 < leave).then_some(()).and(enter.1.map(|normal| (enter.0, normal)))
    }

    /// How far a point lies outside the nearest face that it is outside of, m; negative inside.
    pub fn outside_m(&self, point_m: DVec3) -> f64 {
        self.planes.iter().map(|(n, d)| n.dot(point_m) - d).fold(f64::NEG_INFINITY, f64::max)
    }
}

/// A coloured quadrilateral on a solid's surface (a lamp, a window) or, dark, on the ground.
#[derive(Clone, Copy, Debug)]
pub struct Decal {
    /// World frame, m, counter-clockwise from where it can be seen.
    pub corners_m: [DVec3; 4],
    pub colour: Rgb,
    /// Lamps do not depend on the sun.
    pub glows: bool,
}

/// Everything but the ground and the sky.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    pub solids: Vec<Solid>,
    pub decals: Vec<Decal>,
    /// Outlines of shadows on the ground, world frame, m.
    pub shadows_m: Vec<[DVec3; 4]>,
}

impl Scene {
    /// The parts within `range_m` of a place; what is beyond is not for that sensor.
    pub fn add_near(&mut self, other: &Scene, place_m: DVec3, range_m: f64) {
        let near = |p: DVec3| p.distance_squared(place_m) < range_m * range_m;
        self.solids.extend(other.solids.iter().filter(|s| near(s.corners_m[0])).cloned());
        self.decals.extend(other.decals.iter().filter(|d| near(d.corners_m[0])));
        self.shadows_m.extend(other.shadows_m.iter().filter(|s| near(s[0])));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn block() -> Solid {
        let shape = Shape::block(DVec3::new(10.0, 0.0, 0.0), [1.0, 2.0], 3.0);
        Solid::new(&DAffine3::IDENTITY, shape, Paint { top: [0; 3], sides: [0; 3] }, 0.5)
    }

    #[test]
    fn a_ray_enters_a_box_at_its_near_face() {
        let (distance, normal) = block().hit(DVec3::new(0.0, 0.0, 1.0), DVec3::X).unwrap();
        assert!((distance - 9.0).abs() < 1e-12);
        assert!(normal.distance(DVec3::NEG_X) < 1e-12);
    }

    #[test]
    fn rays_that_pass_beside_behind_or_start_inside_miss() {
        let up = DVec3::new(0.0, 0.0, 1.0);
        assert_eq!(block().hit(up, DVec3::NEG_X), None);
        assert_eq!(block().hit(up + 3.0 * DVec3::Y, DVec3::X), None);
        assert_eq!(block().hit(DVec3::new(10.0, 0.0, 1.0), DVec3::X), None);
    }
}
