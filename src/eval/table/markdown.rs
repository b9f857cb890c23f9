//! A table as Markdown: caveats, verdicts, table I as in the paper, the other metrics, comparisons,
//! what the numbers are.

use std::fmt::Write as _;

use crate::eval::table::{
    cells::{MISSING, heads, letter, pieces, systems_of, table_i, title},
    comparison::{of_test, p_text},
    definitions::{INSIDE, METRICS, Metric, TABLE_I},
    report::{Cell, Comparison, Source, SuccessTest, System, Table, Test, Verdict},
};

const BESIDE_DRIVEN: &str = "E empty, F few, R regular, D dense traffic. In brackets: 95 % \
    intervals, Wilson's for shares of episodes, else a bootstrap's over episodes; those of single \
    tasks' WL and OVSP are in the CSV and the JSON.";

const BESIDE_THE_PAPER: &str = "E empty, R regular, D dense traffic. The paper prints success in \
    whole per cents, each of which is k of 18 cut, not rounded; all tasks together with Wilson's \
    95 % interval are computed from these k. Its `--` stand where nothing succeeded.";

/// The whole of it.
pub fn markdown(table: &Table) -> String {
    let mut blocks = vec![
        match &table.suite {
            Some(suite) => format!("# Closed loop: suite {suite}"),
            None => "# Table I of the paper".to_string(),
        },
        lines(&table.caveats, |caveat| format!("> **{caveat}**\n\n")),
        lines(&table.comparisons, |comparison| format!("- {}\n", comparison.sentence)),
        match &table.suite {
            Some(_) => BESIDE_DRIVEN.to_string(),
            None => BESIDE_THE_PAPER.to_string(),
        },
        first_table(table),
        seeds_table(table),
    ];
    let driven: Vec<&System> =
        table.systems.iter().filter(|system| system.source == Source::Driven).collect();
    if !driven.is_empty() {
        blocks.extend([rest_table(&driven), touched_table(&driven), inside_table(&driven)]);
    }
    blocks.push(tests_table(table));
    blocks.push(differences_table(table));
    if !driven.is_empty() {
        blocks.push("What the numbers are:".to_string());
        blocks.push(lines(&table.metrics, |m| {
            let unit = if m.unit == "1" { String::new() } else { format!(", {}", m.unit) };
            let better = match m.better.as_str() {
                "neither" => String::new(),
                better => format!(", {better} is better"),
            };
            format!("- {} (`{}`{unit}{better}): {}\n", m.title, m.key, m.definition)
        }));
    }
    blocks.retain(|block| !block.is_empty());
    blocks.iter_mut().for_each(|block| block.truncate(block.trim_end().len()));
    blocks.join("\n\n") + "\n"
}

/// Rows are systems by metric; columns are tasks by condition and town, then all together.
fn first_table(table: &Table) -> String {
    let mut text = String::from("| | |");
    for head in heads(&table.tasks) {
        for (i, task) in head.iter().enumerate() {
            let place = format!("{}: {} ", task.condition, task.town);
            let _ =
                write!(text, " {}{} |", if i == 0 { &place } else { "" }, letter(&task.traffic));
        }
    }
    text += " all |\n|---|---|";
    text += &"---:|".repeat(table.tasks.len() + 1);
    text.push('\n');
    for metric in table_i(table) {
        for (i, system) in systems_of(table, metric).into_iter().enumerate() {
            let head =
                if i == 0 { format!("**{}** %", title(table, metric)) } else { String::new() };
            let _ = write!(text, "| {head} | {} |", system.shown());
            for cell in &system.tasks {
                let _ = write!(text, " {} |", short(cell, metric, system.source));
            }
            let all = match system.source {
                // As the paper does not print it, it is not cut as the paper cuts.
                Source::Paper => full(&system.pooled, metric),
                Source::Driven => counted(&system.pooled, metric),
            };
            let _ = writeln!(text, " {all} |");
        }
    }
    text
}

/// `38.9 (7/18) [20.3, 61.4]`, and of what is no share of episodes the value alone.
fn short(cell: &Cell, metric: &Metric, source: Source) -> String {
    let Some(pieces) = pieces(cell, metric, source) else { return MISSING.to_string() };
    match (pieces.fraction, pieces.interval) {
        (Some(fraction), Some(interval)) if source == Source::Driven => {
            format!("{} ({fraction}) [{interval}]", pieces.value)
        }
        (Some(fraction), _) => format!("{} ({fraction})", pieces.value),
        (None, _) => pieces.value,
    }
}

