//! A table as LaTeX: the paper's table I, in its layout.

use std::fmt::Write as _;

use crate::eval::{
    quoting,
    table::{
        cells::{MISSING, Pieces, heads, letter, pieces, systems_of, table_i, title},
        report::{Source, Table},
    },
};

/// A `tabular` of `booktabs`: systems by metric, tasks by condition and town, all tasks last with
/// intervals; caveats and verdicts as comments.
pub fn latex(table: &Table) -> String {
    let mut text = String::new();
    let sentences = table.comparisons.iter().map(|comparison| &comparison.sentence);
    for said in table.caveats.iter().chain(sentences) {
        let _ = writeln!(text, "% {}", said.replace(['\n', '\r'], " "));
    }
    let heads = heads(&table.tasks);
    let columns: String = heads.iter().map(|head| "r".repeat(head.len())).collect();
    let _ = writeln!(text, "\\begin{{tabular}}{{ll{columns}r}}\n\\toprule");
    for pick in [0, 1] {
        let names = heads.iter().map(|head| {
            let name = if pick == 0 { &head[0].condition } else { &head[0].town };
            format!(" & \\multicolumn{{{}}}{{c}}{{{}}}", head.len(), quoting::latex(name))
        });
        let _ = writeln!(text, " & {} & \\\\", names.collect::<String>());
    }
    let letters =
        table.tasks.iter().map(|task| format!(" & {}", quoting::latex(letter(&task.traffic))));
    let _ = writeln!(text, " & {} & all \\\\", letters.collect::<String>());
    for metric in table_i(table) {
        text += "\\midrule\n";
        for (i, system) in systems_of(table, metric).into_iter().enumerate() {
            let head = match i {
                0 => format!("{} (\\%)", quoting::latex(title(table, metric))),
                _ => String::new(),
            };
            let name = match system.source {
                Source::Driven => quoting::latex(&system.name),
                Source::Paper => format!("{} (paper)", quoting::latex(&system.name)),
            };
            let _ = write!(text, "{head} & {name}");
            for cell in &system.tasks {
                let shown = pieces(cell, metric, system.source);
                let shown = shown.map(|pieces| Pieces { interval: None, ..pieces });
                let _ = write!(text, " & {}", cell_text(shown));
            }
            let all = pieces(&system.pooled, metric, Source::Driven);
            let _ = writeln!(text, " & {} \\\\", cell_text(all));
        }
    }
    text + "\\bottomrule\n\\end{tabular}\n"
}

fn cell_text(pieces: Option<Pieces>) -> String {
    let Some(Pieces { value, fraction, interval }) = pieces else { return MISSING.to_string() };
    let small = |text: String| format!(" {{\\scriptsize {text}}}");
    let fraction = fraction.map_or(String::new(), small);
    let interval = interval.map_or(String::new(), |interval| small(format!("$[{interval}]$")));
    format!("${value}${fraction}{interval}")
}
