//! Rows become a table: every number over tasks, conditions and all, with its interval.

use std::collections::{BTreeMap, BTreeSet};

use rayon::iter::{IntoParallelRefIterator as _, ParallelIterator as _};

use crate::{
    closed_loop::row::EpisodeRow,
    error::Result,
    eval::{
        statistics::{
            Bootstrap,
            ratio::{Term, ratio},
        },
        table::{
            comparison,
            definitions::{CRASHED, METRICS, Measure, Metric},
            episodes::{Driven, Group, Key, key, systems, tasks},
            paper::Paper,
            report::{
                Cell, Definition, Estimate, Seed, Source, System, Table, Task, Touched, VERSION,
            },
        },
    },
};

/// Episodes named one by one in a caveat; of more, how many they are.
const NAMED: usize = 4;

/// The table of rows that [`merge`](crate::eval::table::episodes::merge) put together, with the
/// paper's numbers on the same tasks where they are asked for.
///
/// # Errors
///
/// [`Error::Config`](crate::error::Error::Config) if a group is none.
pub fn of_episodes(
    rows: &[EpisodeRow],
    groups: &[Group],
    bootstrap: Bootstrap,
    paper: Option<&Paper>,
) -> Result<Table> {
    let tasks = tasks(rows);
    let driven = systems(rows, groups)?;
    let all: BTreeSet<Key> = rows.iter().map(key).collect();
    let mut systems: Vec<System> =
        driven.iter().map(|system| summarise(system, &tasks, &all, bootstrap)).collect();
    let mut caveats: Vec<String> = driven.iter().filter_map(crashes).collect();
    caveats.extend(driven.iter().flat_map(|system| lacking(system, &all)));
    if let Some(paper) = paper {
        let printed = paper.over(&tasks);
        let matched =
            printed.first().map_or(0, |s| s.tasks.iter().filter(|c| c.episodes > 0).count());
        caveats.push(reference_caveat(matched, tasks.len()));
        systems.extend(printed);
    }
    Ok(Table {
        version: VERSION,
        caveats,
        suite: rows.first().map(|row| row.suite.clone()),
        bootstrap,
        metrics: Definition::all(),
        comparisons: comparison::of_driven(&driven, &tasks, bootstrap),
        tasks,
        systems,
    })
}

/// The paper's table alone.
pub fn of_paper(paper: &Paper) -> Table {
    Table {
        version: VERSION,
        caveats: Vec::new(),
        suite: None,
        bootstrap: Bootstrap::default(),
        metrics: Definition::all(),
        comparisons: comparison::of_printed(&paper.systems, &paper.tasks),
        tasks: paper.tasks.clone(),
        systems: paper.systems.clone(),
    }
}

/// Which rows a cell is over.
#[derive(Clone, Copy)]
enum Scope<'t> {
    Task(&'t Task),
    Condition(&'t str),
    All,
}

impl Scope<'_> {
    fn holds(self, row: &EpisodeRow) -> bool {
        match self {
            Scope::Task(task) => row.town == task.town && row.traffic == task.traffic,
            Scope::Condition(condition) => row.condition == condition,
            Scope::All => true,
        }
    }
}

fn summarise(system: &Driven, tasks: &[Task], all: &BTreeSet<Key>, bootstrap: Bootstrap) -> System {
    let conditions: BTreeSet<&str> = tasks.iter().map(|task| task.condition.as_str()).collect();
    let mut scopes: Vec<Scope> = tasks.iter().map(Scope::Task).collect();
    scopes.extend(conditions.iter().map(|condition| Scope::Condition(condition)));
    scopes.push(Scope::All);
    let lacking = lacking_keys(system, all);
    let of_scope = |scope: &Scope| cell(system, *scope, tasks, &lacking, bootstrap);
    let mut cells: Vec<Cell> = scopes.par_iter().map(of_scope).collect();
    let pooled = cells.pop().unwrap_or_default();
    let by_condition = cells.split_off(tasks.len());
    let names = conditions.iter().map(ToString::to_string);
    System {
        name: system.name.clone(),
        source: Source::Driven,
        seeds: seeds(system),
        conditions: names.zip(by_condition).collect(),
        tasks: cells,
        pooled,
        touched: touched(system),
    }
}

fn cell(
    system: &Driven,
    scope: Scope,
    tasks: &[Task],
    lacking: &[Key],
    bootstrap: Bootstrap,
) -> Cell {
    let within = |rows: &[&EpisodeRow]| -> Vec<Vec<Term>> {
        let ended = rows.iter().filter(|row| row.reason != CRASHED && scope.holds(row));
        ended.map(|row| METRICS.iter().map(|metric| metric.measure.term(row)).collect()).collect()
    };
    let groups: Vec<Vec<Vec<Term>>> =
        system.policies.iter().map(|(_, rows)| within(rows)).collect();
    let intervals = bootstrap.ratios(&groups);
    let units: Vec<&Vec<Term>> = groups.iter().flatten().collect();
    let estimates = METRICS.iter().zip(intervals).enumerate().map(|(i, (metric, interval))| {
        let estimate = estimate(metric, units.iter().map(|unit| unit[i]), interval, groups.len());
        (metric.key.to_string(), estimate)
    });
    let crashed = system.rows().filter(|row| row.reason == CRASHED && scope.holds(row));
    let in_scope = |key: &&Key| match scope {
        Scope::All => true,
        Scope::Task(task) => (key.0, key.1) == (&task.town, &task.traffic),
        Scope::Condition(condition) => tasks.iter().any(|task| {
            task.condition == condition && (key.0, key.1) == (&task.town, &task.traffic)
        }),
    };
    Cell {
        episodes: units.len() as u64,
        crashed: crashed.count() as u64,
        lacking: lacking.iter().filter(in_scope).count() as u64,
        metrics: estimates.collect(),
    }
}

