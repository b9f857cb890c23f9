//! Triangles in handy pieces: faces, grids, boxes, limbs, rings along an axis, blobs.
//!
//! Outlines are given counter-clockwise as seen from outside.

use glam::{Vec2, Vec3};

use crate::scene::mesh::{Material, Mesh, Triangle, Vertex};

/// What a face is made of, and its colour, sRGB.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Paint {
    pub material: Material,
    pub colour: [u8; 3],
}

/// A paint.
pub const fn paint(material: Material, colour: [u8; 3]) -> Paint {
    Paint { material, colour }
}

impl Paint {
    /// Lighter or darker by a factor.
    pub fn shaded(self, factor: f32) -> Paint {
        let shade = |value: u8| (f32::from(value) * factor).round().clamp(0.0, 255.0) as u8;
        Paint { colour: self.colour.map(shade), ..self }
    }
}

impl Mesh {
    fn corner(&mut self, position_m: Vec3, texture_m: Vec2) -> u32 {
        self.vertices.push(Vertex { position_m, texture_m });
        self.vertices.len() as u32 - 1
    }

    /// A convex face whose texture is not looked at.
    pub fn face(&mut self, outline_m: &[Vec3], paint: Paint) {
        let corners: Vec<(Vec3, Vec2)> =
            outline_m.iter().map(|corner| (*corner, Vec2::ZERO)).collect();
        self.textured_face(&corners, paint);
    }

    /// A convex face on the ground: texture coordinates are east and north.
    pub fn ground_face(&mut self, outline_m: &[Vec3], paint: Paint) {
        let corners: Vec<(Vec3, Vec2)> =
            outline_m.iter().map(|corner| (*corner, corner.truncate())).collect();
        self.textured_face(&corners, paint);
    }

    /// A convex face, corner by corner with its texture coordinates; slivers are left out.
    pub fn textured_face(&mut self, corners: &[(Vec3, Vec2)], paint: Paint) {
        const SLIVER_M2: f32 = 1e-7;
        let Paint { material, colour } = paint;
        let first = self.vertices.len() as u32;
        corners.iter().for_each(|(position_m, texture_m)| {
            self.corner(*position_m, *texture_m);
        });
        for k in 1..corners.len().saturating_sub(1) {
            let [a, b, c] = [corners[0].0, corners[k].0, corners[k + 1].0];
            if (b - a).cross(c - a).length() > SLIVER_M2 {
                let corners = [first, first + k as u32, first + k as u32 + 1];
                self.triangles.push(Triangle { corners, material, colour });
            }
        }
    }

    /// A four-sided face cut in columns and rows: `corners` are lower left, lower right, upper
    /// right and upper left from outside, cuts are shares of its width and height.
    pub fn panel(
        &mut self,
        corners: [Vec3; 4],
        columns: &[f32],
        rows: &[f32],
        paint: impl Fn(usize, usize) -> Paint,
    ) {
        let cuts = |inner: &[f32]| [&[0.0], inner, &[1.0]].concat();
        let (columns, rows) = (cuts(columns), cuts(rows));
        let [low_left, low_right, high_right, high_left] = corners;
        let at = |across: f32, up: f32| {
            low_left.lerp(low_right, across).lerp(high_left.lerp(high_right, across), up)
        };
        for (row, up) in rows.windows(2).enumerate() {
            for (column, across) in columns.windows(2).enumerate() {
                let cell = [
                    at(across[0], up[0]),
                    at(across[1], up[0]),
                    at(across[1], up[1]),
                    at(across[0], up[1]),
                ];
                self.face(&cell, paint(column, row));
            }
        }
    }

    /// Rings of equally many corners, one behind the other along an axis, joined by faces. Each
    /// ring is counter-clockwise as seen against the axis. The face of edge `i` runs from corner
    /// `i` to the next; painted by the ring that it begins at, and the edge.
    pub fn loft(&mut self, rings: &[Vec<Vec3>], paint: impl Fn(usize, usize) -> Paint) {
        for (index, pair) in rings.windows(2).enumerate() {
            let count = pair[0].len();
            for edge in 0..count {
                let next = (edge + 1) % count;
                let outline = [pair[1][edge], pair[0][edge], pair[0][next], pair[1][next]];
                self.face(&outline, paint(index, edge));
            }
        }
    }

    /// [`Mesh::loft`] with its ends closed.
    pub fn closed_loft(&mut self, rings: &[Vec<Vec3>], paint: Paint) {
        self.loft(rings, |_, _| paint);
        let reversed: Vec<Vec3> = rings[0].iter().rev().copied().collect();
        self.face(&reversed, paint);
        self.face(&rings[rings.len() - 1], paint);
    }

    /// A box along the axes.
    pub fn cuboid(&mut self, low_m: Vec3, high_m: Vec3, paint: Paint) {
        let ring = |x: f32| {
            vec![
                Vec3::new(x, high_m.y, low_m.z),
                Vec3::new(x, high_m.y, high_m.z),
                Vec3::new(x, low_m.y, high_m.z),
                Vec3::new(x, low_m.y, low_m.z),
            ]
        };
        self.closed_loft(&[ring(low_m.x), ring(high_m.x)], paint);
    }

    /// A bar between two places with four sides; half of its extent along `side` and across it
    /// at both ends, m. `side` is not along the bar.
    pub fn limb(&mut self, ends_m: [Vec3; 2], side: Vec3, half_m: [Vec2; 2], paint: Paint) {
        self.closed_loft(&bar(ends_m, side, half_m), paint);
    }

