//! Many points as how many there are in each cell of a grid.

use crate::chart::{
    palette::INK,
    plot::{Plot, Size},
    scale::Axis,
};

/// Cells between the ends of the axes: rows of ascending y, each of ascending x. The more points, the
/// darker; over them a line.
pub fn density(
    title: &str,
    size: Size,
    x: Axis,
    y: Axis,
    counts: &[Vec<u64>],
    line: &[[f64; 2]],
    colour: &str,
) -> String {
    let most = counts.iter().flatten().copied().max().unwrap_or_default().max(1) as f64;
    let ([x0, x1], [y0, y1]) = ([x.low, x.high], [y.low, y.high]);
    let mut plot = Plot::new(title, size, x, y);
    let between =
        |low: f64, high: f64, i: usize, n: usize| low + (high - low) * i as f64 / n as f64;
    for (j, row) in counts.iter().enumerate() {
        let rows = counts.len();
        for (i, count) in row.iter().enumerate().filter(|(_, count)| **count > 0) {
            let across = [between(x0, x1, i, row.len()), between(x0, x1, i + 1, row.len())];
            let up = [between(y0, y1, j, rows), between(y0, y1, j + 1, rows)];
            // A single point among thousands is still to be seen.
            let opacity = 0.12 + 0.88 * (*count as f64 / most).sqrt();
            plot.area_of(across, up, colour, opacity);
        }
    }
    plot.line(line, INK, false);
    for point in line {
        plot.dot(*point, None, 0.0, INK);
    }
    plot.finish()
}
