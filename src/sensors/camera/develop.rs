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
    /// A row of the picture, after exposure.
    row: Vec<f32>,
}

impl Default for Sensor {
    fn default() -> Sensor {
        let mut noise = Noise::new(1, 0, Purpose::Camera);
        let draws = (0..DRAWS).map(|_| noise.normal(1.0) as f32).collect();
        Sensor { draws, row: Vec::new() }
    }
}

impl Sensor {
    /// Radiance to RGB; `shot` decides over the noise.
    pub fn develop(
        &mut self,
        light: &Light,
        radiance: &[Vec3A],
        shot: &mut Noise,
        width: usize,
        picture: &mut [u8],
    ) {
        let rows = radiance.chunks_exact(width).zip(picture.chunks_exact_mut(3 * width));
        for (radiance, bytes) in rows {
            self.row.clear();
            self.row.extend(radiance.iter().flat_map(|radiance| radiance.to_array()));
            let mut left = bytes;
            let mut values = &self.row[..];
            // The draws are gone through from another place in each row.
            while !values.is_empty() {
                let start = shot.uniform(0.0, (DRAWS / 2) as f64) as usize;
                let count = values.len().min(DRAWS / 2);
                let (now, later) = left.split_at_mut(count);
                let values_now = values[..count].iter().zip(&self.draws[start..start + count]);
                for (byte, (value, draw)) in now.iter_mut().zip(values_now) {
                    let exposed = value * light.exposure;
                    let toned =
                        exposed * (1.0 + exposed * (1.0 / (WHITE * WHITE))) / (1.0 + exposed);
                    let toned = toned.max(0.0).min(1.0);
                    // Close to the power 1 / 2.2.
                    let root = toned.sqrt();
                    let bright = root * 0.83 + root.sqrt() * 0.2 - toned * 0.03;
                    // Less of it where there is light.
                    let grown = light.noise * (1.3 - bright) * draw;
                    *byte = (bright * 255.0 + grown + 0.5).max(0.0).min(255.0) as i32 as u8;
                }
                (left, values) = (later, &values[count..]);
            }
        }
    }
}
