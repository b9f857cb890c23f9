//! Light on what each pixel shows, once per pixel.

use std::ops::Range;

use glam::{Vec2, Vec3A};

use crate::sensors::camera::{
    curves::{fade, smooth},
    facets::{Facet, Texture},
    grain::Grain,
    knots::{Between, Knot},
    lamps::{Beam, LightMap, glow},
    light::Light,
    raster::{NOTHING, Visibility},
    shadows::Shadows,
    sky,
    surfaces::Surface,
    view::{Row, View},
};

/// Share of the light of the own lamps that drops throw back into the camera.
const VEIL: f32 = 0.009;

/// Light is worked out once for so many pixels of a row of a facet, or of the sky.
const KNOTS_PX: usize = 16;
const SKY_KNOTS_PX: usize = 4;

/// Shadows are looked up so far before a surface, m.
const OFF_SURFACE_M: f32 = 0.06;

/// On so few pixels it does not change.
const SHORT_PX: usize = 3;

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

/// A facet, prepared.
struct Lit {
    surface: Surface,
    texture: Texture,
    normal: Vec3A,
    /// The eye.
    eye: Place,
    /// Light from sky and ground, and from the sun where nothing stands before it.
    ambient: Vec3A,
    sun: Vec3A,
    emission: Vec3A,
    /// Share of light that water leaves.
    soaked: f32,
    faces_up: bool,
    is_shiny: bool,
}

/// A place, or how places change, in three frames.
#[derive(Clone, Copy)]
struct Place {
    /// m.
    world: Vec3A,
    /// On the surface, m.
    texture: Vec2,
    /// On the map of shadows.
    shadow: Vec3A,
}

