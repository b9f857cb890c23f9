//! Where the camera is, and what its view holds: the pinhole of [`projection::Camera`] in f32.

use glam::{Affine3A, DAffine3, Mat3, Vec2, Vec3, Vec3A};

use crate::projection;

/// What is nearer than this is not drawn, m.
pub const NEAR_M: f32 = 0.2;

/// What is further than this is not drawn, m.
pub const FAR_M: f32 = 400.0;

/// A pinhole camera at a place. Camera frame: x right, y down, z forward.
#[derive(Clone, Debug)]
pub struct View {
    pub width: usize,
    pub height: usize,
    /// Focal lengths and principal point, pixels.
    pub focal_px: Vec2,
    pub centre_px: Vec2,
    /// World frame, m.
    pub eye_m: Vec3,
    pub camera_from_world: Mat3,
    pub world_from_camera: Mat3,
    /// Inward normals of the planes through the eye that bound the view, world frame.
    sides: [Vec3; 4],
}

/// Rays through the pixels of a row, from the eye to 1 m ahead; world frame.
#[derive(Clone, Copy, Debug)]
pub struct Row {
    pub number: usize,
    /// Through the first pixel, and how rays change from pixel to pixel.
    pub first: Vec3A,
    pub across: Vec3A,
}

impl Row {
    #[inline]
    pub fn ray(&self, column: usize) -> Vec3A {
        self.first + self.across * column as i32 as f32
    }
}

impl View {
    pub fn new(intrinsics: &projection::Camera, world_from_camera: &DAffine3) -> View {
        let rotation = world_from_camera.matrix3.as_mat3();
        let (width, height) = (intrinsics.width as f32, intrinsics.height as f32);
        let focal_px = Vec2::new(intrinsics.fx as f32, intrinsics.fy as f32);
        let centre_px = Vec2::new(intrinsics.cx as f32, intrinsics.cy as f32);
        let sides = [
            Vec3::new(focal_px.x, 0.0, centre_px.x),
            Vec3::new(-focal_px.x, 0.0, width - centre_px.x),
            Vec3::new(0.0, focal_px.y, centre_px.y),
            Vec3::new(0.0, -focal_px.y, height - centre_px.y),
        ];
        View {
            width: intrinsics.width,
            height: intrinsics.height,
            focal_px,
            centre_px,
            eye_m: world_from_camera.translation.as_vec3(),
            camera_from_world: rotation.transpose(),
            world_from_camera: rotation,
            sides: sides.map(|side| rotation * side.normalize()),
        }
    }

    /// Whether a box along the axes of the world may hold something that is seen.
    pub fn may_see_box(&self, low_m: Vec3, high_m: Vec3) -> bool {
        let (low, high) = (low_m - self.eye_m, high_m - self.eye_m);
        let nearest = low.max(-high).max(Vec3::ZERO);
        nearest.length_squared() < FAR_M * FAR_M
            && self.sides.iter().all(|side| (*side * low).max(*side * high).element_sum() >= 0.0)
    }

    /// Whether a ball may hold something that is seen.
    pub fn may_see_ball(&self, centre_m: Vec3, radius_m: f32) -> bool {
        let centre = centre_m - self.eye_m;
        centre.length_squared() < (FAR_M + radius_m).powi(2)
            && self.sides.iter().all(|side| side.dot(centre) >= -radius_m)
    }

    /// From the frame of a body, to be applied as rotation, then shift.
    pub fn camera_from_body(&self, world_from_body: &Affine3A) -> (Mat3, Vec3) {
        let rotation = self.camera_from_world * Mat3::from(world_from_body.matrix3);
        let shift = Vec3::from(world_from_body.translation) - self.eye_m;
        (rotation, self.camera_from_world * shift)
    }

    /// A place of the world in the camera frame, m.
    pub fn seen_m(&self, place_m: Vec3) -> Vec3 {
        self.camera_from_world * (place_m - self.eye_m)
    }

    /// Where a place of the camera frame falls on the picture, pixels.
    pub fn project_px(&self, seen_m: Vec3) -> Vec2 {
        seen_m.truncate() / seen_m.z * self.focal_px + self.centre_px
    }

    /// From the eye through a place on the picture to where it is 1 m ahead; world frame.
    pub fn ray(&self, place_px: Vec2) -> Vec3 {
        self.world_from_camera * ((place_px - self.centre_px) / self.focal_px).extend(1.0)
    }

    /// The rays of a row.
    pub fn row(&self, number: usize) -> Row {
        let first = self.ray(Vec2::new(0.5, number as f32 + 0.5)).into();
        let across = (self.world_from_camera.x_axis / self.focal_px.x).into();
        Row { number, first, across }
    }
}
