//! How values are spread, counted in even bins: quantiles in fixed memory.

use serde::{Deserialize, Serialize};

/// Counts of values from 0 up, by bins of one width; the last bin has all that is larger.
#[derive(Clone, Debug, PartialEq)]
pub struct Spread {
    width: f64,
    counts: Vec<u64>,
}

/// Quantiles of a [`Spread`], in its unit, exact to the width of a bin.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Quantiles {
    pub count: u64,
    pub p05: f64,
    pub median: f64,
    pub p95: f64,
}

impl Spread {
    /// Bins of `width` up to `most`.
    pub fn new(width: f64, most: f64) -> Spread {
        Spread { width, counts: vec![0; (most / width).ceil() as usize] }
    }

    /// Count a value; what is below 0 counts as 0.
    pub fn add(&mut self, value: f64) {
        let last = self.counts.len() - 1;
        self.counts[((value / self.width).max(0.0) as usize).min(last)] += 1;
    }

    /// The quantiles, by straight lines within bins; `None` of no values.
    pub fn quantiles(&self) -> Option<Quantiles> {
        let count: u64 = self.counts.iter().sum();
        let at = |share: f64| {
            let wanted = share * count as f64;
            let mut below = 0.0;
            for (bin, &here) in self.counts.iter().enumerate() {
                let here = here as f64;
                if here > 0.0 && below + here >= wanted {
                    return (bin as f64 + (wanted - below) / here) * self.width;
                }
                below += here;
            }
            self.counts.len() as f64 * self.width
        };
        (count > 0).then(|| Quantiles { count, p05: at(0.05), median: at(0.5), p95: at(0.95) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Held against the sorted values themselves.
        #[test]
        fn quantiles_are_those_of_the_values(mut values in prop::collection::vec(0.0..9.9_f64, 1..200)) {
            let mut spread = Spread::new(0.1, 10.0);
            values.iter().for_each(|value| spread.add(*value));
            values.sort_by(f64::total_cmp);
            let quantiles = spread.quantiles().unwrap();
            prop_assert_eq!(quantiles.count, values.len() as u64);
            for (share, found) in [(0.05, quantiles.p05), (0.5, quantiles.median), (0.95, quantiles.p95)] {
                let rank = (share * values.len() as f64).ceil().max(1.0) as usize - 1;
                prop_assert!((values[rank] - found).abs() <= 0.1 + 1e-9, "{} and {}", values[rank], found);
            }
        }
    }

    #[test]
    fn no_values_have_no_quantiles_and_large_ones_are_in_the_last_bin() {
        let mut spread = Spread::new(0.5, 2.0);
        assert_eq!(spread.quantiles(), None);
        spread.add(1e9);
        assert!(spread.quantiles().unwrap().median > 1.5);
    }
}
