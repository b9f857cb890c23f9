//! A table as CSV, tidy: one line for each system, task and metric.

use crate::eval::{
    quoting,
    table::report::{Cell, Definition, Source, System, Table},
};

/// What stands for every condition, town or traffic.
const ALL: &str = "all";

/// One line for each system, metric and task, then each condition, then all tasks together; numbers
/// exact, in the metric's unit, empty where there is none. RFC 4180 but for line ends, `\n`.
pub fn csv(table: &Table) -> String {
    let mut text = String::from(
        "suite,system,source,condition,town,traffic,metric,unit,value,k,n,low,high,episodes,\
         crashed,lacking\n",
    );
    for system in &table.systems {
        for (task, cell) in table.tasks.iter().zip(&system.tasks) {
            let place = [task.condition.as_str(), &task.town, &task.traffic];
            lines(&mut text, table, system, place, cell);
        }
        for (condition, cell) in &system.conditions {
            lines(&mut text, table, system, [condition, ALL, ALL], cell);
        }
        lines(&mut text, table, system, [ALL; 3], &system.pooled);
    }
    text
}

fn lines(text: &mut String, table: &Table, system: &System, place: [&str; 3], cell: &Cell) {
    let source = match system.source {
        Source::Driven => "driven",
        Source::Paper => "paper",
    };
    let mut head = vec![quoting::csv(table.suite.as_deref().unwrap_or_default())];
    head.extend([quoting::csv(&system.name), source.to_string()]);
    head.extend(place.map(quoting::csv));
    let exact = |value: Option<f64>| value.map_or(String::new(), |value| value.to_string());
    for Definition { key, unit, .. } in &table.metrics {
        let Some(estimate) = cell.metrics.get(key) else { continue };
        let mut line = head.clone();
        line.extend([
            key.clone(),
            unit.clone(),
            exact(estimate.value),
            estimate.k.map_or(String::new(), |k| k.to_string()),
            estimate.n.to_string(),
            exact(estimate.interval.map(|ends| ends[0])),
            exact(estimate.interval.map(|ends| ends[1])),
            cell.episodes.to_string(),
            cell.crashed.to_string(),
            cell.lacking.to_string(),
        ]);
        *text += &(line.join(",") + "\n");
    }
}
