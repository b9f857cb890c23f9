//! One picture of a report: how the speed error grows with the horizon.
//!
//! Static SVG without scripts, so that it stands in a README as well as in a paper.

use crate::{
    chart::{
        palette::{INK, colour},
        plot::{Plot, Size},
        scale::Axis,
    },
    eval::{
        baseline::REFERENCE,
        offline::report::{Estimate, PolicyReport, Report},
    },
};

/// Metric at each horizon, and how the horizon is written.
const HORIZONS: [(&str, &str); 3] =
    [("speed_mae_1s", "1 s"), ("speed_mae_2s", "2 s"), ("speed_mae_3s", "3 s")];

/// Lines above the axis.
const GRID_LINES: u32 = 4;

/// Between the dots of two policies at one horizon, px.
const APART_PX: f64 = 10.0;

/// Those of a report that drive, with their colours, the reference in that of text.
pub fn drivers(report: &Report) -> Vec<(&PolicyReport, &'static str)> {
    let drivers = report.policies.iter().filter(|policy| !policy.sees_the_future);
    let mut others = 0;
    drivers
        .map(|policy| match policy.name == REFERENCE {
            true => (policy, INK),
            false => {
                others += 1;
                (policy, colour(others - 1))
            }
        })
        .collect()
}

/// Upper end of an axis: twice the reference's value, or the best policy's where there is no
/// reference, so that standing still does not flatten the rest.
pub fn enough(report: &Report, value: impl Fn(&PolicyReport) -> Option<f64>) -> f64 {
    let reference = report.policies.iter().find(|policy| policy.name == REFERENCE);
    let best = || report.policies.iter().filter_map(&value).reduce(f64::min);
    reference.and_then(&value).or_else(best).unwrap_or_default() * 2.0
}

/// Mean absolute speed error at 1, 2 and 3 s with its interval, as SVG.
///
/// What lies beyond [`enough`] is not drawn but named.
pub fn speed_errors(report: &Report) -> String {
    let last = |policy: &PolicyReport| Some(at(policy, HORIZONS[2].0)?.0);
    let title = format!(
        "Mean speed error in m/s, {:.0} % interval, on {}",
        report.intervals.bootstrap.level * 100.0,
        report.dataset.name,
    );
    let size = Size { width: 680.0, height: 330.0, aside: 280.0 };
    let y = Axis::from_zero("m/s", enough(report, last), GRID_LINES);
    let x = Axis::things(HORIZONS.map(|(_, horizon)| horizon));
    let mut plot = Plot::new(&title, size, x, y);
    let drivers = drivers(report);
    for (row, (policy, colour)) in drivers.iter().enumerate() {
        // Side by side, or the bars of like policies would hide each other.
        let aside_px = APART_PX * (row as f64 - (drivers.len() - 1) as f64 / 2.0);
        let mut fits = true;
        for (i, (key, _)) in HORIZONS.iter().enumerate() {
            let Some((value, estimate)) = at(policy, key) else { continue };
            match plot.holds_y(value) {
                true => plot.dot([i as f64, value], estimate.interval, aside_px, colour),
                false => fits = false,
            }
        }
        let said = last(policy).map_or("–".to_string(), |value| format!("{value:.3} m/s"));
        let beyond = if fits { " at 3 s" } else { " off the scale" };
        plot.note(row, &format!("{}: {said}{beyond}", policy.name), colour);
    }
    if report.holdout.weak {
        plot.note(drivers.len() + 1, "Weak evidence: see the report's first lines.", INK);
    }
    plot.finish()
}

fn at<'a>(policy: &'a PolicyReport, key: &str) -> Option<(f64, &'a Estimate)> {
    let estimate = policy.metrics.get(key)?;
    Some((estimate.value?, estimate))
}
