//! Ranks, mixtures and steering measures against scipy, scikit-learn and numpy.
//!
//! `tests/peers/offline_metrics.py` made the fixture.
#![allow(clippy::unwrap_used)]

use std::{fs, path::Path};

use pmp::eval::{
    offline::{
        measures::{self, BINS},
        mixture_errors::CENTRAL_SHARES,
        pedals::{Onset, Pedal, brake_onsets},
        steering::{Steering, WINDOW, steer_way_m},
    },
    statistics::{
        Bootstrap,
        mixture::{Normal, cdf, central_width, crps, quantile},
        rank::{self, auroc, ranks, spearman},
    },
};
use proptest::prelude::*;
use serde_json::Value;

fn fixture() -> Value {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/offline_metrics.json");
    serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap()
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
}

fn near(a: f64, b: &Value, within: f64) {
    let b = b.as_f64().unwrap();
    assert!((a - b).abs() <= within * b.abs().max(1.0), "{a} is not {b}");
}

fn mixture_of(case: &Value) -> Vec<Normal> {
    let [weights, means, stds] = ["weights", "means", "stds"].map(|key| numbers(&case[key]));
    let normals = weights.into_iter().zip(means).zip(stds);
    normals.map(|((weight, mean), std)| Normal { weight, mean, std }).collect()
}

#[test]
fn mixtures_are_those_of_scipy() {
    let fixture = fixture();
    for case in fixture["mixtures"].as_array().unwrap() {
        let (mixture, x) = (mixture_of(case), case["x"].as_f64().unwrap());
        near(cdf(&mixture, x), &case["cdf"], 1e-12);
        // scipy integrates numerically.
        near(crps(&mixture, x), &case["crps"], 1e-8);
        let quantiles = case["quantiles"].as_array().unwrap();
        for pair in quantiles {
            near(quantile(&mixture, pair[0].as_f64().unwrap()), &pair[1], 1e-7);
        }
        let at = |i: usize| quantiles[i][1].as_f64().unwrap();
        for (share, width) in
            CENTRAL_SHARES.into_iter().zip([at(4) - at(2), at(5) - at(1), at(6) - at(0)])
        {
            assert!((central_width(&mixture, share) - width).abs() < 1e-6);
        }
    }
}

#[test]
fn ranks_are_those_of_scipy_and_scikit_learn() {
    let fixture = fixture();
    for case in fixture["ranked"].as_array().unwrap() {
        let pairs: Vec<[f64; 2]> = case["pairs"]
            .as_array()
            .unwrap()
            .iter()
            .map(|p| numbers(p).try_into().unwrap())
            .collect();
        let first: Vec<f64> = pairs.iter().map(|pair| pair[0]).collect();
        assert_eq!(ranks(&first), numbers(&case["ranks"]));
        near(spearman(&pairs).unwrap(), &case["spearman"], 1e-12);
        near(measures::auroc_of_worst_tenth(&pairs).unwrap(), &case["auroc"], 1e-12);
        let mut second: Vec<f64> = pairs.iter().map(|pair| pair[1]).collect();
        second.sort_by(f64::total_cmp);
        near(rank::quantile(&second, 0.9), &case["quantile_90"], 1e-12);
    }
}

#[test]
fn ranks_of_nothing_and_of_sameness_say_nothing() {
    assert_eq!(ranks(&[]), [] as [f64; 0]);
    assert_eq!(spearman(&[[1.0, 2.0]]), None);
    assert_eq!(spearman(&[[1.0, 2.0], [1.0, 3.0]]), None, "one side is always the same");
    assert_eq!(spearman(&[[1.0, 2.0], [5.0, 3.0], [9.0, 4.0]]), Some(1.0));
    assert_eq!(auroc(&[(1.0, true), (2.0, true)]), None, "no other");
    assert_eq!(auroc(&[(1.0, false), (2.0, true)]), Some(1.0));
    assert_eq!(auroc(&[(2.0, false), (2.0, true)]), Some(0.5));
    assert_eq!(measures::auroc_of_worst_tenth(&[]), None);
}

