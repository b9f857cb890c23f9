//! How errors grow with the horizon.

use crate::{
    chart::{
        lines::{Line, Point, lines},
        plot::SMALL,
        scale::Axis,
    },
    eval::offline::{
        plot::{drivers, enough},
        report::{PolicyReport, Report},
    },
    page::tags::{paragraph, row, section, unit},
};

/// Curves of what is wrong, and those of what a mixture says.
const ERRORS: [&str; 4] = ["ade", "fde", "speed_mae", "heading"];

/// Lines above the axis.
const GRID_LINES: u32 = 4;

/// One chart for each curve of errors.
pub fn horizons(report: &Report) -> String {
    let charts: Vec<String> = ERRORS.iter().filter_map(|key| curve(report, key, None)).collect();
    let said = paragraph(
        "Means over the frames that reach the horizon, with intervals as bands. An axis ends at about \
         twice the reference's last value: what errs more leaves the chart.",
    );
    match charts.is_empty() {
        true => String::new(),
        false => section("Errors by horizon", &(row(&charts) + &said)),
    }
}

/// A curve of all policies that have it, up to `top` if that is given; `None` if none has it.
pub fn curve(report: &Report, key: &str, top: Option<f64>) -> Option<String> {
    let definition = report.curves.iter().find(|curve| curve.key == key)?;
    let last = |policy: &PolicyReport| policy.curves.get(key)?.last()?.value;
    let of = |(policy, colour): &(&PolicyReport, &'static str)| {
        let points = report.horizons_s.iter().zip(policy.curves.get(key)?);
        let points: Vec<Point> = points
            .filter_map(|(x, at)| Some(Point { x: *x, y: at.value?, interval: at.interval }))
            .collect();
        (!points.is_empty()).then_some(Line { colour, points })
    };
    let drawn: Vec<Line> = drivers(report).iter().filter_map(of).collect();
    let high = top.unwrap_or_else(|| match key.starts_with("crps") || key.starts_with("width") {
        // Only some policies have them: the highest is not that of one that stands still.
        true => {
            let highest = drawn.iter().flat_map(|line| &line.points);
            highest
                .map(|point| point.interval.map_or(point.y, |[_, high]| high))
                .fold(0.0, f64::max)
        }
        false => enough(report, last),
    });
    let title = format!("{}{}", definition.title, unit(&definition.unit));
    let level = definition.better.strip_prefix("near ").and_then(|level| level.parse().ok());
    let x = Axis { low: 0.0, ..Axis::around("horizon (s)", 0.0, *report.horizons_s.last()?, 3) };
    let y = Axis::from_zero("", high, GRID_LINES);
    (!drawn.is_empty()).then(|| lines(&title, SMALL, x, y, &drawn, level))
}
