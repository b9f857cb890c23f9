//! The manifest against the files that are there.

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::Path,
};

use parquet::{
    file::reader::{FileReader as _, SerializedFileReader},
    record::{Row, RowAccessor as _},
    schema::types::Type,
};

use crate::{
    atomic,
    dataset::{
        manifest::{EDIT, EpisodeRecord, LogRecord, Manifest},
        shard::ShardRecord,
    },
    error::Error,
    stats::check::{
        finding::{Check, Count, Finding, Level, Needs, Place, percent},
        track::{SHARD_MISSING, SHARD_ROWS, SHARD_SCHEMA, SHARD_UNREADABLE, Track},
    },
};

pub static MANIFEST_MISSING: Check = Check {
    code: "S01",
    name: "manifest-missing",
    level: Level::Error,
    needs: Needs::Records,
    what: "the folder has no manifest.json",
    why: "the manifest is written last: without it the dataset is unfinished, or none at all",
    remedy: "give the same pmp-ingest command again to finish it",
};

pub static MANIFEST_UNREADABLE: Check = Check {
    code: "S02",
    name: "manifest-unreadable",
    level: Level::Error,
    needs: Needs::Records,
    what: "manifest.json is no JSON of this version's fields",
    why: "nothing says which shards belong to the dataset, to which split, and which are whole",
    remedy: "copy the dataset again, or ingest the logs again with this version",
};

pub static SHARD_SIZE: Check = Check {
    code: "S04",
    name: "shard-size",
    level: Level::Error,
    needs: Needs::Records,
    what: "a shard has another number of bytes than when it was written",
    why: "it was cut off or changed since: its frames are not those that the manifest counts",
    remedy: "copy the dataset again, or ingest the logs again",
};

pub static SHARD_CHECKSUM: Check = Check {
    code: "S08",
    name: "shard-checksum",
    level: Level::Error,
    needs: Needs::Bytes,
    what: "a shard of the right size has another SHA-256 than when it was written",
    why: "a flipped bit in a label trains like any other label",
    remedy: "copy the dataset again, or ingest the logs again; then test the disk",
};

pub static FRAME_TOTALS: Check = Check {
    code: "S09",
    name: "frame-totals",
    level: Level::Error,
    needs: Needs::Records,
    what: "the manifest's sums disagree: dataset, logs, episodes and shards name other numbers of frames",
    why: "shares, epochs and learning-rate schedules are computed from these sums",
    remedy: "ingest the logs again; a manifest is not for editing by hand",
};

pub static EPISODES_TABLE: Check = Check {
    code: "S10",
    name: "episodes-table",
    level: Level::Error,
    needs: Needs::Records,
    what: "episodes.parquet is missing or unreadable, or disagrees with the manifest on ids, splits or frames",
    why: "notebooks and samplers that start from the table see another dataset than the training does",
    remedy: "ingest the logs again, which writes the table anew",
};

pub static EPISODE_NAME: Check = Check {
    code: "S11",
    name: "episode-name",
    level: Level::Error,
    needs: Needs::Columns,
    what: "rows of a shard name another episode than the manifest does",
    why: "whoever groups frames by their episode mixes drives, or splits one in two",
    remedy: "ingest the logs again",
};

pub static UNLISTED_FILE: Check = Check {
    code: "S12",
    name: "unlisted-file",
    level: Level::Warning,
    needs: Needs::Records,
    what: "a Parquet file below frames/ is not in the manifest",
    why: "pmp leaves it out, but polars, DuckDB and everyone who reads with a glob takes it in",
    remedy: "remove the file: it was left by a killed run or came from elsewhere",
};

pub static SPLIT_FOLDER: Check = Check {
    code: "S13",
    name: "split-folder",
    level: Level::Error,
    needs: Needs::Records,
    what: "a shard lies in the folder of another split than its record names",
    why: "pmp goes by the record, readers with a glob go by the folder: one of them trains on what judges the other",
    remedy: "ingest the logs again; to change the split use a command that writes a new manifest",
};

