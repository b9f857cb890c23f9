//! What every number in a report is: two tables. Nothing else spells a metric's key or unit.
//!
//! `schemas/report.v2.json` says the same for readers who have no Rust; a test holds the two
//! against each other.

use self::{
    Better::{Higher, Lower, Near},
    Measure::{Histogram, Mean, Pairs, Ratio, RootMeanSquare},
};
use crate::eval::{
    offline::{
        errors::Row,
        horizons::{HORIZONS, WHOLE_SECONDS},
        measures::{
            auroc_of_worst_tenth, calibration_error, event, greatest_deviation, onset_is_missed,
            onset_late_s,
        },
        mixture_errors::MixtureErrors,
    },
    statistics::rank::spearman,
};

/// Which way a metric is good.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Better {
    Lower,
    Higher,
    /// The nearer to this value the better: a share that should be what it claims to be.
    Near(f64),
}

impl Better {
    /// As written in tables: `lower`, `near 0.8`.
    pub fn text(self) -> String {
        match self {
            Better::Lower => "lower".to_string(),
            Better::Higher => "higher".to_string(),
            Better::Near(target) => format!("near {target}"),
        }
    }
}

/// How frames become one number.
#[derive(Clone, Copy, Debug)]
pub enum Measure {
    Mean(fn(&Row) -> Option<f64>),
    RootMeanSquare(fn(&Row) -> Option<f64>),
    /// The sum of the first over the sum of the second.
    Ratio(fn(&Row) -> Option<[f64; 2]>),
    /// Of how many of the numbers in [0, 1] that a frame has lie in each hundredth.
    Histogram(fn(&MixtureErrors) -> &[f32], fn(&[f64]) -> f64),
    /// Of two numbers of every frame.
    Pairs(fn(&Row) -> Option<[f64; 2]>, fn(&[[f64; 2]]) -> Option<f64>),
}

/// One row of [`METRICS`].
#[derive(Clone, Copy, Debug)]
pub struct Metric {
    /// Name in JSON, CSV and, for means, of the column in `errors.parquet`.
    pub key: &'static str,
    /// What it is about: a heading in tables.
    pub group: &'static str,
    pub title: &'static str,
    /// `1` for a number without unit.
    pub unit: &'static str,
    pub better: Better,
    pub definition: &'static str,
    pub measure: Measure,
}

/// A number at each of the horizons, each the mean over frames.
#[derive(Clone, Copy, Debug)]
pub struct Curve {
    /// Name in JSON and of the column in `errors.parquet`, a list of the horizons.
    pub key: &'static str,
    pub title: &'static str,
    pub unit: &'static str,
    pub better: Option<Better>,
    pub definition: &'static str,
    /// Of one frame, in `unit`.
    pub of: fn(&Row) -> [Option<f64>; HORIZONS],
}

const MOTION: &str = "Motion";
const MIXTURE: &str = "Mixture";
const VARIANCE: &str = "Variance";

/// 1, 2 and 3 s among the horizons.
const AT_1S: usize = WHOLE_SECONDS[0];
const AT_2S: usize = WHOLE_SECONDS[1];
const AT_3S: usize = WHOLE_SECONDS[2];

/// Farther than this within 3 s is a miss, m.
pub const MISS_M: f64 = 2.0;

