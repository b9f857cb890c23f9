//! A report as text: Markdown, CSV, LaTeX.
//!
//! Missing values are a dash where people read and empty where programs do. Every number stands
//! beside the frames it is over.

use std::fmt::Write as _;

use crate::eval::{
    offline::{
        definitions::HEADLINE,
        report::{Definition, Estimate, PolicyReport, Report},
    },
    quoting,
};

/// What a missing value looks like to people.
const MISSING: &str = "–";

/// Metrics of the table by slice.
const SLICED: [&str; 2] = ["ade_3s", HEADLINE];

/// One metric a row and one policy a column; caveats first, then verdicts, slices, definitions.
pub fn markdown(report: &Report) -> String {
    let mut blocks = vec![
        format!("# Offline evaluation on {}\n", report.dataset.name),
        lines(&report.caveats, |caveat| format!("> **{caveat}**\n\n")),
        basis(report),
        lines(&verdicts(report), |verdict| format!("- {verdict}\n")),
        metrics_tables(report),
        slices_table(report),
        "What the numbers are (open loop: a small error here does not show that a policy \
         drives; closed loop does):\n"
            .to_string(),
        lines(&report.metrics, |m| {
            let unit = if m.unit == "1" { String::new() } else { format!(", {}", m.unit) };
            format!("- {} (`{}`{unit}, {} is better): {}\n", m.title, m.key, m.better, m.definition)
        }),
    ];
    blocks.retain(|block| !block.is_empty());
    blocks.iter_mut().for_each(|block| block.truncate(block.trim_end().len()));
    blocks.join("\n\n") + "\n"
}

/// One policy a row; `KEY`, `KEY_low`, `KEY_high` (ends of the interval) and `KEY_frames` for every
/// metric, in its unit. RFC 4180 but for line ends, which are `\n`.
pub fn csv(report: &Report) -> String {
    let mut head = ["dataset", "holdout", "weak", "policy", "sees_the_future", "frames"]
        .map(str::to_string)
        .to_vec();
    for metric in &report.metrics {
        head.extend(["", "_low", "_high", "_frames"].map(|end| format!("{}{end}", metric.key)));
    }
    let mut text = head.join(",") + "\n";
    for policy in &report.policies {
        let mut row = vec![
            quoting::csv(&report.dataset.name),
            quoting::csv(report.holdout.kind.text()),
            report.holdout.weak.to_string(),
            quoting::csv(&policy.name),
            policy.sees_the_future.to_string(),
            report.evaluated.frames.to_string(),
        ];
        for metric in &report.metrics {
            let estimate = of(policy, &metric.key);
            let exact = |value: Option<f64>| value.map_or(String::new(), |v| v.to_string());
            row.push(exact(estimate.value));
            row.push(exact(estimate.interval.map(|ends| ends[0])));
            row.push(exact(estimate.interval.map(|ends| ends[1])));
            row.push(estimate.frames.to_string());
        }
        text += &(row.join(",") + "\n");
    }
    text
}

/// A `tabular` of `booktabs`, one metric a row and one policy a column, caveats as comments.
pub fn latex(report: &Report) -> String {
    let mut text = lines(&report.caveats, |caveat| format!("% {caveat}\n"));
    let columns = "r".repeat(report.policies.len() + 1);
    let names = lines(&report.policies, |policy| format!(" & {}", quoting::latex(&policy.name)));
    let _ = writeln!(text, "\\begin{{tabular}}{{ll{columns}}}\n\\toprule");
    let _ = writeln!(text, "Metric & Unit & Frames{names} \\\\\n\\midrule");
    for metric in metrics_had(report) {
        let cells = lines(&report.policies, |policy| {
            let estimate = of(policy, &metric.key);
            let interval = estimate.interval.map_or(String::new(), |[low, high]| {
                format!(" {{\\scriptsize $[{low:.3}, {high:.3}]$}}")
            });
            let value = estimate.value.map_or(MISSING.to_string(), |value| format!("${value:.3}$"));
            format!(" & {value}{interval}")
        });
        let unit = if metric.unit == "1" { MISSING } else { &metric.unit };
        let (title, frames) = (quoting::latex(&metric.title), counts(report, &metric.key));
        let _ = writeln!(text, "{title} & {unit} & {frames}{cells} \\\\");
    }
    text + "\\bottomrule\n\\end{tabular}\n"
}

