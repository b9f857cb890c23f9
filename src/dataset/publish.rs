//! A dataset made for an object store: in a local folder, and sent when it is whole.
//!
//! `ingest.json` goes first and `manifest.json` last, when all else is there, so what a reader of
//! the store finds is as it is in a folder: with a manifest it is whole. Nothing that lies there is
//! overwritten, and what lies there already is not sent again, so a run that was killed is gone on
//! with by the same command.

use std::{
    fs,
    path::{Path, PathBuf},
};

use crate::{
    atomic::sha256_of_file,
    dataset::{
        claim::{self, MARKER},
        ingest::{self, ingest},
        ingest_event::Event,
        logs::GivenLog,
        manifest::{IngestConfig, Manifest},
        plan::{Plan, Share},
    },
    error::{Error, Result},
    remote::{
        bucket::{Bucket, Object},
        location::ObjectUrl,
        spool,
    },
};

const MANIFEST: &str = "manifest.json";

/// Largest manifest that is read from a store: that of a hundred thousand logs has less.
const MOST_JSON_BYTES: u64 = 1 << 30;

/// Ingest logs into a dataset below a URL; `spool` is the folder where it is made.
///
/// # Errors
///
/// As [`ingest()`], and if the store refuses, has other objects below the URL, or a `share` is asked
/// for: shares meet in a folder.
pub fn ingest_to(
    url: &ObjectUrl,
    logs: &[GivenLog],
    spool: &Path,
    config: &IngestConfig,
    share: Option<Share>,
    on: &(dyn Fn(Event) + Sync),
) -> Result<Manifest> {
    if share.is_some() {
        let what = "processes cannot share a dataset in an object store".to_string();
        let hint = "ingest into a folder that all of them see, and copy it when it is finished";
        return Err(Error::Config { key: "--shard".into(), what, hint: Some(hint.into()) });
    }
    let target = Target { bucket: Bucket::open(url)?, url: url.clone() };
    let found = target.found()?;
    let staging = spool::dataset_folder(spool, url);
    target.may_go_on(&found, config)?;
    if let Some(manifest) = found.iter().find(|file| file.name == MANIFEST) {
        let finished: Manifest = target.read_json(manifest)?;
        on(Event::Begun { logs });
        let plan = Plan::hashing(logs, &|_| true, on)?;
        ingest::check_logs(&finished, &plan, &target.place())?;
        ingest::check_shards(&finished, &target.place(), &|shard| {
            found.iter().any(|file| file.name == shard.path && file.object.bytes == shard.bytes)
        })?;
        remove(&staging)?;
        plan.tell_done(on);
        return Ok(finished);
    }
    let manifest = ingest(logs, &staging, config, None, on)
        .map_err(|error| of_staging(error, &staging, url))?;
    target.send_all(&staging, on)?;
    remove(&staging)?;
    Ok(manifest)
}

/// An error of the folder where the dataset is made, which nobody has named.
fn of_staging(error: Error, staging: &Path, url: &ObjectUrl) -> Error {
    match error {
        Error::Dataset { path, what, hint } if path == staging => {
            let why = format!(
                "this is what an earlier command made for {url} and has not sent: give that \
                 command again to send it, or remove the folder to begin anew"
            );
            Error::Dataset { path, what, hint: hint.map(|_| why) }
        }
        other => other,
    }
}

/// Where a dataset goes.
struct Target {
    bucket: Bucket,
    url: ObjectUrl,
}

/// A file of a dataset in its store.
struct RemoteFile {
    /// Its path in the dataset.
    name: String,
    object: Object,
}

impl Target {
    fn place(&self) -> PathBuf {
        PathBuf::from(self.url.to_string())
    }

    fn key(&self, name: &str) -> String {
        if self.url.key.is_empty() { name.to_string() } else { format!("{}/{name}", self.url.key) }
    }

    fn refuse<T>(&self, what: &str) -> Result<T> {
        let hint = Some("choose another --out, or remove what is there".to_string());
        Err(Error::Dataset { path: self.place(), what: what.to_string(), hint })
    }

    fn found(&self) -> Result<Vec<RemoteFile>> {
        let objects = self.bucket.list(&self.url.key)?;
        let named = objects.into_iter().map(|object| {
            let key = object.url.key.strip_prefix(&self.url.key).unwrap_or(&object.url.key);
            RemoteFile { name: key.trim_start_matches('/').to_string(), object }
        });
        Ok(named.collect())
    }

