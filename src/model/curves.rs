//! The curves of a run as a picture: what people look at first.

use plotters::prelude::*;
use serde_json::Value;

/// Okabe and Ito's colours, which colour-blind readers can tell apart.
const TRAIN: RGBColor = RGBColor(0x56, 0xb4, 0xe9);
const VALIDATION: RGBColor = RGBColor(0xd5, 0x5e, 0x00);

/// Key in `metrics.jsonl`, and what a panel says of it.
const PANELS: [(&str, &str); 4] = [
    ("total", "loss"),
    ("action", "action: mean absolute error"),
    ("motion", "motion: NLL per number, nats"),
    ("lr", "learning rate"),
];

/// Panels of the lines of `metrics.jsonl`, training and validation, over the steps, as SVG.
///
/// A panel for a term that the run does not have stays empty.
pub fn svg(lines: &[Value]) -> String {
    let mut text = String::new();
    {
        let area = SVGBackend::with_string(&mut text, (900, 560)).into_drawing_area();
        // Writing into a string cannot fail.
        let _ = area.fill(&WHITE);
        for (panel, (key, title)) in area.split_evenly((2, 2)).iter().zip(PANELS) {
            let _ = draw(panel, title, &points(lines, "train", key), &points(lines, "val", key));
        }
        let _ = area.present();
    }
    text
}

/// (step, value) of a key on one side of the split.
fn points(lines: &[Value], split: &str, key: &str) -> Vec<(f64, f64)> {
    let of_split = lines.iter().filter(|line| line["split"] == split);
    of_split.filter_map(|line| Some((line["step"].as_f64()?, line[key].as_f64()?))).collect()
}

fn draw(
    panel: &DrawingArea<SVGBackend, plotters::coord::Shift>,
    title: &str,
    train: &[(f64, f64)],
    validation: &[(f64, f64)],
) -> Result<(), Box<dyn std::error::Error>> {
    let all = || train.iter().chain(validation);
    let last = all().map(|(step, _)| *step).fold(1.0, f64::max);
    let low = all().map(|(_, value)| *value).fold(f64::INFINITY, f64::min);
    let high = all().map(|(_, value)| *value).fold(f64::NEG_INFINITY, f64::max);
    let (low, high) = if low < high { (low, high) } else { (0.0, 1.0) };
    let margin = (high - low) * 0.05;
    let mut chart = ChartBuilder::on(panel)
        .caption(title, ("sans-serif", 15))
        .margin(8)
        .margin_right(24)
        .x_label_area_size(24)
        .y_label_area_size(56)
        .build_cartesian_2d(0.0..last, low - margin..high + margin)?;
    chart
        .configure_mesh()
        .light_line_style(WHITE)
        .bold_line_style(RGBColor(221, 221, 221))
        .draw()?;
    let pairs = [("training", TRAIN, train), ("validation", VALIDATION, validation)];
    for (name, colour, points) in pairs {
        if points.is_empty() {
            continue;
        }
        let line = LineSeries::new(points.iter().copied(), colour.stroke_width(2));
        chart
            .draw_series(line)?
            .label(name)
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 16, y)], colour.stroke_width(2)));
    }
    if !validation.is_empty() {
        // Where a loss that falls leaves room.
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::LowerLeft)
            .background_style(WHITE.mix(0.8))
            .border_style(WHITE)
            .draw()?;
    }
    Ok(())
}
