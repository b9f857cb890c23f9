//! What an ingest tells while it runs. It prints nothing itself.

use crate::dataset::logs::GivenLog;

/// What an ingest tells.
#[derive(Clone, Copy)]
pub enum Event<'l> {
    /// The logs that this process goes through; others count them in this order, from 0.
    Begun { logs: &'l [GivenLog] },
    /// Something happened to one of them.
    OfLog { number: usize, step: Step },
    /// So many bytes of a whole dataset are to be sent to its store.
    Sending { bytes: u64 },
    /// So many bytes more were sent, or were there already.
    Sent { bytes: u64 },
}

/// What happens to a log. Threads work on several at once, each in this order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// Work on it begins.
    Started,
    /// Its bytes may be known, and are hashed to tell.
    Hashing,
    Hashed,
    /// So many of its bytes were copied so far, from a store to the disk.
    Copied {
        bytes: u64,
    },
    /// So many of its bytes were read so far, in the first pass.
    Read {
        bytes: u64,
    },
    /// A part of it has so many ticks to make.
    Opened {
        ticks: u64,
    },
    /// So many ticks more were made, and so many frames came of them.
    Made {
        ticks: u64,
        frames: u64,
    },
    /// It is done with: committed now or before, or failed. Once for every log.
    Ended,
}
