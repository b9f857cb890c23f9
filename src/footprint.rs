//! What a body covers of the ground: an oriented rectangle.

use glam::DVec2;

/// A rectangle on the ground; frame of the map, which is the world's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Footprint {
    pub centre_m: DVec2,
    /// Unit vector along the length.
    pub forward: DVec2,
    /// Half of length and width, m.
    pub half_m: DVec2,
}

impl Footprint {
    pub fn new(centre_m: DVec2, heading_rad: f64, half_m: DVec2) -> Footprint {
        Footprint { centre_m, forward: DVec2::from_angle(heading_rad), half_m }
    }

    /// Unit vector to the left.
    pub fn left(&self) -> DVec2 {
        self.forward.perp()
    }

    /// Front left, rear left, rear right, front right; world frame, m.
    pub fn corners_m(&self) -> [DVec2; 4] {
        let (along, aside) = (self.forward * self.half_m.x, self.left() * self.half_m.y);
        let centre = self.centre_m;
        [
            centre + along + aside,
            centre - along + aside,
            centre - along - aside,
            centre + along - aside,
        ]
    }

    /// South-west and north-east corner of the box along the axes of the map, m.
    pub fn bounds_m(&self) -> (DVec2, DVec2) {
        let corners = self.corners_m();
        let low = corners.iter().copied().fold(DVec2::INFINITY, DVec2::min);
        let high = corners.iter().copied().fold(DVec2::NEG_INFINITY, DVec2::max);
        (low, high)
    }

    /// Half of the diagonal, m: nothing further from the centre is touched.
    pub fn radius_m(&self) -> f64 {
        self.half_m.length()
    }

    /// The same body a share of the way to where it is `next`.
    pub fn towards(&self, next: &Footprint, share: f64) -> Footprint {
        Footprint {
            centre_m: self.centre_m.lerp(next.centre_m, share),
            forward: self.forward.lerp(next.forward, share).normalize_or(next.forward),
            ..*next
        }
    }

    /// The same rectangle with a margin on all sides, m.
    pub fn grown(&self, margin_m: f64) -> Footprint {
        Footprint { half_m: self.half_m + DVec2::splat(margin_m), ..*self }
    }

    /// Whether two rectangles share a point, by separating axes: for convex shapes in the plane a
    /// line between them exists exactly if one along a side of either does.
    pub fn touches(&self, other: &Footprint) -> bool {
        self.separation(other).0 <= 0.0
    }

    /// Along the axis on which they are furthest apart: the gap, m, negative where they overlap,
    /// and the axis, pointing from this one to the other. Never more than the true distance.
    pub fn separation(&self, other: &Footprint) -> (f64, DVec2) {
        let between = other.centre_m - self.centre_m;
        let mut widest = (f64::NEG_INFINITY, self.forward);
        for axis in [self.forward, self.left(), other.forward, other.left()] {
            let along = between.dot(axis);
            let gap = along.abs() - self.reach_m(axis) - other.reach_m(axis);
            if gap > widest.0 {
                widest = (gap, if along < 0.0 { -axis } else { axis });
            }
        }
        widest
    }

    /// Half of the rectangle's extent along a unit vector, m.
    pub fn reach_m(&self, axis: DVec2) -> f64 {
        self.half_m.x * self.forward.dot(axis).abs() + self.half_m.y * self.left().dot(axis).abs()
    }

    /// Distance from a point to the rectangle, m; 0 inside.
    pub fn distance_m(&self, point_m: DVec2) -> f64 {
        let from = point_m - self.centre_m;
        let local = DVec2::new(from.dot(self.forward), from.dot(self.left())).abs();
        (local - self.half_m).max(DVec2::ZERO).length()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn footprint() -> impl Strategy<Value = Footprint> {
        let ranges = (-6.0..6.0_f64, -6.0..6.0_f64, -4.0..4.0_f64, 0.2..4.0_f64, 0.2..2.0_f64);
        ranges.prop_map(|(x, y, heading, length, width)| {
            Footprint::new(DVec2::new(x, y), heading, DVec2::new(length, width))
        })
    }

    proptest! {
        /// Held against points: a grid over one rectangle, asked of the other.
        #[test]
        fn rectangles_touch_where_points_of_one_lie_in_the_other(a in footprint(), b in footprint()) {
            let steps = 40;
            let fraction = |i: i32| f64::from(i) / f64::from(steps) * 2.0 - 1.0;
            let least = (0..=steps).flat_map(|i| (0..=steps).map(move |j| (i, j))).map(|(i, j)| {
                let (x, y) = (fraction(i) * a.half_m.x, fraction(j) * a.half_m.y);
                b.distance_m(a.centre_m + a.forward * x + a.left() * y)
            }).fold(f64::INFINITY, f64::min);
            // No point of the rectangle is further from the grid than this.
            let mesh = a.radius_m() * 1.01 / f64::from(steps);
            if a.touches(&b) {
                prop_assert!(least <= mesh, "they touch, and the nearest point is {least} away");
            } else {
                prop_assert!(least > 0.0);
            }
            prop_assert_eq!(a.touches(&b), b.touches(&a));
            prop_assert!(a.separation(&b).0 <= least + 1e-9);
        }
    }

    #[test]
    fn the_axis_of_separation_points_to_the_other() {
        let ego = Footprint::new(DVec2::ZERO, 0.0, DVec2::new(2.0, 1.0));
        let ahead = Footprint::new(DVec2::new(6.0, 0.5), 0.3, DVec2::new(2.0, 1.0));
        let (gap, axis) = ego.separation(&ahead);
        assert!(gap > 1.0 && axis.x > 0.9, "{gap} {axis}");
        assert!(ahead.separation(&ego).1.x < -0.9);
    }
}
