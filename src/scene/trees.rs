//! Trees: a trunk, and a crown of one of several shapes.

use glam::{Vec2, Vec3};

use crate::{
    scene::{
        mesh::{Material, Mesh},
        solids::{Paint, circle, paint},
    },
    towns::scenery::things::{Kind, Thing},
};

const BARK: [[u8; 3]; 3] = [[92, 76, 60], [110, 98, 84], [78, 66, 56]];

/// Radius of a crown, as a share of the tree's height; see [`Kind::Tree`].
const CROWN: f32 = 0.25;

/// Trees that are further from any lane are simpler, m.
const FAR_M: f32 = 10.0;

/// A tree on the ground at `ground_m`, with `free_m` around it to where cars drive.
pub fn draw(thing: &Thing, number: usize, ground_m: f32, free_m: f32, mesh: &mut Mesh) {
    let foot_m = thing.footprint.centre_m.extend(f64::from(ground_m)).as_vec3();
    let height_m = thing.height_m as f32;
    let shade = 0.88 + 0.06 * (number * 3 % 5) as f32;
    let leaves =
        paint(Material::Foliage, Kind::Tree.colours()[usize::from(thing.colour)]).shaded(shade);
    let bark = paint(Material::Bark, BARK[number % BARK.len()]);
    // Where a road is near, crowns are slender.
    let radius_m = (CROWN * height_m).min(free_m.max(0.5));
    let is_far = free_m > FAR_M;
    let tree = Tree { foot_m, height_m, radius_m, number, is_far, leaves, bark };
    match number % 5 {
        0 => tree.conifer(mesh),
        1 => tree.poplar(mesh),
        _ => tree.broad(mesh),
    }
}

struct Tree {
    foot_m: Vec3,
    height_m: f32,
    radius_m: f32,
    number: usize,
    /// From any road: simpler.
    is_far: bool,
    leaves: Paint,
    bark: Paint,
}

impl Tree {
    fn up(&self, share: f32) -> Vec3 {
        self.foot_m + Vec3::Z * self.height_m * share
    }

    fn trunk(&self, share: f32, mesh: &mut Mesh) {
        let radius_m = (0.022 * self.height_m).clamp(0.08, 0.2);
        let sides = if self.is_far { 3 } else { 5 };
        let ends = [self.foot_m - Vec3::Z * 0.4, self.up(share)];
        let rings = [
            circle(ends[0], Vec3::Z, radius_m * 1.2, sides),
            circle(ends[1], Vec3::Z, radius_m * 0.7, sides),
        ];
        mesh.loft(&rings, |_, _| self.bark);
    }

    /// Between -1 and 1, differing by the number.
    fn vary(&self, salt: usize) -> f32 {
        let mixed = (self.number * 0x9E37 + salt * 0x85EB + 11) % 1009;
        mixed as f32 / 504.0 - 1.0
    }

    fn ball(&self, middle: Vec3, radii: Vec3, salt: usize, paint: Paint, mesh: &mut Mesh) {
        let factor = |corner: usize| 0.93 + 0.07 * self.vary(salt * 17 + corner);
        mesh.blob(middle, radii, factor, |_| paint);
    }

    /// One large ball of leaves, and two smaller ones that lean out of it.
    fn broad(&self, mesh: &mut Mesh) {
        self.trunk(0.5, mesh);
        let (radius, tall) = (self.radius_m, 0.62 * self.height_m);
        self.ball(
            self.up(0.66),
            Vec3::new(0.8 * radius, 0.8 * radius, 0.5 * tall),
            1,
            self.leaves,
            mesh,
        );
        let turn = std::f32::consts::PI * self.vary(5);
        let out = Vec2::new(libm::cosf(turn), libm::sinf(turn)) * 0.4 * radius;
        let small = Vec3::new(0.6 * radius, 0.6 * radius, 0.34 * tall);
        self.ball(self.up(0.58) + out.extend(0.0), small, 2, self.leaves.shaded(0.92), mesh);
        if !self.is_far {
            let place = self.up(0.72) - out.extend(0.0);
            self.ball(place, 0.9 * small, 3, self.leaves.shaded(1.07), mesh);
        }
    }

    /// Tall and slender.
    fn poplar(&self, mesh: &mut Mesh) {
        self.trunk(0.3, mesh);
        let radius = 0.62 * self.radius_m;
        let half_m = 0.41 * self.height_m;
        self.ball(self.up(0.58), Vec3::new(radius, radius, half_m), 1, self.leaves, mesh);
        if self.is_far {
            return;
        }
        let low = Vec3::new(0.9 * radius, 0.9 * radius, 0.55 * half_m);
        self.ball(self.up(0.42), low, 2, self.leaves.shaded(0.94), mesh);
    }

    /// Skirts of needles, one above the other.
    fn conifer(&self, mesh: &mut Mesh) {
        let sides = if self.is_far { 5 } else { 7 };
        self.trunk(0.3, mesh);
        let dark = self.leaves.shaded(0.8);
        for (layer, (low, high, width)) in
            [(0.16, 0.58, 1.0), (0.4, 0.8, 0.74), (0.62, 1.0, 0.48)].into_iter().enumerate()
        {
            let rim = circle(self.up(low), Vec3::Z, width * self.radius_m, sides);
            let turned = 1.0 + 0.1 * self.vary(layer);
            let tip = self.up(high);
            for k in 0..sides {
                mesh.face(&[rim[k], rim[(k + 1) % sides], tip], dark.shaded(turned));
            }
            let below: Vec<Vec3> = rim.iter().rev().copied().collect();
            mesh.face(&below, dark.shaded(0.7));
        }
    }
}
