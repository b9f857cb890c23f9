//! Polygons seen from above, filled on a picture.

use glam::DVec2;

/// Points that are taken across each pixel, and down.
const SAMPLES: usize = 2;

/// Red, green, blue.
pub type Colour = [u8; 3];

/// A picture that polygons are painted on, finer than it will be.
#[derive(Clone, Debug)]
pub struct Canvas {
    columns: usize,
    rows: usize,
    /// Row by row from the top.
    samples: Vec<Colour>,
}

impl Canvas {
    /// `width` and `height` in pixels of the finished picture.
    pub fn new(width: usize, height: usize, background: Colour) -> Self {
        let (columns, rows) = (width * SAMPLES, height * SAMPLES);
        Canvas { columns, rows, samples: vec![background; columns * rows] }
    }

    /// Fill a closed outline in pixels, x right and y down; where it crosses itself, by the
    /// even-odd rule.
    pub fn fill(&mut self, outline_px: &[DVec2], colour: Colour) {
        let fine: Vec<DVec2> = outline_px.iter().map(|point| *point * SAMPLES as f64).collect();
        let top = fine.iter().map(|point| point.y).fold(f64::INFINITY, f64::min);
        let bottom = fine.iter().map(|point| point.y).fold(f64::NEG_INFINITY, f64::max);
        let mut crossings = Vec::new();
        for row in samples_between(top, bottom, self.rows) {
            let y = row as f64 + 0.5;
            crossings.clear();
            for (index, to) in fine.iter().enumerate() {
                let from = fine[(index + fine.len() - 1) % fine.len()];
                if (from.y <= y) != (to.y <= y) {
                    crossings.push(from.x + (to.x - from.x) * (y - from.y) / (to.y - from.y));
                }
            }
            crossings.sort_by(f64::total_cmp);
            for span in crossings.chunks_exact(2) {
                let columns = samples_between(span[0], span[1], self.columns);
                let start = row * self.columns;
                self.samples[start + columns.start..start + columns.end].fill(colour);
            }
        }
    }

    /// The finished picture: row by row, 3 bytes a pixel.
    pub fn into_rgb(self) -> Vec<u8> {
        let mut rgb = Vec::with_capacity(3 * self.samples.len() / (SAMPLES * SAMPLES));
        for row in (0..self.rows).step_by(SAMPLES) {
            for column in (0..self.columns).step_by(SAMPLES) {
                let of_pixel = (0..SAMPLES * SAMPLES).map(|i| {
                    self.samples[(row + i / SAMPLES) * self.columns + column + i % SAMPLES]
                });
                let sum = of_pixel.fold([0_usize; 3], |sum, sample| {
                    std::array::from_fn(|i| sum[i] + usize::from(sample[i]))
                });
                rgb.extend(sum.map(|value| (value / (SAMPLES * SAMPLES)) as u8));
            }
        }
        rgb
    }
}

/// Samples whose middle lies in [`low`, `high`).
fn samples_between(low: f64, high: f64, count: usize) -> std::ops::Range<usize> {
    let clamped = |edge: f64| (edge - 0.5).ceil().clamp(0.0, count as f64) as usize;
    let (start, end) = (clamped(low), clamped(high));
    start..end.max(start)
}
