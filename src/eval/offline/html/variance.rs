//! Whether the variance of a plan says when it is wrong, and what eq. (3) makes of it.

use crate::{
    chart::{
        density::density,
        histogram::histogram,
        plot::{SMALL, Size},
        scale::Axis,
    },
    control::fusion::Fusion,
    eval::offline::{
        plot::drivers,
        report::{Report, Variance},
    },
    page::tags::{named, paragraph, row, section},
};

/// Of a chart with many cells.
const LARGE: Size = Size { width: 420.0, height: 330.0, aside: 0.0 };

/// One pair of charts for each policy that has a variance.
pub fn variance(report: &Report) -> String {
    let mut body = String::new();
    for (policy, colour) in drivers(report) {
        let Some(variance) = &policy.variance else { continue };
        body += &format!("<h3>{}</h3>\n", named(&policy.name, colour));
        let mut charts = vec![against_error(variance, colour)];
        let mut said = format!(
            "{} frames; median of S {:.2e}, 95th percentile {:.2e}.",
            variance.frames, variance.s_median, variance.s_q95
        );
        if let Some(lambda) = &variance.lambda {
            let title = "Share of a2 in the fused action";
            charts.push(histogram(title, SMALL, "lambda of eq. (3)", &lambda.counts, colour));
            said += &format!(
                " Share of a2 (lambda): mean {:.2}, above 0.99 in {:.0} % of frames, below 0.5 in \
                 {:.0} %.",
                lambda.mean,
                lambda.above_099 * 100.0,
                lambda.below_05 * 100.0
            );
        }
        match policy.fusion {
            Some(Fusion::Variance { c1, c2 }) => said += &format!(" c1 = {c1:.4}, c2 = {c2:.6}."),
            Some(_) => {}
            None => said += " Its constants are not known: `pmp-eval calibrate` finds them.",
        }
        body += &(row(&charts) + &paragraph(&said));
    }
    if body.is_empty() {
        return body;
    }
    let about = paragraph(
        "S is the variance of the plan up to its target 5 m ahead, in units of (10 m/s)² and rad²; the \
         error is the displacement there. The line joins the medians of ten parts of the frames, the \
         most certain first: it rises if the variance tells where the plan is wrong.",
    );
    section("Does the variance find the errors?", &(about + &body))
}

fn against_error(variance: &Variance, colour: &str) -> String {
    let grid = &variance.grid;
    let x = Axis::log10("S of eq. (3)", grid.log10_s[0], grid.log10_s[1]);
    let y = Axis::log10("displacement at 5 m (m)", grid.log10_error_m[0], grid.log10_error_m[1]);
    // Means of tenths may lie outside of what is drawn: the grid leaves out the outermost hundredths.
    let inside = |[s, error]: &[f64; 2]| x.holds(*s) && y.holds(*error);
    let line: Vec<[f64; 2]> = variance
        .tenths
        .iter()
        .map(|tenth| [tenth.s.max(f64::MIN_POSITIVE).log10(), tenth.median_m.max(1e-3).log10()])
        .filter(inside)
        .collect();
    let title = "Frames by variance and error";
    density(title, LARGE, x, y, &grid.counts, &line, colour)
}