/// Value, fraction and interval.
fn full(cell: &Cell, metric: &Metric) -> String {
    let Some(pieces) = pieces(cell, metric, Source::Driven) else { return MISSING.to_string() };
    let fraction = pieces.fraction.map_or(String::new(), |fraction| format!(" ({fraction})"));
    let interval = pieces.interval.map_or(String::new(), |interval| format!(" [{interval}]"));
    format!("{}{fraction}{interval}", pieces.value)
}

/// The same with the episodes that it is over, if these are not all.
fn counted(cell: &Cell, metric: &Metric) -> String {
    let estimate = cell.of(metric.key);
    let some = estimate.value.is_some() && estimate.k.is_none() && estimate.n < cell.episodes;
    full(cell, metric) + &if some { format!(" (n = {})", estimate.n) } else { String::new() }
}

/// Success of each seed of a group.
fn seeds_table(table: &Table) -> String {
    let seeds = table.systems.iter().flat_map(|s| s.seeds.iter().map(move |seed| (s, seed)));
    let rows = seeds.map(|(system, seed)| {
        let [low, high] = seed.sr.interval.unwrap_or_default();
        let share = format!("{}/{}", seed.sr.k.unwrap_or_default(), seed.sr.n);
        match seed.sr.value {
            Some(value) => format!(
                "| `{}` | `{}` | {value:.1} ({share}) [{low:.1}, {high:.1}] |\n",
                system.name, seed.policy
            ),
            None => format!("| `{}` | `{}` | {MISSING} |\n", system.name, seed.policy),
        }
    });
    headed("| several seeds | policy | SR % |\n|---|---|---:|\n", rows.collect())
}

/// Metrics beside table I, over all tasks.
fn rest_table(driven: &[&System]) -> String {
    let names: String = lines(driven, |system| format!(" {} |", system.shown()));
    let mut head = format!("| all tasks | unit | better |{names}\n|---|---|---|");
    head += &"---:|".repeat(driven.len());
    head.push('\n');
    let shown = METRICS.iter().filter(|metric| !TABLE_I.contains(&metric.key));
    let shown = shown.filter(|metric| !INSIDE.contains(&metric.key));
    let row = |metric: &Metric| {
        let unit = if metric.unit == "1" { MISSING } else { metric.unit };
        let better = metric.better.text();
        let cells = lines(driven, |system| format!(" {} |", counted(&system.pooled, metric)));
        format!("| {} | {unit} | {better} |{cells}\n", metric.title)
    };
    let episodes = lines(driven, |system| {
        let Cell { episodes, crashed, lacking, .. } = system.pooled;
        format!(" {episodes} ({crashed}, {lacking}) |")
    });
    let episodes = format!("| Episodes (crashed, lacking) | {MISSING} | neither |{episodes}\n");
    head + &episodes + &shown.map(row).collect::<String>()
}

fn touched_table(driven: &[&System]) -> String {
    let kinds: std::collections::BTreeSet<&String> =
        driven.iter().flat_map(|system| system.touched.keys()).collect();
    let names: String = lines(driven, |system| format!(" {} |", system.shown()));
    let mut head = format!("| touched (at fault) |{names}\n|---|");
    head += &"---:|".repeat(driven.len());
    head.push('\n');
    let row = |kind: &String| {
        let cells = lines(driven, |system| match system.touched.get(kind) {
            Some(touched) => format!(" {} ({}) |", touched.contacts, touched.at_fault),
            None => " 0 |".to_string(),
        });
        format!("| {kind} |{cells}\n")
    };
    headed(&head, kinds.into_iter().map(row).collect())
}