pub static LOG_FAILED: Check = Check {
    code: "S14",
    name: "log-failed",
    level: Level::Warning,
    needs: Needs::Records,
    what: "a log gave no frames at all",
    why: "its drive is missing, and with it perhaps all of a condition",
    remedy: "see the reason, mend the log or its mapping (pmp-ingest inspect LOG), and ingest again",
};

/// More of a log's ticks than this left out is more than a few hiccups of a sensor.
const LEFT_OUT_SHARE: f64 = 0.1;

pub static TICKS_LEFT_OUT: Check = Check {
    code: "S15",
    name: "ticks-left-out",
    level: Level::Warning,
    needs: Needs::Records,
    what: "more than 10 % of an episode's ticks did not become frames",
    why: "what is missing is rarely random: sensors drop out in rain, in tunnels, under load",
    remedy: "see which sensor has gaps in the report; widen its tolerance or make it optional, if that is honest",
};

pub static EPISODE_EMPTY: Check = Check {
    code: "S16",
    name: "episode-empty",
    level: Level::Warning,
    needs: Needs::Records,
    what: "an episode has no frames",
    why: "it counts as an episode in shares and splits and teaches nothing",
    remedy: "see in the report why its ticks were left out",
};

pub static ALL: [&Check; 16] = [
    &MANIFEST_MISSING,
    &MANIFEST_UNREADABLE,
    &SHARD_MISSING,
    &SHARD_SIZE,
    &SHARD_UNREADABLE,
    &SHARD_SCHEMA,
    &SHARD_ROWS,
    &SHARD_CHECKSUM,
    &FRAME_TOTALS,
    &EPISODES_TABLE,
    &EPISODE_NAME,
    &UNLISTED_FILE,
    &SPLIT_FOLDER,
    &LOG_FAILED,
    &TICKS_LEFT_OUT,
    &EPISODE_EMPTY,
];

/// Read the manifest; without one, the finding that says so.
pub fn manifest(dataset: &Path) -> Result<Manifest, Finding> {
    if !Manifest::path(dataset).is_file() {
        let has = |name: &str| dataset.join(name).exists();
        let what = match (has(EDIT), has("ingest.json")) {
            (true, _) => "manifest.json is missing: an edit was not finished",
            (false, true) => "manifest.json is missing: an ingest was not finished",
            (false, false) => "manifest.json is missing: the folder is no dataset",
        };
        return Err(MANIFEST_MISSING.found(Place::dataset(), None, what));
    }
    Manifest::read(dataset).map_err(|error| {
        let what = match &error {
            Error::Json { source, .. } => source.to_string(),
            Error::Dataset { what, .. } => what.clone(),
            other => other.to_string(),
        };
        let place = Place::file("manifest.json");
        MANIFEST_UNREADABLE.found(place, None, format!("manifest.json cannot be used: {what}"))
    })
}

/// Everything that needs no column of a frame.
pub fn check(dataset: &Path, manifest: &Manifest, with_checksums: bool) -> Vec<Finding> {
    let mut findings = sizes(dataset, manifest);
    if with_checksums {
        findings.extend(checksums(dataset, manifest));
    }
    findings.extend(totals(manifest));
    findings.extend(episodes_table(dataset, manifest));
    findings.extend(files(dataset, manifest));
    findings.extend(records(manifest));
    findings
}

/// Each file once, although several logs may have shards in it.
fn shards_by_path(manifest: &Manifest) -> BTreeMap<&str, &ShardRecord> {
    let shards = manifest.logs.iter().flat_map(|log| &log.shards);
    shards.map(|shard| (shard.path.as_str(), shard)).collect()
}

fn sizes(dataset: &Path, manifest: &Manifest) -> Vec<Finding> {
    let found = |(path, shard): (&str, &ShardRecord)| {
        let bytes = fs::metadata(dataset.join(path)).ok()?.len();
        let sentence = format!("{path} has {bytes} bytes, its record says {}", shard.bytes);
        let place = Place::file(path);
        (bytes != shard.bytes).then(|| SHARD_SIZE.found(place, bytes as f64, sentence))
    };
    shards_by_path(manifest).into_iter().filter_map(found).collect()
}

