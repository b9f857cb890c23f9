//! Wet ground: a film that mirrors what stands behind it, smeared, and puddles that mirror it clearly.

use glam::{Vec2, Vec3, Vec3A};

use crate::{
    scene::mesh::Material,
    sensors::camera::{
        curves::{fade, lot, smooth},
        facets::Facet,
        grain::Grain,
        light::Light,
        raster::{NOTHING, Visibility},
        view::View,
    },
};

/// Places along a mirrored ray that are looked at.
const STEPS: usize = 6;

/// A camera is level if its axes are within this of those of the world.
const LEVEL: f32 = 0.03;

/// What the water on the ground does to a picture.
pub struct Water<'a> {
    pub view: &'a View,
    pub visibility: &'a Visibility,
    pub facets: &'a [Facet],
    pub light: &'a Light,
    pub grain: &'a Grain,
}

impl Water<'_> {
    /// Add the mirrored light, from the top row to the bottom: a mirrored ray rises on the picture.
    pub fn add(&self, radiance: &mut [Vec3A]) {
        let view = self.view;
        if self.light.wetness <= 0.0 {
            return;
        }
        // Only of a level camera do mirrored rays stay in their column.
        let axes = &view.world_from_camera;
        let is_level = axes.x_axis.z.abs() < LEVEL && axes.z_axis.z.abs() < LEVEL;
        for row in 0..view.height {
            let start = row * view.width;
            let first = view.ray(Vec2::new(0.5, row as f32 + 0.5));
            let across = axes.x_axis / view.focal_px.x;
            let mut known = (NOTHING, false);
            let mut mirrored = None;
            for column in 0..view.width {
                let facet = self.visibility.facet[start + column];
                if facet != known.0 {
                    known = (facet, self.is_wet_ground(facet));
                }
                if known.1 {
                    let ray = first + across * column as f32;
                    // Neighbours mirror nearly the same: the water is not smooth enough to tell.
                    let before = mirrored.filter(|_| column % 2 == 1);
                    mirrored = self.mirror(row, column, ray, before, is_level, radiance);
                } else {
                    mirrored = None;
                }
            }
        }
    }

    fn is_wet_ground(&self, facet: u32) -> bool {
        facet != NOTHING && {
            let facet = &self.facets[facet as usize];
            let is_paved = matches!(
                facet.material,
                Material::Asphalt | Material::Marking | Material::Concrete
            );
            is_paved && facet.normal.z > 0.9
        }
    }

    /// Add what a pixel mirrors (`before`, if that is known), and return it.
    #[inline]
    fn mirror(
        &self,
        row: usize,
        column: usize,
        ray: Vec3,
        before: Option<Vec3A>,
        is_level: bool,
        radiance: &mut [Vec3A],
    ) -> Option<Vec3A> {
        let (view, light) = (self.view, self.light);
        let place = row * view.width + column;
        let nearness = self.visibility.nearness[place];
        let from_eye_m = ray / nearness;
        let distance_m = from_eye_m.length();
        let above_m = -from_eye_m.z;
        if above_m < 0.1 {
            return None;
        }
        let facing = above_m / distance_m;
        let grazing = 1.0 - facing;
        let fresnel = 0.03 + 0.97 * grazing * grazing * grazing * grazing;
        let at_m = view.eye_m + from_eye_m;
        let footprint_m = distance_m / (view.focal_px.x * facing.sqrt());
        let pool = self.grain.at(at_m.x * 2.2, at_m.y * 2.2, footprint_m * 2.2);
        let edge = 0.45 - 0.35 * light.puddles;
        let puddle = smooth(edge, edge + 0.25, pool) * light.puddles.sqrt();
        let film = 0.42 * light.wetness;
        let strength = fresnel * (film + (0.95 - film) * puddle);
        if strength < 0.02 {
            return None;
        }
        let rough = 1.0 - 0.85 * puddle;
        let mirrored = before.unwrap_or_else(|| {
            let met = is_level.then(|| self.march(row, column, nearness, above_m, rough, radiance));
            let sky = || light.horizon.lerp(light.zenith, smooth(0.0, 0.8, facing));
            met.flatten().unwrap_or_else(sky)
        });
        let left = fade(light.haze_per_m * distance_m);
        let share = strength * left;
        // Water that mirrors lets less light down to the ground.
        radiance[place] = radiance[place] * (1.0 - 0.6 * share) + mirrored * share;
        Some(mirrored)
    }

    /// Follow the mirrored ray up its column to what stands in its way.
    #[inline]
    fn march(
        &self,
        row: usize,
        column: usize,
        nearness: f32,
        above_m: f32,
        rough: f32,
        radiance: &[Vec3A],
    ) -> Option<Vec3A> {
        let view = self.view;
        let below_horizon = row as f32 + 0.5 - view.centre_px.y;
        let rise = 2.0 * below_horizon;
        let per_row = 1.0 / (view.focal_px.y * above_m);
        let dice = lot(row as i32, column as i32, 7);
        let mut last = None;
        for step in 1..=STEPS {
            let share = (step as f32 - dice * 0.9) / STEPS as f32;
            let at = row as f32 - rise * share;
            if at < 0.0 {
                return last;
            }
            let place = at as usize * view.width + column;
            let there = (at + 0.5 - view.centre_px.y) * per_row;
            let ray_nearness = 0.5 * (there + nearness);
            last = Some(radiance[place]);
            if self.visibility.nearness[place] > ray_nearness * 1.01 {
                break;
            }
        }
        // A rough film smears what it mirrors, up and down.
        let smear = (rise * 0.45 * dice * rough) as usize;
        let other = (row as f32 - rise).max(0.0) as usize + smear;
        let other = radiance[other.min(row) * view.width + column];
        last.map(|seen| seen.lerp(other, 0.35 * rough))
    }
}
