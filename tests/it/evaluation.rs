//! The offline evaluation's numbers, against closed forms and slow second implementations.
#![allow(clippy::unwrap_used)]

use std::f64::consts::{PI, TAU};

use pmp::{
    error::Result,
    eval::{
        baseline::{self, baseline},
        offline::{
            definitions::{CURVES, METRICS, metric},
            errors::{Errors, Row},
            evaluate::evaluate,
            horizons::{WHOLE_SECONDS, wrapped_rad},
            metrics::FrameErrors,
            mixture_errors as mixtures,
        },
        statistics::Bootstrap,
    },
    frame::{
        Command, Conditions, FUTURE_STEPS, Frame, Future, ROUTE_POINTS, RecordedAction, Route,
        RouteSource, Skew, signed_speed_mps,
    },
    policy::{Action, Mode, ModeStd, Plan, Policy},
};
use proptest::prelude::*;

/// A frame of a car that goes straight on with a constant acceleration from `speed_mps`.
pub(crate) fn accelerating(index: u32, speed_mps: f64, acceleration_mps2: f64) -> Frame {
    let mut future = Future::UNKNOWN;
    future.len = FUTURE_STEPS as u8;
    for i in 0..FUTURE_STEPS {
        let t = 0.1 * (i + 1) as f64;
        future.speed_mps[i] = (speed_mps + acceleration_mps2 * t) as f32;
        future.xy_m[2 * i] = (speed_mps * t + acceleration_mps2 * t * t / 2.0) as f32;
    }
    Frame {
        index,
        stamp_ns: 1_700_000_000_000_000_000 + i64::from(index) * 100_000_000,
        image: Vec::new(),
        lidar: None,
        radar: None,
        velocity_mps: [speed_mps as f32, 0.0],
        yaw_rad: 0.0,
        position_m: [0.0; 3],
        action: RecordedAction { steer: Some(0.25), throttle: Some(0.5), brake: None },
        route: Route {
            waypoints_m: [0.0; 2 * ROUTE_POINTS],
            len: ROUTE_POINTS as u8,
            source: RouteSource::Driven,
        },
        command: Command::Follow,
        future,
        skew: Skew::default(),
        conditions: Conditions::default(),
        in_junction: None,
        speed_limit_mps: None,
        perturbed: false,
    }
}

/// A policy that says the same at every frame.
struct Constant {
    name: String,
    plan: Plan,
}

impl Policy for Constant {
    fn name(&self) -> &str {
        &self.name
    }

    fn reset(&mut self) {}

    fn plan(&mut self, _: &Frame) -> Result<Plan> {
        Ok(self.plan.clone())
    }
}

/// One mode with the same speed, yaw and, if given, deviations at every step.
pub(crate) fn steady(weight: f32, speed_mps: f32, yaw_rad: f32, std: Option<[f32; 2]>) -> Mode {
    Mode {
        weight,
        speed_mps: [speed_mps; FUTURE_STEPS],
        yaw_rad: [yaw_rad; FUTURE_STEPS],
        std: std.map(|[speed, yaw]| ModeStd {
            speed_mps: [speed; FUTURE_STEPS],
            yaw_rad: [yaw; FUTURE_STEPS],
        }),
    }
}

fn errors_of(name: &str, frame: &Frame) -> FrameErrors {
    FrameErrors::of(&baseline(name).unwrap().plan(frame).unwrap(), frame)
}

fn near(a: Option<f64>, b: f64) {
    assert!((a.unwrap() - b).abs() < 1e-5, "{a:?} is not {b}");
}

#[test]
fn constant_velocity_is_off_by_the_closed_form_when_the_car_accelerates() {
    let errors = errors_of("constant-velocity", &accelerating(0, 8.0, 2.0));
    for (i, t) in [1.0, 2.0, 3.0].into_iter().enumerate() {
        let at = WHOLE_SECONDS[i];
        near(errors.speed_mps[at], -2.0 * t);
        near(errors.fde_m[at], 2.0 * t * t / 2.0);
        // Mean of a t^2 / 2 over t = 0.1 k, k = 1 ... n: a / 2 * 0.01 * (n + 1) (2 n + 1) / 6.
        let n = 10.0 * t;
        near(errors.ade_m[at], 2.0 / 2.0 * 0.01 * (n + 1.0) * (2.0 * n + 1.0) / 6.0);
    }
    near(errors.heading_rad[5], 0.0);
    near(errors.largest_m, 9.0);
    assert_eq!(errors.min_ade_m, errors.ade_m[5], "there is only one mode");
    assert_eq!(errors.min_fde_m, errors.fde_m[5], "there is only one mode");
    assert_eq!((errors.planned[0], &errors.mixture), (None, &None), "it claims neither");
}