fn checksums(dataset: &Path, manifest: &Manifest) -> Vec<Finding> {
    use rayon::prelude::*;
    let shards: Vec<_> = shards_by_path(manifest).into_iter().collect();
    let found = |(path, shard): &(&str, &ShardRecord)| {
        let file = dataset.join(path);
        let bytes = fs::metadata(&file).ok()?.len();
        let is_another =
            bytes == shard.bytes && atomic::sha256_of_file(&file).ok()? != shard.sha256;
        let sentence = format!("{path} is not the file that was written: its SHA-256 is another");
        is_another.then(|| SHARD_CHECKSUM.found(Place::file(path), None, sentence))
    };
    shards.par_iter().filter_map(found).collect()
}

fn totals(manifest: &Manifest) -> Vec<Finding> {
    let mut findings = Vec::new();
    let of_logs: u64 = manifest.logs.iter().map(|log| log.frames).sum();
    if of_logs != manifest.frames {
        let what = format!("the manifest says {} frames, its logs have {of_logs}", manifest.frames);
        findings.push(FRAME_TOTALS.found(Place::dataset(), of_logs as f64, what));
    }
    for log in &manifest.logs {
        let of_episodes: u64 = log.episodes.iter().map(|episode| episode.frames).sum();
        let of_shards: u64 = log.shards.iter().map(|shard| shard.rows).sum();
        if of_episodes != log.frames || of_shards != log.frames {
            let sentence = format!(
                "{}: {} frames, but {of_episodes} in its episodes and {of_shards} in its shards",
                log.source_log, log.frames
            );
            let place = Place::episode(&log.episode);
            findings.push(FRAME_TOTALS.found(place, of_shards as f64, sentence));
        }
    }
    findings
}

/// What the table and the manifest both say of an episode.
type Said = (String, u64);

fn episodes_table(dataset: &Path, manifest: &Manifest) -> Option<Finding> {
    const NAME: &str = "episodes.parquet";
    let found = |sentence: String| Some(EPISODES_TABLE.found(Place::file(NAME), None, sentence));
    let path = dataset.join(NAME);
    if !path.is_file() {
        return found(format!("{NAME} does not exist"));
    }
    let in_table = match read_table(&path) {
        Ok(rows) => rows,
        Err(why) => return found(format!("{NAME}: {why}")),
    };
    let of_log = |log: &LogRecord| {
        let split = log.split.name().to_string();
        let said =
            move |episode: &EpisodeRecord| (episode.id.clone(), (split.clone(), episode.frames));
        log.episodes.iter().map(said).collect::<Vec<_>>()
    };
    let in_manifest: BTreeMap<String, Said> = manifest.logs.iter().flat_map(of_log).collect();
    let only = |a: &BTreeMap<String, Said>, b: &BTreeMap<String, Said>| {
        a.keys().find(|id| !b.contains_key(*id)).cloned()
    };
    if let Some(id) = only(&in_manifest, &in_table) {
        return found(format!("{NAME} lacks {id} of the manifest"));
    }
    if let Some(id) = only(&in_table, &in_manifest) {
        return found(format!("{NAME} has {id}, which the manifest has not"));
    }
    let (id, table) = in_table.iter().find(|(id, said)| in_manifest[*id] != **said)?;
    let of_manifest = &in_manifest[id];
    found(format!(
        "{id}: {} frames in {} by {NAME}, {} in {} by the manifest",
        table.1, table.0, of_manifest.1, of_manifest.0
    ))
}

