//! How often numbers lie in each of equal parts of an axis.

use crate::chart::{
    palette::INK,
    plot::{Plot, Size},
    scale::Axis,
};

/// Share of a part's width that its bar takes.
const FILLED: f64 = 0.94;

/// Shares of all in each part of [0, 1], with the share that each would have if all were alike as a
/// dashed line.
pub fn histogram(title: &str, size: Size, x_label: &str, counts: &[u64], colour: &str) -> String {
    let even = 1.0 / counts.len().max(1) as f64;
    let shares = shares(counts);
    let y = Axis::from_zero("share", highest(&shares).max(1.5 * even), 4);
    let mut plot = Plot::new(title, size, Axis::shares(x_label), y);
    parts(&mut plot, [0.0, 1.0], 0.0, &shares, colour);
    plot.line(&[[0.0, even], [1.0, even]], INK, true);
    plot.finish()
}

/// Shares of all in each part of any axis.
pub fn distribution(title: &str, size: Size, x: Axis, counts: &[u64], colour: &str) -> String {
    let (ends, shares) = ([x.low, x.high], shares(counts));
    let y = Axis::from_zero("share", highest(&shares), 4);
    let mut plot = Plot::new(title, size, x, y);
    parts(&mut plot, ends, 0.0, &shares, colour);
    plot.finish()
}

/// The same where one part has nearly all: heights are logarithms, from a tenth of the share of a
/// single one.
pub fn log_distribution(title: &str, size: Size, x: Axis, counts: &[u64], colour: &str) -> String {
    let ends = [x.low, x.high];
    let all = counts.iter().sum::<u64>().max(1) as f64;
    let low = (0.5 / all).log10().floor().min(-1.0);
    let heights: Vec<f64> =
        counts.iter().map(|count| (*count as f64 / all).log10().max(low)).collect();
    let mut plot = Plot::new(title, size, x, Axis::log10("share", low, 0.0));
    parts(&mut plot, ends, low, &heights, colour);
    plot.finish()
}

fn shares(counts: &[u64]) -> Vec<f64> {
    let all = counts.iter().sum::<u64>().max(1) as f64;
    counts.iter().map(|count| *count as f64 / all).collect()
}

fn highest(shares: &[f64]) -> f64 {
    shares.iter().copied().fold(0.0, f64::max)
}

/// Bars of these heights on equal parts of the axis.
fn parts(plot: &mut Plot, [left, right]: [f64; 2], low: f64, heights: &[f64], colour: &str) {
    let width = (right - left) / heights.len().max(1) as f64;
    for (i, height) in heights.iter().enumerate() {
        let start = left + width * i as f64;
        plot.area_of([start, start + FILLED * width], [low, *height], colour, 1.0);
    }
}
