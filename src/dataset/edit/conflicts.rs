//! What keeps datasets from being put together: rows that would mean different things.
//!
//! The rate and the picture's size decide the shape of what is trained on, so they have to agree.
//! What else a profile says, and where the camera looks from, changes what the numbers mean: it has
//! to agree unless a person says that it may differ. Conditions are said of every frame, so what a
//! profile assumed of them may differ.

use std::collections::BTreeMap;

use serde_json::Value;

use crate::{
    dataset::{
        edit::source::Source,
        manifest::{IngestConfig, LogRecord},
    },
    error::{Error, Result},
    frame::Conditions,
    projection::Camera,
};

/// Cameras whose focal lengths and principal points are at most this share of the picture's width
/// apart are alike: what two calibrations of one camera differ by.
const ALIKE: f64 = 0.01;

/// The configuration of all of them together.
///
/// # Errors
///
/// [`Error::Dataset`] naming the dataset that does not go with the ones before it, and why:
/// another rate or picture size, an episode that was there already, and unless `mixed`, another
/// profile or camera.
pub fn common_config(sources: &[Source], mixed: bool) -> Result<IngestConfig> {
    let mut by_identity: Vec<&Source> = sources.iter().collect();
    by_identity.sort_by_key(|source| source.manifest.identity());
    let Some(first) = by_identity.first() else {
        let what = "no dataset".to_string();
        return Err(Error::Config { key: "DATASET".into(), what, hint: None });
    };
    episodes_differ(sources)?;
    let mut config = first.manifest.config.clone();
    for (before, source) in sources.iter().zip(&sources[1..]) {
        let (a, b) = (&before.manifest.config, &source.manifest.config);
        let refuse = |what: String, hint: &str| {
            let what = format!("{what} than {}", before.path.display());
            Err(Error::Dataset { path: source.path.clone(), what, hint: Some(hint.to_string()) })
        };
        if a.rate_hz != b.rate_hz {
            let what = format!("another rate ({} Hz, not {} Hz)", b.rate_hz, a.rate_hz);
            return refuse(what, "ingest the logs of one again with the --rate of the other");
        }
        let size = |config: &IngestConfig| {
            format!("{} x {}", config.profile.camera.width, config.profile.camera.height)
        };
        if size(a) != size(b) {
            let what = format!("another picture size ({}, not {} pixels)", size(b), size(a));
            return refuse(what, "ingest the logs of one again with the profile of the other");
        }
        let differing = differing_keys(a, b)?;
        if !mixed && !differing.is_empty() {
            let what = format!("another profile ({})", differing.join(", "));
            return refuse(what, "--mixed puts them together all the same");
        }
        if !mixed && let Some(log) = unlike_camera(before, source) {
            let what = format!("another camera ({})", log.source_log);
            return refuse(what, "--mixed puts them together all the same");
        }
        let (all, own) = (&mut config.profile.conditions, &b.profile.conditions);
        *all = agreed(agreed(all.clone(), &a.profile.conditions), own);
    }
    Ok(config)
}

/// What two profiles assume of the surroundings, where they agree.
fn agreed(a: Conditions, b: &Conditions) -> Conditions {
    let both = |a: Option<String>, b: &Option<String>| a.filter(|a| Some(a) == b.as_ref());
    Conditions {
        town: both(a.town, &b.town),
        weather: both(a.weather, &b.weather),
        illumination: both(a.illumination, &b.illumination),
        traffic: both(a.traffic, &b.traffic),
    }
}

fn episodes_differ(sources: &[Source]) -> Result<()> {
    let mut seen: BTreeMap<&str, &Source> = BTreeMap::new();
    for source in sources {
        let logs = &source.manifest.logs;
        let twice: Vec<(&str, &LogRecord)> = logs
            .iter()
            .flat_map(|log| log.episodes.iter().map(move |episode| (episode.id.as_str(), log)))
            .filter(|(id, _)| seen.contains_key(id))
            .collect();
        if let Some((id, log)) = twice.first() {
            let more = match twice.len() - 1 {
                0 => String::new(),
                more => format!(" and {more} more"),
            };
            let what = format!(
                "episode {id} ({}){more} is in {} as well",
                log.source_log,
                seen[id].path.display()
            );
            let hint = format!(
                "`pmp-stats drop {} --episode {id} --out NEW` makes one without it",
                source.path.display()
            );
            return Err(Error::Dataset { path: source.path.clone(), what, hint: Some(hint) });
        }
        let ids = logs.iter().flat_map(|log| &log.episodes).map(|episode| episode.id.as_str());
        seen.extend(ids.map(|id| (id, source)));
    }
    Ok(())
}

/// Settings in which two configurations differ, conditions aside.
fn differing_keys(a: &IngestConfig, b: &IngestConfig) -> Result<Vec<String>> {
    let value =
        |config: &IngestConfig| serde_json::to_value(config).map_err(Error::json("ingest.json"));
    let mut keys = Vec::new();
    differing(&value(a)?, &value(b)?, "", &mut keys);
    keys.retain(|key| !key.starts_with("profile.conditions"));
    Ok(keys)
}

/// Paths below which two values differ.
pub fn differing(a: &Value, b: &Value, path: &str, found: &mut Vec<String>) {
    match (a, b) {
        (Value::Object(a), Value::Object(b)) => {
            let mut keys: Vec<&String> = a.keys().chain(b.keys()).collect();
            keys.sort();
            keys.dedup();
            for key in keys {
                let dot = if path.is_empty() { "" } else { "." };
                let (a, b) = (a.get(key), b.get(key));
                let path = format!("{path}{dot}{key}");
                let null = Value::Null;
                differing(a.unwrap_or(&null), b.unwrap_or(&null), &path, found);
            }
        }
        _ if a == b => {}
        _ => found.push(path.to_string()),
    }
}

/// A log of `b` whose camera is like none of `a`.
fn unlike_camera<'s>(a: &Source, b: &'s Source) -> Option<&'s LogRecord> {
    let known: Vec<&Option<Camera>> =
        a.manifest.logs.iter().map(|log| &log.calibration.camera).collect();
    b.manifest.logs.iter().find(|log| {
        let camera = &log.calibration.camera;
        !known.iter().any(|known| match (known, camera) {
            (Some(known), Some(camera)) => are_alike(known, camera),
            (known, camera) => known.is_none() && camera.is_none(),
        })
    })
}

fn are_alike(a: &Camera, b: &Camera) -> bool {
    let most = ALIKE * a.width as f64;
    let near = |a: f64, b: f64| (a - b).abs() <= most;
    (a.width, a.height) == (b.width, b.height)
        && near(a.fx, b.fx)
        && near(a.fy, b.fy)
        && near(a.cx, b.cx)
        && near(a.cy, b.cy)
}
