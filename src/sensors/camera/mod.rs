//! The camera: a scene onto a picture, on one core.
//!
//! ```text
//! tiles, bodies -> facets -> visibility (nearest facet per pixel) -> shading -> picture
//! ```

pub mod view;
pub mod raster;
pub mod facets;

use glam::{DAffine3, DQuat, DVec3, Vec3};

use crate::{
    projection,
    scene::{conditions::Sky, instant::Instant, surroundings::Surroundings},
    sensors::camera::{
        facets::Facets,
        raster::{NOTHING, Visibility},
        view::View,
    },
};

/// What a camera is, and where it sits.
#[derive(Clone, Debug)]
pub struct CameraConfig {
    /// Its distortion is not drawn.
    pub intrinsics: projection::Camera,
    /// Optical frame: x right, y down, z forward.
    pub ego_from_camera: DAffine3,
}

impl Default for CameraConfig {
    /// 600 x 250, 100 degrees wide, level, behind the windscreen (PAPER.md U20).
    fn default() -> CameraConfig {
        let rotation = DQuat::from_xyzw(-0.5, 0.5, -0.5, 0.5);
        CameraConfig {
            intrinsics: projection::Camera::from_fov(600, 250, 100_f64.to_radians()),
            ego_from_camera: DAffine3::from_rotation_translation(
                rotation,
                DVec3::new(2.0, 0.0, 1.4),
            ),
        }
    }
}

/// A camera with its memory, which is used again for each picture.
#[derive(Clone, Debug)]
pub struct Camera {
    config: CameraConfig,
    visibility: Visibility,
    facets: Facets,
    picture: Vec<u8>,
}

impl Camera {
    pub fn new(config: CameraConfig) -> Camera {
        let (width, height) = (config.intrinsics.width, config.intrinsics.height);
        Camera {
            visibility: Visibility::new(width, height),
            facets: Facets::default(),
            picture: vec![0; 3 * width * height],
            config,
        }
    }

    /// What the camera sees: RGB, row by row, 3 bytes a pixel. The same arguments give the same bytes;
    /// `seed` is the episode's, and `world_from_ego` includes the height of the ground.
    pub fn picture(
        &mut self,
        surroundings: &Surroundings,
        instant: &Instant,
        world_from_ego: &DAffine3,
        _sky: Sky,
        _seed: u64,
    ) -> &[u8] {
        let world_from_camera = *world_from_ego * self.config.ego_from_camera;
        let view = View::new(&self.config.intrinsics, &world_from_camera);
        self.facets.draw(&view, surroundings, instant, &mut self.visibility);
        let sun = Vec3::new(-0.42, -0.56, 0.71);
        for (pixel, facet) in self.picture.chunks_exact_mut(3).zip(&self.visibility.facet) {
            let colour = if *facet == NOTHING {
                [150.0, 180.0, 220.0]
            } else {
                let facet = &self.facets.facets[*facet as usize];
                let light = 0.55 + 0.45 * facet.normal.dot(sun).max(0.0);
                facet.colour.map(|value| f32::from(value) * light)
            };
            pixel.copy_from_slice(&colour.map(|value| value as u8));
        }
        &self.picture
    }
}
