//! Surfaces as triangles, each of one material.

use glam::{Vec2, Vec3};

/// What a surface is made of: decides how light, laser and radar come back from it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Material {
    Asphalt,
    /// Paint on the road.
    Marking,
    /// Side-walks and kerbs.
    Concrete,
    Grass,
    /// A wall with windows, by its coordinates: along the wall, and up.
    Facade,
    /// A wall without windows, a roof.
    Plaster,
    Bark,
    Foliage,
    /// Poles, bicycle frames, rims.
    Metal,
    /// Coachwork: takes the colour of the body that it belongs to.
    Coachwork,
    Glass,
    Rubber,
    /// Lamps of vehicles: at the front, at the rear, and those that come on when it brakes.
    HeadLamp,
    TailLamp,
    BrakeLamp,
    /// The part of a street lamp that glows at night.
    StreetLamp,
    Skin,
    /// Upper and lower garments: the upper ones take the colour of the body.
    Jacket,
    Trousers,
}

/// A corner of triangles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vertex {
    pub position_m: Vec3,
    /// Coordinates on the surface for its texture, m: along and up on walls, east and north on the
    /// ground.
    pub texture_m: Vec2,
}

/// Three places in [`Mesh::vertices`], counter-clockwise from outside.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Triangle {
    pub corners: [u32; 3],
    pub material: Material,
    /// sRGB; of coachwork and jackets the body's colour counts.
    pub colour: [u8; 3],
}

/// A surface.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    pub vertices: Vec<Vertex>,
    pub triangles: Vec<Triangle>,
}