impl Place {
    #[inline]
    fn plus(&self, change: &Place, times: f32) -> Place {
        Place {
            world: self.world + change.world * times,
            texture: self.texture + change.texture * times,
            shadow: self.shadow + change.shadow * times,
        }
    }
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
        for number in 0..view.height {
            let pixels = number * view.width..(number + 1) * view.width;
            let row = view.row(number);
            let facet = &visibility.facet[pixels.clone()];
            let nearness = &visibility.nearness[pixels.clone()];
            let openness = &openness[pixels.clone()];
            let radiance = &mut radiance[pixels];
            let mut from = 0;
            while from < view.width {
                let this = facet[from];
                let end = from + facet[from..].iter().take_while(|other| **other == this).count();
                let run = from..end;
                if this == NOTHING {
                    self.shade_sky(&row, run, radiance);
                } else {
                    let lit = self.prepare(view, &facets[this as usize]);
                    self.shade_facet(view, &lit, &row, run, nearness, openness, radiance);
                }
                from = end;
            }
        }
    }

    fn shade_sky(&self, row: &Row, run: Range<usize>, radiance: &mut [Vec3A]) {
        let last = run.end - 1;
        let mut from = run.start;
        let mut here = self.sky(row.ray(from).normalize());
        while from < last {
            let to = (from + SKY_KNOTS_PX).min(last);
            let there = self.sky(row.ray(to).normalize());
            let step = (there - here) / (to - from) as f32;
            for (i, pixel) in radiance[from..to].iter_mut().enumerate() {
                *pixel = here + step * i as i32 as f32;
            }
            (from, here) = (to, there);
        }
        radiance[last] = here;
    }

    #[expect(clippy::too_many_arguments)]
    fn shade_facet(
        &self,
        view: &View,
        lit: &Lit,
        row: &Row,
        run: Range<usize>,
        nearness: &[f32],
        openness: &[f32],
        radiance: &mut [Vec3A],
    ) {
        let knot = |column: usize| self.knot(view, lit, row.ray(column), nearness[column]);
        let across = self.change(lit, row.across);
        let is_short = run.len() <= SHORT_PX;
        let mut from = run.start;
        let mut here = knot(if is_short { (from + run.end) / 2 } else { from });
        while from < run.end {
            let to = if is_short { run.end } else { (from + KNOTS_PX).min(run.end - 1) };
            // The last pixel of a long run stands for itself.
            let (there, growth, end) = if is_short || to == from {
                (here, Knot::SAME, run.end)
            } else {
                let there = knot(to);
                (there, here.growth_to(&there, to - from), to)
            };
            let (nearness, openness) = (&nearness[from..end], &openness[from..end]);
            let pixels = radiance[from..end].iter_mut().zip(nearness).zip(openness);
            let mut ray = self.change(lit, row.ray(from));
            let mut between = Between { knot: &here, growth: &growth, pixels: 0.0 };
            for ((pixel, nearness), openness) in pixels {
                let place = lit.eye.plus(&ray, 1.0 / nearness);
                *pixel = self.pixel(lit, &between, &place, *openness);
                ray = ray.plus(&across, 1.0);
                between.pixels += 1.0;
            }
            (from, here) = (end, there);
        }
    }

    /// How a place changes in all frames with a way in the world, m.
    fn change(&self, lit: &Lit, way_m: Vec3A) -> Place {
        Place {
            world: way_m,
            texture: lit.texture.growth_m(way_m.into()),
            shadow: self.shadows.change(way_m),
        }
    }

    fn sky(&self, direction: Vec3A) -> Vec3A {
        let veil = self.veil(direction);
        sky::radiance(self.light, self.grain, direction, self.drift) + Vec3A::splat(veil)
    }

    fn prepare(&self, view: &View, facet: &Facet) -> Lit {
        let light = self.light;
        let normal = Vec3A::from(facet.normal);
        let upward = 0.5 + 0.5 * normal.z;
        let is_braking = facet.body.is_some_and(|body| (self.is_braking)(body));
        let surface = Surface::new(facet);
        // Water darkens what it soaks.
        let soaked = 1.0 - 0.35 * light.wetness;
        let eye_m = Vec3A::from(view.eye_m);
        let eye = Place {
            world: eye_m,
            texture: facet.texture.origin_m,
            shadow: self.shadows.place(eye_m + normal * OFF_SURFACE_M),
        };
        Lit {
            texture: facet.texture,
            normal,
            eye,
            ambient: light.below.lerp(light.above, upward) * soaked,
            sun: light.sun * (soaked * normal.dot(light.sun_direction).max(0.0)),
            soaked,
            emission: glow(light, facet.material, is_braking),
            faces_up: normal.z > 0.8,
            is_shiny: surface.is_shiny(),
            surface,
        }
    }

    fn knot(&self, view: &View, lit: &Lit, ray: Vec3A, nearness: f32) -> Knot {
        let light = self.light;
        let depth_m = 1.0 / nearness;
        let from_eye_m = ray * depth_m;
        let distance_m = from_eye_m.length();
        let direction = from_eye_m / distance_m;
        let facing = (-direction.dot(lit.normal)).max(0.02);
        let footprint_m = depth_m / (view.focal_px.x * facing.sqrt());
        let left = fade(light.haze_per_m * distance_m);
        // Rain in the beam of the head lamps: most of it comes from the first metres.
        let veil = self.veil(direction) * (1.0 - fade(distance_m * 0.3));
        let mut lamps = Vec3A::ZERO;
        if light.exposure > 2.0 {
            let place_m = from_eye_m + Vec3A::from(view.eye_m);
            let height_m = place_m.z - self.ground_m;
            let share = if lit.faces_up { 1.0 } else { 0.5 } * smooth(9.0, 4.0, height_m);
            lamps = self.lamps.at(place_m.x, place_m.y) * share;
            lamps += self.beam.on(from_eye_m, lit.normal);
            lamps *= lit.soaked;
        }
        let (mut mirrored, mut gloss) = (Vec3A::ZERO, 0.0);
        if lit.is_shiny {
            let away_z = direction.z + lit.normal.z * (2.0 * facing);
            mirrored = light.horizon.lerp(light.zenith, smooth(0.0, 0.9, away_z));
            mirrored = if away_z > 0.0 { mirrored } else { light.below * 0.4 };
            gloss = 0.6 * (1.0 - facing).powi(4);
        }
        Knot {
            air: Vec3A::new(left, footprint_m, gloss),
            lamps,
            mirrored,
            added: lit.emission * left + light.horizon * (1.0 - left) + Vec3A::splat(veil),
        }
    }

    #[inline]
    fn pixel(&self, lit: &Lit, between: &Between, place: &Place, openness: f32) -> Vec3A {
        let light = self.light;
        let [left, footprint_m, gloss] = between.air().to_array();
        let look = lit.surface.look(self.grain, place.world, place.texture, footprint_m);
        let mut arriving = lit.ambient * openness;
        if lit.sun.x > 0.0 {
            arriving += lit.sun * self.shadows.sunlight(place.shadow);
        }
        if light.exposure > 2.0 {
            arriving += between.lamps();
        }
        let mut colour = look.albedo * arriving;
        if look.mirror > 0.0 {
            let fresnel = if look.lit > 0.0 {
                look.mirror * 0.5
            } else {
                (look.mirror + (1.0 - look.mirror) * gloss) * look.mirror.min(0.3) * 3.0
            };
            colour = colour * (1.0 - 0.5 * fresnel) + between.mirrored() * fresnel;
            colour += Vec3A::new(0.34, 0.24, 0.11) * (look.lit * light.windows);
        }
        colour * left + between.added()
    }

    /// What rain throws back of the light of the own head lamps.
    #[inline]
    fn veil(&self, direction: Vec3A) -> f32 {
        if self.light.rain == 0.0 {
            return 0.0;
        }
        self.beam.veil(direction) * self.light.haze_per_m * VEIL
    }
}
