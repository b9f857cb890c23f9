//! Rows of one or more directories, put together: what may stand in one table, and who drove what.

use std::{
    collections::{BTreeMap, BTreeSet},
    path::{Path, PathBuf},
};

use crate::{
    closed_loop::row::EpisodeRow,
    error::{Error, Result},
    eval::table::{
        definitions::{CRASHED, REASONS},
        paper,
        report::Task,
    },
};

/// Levels of traffic in the order of columns; others come behind.
const TRAFFIC: [&str; 4] = ["empty", "few", "regular", "dense"];

/// What tells an episode from the others of its suite: the same for every policy that drove it.
pub type Key<'r> = (&'r str, &'r str, u32, u64);

/// The key of a row's episode: town, traffic, number, seed of the suite.
pub fn key(row: &EpisodeRow) -> Key<'_> {
    (&row.town, &row.traffic, row.episode, row.seed)
}

/// Policies that are one model, trained from different seeds.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Group {
    pub name: String,
    pub policies: Vec<String>,
}

/// A system and the rows of each of its policies; it is one policy, unless it is a [`Group`].
#[derive(Clone, Debug)]
pub struct Driven<'r> {
    pub name: String,
    pub policies: Vec<(&'r str, Vec<&'r EpisodeRow>)>,
}

impl<'r> Driven<'r> {
    /// All rows.
    pub fn rows(&self) -> impl Iterator<Item = &'r EpisodeRow> {
        self.policies.iter().flat_map(|(_, rows)| rows.iter().copied())
    }

    /// Rows of episodes that were driven to an end, by episode.
    pub fn ended(&self) -> BTreeMap<Key<'r>, Vec<&'r EpisodeRow>> {
        let mut by_key: BTreeMap<_, Vec<_>> = BTreeMap::new();
        for row in self.rows().filter(|row| row.reason != CRASHED) {
            by_key.entry(key(row)).or_default().push(row);
        }
        by_key
    }
}

/// The rows of several files as those of one; each file's come with where they were read.
///
/// A row that is in more than one is kept once.
///
/// # Errors
///
/// [`Error::Report`] naming the file that is of another suite, that holds another outcome of an
/// episode of the same policy, another episode under the same number, or a reason that is unknown;
/// or if there is no row at all.
pub fn merge(files: Vec<(PathBuf, Vec<EpisodeRow>)>) -> Result<Vec<EpisodeRow>> {
    let mut merged: Vec<EpisodeRow> = Vec::new();
    let mut outcomes: BTreeMap<(String, String, String, u32, u64), usize> = BTreeMap::new();
    let mut courses: BTreeMap<(String, String, u32, u64), usize> = BTreeMap::new();
    for (path, rows) in &files {
        for row in rows {
            if let Some(first) = merged.first()
                && row.suite != first.suite
            {
                return Err(refusal(
                    path,
                    format!("these are episodes of suite {}, others of {}", row.suite, first.suite),
                    "one table holds one suite: make one table for each",
                ));
            }
            if !REASONS.contains(&row.reason.as_str()) {
                return Err(refusal(
                    path,
                    format!("{} ended by `{}`, which is unknown", shown(row), row.reason),
                    "read the file with the build that wrote it, or drive the suite again",
                ));
            }
            let (town, traffic) = (row.town.clone(), row.traffic.clone());
            let of_policy =
                (row.policy.clone(), town.clone(), traffic.clone(), row.episode, row.seed);
            match outcomes.get(&of_policy) {
                Some(&known) if merged[known] == *row => continue,
                Some(_) => {
                    return Err(refusal(
                        path,
                        format!("another outcome of {} than before", shown(row)),
                        "two policies of one name: rename one of the run directories and drive \
                         the suite again",
                    ));
                }
                None => {}
            }
            if row.reason != CRASHED {
                let course = (town, traffic, row.episode, row.seed);
                match courses.get(&course) {
                    Some(&known) if !same_course(&merged[known], row) => {
                        return Err(refusal(
                            path,
                            format!(
                                "{} is not the episode of {}",
                                shown(row),
                                shown(&merged[known])
                            ),
                            "the suite has changed between these drives: drive it again with all \
                             policies",
                        ));
                    }
                    Some(_) => {}
                    None => drop(courses.insert(course, merged.len())),
                }
            }
            outcomes.insert(of_policy, merged.len());
            merged.push(row.clone());
        }
    }
    if merged.is_empty() {
        let path = files.first().map(|(path, _)| path.clone()).unwrap_or_default();
        return Err(refusal(&path, "no episodes".to_string(), "drive a suite: `pmp-eval drive`"));
    }
    Ok(merged)
}