#[test]
fn recorded_oracle_has_no_error_where_speed_and_yaw_say_everything() {
    let frame = accelerating(0, 3.0, -0.75);
    let errors = errors_of("recorded", &frame);
    for number in [errors.min_ade_m, errors.min_fde_m, errors.largest_m, errors.mean_heading_rad]
        .into_iter()
        .chain(errors.ade_m)
        .chain(errors.fde_m)
        .chain(errors.speed_mps)
    {
        near(number, 0.0);
    }
    let mut frames = Errors::default();
    frames.push_frame(0, &frame);
    let row = Row { frame: &frames.frames[0], errors: &errors };
    near(row.steering(0).map(|steering| steering.l1()), 0.0);
    assert_eq!(row.brake(0), None, "the log has no brake");
    assert!(baseline("recorded").unwrap().sees_the_future());
}

#[test]
fn recorded_oracle_keeps_the_displacement_that_speed_and_yaw_cannot_say() {
    // The same drive, but the body slides 0.2 m to the left with every second.
    let mut frame = accelerating(0, 10.0, 0.0);
    for i in 0..FUTURE_STEPS {
        frame.future.xy_m[2 * i + 1] = 0.02 * (i + 1) as f32;
    }
    let errors = errors_of("recorded", &frame);
    near(errors.fde_m[5], 0.6);
    near(errors.ade_m[5], 0.31);
    near(errors.speed_mps[5], 0.0);
}

#[test]
fn standing_still_is_off_by_the_way_driven() {
    let errors = errors_of("stand-still", &accelerating(0, 10.0, 0.0));
    // The first step still rolls out the speed of now by the trapezium rule: 10 / 2 * 0.1 m.
    near(errors.fde_m[5], 30.0 - 0.5);
    near(errors.speed_mps[1], -10.0);
    assert_eq!(errors.planned[0], Some(Action { steer: 0.0, throttle: 0.0, brake: 1.0 }));
}

#[test]
fn every_listed_baseline_exists_and_no_other() {
    for name in baseline::NAMES {
        assert_eq!(baseline(name).unwrap().name(), name);
    }
    assert!(baseline(baseline::REFERENCE).is_some());
    assert!(baseline("expert").is_none());
}

#[test]
fn reversing_keeps_its_sign() {
    assert_eq!(signed_speed_mps([-3.0, 4.0]), -5.0);
    let mut frame = accelerating(0, 2.0, 0.0);
    frame.velocity_mps = [-2.0, 0.0];
    frame.future.speed_mps = [-2.0; FUTURE_STEPS];
    let backwards = |x: f32| -x;
    frame.future.xy_m = frame.future.xy_m.map(backwards);
    let errors = errors_of("constant-velocity", &frame);
    near(errors.fde_m[5], 0.0);
    near(errors.speed_mps[5], 0.0);
}

#[test]
fn horizon_counts_only_frames_that_reach_it() {
    for (len, reached) in [(4, 0), (5, 1), (9, 1), (10, 2), (20, 4), (29, 5), (30, 6)] {
        let mut frame = accelerating(0, 5.0, 1.0);
        frame.future.len = len;
        let plan =
            Plan { motion: vec![steady(1.0, 5.0, 0.0, Some([1.0, 0.1]))], ..Plan::default() };
        let errors = FrameErrors::of(&plan, &frame);
        let some = |values: [Option<f64>; 6]| values.iter().flatten().count();
        assert_eq!(some(errors.speed_mps), reached, "{len} steps");
        assert_eq!((some(errors.ade_m), some(errors.fde_m)), (reached, reached), "{len} steps");
        assert_eq!(some(errors.heading_rad), reached, "{len} steps");
        let whole = [errors.min_ade_m, errors.min_fde_m, errors.largest_m, errors.mean_heading_rad];
        assert_eq!(whole.iter().flatten().count(), if reached == 6 { 4 } else { 0 });
        assert_eq!(errors.mixture.is_some(), reached == 6);
    }
}

