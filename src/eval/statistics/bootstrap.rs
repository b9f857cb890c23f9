//! How far a number can be trusted: means and bootstrap intervals over independent units.
//!
//! Neighbouring frames see the same road and share most of their future, so frames are not
//! resampled one by one: the unit is the episode, or a block of the length of the future where
//! there are too few episodes.

use rand_chacha::{
    ChaCha8Rng,
    rand_core::{Rng as _, SeedableRng as _},
};
use serde::{Deserialize, Serialize};

use crate::eval::statistics::rank::selected_quantile;

/// Fewest units from which a claim is made.
///
/// With `n` units that all point the same way, a two-sided sign test gives `2 / 2^n`: 0.06 for
/// five, 0.03 for six. Below six, no outcome is significant at 5 %, whatever a bootstrap says.
pub const FEWEST_UNITS: usize = 6;

/// What is drawn in a resample.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Unit {
    /// Whole episodes: the interval speaks of other drives.
    Episodes,
    /// Contiguous 3 s blocks of frames: the interval speaks of more of the same drives, and is
    /// somewhat too narrow, as the last frames of a block look into the next one.
    #[serde(rename = "blocks-of-3s")]
    Blocks,
}

impl Unit {
    /// So many of them, in words: `1 episode`, `14 contiguous blocks of 3 s`.
    pub fn counted(self, count: u64) -> String {
        let s = if count == 1 { "" } else { "s" };
        match self {
            Unit::Episodes => format!("{count} episode{s}"),
            Unit::Blocks => format!("{count} contiguous block{s} of 3 s"),
        }
    }
}

/// A percentile bootstrap (Efron, 1979): the same numbers and settings give the same interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Bootstrap {
    /// Share of resamples inside the interval.
    pub level: f64,
    pub resamples: usize,
    pub seed: u64,
}

impl Default for Bootstrap {
    fn default() -> Self {
        Bootstrap { level: 0.95, resamples: 10_000, seed: 0 }
    }
}

impl Bootstrap {
    /// Interval of the mean of `values`, whose unit is `unit_of[i]`, counted from 0.
    ///
    /// Units are drawn with replacement, as many as have a value; a resample's mean weighs each
    /// of its values alike. `None` if fewer than two units have a value.
    ///
    /// # Panics
    ///
    /// If the slices differ in length.
    pub fn interval(&self, values: &[Option<f64>], unit_of: &[u32]) -> Option<[f64; 2]> {
        assert_eq!(values.len(), unit_of.len(), "one unit per value");
        let units = unit_of.iter().max().map_or(0, |&last| last as usize + 1);
        let mut sums = vec![(0.0, 0u32); units];
        for (value, &unit) in values.iter().zip(unit_of) {
            if let Some(value) = value {
                let (sum, count) = &mut sums[unit as usize];
                *sum += value;
                *count += 1;
            }
        }
        sums.retain(|&(_, count)| count > 0);
        self.interval_of(sums.len(), |drawn| {
            let (mut total, mut count) = (0.0, 0u64);
            for &unit in drawn {
                let (sum, n) = sums[unit];
                total += sum;
                count += u64::from(n);
            }
            Some(total / count as f64)
        })
    }

    /// Interval of anything that can be computed of units that are drawn, given by their numbers
    /// below `units`, with replacement.
    ///
    /// Resamples of which it cannot be computed are left out; `None` if that is half of them or
    /// more, or with fewer than two units.
    pub fn interval_of(
        &self,
        units: usize,
        statistic: impl Fn(&[usize]) -> Option<f64>,
    ) -> Option<[f64; 2]> {
        if units < 2 {
            return None;
        }
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        let mut drawn = vec![0; units];
        let mut found: Vec<f64> = Vec::with_capacity(self.resamples);
        for _ in 0..self.resamples {
            drawn.fill_with(|| draw(units, &mut random));
            found.extend(statistic(&drawn));
        }
        if 2 * found.len() <= self.resamples {
            return None;
        }
        Some(self.middle(&mut found))
    }

    /// Between which two the share [`Bootstrap::level`] of some values lies, as many below as above;
    /// changes their order.
    pub(crate) fn middle(&self, values: &mut [f64]) -> [f64; 2] {
        let tail = (1.0 - self.level) / 2.0;
        [tail, 1.0 - tail].map(|share| selected_quantile(values, share))
    }
}

/// Mean of what is there, and how many that are.
pub fn mean(values: &[Option<f64>]) -> (Option<f64>, u64) {
    let count = values.iter().flatten().count();
    let sum: f64 = values.iter().flatten().sum();
    ((count > 0).then(|| sum / count as f64), count as u64)
}

/// Units that have at least one value.
pub fn units_with_a_value(values: &[Option<f64>], unit_of: &[u32]) -> usize {
    let with_value = values.iter().zip(unit_of).filter(|(value, _)| value.is_some());
    with_value.map(|(_, unit)| unit).collect::<std::collections::BTreeSet<_>>().len()
}

/// A number below `units`, all alike.
pub(crate) fn draw(units: usize, random: &mut ChaCha8Rng) -> usize {
    // Multiply-shift rather than a library's range: its stream may change with its version.
    ((u128::from(random.next_u64()) * units as u128) >> 64) as usize
}
