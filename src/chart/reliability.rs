//! What is claimed beside what comes: on the diagonal if claims hold.

use crate::chart::{
    palette::INK,
    plot::{Plot, Size},
    scale::Axis,
};

/// A line for each colour: the share of numbers at or below each quantile that was claimed, from
/// counts of the probability integral transform in equal parts of [0, 1].
pub fn reliability(title: &str, size: Size, claims: &[(&str, &[u64])]) -> String {
    let (x, y) = (Axis::shares("quantile that was planned"), Axis::shares("share at or below it"));
    let mut plot = Plot::new(title, size, x, y);
    plot.line(&[[0.0, 0.0], [1.0, 1.0]], INK, true);
    for (colour, counts) in claims {
        plot.line(&shares_below(counts), colour, false);
    }
    plot.finish()
}

/// Share of all that lies below each border of the parts, from (0, 0) to (1, 1).
pub fn shares_below(counts: &[u64]) -> Vec<[f64; 2]> {
    let all = counts.iter().sum::<u64>().max(1) as f64;
    let mut below = 0;
    let mut points = vec![[0.0, 0.0]];
    for (i, count) in counts.iter().enumerate() {
        below += count;
        points.push([(i + 1) as f64 / counts.len() as f64, below as f64 / all]);
    }
    points
}
