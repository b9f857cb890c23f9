//! Light that changes slowly along a row: worked out at some pixels, interpolated between them.

use glam::Vec3A;

/// What changes so slowly along a row of a facet that it is worked out at some pixels alone.
#[derive(Clone, Copy, Debug)]
pub struct Knot {
    /// Share of the light that is left by the way through the air; breadth of the pixel on the
    /// surface, m; how strongly a window mirrors at this angle beyond what it does facing it.
    pub air: Vec3A,
    /// What lamps throw, as it arrives.
    pub lamps: Vec3A,
    /// The sky that is mirrored.
    pub mirrored: Vec3A,
    /// What shines by itself, and what the air adds.
    pub added: Vec3A,
}

/// A place between two knots: what is at the first, and how it grows by each pixel.
#[derive(Debug)]
pub struct Between<'k> {
    pub knot: &'k Knot,
    pub growth: &'k Knot,
    pub pixels: f32,
}

impl Between<'_> {
    #[inline]
    pub fn air(&self) -> Vec3A {
        self.knot.air + self.growth.air * self.pixels
    }

    #[inline]
    pub fn lamps(&self) -> Vec3A {
        self.knot.lamps + self.growth.lamps * self.pixels
    }

    #[inline]
    pub fn mirrored(&self) -> Vec3A {
        self.knot.mirrored + self.growth.mirrored * self.pixels
    }

    #[inline]
    pub fn added(&self) -> Vec3A {
        self.knot.added + self.growth.added * self.pixels
    }
}

impl Knot {
    /// No growth.
    pub const SAME: Knot =
        Knot { air: Vec3A::ZERO, lamps: Vec3A::ZERO, mirrored: Vec3A::ZERO, added: Vec3A::ZERO };

    /// How it grows by each pixel on the way to another that is so many away.
    pub fn growth_to(&self, other: &Knot, pixels: usize) -> Knot {
        let share = 1.0 / pixels as f32;
        Knot {
            air: (other.air - self.air) * share,
            lamps: (other.lamps - self.lamps) * share,
            mirrored: (other.mirrored - self.mirrored) * share,
            added: (other.added - self.added) * share,
        }
    }
}
