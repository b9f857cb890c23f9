//! Intervals and tests against scipy's and statsmodels'.
//!
//! `tests/peers/statistics_peers.py` makes the fixture.

use std::{fs, path::Path};

use pmp::eval::statistics::{
    Bootstrap,
    paired::{holm, mcnemar_exact},
    proportion::{fisher_exact, wilson},
    ratio::{Term, ratio},
};
use serde::Deserialize;

#[derive(Deserialize)]
struct Fixture {
    wilson: Vec<(u64, u64, f64, f64)>,
    fisher: Vec<(u64, u64, u64, u64, f64)>,
    mcnemar: Vec<(u64, u64, f64)>,
    holm: Vec<(Vec<f64>, Vec<f64>)>,
    bootstrap: Resampled,
}

#[derive(Deserialize)]
struct Resampled {
    first: Vec<[f64; 2]>,
    second: Vec<[f64; 2]>,
    ratio: [f64; 2],
    difference: [f64; 2],
}

fn fixture() -> Fixture {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/statistics.json");
    serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap()
}

#[track_caller]
fn near(ours: f64, theirs: f64, what: &str) {
    let off = (ours - theirs).abs();
    assert!(off <= 1e-9 * theirs.abs() || off < 1e-15, "{what}: {ours}, theirs {theirs}");
}

#[test]
fn shares_have_the_intervals_of_statsmodels() {
    let cases = fixture().wilson;
    assert!(cases.len() > 10);
    for (k, n, low, high) in cases {
        let ours = wilson(k, n).unwrap();
        near(ours[0], low, &format!("{k}/{n} low"));
        near(ours[1], high, &format!("{k}/{n} high"));
        assert!(0.0 <= ours[0] && ours[0] < ours[1] && ours[1] <= 1.0);
    }
    assert_eq!(wilson(0, 0), None);
    assert_eq!(wilson(0, 18).unwrap()[0], 0.0);
    assert_eq!(wilson(18, 18).unwrap()[1], 1.0);
}

#[test]
fn tests_have_the_p_values_of_scipy_and_statsmodels() {
    let fixture = fixture();
    assert!(fixture.fisher.len() > 8 && fixture.mcnemar.len() > 8 && fixture.holm.len() > 4);
    for (k, n, other, m, p) in fixture.fisher {
        near(fisher_exact([k, n], [other, m]), p, &format!("fisher {k}/{n}, {other}/{m}"));
        near(fisher_exact([other, m], [k, n]), p, "fisher the other way");
    }
    for (first, second, p) in fixture.mcnemar {
        near(mcnemar_exact(first, second), p, &format!("mcnemar {first}, {second}"));
        near(mcnemar_exact(second, first), p, "mcnemar the other way");
    }
    for (p, corrected) in fixture.holm {
        let ours = holm(&p);
        assert_eq!(ours.len(), corrected.len());
        ours.iter().zip(&corrected).for_each(|(ours, theirs)| near(*ours, *theirs, "holm"));
    }
}

fn units(rows: &[[f64; 2]]) -> Vec<Vec<Term>> {
    rows.iter().map(|&row| vec![Some(row)]).collect()
}

/// Ends agree but for chance: theirs come of 200,000 resamples, ours of 50,000.
#[track_caller]
fn about(ours: Option<[f64; 2]>, theirs: [f64; 2]) {
    let ours = ours.unwrap();
    let width = theirs[1] - theirs[0];
    for (ours, theirs) in ours.iter().zip(theirs) {
        assert!((ours - theirs).abs() < 0.02 * width, "{ours}, theirs {theirs}");
    }
}

#[test]
fn ratios_have_the_bootstrap_of_scipy() {
    let Resampled { first, second, ratio: of_ratio, difference } = fixture().bootstrap;
    let bootstrap = Bootstrap { resamples: 50_000, ..Bootstrap::default() };
    about(bootstrap.ratios(&[units(&first)])[0], of_ratio);
    let both = first.iter().zip(&second).map(|(&a, &b)| vec![Some(a), Some(b)]).collect();
    about(bootstrap.ratio_differences(both)[0], difference);
}

#[test]
fn a_ratio_without_units_has_no_interval_and_one_unit_is_no_sample() {
    let bootstrap = Bootstrap { resamples: 100, ..Bootstrap::default() };
    assert_eq!(ratio([]), None);
    assert_eq!(ratio([Some([3.0, 0.0])]), None);
    assert_eq!(ratio([Some([1.0, 4.0]), None, Some([2.0, 2.0])]), Some(0.5));
    let one = vec![vec![Some([1.0, 2.0]), None], vec![None, None], vec![None, Some([1.0, 0.0])]];
    assert_eq!(bootstrap.ratios(&[one]), [None, None]);
    // Without a denominator in some resample, the way between failures has no upper end.
    let failures = vec![vec![Some([1.0, 1.0])], vec![Some([1.0, 0.0])], vec![Some([1.0, 0.0])]];
    assert_eq!(bootstrap.ratios(&[failures]), [None]);
}

#[test]
fn seeds_that_differ_make_a_wider_interval_than_their_episodes_together() {
    let bootstrap = Bootstrap { resamples: 2_000, ..Bootstrap::default() };
    let won = |k: usize| -> Vec<Vec<Term>> {
        (0..54).map(|i| vec![Some([if i < k { 1.0 } else { 0.0 }, 1.0])]).collect()
    };
    let seeds = [won(10), won(50), won(48)];
    let together = bootstrap.ratios(&[seeds.concat()])[0].unwrap();
    let by_seed = bootstrap.ratios(&seeds)[0].unwrap();
    assert!(by_seed[0] < together[0] - 0.1 && by_seed[1] > together[1], "{by_seed:?} {together:?}");
}