#[test]
fn heading_error_goes_the_short_way_round() {
    let mut frame = accelerating(0, 5.0, 0.0);
    frame.future.yaw_rad = [3.0; FUTURE_STEPS];
    let plan = Plan { motion: vec![steady(1.0, 5.0, -3.0, None)], ..Plan::default() };
    let errors = FrameErrors::of(&plan, &frame);
    near(errors.heading_rad[5], TAU - 6.0);
    near(errors.mean_heading_rad, TAU - 6.0);
}

#[test]
fn strongest_mode_counts_but_for_min_ade() {
    let frame = accelerating(0, 5.0, 0.0);
    let motion = vec![steady(0.25, 5.0, 0.0, None), steady(0.75, 7.0, 0.0, None)];
    let errors = FrameErrors::of(&Plan { motion, ..Plan::default() }, &frame);
    near(errors.speed_mps[5], 2.0);
    near(errors.min_ade_m, 0.0);
    near(errors.min_fde_m, 0.0);
    near(errors.min_largest_m, 0.0);
    // 2 m/s too fast, of which the first step has half.
    near(errors.largest_m, 2.0 * 3.0 - 0.1);
}

#[test]
fn nll_is_what_a_calculator_says() {
    // In Python, with N(x, m, s) = exp(-((x - m) / s)**2 / 2) / (s * sqrt(2 * pi)):
    //   v, yaw = [1, 2], [1/8, -1/4]
    //   A: weight 3/4, v 1.25 2.5 (std 0.5 1), yaw 0 -1/8 (std 1/8 1/4)
    //   B: weight 1/4, v 0.5 1 (std 1 2), yaw 1/4 1/2 (std 1/4 1/2)
    //   p = sum(w * prod(N(v / 10, m / 10, s / 10)) * prod(N(yaw, m, s)) for A, B)
    //   -log(p) / 4 = -0.9841766566776848
    let mut future = Future::UNKNOWN;
    future.len = 2;
    future.speed_mps[..2].copy_from_slice(&[1.0, 2.0]);
    future.yaw_rad[..2].copy_from_slice(&[0.125, -0.25]);
    let mut a = steady(0.75, 9.0, 9.0, Some([9.0, 9.0]));
    let mut b = steady(0.25, 9.0, 9.0, Some([9.0, 9.0]));
    let set = |mode: &mut Mode, values: [[f32; 2]; 4]| {
        let std = mode.std.as_mut().unwrap();
        mode.speed_mps[..2].copy_from_slice(&values[0]);
        mode.yaw_rad[..2].copy_from_slice(&values[1]);
        std.speed_mps[..2].copy_from_slice(&values[2]);
        std.yaw_rad[..2].copy_from_slice(&values[3]);
    };
    set(&mut a, [[1.25, 2.5], [0.0, -0.125], [0.5, 1.0], [0.125, 0.25]]);
    set(&mut b, [[0.5, 1.0], [0.25, 0.5], [1.0, 2.0], [0.25, 0.5]]);
    let nll = mixtures::nll_nats(&[a, b], &future).unwrap();
    assert!((nll + 0.984_176_656_677_684_8).abs() < 1e-12, "{nll}");
}

#[test]
fn nll_survives_modes_whose_density_is_zero_in_floating_point() {
    let frame = accelerating(0, 10.0, 0.0);
    let far = |speed| steady(0.5, speed, 0.0, Some([0.1, 0.01]));
    let nll = mixtures::nll_nats(&[far(30.0), far(50.0)], &frame.future).unwrap();
    // Only the nearer one counts: 200 standard deviations at 30 steps, and the log of its weight.
    let expected =
        (30.0 * (200.0f64.powi(2) / 2.0 + TAU.ln() + 2.0 * 0.01f64.ln()) - 0.5f64.ln()) / 60.0;
    assert!((nll / expected - 1.0).abs() < 1e-5, "{nll} {expected}");
}