/// What is measured of an action, for each of `SOURCES`: their place there, the beginning of the
/// keys, the heading, and what stands behind the titles.
macro_rules! action_metrics {
    ($source:literal, $key:literal, $group:literal, $title:literal) => { [
        Metric { key: concat!($key, "steer_l1"), title: concat!("Steer L1", $title), group: $group, unit: "1", better: Lower, measure: Mean(|r| Some(r.steering($source)?.l1())), definition: "mean |planned - recorded| steering in [-1, 1], over frames whose log has steering" },
        Metric { key: concat!($key, "throttle_l1"), title: concat!("Throttle L1", $title), group: $group, unit: "1", better: Lower, measure: Mean(|r| Some(f64::from((r.errors.planned[$source]?.throttle - r.frame.recorded.throttle?).abs()))), definition: "mean |planned - recorded| throttle in [0, 1], over frames whose log has throttle" },
        Metric { key: concat!($key, "brake_l1"), title: concat!("Brake L1", $title), group: $group, unit: "1", better: Lower, measure: Mean(|r| Some(f64::from((r.errors.planned[$source]?.brake - r.frame.recorded.brake?).abs()))), definition: "mean |planned - recorded| brake in [0, 1], over frames whose log has brake" },
        Metric { key: concat!($key, "steer_speed_weighted"), title: concat!("Steer, speed-weighted", $title), group: $group, unit: "m/s", better: Lower, measure: Mean(|r| Some(r.steering($source)?.speed_weighted_mps())), definition: "mean |planned - recorded| steering x |speed| (Codevilla et al., 2018)" },
        Metric { key: concat!($key, "steer_cumulative"), title: concat!("Steer, cumulative", $title), group: $group, unit: "m", better: Lower, measure: Mean(|r| r.errors.steer_way_m[$source]), definition: "mean |sum of (planned - recorded) steering x |speed| x 0.1 s| over windows of 16 frames, 1.6 s, one ending at every frame (Codevilla et al., 2018)" },
        Metric { key: concat!($key, "steer_class_error"), title: concat!("Steer, other class", $title), group: $group, unit: "1", better: Lower, measure: Mean(|r| Some(f64::from(u8::from(r.steering($source)?.is_other_class())))), definition: "share of frames where left, straight on and right are mistaken; straight on is within 0.03 (Codevilla et al., 2018)" },
        Metric { key: concat!($key, "steer_relative_error"), title: concat!("Steer, off by a tenth", $title), group: $group, unit: "1", better: Lower, measure: Mean(|r| Some(f64::from(u8::from(r.steering($source)?.is_beyond_tolerance())))), definition: "share of frames where |planned - recorded| steering is above 0.1 x |recorded| (Codevilla et al., 2018)" },
        Metric { key: concat!($key, "brake_precision"), title: concat!("Brake precision", $title), group: $group, unit: "1", better: Higher, measure: Ratio(|r| event(r.brake($source)).map(|e| e.precision())), definition: "of the frames where it brakes (brake above 0.1), the share where the driver brakes" },
        Metric { key: concat!($key, "brake_recall"), title: concat!("Brake recall", $title), group: $group, unit: "1", better: Higher, measure: Ratio(|r| event(r.brake($source)).map(|e| e.recall())), definition: "of the frames where the driver brakes (brake above 0.1), the share where it brakes" },
        Metric { key: concat!($key, "brake_f1"), title: concat!("Brake F1", $title), group: $group, unit: "1", better: Higher, measure: Ratio(|r| event(r.brake($source)).map(|e| e.f1())), definition: "harmonic mean of brake precision and recall" },
        Metric { key: concat!($key, "throttle_precision"), title: concat!("Throttle precision", $title), group: $group, unit: "1", better: Higher, measure: Ratio(|r| event(r.throttle($source)).map(|e| e.precision())), definition: "as brake precision, of the throttle" },
        Metric { key: concat!($key, "throttle_recall"), title: concat!("Throttle recall", $title), group: $group, unit: "1", better: Higher, measure: Ratio(|r| event(r.throttle($source)).map(|e| e.recall())), definition: "as brake recall, of the throttle" },
        Metric { key: concat!($key, "throttle_f1"), title: concat!("Throttle F1", $title), group: $group, unit: "1", better: Higher, measure: Ratio(|r| event(r.throttle($source)).map(|e| e.f1())), definition: "as brake F1, of the throttle" },
        Metric { key: concat!($key, "brake_onset_error"), title: concat!("Time to brake", $title), group: $group, unit: "s", better: Lower, measure: Mean(|r| Some(onset_late_s(r, $source)?.abs())), definition: "mean |time between the driver's and its own beginning to brake|, over those that are within 3 s of each other; having braked for longer counts as 3 s" },
        Metric { key: concat!($key, "brake_onset_missed"), title: concat!("Brakings missed", $title), group: $group, unit: "1", better: Lower, measure: Mean(|r| onset_is_missed(r, $source)), definition: "share of the driver's beginnings to brake without one of its own within 3 s, nor braking already" },
    ] };
}

