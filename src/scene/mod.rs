//! What sensors look at: a town as triangles, and all that moves in it at one instant.
//!
//! ```text
//! map, scenery -> surroundings of a town (once) ---------------+
//! kinds -> shapes (once) -> bodies of a snapshot -> instant ---+-> camera, lidar, radar
//! ```
//!
//! Lengths are metres, in the world's frame: x east, y north, z up.

pub mod conditions;
pub mod mesh;
pub mod solids;
pub mod course;
pub mod driven;
pub mod terrain;
pub mod streets;
pub mod junctions;
pub mod marks;
pub mod buildings;
pub mod trees;
pub mod furniture;
pub mod surroundings;
pub mod people;
pub mod vehicles;
pub mod two_wheelers;
pub mod shapes;
pub mod instant;
