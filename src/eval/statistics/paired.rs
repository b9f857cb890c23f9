//! Two systems on the same episodes, and many such comparisons at once.

use crate::eval::statistics::proportion::ln_choose;

/// McNemar's exact test, two-sided: how likely so unequal numbers are if neither system is better.
///
/// Episodes that both won or both lost say nothing; of the others, `only_first` were won by the
/// first system alone and `only_second` by the second. A fair coin would part them as far in that
/// share of cases; 1 if there are none.
pub fn mcnemar_exact(only_first: u64, only_second: u64) -> f64 {
    let n = only_first + only_second;
    let likelihood = |k: u64| (ln_choose(n, k) - n as f64 * std::f64::consts::LN_2).exp();
    let tail: f64 = (0..=only_first.min(only_second)).map(likelihood).sum();
    (2.0 * tail).min(1.0)
}

/// Holm's correction: the same tests' p-values, in their order, such that the chance of any false
/// claim among all that are below 0.05 is below 0.05.
///
/// Holm, A simple sequentially rejective multiple test procedure (1979).
pub fn holm(p: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..p.len()).collect();
    order.sort_by(|&a, &b| p[a].total_cmp(&p[b]));
    let mut corrected = vec![0.0; p.len()];
    let mut least = 0.0f64;
    for (done, &i) in order.iter().enumerate() {
        least = least.max(p[i] * (p.len() - done) as f64).min(1.0);
        corrected[i] = least;
    }
    corrected
}
