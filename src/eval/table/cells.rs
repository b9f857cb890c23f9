//! What stands in a cell, for all who print tables for people.

use crate::eval::table::{
    definitions::{Metric, TABLE_I, metric},
    report::{Cell, Estimate, Source, System, Table, Task},
};

/// What a missing value looks like, as in the paper.
pub const MISSING: &str = "--";

/// A number in pieces, so that each format puts them together in its way.
pub struct Pieces {
    /// `38.9`; the paper's success rates as it prints them, cut to whole per cents.
    pub value: String,
    /// `7/18`, of a share of episodes.
    pub fraction: Option<String>,
    /// `20.3, 61.4`.
    pub interval: Option<String>,
}

/// The number of a metric in a cell; `None` where there is none.
pub fn pieces(cell: &Cell, metric: &Metric, source: Source) -> Option<Pieces> {
    let Estimate { value, k, n, interval } = cell.of(metric.key);
    let value = value?;
    let digits = metric.digits;
    // Whole numbers, so that no rounding stands between k and the paper's floor of it.
    let floored = k.filter(|_| source == Source::Paper).and_then(|k| (100 * k).checked_div(n));
    Some(Pieces {
        value: floored.map_or(format!("{value:.digits$}"), |floored| floored.to_string()),
        fraction: k.map(|k| format!("{k}/{n}")),
        interval: interval.map(|[low, high]| format!("{low:.digits$}, {high:.digits$}")),
    })
}

/// The metrics of table I that any system has.
pub fn table_i(table: &Table) -> Vec<&'static Metric> {
    TABLE_I.iter().filter(|key| table.has(key)).filter_map(|key| metric(key)).collect()
}

/// Whose rows a metric of table I has: all that were driven, and the paper's if it prints it.
pub fn systems_of<'t>(table: &'t Table, metric: &Metric) -> Vec<&'t System> {
    let has = |cell: &Cell| cell.of(metric.key).value.is_some();
    let shown = |s: &&System| s.source == Source::Driven || s.tasks.iter().any(has);
    table.systems.iter().filter(shown).collect()
}

/// A metric's title in table I; the paper's own has no more than one OVSP.
pub fn title(table: &Table, metric: &Metric) -> &'static str {
    match metric.key {
        "ovsp_success" if !table.has("ovsp") => "OVSP",
        _ => metric.title,
    }
}

/// Tasks that stand side by side under one head: same condition, same town.
pub fn heads(tasks: &[Task]) -> Vec<&[Task]> {
    tasks.chunk_by(|a, b| (&a.condition, &a.town) == (&b.condition, &b.town)).collect()
}

/// E, F, R or D as in the paper, or the word itself.
pub fn letter(traffic: &str) -> &str {
    match traffic {
        "empty" => "E",
        "few" => "F",
        "regular" => "R",
        "dense" => "D",
        other => other,
    }
}