#[test]
fn calibration_is_that_of_numpy_and_scipy() {
    let case = &fixture()["uniforms"];
    let mut counts = [0.0; BINS];
    for value in numbers(&case["values"]) {
        counts[measures::bin(value as f32)] += 1.0;
    }
    near(measures::calibration_error(&counts), &case["ece"], 1e-12);
    near(measures::greatest_deviation(&counts), &case["ks_on_grid"], 1e-12);
    // The exact distance looks between the hundredths as well.
    let exact = case["ks"].as_f64().unwrap();
    assert!((measures::greatest_deviation(&counts) - exact).abs() <= 0.01 + 1e-9, "{exact}");
}

#[test]
fn steering_measures_are_those_of_numpy() {
    let fixture = fixture();
    let case = &fixture["steering"];
    let [planned, recorded, speed] =
        ["planned", "recorded", "speed_mps"].map(|key| numbers(&case[key]));
    let frames: Vec<Steering> = (0..planned.len())
        .map(|i| Steering { planned: planned[i], recorded: recorded[i], speed_mps: speed[i] })
        .collect();
    let mean =
        |of: &dyn Fn(&Steering) -> f64| frames.iter().map(of).sum::<f64>() / frames.len() as f64;
    near(mean(&|s| s.l1()), &case["steer_l1"], 1e-12);
    near(mean(&|s| s.speed_weighted_mps()), &case["steer_speed_weighted"], 1e-12);
    near(mean(&|s| f64::from(u8::from(s.is_other_class()))), &case["steer_class_error"], 1e-12);
    near(
        mean(&|s| f64::from(u8::from(s.is_beyond_tolerance()))),
        &case["steer_relative_error"],
        1e-12,
    );
    let mut ways = steer_way_m(&frames.iter().copied().map(Some).collect::<Vec<_>>());
    assert!(ways.drain(..WINDOW - 1).all(|way| way.is_none()), "the window is not full");
    let ways: Vec<f64> = ways.into_iter().map(Option::unwrap).collect();
    near(ways.iter().sum::<f64>() / ways.len() as f64, &case["steer_cumulative"], 1e-12);
}

#[test]
fn brake_events_are_those_of_scikit_learn() {
    let fixture = fixture();
    let case = &fixture["steering"];
    let [planned, recorded] = ["planned_brake", "recorded_brake"].map(|key| numbers(&case[key]));
    let mut sums = [[0.0; 2]; 3];
    for (planned, recorded) in planned.into_iter().zip(recorded) {
        let event = measures::event(Some(Pedal::of(planned as f32, recorded as f32))).unwrap();
        for (sum, part) in sums.iter_mut().zip([event.precision(), event.recall(), event.f1()]) {
            (sum[0], sum[1]) = (sum[0] + part[0], sum[1] + part[1]);
        }
    }
    for ([part, whole], key) in
        sums.into_iter().zip(["brake_precision", "brake_recall", "brake_f1"])
    {
        near(part / whole, &case[key], 1e-12);
    }
}

#[test]
fn window_with_a_gap_has_no_way() {
    let frame = Steering { planned: 0.1, recorded: 0.0, speed_mps: -10.0 };
    let mut stretch = vec![Some(frame); 3 * WINDOW];
    stretch[WINDOW] = None;
    let ways = steer_way_m(&stretch);
    let there: Vec<usize> = (0..ways.len()).filter(|i| ways[*i].is_some()).collect();
    assert_eq!(there, [vec![WINDOW - 1], (2 * WINDOW..3 * WINDOW).collect()].concat());
    // 16 frames of 0.1 x 10 m/s x 0.1 s.
    assert!((ways[WINDOW - 1].unwrap() - 1.6).abs() < 1e-12);
}

