//! Lamps, posts and fields.

use glam::{DVec2, Vec2, Vec3};

use crate::{
    footprint::Footprint,
    scene::{
        mesh::{Material, Mesh},
        solids::{circle, paint},
        terrain::Terrain,
    },
    towns::scenery::things::{Kind, Thing},
};

/// How far a lamp reaches over the road, m.
const ARM_M: f64 = 1.6;
const HEAD_M: Vec3 = Vec3::new(0.35, 0.14, 0.06);

/// Crops lower than this are short grass, m.
const STUBBLE_M: f64 = 0.35;

/// A field follows the ground in pieces of this size, m.
const PIECE_M: f64 = 10.0;

/// A lamp that leans over what lies in the direction `to_road`.
pub fn lamp(thing: &Thing, ground_m: f64, to_road: DVec2, mesh: &mut Mesh) {
    let metal = paint(Material::Metal, Kind::Lamp.colours()[usize::from(thing.colour)]);
    let foot = thing.footprint.centre_m.extend(ground_m).as_vec3();
    let top = foot + Vec3::Z * thing.height_m as f32;
    let ends = [foot - Vec3::Z * 0.3, top];
    let rings = [circle(ends[0], Vec3::Z, 0.09, 6), circle(ends[1], Vec3::Z, 0.05, 6)];
    mesh.loft(&rings, |_, _| metal);
    let out = (to_road * ARM_M).extend(0.0).as_vec3();
    let side = Vec3::Z.cross(out);
    let arm = [top - Vec3::Z * 0.12, top + out - Vec3::Z * 0.02];
    mesh.limb(arm, side, [Vec2::splat(0.04), Vec2::splat(0.03)], metal);
    let head = [arm[1] - out * 0.2, arm[1] + out * 0.25];
    mesh.limb(head, side, [Vec2::new(HEAD_M.y, HEAD_M.z); 2], metal);
    // The glass looks down, a little below the head.
    let (along, across) = (out.normalize() * HEAD_M.x, side.normalize() * HEAD_M.y * 0.8);
    let middle = 0.5 * (head[0] + head[1]) - Vec3::Z * (HEAD_M.z + 0.01);
    let glass = [
        middle - along + across,
        middle + along + across,
        middle + along - across,
        middle - along - across,
    ];
    mesh.face(&glass, paint(Material::StreetLamp, [250, 240, 214]));
}

/// A white post with a dark band, as at the edges of country roads.
pub fn post(thing: &Thing, ground_m: f64, mesh: &mut Mesh) {
    let white = paint(Material::Plaster, Kind::Post.colours()[usize::from(thing.colour)]);
    let black = paint(Material::Plaster, [30, 30, 32]);
    let foot = thing.footprint.centre_m.extend(ground_m).as_vec3();
    let side = thing.footprint.left().extend(0.0).as_vec3();
    let half = [Vec2::splat(0.5 * thing.footprint.half_m.x as f32 + 0.03); 2];
    let at = |share: f32| foot + Vec3::Z * thing.height_m as f32 * share;
    let pieces = [(-0.3, 0.68, white), (0.68, 0.86, black), (0.86, 1.0, white)];
    for (low, high, paint) in pieces {
        mesh.limb([at(low), at(high)], side, half, paint);
    }
}

/// Crops: a low box that follows the ground.
pub fn field(thing: &Thing, terrain: &Terrain, mesh: &mut Mesh) {
    let is_short = thing.height_m < STUBBLE_M;
    let material = if is_short { Material::Grass } else { Material::Foliage };
    let crop = paint(material, Kind::Field.colours()[usize::from(thing.colour)]);
    let Footprint { centre_m, forward, half_m } = thing.footprint;
    let counts = if terrain.is_flat {
        [1, 1]
    } else {
        (2.0 * half_m / PIECE_M).ceil().max(DVec2::ONE).to_array().map(|count| count as usize)
    };
    let at = |i: usize, j: usize, above_m: f64| {
        let share = DVec2::new(i as f64 / counts[0] as f64, j as f64 / counts[1] as f64);
        let place = centre_m + forward.rotate((2.0 * share - 1.0) * half_m);
        place.extend(terrain.height_m(place) + above_m).as_vec3()
    };
    let top = thing.height_m;
    for (i, j) in (0..counts[0]).flat_map(|i| (0..counts[1]).map(move |j| (i, j))) {
        let outline = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)];
        mesh.ground_face(&outline.map(|(i, j)| at(i, j, top)), crop);
    }
    let sides = (0..counts[0])
        .flat_map(|i| [[(i, 0), (i + 1, 0)], [(i + 1, counts[1]), (i, counts[1])]])
        .chain(
            (0..counts[1])
                .flat_map(|j| [[(counts[0], j), (counts[0], j + 1)], [(0, j + 1), (0, j)]]),
        );
    for [from, to] in sides {
        let low = -0.2;
        let outline = [
            at(from.0, from.1, low),
            at(to.0, to.1, low),
            at(to.0, to.1, top),
            at(from.0, from.1, top),
        ];
        mesh.face(&outline, crop.shaded(0.85));
    }
}
