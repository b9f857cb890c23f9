//! From radiance to bytes: exposure, tone, the sensor's noise.

use glam::Vec3A;

use crate::{
    noise::{Noise, Purpose},
    sensors::camera::light::Light,
};

/// Random numbers that are drawn once and used again from other places.
const DRAWS: usize = 1 << 14;

/// Radiance (after exposure) that is as bright as a byte can say.
const WHITE: f32 = 2.2;

/// The part of the camera behind the lens.
#[derive(Clone, Debug)]
pub struct Sensor {
    /// Normal, of standard deviation 1.
    draws: Vec<f32>,
}

impl Default for Sensor {
    fn default() -> Sensor {
        let mut noise = Noise::new(1, 0, Purpose::Camera);
        Sensor { draws: (0..DRAWS).map(|_| noise.normal(1.0) as f32).collect() }
    }
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
        let rows = radiance.chunks_exact(width).zip(picture.chunks_exact_mut(3 * width));
        for (radiance, row) in rows {
            let start = shot.uniform(0.0, (DRAWS - 1) as f64) as usize;
            let draws = self.draws.iter().cycle().skip(start);
            for ((radiance, pixel), draw) in radiance.iter().zip(row.chunks_exact_mut(3)).zip(draws)
            {
                let exposed = *radiance * light.exposure;
                let toned = exposed * (1.0 + exposed * (1.0 / (WHITE * WHITE))) / (1.0 + exposed);
                let toned = toned.clamp(Vec3A::ZERO, Vec3A::ONE);
                // Close to the power 1 / 2.2.
                let root = Vec3A::new(toned.x.sqrt(), toned.y.sqrt(), toned.z.sqrt());
                let fourth = Vec3A::new(root.x.sqrt(), root.y.sqrt(), root.z.sqrt());
                let bright = root * 0.83 + fourth * 0.2 - toned * 0.03;
                // Less of it where there is light.
                let grown = light.noise * (1.3 - bright);
                let value =
                    (bright * 255.0 + grown * *draw + 0.5).clamp(Vec3A::ZERO, Vec3A::splat(255.0));
                pixel.copy_from_slice(&[value.x as u8, value.y as u8, value.z as u8]);
            }
        }
    }
}