/// Every metric of a plan's motion.
#[rustfmt::skip]
const MOTION_METRICS: [Metric; 33] = [
    Metric { key: "ade_1s",        group: MOTION, title: "ADE 1 s",           unit: "m",    better: Lower,      measure: Mean(|r| r.errors.ade_m[AT_1S]),            definition: "mean distance to the recorded position over t = 0.1 ... 1.0 s, strongest mode" },
    Metric { key: "ade_2s",        group: MOTION, title: "ADE 2 s",           unit: "m",    better: Lower,      measure: Mean(|r| r.errors.ade_m[AT_2S]),            definition: "mean distance to the recorded position over t = 0.1 ... 2.0 s, strongest mode" },
    Metric { key: "ade_3s",        group: MOTION, title: "ADE 3 s",           unit: "m",    better: Lower,      measure: Mean(|r| r.errors.ade_m[AT_3S]),            definition: "mean distance to the recorded position over t = 0.1 ... 3.0 s, strongest mode" },
    Metric { key: "fde_1s",        group: MOTION, title: "FDE 1 s",           unit: "m",    better: Lower,      measure: Mean(|r| r.errors.fde_m[AT_1S]),            definition: "mean distance to the recorded position at 1 s, strongest mode" },
    Metric { key: "fde_2s",        group: MOTION, title: "FDE 2 s",           unit: "m",    better: Lower,      measure: Mean(|r| r.errors.fde_m[AT_2S]),            definition: "mean distance to the recorded position at 2 s, strongest mode" },
    Metric { key: "fde_3s",        group: MOTION, title: "FDE 3 s",           unit: "m",    better: Lower,      measure: Mean(|r| r.errors.fde_m[AT_3S]),            definition: "mean distance to the recorded position at 3 s, strongest mode" },
    Metric { key: "min_ade_3s",    group: MOTION, title: "minADE 3 s",        unit: "m",    better: Lower,      measure: Mean(|r| r.errors.min_ade_m),               definition: "as ADE 3 s, of the mode that comes nearest: more modes can only lower it" },
    Metric { key: "min_fde_3s",    group: MOTION, title: "minFDE 3 s",        unit: "m",    better: Lower,      measure: Mean(|r| r.errors.min_fde_m),               definition: "as FDE 3 s, of the mode that comes nearest there: more modes can only lower it" },
    Metric { key: "miss_3s",       group: MOTION, title: "Miss rate 3 s",     unit: "1",    better: Lower,      measure: Mean(|r| Some(f64::from(u8::from(r.errors.largest_m? > MISS_M)))), definition: "share of frames where the plan is more than 2 m from the recorded position at any time within 3 s, strongest mode" },
    Metric { key: "min_miss_3s",   group: MOTION, title: "minMiss rate 3 s",  unit: "1",    better: Lower,      measure: Mean(|r| Some(f64::from(u8::from(r.errors.min_largest_m? > MISS_M)))), definition: "as the miss rate, of every mode: share of frames where none stays within 2 m" },
    Metric { key: "target_fde",    group: MOTION, title: "FDE at 5 m",        unit: "m",    better: Lower,      measure: Mean(|r| r.errors.target_m),                definition: "mean distance to the recorded position at the step where the planned way is 5 m long, at 3 s if it is never: what a2 steers to" },
    Metric { key: "target_ade",    group: MOTION, title: "ADE at 5 m",        unit: "m",    better: Lower,      measure: Mean(|r| r.errors.target_ade_m),            definition: "mean distance to the recorded position up to that step" },
    Metric { key: "speed_mae_1s",  group: MOTION, title: "Speed error 1 s",   unit: "m/s",  better: Lower,      measure: Mean(|r| Some(r.errors.speed_mps[AT_1S]?.abs())), definition: "mean |planned - recorded| speed at 1 s, strongest mode" },
    Metric { key: "speed_mae_2s",  group: MOTION, title: "Speed error 2 s",   unit: "m/s",  better: Lower,      measure: Mean(|r| Some(r.errors.speed_mps[AT_2S]?.abs())), definition: "mean |planned - recorded| speed at 2 s, strongest mode" },
    Metric { key: "speed_mae_3s",  group: MOTION, title: "Speed error 3 s",   unit: "m/s",  better: Lower,      measure: Mean(|r| Some(r.errors.speed_mps[AT_3S]?.abs())), definition: "mean |planned - recorded| speed at 3 s, strongest mode" },
    Metric { key: "speed_bias_1s", group: MOTION, title: "Speed bias 1 s",    unit: "m/s",  better: Near(0.0),  measure: Mean(|r| r.errors.speed_mps[AT_1S]),        definition: "mean of planned - recorded speed at 1 s, above 0 if too fast, strongest mode" },
    Metric { key: "speed_bias_2s", group: MOTION, title: "Speed bias 2 s",    unit: "m/s",  better: Near(0.0),  measure: Mean(|r| r.errors.speed_mps[AT_2S]),        definition: "mean of planned - recorded speed at 2 s, above 0 if too fast, strongest mode" },
    Metric { key: "speed_bias_3s", group: MOTION, title: "Speed bias 3 s",    unit: "m/s",  better: Near(0.0),  measure: Mean(|r| r.errors.speed_mps[AT_3S]),        definition: "mean of planned - recorded speed at 3 s, above 0 if too fast, strongest mode" },
    Metric { key: "speed_rmse_1s", group: MOTION, title: "Speed RMSE 1 s",    unit: "m/s",  better: Lower,      measure: RootMeanSquare(|r| r.errors.speed_mps[AT_1S]), definition: "root of the mean squared speed error at 1 s, strongest mode" },
    Metric { key: "speed_rmse_2s", group: MOTION, title: "Speed RMSE 2 s",    unit: "m/s",  better: Lower,      measure: RootMeanSquare(|r| r.errors.speed_mps[AT_2S]), definition: "root of the mean squared speed error at 2 s, strongest mode" },
    Metric { key: "speed_rmse_3s", group: MOTION, title: "Speed RMSE 3 s",    unit: "m/s",  better: Lower,      measure: RootMeanSquare(|r| r.errors.speed_mps[AT_3S]), definition: "root of the mean squared speed error at 3 s, strongest mode" },
    Metric { key: "heading_mean",  group: MOTION, title: "AHE 3 s",           unit: "rad",  better: Lower,      measure: Mean(|r| r.errors.mean_heading_rad),        definition: "mean |planned - recorded| yaw change over t = 0.1 ... 3.0 s, wrapped, strongest mode" },
    Metric { key: "heading_3s",    group: MOTION, title: "FHE 3 s",           unit: "rad",  better: Lower,      measure: Mean(|r| r.errors.heading_rad[AT_3S]),      definition: "mean |planned - recorded| yaw change at 3 s, wrapped, strongest mode" },
    Metric { key: "nll",           group: MIXTURE, title: "NLL per number",   unit: "nats", better: Lower,      measure: Mean(|r| Some(r.errors.mixture.as_ref()?.nll_nats)), definition: "negative log-likelihood of the recorded 3 s under the mixture, divided by its 60 numbers; speed in units of 10 m/s, yaw in rad, so it may be negative; none for a policy without deviations" },
    Metric { key: "crps_speed",    group: MIXTURE, title: "CRPS of speed",    unit: "m/s",  better: Lower,      measure: Mean(|r| Some(r.errors.mixture.as_ref()?.crps[0])), definition: "mean continuous ranked probability score of the mixture of speed over t = 0.1 ... 3.0 s: the absolute error of a plan, for one that says how sure it is" },
    Metric { key: "crps_yaw",      group: MIXTURE, title: "CRPS of yaw",      unit: "rad",  better: Lower,      measure: Mean(|r| Some(r.errors.mixture.as_ref()?.crps[1])), definition: "as the CRPS of speed, of the yaw change, the short way round" },
    Metric { key: "coverage_50",   group: MIXTURE, title: "Coverage of 50 %", unit: "1",    better: Near(0.5),  measure: Mean(|r| Some(r.errors.mixture.as_ref()?.inside[0])), definition: "share of recorded speeds and yaw changes inside the central 50 % of the mixture" },
    Metric { key: "coverage_80",   group: MIXTURE, title: "Coverage of 80 %", unit: "1",    better: Near(0.8),  measure: Mean(|r| Some(r.errors.mixture.as_ref()?.inside[1])), definition: "share of recorded speeds and yaw changes inside the central 80 % of the mixture" },
    Metric { key: "coverage_95",   group: MIXTURE, title: "Coverage of 95 %", unit: "1",    better: Near(0.95), measure: Mean(|r| Some(r.errors.mixture.as_ref()?.inside[2])), definition: "share of recorded speeds and yaw changes inside the central 95 % of the mixture" },
    Metric { key: "ece_speed",     group: MIXTURE, title: "ECE of speed",     unit: "1",    better: Lower,      measure: Histogram(|m| &m.pit[0], calibration_error),  definition: "expected calibration error: with u the share of the mixture at or below the recorded speed (PIT), over all frames and steps, the mean over q = 0.05, 0.10 ... 0.95 of |share of u <= q - q|" },
    Metric { key: "ece_yaw",       group: MIXTURE, title: "ECE of yaw",       unit: "1",    better: Lower,      measure: Histogram(|m| &m.pit[1], calibration_error),  definition: "as the ECE of speed, of the yaw change" },
    Metric { key: "ks_speed",      group: MIXTURE, title: "KS of speed",      unit: "1",    better: Lower,      measure: Histogram(|m| &m.pit[0], greatest_deviation), definition: "Kolmogorov and Smirnov's distance of the PIT of speed from uniform, over q = 0.01, 0.02 ... 0.99: the greatest |share of u <= q - q|" },
    Metric { key: "ks_yaw",        group: MIXTURE, title: "KS of yaw",        unit: "1",    better: Lower,      measure: Histogram(|m| &m.pit[1], greatest_deviation), definition: "as the KS of speed, of the yaw change" },
];

