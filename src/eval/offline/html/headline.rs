//! What a reader wants to know first: what may be said, and the numbers it rests on.

use crate::{
    eval::offline::{
        html::cell::cell,
        plot::drivers,
        render::{basis, metrics_had, of},
        report::Report,
    },
    page::tags::{code, named, section, table, unit},
};

/// Metrics of the first table.
const HEADLINES: [&str; 17] = [
    "speed_mae_3s",
    "ade_3s",
    "fde_3s",
    "min_ade_3s",
    "miss_3s",
    "target_ade",
    "steer_l1",
    "a2_steer_l1",
    "fused_steer_l1",
    "steer_speed_weighted",
    "brake_f1",
    "nll",
    "crps_speed",
    "coverage_80",
    "ece_speed",
    "variance_spearman",
    "variance_auroc",
];

/// Verdicts, then the first table; oracles stand last.
pub fn headline(report: &Report) -> String {
    let verdicts: String = report
        .policies
        .iter()
        .flat_map(|policy| &policy.paired)
        .map(|paired| format!("<li>{}</li>\n", code(&paired.sentence)))
        .collect();
    let verdicts = if verdicts.is_empty() {
        verdicts
    } else {
        format!("<ul class=\"verdicts\">\n{verdicts}</ul>\n")
    };
    let drivers = drivers(report);
    let mut columns: Vec<(_, String)> =
        drivers.iter().map(|(policy, colour)| (*policy, named(&policy.name, colour))).collect();
    let oracles = report.policies.iter().filter(|policy| policy.sees_the_future);
    columns.extend(
        oracles.map(|policy| (policy, format!("{} (oracle)", code(&format!("`{}`", policy.name))))),
    );
    let mut head = vec!["Metric".to_string(), "better".to_string()];
    head.extend(columns.iter().map(|(_, name)| name.clone()));
    let had = metrics_had(report);
    let rows: Vec<Vec<String>> = HEADLINES
        .iter()
        .filter_map(|key| had.iter().find(|metric| metric.key == *key))
        .map(|metric| {
            let mut row = vec![code(&metric.title) + &unit(&metric.unit), metric.better.clone()];
            row.extend(columns.iter().map(|(policy, _)| cell(of(policy, &metric.key))));
            row
        })
        .collect();
    let basis = format!("<p class=\"basis\">{}</p>\n", code(&basis(report)));
    section("What can be said", &(verdicts + &table(&head, &rows) + &basis))
}
