//! A dataset whose episodes are dealt out anew: which train, which judge.
//!
//! All episodes of a log are one drive and stay on one side.

use std::collections::BTreeSet;

use sha2::{Digest, Sha256};

use crate::{
    dataset::{
        edit::{
            drop::{log_of_episode, log_of_name},
            place::Plan,
            source::{Source, edit_of},
        },
        manifest::{Change, LogRecord},
        split::Split,
    },
    error::{Error, Result},
};

/// Which logs judge.
#[derive(Clone, Debug, PartialEq)]
pub enum Rule {
    /// So many of all logs, above 0 and below 1, as evenly from all conditions as their numbers allow.
    Share(f64),
    /// Those that have these episodes.
    Episodes(Vec<String>),
    /// Those whose files have these names.
    Logs(Vec<String>),
    /// Those of these towns.
    Towns(Vec<String>),
    /// Those that an ingest chooses: by the hash of their id, one in eight.
    Hash,
}

impl Rule {
    /// As it is said on the command line.
    fn text(&self) -> String {
        let listed = |flag: &str, names: &[String]| {
            let names: BTreeSet<&str> = names.iter().map(String::as_str).collect();
            let flags = names.iter().map(|name| format!("{flag} {name}"));
            flags.collect::<Vec<_>>().join(" ")
        };
        match self {
            Rule::Share(share) => format!("--val-share {share}"),
            Rule::Episodes(ids) => listed("--val", ids),
            Rule::Logs(names) => listed("--val-log", names),
            Rule::Towns(towns) => listed("--val-town", towns),
            Rule::Hash => "--by-hash".to_string(),
        }
    }

    /// Ids of the logs that judge.
    fn judges(&self, source: &Source) -> Result<BTreeSet<String>> {
        let logs = &source.manifest.logs;
        let id = |log: &LogRecord| log.episode.clone();
        match self {
            Rule::Share(share) if *share > 0.0 && *share < 1.0 => Ok(spread(logs, *share)),
            Rule::Share(share) => Err(Error::Config {
                key: "--val-share".into(),
                what: format!("{share} is not between 0 and 1"),
                hint: Some("0.125 is one episode in eight".into()),
            }),
            Rule::Episodes(ids) => {
                ids.iter().map(|name| log_of_episode(source, "--val", name).map(id)).collect()
            }
            Rule::Logs(names) => {
                names.iter().map(|name| log_of_name(source, "--val-log", name).map(id)).collect()
            }
            Rule::Towns(towns) => {
                let is_in =
                    |log: &LogRecord, town: &String| log.conditions.town.as_ref() == Some(town);
                if let Some(town) = towns.iter().find(|t| !logs.iter().any(|log| is_in(log, t))) {
                    return Err(Error::Config {
                        key: "--val-town".into(),
                        what: format!("{} has no episode of `{town}`", source.path.display()),
                        hint: Some("`pmp-stats DATASET` lists its towns".into()),
                    });
                }
                let judges = |log: &&LogRecord| towns.iter().any(|town| is_in(log, town));
                Ok(logs.iter().filter(judges).map(id).collect())
            }
            Rule::Hash => Ok(logs
                .iter()
                .filter(|log| Split::of(&log.episode) == Split::Val)
                .map(id)
                .collect()),
        }
    }
}

/// A share of the logs: sorted by conditions, and by a hash of the id within them, every so many-th
/// judges. The same logs give the same choice.
fn spread(logs: &[LogRecord], share: f64) -> BTreeSet<String> {
    let mut sorted: Vec<&LogRecord> = logs.iter().collect();
    sorted.sort_by_cached_key(|log| {
        let of = &log.conditions;
        let conditions = [&of.town, &of.weather, &of.illumination, &of.traffic].map(Clone::clone);
        (conditions, Sha256::digest(log.episode.as_bytes()).to_vec())
    });
    let count_before = |place: usize| (place as f64 * share + 0.5).floor();
    let judges = sorted
        .iter()
        .enumerate()
        .filter(|(place, _)| count_before(*place) < count_before(place + 1));
    judges.map(|(_, log)| log.episode.clone()).collect()
}

/// All logs, dealt out by a rule.
///
/// # Errors
///
/// [`Error::Config`] if the rule names what is not there, or leaves a side empty.
pub fn resplit<'s>(source: &'s Source, rule: &Rule) -> Result<Plan<'s>> {
    let judges = rule.judges(source)?;
    let count = source.manifest.logs.len();
    if judges.is_empty() || judges.len() == count {
        let side = if judges.is_empty() { "judges" } else { "trains" };
        return Err(Error::Config {
            key: rule.text(),
            what: format!("of {count} logs, none {side}"),
            hint: Some("each side needs one; all episodes of a log are on the same".into()),
        });
    }
    let side_of = |log: &LogRecord| match judges.contains(&log.episode) {
        true => Split::Val,
        false => Split::Train,
    };
    let logs = &source.manifest.logs;
    let moved = logs.iter().filter(|log| side_of(log) != log.split);
    let moved = moved.map(|log| log.episode.clone()).collect();
    Ok(Plan {
        edit: edit_of(Change::Resplit { rule: rule.text(), moved }, &[source]),
        config: source.manifest.config.clone(),
        logs: source.choose(side_of),
        failed: source.manifest.failed.clone(),
    })
}
