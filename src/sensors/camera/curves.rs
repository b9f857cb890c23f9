//! Curves that shading is made of.

/// 0 below `from`, 1 above `to`, smooth in between.
#[inline]
pub fn smooth(from: f32, to: f32, value: f32) -> f32 {
    let share = ((value - from) / (to - from)).clamp(0.0, 1.0);
    share * share * (3.0 - 2.0 * share)
}

/// exp(-x) for x >= 0, to 3 % of 1 and 0 beyond 16: much faster, and as good for haze.
#[inline]
pub fn fade(x: f32) -> f32 {
    let root = (1.0 - x * (1.0 / 16.0)).max(0.0);
    let square = root * root;
    let fourth = square * square;
    let eighth = fourth * fourth;
    eighth * eighth
}

/// Largest whole number that is not greater.
#[inline]
pub fn floor(value: f32) -> i32 {
    let towards_zero = value as i32;
    towards_zero - i32::from((towards_zero as f32) > value)
}

/// How much of a stretch `footprint` wide around `place` is covered by bars of a width, one at the
/// start of each period.
#[inline]
pub fn bars(place: f32, period: f32, width: f32, footprint: f32) -> f32 {
    let covered = |to: f32| {
        let whole = floor(to / period) as f32;
        whole * width + (to - whole * period).min(width)
    };
    let half = 0.5 * footprint.max(1e-3);
    ((covered(place + half) - covered(place - half)) / (2.0 * half)).clamp(0.0, 1.0)
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

/// Linear light of a colour in sRGB, in [0, 1]; gamma 2.2.
pub fn linear(colour: [u8; 3]) -> glam::Vec3A {
    glam::Vec3A::from_array(colour.map(|value| (f32::from(value) / 255.0).powf(2.2)))
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
        assert!((bars(7.3, 2.0, 0.5, 400.0) - 0.25).abs() < 2e-3);
        assert_eq!(bars(0.25, 2.0, 0.5, 0.01), 1.0);
        assert_eq!(bars(-0.25, 2.0, 0.5, 0.01), 0.0);
    }
}