/// `.` neither brakes, `p` the plan does, `r` the recorded driver, `b` both, `x` unknown.
fn onsets(frames: &str) -> Vec<(usize, Option<f64>)> {
    let stretch: Vec<Option<Pedal>> = frames
        .chars()
        .map(|c| {
            let pedal = Pedal { planned: "pb".contains(c), recorded: "rb".contains(c) };
            (c != 'x').then_some(pedal)
        })
        .collect();
    let stamps_s: Vec<f64> = (0..stretch.len()).map(|i| i as f64 * 0.5).collect();
    let onsets = brake_onsets(&stretch, &stamps_s).into_iter().enumerate();
    onsets.filter_map(|(i, onset)| onset.map(|Onset { late_s }| (i, late_s))).collect()
}

#[test]
fn beginnings_to_brake_are_matched_with_the_nearest() {
    assert_eq!(onsets("..rrr"), [(2, None)], "it never brakes");
    assert_eq!(onsets("..bbb"), [(2, Some(0.0))]);
    assert_eq!(onsets("..rrb"), [(2, Some(1.0))]);
    assert_eq!(onsets(".ppbb"), [(3, Some(-1.0))]);
    assert_eq!(onsets(".p..rb"), [(4, Some(0.5))], "the nearer one of two");
    assert_eq!(onsets(".ppppppppppb"), [(11, Some(-3.0))], "for longer than 3 s");
    assert_eq!(onsets(".p.......r"), [(9, None)], "4 s ago and over");
    assert_eq!(onsets("rr..ppp"), [], "who brakes at once began before");
    assert_eq!(onsets(".xr.r"), [(4, None)], "nobody knows when");
    assert_eq!(onsets("..r..r.b"), [(2, Some(2.5)), (5, Some(1.0)), (7, Some(0.0))]);
}

#[test]
fn interval_of_a_share_is_the_binomial_one() {
    // As in the test of means: 100 units, half of them hits.
    let interval = Bootstrap::default().interval_of(100, |drawn| {
        Some(drawn.iter().filter(|unit| **unit < 50).count() as f64 / drawn.len() as f64)
    });
    let [low, high] = interval.unwrap();
    assert!((low - 0.40).abs() < 0.011 && (high - 0.60).abs() < 0.011, "{low} {high}");
    assert_eq!(Bootstrap::default().interval_of(1, |_| Some(1.0)), None, "one unit");
    let never = |_: &[usize]| None;
    assert_eq!(Bootstrap::default().interval_of(9, never), None);
}

proptest! {
    #[test]
    fn score_of_a_sure_forecast_is_its_absolute_error(mean in -9.0f64..9.0, x in -9.0f64..9.0) {
        let mixture = [Normal { weight: 1.0, mean, std: 1e-9 }];
        prop_assert!((crps(&mixture, x) - (x - mean).abs()).abs() < 1e-8);
    }

    #[test]
    fn quantile_and_distribution_are_each_others_inverse(
        share in 0.01f64..0.99, weight in 0.05f64..0.95, means in prop::array::uniform2(-5.0f64..5.0),
        stds in prop::array::uniform2(0.1f64..3.0),
    ) {
        let normal = |weight, i: usize| Normal { weight, mean: means[i], std: stds[i] };
        let mixture = [normal(weight, 0), normal(1.0 - weight, 1)];
        prop_assert!((cdf(&mixture, quantile(&mixture, share)) - share).abs() < 1e-6);
    }

    #[test]
    fn order_of_ranks_is_kept_by_what_keeps_the_order(values in prop::collection::vec(-3.0f64..3.0, 3..40)) {
        let pairs: Vec<[f64; 2]> = values.iter().map(|v| [*v, v.exp()]).collect();
        if let Some(correlation) = spearman(&pairs) {
            prop_assert!((correlation - 1.0).abs() < 1e-12);
        }
        let sum: f64 = ranks(&values).iter().sum();
        let n = values.len() as f64;
        prop_assert!((sum - n * (n + 1.0) / 2.0).abs() < 1e-9);
    }
}
