//! Where LeRobot's episodes begin and end.

use crate::{
    dataset::{
        manifest::{LogRecord, Manifest},
        split::Split,
    },
    frame::Frame,
    lerobot::layout::CHANNELS,
};

/// An episode as it is asked for: a whole one of the dataset.
#[derive(Clone, Copy, Debug)]
pub struct Wanted<'m> {
    pub log: &'m LogRecord,
    /// Index in the log.
    pub number: usize,
}

/// All episodes of a dataset, those that train first.
pub fn episodes(manifest: &Manifest) -> Vec<Wanted<'_>> {
    let of_split = |split: Split| {
        let logs = manifest.logs.iter().filter(move |log| log.split == split);
        logs.flat_map(|log| (0..log.episodes.len()).map(move |number| Wanted { log, number }))
    };
    Split::ALL.into_iter().flat_map(of_split).collect()
}

/// What was cut and left out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Episodes of the dataset.
    pub drives: usize,
    /// Episodes that were made of them.
    pub episodes: usize,
    pub frames: usize,
    /// Frames whose action lacks a channel that others have.
    pub without_action: usize,
}

/// Whether a frame goes on with the stretch that ended with tick `last`.
pub fn goes_on(last: Option<u32>, frame: &Frame) -> bool {
    last.is_some_and(|last| frame.index == last + 1)
}

/// The frame's action in those channels; `None` if it lacks one.
pub fn action(frame: &Frame, channels: &[usize]) -> Option<Vec<f32>> {
    channels.iter().map(|channel| CHANNELS[*channel].1(&frame.action)).collect()
}