#[test]
fn mixture_metrics_need_deviations_of_every_mode() {
    let frame = accelerating(0, 10.0, 0.0);
    let modes = [steady(0.5, 9.0, 0.0, Some([1.0, 0.1])), steady(0.5, 9.0, 0.0, None)];
    assert_eq!(mixtures::nll_nats(&modes, &frame.future), None);
    assert_eq!(mixtures::pit(&modes, &frame.future), None);
    assert_eq!(mixtures::MixtureErrors::of(&modes, &frame.future), None);
    assert_eq!(mixtures::nll_nats(&[], &frame.future), None);
}

#[test]
fn central_intervals_end_at_the_normal_quantiles() {
    // Quantiles of the standard normal at 75, 90 and 97.5 %.
    for (share, quantile) in [(0.5, 0.67449), (0.8, 1.28155), (0.95, 1.95996)] {
        for (offset, expected) in [(quantile - 1e-3, 1.0), (quantile + 1e-3, 0.5)] {
            let frame = accelerating(0, 10.0, 0.0);
            let mode = steady(1.0, 10.0 + 2.0 * offset as f32, 0.0, Some([2.0, 0.1]));
            let pits = mixtures::pit(&[mode], &frame.future).unwrap();
            assert_eq!(mixtures::inside(&pits, share), expected);
        }
    }
}

#[test]
fn plan_that_is_not_finite_stops_the_evaluation_and_is_named() {
    let broken = [
        steady(1.0, f32::NAN, 0.0, None),
        steady(1.0, 1.0, 0.0, Some([0.0, 0.1])),
        steady(0.5, 1.0, 0.0, None),
    ];
    for (mode, what) in broken.into_iter().zip(["not finite", "not positive", "probabilities"]) {
        let plan = Plan { motion: vec![mode], ..Plan::default() };
        let policy = Constant { name: "run".to_string(), plan };
        let frames = vec![Ok(("town-3".to_string(), accelerating(17, 5.0, 0.0)))];
        let policy: Box<dyn Policy> = Box::new(policy);
        let error = evaluate(&mut [policy.into()], frames).unwrap_err().to_string();
        assert!(error.contains("`run`, episode town-3, frame 17"), "{error}");
        assert!(error.contains(what), "{error}");
    }
}

#[test]
fn two_policies_of_one_name_are_refused() {
    let mut policies = ["stand-still"; 2].map(|name| baseline(name).unwrap().into());
    let error = evaluate(&mut policies, Vec::new()).unwrap_err();
    assert!(error.to_string().contains("`stand-still`"), "{error}");
}

/// Counts the frames since its last reset, as its steering.
struct Counting(u32);

impl Policy for Counting {
    fn name(&self) -> &str {
        "counting"
    }

    fn reset(&mut self) {
        self.0 = 0;
    }

    fn plan(&mut self, _: &Frame) -> Result<Plan> {
        self.0 += 1;
        let action = Action { steer: self.0 as f32, ..Action::default() };
        Ok(Plan { action: Some(action), ..Plan::default() })
    }
}

#[test]
fn policy_is_reset_at_the_first_frame_of_every_episode() {
    let item = |(episode, index): (&str, u32)| {
        let mut frame = accelerating(index, 5.0, 0.0);
        frame.action.steer = Some(0.0);
        Ok((episode.to_string(), frame))
    };
    let order = [("a", 0), ("a", 1), ("a", 2), ("b", 0), ("b", 1)];
    let Errors { episodes, policies, .. } =
        evaluate(&mut [(Box::new(Counting(9)) as Box<dyn Policy>).into()], order.map(item))
            .unwrap();
    let steps: Vec<_> = policies[0].rows.iter().map(|row| row.planned[0].unwrap().steer).collect();
    assert_eq!(steps, [1.0, 2.0, 3.0, 1.0, 2.0]);
    assert_eq!(episodes, ["a", "b"]);
}

#[test]
fn metric_keys_are_unique_and_root_mean_squares_have_a_mean_beside_them() {
    let keys: std::collections::BTreeSet<_> = METRICS.iter().map(|m| m.key).collect();
    assert_eq!(keys.len(), METRICS.len());
    let curves: std::collections::BTreeSet<_> = CURVES.iter().map(|curve| curve.key).collect();
    assert_eq!(curves.len(), CURVES.len());
    for key in keys.iter().filter(|key| key.contains("rmse")) {
        assert!(metric(&key.replace("rmse", "mae")).is_some(), "{key}");
    }
}