fn read_table(path: &Path) -> Result<BTreeMap<String, Said>, String> {
    let text = |error: parquet::errors::ParquetError| error.to_string();
    let file = fs::File::open(path).map_err(|error| error.to_string())?;
    let reader = SerializedFileReader::new(file).map_err(text)?;
    let schema = reader.metadata().file_metadata().schema();
    let wanted = ["id", "split", "frames"];
    let fields = schema.get_fields().iter().filter(|field| wanted.contains(&field.name()));
    let fields: Vec<_> = fields.cloned().collect();
    if fields.len() != wanted.len() {
        return Err(format!("lacks one of the columns {}", wanted.join(", ")));
    }
    let projection =
        Type::group_type_builder(schema.name()).with_fields(fields).build().map_err(text)?;
    let said = |row: Row| -> Result<(String, Said), parquet::errors::ParquetError> {
        let id = row.get_string(0)?.clone();
        Ok((id, (row.get_string(1)?.clone(), u64::from(row.get_uint(2)?))))
    };
    let rows = reader.get_row_iter(Some(projection)).map_err(text)?;
    rows.map(|row| row.and_then(said).map_err(text)).collect()
}

/// Files that nobody names, and files in the wrong folder.
fn files(dataset: &Path, manifest: &Manifest) -> Vec<Finding> {
    let listed: BTreeSet<&str> = shards_by_path(manifest).into_keys().collect();
    let mut findings = Vec::new();
    for path in parquet_files(dataset) {
        if !listed.contains(path.as_str()) {
            let sentence = format!("{path} is not in the manifest");
            findings.push(UNLISTED_FILE.found(Place::file(&path), None, sentence));
        }
    }
    let mut seen = BTreeSet::new();
    for log in &manifest.logs {
        let folder = format!("split={}", log.split.name());
        for shard in &log.shards {
            let is_there = shard.path.split('/').any(|part| part == folder);
            if !is_there && seen.insert((&shard.path, log.split)) {
                let name = log.split.name();
                let sentence = format!("{} holds frames of the {name} split", shard.path);
                findings.push(SPLIT_FOLDER.found(Place::file(&shard.path), None, sentence));
            }
        }
    }
    findings
}

/// Paths below `frames/`, relative to the dataset, sorted.
fn parquet_files(dataset: &Path) -> Vec<String> {
    let mut found = Vec::new();
    let mut folders = vec!["frames".to_string()];
    while let Some(folder) = folders.pop() {
        let Ok(entries) = fs::read_dir(dataset.join(&folder)) else { continue };
        for entry in entries.flatten() {
            let path = format!("{folder}/{}", entry.file_name().to_string_lossy());
            match entry.path().is_dir() {
                true => folders.push(path),
                false if path.ends_with(".parquet") => found.push(path),
                false => {}
            }
        }
    }
    found.sort();
    found
}

/// What the records say themselves.
fn records(manifest: &Manifest) -> Vec<Finding> {
    let mut findings = Vec::new();
    for log in &manifest.failed {
        let sentence = format!("{} gave nothing: {}", log.source_log, log.error);
        findings.push(LOG_FAILED.found(Place::dataset(), None, sentence));
    }
    for episode in manifest.logs.iter().flat_map(|log| &log.episodes) {
        let place = || Place::episode(&episode.id);
        if episode.frames == 0 {
            findings.push(EPISODE_EMPTY.found(place(), None, "has no frames"));
            continue;
        }
        let dropped = episode.drops.total();
        let share = dropped as f64 / (dropped + episode.frames) as f64;
        if share > LEFT_OUT_SHARE {
            let most = episode.drops.iter().max_by_key(|(_, drop)| drop.count);
            let most = most.map_or("", |(reason, _)| reason.name());
            let sentence =
                format!("{} of its ticks did not become frames, most by {most}", percent(share));
            findings.push(TICKS_LEFT_OUT.found(place(), share, sentence));
        }
    }
    findings
}

/// Rows that name another episode.
pub fn names(track: &Track) -> Option<Finding> {
    let (count, example) = track.foreign.as_ref()?;
    let place = Place { places: *count, ..Place::episode(&track.episode) };
    let sentence = format!("{} of its shards say `{example}`", Count(*count, "row"));
    Some(EPISODE_NAME.found(place, *count as f64, sentence))
}
