//! Statistics as LeRobot normalises by them: of every number of every column.

use serde_json::{Map, Value, json};

use crate::dataset::picture::rgb::Rgb;

/// Levels of quantiles, with the names that LeRobot has for them.
pub const QUANTILES: [(&str, f64); 5] =
    [("q01", 0.01), ("q10", 0.10), ("q50", 0.50), ("q90", 0.90), ("q99", 0.99)];

/// All statistics of one number, in LeRobot's order.
pub const NAMES: [&str; 9] = ["min", "max", "mean", "std", "q01", "q10", "q50", "q90", "q99"];

/// What is said of one number.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Summary([f64; 9]);

impl Summary {
    /// Of values in any order; of none, zeros.
    pub fn of(mut values: Vec<f32>) -> Summary {
        values.sort_unstable_by(f32::total_cmp);
        let Some(last) = values.len().checked_sub(1) else { return Summary::default() };
        let count = values.len() as f64;
        let mean = values.iter().map(|value| f64::from(*value)).sum::<f64>() / count;
        let squares = values.iter().map(|value| (f64::from(*value) - mean).powi(2));
        let std = (squares.sum::<f64>() / count).sqrt();
        let quantile = |level: f64| {
            let at = level * last as f64;
            let (low, high) = (values[at.floor() as usize], values[at.ceil() as usize]);
            f64::from(low) + (f64::from(high) - f64::from(low)) * at.fract()
        };
        let [q01, q10, q50, q90, q99] = QUANTILES.map(|(_, level)| quantile(level));
        Summary([quantile(0.0), quantile(1.0), mean, std, q01, q10, q50, q90, q99])
    }

    /// By its name in [`NAMES`].
    pub fn value(&self, name: usize) -> f64 {
        self.0[name]
    }
}

/// How often each value of a colour occurred in the pictures that were looked at.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Colours {
    /// Red, green, blue.
    counts: [[u64; 256]; 3],
    pub pictures: usize,
}

impl Default for Colours {
    fn default() -> Self {
        Colours { counts: [[0; 256]; 3], pictures: 0 }
    }
}

impl Colours {
    /// Of one picture.
    pub fn of(picture: &Rgb) -> Colours {
        let mut colours = Colours { pictures: 1, ..Colours::default() };
        for pixel in picture.data.chunks_exact(3) {
            for (counts, value) in colours.counts.iter_mut().zip(pixel) {
                counts[usize::from(*value)] += 1;
            }
        }
        colours
    }

    pub fn add(&mut self, other: &Colours) {
        self.pictures += other.pictures;
        let pairs = self.counts.as_flattened_mut().iter_mut().zip(other.counts.as_flattened());
        pairs.for_each(|(sum, count)| *sum += count);
    }

    /// Of red, green and blue, from 0 to 1.
    pub fn summaries(&self) -> [Summary; 3] {
        [0, 1, 2].map(|colour| {
            let counts = &self.counts[colour];
            let total: u64 = counts.iter().sum();
            if total == 0 {
                return Summary::default();
            }
            let level = |value: usize| value as f64 / 255.0;
            let mean_of = |pick: &dyn Fn(f64) -> f64| {
                let sums = counts.iter().enumerate().map(|(v, n)| pick(level(v)) * *n as f64);
                sums.sum::<f64>() / total as f64
            };
            let mean = mean_of(&|value| value);
            let std = mean_of(&|value| (value - mean).powi(2)).sqrt();
            let quantile = |share: f64| {
                let wanted = (share * (total - 1) as f64) as u64;
                let mut below = 0;
                let found = counts.iter().position(|count| {
                    below += count;
                    below > wanted
                });
                level(found.unwrap_or(255))
            };
            let [q01, q10, q50, q90, q99] = QUANTILES.map(|(_, share)| quantile(share));
            Summary([quantile(0.0), quantile(1.0), mean, std, q01, q10, q50, q90, q99])
        })
    }
}

/// What `meta/stats.json` says of one column; `is_image` nests as (colour, 1, 1).
pub fn json_of(summaries: &[Summary], count: usize, is_image: bool) -> Value {
    let mut column = Map::new();
    for (place, name) in NAMES.into_iter().enumerate() {
        let values = summaries.iter().map(|summary| match is_image {
            true => json!([[summary.value(place)]]),
            false => json!(summary.value(place)),
        });
        column.insert(name.into(), values.collect());
    }
    column.insert("count".into(), json!([count]));
    Value::Object(column)
}