/// The tasks of the rows, in the order of columns: the paper's conditions first and in its order.
pub fn tasks(rows: &[EpisodeRow]) -> Vec<Task> {
    let tasks: BTreeSet<_> = rows.iter().map(|r| (&r.condition, &r.town, &r.traffic)).collect();
    let task = |(condition, town, traffic): (&String, &String, &String)| Task {
        condition: condition.clone(),
        town: town.clone(),
        traffic: traffic.clone(),
    };
    let mut tasks: Vec<Task> = tasks.into_iter().map(task).collect();
    let rank = |name: &str| TRAFFIC.iter().position(|known| *known == name).unwrap_or(usize::MAX);
    // Stable, so that what is unknown to both ranks stays in the order of its name.
    tasks.sort_by_cached_key(|task| {
        let condition = paper::rank(&task.condition);
        (condition, task.condition.clone(), task.town.clone(), rank(&task.traffic))
    });
    tasks
}

/// Who drove, by name; policies of a group stand for the group.
///
/// # Errors
///
/// [`Error::Config`] if a group has a policy that did not drive or that another group has, or the
/// name of another system.
pub fn systems<'r>(rows: &'r [EpisodeRow], groups: &[Group]) -> Result<Vec<Driven<'r>>> {
    let mut by_policy: BTreeMap<&str, Vec<&EpisodeRow>> = BTreeMap::new();
    for row in rows {
        by_policy.entry(&row.policy).or_default().push(row);
    }
    let known = by_policy.keys().copied().collect::<Vec<_>>().join(", ");
    let refuse = |what: String| Error::Config {
        key: "--group".to_string(),
        what,
        hint: Some(format!("NAME=P1,P2,...; the policies that drove are {known}")),
    };
    let mut systems: BTreeMap<String, Driven<'r>> = BTreeMap::new();
    for group in groups {
        let mut policies = Vec::new();
        for name in &group.policies {
            let found = by_policy.remove_entry(name.as_str());
            policies.push(found.ok_or_else(|| refuse(format!("no policy `{name}` is left")))?);
        }
        let system = Driven { name: group.name.clone(), policies };
        if systems.insert(group.name.clone(), system).is_some() {
            return Err(refuse(format!("two groups `{}`", group.name)));
        }
    }
    for (name, rows) in by_policy {
        let system = Driven { name: name.to_string(), policies: vec![(name, rows)] };
        if systems.insert(name.to_string(), system).is_some() {
            return Err(refuse(format!("`{name}` is a group and a policy")));
        }
    }
    Ok(systems.into_values().collect())
}

/// A row as sentences name it.
fn shown(row: &EpisodeRow) -> String {
    format!("`{}`'s {} {} {}", row.policy, row.town, row.traffic, row.episode)
}

/// Whether two policies were set the same episode.
fn same_course(a: &EpisodeRow, b: &EpisodeRow) -> bool {
    let course = |row: &EpisodeRow| (row.vehicles, row.pedestrians, row.route_m, row.time_limit_s);
    let texts =
        |row: &EpisodeRow| [&row.condition, &row.weather, &row.illumination].map(Clone::clone);
    course(a) == course(b) && texts(a) == texts(b)
}

fn refusal(path: &Path, what: String, hint: &str) -> Error {
    Error::Report { path: path.to_path_buf(), what, hint: Some(hint.to_string()) }
}
