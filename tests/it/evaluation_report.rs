//! The report: its verdicts, its renderings, its schema, and the command that prints it.
#![allow(clippy::unwrap_used)]

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::Path,
};

use parquet::{
    file::reader::{FileReader as _, SerializedFileReader},
    record::{Row, RowAccessor as _},
};
use pmp::{
    control::fusion::Fusion,
    error::Result,
    eval::{
        baseline::baseline,
        offline::{
            definitions::{CURVES, METRICS},
            errors::{Errors, Sight},
            evaluate::{Contender, evaluate},
            plot, render,
            report::{Dataset, Definition, Holdout, HoldoutKind, Report, Verdict},
            store,
            summary::summarise,
        },
        statistics::{Bootstrap, Unit},
    },
    frame::{Frame, signed_speed_mps},
    policy::{Action, Plan, Policy},
};
use serde_json::Value;

use crate::evaluation::{accelerating, steady};

/// Keeps its speed, and is off by that much more.
struct Offset(f32);

impl Policy for Offset {
    fn name(&self) -> &str {
        "run_1"
    }

    fn reset(&mut self) {}

    fn plan(&mut self, frame: &Frame) -> Result<Plan> {
        let speed_mps = signed_speed_mps(frame.velocity_mps) + self.0;
        let motion = vec![steady(1.0, speed_mps, 0.0, Some([2.0, 0.1]))];
        Ok(Plan { motion, ..Plan::default() })
    }
}

/// Drives of `frames` frames each, the last 30 without their whole future. The first starts at
/// 2 m/s and accelerates by 0.25 m/s2, each further one is 3 m/s and 0.125 m/s2 faster.
fn drives(episodes: u32, frames: u32) -> Vec<Result<(String, Frame)>> {
    let frame = |episode: u32, i: u32| {
        let mut frame =
            accelerating(i, 2.0 + 3.0 * f64::from(episode), 0.25 + 0.125 * f64::from(episode));
        frame.future.len = (frames - 1 - i).min(30) as u8;
        Ok((format!("drive-{episode}"), frame))
    };
    (0..episodes).flat_map(|e| (0..frames).map(move |i| (e, i))).map(|(e, i)| frame(e, i)).collect()
}

pub(crate) fn errors(offset_mps: f32, episodes: u32, frames: u32) -> Errors {
    let policies: [Box<dyn Policy>; 3] = [
        Box::new(Offset(offset_mps)),
        baseline("constant-velocity").unwrap(),
        baseline("stand-still").unwrap(),
    ];
    evaluate(&mut policies.map(Contender::from), drives(episodes, frames)).unwrap()
}

pub(crate) fn report_of(errors: &Errors, weak: bool) -> Report {
    let dataset = Dataset { name: "town".into(), manifest_sha256: "ab".repeat(32) };
    let holdout = Holdout {
        kind: if weak { HoldoutKind::TimeBlock } else { HoldoutKind::Episodes },
        how: if weak { "the last eighth of each drive" } else { "by hash of the id" }.into(),
        weak,
        frames: errors.frames.len() as u64,
        episodes: errors.episodes.len() as u64,
    };
    let bootstrap = Bootstrap { resamples: 200, ..Bootstrap::default() };
    summarise(dataset, holdout, errors, bootstrap)
}

fn report(offset_mps: f32, episodes: u32, frames: u32) -> Report {
    report_of(&errors(offset_mps, episodes, frames), false)
}

fn verdict(report: &Report) -> (Verdict, &str) {
    let paired = &report.policies[0].paired[0];
    (paired.verdict, &paired.sentence)
}

