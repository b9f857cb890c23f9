//! Curves that shading is made of.

use glam::Vec3A;

use crate::sensors::floats::{floor, least, most, split};

/// 0 below `from`, 1 above `to`, smooth in between.
#[inline]
pub fn smooth(from: f32, to: f32, value: f32) -> f32 {
    let share = least(most((value - from) * (1.0 / (to - from)), 0.0), 1.0);
    share * share * (3.0 - 2.0 * share)
}

/// exp(-x) for x >= 0, to 3 % of 1 and 0 beyond 16: much faster, and as good for haze.
#[inline]
pub fn fade(x: f32) -> f32 {
    let root = most(1.0 - x * (1.0 / 16.0), 0.0);
    let square = root * root;
    let fourth = square * square;
    let eighth = fourth * fourth;
    eighth * eighth
}

/// Bars of one width, one at the start of each period.
#[derive(Clone, Copy, Debug)]
pub struct Bars {
    pub width: f32,
    period: f32,
    per_period: f32,
}

/// A stretch of some width, at least a millimetre.
#[derive(Clone, Copy, Debug)]
pub struct Stretch {
    width: f32,
    per_width: f32,
}

impl Stretch {
    #[inline]
    pub fn new(width: f32) -> Stretch {
        let width = most(width, 1e-3);
        Stretch { width, per_width: 1.0 / width }
    }
}

impl Bars {
    pub const fn new(width: f32, period: f32) -> Bars {
        Bars { width, period, per_period: 1.0 / period }
    }

    /// Share of a stretch around `place` that bars cover.
    #[inline]
    pub fn share(&self, place: f32, stretch: Stretch) -> f32 {
        self.share_of(self.width, self.off(place), place, stretch)
    }

    /// The same, and that of bars which are wider by so much on each side.
    #[inline]
    pub fn shares(&self, place: f32, wider: f32, stretch: Stretch) -> [f32; 2] {
        let off = self.off(place);
        let share = self.share_of(self.width, off, place, stretch);
        [share, self.share_of(self.width + 2.0 * wider, off, place + wider, stretch)]
    }

    /// How far it is to the middle of the nearest bar.
    #[inline]
    fn off(&self, place: f32) -> f32 {
        let (_, into) = split((place - 0.5 * self.width) * self.per_period + 0.5);
        (into - 0.5).abs() * self.period
    }

    /// Share that bars of another width cover, around a place counted from their start.
    #[inline]
    fn share_of(&self, width: f32, off: f32, place: f32, stretch: Stretch) -> f32 {
        let covered = if stretch.width < self.period - width {
            // It meets one bar at most.
            let reach = 0.5 * (width + stretch.width) - off;
            least(reach, least(width, stretch.width))
        } else {
            self.covered(place, width, stretch)
        };
        least(most(covered * stretch.per_width, 0.0), 1.0)
    }

    /// How much of a stretch bars of another width cover, around a place counted from their start.
    fn covered(&self, place: f32, width: f32, stretch: Stretch) -> f32 {
        let before = |to: f32| {
            let whole = floor(to * self.per_period) as f32;
            whole * width + (to - whole * self.period).min(width)
        };
        before(place + 0.5 * stretch.width) - before(place - 0.5 * stretch.width)
    }
}

/// A number that looks drawn by lot, in [0, 1), for a place on a grid.
#[inline]
pub fn lot(x: i32, y: i32, of: u32) -> f32 {
    let mut mixed = (x as u32).wrapping_mul(0x9E37_79B1)
        ^ (y as u32).wrapping_mul(0x85EB_CA77)
        ^ of.wrapping_mul(0xC2B2_AE3D);
    mixed = (mixed ^ (mixed >> 15)).wrapping_mul(0x2C1B_3C6D);
    mixed = (mixed ^ (mixed >> 12)).wrapping_mul(0x297A_2D39);
    (mixed >> 8) as f32 / (1 << 24) as f32
}

/// Linear light of a colour in sRGB, in [0, 1]; a cubic, to 1 % of white.
#[inline]
pub fn linear(colour: [u8; 3]) -> Vec3A {
    let colour = Vec3A::from_array(colour.map(f32::from)) * (1.0 / 255.0);
    colour * (colour * (colour * 0.305 + 0.682) + 0.0125)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fade_is_close_to_the_exponential() {
        for i in 0..400 {
            let x = i as f32 * 0.05;
            assert!((fade(x) - (-x).exp()).abs() < 0.03, "{x}");
        }
    }

    #[test]
    fn wide_footprints_see_the_mean_of_bars() {
        let bars = Bars::new(0.5, 2.0);
        assert!((bars.share(7.3, Stretch::new(400.0)) - 0.25).abs() < 2e-3);
        assert_eq!(bars.share(0.25, Stretch::new(0.01)), 1.0);
        assert_eq!(bars.share(-0.25, Stretch::new(0.01)), 0.0);
    }

    #[test]
    fn the_cubic_is_close_to_the_curve_of_srgb() {
        for value in 0..=255_u8 {
            let share = f32::from(value) / 255.0;
            let exact =
                if share <= 0.04045 { share / 12.92 } else { ((share + 0.055) / 1.055).powf(2.4) };
            assert!((linear([value; 3]).x - exact).abs() < 0.01, "{value}");
        }
    }
}
