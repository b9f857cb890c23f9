//! Road maps: OpenDRIVE files as lanes that can be measured, searched, driven along and drawn.
//!
//! ```text
//! FILE.xodr -> opendrive -> roads (reference line, lanes) -> lane graph -> planner -> route
//!                                                        \-> index (nearest lane)
//!                                                        \-> picture
//! ```
//!
//! The frame of a map is OpenDRIVE's: x east, y north, z up, metres; headings counter-clockwise
//! from x, radians. CARLA's world has y and yaw of the opposite sign. `s` is the distance along a
//! road's reference line and `t` the distance from it, positive left, metres.

pub mod xml;
pub mod profile;
pub mod reference_line;
pub mod opendrive;
pub mod reader;
pub mod road;
pub mod links;
pub mod contraction;
pub mod graph;
pub mod index;
pub mod road_map;
pub mod planner;
pub mod route;
pub mod leaderboard;
pub mod canvas;
pub mod shapes;
pub mod picture;
pub mod answers;