/// A share of one policy's episodes has Wilson's interval; episodes of several seeds are not
/// independent, so theirs comes of the seeds.
fn estimate(
    metric: &Metric,
    terms: impl Iterator<Item = Term> + Clone,
    interval: Option<[f64; 2]>,
    seeds: usize,
) -> Estimate {
    let scaled = |value: f64| value * metric.measure.scale();
    let n = terms.clone().flatten().count() as u64;
    let interval = interval.map(|ends| ends.map(scaled));
    match metric.measure {
        Measure::Share(_) => {
            let k = terms.flatten().map(|[yes, _]| yes as u64).sum();
            let share = Estimate::share(k, n);
            if seeds > 1 { Estimate { interval, ..share } } else { share }
        }
        Measure::Ratio { .. } => Estimate { value: ratio(terms).map(scaled), k: None, n, interval },
    }
}

fn seeds(system: &Driven) -> Vec<Seed> {
    if system.policies.len() < 2 {
        return Vec::new();
    }
    let seed = |(policy, rows): &(&str, Vec<&EpisodeRow>)| {
        let ended = rows.iter().filter(|row| row.reason != CRASHED);
        let won = ended.clone().filter(|row| row.success);
        let sr = Estimate::share(won.count() as u64, ended.count() as u64);
        Seed { policy: policy.to_string(), sr }
    };
    system.policies.iter().map(seed).collect()
}

fn touched(system: &Driven) -> BTreeMap<String, Touched> {
    let mut touched: BTreeMap<String, Touched> = BTreeMap::new();
    for row in system.rows().filter(|row| row.reason != CRASHED) {
        if let Some(what) = &row.touched {
            let kind = touched.entry(what.clone()).or_default();
            kind.contacts += 1;
            kind.at_fault += u64::from(row.at_fault == Some(true));
        }
    }
    touched
}

/// That episodes ended in an error, which, and what the first one said.
fn crashes(system: &Driven) -> Option<String> {
    let crashed: Vec<&EpisodeRow> = system.rows().filter(|row| row.reason == CRASHED).collect();
    let first = crashed.first()?;
    let names: Vec<String> = crashed.iter().map(|row| place(&key(row))).collect();
    Some(format!(
        "`{}` crashed in {} of {} episodes, which are in no number: {}; the first said: {}.",
        system.name,
        crashed.len(),
        system.rows().count(),
        listed(&names),
        first.error.as_deref().unwrap_or("nothing"),
    ))
}

/// Episodes that others drove, of each policy of the system that lacks them.
fn lacking_keys<'r>(system: &Driven<'r>, all: &BTreeSet<Key<'r>>) -> Vec<Key<'r>> {
    let of_policy = |(_, rows): &(&str, Vec<&'r EpisodeRow>)| {
        let own: BTreeSet<Key> = rows.iter().map(|row| key(row)).collect();
        all.iter().filter(|key| !own.contains(*key)).copied().collect::<Vec<_>>()
    };
    system.policies.iter().flat_map(of_policy).collect()
}

fn lacking(system: &Driven, all: &BTreeSet<Key>) -> Vec<String> {
    let of_policy = |policy: &(&str, Vec<&EpisodeRow>)| {
        let alone = Driven { name: String::new(), policies: vec![policy.clone()] };
        let names: Vec<String> = lacking_keys(&alone, all).iter().map(place).collect();
        (!names.is_empty()).then(|| {
            format!(
                "`{}` lacks {} of {} episodes that others drove, and its numbers are over the rest: {}.",
                policy.0,
                names.len(),
                all.len(),
                listed(&names)
            )
        })
    };
    system.policies.iter().filter_map(of_policy).collect()
}

fn place((town, traffic, episode, _): &Key) -> String {
    format!("{town} {traffic} {episode}")
}

fn listed(names: &[String]) -> String {
    match names.len().saturating_sub(NAMED) {
        0 => names.join(", "),
        more => format!("{} and {more} more", names[..NAMED].join(", ")),
    }
}

fn reference_caveat(matched: usize, tasks: usize) -> String {
    let of = "The paper's systems drove CARLA 0.9.7, other routes and other traffic: they are set \
              beside these, with success cut to whole per cents as printed, and no test compares the \
              two";
    match (matched, tasks) {
        (0, _) => format!("{of}; none of these tasks is one of the paper's."),
        (matched, tasks) if matched < tasks => {
            format!("{of}; {matched} of {tasks} tasks are the paper's, and its sums are over them.")
        }
        _ => format!("{of}."),
    }
}
