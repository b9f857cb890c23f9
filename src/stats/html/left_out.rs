//! What the logs had and the dataset has not.

use crate::{
    digits::grouped,
    page::tags::{code, paragraph, section, table},
    stats::summary::{Loss, Summary},
};

/// Losses of one kind that are listed; the manifest has them all.
const LISTED: usize = 20;

/// Ticks by reason, damage, sensors and logs.
pub fn left_out(summary: &Summary) -> String {
    let left_out = &summary.left_out;
    let mut rows: Vec<Vec<String>> = left_out
        .ticks
        .iter()
        .filter(|(_, count)| **count > 0)
        .map(|(reason, count)| {
            vec![format!("ticks: {}", reason.replace('_', " ")), grouped(*count)]
        })
        .collect();
    for (what, count) in [
        ("damaged parts of files", left_out.damaged_parts),
        ("logs with such parts", left_out.damaged_logs),
        ("messages that could not be decoded", left_out.undecodable_messages),
    ] {
        if count > 0 {
            rows.push(vec![what.to_string(), grouped(count)]);
        }
    }
    let mut body = match rows.is_empty() {
        true => paragraph("Every tick of the grid became a frame, and every message was read."),
        false => table(&["left out", "count"].map(str::to_string), &rows),
    };
    body += &losses("Sensors that a log has and its frames have not", &left_out.sensors);
    body += &losses("Logs that gave nothing", &left_out.failed_logs);
    section("What was left out", &body)
}

fn losses(title: &str, losses: &[Loss]) -> String {
    if losses.is_empty() {
        return String::new();
    }
    let item = |loss: &Loss| {
        format!("<li>{}: {}</li>\n", code(&format!("`{}`", loss.source_log)), code(&loss.what))
    };
    let listed: String = losses.iter().take(LISTED).map(item).collect();
    let rest = match losses.len().saturating_sub(LISTED) {
        0 => String::new(),
        rest => format!("<li>and {} more</li>\n", grouped(rest as u64)),
    };
    format!("<h3>{title}</h3>\n<ul>\n{listed}{rest}</ul>\n")
}