/// Pseudo-normal numbers without a library: sums of twelve steps of a linear congruence.
fn normals(seed: u64, count: usize) -> Vec<f64> {
    let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) + 1;
    let mut uniform = || {
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 53) as f64
    };
    (0..count).map(|_| (0..12).map(|_| uniform()).sum::<f64>() - 6.0).collect()
}

#[test]
fn bootstrap_gives_the_same_interval_for_the_same_seed_and_another_for_another() {
    let values: Vec<_> = normals(1, 60).into_iter().map(Some).collect();
    let units: Vec<u32> = (0..60).map(|i| i / 3).collect();
    let interval =
        |seed| Bootstrap { seed, resamples: 500, level: 0.95 }.interval(&values, &units).unwrap();
    assert_eq!(interval(7), interval(7));
    assert_ne!(interval(7), interval(8));
}

#[test]
fn bootstrap_interval_of_alternating_values_is_the_binomial_one() {
    // 100 units, half 0 and half 1: the mean of a resample is binomial(100, 1/2) / 100, whose
    // quantiles at 2.5 and 97.5 % are 0.40 and 0.60.
    let values: Vec<_> = (0..100).map(|i| Some(f64::from(i % 2))).collect();
    let units: Vec<u32> = (0..100).collect();
    let [low, high] = Bootstrap::default().interval(&values, &units).unwrap();
    assert!((low - 0.40).abs() < 0.011 && (high - 0.60).abs() < 0.011, "{low} {high}");
}

#[test]
fn bootstrap_interval_covers_the_truth_about_as_often_as_it_says() {
    let settings = Bootstrap { level: 0.95, resamples: 400, seed: 3 };
    let units: Vec<u32> = (0..160).map(|i| i / 4).collect();
    let covered = (0..300).filter(|&seed| {
        // Four equal values per unit: forty independent numbers, not 160.
        let drawn = normals(seed, 40);
        let values: Vec<_> = units.iter().map(|&unit| Some(drawn[unit as usize])).collect();
        let [low, high] = settings.interval(&values, &units).unwrap();
        low <= 0.0 && 0.0 <= high
    });
    let covered = covered.count();
    assert!((270..=294).contains(&covered), "{covered} of 300");
}

#[test]
fn bootstrap_needs_two_units_with_a_value() {
    let interval =
        |values: &[Option<f64>], units: &[u32]| Bootstrap::default().interval(values, units);
    assert_eq!(interval(&[], &[]), None);
    assert_eq!(interval(&[Some(1.0), Some(2.0)], &[0, 0]), None);
    assert_eq!(interval(&[Some(1.0), None], &[0, 1]), None);
    assert_eq!(interval(&[Some(1.0), Some(1.0)], &[0, 1]), Some([1.0, 1.0]));
}

/// A mixture of two modes, and a future to judge it by.
fn motions() -> impl Strategy<Value = (Vec<Mode>, Future)> {
    let numbers = prop::collection::vec(-1.0f32..1.0, 4 * FUTURE_STEPS);
    (numbers, 0.1f32..0.9, 1u8..=30, 1.0f32..3.0).prop_map(|(numbers, weight, len, std)| {
        let part =
            |i: usize, scale: f32| std::array::from_fn(|t| scale * numbers[i * FUTURE_STEPS + t]);
        let mode = |weight, i, std: f32| Mode {
            speed_mps: part(i, 4.0),
            yaw_rad: part(i + 1, 2.5),
            ..steady(weight, 0.0, 0.0, Some([2.0 * std, std]))
        };
        let mut future = Future::UNKNOWN;
        future.len = len;
        (future.speed_mps, future.yaw_rad) = (part(3, 4.0), part(2, 1.5));
        (vec![mode(weight, 0, std), mode(1.0 - weight, 2, 2.0 * std)], future)
    })
}

