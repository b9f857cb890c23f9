//! What sensors look at: a town as triangles, and all that moves in it at one instant.
//!
//! ```text
//! map, scenery -> meshes of the town (once) --------------+
//! snapshot -> bodies (meshes of a kind, placed) -> instant +-> camera, lidar, radar
//! ```
//!
//! Lengths are metres, in the world's frame: x east, y north, z up.

pub mod conditions;
pub mod mesh;
pub mod surroundings;
pub mod instant;