/// Whether a plan knows when it is wrong.
#[rustfmt::skip]
const VARIANCE_METRICS: [Metric; 2] = [
    Metric { key: "variance_spearman", group: VARIANCE, title: "Variance against error", unit: "1", better: Higher,    measure: Pairs(variance_and_error, spearman),             definition: "Spearman's correlation of S, the variance of the plan up to its target 5 m ahead (eq. (3)), and the FDE at 5 m: 1 if the variance ranks frames as the error does, 0 if it tells nothing" },
    Metric { key: "variance_auroc",    group: VARIANCE, title: "Variance finds the worst", unit: "1", better: Higher,  measure: Pairs(variance_and_error, auroc_of_worst_tenth), definition: "area under the ROC curve of S for an FDE at 5 m above its 90th percentile: 1 if the worst tenth have the highest variances, 0.5 if by chance" },
];

#[rustfmt::skip]
const A1_METRICS: [Metric; 15] = action_metrics!(0, "", "Action a1: its own", "");
#[rustfmt::skip]
const A2_METRICS: [Metric; 15] = action_metrics!(1, "a2_", "Action a2: of the controller that follows its plan", " (a2)");
#[rustfmt::skip]
const FUSED_METRICS: [Metric; 15] = action_metrics!(2, "fused_", "Fused action: both by eq. (3), after the rules for pedals", " (fused)");

