//! What policies look through, by surroundings.

use std::collections::BTreeMap;

use crate::{
    chart::palette::escaped,
    eval::offline::{plot::drivers, report::Report},
    page::tags::{code, named, paragraph, section, table},
};

/// A table for each policy with attention: mean share of each branch, over all frames and in parts.
pub fn attention(report: &Report) -> String {
    let mut body = String::new();
    for (policy, colour) in drivers(report) {
        if policy.attention.is_empty() {
            continue;
        }
        let mut head = vec!["frames".to_string()];
        head.extend(policy.attention.keys().map(|branch| escaped(branch)));
        let shares = |name: String, of: &BTreeMap<String, f64>| {
            let cell = |branch| {
                let share = of.get(branch).copied().unwrap_or_default();
                let width = share * 100.0;
                format!(
                    "{share:.2} <span class=\"bar\" style=\"width:{width:.0}px;background:{colour}\"></span>"
                )
            };
            let mut row = vec![name];
            row.extend(policy.attention.keys().map(cell));
            row
        };
        let mut rows = vec![shares("all".to_string(), &policy.attention)];
        for slice in policy.slices.iter().filter(|slice| !slice.attention.is_empty()) {
            let unit = if slice.by == "speed" { " m/s" } else { "" };
            let name = code(&format!("{} {}{unit}", slice.by, slice.name));
            rows.push(shares(
                format!("{name} <small>({})</small>", slice.frames),
                &slice.attention,
            ));
        }
        body += &format!("<h3>{}</h3>\n{}", named(&policy.name, colour), table(&head, &rows));
    }
    if body.is_empty() {
        return body;
    }
    let about = paragraph(
        "Mean share of each branch in the features that a1 is made of (eq. (2)). A share says what is \
         weighed, not what is needed: a run without the branch tells that.",
    );
    section("What is looked at", &(about + &body))
}
