//! A dataset without some of its episodes.

use std::collections::BTreeSet;

use crate::{
    dataset::{
        edit::{
            place::Plan,
            source::{Chosen, Source, edit_of},
            trim::without,
        },
        manifest::{Change, LogRecord},
    },
    error::{Error, Result},
};

/// What to leave out: episodes by their ids, and all episodes of logs by the names of their files.
///
/// # Errors
///
/// [`Error::Config`] if one is not there, several logs have a name, or nothing would be left.
pub fn drop<'s>(source: &'s Source, episodes: &[String], logs: &[String]) -> Result<Plan<'s>> {
    let mut dropped = BTreeSet::new();
    for id in episodes {
        log_of_episode(source, "--episode", id)?;
        dropped.insert(id.clone());
    }
    for name in logs {
        let log = log_of_name(source, "--log", name)?;
        dropped.extend(log.episodes.iter().map(|episode| episode.id.clone()));
    }
    let mut left = Vec::new();
    for log in &source.manifest.logs {
        left.extend(without(source, log, &dropped)?.map(|log| Chosen { source, log }));
    }
    if left.is_empty() {
        return Err(Error::Config {
            key: "--episode, --log".into(),
            what: "no episode would be left".into(),
            hint: Some("to be rid of a whole dataset, remove its folder".into()),
        });
    }
    Ok(Plan {
        edit: edit_of(Change::Drop { episodes: dropped.into_iter().collect() }, &[source]),
        config: source.manifest.config.clone(),
        logs: left,
        failed: source.manifest.failed.clone(),
    })
}

/// The log that has an episode.
///
/// # Errors
///
/// [`Error::Config`] for the flag `key` if none has it.
pub fn log_of_episode<'s>(source: &'s Source, key: &str, id: &str) -> Result<&'s LogRecord> {
    let mut logs = source.manifest.logs.iter();
    let log = logs.find(|log| log.episodes.iter().any(|episode| episode.id == id));
    log.ok_or_else(|| Error::Config {
        key: key.into(),
        what: format!("{} has no episode `{id}`", source.path.display()),
        hint: Some("column `id` of its episodes.parquet lists them".into()),
    })
}

/// The log whose file had a name.
///
/// # Errors
///
/// [`Error::Config`] for the flag `key` if none or several have it.
pub fn log_of_name<'s>(source: &'s Source, key: &str, name: &str) -> Result<&'s LogRecord> {
    let named: Vec<&LogRecord> =
        source.manifest.logs.iter().filter(|log| log.source_log == name).collect();
    let (what, hint) = match named.as_slice() {
        [log] => return Ok(log),
        [] => ("no log", "column `source_log` of its episodes.parquet lists them".to_string()),
        several => {
            let ids: Vec<&str> = several.iter().map(|log| log.episode.as_str()).collect();
            ("several logs", format!("name the episode instead: {}", ids.join(", ")))
        }
    };
    let what = format!("{} has {what} `{name}`", source.path.display());
    Err(Error::Config { key: key.into(), what, hint: Some(hint) })
}
