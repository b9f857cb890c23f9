//! The visibility buffer: for each pixel how near the nearest facet is, and which it is.
//!
//! A pixel shows what lies behind its centre. Triangles that share an edge find the same crossings of
//! it with the rows, whatever their order, so no pixel between them is left out or drawn twice.

use glam::{Vec2, Vec3, Vec4};

use crate::sensors::{
    camera::view::{NEAR_M, View},
    floats::{self, WHOLE, least},
};

/// No facet: the sky.
pub const NOTHING: u32 = u32::MAX;

/// A corner of a triangle in the camera frame, and on the picture if it is in front of the camera.
#[derive(Clone, Copy, Debug)]
pub struct Corner {
    pub seen_m: Vec3,
    pub at_px: Vec2,
}

impl Corner {
    #[inline]
    pub fn new(view: &View, seen_m: Vec3) -> Corner {
        Corner { seen_m, at_px: view.project_px(seen_m) }
    }
}

/// The pixels whose centres may lie between corners: the first columns and rows at or beyond them, and
/// those of the other ends, negative. Where it is not known, everything.
#[derive(Clone, Copy, Debug)]
pub struct Bounds(Vec4);

impl Bounds {
    /// Of a corner on the picture.
    #[inline]
    pub fn at(at_px: Vec2) -> Bounds {
        // Numbers this large are outside any picture, and those below are rounded as they should be.
        let from = (at_px - 0.5).clamp(Vec2::splat(-1e6), Vec2::splat(1e6));
        let rounded = (from + WHOLE) - WHOLE;
        let first = rounded + Vec2::select(rounded.cmplt(from), Vec2::ONE, Vec2::ZERO);
        Bounds(Vec4::new(first.x, first.y, -first.x, -first.y))
    }

    #[inline]
    pub fn of(corner: &Corner) -> Bounds {
        if corner.seen_m.z < NEAR_M { Bounds(Vec4::INFINITY) } else { Bounds::at(corner.at_px) }
    }

    /// Whether there is a pixel of a picture whose centre may lie between three corners.
    #[inline]
    pub fn hold_a_centre(a: Bounds, b: Bounds, c: Bounds, width: usize, height: usize) -> bool {
        let ends = a.0.max(b.0).max(c.0);
        let outside = Vec4::new(0.0, 0.0, -(width as f32), -(height as f32));
        ends.cmpgt(outside).all() && ends.x > -ends.z && ends.y > -ends.w
    }
}

/// What each pixel shows.
#[derive(Clone, Debug)]
pub struct Visibility {
    pub width: usize,
    pub height: usize,
    /// 1 / depth, 1/m; 0 where there is nothing. Row by row.
    pub nearness: Vec<f32>,
    /// [`NOTHING`], or what was given to [`Visibility::draw`].
    pub facet: Vec<u32>,
}

impl Visibility {
    pub fn new(width: usize, height: usize) -> Visibility {
        let nearness = vec![0.0; width * height];
        let facet = vec![NOTHING; width * height];
        Visibility { width, height, nearness, facet }
    }

    /// Without facets, for [`Visibility::draw_flat`].
    pub fn flat(width: usize, height: usize) -> Visibility {
        Visibility { width, height, nearness: vec![0.0; width * height], facet: Vec::new() }
    }

    pub fn clear(&mut self) {
        self.nearness.fill(0.0);
        self.facet.fill(NOTHING);
    }

    /// Draw a triangle, if it faces the camera. Tells whether it does, not whether it is seen.
    #[inline]
    pub fn draw(&mut self, view: &View, corners: &[Corner; 3], facet: u32) -> bool {
        let [a, b, c] = corners;
        let nearest_m = a.seen_m.z.min(b.seen_m.z).min(c.seen_m.z);
        let furthest_m = a.seen_m.z.max(b.seen_m.z).max(c.seen_m.z);
        if furthest_m < NEAR_M {
            return false;
        }
        let normal = (b.seen_m - a.seen_m).cross(c.seen_m - a.seen_m);
        let offset = normal.dot(a.seen_m);
        // Turned away, or seen from the side.
        if offset >= -1e-12 {
            return false;
        }
        let slope = normal / offset;
        // 1 / depth is linear on the picture.
        let plane = Vec3::new(slope.x / view.focal_px.x, slope.y / view.focal_px.y, slope.z);
        let plane = plane.with_z(plane.z - plane.truncate().dot(view.centre_px));
        let surface = Surface { plane, most: 1.0 / nearest_m.max(NEAR_M), facet };
        if nearest_m >= NEAR_M {
            self.fill::<true>([a.at_px, b.at_px, c.at_px], &surface);
        } else {
            self.fill_clipped(view, corners, &surface);
        }
        true
    }

