//! Drops on the lens: they come, stay for seconds, and slide down; through them all is upside down.

use glam::{Vec2, Vec3A};

use crate::{
    noise::{Noise, Purpose},
    sensors::camera::{curves::smooth, light::Light, view::View},
};

/// Drops on the lens in a storm.
const DROPS: usize = 70;

/// Draws the drops, and remembers what is behind the one at hand.
#[derive(Clone, Debug, Default)]
pub struct Lens {
    behind: Vec<Vec3A>,
}

/// A drop as it is now, pixels.
struct Drop {
    middle: Vec2,
    radius: f32,
}

impl Lens {
    pub fn draw(
        &mut self,
        view: &View,
        light: &Light,
        seed: u64,
        time_s: f64,
        radiance: &mut [Vec3A],
    ) {
        for number in 0..(DROPS as f32 * light.rain * light.rain.sqrt()) as u32 {
            if let Some(drop) = drop(view, seed, number, time_s) {
                self.look_through(view, &drop, radiance);
            }
        }
    }

    fn look_through(&mut self, view: &View, drop: &Drop, radiance: &mut [Vec3A]) {
        let pixels = |middle: f32, reach: f32, end: usize| {
            let low = ((middle - reach).max(0.0) as usize).min(end);
            low..((middle + reach + 1.0).max(0.0) as usize).min(end)
        };
        let (across, down) = (drop.radius, drop.radius * 1.15);
        let rows = pixels(drop.middle.y, down, view.height);
        let columns = pixels(drop.middle.x, across, view.width);
        self.behind.clear();
        for row in rows.clone() {
            for column in columns.clone() {
                let at = Vec2::new(column as f32 + 0.5, row as f32 + 0.5) - drop.middle;
                let off = at / Vec2::new(across, down);
                let out = off.length_squared();
                let here = radiance[row * view.width + column];
                // Upside down and wide, as through any ball of water.
                let bend = 2.0 + 3.5 * out;
                let bent = [0.0, 0.35].map(|spread| {
                    let from = drop.middle - at * (bend + spread) + spread * drop.radius;
                    let from = from.clamp(
                        Vec2::ZERO,
                        Vec2::new(view.width as f32 - 1.0, view.height as f32 - 1.0),
                    );
                    radiance[from.y as usize * view.width + from.x as usize]
                });
                let rim = 1.0 - 0.45 * smooth(0.55, 1.0, out);
                let seen = (bent[0] + bent[1]) * (0.5 * rim);
                self.behind.push(here.lerp(seen, smooth(1.0, 0.75, out) * 0.9));
            }
        }
        let mut behind = self.behind.iter();
        for row in rows {
            let pixels = &mut radiance[row * view.width..][columns.clone()];
            pixels.iter_mut().zip(&mut behind).for_each(|(pixel, behind)| *pixel = *behind);
        }
    }
}

/// What is at a place on the lens now: each place waits, gets a drop, and loses it.
fn drop(view: &View, seed: u64, number: u32, time_s: f64) -> Option<Drop> {
    let mut place = Noise::new(seed, number, Purpose::Lens);
    let period_s = place.uniform(4.0, 14.0);
    let since_s = time_s + place.uniform(0.0, period_s);
    let round = (since_s / period_s).floor();
    let age = since_s / period_s - round;
    let mut noise = Noise::new(seed, (round as u32) << 8 | number, Purpose::Lens);
    let mut draw = |low: f32, high: f32| noise.uniform(f64::from(low), f64::from(high)) as f32;
    let (width, height) = (view.width as f32, view.height as f32);
    let middle = Vec2::new(draw(0.0, width), draw(0.0, height));
    let size = draw(0.0, 1.0);
    let radius = width / 600.0 * (1.6 + 7.0 * size * size * size);
    // Big ones slide.
    let slid = smooth(0.6, 1.0, age as f32) * size * size * 0.25 * height;
    (age < 0.95).then_some(Drop { middle: middle + Vec2::new(0.0, slid), radius })
}
