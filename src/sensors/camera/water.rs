//! Wet ground: a film that mirrors what stands behind it, smeared, and puddles that mirror it clearly.

use std::ops::Range;

use glam::Vec3A;

use crate::{
    scene::mesh::Material,
    sensors::camera::{
        curves::{fade, lot, smooth},
        facets::Facet,
        grain::Grain,
        light::Light,
        raster::{NOTHING, Visibility},
        view::{Row, View},
    },
};

/// Places along a mirrored ray that are looked at.
const STEPS: usize = 6;

/// A camera is level if its axes are within this of those of the world.
const LEVEL: f32 = 0.03;

/// Mirrored rays are followed for one in so many pixels of a row: the water is not smooth enough to
/// tell.
const KNOTS_PX: usize = 4;

/// What changes slowly along a row.
#[derive(Clone, Copy)]
struct Knot {
    /// Share of the light that is left by the way through the air; share that water mirrors at this
    /// angle; breadth of the pixel on the ground, m.
    water: Vec3A,
    mirrored: Vec3A,
}

/// Two pixels that a place mirrors, and the share of the second.
#[derive(Clone, Copy)]
struct Met {
    pixel: usize,
    other: usize,
    share: f32,
}

/// Those of a run, with what they mirror.
type Knots = Vec<(Knot, Option<Met>)>;

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
        let mut knots = Knots::new();
        for row in 0..view.height {
            let row = view.row(row);
            let start = row.number * view.width;
            let facets = &self.visibility.facet[start..start + view.width];
            let mut known = (NOTHING, false);
            let mut is_wet = |facet: u32| {
                if facet != known.0 {
                    known = (facet, self.is_wet_ground(facet));
                }
                known.1
            };
            let mut from = 0;
            while let Some(dry) = facets[from..].iter().position(|facet| is_wet(*facet)) {
                from += dry;
                let wet = facets[from..].iter().take_while(|facet| is_wet(**facet)).count();
                self.mirror(&row, from..from + wet, is_level, &mut knots, radiance);
                from += wet;
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

    /// Add what the pixels of a run mirror.
    fn mirror(
        &self,
        row: &Row,
        run: Range<usize>,
        is_level: bool,
        knots: &mut Knots,
        radiance: &mut [Vec3A],
    ) {
        let light = self.light;
        let start = row.number * self.view.width;
        let nearness = &self.visibility.nearness[start..];
        let eye_m = Vec3A::from(self.view.eye_m);
        let film = 0.42 * light.wetness;
        let last = run.end - 1;
        knots.clear();
        knots.extend(run.clone().step_by(KNOTS_PX).map(|column| self.knot(row, column, is_level)));
        if !(last - run.start).is_multiple_of(KNOTS_PX) {
            knots.push(self.knot(row, last, is_level));
        }
        // What is mirrored lies all over the memory: asked for at once, it comes at once.
        for (knot, met) in knots.iter_mut() {
            if let Some(Met { pixel, other, share }) = *met {
                knot.mirrored = radiance[pixel].lerp(radiance[other], share);
            }
        }
        let mut from = run.start;
        for (place, (here, _)) in knots.iter().enumerate() {
            let (there, _) = knots.get(place + 1).unwrap_or(&knots[place]);
            let to = (from + KNOTS_PX).min(last);
            let per_pixel = 1.0 / (to - from).max(1) as f32;
            // The last pixel of a run stands for itself.
            for column in from..to.max(from + 1) {
                let share = (column - from) as f32 * per_pixel;
                let water = here.water.lerp(there.water, share);
                let [left, fresnel, footprint_m] = water.to_array();
                let at_m = eye_m + row.ray(column) / nearness[column];
                let puddle = self.puddle(at_m, footprint_m);
                let strength = fresnel * (film + (0.95 - film) * puddle);
                if strength < 0.02 {
                    continue;
                }
                let share_mirrored = strength * left;
                let mirrored = here.mirrored.lerp(there.mirrored, share);
                // Water that mirrors lets less light down to the ground.
                let pixel = &mut radiance[start + column];
                *pixel = *pixel * (1.0 - 0.6 * share_mirrored) + mirrored * share_mirrored;
            }
            from = to;
        }
    }

    /// What is at a pixel, with the sky mirrored, and what is mirrored instead of it.
    fn knot(&self, row: &Row, column: usize, is_level: bool) -> (Knot, Option<Met>) {
        let (view, light) = (self.view, self.light);
        let nearness = self.visibility.nearness[row.number * view.width + column];
        let from_eye_m = row.ray(column) / nearness;
        let distance_m = from_eye_m.length();
        let above_m = -from_eye_m.z;
        if above_m < 0.1 {
            return (Knot { water: Vec3A::ZERO, mirrored: light.horizon }, None);
        }
        let facing = above_m / distance_m;
        let grazing = 1.0 - facing;
        let fresnel = 0.03 + 0.97 * grazing * grazing * grazing * grazing;
        let footprint_m = distance_m / (view.focal_px.x * facing.sqrt());
        let rough = 1.0 - 0.85 * self.puddle(Vec3A::from(view.eye_m) + from_eye_m, footprint_m);
        let knot = Knot {
            water: Vec3A::new(fade(light.haze_per_m * distance_m), fresnel, footprint_m),
            mirrored: light.horizon.lerp(light.zenith, smooth(0.0, 0.8, facing)),
        };
        let met = is_level.then(|| self.march(row.number, column, nearness, above_m, rough));
        (knot, met.flatten())
    }

    /// How much of a puddle there is at a place on the ground, world frame, in [0, 1].
    #[inline]
    fn puddle(&self, at_m: Vec3A, footprint_m: f32) -> f32 {
        let puddles = self.light.puddles;
        let pool = self.grain.at(at_m.x * 2.2, at_m.y * 2.2, footprint_m * 2.2);
        let edge = 0.45 - 0.35 * puddles;
        smooth(edge, edge + 0.25, pool) * puddles.sqrt()
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
    ) -> Option<Met> {
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
                return last.map(|pixel| Met { pixel, other: pixel, share: 0.0 });
            }
            let place = at as usize * view.width + column;
            let there = (at + 0.5 - view.centre_px.y) * per_row;
            let ray_nearness = 0.5 * (there + nearness);
            last = Some(place);
            if self.visibility.nearness[place] > ray_nearness * 1.01 {
                break;
            }
        }
        // A rough film smears what it mirrors, up and down.
        let smear = (rise * 0.45 * dice * rough) as usize;
        let other = (row as f32 - rise).max(0.0) as usize + smear;
        let other = other.min(row) * view.width + column;
        last.map(|pixel| Met { pixel, other, share: 0.35 * rough })
    }
}
