//! Scenery from above, for pictures of maps.

use std::f64::consts::TAU;

use glam::DVec2;

use crate::{
    map::shapes::Shape,
    towns::scenery::{
        collection::Scenery,
        things::{Kind, Thing},
    },
};

/// Radius of a crown, as a share of the tree's height.
const CROWN: f64 = 0.25;

/// Lamps and posts are drawn at least this large, so that they can be seen, m.
const SMALLEST_M: f64 = 0.8;

/// Outlines of all things; those that are higher are painted later.
pub fn outlines(scenery: &Scenery) -> Vec<Shape> {
    let mut things: Vec<&Thing> = scenery.things().iter().collect();
    things.sort_by(|a, b| a.height_m.total_cmp(&b.height_m));
    things.into_iter().map(outline).collect()
}

fn outline(thing: &Thing) -> Shape {
    let outline_m = match thing.kind {
        Kind::Tree => crown_m(thing.footprint.centre_m, CROWN * thing.height_m),
        Kind::Lamp | Kind::Post => crown_m(thing.footprint.centre_m, 0.5 * SMALLEST_M),
        _ => thing.footprint.corners_m().to_vec(),
    };
    Shape::thing(outline_m, thing.kind.colours()[usize::from(thing.colour)])
}

fn crown_m(centre_m: DVec2, radius_m: f64) -> Vec<DVec2> {
    let corner = |i: u32| centre_m + radius_m * DVec2::from_angle(TAU * f64::from(i) / 10.0);
    (0..10).map(corner).collect()
}
