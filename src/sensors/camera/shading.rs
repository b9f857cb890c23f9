//! Light on what each pixel shows, once per pixel.

use glam::{Vec2, Vec3, Vec3A};

use crate::sensors::camera::{
    curves::{fade, smooth},
    facets::Facet,
    grain::Grain,
    lamps::{Beam, LightMap, glow},
    light::Light,
    raster::{NOTHING, Visibility},
    shadows::Shadows,
    sky,
    surfaces::Surface,
    view::View,
};

/// Share of the light of the own lamps that drops throw back into the camera.
const VEIL: f32 = 0.009;

/// Everything that lights a picture.
pub struct Lighting<'a> {
    pub light: &'a Light,
    pub grain: &'a Grain,
    pub shadows: &'a Shadows,
    pub lamps: &'a LightMap,
    pub beam: Beam,
    /// Which bodies brake.
    pub is_braking: &'a dyn Fn(u32) -> bool,
    /// How far clouds have moved, texels.
    pub drift: Vec2,
    /// Of the ground below the eye, world frame, m.
    pub ground_m: f32,
}

/// A facet, lit.
struct Lit {
    surface: Surface,
    normal: Vec3A,
    /// Light from sky and ground, and from the sun where nothing stands before it.
    ambient: Vec3A,
    sun: Vec3A,
    emission: Vec3A,
    faces_up: bool,
}

impl Lighting<'_> {
    /// Radiance of all pixels, row by row; `openness` is the share of the sky that the ground there
    /// sees past bodies.
    pub fn shade(
        &self,
        view: &View,
        visibility: &Visibility,
        facets: &[Facet],
        openness: &[f32],
        radiance: &mut [Vec3A],
    ) {
        let across = Vec3A::from(view.world_from_camera.x_axis / view.focal_px.x);
        for row in 0..view.height {
            let start = row * view.width;
            let first = Vec3A::from(view.ray(Vec2::new(0.5, row as f32 + 0.5)));
            let mut column = 0;
            while column < view.width {
                let facet = visibility.facet[start + column];
                let run = visibility.facet[start + column..start + view.width].iter();
                let end = column + run.take_while(|other| **other == facet).count();
                let rays = (column..end).map(|column| first + across * column as f32);
                let pixels = radiance[start + column..start + end].iter_mut();
                if facet == NOTHING {
                    for (pixel, ray) in pixels.zip(rays) {
                        *pixel = self.sky(ray.normalize());
                    }
                } else {
                    let facet = &facets[facet as usize];
                    let lit = self.prepare(facet);
                    let nearness = visibility.nearness[start + column..start + end].iter();
                    let openness = openness[start + column..start + end].iter();
                    for (((pixel, ray), nearness), openness) in
                        pixels.zip(rays).zip(nearness).zip(openness)
                    {
                        *pixel = self.pixel(view, facet, &lit, ray, 1.0 / nearness, *openness);
                    }
                }
                column = end;
            }
        }
    }

    fn sky(&self, direction: Vec3A) -> Vec3A {
        let veil = self.veil(direction);
        sky::radiance(self.light, self.grain, direction, self.drift) + Vec3A::splat(veil)
    }

    fn prepare(&self, facet: &Facet) -> Lit {
        let light = self.light;
        let normal = Vec3A::from(facet.normal);
        let upward = 0.5 + 0.5 * normal.z;
        let is_braking = facet.body.is_some_and(|body| (self.is_braking)(body));
        Lit {
            surface: Surface::new(facet),
            normal,
            ambient: light.below.lerp(light.above, upward),
            sun: light.sun * normal.dot(light.sun_direction).max(0.0),
            emission: glow(light, facet.material, is_braking),
            faces_up: normal.z > 0.8,
        }
    }

    #[inline]
    fn pixel(
        &self,
        view: &View,
        facet: &Facet,
        lit: &Lit,
        ray: Vec3A,
        depth_m: f32,
        openness: f32,
    ) -> Vec3A {
        let light = self.light;
        let from_eye_m = ray * depth_m;
        let place_m = from_eye_m + Vec3A::from(view.eye_m);
        let distance_m = from_eye_m.length();
        let direction = from_eye_m / distance_m;
        let facing = (-direction.dot(lit.normal)).max(0.02);
        let footprint_m = depth_m / (view.focal_px.x * facing.sqrt());
        let texture_m = || facet.texture.at_m(Vec3::from(from_eye_m));
        let look = lit.surface.look(self.grain, place_m, texture_m, footprint_m);

        let mut arriving = lit.ambient * openness;
        if lit.sun.x > 0.0 {
            arriving += lit.sun * self.shadows.sunlight(place_m, lit.normal);
        }
        if light.exposure > 2.0 {
            let height_m = place_m.z - self.ground_m;
            let share = if lit.faces_up { 1.0 } else { 0.5 } * smooth(9.0, 4.0, height_m);
            arriving += self.lamps.at(place_m.x, place_m.y) * share;
            arriving += self.beam.on(from_eye_m, lit.normal);
        }
        // Water darkens what it soaks.
        let soaked = 1.0 - 0.35 * light.wetness;
        let mut colour = look.albedo * soaked * arriving + lit.emission;
        if look.mirror > 0.0 {
            let fresnel = look.mirror + (1.0 - look.mirror) * (1.0 - facing).powi(4) * 0.6;
            let away = direction + lit.normal * (2.0 * facing);
            let mirrored = light.horizon.lerp(light.zenith, smooth(0.0, 0.9, away.z));
            let mirrored = if away.z > 0.0 { mirrored } else { light.below * 0.4 };
            let fresnel = if look.lit > 0.0 {
                look.mirror * 0.5
            } else {
                fresnel * look.mirror.min(0.3) * 3.0
            };
            colour = colour * (1.0 - 0.5 * fresnel) + mirrored * fresnel;
            colour += Vec3A::new(0.34, 0.24, 0.11) * (look.lit * light.windows);
        }
        self.haze(colour, direction, distance_m)
    }

    /// What rain throws back of the light of the own head lamps.
    #[inline]
    fn veil(&self, direction: Vec3A) -> f32 {
        if self.light.rain == 0.0 {
            return 0.0;
        }
        self.beam.veil(direction) * self.light.haze_per_m * VEIL
    }

    /// What is left of a colour, and what the air adds on the way.
    #[inline]
    fn haze(&self, colour: Vec3A, direction: Vec3A, distance_m: f32) -> Vec3A {
        let left = fade(self.light.haze_per_m * distance_m);
        // Rain in the beam of the head lamps: most of it comes from the first metres.
        let veil = self.veil(direction);
        let near = fade(distance_m * 0.3);
        colour * left + self.light.horizon * (1.0 - left) + Vec3A::splat(veil * (1.0 - near))
    }
}