proptest! {
    #[test]
    fn wrapped_angle_is_the_same_direction_within_half_a_turn(angle in -50.0f64..50.0) {
        let wrapped = wrapped_rad(angle);
        prop_assert!(-PI < wrapped && wrapped <= PI);
        prop_assert!((wrapped.sin() - angle.sin()).abs() < 1e-9);
        prop_assert!((wrapped.cos() - angle.cos()).abs() < 1e-9);
    }

    #[test]
    fn nll_equals_the_product_of_densities((modes, future) in motions()) {
        let density = |x: f64, mean: f64, std: f64| {
            (-((x - mean) / std).powi(2) / 2.0).exp() / (std * TAU.sqrt())
        };
        let mut sum = 0.0;
        for mode in &modes {
            let std = mode.std.as_ref().unwrap();
            let mut product = f64::from(mode.weight);
            for t in 0..usize::from(future.len) {
                let speed = [future.speed_mps[t], mode.speed_mps[t], std.speed_mps[t]];
                let [x, mean, s] = speed.map(|v| f64::from(v) / 10.0);
                product *= density(x, mean, s);
                let mut yaw = f64::from(future.yaw_rad[t]) - f64::from(mode.yaw_rad[t]);
                while yaw > PI { yaw -= TAU }
                while yaw <= -PI { yaw += TAU }
                product *= density(yaw, 0.0, f64::from(std.yaw_rad[t]));
            }
            sum += product;
        }
        let slow = -sum.ln() / f64::from(2 * u32::from(future.len));
        let nll = mixtures::nll_nats(&modes, &future).unwrap();
        prop_assert!((nll - slow).abs() < 1e-9, "{nll} {slow}");
    }

    #[test]
    fn masked_steps_never_count((modes, future) in motions(), garbage in -100.0f32..100.0) {
        let frame = |future: Future| Frame { future, ..accelerating(0, 5.0, 0.0) };
        let mut other = future.clone();
        for t in usize::from(future.len)..FUTURE_STEPS {
            (other.speed_mps[t], other.yaw_rad[t], other.xy_m[2 * t]) = (garbage, garbage, garbage);
        }
        let plan = Plan { motion: modes.clone(), ..Plan::default() };
        prop_assert_eq!(
            FrameErrors::of(&plan, &frame(future.clone())),
            FrameErrors::of(&plan, &frame(other.clone()))
        );
        prop_assert_eq!(mixtures::nll_nats(&modes, &future), mixtures::nll_nats(&modes, &other));
        prop_assert_eq!(mixtures::pit(&modes, &future), mixtures::pit(&modes, &other));
    }

    #[test]
    fn wider_intervals_hold_more_and_nearest_mode_is_no_worse((modes, mut future) in motions()) {
        future.len = FUTURE_STEPS as u8;
        let frame = Frame { future, ..accelerating(0, 5.0, 0.0) };
        let errors = FrameErrors::of(&Plan { motion: modes, ..Plan::default() }, &frame);
        let mixture = errors.mixture.unwrap();
        let [half, most, nearly_all] = mixture.inside;
        prop_assert!(half <= most && most <= nearly_all);
        for [half, most, nearly_all] in mixture.width_at {
            for i in 0..half.len() {
                prop_assert!(0.0 < half[i] && half[i] < most[i] && most[i] < nearly_all[i]);
            }
        }
        prop_assert!(errors.min_ade_m.unwrap() <= errors.ade_m[5].unwrap());
        prop_assert!(errors.min_fde_m.unwrap() <= errors.fde_m[5].unwrap());
        prop_assert!(errors.min_largest_m.unwrap() <= errors.largest_m.unwrap());
        prop_assert!(errors.fde_m[5].unwrap() <= errors.largest_m.unwrap());
    }

    #[test]
    fn interval_shifts_with_its_values(values in prop::collection::vec(-9.0f64..9.0, 12), by in -5.0f64..5.0) {
        let units: Vec<u32> = (0..12).map(|i| i / 2).collect();
        let settings = Bootstrap { resamples: 50, ..Bootstrap::default() };
        let interval = |shift: f64| {
            let shifted: Vec<_> = values.iter().map(|v| Some(v + shift)).collect();
            settings.interval(&shifted, &units).unwrap()
        };
        let (here, there) = (interval(0.0), interval(by));
        prop_assert!((here[0] + by - there[0]).abs() < 1e-9);
        prop_assert!((here[1] + by - there[1]).abs() < 1e-9);
    }
}
