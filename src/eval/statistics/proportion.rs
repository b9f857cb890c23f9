//! k of n: how far such a share can be trusted, and whether two differ.

/// The standard normal's 97.5 % quantile: intervals are of 95 %.
const Z: f64 = 1.959_963_984_540_054;

/// Tables that are as likely as the observed one but for rounding count as such (R's
/// `fisher.test` has the same bound).
const AS_LIKELY: f64 = 1.0 + 1e-7;

/// Wilson's 95 % interval of a share of `k` in `n`, as shares in [0, 1]; `None` of nothing.
///
/// Wilson, Probable inference, the law of succession, and statistical inference (1927). Unlike the
/// textbook's, it neither leaves [0, 1] nor shrinks to a point at 0 of n and n of n.
pub fn wilson(k: u64, n: u64) -> Option<[f64; 2]> {
    if n == 0 {
        return None;
    }
    let share = k as f64 / n as f64;
    let n = n as f64;
    let middle = share + Z * Z / (2.0 * n);
    let half = Z * (share * (1.0 - share) / n + Z * Z / (4.0 * n * n)).sqrt();
    let [low, high] = [middle - half, middle + half].map(|end| end / (1.0 + Z * Z / n));
    // Exact where rounding would leave a trace.
    Some([if share == 0.0 { 0.0 } else { low }, if share == 1.0 { 1.0 } else { high }])
}

/// Fisher's exact test, two-sided: how likely two shares `[k, n]` are at least as unequal as these if
/// both are of the same chance. For systems that did not drive the same episodes.
pub fn fisher_exact(first: [u64; 2], second: [u64; 2]) -> f64 {
    let ([k, n], [other_k, m]) = (first, second);
    let hits = k + other_k;
    let likelihood = |k: u64| {
        let ln = ln_choose(n, k) + ln_choose(m, hits - k) - ln_choose(n + m, hits);
        ln.exp()
    };
    let bound = likelihood(k) * AS_LIKELY;
    let tables = hits.saturating_sub(m)..=hits.min(n);
    tables.map(likelihood).filter(|&l| l <= bound).sum::<f64>().min(1.0)
}

/// The logarithm of `n` choose `k`.
pub(crate) fn ln_choose(n: u64, k: u64) -> f64 {
    let ln_factorial = |n: u64| libm::lgamma(n as f64 + 1.0);
    ln_factorial(n) - ln_factorial(k) - ln_factorial(n - k)
}
