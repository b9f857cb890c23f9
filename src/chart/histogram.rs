//! How often numbers lie in each of equal parts of [0, 1].

use crate::chart::{
    palette::INK,
    plot::{Plot, Size},
    scale::Axis,
};

/// Shares of all in each part, with the share that each would have if all were alike as a dashed
/// line.
pub fn histogram(title: &str, size: Size, x_label: &str, counts: &[u64], colour: &str) -> String {
    let all = counts.iter().sum::<u64>().max(1) as f64;
    let highest = counts.iter().copied().max().unwrap_or_default() as f64 / all;
    let even = 1.0 / counts.len().max(1) as f64;
    let y = Axis::from_zero("share", highest.max(1.5 * even), 4);
    let mut plot = Plot::new(title, size, Axis::shares(x_label), y);
    for (i, count) in counts.iter().enumerate() {
        let ends = [i as f64 * even, (i as f64 + 0.94) * even];
        plot.area_of(ends, [0.0, *count as f64 / all], colour, 1.0);
    }
    plot.line(&[[0.0, even], [1.0, even]], INK, true);
    plot.finish()
}
