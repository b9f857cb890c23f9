//! The verdict: everything that the checks found, sorted and limited.

use std::{collections::BTreeMap, path::Path};

use rayon::prelude::*;
use serde::Serialize;

use crate::{
    dataset::{manifest::Manifest, shard::ShardRecord},
    error::{Error, Result},
    stats::check::{
        actions, balance, catalogue, conditions,
        digest::Digest,
        ego,
        finding::{Check, Finding, Level},
        glimpse::{self, Sample},
        images, labels,
        motion::Motion,
        ralidar, route, split, structure, time,
        track::Track,
    },
};

/// Version of the JSON object; its fields are in `schemas/check.v1.json`.
pub const VERSION: u32 = 1;

/// Findings of one check that are listed; of the rest there is the number.
pub const LISTED: usize = 10;

/// What to look at.
#[derive(Clone, Debug)]
pub struct Asked {
    /// Whose findings are left out.
    pub ignored: Vec<&'static Check>,
    /// Frames whose pictures and sensor returns are looked at.
    pub sample: Sample,
    /// Whether checksums are computed.
    pub checksums: bool,
}

impl Default for Asked {
    fn default() -> Self {
        let sample = Sample::Spread(glimpse::DEFAULT_SAMPLE);
        Asked { ignored: Vec::new(), sample, checksums: false }
    }
}

/// How many findings of a level there are, and of a check beyond those that are listed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Counts {
    pub error: u64,
    pub warning: u64,
    pub note: u64,
}

impl Counts {
    pub fn of(&self, level: Level) -> u64 {
        match level {
            Level::Error => self.error,
            Level::Warning => self.warning,
            Level::Note => self.note,
        }
    }
}

/// What was found in a dataset.
#[derive(Clone, Debug)]
pub struct Verdict {
    /// Name of the folder.
    pub name: String,
    /// `None` without a manifest.
    pub identity: Option<String>,
    pub episodes: u64,
    /// Frames whose columns were read.
    pub frames: u64,
    /// Frames whose pictures and sensor returns were looked at.
    pub looked_at: u64,
    pub checksums: bool,
    pub ignored: Vec<&'static Check>,
    /// Of all findings.
    pub counts: Counts,
    /// The worst first, then by code, episode and frame; at most [`LISTED`] of a check.
    pub findings: Vec<Finding>,
    /// How many more there are of a check, by code.
    pub more: BTreeMap<&'static str, u64>,
}

/// Check a dataset.
///
/// A dataset that lacks its manifest, or files of it, is a finding.
///
/// # Errors
///
/// [`Error::Dataset`] if there is no such folder.
pub fn check(dataset: &Path, asked: &Asked) -> Result<Verdict> {
    if !dataset.is_dir() {
        return Err(Error::Dataset {
            path: dataset.to_path_buf(),
            what: "there is no such folder".to_string(),
            hint: Some("give the folder that pmp-ingest --out made".to_string()),
        });
    }
    let name = dataset.canonicalize().map_err(Error::io("find", dataset))?;
    let name = name.file_name().map_or("dataset".into(), |name| name.to_string_lossy());
    let mut verdict = Verdict {
        name: name.into_owned(),
        identity: None,
        episodes: 0,
        frames: 0,
        looked_at: 0,
        checksums: asked.checksums,
        ignored: asked.ignored.clone(),
        counts: Counts::default(),
        findings: Vec::new(),
        more: BTreeMap::new(),
    };
    match structure::manifest(dataset) {
        Ok(manifest) => verdict.look(dataset, &manifest, asked),
        Err(finding) => verdict.findings.push(finding),
    }
    verdict.settle();
    Ok(verdict)
}

impl Verdict {
    fn look(&mut self, dataset: &Path, manifest: &Manifest, asked: &Asked) {
        self.identity = Some(manifest.identity());
        let episodes = episodes(manifest);
        self.episodes = episodes.len() as u64;
        let (columns, others) = rayon::join(
            || columns(dataset, manifest, &episodes),
            || {
                let mut findings = structure::check(dataset, manifest, asked.checksums);
                findings.extend(split::records(manifest));
                findings
            },
        );
        self.findings.extend(others);
        let (digests, findings) = columns;
        self.findings.extend(findings);
        self.frames = digests.iter().map(|digest| digest.frames).sum();
        self.findings.extend(over_all(manifest, &digests));

        let ids: Vec<&str> = episodes.iter().map(|episode| episode.id).collect();
        let looks = glimpse::look(dataset, manifest, asked.sample, |sight| {
            (images::look(sight), ralidar::look(sight))
        });
        let (pictures, returns): (Vec<_>, Vec<_>) = looks.into_iter().unzip();
        self.looked_at = pictures.len() as u64;
        self.findings.extend(images::judge(&pictures, &ids));
        self.findings.extend(ralidar::judge(&returns, &ids));
    }

    /// Leave out what is ignored, sort, count, and limit.
    fn settle(&mut self) {
        let ignored = self.ignored.iter().map(|check| check.code);
        let ignored: Vec<&str> = ignored.collect();
        self.findings.retain(|finding| !ignored.contains(&finding.check.code));
        self.findings.sort_by(|a, b| {
            let key = |finding: &Finding| {
                (std::cmp::Reverse(finding.check.level), finding.check.code, finding.place.clone())
            };
            key(a).cmp(&key(b)).then_with(|| a.sentence.cmp(&b.sentence))
        });
        let mut seen: BTreeMap<&'static str, u64> = BTreeMap::new();
        for finding in &self.findings {
            *seen.entry(finding.check.code).or_default() += 1;
            match finding.check.level {
                Level::Error => self.counts.error += 1,
                Level::Warning => self.counts.warning += 1,
                Level::Note => self.counts.note += 1,
            }
        }
        let mut kept: BTreeMap<&'static str, usize> = BTreeMap::new();
        self.findings.retain(|finding| {
            let kept = kept.entry(finding.check.code).or_default();
            *kept += 1;
            *kept <= LISTED
        });
        let more =
            seen.into_iter().map(|(code, count)| (code, count.saturating_sub(LISTED as u64)));
        self.more = more.filter(|(_, count)| *count > 0).collect();
    }

