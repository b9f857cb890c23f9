//! The logs to ingest, wherever they lie.

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
    sync::Arc,
};

use crate::{
    atomic::{file_name, sha256_of_file},
    error::{Error, Result},
    remote::{
        bucket::{Bucket, Object},
        location::{Location, ObjectUrl},
        spool::{Copied, Spool},
    },
};

/// A log that was given or found.
#[derive(Clone)]
pub struct GivenLog {
    /// Its path or its URL.
    pub path: PathBuf,
    /// 0 where the file is gone since it was found, which reading it will tell.
    pub bytes: u64,
    remote: Option<RemoteLog>,
}

#[derive(Clone)]
struct RemoteLog {
    bucket: Arc<Bucket>,
    object: Object,
    spool: Arc<Spool>,
}

/// A log as a file that can be read: itself, or a copy, which is removed with this value.
pub enum LocalLog {
    Itself(PathBuf),
    Copy { original: PathBuf, copied: Copied },
}

/// Logs among the arguments: a folder stands for all `.mcap` files in it and below it, and so does
/// the URL of what is no object. Objects are copied into a part of the folder `spool`.
///
/// # Errors
///
/// [`Error::Io`] if a path does not exist, [`Error::Remote`] if a store refuses,
/// [`Error::Config`] if there is no log at all.
pub fn find_logs(places: &[Location], spool: &Path) -> Result<Vec<GivenLog>> {
    let mut logs = Vec::new();
    let mut stores = Stores { spool, buckets: BTreeMap::new(), own_spool: None };
    for place in places {
        match place {
            Location::Local(path) => {
                let metadata = fs::metadata(path).map_err(Error::io("find", path))?;
                match metadata.is_dir() {
                    true => collect(path, &mut logs)?,
                    false => logs.push(GivenLog::local(path.clone())),
                }
            }
            Location::Remote(url) => logs.extend(stores.find(url)?),
        }
    }
    logs.sort_by(|a, b| a.path.cmp(&b.path));
    logs.dedup_by(|a, b| a.path == b.path);
    if logs.is_empty() {
        return Err(Error::Config {
            key: "LOG".into(),
            what: "no .mcap file in the folders given".into(),
            hint: Some("give MCAP files, or folders that hold some".into()),
        });
    }
    Ok(logs)
}

fn collect(folder: &Path, logs: &mut Vec<GivenLog>) -> Result<()> {
    for entry in fs::read_dir(folder).map_err(Error::io("read", folder))? {
        let path = entry.map_err(Error::io("read", folder))?.path();
        if path.is_dir() {
            collect(&path, logs)?;
        } else if is_log(&path) {
            logs.push(GivenLog::local(path));
        }
    }
    Ok(())
}

fn is_log(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension == "mcap")
}

/// The buckets that were opened, each once, and the spool that their logs share.
struct Stores<'s> {
    spool: &'s Path,
    buckets: BTreeMap<String, Arc<Bucket>>,
    own_spool: Option<Arc<Spool>>,
}

impl Stores<'_> {
    fn find(&mut self, url: &ObjectUrl) -> Result<Vec<GivenLog>> {
        let bucket = match self.buckets.get(&url.root) {
            Some(bucket) => bucket.clone(),
            None => {
                let bucket = Arc::new(Bucket::open(url)?);
                self.buckets.insert(url.root.clone(), bucket.clone());
                bucket
            }
        };
        let object = if url.key.is_empty() { None } else { bucket.find(&url.key)? };
        let objects = match object {
            Some(object) => vec![object],
            None => {
                let mut below = bucket.list(&url.key)?;
                below.retain(|object| is_log(Path::new(&object.url.key)));
                below
            }
        };
        if objects.is_empty() {
            let why = "there is no such object, and no .mcap object below it".to_string();
            let hint = "give the URL of an MCAP file, or of a prefix that ends where a / follows";
            let (url, hint) = (url.to_string(), hint.to_string());
            return Err(Error::Remote { action: "find", url, why, hint });
        }
        let spool = match &self.own_spool {
            Some(spool) => spool.clone(),
            None => self.own_spool.insert(Arc::new(Spool::new(self.spool)?)).clone(),
        };
        let given = |object: Object| GivenLog {
            path: PathBuf::from(object.url.to_string()),
            bytes: object.bytes,
            remote: Some(RemoteLog { bucket: bucket.clone(), object, spool: spool.clone() }),
        };
        Ok(objects.into_iter().map(given).collect())
    }
}

impl GivenLog {
    /// A file.
    pub fn local(path: PathBuf) -> GivenLog {
        let bytes = fs::metadata(&path).map_or(0, |metadata| metadata.len());
        GivenLog { path, bytes, remote: None }
    }

    /// Name of the file or object, without what leads to it.
    pub fn name(&self) -> String {
        file_name(&self.path)
    }

    /// Whether it is still where it was found, as far as can be told without asking a store.
    pub fn is_there(&self) -> bool {
        self.remote.is_some() || fs::metadata(&self.path).is_ok()
    }

    /// Bytes that have to be copied before it can be read.
    pub fn bytes_to_copy(&self) -> u64 {
        if self.remote.is_some() { self.bytes } else { 0 }
    }

    /// The log as a local file; `on_bytes` hears of what was copied.
    ///
    /// # Errors
    ///
    /// [`Error::Remote`] if the store refuses, [`Error::Io`] if the disk does.
    pub fn fetch(&self, on_bytes: &dyn Fn(u64)) -> Result<LocalLog> {
        let Some(RemoteLog { bucket, object, spool }) = &self.remote else {
            return Ok(LocalLog::Itself(self.path.clone()));
        };
        let copied = spool.copy(bucket, object, on_bytes)?;
        Ok(LocalLog::Copy { original: self.path.clone(), copied })
    }

    /// SHA-256 of its bytes; an object is read for it, unless it is known from an earlier run.
    ///
    /// # Errors
    ///
    /// As [`GivenLog::fetch`].
    pub fn sha256(&self) -> Result<String> {
        let Some(RemoteLog { bucket, object, spool }) = &self.remote else {
            return sha256_of_file(&self.path);
        };
        if let Some(sha256) = spool.known_sha256(object) {
            return Ok(sha256);
        }
        let sha256 = bucket.sha256(object)?;
        self.remember(&sha256)?;
        Ok(sha256)
    }

    /// Keep in mind what an object's SHA-256 is, so that it need not be read for it again.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] if the disk refuses.
    pub fn remember(&self, sha256: &str) -> Result<()> {
        let Some(RemoteLog { object, spool, .. }) = &self.remote else { return Ok(()) };
        spool.remember(object, sha256)
    }
}

impl LocalLog {
    /// Where it can be read.
    pub fn path(&self) -> &Path {
        match self {
            LocalLog::Itself(path) => path,
            LocalLog::Copy { copied, .. } => &copied.path,
        }
    }

    /// An error of it, which names what the person gave.
    pub fn own(&self, error: Error) -> Error {
        match self {
            LocalLog::Itself(_) => error,
            LocalLog::Copy { original, copied } => error.of_original(&copied.path, original),
        }
    }
}
