//! Which part of the data trains and which part judges.
//!
//! Episodes are split 7 : 1 by a hash of their id, so an episode stays where it is whatever else
//! is ingested, on any machine, in any order. Frames of one episode never fall on both sides.

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

/// One in so many episodes validates (paper §IV.A: 7 : 1).
pub const VAL_ONE_IN: u64 = 8;

/// A side of the split.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Split {
    Train,
    Val,
}

impl Split {
    pub const ALL: [Split; 2] = [Split::Train, Split::Val];

    /// The name in paths and columns.
    pub fn name(self) -> &'static str {
        match self {
            Split::Train => "train",
            Split::Val => "val",
        }
    }

    /// The side of an episode.
    pub fn of(episode: &str) -> Split {
        let hash = Sha256::digest(episode.as_bytes());
        let number = hash.iter().take(8).fold(0, |n: u64, byte| n << 8 | u64::from(*byte));
        if number.is_multiple_of(VAL_ONE_IN) { Split::Val } else { Split::Train }
    }
}