/// Every metric of an offline evaluation, in the order of reports.
pub static METRICS: [Metric; 80] = all();

const fn all() -> [Metric; 80] {
    let mut metrics = [MOTION_METRICS[0]; 80];
    let parts: [&[Metric]; 5] =
        [&MOTION_METRICS, &VARIANCE_METRICS, &A1_METRICS, &A2_METRICS, &FUSED_METRICS];
    let (mut part, mut at) = (0, 0);
    while part < parts.len() {
        let mut i = 0;
        while i < parts[part].len() {
            metrics[at] = parts[part][i];
            (i, at) = (i + 1, at + 1);
        }
        part += 1;
    }
    assert!(at == metrics.len(), "every place is taken");
    metrics
}

/// Every curve by horizon.
#[rustfmt::skip]
pub const CURVES: &[Curve] = &[
    Curve { key: "ade",               title: "ADE",                        unit: "m",   better: Some(Lower),      of: |r| r.errors.ade_m,                        definition: "mean distance to the recorded position up to the horizon, strongest mode" },
    Curve { key: "fde",               title: "FDE",                        unit: "m",   better: Some(Lower),      of: |r| r.errors.fde_m,                        definition: "mean distance to the recorded position at the horizon, strongest mode" },
    Curve { key: "speed_mae",         title: "Speed error",                unit: "m/s", better: Some(Lower),      of: |r| r.errors.speed_mps.map(|v| v.map(f64::abs)), definition: "mean |planned - recorded| speed, strongest mode" },
    Curve { key: "speed_bias",        title: "Speed bias",                 unit: "m/s", better: Some(Near(0.0)),  of: |r| r.errors.speed_mps,                    definition: "mean of planned - recorded speed, strongest mode" },
    Curve { key: "heading",           title: "Heading error",              unit: "rad", better: Some(Lower),      of: |r| r.errors.heading_rad,                  definition: "mean |planned - recorded| yaw change, wrapped, strongest mode" },
    Curve { key: "crps_speed",        title: "CRPS of speed",              unit: "m/s", better: Some(Lower),      of: |r| mixed(r, |m, i| m.crps_at[0][i]),      definition: "mean continuous ranked probability score of the mixture of speed" },
    Curve { key: "crps_yaw",          title: "CRPS of yaw",                unit: "rad", better: Some(Lower),      of: |r| mixed(r, |m, i| m.crps_at[1][i]),      definition: "mean continuous ranked probability score of the mixture of the yaw change" },
    Curve { key: "coverage_speed_50", title: "Coverage of 50 %, speed",    unit: "1",   better: Some(Near(0.5)),  of: |r| mixed(r, |m, i| m.inside_at(0, 0, i)), definition: "share of recorded speeds inside the central 50 % of the mixture" },
    Curve { key: "coverage_speed_80", title: "Coverage of 80 %, speed",    unit: "1",   better: Some(Near(0.8)),  of: |r| mixed(r, |m, i| m.inside_at(0, 1, i)), definition: "share of recorded speeds inside the central 80 % of the mixture" },
    Curve { key: "coverage_speed_95", title: "Coverage of 95 %, speed",    unit: "1",   better: Some(Near(0.95)), of: |r| mixed(r, |m, i| m.inside_at(0, 2, i)), definition: "share of recorded speeds inside the central 95 % of the mixture" },
    Curve { key: "coverage_yaw_50",   title: "Coverage of 50 %, yaw",      unit: "1",   better: Some(Near(0.5)),  of: |r| mixed(r, |m, i| m.inside_at(1, 0, i)), definition: "share of recorded yaw changes inside the central 50 % of the mixture" },
    Curve { key: "coverage_yaw_80",   title: "Coverage of 80 %, yaw",      unit: "1",   better: Some(Near(0.8)),  of: |r| mixed(r, |m, i| m.inside_at(1, 1, i)), definition: "share of recorded yaw changes inside the central 80 % of the mixture" },
    Curve { key: "coverage_yaw_95",   title: "Coverage of 95 %, yaw",      unit: "1",   better: Some(Near(0.95)), of: |r| mixed(r, |m, i| m.inside_at(1, 2, i)), definition: "share of recorded yaw changes inside the central 95 % of the mixture" },
    Curve { key: "width_speed_50",    title: "Width of 50 %, speed",       unit: "m/s", better: None,             of: |r| mixed(r, |m, i| m.width_at[0][0][i]),  definition: "mean width of the central 50 % of the mixture of speed (sharpness): narrow is good only where the coverage is right" },
    Curve { key: "width_speed_80",    title: "Width of 80 %, speed",       unit: "m/s", better: None,             of: |r| mixed(r, |m, i| m.width_at[0][1][i]),  definition: "mean width of the central 80 % of the mixture of speed (sharpness)" },
    Curve { key: "width_speed_95",    title: "Width of 95 %, speed",       unit: "m/s", better: None,             of: |r| mixed(r, |m, i| m.width_at[0][2][i]),  definition: "mean width of the central 95 % of the mixture of speed (sharpness)" },
    Curve { key: "width_yaw_50",      title: "Width of 50 %, yaw",         unit: "rad", better: None,             of: |r| mixed(r, |m, i| m.width_at[1][0][i]),  definition: "mean width of the central 50 % of the mixture of the yaw change (sharpness)" },
    Curve { key: "width_yaw_80",      title: "Width of 80 %, yaw",         unit: "rad", better: None,             of: |r| mixed(r, |m, i| m.width_at[1][1][i]),  definition: "mean width of the central 80 % of the mixture of the yaw change (sharpness)" },
    Curve { key: "width_yaw_95",      title: "Width of 95 %, yaw",         unit: "rad", better: None,             of: |r| mixed(r, |m, i| m.width_at[1][2][i]),  definition: "mean width of the central 95 % of the mixture of the yaw change (sharpness)" },
];

/// The metric on which policies are compared in words.
pub const HEADLINE: &str = "speed_mae_3s";

/// The metric of that key.
pub fn metric(key: &str) -> Option<&'static Metric> {
    METRICS.iter().find(|metric| metric.key == key)
}

fn variance_and_error(row: &Row) -> Option<[f64; 2]> {
    Some([row.errors.variance?, row.errors.target_m?])
}

fn mixed(row: &Row, at: fn(&MixtureErrors, usize) -> f64) -> [Option<f64>; HORIZONS] {
    std::array::from_fn(|i| row.errors.mixture.as_ref().map(|mixture| at(mixture, i)))
}
