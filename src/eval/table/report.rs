//! The table as data: the same whatever it is rendered to. `schemas/table.v1.json` lists its fields.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::eval::{
    statistics::{Bootstrap, proportion::wilson},
    table::definitions::METRICS,
};

/// Version of the fields below.
pub const VERSION: u32 = 1;

/// Systems, the tasks that they drove, and what came of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Table {
    /// [`VERSION`].
    pub version: u32,
    /// What a reader has to know beside the numbers, most important first.
    pub caveats: Vec<String>,
    /// Name of the suite; `None` where nothing was driven and the paper stands alone.
    pub suite: Option<String>,
    pub bootstrap: Bootstrap,
    pub metrics: Vec<Definition>,
    /// In the order of columns.
    pub tasks: Vec<Task>,
    /// Driven ones by name, then the paper's.
    pub systems: Vec<System>,
    /// Every pair of driven systems; of the paper's where they stand alone.
    pub comparisons: Vec<Comparison>,
}

/// A row of [`METRICS`], for readers of the JSON.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Definition {
    pub key: String,
    pub title: String,
    pub unit: String,
    /// lower, higher or neither.
    pub better: String,
    pub definition: String,
}

/// Where and among how many others.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Task {
    pub condition: String,
    pub town: String,
    pub traffic: String,
}

/// A policy, or several of one name that were trained from different seeds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct System {
    pub name: String,
    pub source: Source,
    /// One by one, where the system is a group; else none.
    pub seeds: Vec<Seed>,
    /// One a task, in their order.
    pub tasks: Vec<Cell>,
    /// By condition.
    pub conditions: BTreeMap<String, Cell>,
    /// All tasks together.
    pub pooled: Cell,
    /// What was touched, by what it was.
    pub touched: BTreeMap<String, Touched>,
}

/// Where numbers are from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Source {
    /// From episodes.
    Driven,
    /// As printed in the paper.
    Paper,
}

/// One policy of a group.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Seed {
    pub policy: String,
    /// Success rate over all tasks, with Wilson's interval.
    pub sr: Estimate,
}

/// The numbers of some episodes.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Cell {
    /// Driven to an end: all that is counted.
    pub episodes: u64,
    /// In which the policy gave an error; in no number.
    pub crashed: u64,
    /// That another system drove and this one did not; in no number.
    pub lacking: u64,
    /// By metric key.
    pub metrics: BTreeMap<String, Estimate>,
}

/// One number.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// In the metric's unit; `None` where no episode has it.
    pub value: Option<f64>,
    /// Episodes of which it is true, for a share of episodes.
    pub k: Option<u64>,
    /// Episodes that have a part in it.
    pub n: u64,
    /// 95 %: Wilson's for a share of episodes, a bootstrap's over episodes for the rest and over
    /// seeds and episodes for several seeds; `None` where it says nothing.
    pub interval: Option<[f64; 2]>,
}

/// Contacts with one kind of thing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Touched {
    pub contacts: u64,
    /// Caused by the ego vehicle.
    pub at_fault: u64,
}

/// Two systems.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Comparison {
    pub first: String,
    pub second: String,
    /// Success, one a task in their order; `None` where one has no episode, or is several seeds.
    /// Holm's correction is over these tasks.
    pub tasks: Vec<Option<SuccessTest>>,
    /// Success in all tasks together. Holm's correction is over the pairs of systems.
    pub pooled: Option<SuccessTest>,
    /// Other metrics, over the episodes that both drove.
    pub differences: Vec<Difference>,
    /// On success.
    pub verdict: Verdict,
    /// The verdict in words.
    pub sentence: String,
}

/// Whether two systems succeed alike.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SuccessTest {
    pub test: Test,
    /// Successes and episodes.
    pub first: [u64; 2],
    pub second: [u64; 2],
    /// Episodes that only this system won, of those that both drove; `None` unless paired.
    pub only_first: Option<u64>,
    pub only_second: Option<u64>,
    /// Two-sided.
    pub p: f64,
    pub p_holm: f64,
}

/// A test of two shares, exact and two-sided.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Test {
    /// Of the same episodes.
    Mcnemar,
    /// Of different episodes.
    Fisher,
}

impl Test {
    /// As written in sentences.
    pub fn text(self) -> &'static str {
        match self {
            Test::Mcnemar => "McNemar",
            Test::Fisher => "Fisher",
        }
    }
}

/// One metric of two systems over the same episodes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Difference {
    /// Key of the metric.
    pub metric: String,
    /// Episodes that both drove.
    pub episodes: u64,
    pub first: Option<f64>,
    pub second: Option<f64>,
    /// `first - second`.
    pub difference: Option<f64>,
    /// Of the difference; a bootstrap over these episodes.
    pub interval: Option<[f64; 2]>,
    pub verdict: Verdict,
}

/// What a comparison allows to say.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    FirstIsBetter,
    SecondIsBetter,
    NoDifference,
    /// Too few episodes for any claim.
    TooFew,
}

impl Definition {
    /// All of [`METRICS`].
    pub fn all() -> Vec<Definition> {
        let of = |metric: &crate::eval::table::definitions::Metric| Definition {
            key: metric.key.to_string(),
            title: metric.title.to_string(),
            unit: metric.unit.to_string(),
            better: metric.better.text().to_string(),
            definition: metric.definition.to_string(),
        };
        METRICS.iter().map(of).collect()
    }
}

impl Estimate {
    /// k of n in per cent, with Wilson's interval.
    pub fn share(k: u64, n: u64) -> Estimate {
        Estimate {
            value: (n > 0).then(|| 100.0 * k as f64 / n as f64),
            k: Some(k),
            n,
            interval: wilson(k, n).map(|ends| ends.map(|end| 100.0 * end)),
        }
    }
}

impl System {
    /// As tables name it.
    pub fn shown(&self) -> String {
        match self.source {
            Source::Driven => format!("`{}`", self.name),
            Source::Paper => format!("{} (paper)", self.name),
        }
    }
}

impl Cell {
    /// The number of that metric; of no episodes if there is none.
    pub fn of(&self, key: &str) -> Estimate {
        self.metrics.get(key).copied().unwrap_or_default()
    }
}

impl Table {
    /// Whether any system has a value of that metric somewhere.
    pub fn has(&self, key: &str) -> bool {
        let in_cell = |cell: &Cell| cell.of(key).value.is_some();
        self.systems.iter().any(|system| system.tasks.iter().any(in_cell))
    }
}
