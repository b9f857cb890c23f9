//! All that stands still, as meshes in tiles.

use glam::Vec3;

use crate::scene::mesh::Mesh;

/// A part of the town with the box around it.
#[derive(Clone, Debug)]
pub struct Tile {
    pub low_m: Vec3,
    pub high_m: Vec3,
    pub mesh: Mesh,
}

/// The town, in tiles.
#[derive(Clone, Debug, Default)]
pub struct Surroundings {
    pub tiles: Vec<Tile>,
}