/// How actions were fused and where attention lay, by condition.
fn inside_table(driven: &[&System]) -> String {
    let inside: Vec<&Metric> = METRICS.iter().filter(|m| INSIDE.contains(&m.key)).collect();
    let has = |cell: &Cell| inside.iter().any(|metric| cell.of(metric.key).value.is_some());
    let titles = lines(&inside, |metric| format!(" {} |", metric.title));
    let mut head = format!("| condition | system |{titles}\n|---|---|");
    head += &"---:|".repeat(inside.len());
    head.push('\n');
    let cells = driven.iter().flat_map(|system| {
        system.conditions.iter().map(move |(condition, cell)| (condition, system, cell))
    });
    let row = |(condition, system, cell): (&String, &&System, &Cell)| {
        let values = lines(&inside, |metric| format!(" {} |", full(cell, metric)));
        format!("| {condition} | {} |{values}\n", system.shown())
    };
    headed(&head, cells.filter(|(_, _, cell)| has(cell)).map(row).collect())
}

/// Success of every pair on every task.
fn tests_table(table: &Table) -> String {
    let tested: Vec<&Comparison> =
        table.comparisons.iter().filter(|comparison| comparison.pooled.is_some()).collect();
    let mut head = String::from("| success: pair |");
    for task in &table.tasks {
        let _ = write!(head, " {} {} |", task.town, letter(&task.traffic));
    }
    head += " all |\n|---|";
    head += &"---:|".repeat(table.tasks.len() + 1);
    head.push('\n');
    let row = |comparison: &&Comparison| {
        let mut row = format!("| {} : {} |", comparison.first, comparison.second);
        for test in comparison.tasks.iter().chain([&comparison.pooled]) {
            let _ = write!(row, " {} |", test.as_ref().map_or(MISSING.to_string(), test_text));
        }
        row + "\n"
    };
    let rows: String = tested.iter().map(row).collect();
    if rows.is_empty() {
        return rows;
    }
    "Success of pairs, two-sided exact tests. `5 : 1` is McNemar's: episodes won by the first alone \
     and by the second alone; `18/18 : 15/18` is Fisher's, of unpaired episodes. p is after Holm's \
     correction over the tasks, that of all tasks over the pairs; bold is below 0.05.\n\n"
        .to_string()
        + &head
        + &rows
}

fn test_text(test: &SuccessTest) -> String {
    let counts = match (test.test, test.only_first, test.only_second) {
        (Test::Mcnemar, Some(first), Some(second)) => format!("{first} : {second}"),
        _ => format!("{}/{} : {}/{}", test.first[0], test.first[1], test.second[0], test.second[1]),
    };
    let p = format!("p {}", p_text(test.p_holm));
    match of_test(test) {
        Verdict::FirstIsBetter | Verdict::SecondIsBetter => format!("{counts}, **{p}**"),
        Verdict::NoDifference | Verdict::TooFew => format!("{counts}, {p}"),
    }
}

/// The other metrics of every pair, over the episodes that both drove.
fn differences_table(table: &Table) -> String {
    let mut rows = String::new();
    for comparison in &table.comparisons {
        for found in comparison.differences.iter().filter(|found| found.episodes > 0) {
            let Some(metric) = METRICS.iter().find(|metric| metric.key == found.metric) else {
                continue;
            };
            let digits = metric.digits;
            let number =
                |value: Option<f64>| value.map_or(MISSING.to_string(), |v| format!("{v:.digits$}"));
            let interval = found
                .interval
                .map_or(String::new(), |[low, high]| format!(" [{low:.digits$}, {high:.digits$}]"));
            let better = match found.verdict {
                Verdict::FirstIsBetter => format!("`{}`", comparison.first),
                Verdict::SecondIsBetter => format!("`{}`", comparison.second),
                Verdict::NoDifference => "no claim".to_string(),
                Verdict::TooFew => "too few".to_string(),
            };
            let _ = writeln!(
                rows,
                "| {} : {} | {} | {} | {} | {}{interval} | {better} | {} |",
                comparison.first,
                comparison.second,
                metric.title,
                number(found.first),
                number(found.second),
                number(found.difference),
                found.episodes,
            );
        }
    }
    headed(
        "| same episodes: pair | metric | first | second | difference | better | episodes |\n\
         |---|---|---:|---:|---:|---|---:|\n",
        rows,
    )
}

/// Nothing if there are no rows.
fn headed(head: &str, rows: String) -> String {
    if rows.is_empty() { rows } else { head.to_string() + &rows }
}

fn lines<T>(items: &[T], line: impl Fn(&T) -> String) -> String {
    items.iter().map(line).collect()
}
