//! From radiance to bytes: exposure, tone, the sensor's noise.

use glam::Vec3A;

use crate::{
    noise::{Noise, Purpose},
    sensors::{camera::light::Light, floats::WHOLE},
};

/// Random numbers that are drawn once and used again from other places.
const DRAWS: usize = 1 << 14;

/// Radiance (after exposure) that is as bright as a byte can say.
const WHITE: f32 = 2.2;

/// Exposed radiance is told apart to 1 in 256, from 2 to the power of this, over so many octaves.
const STEPS_BITS: u32 = 8;
const DARKEST: i32 = -11;
const OCTAVES: usize = 16;
const TONES: usize = OCTAVES << STEPS_BITS;

/// The part of the camera behind the lens.
#[derive(Clone, Debug)]
pub struct Sensor {
    /// Normal, of standard deviation 1.
    draws: Vec<f32>,
    /// How bright each step of exposed radiance is, in [0, 1].
    tones: Box<[f32; TONES]>,
}

impl Default for Sensor {
    fn default() -> Sensor {
        let mut noise = Noise::new(1, 0, Purpose::Camera);
        let draws = (0..DRAWS).map(|_| noise.normal(1.0) as f32).collect();
        let first = darkest().to_bits();
        let mut tones = Box::new([0.0; TONES]);
        for (step, tone) in tones.iter_mut().enumerate() {
            let middle = ((step as u32) << 1 | 1) << (f32::MANTISSA_DIGITS - 2 - STEPS_BITS);
            *tone = if step == 0 { 0.0 } else { bright(f32::from_bits(first + middle)) };
        }
        Sensor { draws, tones }
    }
}

/// What is darker is as dark as this.
fn darkest() -> f32 {
    2.0_f32.powi(DARKEST)
}

/// How bright exposed radiance is, in [0, 1].
fn bright(exposed: f32) -> f32 {
    let toned = exposed * (1.0 + exposed * (1.0 / (WHITE * WHITE))) / (1.0 + exposed);
    let toned = toned.min(1.0);
    // Close to the power 1 / 2.2.
    let root = toned.sqrt();
    root * 0.83 + root.sqrt() * 0.2 - toned * 0.03
}

impl Sensor {
    /// Radiance to RGB; `shot` decides over the noise.
    pub fn develop(
        &self,
        light: &Light,
        radiance: &[Vec3A],
        shot: &mut Noise,
        width: usize,
        picture: &mut [u8],
    ) {
        // The draws are gone through from another place in each row.
        const MOST: usize = DRAWS / 2 / 3;
        let rows = radiance.chunks_exact(width).zip(picture.chunks_exact_mut(3 * width));
        for (radiance, bytes) in rows {
            for (radiance, bytes) in radiance.chunks(MOST).zip(bytes.chunks_mut(3 * MOST)) {
                let start = shot.uniform(0.0, (DRAWS / 2) as f64) as usize;
                self.expose(light, radiance, &self.draws[start..], bytes);
            }
        }
    }

    fn expose(&self, light: &Light, radiance: &[Vec3A], draws: &[f32], bytes: &mut [u8]) {
        let (darkest, brightest) = (darkest(), 2.0_f32.powi(DARKEST + OCTAVES as i32 - 1));
        let shift = f32::MANTISSA_DIGITS - 1 - STEPS_BITS;
        let first = darkest.to_bits() >> shift;
        let (draws, _) = draws.as_chunks::<3>();
        let (bytes, _) = bytes.as_chunks_mut::<3>();
        for ((radiance, draws), bytes) in radiance.iter().zip(draws).zip(bytes) {
            let exposed = *radiance * light.exposure;
            let exposed = exposed.clamp(Vec3A::splat(darkest), Vec3A::splat(brightest));
            let tone = |exposed: f32| {
                let step = (exposed.to_bits() >> shift).wrapping_sub(first);
                self.tones[step as usize % TONES]
            };
            let bright = Vec3A::new(tone(exposed.x), tone(exposed.y), tone(exposed.z));
            // Less of it where there is light.
            let noise = (Vec3A::splat(1.3) - bright) * light.noise * Vec3A::from_array(*draws);
            let value = (bright * 255.0 + noise).clamp(Vec3A::ZERO, Vec3A::splat(255.0));
            // The last bits are those of the nearest whole number.
            let rounded = value + Vec3A::splat(WHOLE);
            let [r, g, b] = rounded.to_array();
            *bytes = [r.to_bits() as u8, g.to_bits() as u8, b.to_bits() as u8];
        }
    }
}