#[test]
fn verdict_says_no_more_than_the_interval_allows() {
    let better = report(1.0, 8, 60);
    assert_eq!(verdict(&better).0, Verdict::Beats);
    insta::assert_snapshot!(verdict(&better).1, @"`run_1` beats constant-velocity on speed at 3 s: 1.125 against 2.062 m/s (difference -0.938, 95 % interval -1.000 ... -0.750, n = 240 frames in 8 episodes)");
    let worse = report(-1.0, 8, 60);
    assert_eq!(verdict(&worse).0, Verdict::Worse);
    insta::assert_snapshot!(verdict(&worse).1, @"`run_1` does not beat constant-velocity on speed at 3 s, it is worse: 3.062 against 2.062 m/s (difference 1.000, 95 % interval 1.000 ... 1.000, n = 240 frames in 8 episodes)");
    let same = report(3.0, 6, 60);
    assert_eq!(verdict(&same).0, Verdict::NoDifference);
    insta::assert_snapshot!(verdict(&same).1, @"no difference can be claimed between `run_1` and constant-velocity on speed at 3 s: 1.312 against 1.688 m/s (difference -0.375, 95 % interval -1.500 ... 0.875, n = 180 frames in 6 episodes)");
    let short = report(1.0, 1, 60);
    assert_eq!(verdict(&short).0, Verdict::TooFew);
    insta::assert_snapshot!(verdict(&short).1, @"no difference can be claimed between `run_1` and constant-velocity on speed at 3 s, too few for a claim: 0.250 against 0.750 m/s (difference -0.500, no interval, n = 30 frames in 1 contiguous block of 3 s)");
}

#[test]
fn few_episodes_are_resampled_in_blocks_of_three_seconds_and_the_report_says_so() {
    let few = report(1.0, 2, 200);
    assert_eq!((few.intervals.unit, few.intervals.units), (Unit::Blocks, 14));
    insta::assert_snapshot!(few.caveats.join("\n"), @"Intervals are over blocks of 3 s of 2 episodes: they speak of more of the same drives, not of others.");
    let many = report(1.0, 6, 40);
    assert_eq!((many.intervals.unit, many.intervals.units), (Unit::Episodes, 6));
    assert!(many.caveats.is_empty());
}

#[test]
fn slices_partition_the_frames() {
    let report = report(1.0, 6, 40);
    for policy in &report.policies {
        for by in ["command", "speed"] {
            let slices = policy.slices.iter().filter(|slice| slice.by == by);
            assert_eq!(slices.map(|slice| slice.frames).sum::<u64>(), report.evaluated.frames);
        }
    }
    // Speeds of the six drives: 2, 5, 8, 11, 14, 17 m/s.
    let speed = report.policies[0].slices.iter().filter(|slice| slice.by == "speed");
    let frames: Vec<_> = speed.map(|slice| (slice.name.as_str(), slice.frames)).collect();
    assert_eq!(frames, [("0-5", 40), ("5-10", 80), ("10-15", 80), ("15+", 40)]);
}

#[test]
fn root_mean_square_weighs_large_errors_more() {
    // Two drives of equal length; keeping the speed is off by 0.75 and 1.125 m/s after 3 s,
    // standing still by 2.75 and 6.125 m/s.
    let report = report(0.0, 2, 60);
    for (policy, low, high) in [(1, 0.75f64, 1.125f64), (2, 2.75, 6.125)] {
        let value = |key: &str| report.policies[policy].metrics[key].value.unwrap();
        assert!((value("speed_mae_3s") - (low + high) / 2.0).abs() < 1e-6);
        let rms = ((low * low + high * high) / 2.0).sqrt();
        assert!((value("speed_rmse_3s") - rms).abs() < 1e-6);
    }
}

#[test]
fn weak_report_says_so_in_its_first_lines_and_in_its_json() {
    let weak = report_of(&errors(1.0, 1, 60), true);
    let markdown = render::markdown(&weak);
    let head: Vec<_> = markdown.lines().take(3).collect();
    assert!(head.join("\n").contains("Weak evidence"), "{head:?}");
    assert!(head.join("\n").contains("the last eighth of each drive"), "{head:?}");
    let json: Value = serde_json::from_str(&store::json(&weak).unwrap()).unwrap();
    assert_eq!(json["holdout"]["weak"], Value::Bool(true));
    assert!(json["caveats"][0].as_str().unwrap().starts_with("Weak evidence"));
    assert!(render::latex(&weak).starts_with("% Weak evidence"));
    assert!(render::csv(&weak).lines().nth(1).unwrap().starts_with("town,time block,true,run_1"));
}

