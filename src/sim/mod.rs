//! The embedded simulator: a world, its sensors, and the recorder that makes logs of it.
//!
//! Nothing in a log comes from outside the simulated world. Every random number is drawn from a
//! stream keyed by (seed, episode, purpose), so one build makes the same bytes of the same drive,
//! however many threads it has.

pub mod road;
pub mod cruise;
pub mod driver;
pub mod scene;
pub mod car;
pub mod scenery;
pub mod traffic;
pub mod world;
pub mod raster;
pub mod ground;
pub mod camera;
pub mod lidar;
pub mod radar;
pub mod messages;
pub mod record;
