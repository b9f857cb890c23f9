//! Errors per frame in, report out: means, intervals, slices, and the verdict in words.

use std::collections::BTreeMap;

use rayon::prelude::*;
use sha2::{Digest as _, Sha256};

use crate::eval::{
    baseline::REFERENCE,
    offline::{
        definitions::{CURVES, METRICS},
        errors::{Errors, FrameKey, PolicyErrors, Row, Sight},
        estimate::{Resampling, estimate, of_means},
        horizons::{HORIZONS, horizons_s},
        report::{
            Dataset, Definition, Estimate, Evaluated, Holdout, Intervals, PolicyReport, Report,
            VERSION,
        },
        slices::{attention, slices},
        trust,
        verdict::paired,
    },
    statistics::{Bootstrap, FEWEST_UNITS, Unit},
};

/// Length of a block of frames, ns: the 3 s over which neighbouring frames share their future.
const BLOCK_NS: i64 = 3_000_000_000;

/// Summarise what [`evaluate`](crate::eval::offline::evaluate::evaluate) found.
pub fn summarise(
    dataset: Dataset,
    holdout: Holdout,
    errors: &Errors,
    bootstrap: Bootstrap,
) -> Report {
    let (unit, unit_of) = units(errors);
    let count = unit_of.iter().max().map_or(0, |&last| u64::from(last) + 1);
    let intervals = Intervals { bootstrap, unit, units: count };
    let resampling = Resampling { bootstrap: &bootstrap, unit_of: &unit_of };
    let references: Vec<&PolicyErrors> = errors
        .policies
        .iter()
        .filter(|policy| policy.name == REFERENCE || policy.sight == Sight::Blind)
        .collect();
    let of_policy = |policy: &PolicyErrors| {
        let rows: Vec<Row> = errors
            .frames
            .iter()
            .zip(&policy.rows)
            .map(|(frame, errors)| Row { frame, errors })
            .collect();
        let compared = references.iter().filter(|reference| {
            let learned = policy.sight != Sight::Baseline;
            let is_itself = reference.name == policy.name || policy.name == REFERENCE;
            !is_itself && !policy.sees_the_future && (reference.name == REFERENCE || learned)
        });
        PolicyReport {
            name: policy.name.clone(),
            sees_the_future: policy.sees_the_future,
            sight: policy.sight,
            fusion: policy.fusion,
            metrics: METRICS
                .par_iter()
                .map(|m| (m.key.to_string(), estimate(&m.measure, &rows, Some(resampling))))
                .collect(),
            curves: CURVES
                .par_iter()
                .map(|curve| (curve.key.to_string(), by_horizon(curve.of, &rows, resampling)))
                .collect(),
            slices: slices(errors, policy),
            paired: compared
                .filter_map(|reference| paired(errors, policy, reference, &unit_of, &intervals))
                .collect(),
            pit: trust::pit(&rows),
            variance: trust::variance(&rows),
            attention: attention(&policy.branches, &rows),
        }
    };
    Report {
        version: VERSION,
        caveats: caveats(&holdout, errors, &intervals),
        dataset,
        evaluated: evaluated(errors),
        holdout,
        metrics: Definition::metrics(),
        curves: Definition::curves(),
        horizons_s: horizons_s().to_vec(),
        policies: errors.policies.iter().map(of_policy).collect(),
        intervals,
    }
}

/// A number at each horizon.
fn by_horizon(
    of: fn(&Row) -> [Option<f64>; HORIZONS],
    rows: &[Row],
    resampling: Resampling,
) -> Vec<Estimate> {
    let values: Vec<_> = rows.iter().map(of).collect();
    let at = |i: usize| values.iter().map(|values| values[i]).collect::<Vec<_>>();
    (0..HORIZONS).map(|i| of_means(&at(i), |mean| mean, Some(resampling))).collect()
}

/// What is resampled, and which one every frame belongs to: episodes if there are enough of them
/// for a claim, else blocks of 3 s counted from the first frame of each episode.
fn units(errors: &Errors) -> (Unit, Vec<u32>) {
    if errors.episodes.len() >= FEWEST_UNITS {
        return (Unit::Episodes, errors.frames.iter().map(|frame| frame.episode).collect());
    }
    let mut starts = BTreeMap::new();
    for frame in &errors.frames {
        starts.entry(frame.episode).or_insert(frame.stamp_ns);
    }
    let block = |frame: &FrameKey| {
        (frame.episode, (frame.stamp_ns - starts[&frame.episode]).div_euclid(BLOCK_NS))
    };
    let mut numbers = BTreeMap::new();
    let of_frame = errors.frames.iter().map(|frame| {
        let next = numbers.len() as u32;
        *numbers.entry(block(frame)).or_insert(next)
    });
    (Unit::Blocks, of_frame.collect())
}

fn evaluated(errors: &Errors) -> Evaluated {
    let mut hash = Sha256::new();
    for frame in &errors.frames {
        let episode = &errors.episodes[frame.episode as usize];
        hash.update(format!("{episode}\t{}\n", frame.frame));
    }
    let sha256 = hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect();
    Evaluated { frames: errors.frames.len() as u64, episodes: errors.episodes.len() as u64, sha256 }
}

fn caveats(holdout: &Holdout, errors: &Errors, intervals: &Intervals) -> Vec<String> {
    let mut caveats = Vec::new();
    if holdout.weak {
        caveats.push(format!(
            "Weak evidence: these frames resemble what was trained on, so the numbers say little \
             of other drives ({}).",
            holdout.how
        ));
    }
    let frames = errors.frames.len() as u64;
    if frames != holdout.frames {
        caveats.push(format!("Only {frames} of {} held-out frames were read.", holdout.frames));
    }
    if intervals.unit == Unit::Blocks {
        caveats.push(format!(
            "Intervals are over blocks of 3 s of {}: they speak of more of the same drives, not \
             of others.",
            Unit::Episodes.counted(errors.episodes.len() as u64)
        ));
    }
    if intervals.units < FEWEST_UNITS as u64 {
        caveats.push(format!(
            "Too few for any claim: {}, and {FEWEST_UNITS} are the fewest.",
            intervals.unit.counted(intervals.units)
        ));
    }
    let of_sight = |sight| errors.policies.iter().any(|policy| policy.sight == sight);
    if of_sight(Sight::Seeing) && !of_sight(Sight::Blind) {
        caveats.push(
            "No policy beside these is blind, so what the sensors are good for cannot be told: train \
             one with `pmp-train --data DATASET --out RUN --model blind` and evaluate it as well."
                .to_string(),
        );
    }
    for policy in errors.policies.iter().filter(|policy| policy.sees_the_future) {
        caveats.push(format!(
            "`{}` reads what the driver did next: it is a floor, not a driver.",
            policy.name
        ));
    }
    caveats
}