/// What was evaluated and how intervals were made, in sentences.
pub fn basis(report: &Report) -> String {
    let (evaluated, holdout, intervals) = (&report.evaluated, &report.holdout, &report.intervals);
    let bootstrap = &intervals.bootstrap;
    format!(
        "Evaluated: {}/{} frames of {}/{} episodes. Held out by {}: {}.\n\
         Intervals: {:.0} %, percentile bootstrap, {} resamples of {}, seed {}.\n",
        evaluated.frames,
        holdout.frames,
        evaluated.episodes,
        holdout.episodes,
        holdout.kind.text(),
        holdout.how,
        bootstrap.level * 100.0,
        bootstrap.resamples,
        intervals.unit.counted(intervals.units),
        bootstrap.seed,
    )
}

/// A table for each group of metrics, of those that some policy has.
fn metrics_tables(report: &Report) -> String {
    let names = lines(&report.policies, |policy| format!(" `{}` |", policy.name));
    let head = format!("| metric | unit | better | frames |{names}\n|---|---|---|---:|");
    let head = head + &"---:|".repeat(report.policies.len());
    let mut text = String::new();
    for group in metrics_had(report).chunk_by(|a, b| a.group == b.group) {
        let _ = writeln!(text, "## {}\n\n{head}", group[0].group);
        for metric in group {
            let unit = if metric.unit == "1" { MISSING } else { &metric.unit };
            let frames = counts(report, &metric.key);
            let cells =
                lines(&report.policies, |policy| format!(" {} |", cell(of(policy, &metric.key))));
            let title = &metric.title;
            let _ = writeln!(text, "| {title} | {unit} | {} | {frames} |{cells}", metric.better);
        }
        text.push('\n');
    }
    text
}

/// What can be said of the policies against the reference.
fn verdicts(report: &Report) -> Vec<&str> {
    let paired = report.policies.iter().flat_map(|policy| &policy.paired);
    paired.map(|paired| paired.sentence.as_str()).collect()
}

fn slices_table(report: &Report) -> String {
    let Some(first) = report.policies.first() else { return String::new() };
    let mut text = String::from("| slice | frames |");
    for key in SLICED {
        let title = report.metrics.iter().find(|m| m.key == key).map_or(key, |m| &m.title);
        text += &lines(&report.policies, |policy| format!(" {title} `{}` |", policy.name));
    }
    text += "\n|---|---:|";
    text += &"---:|".repeat(SLICED.len() * report.policies.len());
    text.push('\n');
    for (i, slice) in first.slices.iter().enumerate() {
        let unit = if slice.by == "speed" { " m/s" } else { "" };
        let _ = write!(text, "| {} {}{unit} | {}/{} |", slice.by, slice.name, slice.frames, {
            report.evaluated.frames
        });
        for key in SLICED {
            text += &lines(&report.policies, |policy| {
                let estimate = policy.slices.get(i).and_then(|slice| slice.metrics.get(key));
                let counted = estimate
                    .filter(|e| e.value.is_some())
                    .map(|e| format!("{} (n = {})", cell(e), e.frames));
                format!(" {} |", counted.unwrap_or(MISSING.to_string()))
            });
        }
        text.push('\n');
    }
    text
}

/// `k/n` frames, once if all policies that have the metric agree, else in their order.
fn counts(report: &Report, key: &str) -> String {
    let mut counts: Vec<u64> = report.policies.iter().map(|p| of(p, key).frames).collect();
    let mut present = counts.clone();
    present.retain(|&count| count > 0);
    if present.windows(2).all(|pair| pair[0] == pair[1]) {
        counts = vec![present.first().copied().unwrap_or(0)];
    }
    let counts: Vec<_> =
        counts.iter().map(|k| format!("{k}/{}", report.evaluated.frames)).collect();
    counts.join(", ")
}

/// The number of a policy; an empty one if it has none.
pub fn of<'a>(policy: &'a PolicyReport, key: &str) -> &'a Estimate {
    const NONE: &Estimate = &Estimate { value: None, interval: None, frames: 0 };
    policy.metrics.get(key).unwrap_or(NONE)
}

fn cell(estimate: &Estimate) -> String {
    let value = estimate.value.map_or(MISSING.to_string(), |value| format!("{value:.3}"));
    let interval =
        estimate.interval.map_or(String::new(), |[low, high]| format!(" [{low:.3}, {high:.3}]"));
    value + &interval
}

/// The metrics that some policy has.
pub fn metrics_had(report: &Report) -> Vec<&Definition> {
    let has = |metric: &&Definition| {
        report.policies.iter().any(|policy| of(policy, &metric.key).value.is_some())
    };
    report.metrics.iter().filter(has).collect()
}

fn lines<T>(items: &[T], line: impl Fn(&T) -> String) -> String {
    items.iter().map(line).collect()
}
