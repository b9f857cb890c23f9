//! Errors per frame in, report out: means, intervals, slices, and the verdict in words.

use std::collections::BTreeMap;

use rayon::prelude::*;
use sha2::{Digest as _, Sha256};

use crate::{
    eval::{
        baseline::REFERENCE,
        offline::{
            definitions::{Aggregate, HEADLINE, METRICS, Metric, metric},
            evaluate::{Errors, FrameKey, PolicyErrors},
            metrics::FrameErrors,
            report::{
                Dataset, Definition, Estimate, Evaluated, Holdout, Intervals, Paired, PolicyReport,
                Report, Slice, VERSION, Verdict,
            },
        },
        statistics::{Bootstrap, FEWEST_UNITS, Unit, mean, units_with_a_value},
    },
    frame::Command,
};

/// Bounds of the slices by |speed|, m/s: 0-5, 5-10, 10-15, 15+.
const SPEED_BINS_MPS: [(&str, f32, f32); 4] =
    [("0-5", 0.0, 5.0), ("5-10", 5.0, 10.0), ("10-15", 10.0, 15.0), ("15+", 15.0, f32::INFINITY)];

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
    let reference = errors.policies.iter().find(|policy| policy.name == REFERENCE);
    let of_policy = |policy: &PolicyErrors| {
        let compared = reference.filter(|r| r.name != policy.name && !policy.sees_the_future);
        PolicyReport {
            name: policy.name.clone(),
            sees_the_future: policy.sees_the_future,
            metrics: METRICS
                .par_iter()
                .map(|m| (m.key.to_string(), estimate(m, &policy.rows, &unit_of, &bootstrap)))
                .collect(),
            slices: slices(&errors.frames, &policy.rows),
            paired: compared.and_then(|r| paired(policy, r, &unit_of, &intervals)),
        }
    };
    Report {
        version: VERSION,
        caveats: caveats(&holdout, errors, &intervals),
        dataset,
        evaluated: evaluated(errors),
        holdout,
        metrics: Definition::all(),
        policies: errors.policies.iter().map(of_policy).collect(),
        intervals,
    }
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
    for policy in errors.policies.iter().filter(|policy| policy.sees_the_future) {
        caveats.push(format!(
            "`{}` reads what the driver did next: it is a floor, not a driver.",
            policy.name
        ));
    }
    caveats
}

fn estimate(
    metric: &Metric,
    rows: &[FrameErrors],
    unit_of: &[u32],
    bootstrap: &Bootstrap,
) -> Estimate {
    let values = values(metric, rows.iter());
    let interval = bootstrap.interval(&values, unit_of);
    let interval = interval.map(|ends| ends.map(|end| finished(metric, end)));
    Estimate { interval, ..point(metric, &values) }
}

/// What is averaged: errors or their squares. The root comes after the mean ([`finished`]); it
/// keeps the order, so the ends of an interval may pass through it too.
fn values<'a>(metric: &Metric, rows: impl Iterator<Item = &'a FrameErrors>) -> Vec<Option<f64>> {
    rows.map(|row| match metric.aggregate {
        Aggregate::Mean => (metric.of)(row),
        Aggregate::RootMeanSquare => (metric.of)(row).map(|error| error * error),
    })
    .collect()
}

fn finished(metric: &Metric, mean: f64) -> f64 {
    match metric.aggregate {
        Aggregate::Mean => mean,
        Aggregate::RootMeanSquare => mean.sqrt(),
    }
}

fn point(metric: &Metric, values: &[Option<f64>]) -> Estimate {
    let (mean, frames) = mean(values);
    Estimate { value: mean.map(|mean| finished(metric, mean)), interval: None, frames }
}

fn slices(frames: &[FrameKey], rows: &[FrameErrors]) -> Vec<Slice> {
    let slice = |by: &str, name: &str, belongs: &dyn Fn(&FrameKey) -> bool| {
        let inside = || frames.iter().zip(rows).filter(|(frame, _)| belongs(frame));
        let of_metric = |metric: &Metric| {
            let values = values(metric, inside().map(|(_, row)| row));
            (metric.key.to_string(), point(metric, &values))
        };
        Slice {
            by: by.to_string(),
            name: name.to_string(),
            frames: inside().count() as u64,
            metrics: METRICS.iter().map(of_metric).collect(),
        }
    };
    let commands = Command::ALL
        .map(|command| slice("command", command.name(), &|frame| frame.command == command));
    let speeds = SPEED_BINS_MPS.map(|(name, from, to)| {
        slice("speed", name, &|frame| (from..to).contains(&frame.speed_mps.abs()))
    });
    commands.into_iter().chain(speeds).collect()
}

fn paired(
    policy: &PolicyErrors,
    reference: &PolicyErrors,
    unit_of: &[u32],
    intervals: &Intervals,
) -> Option<Paired> {
    let metric = metric(HEADLINE)?;
    let both =
        |pair: (&FrameErrors, &FrameErrors)| Some(((metric.of)(pair.0)?, (metric.of)(pair.1)?));
    let pairs: Vec<_> = policy.rows.iter().zip(&reference.rows).map(both).collect();
    let mean_of = |part: fn((f64, f64)) -> f64| {
        mean(&pairs.iter().map(|pair| pair.map(part)).collect::<Vec<_>>()).0
    };
    let differences: Vec<_> = pairs.iter().map(|pair| pair.map(|(a, b)| a - b)).collect();
    let (difference, frames) = mean(&differences);
    let units = units_with_a_value(&differences, unit_of);
    let interval = intervals.bootstrap.interval(&differences, unit_of);
    let verdict = match interval {
        _ if units < FEWEST_UNITS => Verdict::TooFew,
        Some([_, high]) if high < 0.0 => Verdict::Beats,
        Some([low, _]) if low > 0.0 => Verdict::Worse,
        _ => Verdict::NoDifference,
    };
    let mut paired = Paired {
        reference: reference.name.clone(),
        metric: metric.key.to_string(),
        frames,
        units: units as u64,
        policy: mean_of(|pair| pair.0)?,
        of_reference: mean_of(|pair| pair.1)?,
        difference: difference?,
        interval,
        verdict,
        sentence: String::new(),
    };
    paired.sentence = sentence(&policy.name, &paired, intervals);
    Some(paired)
}

/// The verdict in words, with the numbers it rests on.
fn sentence(name: &str, paired: &Paired, intervals: &Intervals) -> String {
    let Paired { reference, frames, policy, of_reference, difference, .. } = paired;
    let on = "on speed at 3 s";
    let percent = intervals.bootstrap.level * 100.0;
    let interval = paired.interval.map_or("no interval".to_string(), |[low, high]| {
        format!("{percent:.0} % interval {low:.3} ... {high:.3}")
    });
    let units = intervals.unit.counted(paired.units);
    let numbers = format!(
        "{policy:.3} against {of_reference:.3} m/s (difference {difference:.3}, {interval}, \
         n = {frames} frames in {units})"
    );
    match paired.verdict {
        Verdict::Beats => format!("`{name}` beats {reference} {on}: {numbers}"),
        Verdict::Worse => {
            format!("`{name}` does not beat {reference} {on}, it is worse: {numbers}")
        }
        Verdict::NoDifference => {
            format!("no difference can be claimed between `{name}` and {reference} {on}: {numbers}")
        }
        Verdict::TooFew => format!(
            "no difference can be claimed between `{name}` and {reference} {on}, \
             too few for a claim: {numbers}"
        ),
    }
}
