//! Rain in the air: streaks that are drawn anew for each instant.

use glam::{Vec2, Vec3A};

use crate::{
    noise::Noise,
    sensors::camera::{lamps::Beam, light::Light, view::View},
};

/// Streaks over a picture in a storm, per pixel.
const PER_PIXEL: f32 = 0.008;

/// Draw streaks; `wind` is how far they lean, pixels across for each one down.
pub fn draw(
    view: &View,
    light: &Light,
    beam: &Beam,
    wind: f32,
    noise: &mut Noise,
    radiance: &mut [Vec3A],
) {
    let count = light.rain * PER_PIXEL * (view.width * view.height) as f32;
    let (width, height) = (view.width as f32, view.height as f32);
    // Drops are bright with the light of the sky around them.
    let grey = light.horizon * 0.75 + light.above * 0.4;
    for _ in 0..count as usize {
        let draw = |noise: &mut Noise, low: f32, high: f32| {
            noise.uniform(f64::from(low), f64::from(high)) as f32
        };
        let x = draw(noise, 0.0, width);
        let y = draw(noise, -0.1 * height, height);
        // Most are far away, short and faint.
        let near = draw(noise, 0.0, 1.0).powi(3);
        let length = height * (0.015 + 0.02 * light.rain + 0.1 * near);
        let strength = (0.1 + 0.22 * near) * (0.5 + 0.5 * light.rain);
        let lean = wind + draw(noise, -0.03, 0.03);
        let direction = view.ray(Vec2::new(x, y)).normalize();
        let lamp = beam.veil(Vec3A::from(direction)) * 0.0015;
        let colour = grey + Vec3A::splat(lamp);
        for step in 0..length as usize {
            let (at_x, at_y) = (x + lean * step as f32, y + step as f32);
            if at_x < 0.0 || at_y < 0.0 || at_x >= width || at_y >= height {
                continue;
            }
            let along = step as f32 / length;
            let share = strength * 4.0 * along * (1.0 - along);
            let pixel = &mut radiance[at_y as usize * view.width + at_x as usize];
            *pixel = pixel.lerp(colour.max(*pixel * 0.9), share);
        }
    }
}
