//! The sky behind everything.

use glam::{Vec2, Vec3A};

use crate::sensors::camera::{curves::smooth, grain::Grain, light::Light};

/// Height of the clouds over the eye in units of the texture.
const CLOUD_TEXELS: f32 = 14.0;

/// What comes from a direction (unit length) above, or from the haze at the horizon; linear.
#[inline]
pub fn radiance(light: &Light, grain: &Grain, direction: Vec3A, drift: Vec2) -> Vec3A {
    let up = direction.z.max(0.0);
    let rise = 1.0 - (1.0 - up) * (1.0 - up) * (1.0 - up);
    let mut colour = light.horizon.lerp(light.zenith, rise);
    if up > 0.02 {
        let over = Vec2::new(direction.x, direction.y) * (CLOUD_TEXELS / (up + 0.12)) + drift;
        let blur = 1.5 / (up + 0.05);
        let billow = grain.at(over.x, over.y, blur.max(4.0))
            + 0.7 * grain.at(over.x * 2.7, over.y * 2.7, (2.7 * blur).max(2.0));
        let cover = smooth(0.45 - light.clouds, 1.0 - light.clouds, billow + 0.1);
        let white = light.horizon * 0.8 + light.above * 0.5;
        let share = cover * smooth(0.02, 0.2, up) * 0.75;
        // Thick clouds are darker below.
        colour = colour.lerp(white * (1.0 - 0.35 * light.clouds * billow), share);
    }
    if light.glare == Vec3A::ZERO {
        return colour;
    }
    let towards_sun = direction.dot(light.sun_direction).max(0.0);
    let near = towards_sun * towards_sun * towards_sun * towards_sun;
    let near = near * near;
    let halo = near * near * near;
    let disc = smooth(0.9992, 0.9997, towards_sun);
    colour + light.glare * (0.25 * near + 0.7 * halo + 12.0 * disc)
}