    /// Whether there is anything of a level or worse.
    pub fn has(&self, level: Level) -> bool {
        Level::ALL.iter().any(|other| *other >= level && self.counts.of(*other) > 0)
    }

    /// For programs: one object, fields as in `schemas/check.v1.json`.
    pub fn json(&self) -> String {
        let object = Object {
            version: VERSION,
            dataset: Dataset { name: &self.name, identity: self.identity.as_deref() },
            episodes: self.episodes,
            frames: self.frames,
            looked_at: self.looked_at,
            checksums: self.checksums,
            ignored: self.ignored.iter().map(|check| check.code).collect(),
            counts: self.counts,
            findings: self.findings.iter().map(Listed::of).collect(),
            more: &self.more,
        };
        pretty(&object)
    }
}

fn pretty(object: &impl Serialize) -> String {
    let mut text = serde_json::to_string_pretty(object).unwrap_or_default();
    text.push('\n');
    text
}

#[derive(Serialize)]
struct Object<'v> {
    version: u32,
    dataset: Dataset<'v>,
    episodes: u64,
    frames: u64,
    looked_at: u64,
    checksums: bool,
    ignored: Vec<&'static str>,
    counts: Counts,
    findings: Vec<Listed<'v>>,
    more: &'v BTreeMap<&'static str, u64>,
}

#[derive(Serialize)]
struct Dataset<'v> {
    name: &'v str,
    identity: Option<&'v str>,
}

#[derive(Serialize)]
struct Listed<'v> {
    code: &'static str,
    name: &'static str,
    level: Level,
    episode: Option<&'v str>,
    frame: Option<u32>,
    places: u64,
    file: Option<&'v str>,
    value: Option<f64>,
    sentence: &'v str,
    remedy: &'static str,
}

impl Listed<'_> {
    fn of(finding: &Finding) -> Listed<'_> {
        let Finding { check, place, value, sentence } = finding;
        Listed {
            code: check.code,
            name: check.name,
            level: check.level,
            episode: place.episode.as_deref(),
            frame: place.frame,
            places: place.places,
            file: place.file.as_deref(),
            value: *value,
            sentence,
            remedy: check.remedy,
        }
    }
}

/// All checks for programs: one object.
pub fn catalogue_json() -> String {
    #[derive(Serialize)]
    struct Row {
        code: &'static str,
        name: &'static str,
        level: Level,
        needs: &'static str,
        what: &'static str,
        why: &'static str,
        remedy: &'static str,
    }
    #[derive(Serialize)]
    struct Catalogue {
        version: u32,
        checks: Vec<Row>,
    }
    let row = |check: &'static Check| {
        let Check { code, name, level, needs, what, why, remedy } = *check;
        Row { code, name, level, needs: needs.name(), what, why, remedy }
    };
    pretty(&Catalogue { version: VERSION, checks: catalogue::all().map(row).collect() })
}

/// An episode of the manifest.
struct Episode<'m> {
    id: &'m str,
    log: usize,
    shards: &'m [ShardRecord],
}

fn episodes(manifest: &Manifest) -> Vec<Episode<'_>> {
    let mut all = Vec::new();
    for (log, record) in manifest.logs.iter().enumerate() {
        let both = record.episodes.iter().zip(record.shards_by_episode());
        all.extend(both.map(|(episode, shards)| Episode { id: &episode.id, log, shards }));
    }
    all
}

/// Every episode by itself, several at a time; what is kept of them is small.
fn columns(
    dataset: &Path,
    manifest: &Manifest,
    episodes: &[Episode],
) -> (Vec<Digest>, Vec<Finding>) {
    let rate_hz = manifest.config.rate_hz;
    let of_episode = |episode: &Episode| {
        let record = &manifest.logs[episode.log];
        let (track, mut findings) = Track::read(dataset, episode.id, record.split, episode.shards);
        let motion = Motion::of(&track, rate_hz);
        findings.extend(structure::names(&track));
        if !track.is_empty() {
            findings.extend(time::check(&track, rate_hz));
            findings.extend(ego::check(&track, &motion));
            findings.extend(labels::check(&track, &motion));
            findings.extend(actions::check(&track, &motion));
            findings.extend(route::check(&track, &motion));
        }
        (Digest::of(&track, &motion, episode.log, record), findings)
    };
    let both: Vec<(Digest, Vec<Finding>)> = episodes.par_iter().map(of_episode).collect();
    let (digests, findings): (Vec<_>, Vec<_>) = both.into_iter().unzip();
    (digests, findings.into_iter().flatten().collect())
}

/// What only all episodes together tell.
fn over_all(manifest: &Manifest, digests: &[Digest]) -> Vec<Finding> {
    if digests.iter().all(|digest| digest.frames == 0) {
        return Vec::new();
    }
    let mut findings = time::overlaps(manifest, digests);
    findings.extend(labels::over_all(digests));
    findings.extend(actions::missing(manifest, digests));
    findings.extend(route::over_all(digests));
    findings.extend(ralidar::over_all(digests));
    findings.extend(split::check(digests));
    findings.extend(balance::check(digests));
    findings.extend(conditions::check(manifest, digests));
    findings
}
