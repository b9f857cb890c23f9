//! The curves of a run as a picture: what people look at first.

use serde_json::Value;

use crate::chart::{
    palette::COLOURS,
    plot::{Plot, Size},
    scale::Axis,
};

/// Sides of the split with their colours.
const SIDES: [(&str, &str, &str); 2] =
    [("train", "training", COLOURS[5]), ("val", "validation", COLOURS[1])];

/// Key in `metrics.jsonl`, and what a panel says of it.
const PANELS: [(&str, &str); 4] = [
    ("total", "loss"),
    ("action", "action: mean absolute error"),
    ("motion", "motion: NLL per number, nats"),
    ("lr", "learning rate"),
];

/// Panels side by side, and the size of each, px.
const ACROSS: usize = 2;
const PANEL: Size = Size { width: 450.0, height: 280.0, aside: 72.0 };

/// Marks on the axes.
const MARKS: u32 = 5;

/// Panels of the lines of `metrics.jsonl`, training and validation, over the steps, as SVG.
///
/// A panel for a term that the run does not have stays empty.
pub fn svg(lines: &[Value]) -> String {
    let (width, height) =
        (PANEL.width * ACROSS as f64, PANEL.height * PANELS.len().div_ceil(ACROSS) as f64);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" \
         width=\"{width}\" height=\"{height}\">\n"
    );
    for (i, (key, title)) in PANELS.into_iter().enumerate() {
        let left = PANEL.width * (i % ACROSS) as f64;
        let top = PANEL.height * (i / ACROSS) as f64;
        let panel = panel(title, &SIDES.map(|(side, ..)| points(lines, side, key)));
        svg += &format!("<g transform=\"translate({left} {top})\">\n{panel}</g>\n");
    }
    svg + "</svg>\n"
}

/// (step, value) of a key on one side of the split.
fn points(lines: &[Value], split: &str, key: &str) -> Vec<[f64; 2]> {
    let of_split = lines.iter().filter(|line| line["split"] == split);
    of_split.filter_map(|line| Some([line["step"].as_f64()?, line[key].as_f64()?])).collect()
}

fn panel(title: &str, sides: &[Vec<[f64; 2]>; 2]) -> String {
    let values = || sides.iter().flatten().map(|[_, value]| *value);
    let last = sides.iter().flatten().map(|[step, _]| *step).fold(1.0, f64::max);
    let low = values().fold(f64::INFINITY, f64::min);
    let high = values().fold(f64::NEG_INFINITY, f64::max);
    let (low, high) = if low < high { (low, high) } else { (0.0, 1.0) };
    let x = Axis::from_zero("step", last, MARKS);
    let mut plot = Plot::new(title, PANEL, x, Axis::around("", low, high, MARKS));
    for (row, ((_, name, colour), points)) in SIDES.into_iter().zip(sides).enumerate() {
        if !points.is_empty() {
            plot.line(points, colour, false);
            plot.note(row, name, colour);
        }
        // There are few, and a single one is no line.
        if name == "validation" {
            points.iter().for_each(|point| plot.dot(*point, None, 0.0, colour));
        }
    }
    plot.finish()
}