    /// Draw a triangle that was not seen in perspective: pixels, and how near it is (above 0, linear
    /// on the picture). Which facet it was is not kept; both sides count.
    #[inline]
    pub fn draw_flat(&mut self, corners: [Vec3; 3]) {
        let [a, b, c] = corners;
        let normal = (b - a).cross(c - a);
        if normal.z.abs() < 1e-6 {
            return;
        }
        let slope = -normal.truncate() / normal.z;
        let plane = slope.extend(a.z - slope.dot(a.truncate()));
        let surface = Surface { plane, most: a.z.max(b.z).max(c.z), facet: NOTHING };
        self.fill::<false>([a.truncate(), b.truncate(), c.truncate()], &surface);
    }

    /// The part of a triangle in front of the near plane.
    fn fill_clipped(&mut self, view: &View, corners: &[Corner; 3], surface: &Surface) {
        let mut outline = [Vec2::ZERO; 4];
        let mut count = 0;
        for i in 0..3 {
            let (here, next) = (corners[i].seen_m, corners[(i + 1) % 3].seen_m);
            if here.z >= NEAR_M {
                outline[count] = corners[i].at_px;
                count += 1;
            }
            if (here.z >= NEAR_M) != (next.z >= NEAR_M) {
                // From the same end in both triangles at this edge.
                let (front, back) = if here.z >= NEAR_M { (here, next) } else { (next, here) };
                let share = (front.z - NEAR_M) / (front.z - back.z);
                let crossing = front.lerp(back, share).with_z(NEAR_M);
                outline[count] = view.project_px(crossing);
                count += 1;
            }
        }
        for i in 2..count {
            self.fill::<true>([outline[0], outline[i - 1], outline[i]], surface);
        }
    }

    /// Fill a triangle; whether it is kept which facet it was.
    fn fill<const IS_KEPT: bool>(&mut self, corners: [Vec2; 3], surface: &Surface) {
        let [mut top, mut middle, mut bottom] = corners;
        if middle.y < top.y {
            std::mem::swap(&mut top, &mut middle);
        }
        if bottom.y < middle.y {
            std::mem::swap(&mut middle, &mut bottom);
        }
        if middle.y < top.y {
            std::mem::swap(&mut top, &mut middle);
        }
        let rows = first_centre(top.y, self.height)..first_centre(bottom.y, self.height);
        if rows.is_empty() {
            return;
        }
        let long = Edge::new(top, bottom);
        let (upper, lower) = (Edge::new(top, middle), Edge::new(middle, bottom));
        let bends_right = middle.x > long.x(middle.y);
        for row in rows {
            let y = row as f32 + 0.5;
            let short = if y < middle.y { upper.x(y) } else { lower.x(y) };
            let (left, right) = if bends_right { (long.x(y), short) } else { (short, long.x(y)) };
            let from = first_centre(left, self.width);
            let to = first_centre(right, self.width);
            if from < to {
                self.fill_row::<IS_KEPT>(row, from, to, surface);
            }
        }
    }

    #[inline]
    fn fill_row<const IS_KEPT: bool>(
        &mut self,
        row: usize,
        from: usize,
        to: usize,
        surface: &Surface,
    ) {
        let start = row * self.width;
        let nearness = &mut self.nearness[start + from..start + to];
        let Surface { plane, most, facet: this } = *surface;
        let base = plane.x * (from as f32 + 0.5) + (plane.y * (row as f32 + 0.5) + plane.z);
        let mine = |i: usize| least(base + plane.x * i as i32 as f32, most);
        if IS_KEPT {
            let facet = &mut self.facet[start + from..start + to];
            for (i, (nearness, facet)) in nearness.iter_mut().zip(facet).enumerate() {
                let mine = mine(i);
                // All bits where it is nearer: a choice that takes no branch.
                let chosen = 0_u32.wrapping_sub(u32::from(mine > *nearness));
                *facet = (this & chosen) | (*facet & !chosen);
                *nearness = floats::most(mine, *nearness);
            }
        } else {
            for (i, nearness) in nearness.iter_mut().enumerate() {
                let mine = mine(i);
                *nearness = floats::most(mine, *nearness);
            }
        }
    }
}

/// 1 / depth as a plane over the picture, and what lies there.
struct Surface {
    plane: Vec3,
    /// At the nearest corner: what rounding adds on slim triangles stays below it.
    most: f32,
    facet: u32,
}

/// An edge from its upper end.
struct Edge {
    from: Vec2,
    slope: f32,
}

impl Edge {
    #[inline]
    fn new(upper: Vec2, lower: Vec2) -> Edge {
        Edge { from: upper, slope: (lower.x - upper.x) / (lower.y - upper.y) }
    }

    /// Where the edge crosses the height of a row.
    #[inline]
    fn x(&self, y: f32) -> f32 {
        self.from.x + self.slope * (y - self.from.y)
    }
}

/// The first pixel of a row or column whose centre lies at or beyond a place; `end` if none does.
#[inline]
fn first_centre(place_px: f32, end: usize) -> usize {
    let from = least(floats::most(place_px - 0.5, 0.0), end as f32);
    let rounded = from + WHOLE;
    let whole = rounded.to_bits().wrapping_sub(WHOLE.to_bits());
    (whole + u32::from(rounded - WHOLE < from)) as usize
}
