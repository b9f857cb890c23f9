//! The camera: a scene onto a picture, on one core.
//!
//! ```text
//! tiles, bodies -> facets -> visibility (nearest facet per pixel) -> shading -> picture
//! ```

pub mod curves;
pub mod view;
pub mod raster;
pub mod facets;
pub mod grain;
pub mod light;
pub mod sky;
pub mod surfaces;
pub mod lamps;
pub mod shadows;
pub mod contact;
pub mod knots;
pub mod shading;
pub mod glows;
pub mod water;
pub mod rain;
pub mod lens;
pub mod develop;

use glam::{DAffine3, DQuat, DVec3, Vec2, Vec3A};

use crate::{
    noise::{Noise, Purpose},
    projection,
    scene::{conditions::Sky, instant::Instant, surroundings::Surroundings},
    sensors::camera::{
        develop::Sensor,
        facets::Facets,
        grain::Grain,
        lamps::{Beam, Lamp, LightMap},
        lens::Lens,
        light::Light,
        raster::Visibility,
        shading::Lighting,
        shadows::Shadows,
        view::View,
        water::Water,
    },
};

/// Instants are told apart to this, 1/s: noise and rain are drawn anew for each.
const TICKS_HZ: f64 = 1000.0;

/// How far rain leans, pixels across for each one down.
const WIND: f32 = -0.12;

/// Sun shadows and the light of lamps are drawn around a place so far ahead, m.
const AHEAD_M: f32 = 38.0;

/// What a camera is, and where it sits.
#[derive(Clone, Debug)]
pub struct CameraConfig {
    /// Its distortion is not drawn.
    pub intrinsics: projection::Camera,
    /// Optical frame: x right, y down, z forward.
    pub ego_from_camera: DAffine3,
}

impl Default for CameraConfig {
    /// 600 x 250, 100 degrees wide, level, behind the windscreen.
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
    grain: Grain,
    sensor: Sensor,
    visibility: Visibility,
    facets: Facets,
    shadows: Shadows,
    lamps: Vec<Lamp>,
    light_map: LightMap,
    openness: Vec<f32>,
    lens: Lens,
    radiance: Vec<Vec3A>,
    picture: Vec<u8>,
}

impl Camera {
    pub fn new(config: CameraConfig) -> Camera {
        let (width, height) = (config.intrinsics.width, config.intrinsics.height);
        Camera {
            grain: Grain::default(),
            sensor: Sensor::default(),
            visibility: Visibility::new(width, height),
            facets: Facets::default(),
            shadows: Shadows::default(),
            lamps: Vec::new(),
            light_map: LightMap::default(),
            lens: Lens::default(),
            openness: vec![1.0; width * height],
            radiance: vec![Vec3A::ZERO; width * height],
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
        sky: Sky,
        seed: u64,
    ) -> &[u8] {
        let world_from_camera = *world_from_ego * self.config.ego_from_camera;
        let view = View::new(&self.config.intrinsics, &world_from_camera);
        let light = Light::new(sky);
        let tick = (instant.time_s * TICKS_HZ).round() as u32;
        self.facets.draw(&view, surroundings, instant, &mut self.visibility);
        let facets = &self.facets.facets;
        contact::openness(&view, &self.visibility, facets, instant, &mut self.openness);
        let ahead_m = view.eye_m + view.world_from_camera.z_axis * AHEAD_M;
        self.shadows.draw(&light, surroundings, instant, ahead_m);
        lamps::find(&light, surroundings, instant, view.eye_m, &mut self.lamps);
        self.light_map.draw(&light, &self.lamps, ahead_m.truncate());
        let axes = world_from_ego.matrix3;
        let axes = [axes.x_axis, axes.y_axis, axes.z_axis].map(|axis| axis.as_vec3a());
        let origin_m = (world_from_ego.translation - world_from_camera.translation).as_vec3a();
        let beam = Beam::new(&light, axes, origin_m);
        let lighting = Lighting {
            light: &light,
            grain: &self.grain,
            shadows: &self.shadows,
            lamps: &self.light_map,
            beam,
            is_braking: &|body| instant.bodies[body as usize].is_braking,
            drift: Vec2::new(0.06, 0.03) * instant.time_s as f32,
            ground_m: world_from_ego.translation.z as f32,
        };
        lighting.shade(&view, &self.visibility, facets, &self.openness, &mut self.radiance);
        let radiance = &mut self.radiance;
        glows::add(&view, &self.visibility, &light, &self.lamps, radiance);
        let visibility = &self.visibility;
        let water = Water { view: &view, visibility, facets, light: &light, grain: &self.grain };
        water.add(radiance);
        let mut drops = Noise::new(seed, tick, Purpose::Rain);
        rain::draw(&view, &light, &beam, WIND, &mut drops, radiance);
        self.lens.draw(&view, &light, seed, instant.time_s, radiance);
        let mut shot = Noise::new(seed, tick, Purpose::Camera);
        self.sensor.develop(&light, &self.radiance, &mut shot, view.width, &mut self.picture);
        &self.picture
    }

    /// Depth of what each pixel of the last picture shows, m, row by row: along the optical axis, as the
    /// z of the camera's frame; infinite where there is sky.
    pub fn depths_m(&self) -> impl Iterator<Item = f32> {
        self.visibility.nearness.iter().map(|nearness| 1.0 / nearness)
    }
}
