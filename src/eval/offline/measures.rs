//! From frames to one number, where that is more than a mean.

use crate::eval::{
    offline::{errors::Row, pedals::Pedal},
    statistics::rank::{auroc, quantile},
};

/// Parts of [0, 1] in which numbers are counted.
pub const BINS: usize = 100;

/// The part that a number in [0, 1] lies in.
pub fn bin(share: f32) -> usize {
    ((f64::from(share) * BINS as f64) as usize).min(BINS - 1)
}

/// Mean over q = 0.05, 0.10 ... 0.95 of how far the share of numbers up to q is from q.
pub fn calibration_error(counts: &[f64]) -> f64 {
    let every = BINS / 20;
    let off: Vec<f64> = deviations(counts).skip(every - 1).step_by(every).collect();
    off.iter().sum::<f64>() / off.len() as f64
}

/// Kolmogorov and Smirnov's distance from uniform at q = 0.01, 0.02 ... 0.99.
pub fn greatest_deviation(counts: &[f64]) -> f64 {
    deviations(counts).fold(0.0, f64::max)
}

/// |share of numbers up to q - q| at the inner borders of the parts.
fn deviations(counts: &[f64]) -> impl Iterator<Item = f64> {
    let all: f64 = counts.iter().sum();
    let parts = counts.len() as f64;
    let mut below = 0.0;
    counts[..counts.len() - 1].iter().enumerate().map(move |(i, count)| {
        below += count;
        (below / all - (i + 1) as f64 / parts).abs()
    })
}

/// Area under the ROC curve of the first number for the second being above its 90th percentile.
pub fn auroc_of_worst_tenth(pairs: &[[f64; 2]]) -> Option<f64> {
    let mut errors: Vec<f64> = pairs.iter().map(|pair| pair[1]).collect();
    if errors.is_empty() {
        return None;
    }
    errors.sort_by(f64::total_cmp);
    let bound = quantile(&errors, 0.9);
    auroc(&pairs.iter().map(|[score, error]| (*score, *error > bound)).collect::<Vec<_>>())
}

/// A frame's part in the measures of an event: [what counts, of what] of each.
#[derive(Clone, Copy, Debug)]
pub struct Event {
    hit: f64,
    planned: f64,
    recorded: f64,
}

/// Whether both, either or neither do it.
pub fn event(pedal: Option<Pedal>) -> Option<Event> {
    let Pedal { planned, recorded } = pedal?;
    let [hit, planned, recorded] =
        [planned && recorded, planned, recorded].map(|is| f64::from(u8::from(is)));
    Some(Event { hit, planned, recorded })
}

impl Event {
    pub fn precision(self) -> [f64; 2] {
        [self.hit, self.planned]
    }

    pub fn recall(self) -> [f64; 2] {
        [self.hit, self.recorded]
    }

    pub fn f1(self) -> [f64; 2] {
        [2.0 * self.hit, self.planned + self.recorded]
    }
}

/// How much later than the driver that source of actions began to brake, s.
pub fn onset_late_s(row: &Row, source: usize) -> Option<f64> {
    row.errors.brake_onset[source]?.late_s
}

/// 1 where the driver began to brake and that source of actions did not.
pub fn onset_is_missed(row: &Row, source: usize) -> Option<f64> {
    let onset = row.errors.brake_onset[source]?;
    Some(f64::from(u8::from(onset.late_s.is_none())))
}
