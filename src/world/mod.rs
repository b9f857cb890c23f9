//! The world: streets with traffic and people on them, an ego vehicle, and who touches whom.
//!
//! ```text
//! map -> streets ---------------------------------------+
//! scenario (seed, density) -> vehicles, pedestrians ----+-> world, every 10 ms -> snapshot -> contacts
//! action -> ego vehicle (bicycle with lag) -------------+
//! ```
//!
//! Agents move every 0.1 s, the ego vehicle every 0.01 s. Every actor draws from a stream of its
//! own, keyed by (seed, episode, actor), and is visited in the order of its number, so the same
//! seed gives the same states.

pub mod ego;
pub mod car_following;
pub mod kind;
pub mod streets;
pub mod stop_lines;
pub mod paving;
pub mod reservation;
pub mod occupancy;
pub mod vehicle;
pub mod right_of_way;
pub mod lane_change;
pub mod traffic;
pub mod walkers;
pub mod contact;
pub mod density;
pub mod snapshot;
pub mod spread;
pub mod touches;
pub mod census;
pub mod rush_hour;
pub mod route;
pub mod simulation;
pub mod expert;
pub mod scoring;
pub mod episode;
pub mod town;
pub mod drill;
