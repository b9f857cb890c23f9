//! Where the car went, from above.

use std::{collections::BTreeMap, fmt::Write as _};

use crate::{
    chart::palette::{COLOURS, escaped},
    page::tags::{paragraph, row, section},
    stats::survey::{Drive, Survey},
};

/// Between two points of a line that is drawn, m; and what is a jump and no line.
const SPACING_M: f64 = 4.0;
const JUMP_M: f64 = 30.0;

/// Side of a map and its margin, px.
const SIDE: f64 = 320.0;
const MARGIN: f64 = 26.0;

/// Lengths that a scale bar may have, m.
const BARS_M: [f64; 12] = [1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1e3, 2e3, 5e3];

/// Maps without a town to tell them apart, at most: drives at unlike places cannot share one.
const MOST: usize = 12;

/// A map for each town; where no town is known, one for each of the first drives.
pub fn ways(survey: &Survey) -> String {
    let mut maps: BTreeMap<(usize, String), Vec<&Drive>> = BTreeMap::new();
    for (i, drive) in survey.drives.iter().enumerate().filter(|(_, drive)| drive.places_m.len() > 1)
    {
        let key = match &drive.conditions.town {
            Some(town) => (0, town.clone()),
            None => (i + 1, drive.source_log.clone()),
        };
        maps.entry(key).or_default().push(drive);
    }
    let charts: Vec<String> =
        maps.iter().take(MOST).map(|((_, name), drives)| map(name, drives)).collect();
    let rest = match maps.len().saturating_sub(MOST) {
        0 => String::new(),
        rest => format!(" {rest} more drives are not drawn."),
    };
    let about = format!(
        "Ways driven, x to the right and y up in the world frame; a dot is where a drive begins. The \
         darker, the more often.{rest}"
    );
    match charts.is_empty() {
        true => String::new(),
        false => section("Where it went", &(paragraph(&about) + &row(&charts))),
    }
}

fn map(name: &str, drives: &[&Drive]) -> String {
    let places = || drives.iter().flat_map(|drive| &drive.places_m);
    let end = |axis: usize, pick: fn(f64, f64) -> f64, from: f64| {
        places().map(|place_m| place_m[axis]).fold(from, pick)
    };
    let low_m = [0, 1].map(|axis| end(axis, f64::min, f64::INFINITY));
    let high_m = [0, 1].map(|axis| end(axis, f64::max, f64::NEG_INFINITY));
    let span_m = (high_m[0] - low_m[0]).max(high_m[1] - low_m[1]).max(1.0);
    let px_per_m = (SIDE - 2.0 * MARGIN) / span_m;
    let height = MARGIN * 2.0 + (high_m[1] - low_m[1]) * px_per_m + 20.0;
    let px = |[x_m, y_m]: [f64; 2]| {
        [MARGIN + (x_m - low_m[0]) * px_per_m, MARGIN + (high_m[1] - y_m) * px_per_m]
    };
    let title = match drives.len() {
        1 => name.to_string(),
        count => format!("{name}, {count} drives"),
    };
    let title = escaped(&title);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {SIDE} {height:.0}\" width=\"{SIDE}\" \
         height=\"{height:.0}\" role=\"img\" aria-label=\"{title}\" font-family=\"sans-serif\" \
         font-size=\"11\" fill=\"currentColor\">\n<text x=\"8\" y=\"15\" font-size=\"12\" \
         font-weight=\"bold\">{title}</text>\n"
    );
    for drive in drives {
        let _ = writeln!(
            svg,
            "<path d=\"{}\" fill=\"none\" stroke=\"{}\" stroke-opacity=\"0.55\" stroke-width=\"1.5\"/>",
            path(&drive.places_m, px),
            COLOURS[0]
        );
    }
    for [x, y] in drives.iter().map(|drive| px(drive.places_m[0])) {
        let _ = writeln!(
            svg,
            "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"2.5\" fill=\"{}\"/>",
            COLOURS[1]
        );
    }
    let bar_m = BARS_M.into_iter().rev().find(|bar_m| *bar_m <= span_m / 3.0).unwrap_or(BARS_M[0]);
    let (y, width) = (height - 12.0, bar_m * px_per_m);
    let _ = writeln!(
        svg,
        "<path d=\"M8 {y:.1}h{width:.1}\" stroke=\"currentColor\" stroke-width=\"2\"/>\
         <text x=\"{:.1}\" y=\"{:.1}\">{bar_m} m</text>\n</svg>",
        width + 14.0,
        y + 4.0
    );
    svg
}

/// A line through places, thinned out; it ends where the car jumps.
fn path(places_m: &[[f64; 2]], px: impl Fn([f64; 2]) -> [f64; 2]) -> String {
    let mut path = String::new();
    let mut last: Option<[f64; 2]> = None;
    for (i, place_m) in places_m.iter().enumerate() {
        let gone_m = last.map(|last| (place_m[0] - last[0]).hypot(place_m[1] - last[1]));
        let is_end = i + 1 == places_m.len();
        let command = match gone_m {
            Some(gone_m) if gone_m < SPACING_M && !is_end => continue,
            Some(gone_m) if gone_m < JUMP_M => 'L',
            _ => 'M',
        };
        let [x, y] = px(*place_m);
        let _ = write!(path, "{command}{x:.1} {y:.1}");
        last = Some(*place_m);
    }
    path
}
