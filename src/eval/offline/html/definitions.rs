//! Every number, and what it is.

use crate::{
    eval::offline::{
        html::cell::cell,
        plot::drivers,
        render::{metrics_had, of},
        report::{Definition, Report},
    },
    page::tags::{code, named, paragraph, section, table, unit},
};

/// Every metric that a policy has, by group, then definitions.
pub fn definitions(report: &Report) -> String {
    let drivers = drivers(report);
    let mut numbers = String::new();
    for group in metrics_had(report).chunk_by(|a, b| a.group == b.group) {
        let mut head = vec!["Metric".to_string(), "better".to_string(), "frames".to_string()];
        head.extend(drivers.iter().map(|(policy, colour)| named(&policy.name, colour)));
        let row = |metric: &&Definition| {
            let frames = drivers.iter().map(|(policy, _)| of(policy, &metric.key).frames).max();
            let mut row = vec![
                code(&metric.title) + &unit(&metric.unit),
                metric.better.clone(),
                format!("{} / {}", frames.unwrap_or_default(), report.evaluated.frames),
            ];
            row.extend(drivers.iter().map(|(policy, _)| cell(of(policy, &metric.key))));
            row
        };
        numbers += &format!("<h3>{}</h3>\n", code(&group[0].group));
        numbers += &table(&head, &group.iter().map(row).collect::<Vec<_>>());
    }
    let list = |definitions: &[Definition]| -> String {
        let item = |m: &Definition| {
            let (title, key) = (code(&m.title), code(&format!("`{}`", m.key)));
            format!("<dt>{title}{} {key}</dt><dd>{}</dd>\n", unit(&m.unit), code(&m.definition))
        };
        format!("<dl>\n{}</dl>\n", definitions.iter().map(item).collect::<String>())
    };
    let meanings = paragraph(
        "Open loop: a small error here does not show that a policy drives; closed loop does.",
    ) + &list(&report.metrics)
        + "<h3>By horizon</h3>\n"
        + &list(&report.curves);
    section("Every number", &numbers) + &section("What the numbers are", &meanings)
}
