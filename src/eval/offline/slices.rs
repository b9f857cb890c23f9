//! The same numbers over some of the frames: by command, by speed, and by surroundings.

use std::collections::{BTreeMap, BTreeSet};

use crate::{
    eval::offline::{
        definitions::METRICS,
        errors::{Errors, FrameKey, PolicyErrors, Row},
        estimate::estimate,
        report::Slice,
    },
    frame::{Command, Conditions},
};

/// Bounds of the slices by |speed|, m/s: 0-5, 5-10, 10-15, 15+.
const SPEED_BINS_MPS: [(&str, f32, f32); 4] =
    [("0-5", 0.0, 5.0), ("5-10", 5.0, 10.0), ("10-15", 10.0, 15.0), ("15+", 15.0, f32::INFINITY)];

/// What surroundings are told apart by, in the order of reports.
type Surroundings = (&'static str, fn(&Conditions) -> Option<&str>);
const SURROUNDINGS: [Surroundings; 4] = [
    ("town", |conditions| conditions.town.as_deref()),
    ("weather", |conditions| conditions.weather.as_deref()),
    ("illumination", |conditions| conditions.illumination.as_deref()),
    ("traffic", |conditions| conditions.traffic.as_deref()),
];

/// What frames are called of which nothing is known, where something is known of others.
const UNKNOWN: &str = "unknown";

/// All slices of one policy. What is known of no frame makes none.
pub fn slices(errors: &Errors, policy: &PolicyErrors) -> Vec<Slice> {
    let slice = |by: &str, name: &str, belongs: &dyn Fn(&FrameKey) -> bool| {
        let rows = errors.frames.iter().zip(&policy.rows);
        let inside: Vec<Row> = rows
            .filter(|(frame, _)| belongs(frame))
            .map(|(frame, errors)| Row { frame, errors })
            .collect();
        let metrics =
            METRICS.iter().map(|m| (m.key.to_string(), estimate(&m.measure, &inside, None)));
        Slice {
            by: by.to_string(),
            name: name.to_string(),
            frames: inside.len() as u64,
            metrics: metrics.filter(|(_, estimate)| estimate.value.is_some()).collect(),
            attention: attention(&policy.branches, &inside),
        }
    };
    let commands = Command::ALL
        .map(|command| slice("command", command.name(), &|frame| frame.command == command));
    let speeds = SPEED_BINS_MPS.map(|(name, from, to)| {
        slice("speed", name, &|frame| (from..to).contains(&frame.speed_mps.abs()))
    });
    let mut slices: Vec<Slice> = commands.into_iter().chain(speeds).collect();
    for (by, of) in SURROUNDINGS {
        let name =
            |frame: &FrameKey| of(&errors.conditions[frame.conditions as usize]).unwrap_or(UNKNOWN);
        let names: BTreeSet<&str> = errors.frames.iter().map(name).collect();
        if names.iter().any(|name| *name != UNKNOWN) {
            slices.extend(names.iter().map(|n| slice(by, n, &|frame| name(frame) == *n)));
        }
    }
    slices
}

/// Mean share of each branch over rows that have shares.
pub fn attention(branches: &[&str], rows: &[Row]) -> BTreeMap<String, f64> {
    let with: Vec<_> = rows.iter().filter(|row| !row.errors.attention.is_empty()).collect();
    if with.is_empty() {
        return BTreeMap::new();
    }
    let mean = |i: usize| {
        let shares = with.iter().filter_map(|row| row.errors.attention.get(i));
        shares.map(|share| f64::from(*share)).sum::<f64>() / with.len() as f64
    };
    branches.iter().enumerate().map(|(i, branch)| (branch.to_string(), mean(i))).collect()
}
