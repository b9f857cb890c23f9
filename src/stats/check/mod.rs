//! A dataset's verdict: what would hurt a training run, by stable code.
//!
//! ```text
//! manifest, files -> structure --------------------------------------------+
//! columns -> track (one episode) -> motion -> time, ego, labels, actions,  |
//!                                             route                        +- verdict -> screen, github, JSON
//!                 -> digest (all episodes) -> split, balance, conditions   |
//! a sample of pictures and returns -> glimpse -> images, ralidar ----------+
//! ```
//!
//! Each family of checks is a file: what it looks for, why, the remedy, the limits with their
//! sources, and a plain function over slices. `catalogue` has all of them, `page` writes
//! `docs/checks.md`.

pub mod finding;
pub mod track;
pub mod structure;
pub mod motion;
pub mod digest;
pub mod time;
pub mod ego;
pub mod labels;
pub mod actions;
pub mod route;
pub mod glimpse;
pub mod images;
pub mod ralidar;

pub mod split;
pub mod balance;
pub mod conditions;
pub mod catalogue;
pub mod verdict;
pub mod screen;
pub mod github;
pub mod page;
