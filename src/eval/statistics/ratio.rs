//! Ratios of sums over units, as time in a wrong lane by time driven, with bootstrap intervals.
//!
//! A unit is an episode, and all ratios of one call are taken over the same resamples. A mean is a
//! ratio too: what is averaged, by 1.

use rand_chacha::{ChaCha8Rng, rand_core::SeedableRng as _};

use crate::eval::statistics::bootstrap::{Bootstrap, draw};

/// What a unit adds to a ratio's numerator and denominator; `None` if it has no part in it.
pub type Term = Option<[f64; 2]>;

/// The sum of the numerators by that of the denominators; `None` if that is 0.
pub fn ratio(terms: impl IntoIterator<Item = Term>) -> Option<f64> {
    let add = |sum: [f64; 2], term: [f64; 2]| [sum[0] + term[0], sum[1] + term[1]];
    let [above, below] = terms.into_iter().flatten().fold([0.0; 2], add);
    (below != 0.0).then(|| above / below)
}

impl Bootstrap {
    /// Intervals of ratios; `groups` of units, each unit with one term per ratio.
    ///
    /// With one group, units are drawn. With several (one model trained from several seeds),
    /// groups are drawn first and then units within each, so that the interval speaks of other
    /// seeds too. A resample in which a ratio has no denominator does not count for it. `None`
    /// for a ratio that fewer than two units have a part in, whose end is not finite, or that is
    /// the same in all resamples: what no unit shows, a bootstrap cannot see.
    pub fn ratios(&self, groups: &[Vec<Vec<Term>>]) -> Vec<Option<[f64; 2]>> {
        self.of_sums(groups, |sums| sums.iter().map(|[above, below]| above / below).collect())
    }

    /// Intervals of differences of ratios, the first system's less the second's, over units that
    /// both have: each with the terms of the first and then, as many, those of the second.
    pub fn ratio_differences(&self, units: Vec<Vec<Term>>) -> Vec<Option<[f64; 2]>> {
        self.of_sums(&[units], |sums| {
            let (first, second) = sums.split_at(sums.len() / 2);
            let pairs = first.iter().zip(second);
            pairs.map(|(first, second)| first[0] / first[1] - second[0] / second[1]).collect()
        })
    }

    /// Intervals of values that come of the sums of each term over the drawn units. Value `i` comes
    /// of every `values.len()`-th term from the `i`-th on; two units must have each of these.
    fn of_sums(
        &self,
        groups: &[Vec<Vec<Term>>],
        values: impl Fn(&[[f64; 2]]) -> Vec<f64>,
    ) -> Vec<Option<[f64; 2]>> {
        let width = groups.iter().flatten().map(Vec::len).next().unwrap_or(0);
        let mut sums = vec![[0.0; 2]; width];
        let count = values(&sums).len();
        let units_with = |term: usize| {
            groups.iter().flatten().filter(|unit| unit[term].is_some()).take(2).count()
        };
        let enough: Vec<bool> = (0..count)
            .map(|i| (i..width).step_by(count).all(|term| units_with(term) == 2))
            .collect();
        let groups: Vec<Vec<Vec<[f64; 2]>>> = groups
            .iter()
            .filter(|units| !units.is_empty())
            .map(|units| units.iter().map(|unit| unit.iter().map(or_nothing).collect()).collect())
            .collect();
        if !enough.contains(&true) {
            return vec![None; count];
        }
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        let mut resampled = vec![Vec::new(); count];
        for _ in 0..self.resamples {
            sums.fill([0.0; 2]);
            for _ in 0..groups.len() {
                // With one group, nothing is drawn to choose it.
                let chosen = if groups.len() == 1 { 0 } else { draw(groups.len(), &mut random) };
                let units = &groups[chosen];
                for _ in 0..units.len() {
                    for (sum, term) in sums.iter_mut().zip(&units[draw(units.len(), &mut random)]) {
                        sum[0] += term[0];
                        sum[1] += term[1];
                    }
                }
            }
            for ((found, value), enough) in resampled.iter_mut().zip(values(&sums)).zip(&enough) {
                if *enough && !value.is_nan() {
                    found.push(value);
                }
            }
        }
        resampled.iter_mut().map(|found| self.telling(found)).collect()
    }

    /// The middle of some values; `None` if they are all the same, or an end of it is not finite.
    fn telling(&self, values: &mut [f64]) -> Option<[f64; 2]> {
        let first = *values.first()?;
        if values.iter().all(|value| *value == first) {
            return None;
        }
        let ends = self.middle(values);
        (ends[0] < ends[1] && ends.iter().all(|end| end.is_finite())).then_some(ends)
    }
}

fn or_nothing(term: &Term) -> [f64; 2] {
    term.unwrap_or_default()
}
