//! One random texture for all surfaces, filtered to any size of a pixel, so that nothing flickers.

use crate::{
    noise::{Noise, Purpose},
    sensors::floats::{most, split},
};

/// Texels along a side of the finest level, a power of two.
const SIDE: usize = 128;
const LEVELS: usize = 7;

/// Values in [-1, 1] that repeat every `SIDE` texels, each level half as fine as the one before.
#[derive(Clone, Debug)]
pub struct Grain {
    levels: Vec<Vec<Patch>>,
}

/// Between a texel and its neighbours: the value there, and what it grows by across, down, and both.
type Patch = [f32; 4];

impl Default for Grain {
    fn default() -> Grain {
        Grain::new()
    }
}

impl Grain {
    /// The same in all episodes.
    pub fn new() -> Grain {
        let mut noise = Noise::new(0, 0, Purpose::Camera);
        let mut finest = vec![0.0_f32; SIDE * SIDE];
        // Octaves from coarse to fine, the fine ones strongest.
        for (cell, weight) in [(32, 0.25), (16, 0.2), (8, 0.2), (4, 0.25), (2, 0.3), (1, 0.5)] {
            let cells = SIDE / cell;
            let knots: Vec<f32> =
                (0..cells * cells).map(|_| noise.uniform(-1.0, 1.0) as f32).collect();
            for (place, value) in finest.iter_mut().enumerate() {
                let (x, y) = (place % SIDE, place / SIDE);
                let (left, top) = (x / cell, y / cell);
                let ease = |into: usize| {
                    let t = into as f32 / cell as f32;
                    t * t * (3.0 - 2.0 * t)
                };
                let (across, down) = (ease(x % cell), ease(y % cell));
                let at = |x: usize, y: usize| knots[(y % cells) * cells + x % cells];
                let above = at(left, top) * (1.0 - across) + at(left + 1, top) * across;
                let below = at(left, top + 1) * (1.0 - across) + at(left + 1, top + 1) * across;
                *value += weight * (above * (1.0 - down) + below * down);
            }
        }
        let mut levels = vec![finest];
        for level in 1..LEVELS {
            let (side, finer) = (SIDE >> level, &levels[level - 1]);
            let coarser = (0..side * side).map(|place| {
                let (x, y) = (2 * (place % side), 2 * (place / side));
                let at = |x: usize, y: usize| finer[y * 2 * side + x];
                0.25 * (at(x, y) + at(x + 1, y) + at(x, y + 1) + at(x + 1, y + 1))
            });
            let coarser = coarser.collect();
            levels.push(coarser);
        }
        levels.iter_mut().flatten().for_each(|value| *value = value.clamp(-1.0, 1.0));
        Grain { levels: levels.iter().map(|level| patches(level)).collect() }
    }

    /// The value at a place, both in texels, as a pixel sees it that covers `footprint` texels.
    #[inline]
    pub fn at(&self, x: f32, y: f32, footprint: f32) -> f32 {
        let exponent = (most(footprint, 1.0).to_bits() >> 23) - 127;
        let Some(level) = self.levels.get(exponent as usize) else { return 0.0 };
        // 2 to the power of -exponent.
        let scale = f32::from_bits((127 - exponent) << 23);
        let ((left, across), (top, down)) = (split(x * scale - 0.5), split(y * scale - 0.5));
        let shift = SIDE.trailing_zeros() - exponent;
        let mask = (1 << shift) - 1;
        let place = ((top as u32 & mask) << shift) + (left as u32 & mask);
        let [value, by_across, by_down, by_both] = level[place as usize];
        value + by_across * across + (by_down + by_both * across) * down
    }
}

/// A level of texels, row by row, ready to be looked at between them.
fn patches(level: &[f32]) -> Vec<Patch> {
    let side = level.len().isqrt();
    let at = |x: usize, y: usize| level[(y % side) * side + x % side];
    let patch = |place: usize| {
        let (x, y) = (place % side, place / side);
        let (here, right) = (at(x, y), at(x + 1, y));
        let (below, both) = (at(x, y + 1), at(x + 1, y + 1));
        [here, right - here, below - here, here - right - below + both]
    };
    (0..level.len()).map(patch).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wider_pixel_sees_less_of_the_grain() {
        let grain = Grain::new();
        let spread = |footprint: f32| {
            let values = (0..4000).map(|i| grain.at(i as f32 * 7.3, i as f32 * 3.1, footprint));
            values.map(|value| value * value).sum::<f32>()
        };
        let spreads = [1.0, 8.0, 64.0, 1000.0].map(spread);
        assert!(spreads.is_sorted_by(|a, b| a > b), "{spreads:?}");
        assert_eq!(spreads[3], 0.0);
    }
}
