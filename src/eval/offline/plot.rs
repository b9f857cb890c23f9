//! One picture of a report: how the speed error grows with the horizon.
//!
//! Static SVG without scripts, so that it stands in a README as well as in a paper.

use std::fmt::Write as _;

use crate::eval::{
    baseline::REFERENCE,
    offline::report::{Estimate, PolicyReport, Report},
};

/// Metric at each horizon, and how the horizon is written.
const HORIZONS: [(&str, &str); 3] =
    [("speed_mae_1s", "1 s"), ("speed_mae_2s", "2 s"), ("speed_mae_3s", "3 s")];

/// Okabe and Ito's colours, which colour-blind readers can tell apart, reference first.
const COLOURS: [&str; 7] =
    ["#000000", "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9"];

/// The axes in pixels.
const LEFT: f64 = 60.0;
const RIGHT: f64 = 400.0;
const TOP: f64 = 40.0;
const BOTTOM: f64 = 280.0;

/// Lines above the axis.
const GRID_LINES: f64 = 4.0;

/// Mean absolute speed error at 1, 2 and 3 s with its interval, as SVG.
///
/// The scale holds at least twice the reference's error, or the best policy's where there is no reference.
/// What lies beyond is not drawn but named, so that standing still does not flatten the rest.
pub fn speed_errors(report: &Report) -> String {
    let top_mps = scale_mps(report);
    let y = |mps: f64| BOTTOM - (mps / top_mps) * (BOTTOM - TOP);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 680 330\" \
         font-family=\"sans-serif\" font-size=\"12\">\n\
         <rect width=\"680\" height=\"330\" fill=\"#ffffff\"/>\n\
         <text x=\"{LEFT}\" y=\"20\">Mean speed error in m/s, {:.0} % interval, on {}</text>\n",
        report.intervals.bootstrap.level * 100.0,
        escaped(&report.dataset.name),
    );
    for i in 0..=GRID_LINES as u32 {
        let mps = top_mps * f64::from(i) / GRID_LINES;
        let at = y(mps);
        let _ = writeln!(
            svg,
            "<path d=\"M{LEFT} {at:.1}H{RIGHT}\" stroke=\"#dddddd\"/>\
             <text x=\"52\" y=\"{:.1}\" text-anchor=\"end\">{mps:.2}</text>",
            at + 4.0
        );
    }
    for (i, (_, horizon)) in HORIZONS.iter().enumerate() {
        let x = centre(i);
        let _ =
            writeln!(svg, "<text x=\"{x:.1}\" y=\"300\" text-anchor=\"middle\">{horizon}</text>");
    }
    let drivers: Vec<_> = report.policies.iter().filter(|p| !p.sees_the_future).collect();
    let mut others = COLOURS[1..].iter().cycle();
    for (row, policy) in drivers.iter().enumerate() {
        let other = if policy.name == REFERENCE { None } else { others.next() };
        let colour = other.unwrap_or(&COLOURS[0]);
        // Side by side, or the bars of like policies would hide each other.
        let aside = 10.0 * (row as f64 - (drivers.len() - 1) as f64 / 2.0);
        let mut fits = true;
        for (i, (key, _)) in HORIZONS.iter().enumerate() {
            let Some((value, estimate)) = at(policy, key) else { continue };
            if value > top_mps {
                fits = false;
                continue;
            }
            let (x, [low, high]) = (centre(i) + aside, estimate.interval.unwrap_or([value; 2]));
            let (low, high) = (y(low), y(high.min(top_mps)));
            let _ = writeln!(
                svg,
                "<path d=\"M{x:.1} {low:.1}V{high:.1}\" stroke=\"{colour}\" stroke-width=\"2\"/>"
            );
            let _ = writeln!(
                svg,
                "<circle cx=\"{x:.1}\" cy=\"{:.1}\" r=\"4\" fill=\"{colour}\"/>",
                y(value)
            );
        }
        let last =
            at(policy, HORIZONS[2].0).map_or("–".to_string(), |(v, _)| format!("{v:.3} m/s"));
        let beyond = if fits { " at 3 s" } else { " off the scale" };
        let _ = writeln!(
            svg,
            "<text x=\"420\" y=\"{}\" fill=\"{colour}\">{}: {last}{beyond}</text>",
            60 + 20 * row,
            escaped(&policy.name)
        );
    }
    if report.holdout.weak {
        svg += "<text x=\"60\" y=\"322\">Weak evidence: see the report's first lines.</text>\n";
    }
    svg + "</svg>\n"
}

/// Upper end of the axis, m/s.
fn scale_mps(report: &Report) -> f64 {
    let value = |policy: &PolicyReport| at(policy, HORIZONS[2].0).map(|(value, _)| value);
    let reference = report.policies.iter().find(|policy| policy.name == REFERENCE);
    let best = || report.policies.iter().filter_map(value).reduce(f64::min);
    let enough = reference.and_then(value).or_else(best).unwrap_or_default() * 2.0;
    if enough > 0.0 { GRID_LINES * round_step(enough / GRID_LINES) } else { 1.0 }
}

/// The least of 1, 2, 2.5 and 5 times a power of ten that is not below `step`.
fn round_step(step: f64) -> f64 {
    let power = 10_f64.powf(step.log10().floor());
    let factor = [1.0, 2.0, 2.5, 5.0].into_iter().find(|factor| factor * power >= step);
    factor.unwrap_or(10.0) * power
}

fn at<'a>(policy: &'a PolicyReport, key: &str) -> Option<(f64, &'a Estimate)> {
    let estimate = policy.metrics.get(key)?;
    Some((estimate.value?, estimate))
}

fn centre(horizon: usize) -> f64 {
    LEFT + (RIGHT - LEFT) * (horizon as f64 + 0.5) / HORIZONS.len() as f64
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}