    fn read_json<T: serde::de::DeserializeOwned>(&self, file: &RemoteFile) -> Result<T> {
        if file.object.bytes > MOST_JSON_BYTES {
            return self.refuse(&format!("a {} of {} bytes", file.name, file.object.bytes));
        }
        let mut text = Vec::new();
        self.bucket.read(&file.object, &mut |piece| {
            text.extend_from_slice(piece);
            Ok(())
        })?;
        serde_json::from_slice(&text).map_err(Error::json(file.object.url.to_string()))
    }

    /// Whether what lies there is nothing, or a dataset of this configuration.
    fn may_go_on(&self, found: &[RemoteFile], config: &IngestConfig) -> Result<()> {
        if found.is_empty() {
            return Ok(());
        }
        match found.iter().find(|file| file.name == MARKER) {
            Some(marker) => claim::check_config(&self.read_json(marker)?, config, &self.place()),
            None => self.refuse("a prefix that is not empty and no dataset"),
        }
    }

    /// Send a whole dataset, as far as it is not there.
    fn send_all(&self, staging: &Path, on: &(dyn Fn(Event) + Sync)) -> Result<()> {
        let mut files = Vec::new();
        collect(staging, staging, &mut files)?;
        files.sort_by_key(|file| (file.name == MANIFEST, file.name != MARKER, file.name.clone()));
        on(Event::Sending { bytes: files.iter().map(|file| file.bytes).sum() });
        let found = self.found()?;
        self.has_no_others(&found, &files)?;
        for file in &files {
            let path = staging.join(&file.name);
            let sha256 = sha256_of_file(&path)?;
            if file.name == MANIFEST {
                self.has_all_others(&files)?;
            }
            match found.iter().find(|there| there.name == file.name) {
                Some(there) => {
                    let is_same = there.object.bytes == file.bytes
                        && self.bucket.sha256(&there.object)? == sha256;
                    if !is_same {
                        return self.refuse(&format!("another dataset's {} lies here", file.name));
                    }
                    on(Event::Sent { bytes: file.bytes });
                }
                None => self.bucket.send(&path, &self.key(&file.name), &sha256, &|bytes| {
                    on(Event::Sent { bytes });
                })?,
            }
        }
        Ok(())
    }

    /// That nothing lies there but what is to be sent: readers take all files below `frames/`.
    fn has_no_others(&self, found: &[RemoteFile], files: &[LocalFile]) -> Result<()> {
        let is_ours = |there: &RemoteFile| files.iter().any(|file| file.name == there.name);
        match found.iter().find(|there| !is_ours(there)) {
            Some(other) => {
                self.refuse(&format!("{}, which is of no log given, lies here", other.name))
            }
            None => Ok(()),
        }
    }

    /// That the store has everything that the manifest, which comes next, says that it has.
    fn has_all_others(&self, files: &[LocalFile]) -> Result<()> {
        let found = self.found()?;
        self.has_no_others(&found, files)?;
        let is_there = |file: &LocalFile| {
            found.iter().any(|f| f.name == file.name && f.object.bytes == file.bytes)
        };
        match files.iter().find(|file| file.name != MANIFEST && !is_there(file)) {
            Some(file) => self.refuse(&format!("{} was sent and is not here as it was", file.name)),
            None => Ok(()),
        }
    }
}

/// A file of a dataset in its folder.
struct LocalFile {
    /// Its path in the dataset, with slashes.
    name: String,
    bytes: u64,
}

fn collect(folder: &Path, root: &Path, files: &mut Vec<LocalFile>) -> Result<()> {
    for entry in fs::read_dir(folder).map_err(Error::io("read", folder))? {
        let path = entry.map_err(Error::io("read", folder))?.path();
        let metadata = fs::metadata(&path).map_err(Error::io("examine", &path))?;
        if metadata.is_dir() {
            collect(&path, root, files)?;
        } else {
            let name = path.strip_prefix(root).unwrap_or(&path).to_string_lossy().into_owned();
            files.push(LocalFile { name, bytes: metadata.len() });
        }
    }
    Ok(())
}

fn remove(staging: &Path) -> Result<()> {
    match staging.exists() {
        true => fs::remove_dir_all(staging).map_err(Error::io("remove", staging)),
        false => Ok(()),
    }
}
