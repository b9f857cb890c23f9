//! The headline metrics over parts of the frames.

use crate::{
    chart::{
        bars::{Bars, bars},
        plot::Size,
        scale::Axis,
    },
    eval::offline::{
        plot::{drivers, enough},
        report::{Report, Slice},
    },
    page::tags::{MISSING, code, named, paragraph, row, section, table, unit},
};

/// Metrics of the tables; the first two are drawn as well.
const SLICED: [&str; 9] = [
    "ade_3s",
    "speed_mae_3s",
    "fde_3s",
    "miss_3s",
    "steer_l1",
    "fused_steer_l1",
    "brake_f1",
    "coverage_80",
    "nll",
];

/// Metrics that are drawn.
const DRAWN: usize = 2;

/// Charts and a table for each way to part the frames.
pub fn slices(report: &Report) -> String {
    let Some(first) = report.policies.first() else { return String::new() };
    let mut body = paragraph(
        "Numbers without intervals: over few frames they say little. A part in which no frame was \
         recorded is left out. An axis \
         ends at about twice the reference's highest: a bar that reaches its end goes on.",
    );
    for group in first.slices.chunk_by(|a, b| a.by == b.by) {
        let by = &group[0].by;
        let parts: Vec<&Slice> = group.iter().filter(|slice| slice.frames > 0).collect();
        body += &format!("<h3>By {}</h3>\n", code(by));
        let charts = SLICED.iter().take(DRAWN).filter_map(|key| chart(report, by, &parts, key));
        body += &row(&charts.collect::<Vec<_>>());
        body += &numbers(report, by, &parts);
    }
    section("By command, speed and surroundings", &body)
}

fn called(by: &str, name: &str) -> String {
    if by == "speed" { format!("{name} m/s") } else { name.to_string() }
}

fn value(slices: &[Slice], by: &str, name: &str, key: &str) -> Option<f64> {
    slices.iter().find(|slice| slice.by == by && slice.name == name)?.metrics.get(key)?.value
}

/// Bars of one metric; the axis ends at twice the reference's highest.
fn chart(report: &Report, by: &str, parts: &[&Slice], key: &str) -> Option<String> {
    let metric = report.metrics.iter().find(|metric| metric.key == key)?;
    let of = |slices: &[Slice]| -> Vec<Option<f64>> {
        parts.iter().map(|part| value(slices, by, &part.name, key)).collect()
    };
    let highest = |slices: &[Slice]| of(slices).into_iter().flatten().reduce(f64::max);
    let top = enough(report, |policy| highest(&policy.slices));
    let series: Vec<Bars> = drivers(report)
        .into_iter()
        .map(|(policy, colour)| Bars { colour, values: of(&policy.slices) })
        .filter(|bars| bars.values.iter().any(Option::is_some))
        .collect();
    let groups: Vec<String> = parts.iter().map(|part| called(by, &part.name)).collect();
    let groups: Vec<&str> = groups.iter().map(String::as_str).collect();
    let title = format!("{}{}", metric.title, unit(&metric.unit));
    let size =
        Size { width: (120.0 + 85.0 * groups.len() as f64).max(320.0), height: 230.0, aside: 0.0 };
    let y = Axis::from_zero("", top, 4);
    (!series.is_empty()).then(|| bars(&title, size, &groups, y, &series))
}

fn numbers(report: &Report, by: &str, parts: &[&Slice]) -> String {
    let drivers = drivers(report);
    let metrics: Vec<_> = SLICED
        .iter()
        .filter_map(|key| report.metrics.iter().find(|metric| metric.key == *key))
        .filter(|metric| {
            drivers.iter().any(|(policy, _)| {
                parts
                    .iter()
                    .any(|part| value(&policy.slices, by, &part.name, &metric.key).is_some())
            })
        })
        .collect();
    let mut head = vec![code(by), "frames".to_string(), "policy".to_string()];
    head.extend(metrics.iter().map(|metric| code(&metric.title) + &unit(&metric.unit)));
    let mut rows = Vec::new();
    for part in parts {
        for (i, (policy, colour)) in drivers.iter().enumerate() {
            let once = |text: String| if i == 0 { text } else { String::new() };
            let mut row = vec![
                once(code(&called(by, &part.name))),
                once(part.frames.to_string()),
                named(&policy.name, colour),
            ];
            row.extend(metrics.iter().map(|metric| {
                let value = value(&policy.slices, by, &part.name, &metric.key);
                value.map_or(MISSING.to_string(), |value| format!("{value:.3}"))
            }));
            rows.push(row);
        }
    }
    table(&head, &rows)
}
