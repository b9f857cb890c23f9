//! All that moves, at one instant, as meshes with places.

use std::sync::Arc;

use glam::{Affine3A, DVec3};

use crate::{scene::mesh::Mesh, world::reservation::ActorId};

/// A mesh somewhere in the world: a vehicle, or somebody on foot in a pose.
#[derive(Clone, Debug)]
pub struct Body {
    pub actor: ActorId,
    /// In the frame of the body: x forward, y left, z up, the origin on the ground below its middle.
    pub mesh: Arc<Mesh>,
    pub world_from_body: Affine3A,
    /// Of coachwork and jackets, sRGB.
    pub colour: [u8; 3],
    /// World frame, m/s.
    pub velocity_mps: DVec3,
    pub is_braking: bool,
}

/// What moves, without the ego vehicle, which its own sensors do not see.
#[derive(Clone, Debug, Default)]
pub struct Instant {
    pub time_s: f64,
    /// Ascending by actor: vehicles, then people.
    pub bodies: Vec<Body>,
}
