//! Two policies frame by frame on the headline metric, and what may be said of it in words.

use crate::eval::{
    offline::{
        definitions::{HEADLINE, Measure, metric},
        errors::{Errors, PolicyErrors, Row},
        report::{Intervals, Paired, Verdict},
    },
    statistics::{FEWEST_UNITS, mean, units_with_a_value},
};

/// The difference between a policy and what it is held against; `None` where either plans no motion.
pub fn paired(
    errors: &Errors,
    policy: &PolicyErrors,
    reference: &PolicyErrors,
    unit_of: &[u32],
    intervals: &Intervals,
) -> Option<Paired> {
    let metric = metric(HEADLINE)?;
    let Measure::Mean(of) = metric.measure else { return None };
    let values = |policy: &PolicyErrors| {
        let rows = errors.frames.iter().zip(&policy.rows);
        rows.map(|(frame, errors)| of(&Row { frame, errors })).collect::<Vec<_>>()
    };
    let pairs: Vec<_> =
        values(policy).into_iter().zip(values(reference)).map(|(a, b)| a.zip(b)).collect();
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