    /// A [`Mesh::limb`] without ends, for where others hide them.
    pub fn sleeve(&mut self, ends_m: [Vec3; 2], side: Vec3, half_m: [Vec2; 2], paint: Paint) {
        self.loft(&bar(ends_m, side, half_m), |_, _| paint);
    }

    /// A round bar with `sides` sides, its radii at both ends, m.
    pub fn pole(&mut self, ends_m: [Vec3; 2], radii_m: [f32; 2], sides: usize, paint: Paint) {
        let rings =
            [0, 1].map(|end| circle(ends_m[end], ends_m[1] - ends_m[0], radii_m[end], sides));
        self.closed_loft(&rings, paint);
    }

    /// A ball of 20 faces, stretched to `radii_m`; each corner moved out or in by a factor, each
    /// face painted by the direction that it looks in.
    pub fn blob(
        &mut self,
        centre_m: Vec3,
        radii_m: Vec3,
        factor: impl Fn(usize) -> f32,
        paint: impl Fn(Vec3) -> Paint,
    ) {
        for face in ICOSAHEDRON {
            let outwards = face.map(|corner| ICOSAHEDRON_M[corner]).iter().sum::<Vec3>() / 3.0;
            let corner = |corner| centre_m + ICOSAHEDRON_M[corner] * radii_m * factor(corner);
            self.face(&face.map(corner), paint(outwards.normalize_or(Vec3::Z)));
        }
    }

    /// All of another mesh, moved.
    pub fn append(&mut self, other: &Mesh, place: impl Fn(Vec3) -> Vec3) {
        let first = self.vertices.len() as u32;
        let moved = other.vertices.iter();
        self.vertices
            .extend(moved.map(|vertex| Vertex { position_m: place(vertex.position_m), ..*vertex }));
        let faces = other.triangles.iter();
        self.triangles.extend(
            faces.map(|face| Triangle { corners: face.corners.map(|c| c + first), ..*face }),
        );
    }

    /// Lowest and highest coordinates; none without vertices.
    pub fn bounds_m(&self) -> Option<(Vec3, Vec3)> {
        let mut places = self.vertices.iter().map(|vertex| vertex.position_m);
        let first = places.next()?;
        Some(places.fold((first, first), |(low, high), place| (low.min(place), high.max(place))))
    }

    /// The corners of a triangle, m.
    pub fn corners_m(&self, triangle: &Triangle) -> [Vec3; 3] {
        triangle.corners.map(|corner| self.vertices[corner as usize].position_m)
    }

    /// What a closed surface holds, m3.
    pub fn volume_m3(&self) -> f64 {
        let of = |triangle: &Triangle| {
            let [a, b, c] = self.corners_m(triangle).map(Vec3::as_dvec3);
            a.dot(b.cross(c)) / 6.0
        };
        self.triangles.iter().map(of).sum()
    }
}

/// The rings at both ends of a bar with four sides.
fn bar(ends_m: [Vec3; 2], side: Vec3, half_m: [Vec2; 2]) -> [Vec<Vec3>; 2] {
    let axis = (ends_m[1] - ends_m[0]).normalize_or(Vec3::Z);
    let across = axis.cross(side).normalize_or(Vec3::X);
    let side = across.cross(axis);
    [0, 1].map(|end| {
        let (u, v) = (side * half_m[end].x, across * half_m[end].y);
        [-u - v, u - v, u + v, v - u].map(|corner| ends_m[end] + corner).to_vec()
    })
}

/// The corners of a regular polygon around an axis, counter-clockwise against it.
pub fn circle(centre_m: Vec3, axis: Vec3, radius_m: f32, sides: usize) -> Vec<Vec3> {
    let axis = axis.normalize_or(Vec3::Z);
    let (u, v) = axis.any_orthonormal_pair();
    // The pair may be of either hand.
    let v = if u.cross(v).dot(axis) < 0.0 { -v } else { v };
    let corner = |k: usize| {
        let angle = std::f32::consts::TAU * k as f32 / sides as f32;
        centre_m + radius_m * (libm::cosf(angle) * u + libm::sinf(angle) * v)
    };
    (0..sides).map(corner).collect()
}

/// Coordinates of an icosahedron's corners on the unit ball.
const NEAR: f32 = 0.525_731_1;
const FAR: f32 = 0.850_650_8;

const ICOSAHEDRON_M: [Vec3; 12] = [
    Vec3::new(-NEAR, FAR, 0.0),
    Vec3::new(NEAR, FAR, 0.0),
    Vec3::new(-NEAR, -FAR, 0.0),
    Vec3::new(NEAR, -FAR, 0.0),
    Vec3::new(0.0, -NEAR, FAR),
    Vec3::new(0.0, NEAR, FAR),
    Vec3::new(0.0, -NEAR, -FAR),
    Vec3::new(0.0, NEAR, -FAR),
    Vec3::new(FAR, 0.0, -NEAR),
    Vec3::new(FAR, 0.0, NEAR),
    Vec3::new(-FAR, 0.0, -NEAR),
    Vec3::new(-FAR, 0.0, NEAR),
];

const ICOSAHEDRON: [[usize; 3]; 20] = [
    [0, 11, 5],
    [0, 5, 1],
    [0, 1, 7],
    [0, 7, 10],
    [0, 10, 11],
    [1, 5, 9],
    [5, 11, 4],
    [11, 10, 2],
    [10, 7, 6],
    [7, 1, 8],
    [3, 9, 4],
    [3, 4, 2],
    [3, 2, 6],
    [3, 6, 8],
    [3, 8, 9],
    [4, 9, 5],
    [2, 4, 11],
    [6, 2, 10],
    [8, 6, 7],
    [9, 8, 1],
];