#[test]
fn frames_that_were_not_read_are_counted_in_the_first_lines() {
    let errors = errors(1.0, 6, 40);
    let mut report = report_of(&errors, false);
    report.holdout.frames = 241;
    let again = summarise(report.dataset, report.holdout, &errors, report.intervals.bootstrap);
    assert_eq!(again.caveats, ["Only 240 of 241 held-out frames were read."]);
}

#[test]
fn oracle_is_marked_and_never_said_to_beat_anything() {
    let mut policies = ["recorded", "constant-velocity"].map(|name| baseline(name).unwrap().into());
    let errors = evaluate(&mut policies, drives(6, 60)).unwrap();
    let report = report_of(&errors, false);
    assert_eq!(report.policies[0].paired, []);
    assert_eq!(report.policies[1].paired, [], "nothing to compare the reference with");
    assert_eq!(
        report.caveats,
        ["`recorded` reads what the driver did next: it is a floor, not a driver."]
    );
}

#[test]
fn markdown_table_shows_counts_intervals_and_dashes() {
    let markdown = render::markdown(&report(1.0, 6, 40));
    let until = markdown.find("What the numbers are").unwrap();
    insta::assert_snapshot!(&markdown[..until], @"
    # Offline evaluation on town

    Evaluated: 240/240 frames of 6/6 episodes. Held out by episodes: by hash of the id.
    Intervals: 95 %, percentile bootstrap, 200 resamples of 6 episodes, seed 0.

    - `run_1` beats constant-velocity on speed at 3 s: 0.771 against 1.688 m/s (difference -0.917, 95 % interval -1.000 ... -0.750, n = 60 frames in 6 episodes)
    - `stand-still` does not beat constant-velocity on speed at 3 s, it is worse: 11.188 against 1.688 m/s (difference 9.500, 95 % interval 4.500 ... 14.000, n = 60 frames in 6 episodes)

    ## Motion

    | metric | unit | better | frames | `run_1` | `constant-velocity` | `stand-still` |
    |---|---|---|---:|---:|---:|---:|
    | minADE 3 s | m | lower | 60/240 | 0.669 [0.471, 0.942] | 0.886 [0.558, 1.182] | 15.136 [7.308, 22.182] |
    | minFDE 3 s | m | lower | 60/240 | 0.890 [0.467, 1.450] | 2.531 [1.594, 3.375] | 30.556 [14.869, 44.675] |
    | Miss rate 3 s | – | lower | 60/240 | 0.000 [0.000, 0.000] | 0.667 [0.167, 1.000] | 1.000 [1.000, 1.000] |
    | minMiss rate 3 s | – | lower | 60/240 | 0.000 [0.000, 0.000] | 0.667 [0.167, 1.000] | 1.000 [1.000, 1.000] |
    | FDE at 5 m | m | lower | 196/240, 186/240, 60/240 | 0.501 [0.302, 0.858] | 0.149 [0.065, 0.337] | 30.556 [14.869, 44.675] |
    | ADE at 5 m | m | lower | 196/240, 186/240, 60/240 | 0.286 [0.179, 0.480] | 0.059 [0.030, 0.123] | 15.136 [7.308, 22.182] |
    | Speed bias 1 s | m/s | near 0 | 180/240 | 0.438 [0.250, 0.646] | -0.562 [-0.750, -0.354] | -10.062 [-14.750, -4.854] |
    | Speed bias 2 s | m/s | near 0 | 120/240 | -0.125 [-0.500, 0.292] | -1.125 [-1.500, -0.708] | -10.625 [-15.500, -5.208] |
    | Speed bias 3 s | m/s | near 0 | 60/240 | -0.688 [-1.250, -0.062] | -1.688 [-2.250, -1.062] | -11.188 [-16.250, -5.562] |
    | AHE 3 s | rad | lower | 60/240 | 0.000 [0.000, 0.000] | 0.000 [0.000, 0.000] | 0.000 [0.000, 0.000] |
    | FHE 3 s | rad | lower | 60/240 | 0.000 [0.000, 0.000] | 0.000 [0.000, 0.000] | 0.000 [0.000, 0.000] |

    ## Mixture

    | metric | unit | better | frames | `run_1` | `constant-velocity` | `stand-still` |
    |---|---|---|---:|---:|---:|---:|
    | CRPS of speed | m/s | lower | 60/240 | 0.545 [0.525, 0.574] | – | – |
    | CRPS of yaw | rad | lower | 60/240 | 0.023 [0.023, 0.023] | – | – |
    | ECE of speed | – | lower | 60/240 | 0.166 [0.139, 0.194] | – | – |
    | ECE of yaw | – | lower | 60/240 | 0.263 [0.263, 0.263] | – | – |
    | KS of speed | – | lower | 60/240 | 0.310 [0.310, 0.367] | – | – |
    | KS of yaw | – | lower | 60/240 | 0.500 [0.500, 0.500] | – | – |

    ## Variance

    | metric | unit | better | frames | `run_1` | `constant-velocity` | `stand-still` |
    |---|---|---|---:|---:|---:|---:|
    | Variance against error | – | higher | 196/240 | 1.000 [1.000, 1.000] | – | – |

    ## Action a1: its own

    | metric | unit | better | frames | `run_1` | `constant-velocity` | `stand-still` |
    |---|---|---|---:|---:|---:|---:|
    | Steer L1 | – | lower | 240/240 | – | – | 0.250 [0.250, 0.250] |
    | Throttle L1 | – | lower | 240/240 | – | – | 0.500 [0.500, 0.500] |
    | Steer, speed-weighted | m/s | lower | 240/240 | – | – | 2.375 [1.125, 3.500] |
    | Steer, cumulative | m | lower | 150/240 | – | – | 3.800 [1.800, 5.600] |
    | Steer, other class | – | lower | 240/240 | – | – | 1.000 [1.000, 1.000] |
    | Steer, off by a tenth | – | lower | 240/240 | – | – | 1.000 [1.000, 1.000] |
    | Throttle recall | – | higher | 240/240 | – | – | 0.000 [0.000, 0.000] |
    | Throttle F1 | – | higher | 240/240 | – | – | 0.000 [0.000, 0.000] |

    ## Action a2: of the controller that follows its plan
    | metric | unit | better | frames | `run_1` | `constant-velocity` | `stand-still` |
    |---|---|---|---:|---:|---:|---:|
    | Steer L1 (a2) | – | lower | 240/240 | 0.250 [0.250, 0.250] | 0.250 [0.250, 0.250] | 0.250 [0.250, 0.250] |
    | Throttle L1 (a2) | – | lower | 240/240 | 0.073 [0.073, 0.073] | 0.500 [0.500, 0.500] | 0.500 [0.500, 0.500] |
    | Steer, speed-weighted (a2) | m/s | lower | 240/240 | 2.375 [1.125, 3.500] | 2.375 [1.125, 3.500] | 2.375 [1.125, 3.500] |
    | Steer, cumulative (a2) | m | lower | 150/240 | 3.800 [1.800, 5.600] | 3.800 [1.800, 5.600] | 3.800 [1.800, 5.600] |
    | Steer, other class (a2) | – | lower | 240/240 | 1.000 [1.000, 1.000] | 1.000 [1.000, 1.000] | 1.000 [1.000, 1.000] |
    | Steer, off by a tenth (a2) | – | lower | 240/240 | 1.000 [1.000, 1.000] | 1.000 [1.000, 1.000] | 1.000 [1.000, 1.000] |
    | Throttle precision (a2) | – | higher | 240/240 | 1.000 [1.000, 1.000] | – | – |
    | Throttle recall (a2) | – | higher | 240/240 | 1.000 [1.000, 1.000] | 0.000 [0.000, 0.000] | 0.000 [0.000, 0.000] |
    | Throttle F1 (a2) | – | higher | 240/240 | 1.000 [1.000, 1.000] | 0.000 [0.000, 0.000] | 0.000 [0.000, 0.000] |
    | slice | frames | ADE 3 s `run_1` | ADE 3 s `constant-velocity` | ADE 3 s `stand-still` | Speed error 3 s `run_1` | Speed error 3 s `constant-velocity` | Speed error 3 s `stand-still` |
    |---|---:|---:|---:|---:|---:|---:|---:|
    | command follow | 240/240 | 0.669 (n = 60) | 0.886 (n = 60) | 15.136 (n = 60) | 0.771 (n = 60) | 1.688 (n = 60) | 11.188 (n = 60) |
    | command left | 0/240 | – | – | – | – | – | – |
    | command right | 0/240 | – | – | – | – | – | – |
    | command straight | 0/240 | – | – | – | – | – | – |
    | speed 0-5 m/s | 40/240 | 1.106 (n = 10) | 0.394 (n = 10) | 3.394 (n = 10) | 0.250 (n = 10) | 0.750 (n = 10) | 2.750 (n = 10) |
    | speed 5-10 m/s | 80/240 | 0.811 (n = 20) | 0.689 (n = 20) | 10.439 (n = 20) | 0.312 (n = 20) | 1.312 (n = 20) | 7.812 (n = 20) |
    | speed 10-15 m/s | 80/240 | 0.450 (n = 20) | 1.083 (n = 20) | 19.833 (n = 20) | 1.062 (n = 20) | 2.062 (n = 20) | 14.562 (n = 20) |
    | speed 15+ m/s | 40/240 | 0.385 (n = 10) | 1.379 (n = 10) | 26.879 (n = 10) | 1.625 (n = 10) | 2.625 (n = 10) | 19.625 (n = 10) |
    ");
}

#[test]
fn plot_draws_what_fits_the_scale_of_the_reference_and_names_what_does_not() {
    let svg = plot::speed_errors(&report(1.0, 6, 40));
    // Two policies at three horizons; standing still is off by ten times as much.
    assert_eq!(svg.matches("<circle").count(), 6);
    assert_eq!(svg.matches(" off the scale").count(), 1);
    assert!(svg.contains("stand-still: 11.188 m/s off the scale"), "{svg}");
    // The error of keeping the speed grows with the horizon, so its points rise.
    let heights: Vec<f64> = svg
        .lines()
        .filter(|line| line.starts_with("<circle"))
        .map(|line| line.split("cy=\"").nth(1).unwrap().split('"').next().unwrap())
        .map(|height| height.parse().unwrap())
        .collect();
    assert!(heights[3] > heights[4] && heights[4] > heights[5], "{heights:?}");
}

#[test]
fn plot_escapes_names_and_survives_a_report_without_numbers() {
    let mut report = report(1.0, 6, 40);
    report.policies[0].name = "<a & b>".to_string();
    assert!(plot::speed_errors(&report).contains("&lt;a &amp; b&gt;"));
    report.policies.iter_mut().for_each(|policy| policy.metrics.clear());
    assert!(!plot::speed_errors(&report).contains("NaN"));
}

#[test]
fn csv_has_one_row_a_policy_and_empty_fields_for_what_is_missing() {
    let csv = render::csv(&report(1.0, 6, 40));
    let rows: Vec<Vec<_>> = csv.lines().map(|line| line.split(',').collect()).collect();
    assert!(rows.iter().all(|row| row.len() == 6 + 4 * METRICS.len()));
    let column = |key: &str| rows[0].iter().position(|head| *head == key).unwrap();
    let short = |row: &[&str], key: &str| {
        let fields = row[column(key)..].iter().take(4);
        fields.map(|field| field.get(..6).unwrap_or(field)).collect::<Vec<_>>().join(",")
    };
    let part: Vec<_> = rows[1..]
        .iter()
        .map(|row| format!("{}: {} | {}", row[3], short(row, "speed_mae_3s"), short(row, "nll")))
        .collect();
    insta::assert_snapshot!(part.join("\n"), @"
    run_1: 0.7708,0.3536,1.2505,60 | -1.012,-1.018,-1.002,60
    constant-velocity: 1.6875,1.0625,2.25,60 | ,,,0
    stand-still: 11.187,5.5625,16.25,60 | ,,,0
    ");
}

#[test]
fn latex_escapes_names() {
    let latex = render::latex(&report(1.0, 6, 40));
    let part: Vec<_> = latex
        .lines()
        .filter(|l| !l.contains("FDE") && !l.contains("ADE") && !l.contains("iss rate"))
        .collect();
    insta::assert_snapshot!(part[..5].join("\n"), @r#"
    \begin{tabular}{llrrrr}
    \toprule
    Metric & Unit & Frames & run\_1 & constant-velocity & stand-still \\
    \midrule
    Speed error 1 s & m/s & 180/240 & $0.438$ {\scriptsize $[0.250, 0.646]$} & $0.562$ {\scriptsize $[0.354, 0.750]$} & $10.062$ {\scriptsize $[4.854, 14.750]$} \\
    "#);
}

/// Equal but for the last bit of a number, which the JSON reader may lose.
fn equal(a: &Value, b: &Value) -> bool {
    match (a, b) {
        (Value::Number(a), Value::Number(b)) => {
            let (a, b) = (a.as_f64().unwrap(), b.as_f64().unwrap());
            (a - b).abs() <= 1e-15 * a.abs()
        }
        (Value::Array(a), Value::Array(b)) => {
            a.len() == b.len() && a.iter().zip(b).all(|(a, b)| equal(a, b))
        }
        (Value::Object(a), Value::Object(b)) => {
            a.keys().eq(b.keys()) && a.values().zip(b.values()).all(|(a, b)| equal(a, b))
        }
        _ => a == b,
    }
}

fn assert_same(a: &Report, b: &Report) {
    let json = |report| serde_json::to_value(report).unwrap();
    assert!(equal(&json(a), &json(b)));
}

#[test]
fn json_has_null_for_what_is_missing_and_reads_back_equal() {
    let report = report(1.0, 6, 40);
    let text = store::json(&report).unwrap();
    assert_same(&serde_json::from_str(&text).unwrap(), &report);
    let json: Value = serde_json::from_str(&text).unwrap();
    let metrics = &json["policies"][1]["metrics"];
    insta::assert_snapshot!(
        serde_json::to_string_pretty(&[&metrics["nll"], &metrics["speed_mae_3s"]]).unwrap(),
        @r#"
        [
          {
            "frames": 0,
            "interval": null,
            "value": null
          },
          {
            "frames": 60,
            "interval": [
              1.0625,
              2.25
            ],
            "value": 1.6875
          }
        ]
        "#
    );
}

/// Every field of a JSON value as `a.b[].c`; keys that are data are `*`.
fn fields(value: &Value, path: &str, found: &mut BTreeSet<String>) {
    match value {
        Value::Object(map) => {
            for (key, value) in map {
                let is_data = METRICS.iter().any(|metric| metric.key == key)
                    || CURVES.iter().any(|curve| curve.key == key)
                    || path.ends_with(".attention");
                let key = if is_data { "*" } else { key };
                let path = if path.is_empty() { key.to_string() } else { format!("{path}.{key}") };
                fields(value, &path, found);
            }
        }
        Value::Array(items) => {
            items.iter().for_each(|item| fields(item, &format!("{path}[]"), found))
        }
        _ => {
            found.insert(path.to_string());
        }
    }
}

/// Plans everything that a plan can have.
struct Whole;

impl Policy for Whole {
    fn name(&self) -> &str {
        "whole"
    }

    fn reset(&mut self) {}

    fn plan(&mut self, frame: &Frame) -> Result<Plan> {
        let speed_mps = signed_speed_mps(frame.velocity_mps);
        let std = 0.5 + 0.1 * frame.index as f32;
        Ok(Plan {
            action: Some(Action { steer: 0.2, throttle: 0.5, brake: 0.0 }),
            motion: vec![
                steady(0.75, speed_mps, 0.0, Some([std, 0.1])),
                steady(0.25, speed_mps + 1.0, 0.1, Some([2.0, 0.1])),
            ],
            attention: vec![("camera", 0.25), ("route", 0.75)],
        })
    }
}

pub(crate) fn whole() -> Errors {
    let fusion = Some(Fusion::Variance { c1: 2.0, c2: 0.001 });
    let whole = Contender { policy: Box::new(Whole), sight: Sight::Blind, fusion };
    let other = Contender {
        sight: Sight::Seeing,
        ..Contender::from(Box::new(Offset(1.0)) as Box<dyn Policy>)
    };
    let mut contenders = [whole, other, Contender::from(baseline("constant-velocity").unwrap())];
    evaluate(&mut contenders, drives(6, 60)).unwrap()
}

#[test]
fn schema_lists_every_field_metric_and_column() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("schemas/report.v2.json");
    let schema: Value = serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap();

    let mut report = report_of(&whole(), true);
    assert_eq!(report.policies[1].paired.len(), 2, "against the reference, and the blind one");
    report.policies.iter_mut().for_each(|policy| policy.slices.truncate(1));
    let mut found = BTreeSet::new();
    fields(&serde_json::to_value(&report).unwrap(), "", &mut found);
    // Empty or null in one policy, and whole in another.
    let optional = [
        "fusion",
        "pit",
        "variance",
        "variance.lambda",
        "metrics.*.interval",
        "curves.*[].interval",
        "paired[].interval",
    ];
    found.retain(|path| !optional.iter().any(|end| *path == format!("policies[].{end}")));
    let mut listed = BTreeSet::new();
    for field in schema["fields"].as_array().unwrap() {
        assert!(field["meaning"].is_string() && field["type"].is_string(), "{field}");
        listed.insert(field["path"].as_str().unwrap().to_string());
    }
    assert_eq!(found, listed);

    for (name, definitions) in
        [("metrics", Definition::metrics()), ("curves", Definition::curves())]
    {
        assert_eq!(schema[name], serde_json::to_value(definitions).unwrap());
    }

    let columns: Vec<&str> = schema["errors_columns"]
        .as_array()
        .unwrap()
        .iter()
        .map(|c| c["name"].as_str().unwrap())
        .collect();
    let mut written: Vec<String> = rows(&whole())
        .0
        .into_iter()
        .map(|name| match name.starts_with("attention_") {
            true => "attention_*".to_string(),
            false => name,
        })
        .collect();
    written.dedup();
    assert_eq!(written, columns);
}

/// Columns and rows of `errors.parquet`.
fn rows(errors: &Errors) -> (Vec<String>, Vec<Row>) {
    let directory = tempfile::tempdir().unwrap();
    store::write(directory.path(), &report_of(errors, false), errors).unwrap();
    let file = fs::File::open(directory.path().join("errors.parquet")).unwrap();
    let reader = SerializedFileReader::new(file).unwrap();
    let schema = reader.metadata().file_metadata().schema_descr();
    let names = schema.root_schema().get_fields().iter().map(|f| f.name().to_string()).collect();
    (names, reader.get_row_iter(None).unwrap().map(std::result::Result::unwrap).collect())
}

#[test]
fn surroundings_make_slices_where_something_is_known_of_them() {
    let frames = drives(6, 40).into_iter().enumerate().map(|(i, item)| {
        let (episode, mut frame) = item.unwrap();
        frame.conditions.town = Some(format!("Town0{}", 1 + i / 120));
        frame.conditions.weather = (i >= 200).then(|| "rainy".to_string());
        Ok((episode, frame))
    });
    let mut contenders = [Contender::from(baseline("constant-velocity").unwrap())];
    let report = report_of(&evaluate(&mut contenders, frames).unwrap(), false);
    let slices = report.policies[0].slices.iter();
    let rest: Vec<_> = slices
        .filter(|slice| slice.by != "command" && slice.by != "speed")
        .map(|slice| (slice.by.as_str(), slice.name.as_str(), slice.frames))
        .collect();
    assert_eq!(
        rest,
        [
            ("town", "Town01", 120),
            ("town", "Town02", 120),
            ("weather", "rainy", 40),
            ("weather", "unknown", 200)
        ]
    );
}

#[test]
fn missing_blind_policy_is_named_with_the_command_that_trains_one() {
    let seeing = || Contender {
        sight: Sight::Seeing,
        ..Contender::from(Box::new(Offset(1.0)) as Box<dyn Policy>)
    };
    let caveats = |contenders: &mut [Contender]| {
        report_of(&evaluate(contenders, drives(6, 40)).unwrap(), false).caveats
    };
    let alone = caveats(&mut [seeing()]);
    assert!(alone[0].contains("pmp-train --data DATASET --out RUN --model blind"), "{alone:?}");
    let blind = Contender { policy: Box::new(Whole), sight: Sight::Blind, fusion: None };
    assert_eq!(caveats(&mut [seeing(), blind]), [] as [String; 0]);
}

#[test]
fn attention_and_shares_of_a2_are_means_over_frames() {
    let report = report_of(&whole(), false);
    let policy = &report.policies[0];
    let expected = [("camera".to_string(), 0.25), ("route".to_string(), 0.75)];
    assert_eq!(policy.attention, expected.clone().into());
    let follow = policy.slices.iter().find(|slice| slice.name == "follow").unwrap();
    assert_eq!(follow.attention, expected.into());
    let variance = policy.variance.as_ref().unwrap();
    let lambda = variance.lambda.as_ref().unwrap();
    assert_eq!(lambda.frames, 6 * 60);
    assert_eq!(lambda.counts.iter().sum::<u64>(), lambda.frames);
    // Frames whose future reaches the target, which a faster car reaches sooner.
    assert!(variance.frames > 6 * 30 && variance.frames < 6 * 60, "{}", variance.frames);
    assert_eq!(variance.tenths.iter().map(|tenth| tenth.frames).sum::<u64>(), variance.frames);
    assert_eq!(variance.grid.counts.iter().flatten().sum::<u64>(), variance.frames);
    let others = &report.policies[1];
    assert!(others.attention.is_empty());
    assert_eq!(others.variance.as_ref().unwrap().lambda, None, "its constants are not known");
    let pit = policy.pit.as_ref().unwrap();
    // Six drives, 30 frames each with a whole future, ten steps in each second.
    for counts in pit.speed.iter().chain(&pit.yaw) {
        assert_eq!(counts.iter().sum::<u64>(), 6 * 30 * 10);
    }
}

#[test]
fn table_can_be_made_again_from_the_errors_per_frame() {
    let errors = errors(1.0, 6, 40);
    let report = report_of(&errors, false);
    let (names, rows) = rows(&errors);
    let at = names.iter().position(|name| name == "speed_mae_3s").unwrap();
    let mut sums: BTreeMap<String, (f64, f64, u64)> = BTreeMap::new();
    for row in rows {
        let (sum, squares, count) = sums.entry(row.get_string(0).unwrap().clone()).or_default();
        if let Ok(error) = row.get_double(at) {
            *sum += error;
            *squares += error * error;
            *count += 1;
        }
    }
    assert_eq!(sums.len(), report.policies.len());
    for policy in &report.policies {
        let (sum, squares, count) = sums[&policy.name];
        let mean = policy.metrics["speed_mae_3s"];
        assert_eq!(mean.frames, count);
        assert!((mean.value.unwrap() - sum / count as f64).abs() < 1e-12);
        let rms = policy.metrics["speed_rmse_3s"].value.unwrap();
        assert!((rms - (squares / count as f64).sqrt()).abs() < 1e-12);
    }
}

#[test]
fn existing_report_is_kept_and_no_temporary_file_is_left() {
    let errors = errors(1.0, 1, 60);
    let report = report_of(&errors, false);
    let directory = tempfile::tempdir().unwrap();
    store::write(directory.path(), &report, &errors).unwrap();
    let mut names: Vec<_> = fs::read_dir(directory.path())
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    assert_eq!(
        names,
        [
            "errors.parquet",
            "report.html",
            "report.json",
            "speed.svg",
            "table.csv",
            "table.md",
            "table.tex"
        ]
    );
    let error = store::write(directory.path(), &report, &errors).unwrap_err();
    assert!(error.to_string().starts_with("a report is already here: "), "{error}");
    assert!(error.hint().unwrap().contains("--out"));
    assert_same(&store::read(directory.path()).unwrap(), &report);
}

#[test]
fn report_of_another_version_is_refused() {
    let directory = tempfile::tempdir().unwrap();
    fs::write(directory.path().join("report.json"), r#"{"version": 9}"#).unwrap();
    let error = store::read(directory.path()).unwrap_err().to_string();
    assert!(error.contains("version 9, this build reads version 2"), "{error}");
}
