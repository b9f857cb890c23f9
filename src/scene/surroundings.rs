//! A town as triangles, in tiles.

use glam::Vec3;

use crate::scene::mesh::Mesh;

/// A part of a town, in the box from `low_m` to `high_m`.
pub struct Tile {
    pub low_m: Vec3,
    pub high_m: Vec3,
    pub mesh: Mesh,
}

/// All that stands in a town.
pub struct Surroundings {
    pub tiles: Vec<Tile>,
}
