//! Ranks: whether what is large in one number is large in another.

/// Rank of every value from 1; equal values share the mean of their ranks.
pub fn ranks(values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
    let mut ranks = vec![0.0; values.len()];
    for equal in order.chunk_by(|&a, &b| values[a] == values[b]) {
        // Ascending, so the first of a run is the only one that can tell where it stands.
        let before = order.partition_point(|&i| values[i] < values[equal[0]]);
        let shared = before as f64 + (equal.len() + 1) as f64 / 2.0;
        equal.iter().for_each(|&i| ranks[i] = shared);
    }
    ranks
}

/// Spearman's correlation of pairs, in [-1, 1]: Pearson's of their ranks.
///
/// `None` of fewer than two pairs, and where one side is always the same.
pub fn spearman(pairs: &[[f64; 2]]) -> Option<f64> {
    let side = |i: usize| ranks(&pairs.iter().map(|pair| pair[i]).collect::<Vec<_>>());
    let (a, b) = (side(0), side(1));
    let middle = (pairs.len() as f64 + 1.0) / 2.0; // the mean of any ranks
    let product = |a: &[f64], b: &[f64]| -> f64 {
        a.iter().zip(b).map(|(a, b)| (a - middle) * (b - middle)).sum()
    };
    let spread = (product(&a, &a) * product(&b, &b)).sqrt();
    (spread > 0.0).then(|| product(&a, &b) / spread)
}

/// How well a score tells cases from others: the share of pairs of one each in which the case has
/// the higher score, equal scores counting half. 0.5 is chance.
///
/// `None` without a case or without another. Mann and Whitney's U by ranks.
pub fn auroc(scored: &[(f64, bool)]) -> Option<f64> {
    let ranks = ranks(&scored.iter().map(|(score, _)| *score).collect::<Vec<_>>());
    let cases = scored.iter().filter(|(_, case)| *case).count() as f64;
    let others = scored.len() as f64 - cases;
    let of_cases = ranks.iter().zip(scored).filter(|(_, (_, case))| *case);
    let sum: f64 = of_cases.map(|(rank, _)| rank).sum();
    let pairs = cases * others;
    (pairs > 0.0).then(|| (sum - cases * (cases + 1.0) / 2.0) / pairs)
}

/// The value below which that share of ascending values lies, linear between the two nearest.
///
/// # Panics
///
/// If there are none.
pub fn quantile(ascending: &[f64], share: f64) -> f64 {
    let at = share * (ascending.len() - 1) as f64;
    let (low, high) = (ascending[at.floor() as usize], ascending[at.ceil() as usize]);
    low + (high - low) * at.fract()
}

/// [`quantile`] of values in any order, which it changes: to sort them all would take most of the time
/// of a table.
pub fn selected_quantile(values: &mut [f64], share: f64) -> f64 {
    let at = share * (values.len() - 1) as f64;
    let (_, &mut low, above) = values.select_nth_unstable_by(at as usize, f64::total_cmp);
    match above.iter().copied().min_by(f64::total_cmp) {
        Some(high) if at.fract() > 0.0 => low + (high - low) * at.fract(),
        _ => low,
    }
}
