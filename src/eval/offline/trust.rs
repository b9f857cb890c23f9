//! Whether a policy knows how sure it may be: its mixtures and its variance against what came.

use crate::{
    eval::{
        offline::{
            errors::Row,
            report::{Grid, Lambda, Pit, Tenth, Variance},
        },
        statistics::rank::quantile,
    },
    frame::FUTURE_STEPS,
};

/// Parts of [0, 1] in a histogram of the probability integral transform.
const PIT_BINS: usize = 20;

/// Groups of steps: the first, second and third second.
const PIT_GROUPS: usize = 3;

/// Cells of the grid of variance and error, each way.
const CELLS: usize = 24;

/// The least displacement that is told from none, m: of float noise, not of driving.
const LEAST_M: f64 = 1e-3;

/// Histograms of where what was recorded lay in what was planned; `None` without mixtures.
pub fn pit(rows: &[Row]) -> Option<Pit> {
    let mut counts = [(); 2].map(|()| vec![vec![0u64; PIT_BINS]; PIT_GROUPS]);
    let mut any = false;
    for mixture in rows.iter().filter_map(|row| row.errors.mixture.as_ref()) {
        any = true;
        for (counts, numbers) in counts.iter_mut().zip(&mixture.pit) {
            for (group, seconds) in numbers.chunks(FUTURE_STEPS / PIT_GROUPS).enumerate() {
                for u in seconds {
                    let bin = (f64::from(*u) * PIT_BINS as f64) as usize;
                    counts[group][bin.min(PIT_BINS - 1)] += 1;
                }
            }
        }
    }
    let [speed, yaw] = counts;
    any.then_some(Pit { speed, yaw })
}

/// S against the displacement at the target; `None` where no frame has both.
pub fn variance(rows: &[Row]) -> Option<Variance> {
    let pair = |row: &Row| Some([row.errors.variance?, row.errors.target_m?]);
    let mut pairs: Vec<[f64; 2]> = rows.iter().filter_map(pair).collect();
    pairs.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let s: Vec<f64> = pairs.iter().map(|pair| pair[0]).collect();
    if pairs.is_empty() {
        return None;
    }
    Some(Variance {
        frames: pairs.len() as u64,
        s_median: quantile(&s, 0.5),
        s_q95: quantile(&s, 0.95),
        tenths: tenths(&pairs),
        grid: grid(&pairs),
        lambda: lambda(rows),
    })
}

/// Ten parts of one size of pairs of ascending S; fewer of fewer pairs.
fn tenths(pairs: &[[f64; 2]]) -> Vec<Tenth> {
    let border = |i: usize| i * pairs.len() / 10;
    let parts = (0..10).map(|i| &pairs[border(i)..border(i + 1)]);
    let tenth = |part: &[[f64; 2]]| {
        let mut errors: Vec<f64> = part.iter().map(|pair| pair[1]).collect();
        errors.sort_by(f64::total_cmp);
        Tenth {
            frames: part.len() as u64,
            s: quantile(&part.iter().map(|pair| pair[0]).collect::<Vec<_>>(), 0.5),
            median_m: quantile(&errors, 0.5),
            q90_m: quantile(&errors, 0.9),
        }
    };
    parts.filter(|part| !part.is_empty()).map(tenth).collect()
}

fn grid(pairs: &[[f64; 2]]) -> Grid {
    let log = |i: usize, least: f64| pairs.iter().map(move |pair| pair[i].max(least).log10());
    let (s, errors): (Vec<f64>, Vec<f64>) =
        (log(0, f64::MIN_POSITIVE).collect(), log(1, LEAST_M).collect());
    let range = |values: &[f64]| {
        let mut sorted = values.to_vec();
        sorted.sort_by(f64::total_cmp);
        let [low, high] = [quantile(&sorted, 0.01), quantile(&sorted, 0.99)];
        if high > low { [low, high] } else { [low - 0.5, low + 0.5] }
    };
    let (s_range, error_range) = (range(&s), range(&errors));
    let cell = |value: f64, [low, high]: [f64; 2]| {
        let at = (value - low) / (high - low) * CELLS as f64;
        (at.max(0.0) as usize).min(CELLS - 1)
    };
    let mut counts = vec![vec![0; CELLS]; CELLS];
    for (s, error) in s.iter().zip(&errors) {
        counts[cell(*error, error_range)][cell(*s, s_range)] += 1;
    }
    Grid { log10_s: s_range, log10_error_m: error_range, counts }
}

fn lambda(rows: &[Row]) -> Option<Lambda> {
    let lambdas: Vec<f64> = rows.iter().filter_map(|row| row.errors.lambda).collect();
    let share = |is: fn(f64) -> bool| {
        lambdas.iter().filter(|lambda| is(**lambda)).count() as f64 / lambdas.len() as f64
    };
    let mut counts = vec![0; 10];
    lambdas.iter().for_each(|lambda| counts[((lambda * 10.0) as usize).min(9)] += 1);
    (!lambdas.is_empty()).then(|| Lambda {
        frames: lambdas.len() as u64,
        mean: lambdas.iter().sum::<f64>() / lambdas.len() as f64,
        above_099: share(|lambda| lambda > 0.99),
        below_05: share(|lambda| lambda < 0.5),
        counts,
    })
}
