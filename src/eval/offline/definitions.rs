//! What every number in a report is: one table. Nothing else spells a metric's key or unit.
//!
//! `schemas/report.v1.json` says the same for readers who have no Rust; a test holds the two
//! against each other.

use self::{
    Aggregate::{Mean, RootMeanSquare},
    Better::{Lower, Near},
};
use crate::eval::offline::metrics::FrameErrors;

/// Which way a metric is good.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Better {
    Lower,
    /// The nearer to this value the better: a share that should be what it claims to be.
    Near(f64),
}

impl Better {
    /// As written in tables: `lower`, `near 0.8`.
    pub fn text(self) -> String {
        match self {
            Better::Lower => "lower".to_string(),
            Better::Near(target) => format!("near {target}"),
        }
    }
}

/// How the errors of frames become one number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Aggregate {
    Mean,
    RootMeanSquare,
}

/// One row of [`METRICS`].
#[derive(Clone, Copy, Debug)]
pub struct Metric {
    /// Name in JSON, CSV and, for means, of the column in `errors.parquet`.
    pub key: &'static str,
    pub title: &'static str,
    /// `1` for a number without unit.
    pub unit: &'static str,
    pub better: Better,
    pub definition: &'static str,
    pub aggregate: Aggregate,
    /// The error of one frame that is aggregated, in `unit`.
    pub of: fn(&FrameErrors) -> Option<f64>,
}

/// Every metric of an offline evaluation, in the order of reports.
#[rustfmt::skip]
pub const METRICS: &[Metric] = &[
    Metric { key: "steer_l1",      title: "Steer L1",         unit: "1",    better: Lower,      aggregate: Mean,           of: |e| e.steer,        definition: "mean |planned - recorded| steering in [-1, 1], over frames whose log has steering" },
    Metric { key: "throttle_l1",   title: "Throttle L1",      unit: "1",    better: Lower,      aggregate: Mean,           of: |e| e.throttle,     definition: "mean |planned - recorded| throttle in [0, 1], over frames whose log has throttle" },
    Metric { key: "brake_l1",      title: "Brake L1",         unit: "1",    better: Lower,      aggregate: Mean,           of: |e| e.brake,        definition: "mean |planned - recorded| brake in [0, 1], over frames whose log has brake" },
    Metric { key: "ade_1s",        title: "ADE 1 s",          unit: "m",    better: Lower,      aggregate: Mean,           of: |e| e.ade_m[0],     definition: "mean distance to the recorded position over t = 0.1 ... 1.0 s, strongest mode" },
    Metric { key: "ade_2s",        title: "ADE 2 s",          unit: "m",    better: Lower,      aggregate: Mean,           of: |e| e.ade_m[1],     definition: "mean distance to the recorded position over t = 0.1 ... 2.0 s, strongest mode" },
    Metric { key: "ade_3s",        title: "ADE 3 s",          unit: "m",    better: Lower,      aggregate: Mean,           of: |e| e.ade_m[2],     definition: "mean distance to the recorded position over t = 0.1 ... 3.0 s, strongest mode" },
    Metric { key: "fde_1s",        title: "FDE 1 s",          unit: "m",    better: Lower,      aggregate: Mean,           of: |e| e.fde_m[0],     definition: "mean distance to the recorded position at 1 s, strongest mode" },
    Metric { key: "fde_2s",        title: "FDE 2 s",          unit: "m",    better: Lower,      aggregate: Mean,           of: |e| e.fde_m[1],     definition: "mean distance to the recorded position at 2 s, strongest mode" },
    Metric { key: "fde_3s",        title: "FDE 3 s",          unit: "m",    better: Lower,      aggregate: Mean,           of: |e| e.fde_m[2],     definition: "mean distance to the recorded position at 3 s, strongest mode" },
    Metric { key: "min_ade_3s",    title: "minADE 3 s",       unit: "m",    better: Lower,      aggregate: Mean,           of: |e| e.min_ade_m,    definition: "as ADE 3 s, of the mode that comes nearest: more modes can only lower it" },
    Metric { key: "speed_mae_1s",  title: "Speed error 1 s",  unit: "m/s",  better: Lower,      aggregate: Mean,           of: |e| e.speed_mps[0], definition: "mean |planned - recorded| speed at 1 s, strongest mode" },
    Metric { key: "speed_mae_2s",  title: "Speed error 2 s",  unit: "m/s",  better: Lower,      aggregate: Mean,           of: |e| e.speed_mps[1], definition: "mean |planned - recorded| speed at 2 s, strongest mode" },
    Metric { key: "speed_mae_3s",  title: "Speed error 3 s",  unit: "m/s",  better: Lower,      aggregate: Mean,           of: |e| e.speed_mps[2], definition: "mean |planned - recorded| speed at 3 s, strongest mode" },
    Metric { key: "speed_rmse_1s", title: "Speed RMSE 1 s",   unit: "m/s",  better: Lower,      aggregate: RootMeanSquare, of: |e| e.speed_mps[0], definition: "root of the mean squared speed error at 1 s, strongest mode" },
    Metric { key: "speed_rmse_2s", title: "Speed RMSE 2 s",   unit: "m/s",  better: Lower,      aggregate: RootMeanSquare, of: |e| e.speed_mps[1], definition: "root of the mean squared speed error at 2 s, strongest mode" },
    Metric { key: "speed_rmse_3s", title: "Speed RMSE 3 s",   unit: "m/s",  better: Lower,      aggregate: RootMeanSquare, of: |e| e.speed_mps[2], definition: "root of the mean squared speed error at 3 s, strongest mode" },
    Metric { key: "heading_3s",    title: "Heading error 3 s", unit: "rad", better: Lower,      aggregate: Mean,           of: |e| e.heading_rad,  definition: "mean |planned - recorded| yaw change at 3 s, wrapped, strongest mode" },
    Metric { key: "nll",           title: "NLL per number",   unit: "nats", better: Lower,      aggregate: Mean,           of: |e| e.nll_nats,     definition: "negative log-likelihood of the recorded 3 s under the mixture, divided by its 60 numbers; speed in units of 10 m/s, yaw in rad, so it may be negative; none for a policy without deviations" },
    Metric { key: "coverage_50",   title: "Coverage of 50 %", unit: "1",    better: Near(0.5),  aggregate: Mean,           of: |e| e.inside[0],    definition: "share of recorded speeds and yaw changes inside the central 50 % of the mixture" },
    Metric { key: "coverage_80",   title: "Coverage of 80 %", unit: "1",    better: Near(0.8),  aggregate: Mean,           of: |e| e.inside[1],    definition: "share of recorded speeds and yaw changes inside the central 80 % of the mixture" },
    Metric { key: "coverage_95",   title: "Coverage of 95 %", unit: "1",    better: Near(0.95), aggregate: Mean,           of: |e| e.inside[2],    definition: "share of recorded speeds and yaw changes inside the central 95 % of the mixture" },
];

/// The metric on which policies are compared in words.
pub const HEADLINE: &str = "speed_mae_3s";

/// The metric of that key.
pub fn metric(key: &str) -> Option<&'static Metric> {
    METRICS.iter().find(|metric| metric.key == key)
}
