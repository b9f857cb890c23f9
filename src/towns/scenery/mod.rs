//! What stands beside the roads of any map: buildings, trees, lamps, posts, kerbs, fields.
//!
//! Derived from the map and a seed, as plain boxes with an index. Nothing stands on what is
//! driven or walked on, nor within a junction. Every stretch of road draws from a stream of
//! random numbers of its own, so that a road added elsewhere changes nothing here.

pub mod outline;
pub mod things;
pub mod ground;
pub mod roadside;
pub mod furniture;
pub mod buildings;
pub mod planting;
pub mod collection;
pub mod drawing;
