//! Who may write into the folder of a dataset: one process alone, or several that share the logs.
//!
//! `ingest.json` is made once and then locked for as long as a process works, by a lock that the
//! system takes back when the process ends, however it ends.

use std::{
    fs::{self, File, OpenOptions, TryLockError},
    io::{ErrorKind, Write},
    path::{Path, PathBuf},
};

use crate::{
    atomic::{self, UNFINISHED, unfinished_name},
    dataset::manifest::{EDIT, IngestConfig, Manifest},
    error::{Error, Result},
};

/// Name of the configuration, which is written first.
pub const MARKER: &str = "ingest.json";

/// The right to write into a dataset's folder.
#[derive(Debug)]
pub struct Claim {
    pub out: PathBuf,
    /// Others may be at work as well, on other logs.
    pub is_share: bool,
    _marker: File,
}

/// The right to write what comes of one log.
#[must_use]
pub struct Held(Option<(PathBuf, File)>);

impl Claim {
    /// Make the folder ready and claim it, alone or for a share of the logs.
    ///
    /// # Errors
    ///
    /// [`Error::Dataset`] if the folder is something else, was made with another configuration, or
    /// another process is at work there that does not leave room.
    pub fn new(out: &Path, config: &IngestConfig, is_share: bool) -> Result<Claim> {
        let refuse = |what: &str, hint: &str| {
            let (path, what, hint) = (out.to_path_buf(), what.to_string(), Some(hint.to_string()));
            Err(Error::Dataset { path, what, hint })
        };
        if out.join(EDIT).exists() && !Manifest::path(out).exists() {
            return refuse(
                "an unfinished dataset that `pmp-stats` makes of others",
                "give the same `pmp-stats` command again to finish it, or choose another --out",
            );
        }
        let path = out.join(MARKER);
        if !path.exists() {
            if !is_free(out)? {
                return refuse("a folder that is not empty and no dataset", "choose another --out");
            }
            write_marker(out, config)?;
        }
        let found: IngestConfig = atomic::read_json(&path)?;
        check_config(&found, config, out)?;
        // A finished dataset is only looked at, and may lie where nothing can be written.
        let is_finished = Manifest::path(out).exists();
        let open = OpenOptions::new().read(true).write(!is_finished).open(&path);
        let marker = open.map_err(Error::io("open", &path))?;
        let locked = match is_share || is_finished {
            true => marker.try_lock_shared(),
            false => marker.try_lock(),
        };
        match locked {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => {
                return refuse(
                    "another pmp-ingest is at work in this dataset",
                    "wait until it has ended; processes work side by side where each has a --shard",
                );
            }
            Err(TryLockError::Error(error)) => return Err(Error::io("lock", &path)(error)),
        }
        // Of a share's logs another process may be writing the neighbours.
        if !is_share && !is_finished {
            remove_unfinished(out)?;
        }
        Ok(Claim { out: out.to_path_buf(), is_share, _marker: marker })
    }

    /// Claim a log: among shares, the same bytes may be there under two names.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] if the disk refuses.
    pub fn hold(&self, episode: &str) -> Result<Held> {
        if !self.is_share {
            return Ok(Held(None));
        }
        let path = unfinished_name(&self.out.join("logs").join(format!("{episode}.lock")));
        let folder = self.out.join("logs");
        fs::create_dir_all(&folder).map_err(Error::io("create", &folder))?;
        let file = File::create(&path).map_err(Error::io("create", &path))?;
        file.lock().map_err(Error::io("lock", &path))?;
        Ok(Held(Some((path, file))))
    }

    /// Undo what was made ready where nothing came of any log: nothing that looks like a dataset
    /// stays behind, unless others are at work on theirs.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] if the disk refuses.
    pub fn abandon(self) -> Result<()> {
        if self.is_share {
            return Ok(());
        }
        remove_unfinished(&self.out)?;
        let marker = self.out.join(MARKER);
        fs::remove_file(&marker).map_err(Error::io("remove", &marker))?;
        for folder in ["frames/split=train", "frames/split=val", "frames", "logs", ""] {
            // Only empty folders go; what somebody else put there stays.
            let _ = fs::remove_dir(self.out.join(folder));
        }
        Ok(())
    }
}

impl Held {
    /// Let others have it.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] if the disk refuses.
    pub fn release(self) -> Result<()> {
        let Some((path, file)) = self.0 else { return Ok(()) };
        match fs::remove_file(&path) {
            Err(error) if error.kind() != ErrorKind::NotFound => {
                Err(Error::io("remove", &path)(error))
            }
            _ => file.unlock().map_err(Error::io("unlock", &path)),
        }
    }
}

/// That the dataset at `place`, made with the configuration `found`, may be gone on with.
///
/// # Errors
///
/// [`Error::Dataset`] if `config` is another.
pub fn check_config(found: &IngestConfig, config: &IngestConfig, place: &Path) -> Result<()> {
    if found == config {
        return Ok(());
    }
    let what = "a dataset made with another configuration".to_string();
    let hint = Some("choose another --out: a dataset is never changed".to_string());
    Err(Error::Dataset { path: place.to_path_buf(), what, hint })
}

/// Whether a folder is not there or holds nothing but markers that others are about to place.
fn is_free(out: &Path) -> Result<bool> {
    match fs::read_dir(out) {
        Ok(entries) => {
            let mut names = entries.filter_map(|entry| entry.ok()).map(|entry| entry.file_name());
            Ok(names.all(|name| name.to_string_lossy().starts_with(MARKER)))
        }
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(true),
        Err(error) => Err(Error::io("read", out)(error)),
    }
}

/// Place the marker whole and at once, unless another process was faster.
fn write_marker(out: &Path, config: &IngestConfig) -> Result<()> {
    fs::create_dir_all(out).map_err(Error::io("create", out))?;
    let path = out.join(MARKER);
    let own = unfinished_name(&out.join(format!("{MARKER}.{}", std::process::id())));
    let text = serde_json::to_string_pretty(config).map_err(Error::json(&path))? + "\n";
    let mut file = File::create(&own).map_err(Error::io("create", &own))?;
    file.write_all(text.as_bytes()).map_err(Error::io("write", &own))?;
    file.sync_all().map_err(Error::io("write", &own))?;
    // Unlike a rename, a link never takes the place of a file.
    match fs::hard_link(&own, &path) {
        Err(error) if error.kind() != ErrorKind::AlreadyExists => {
            return Err(Error::io("place", &path)(error));
        }
        _ => fs::remove_file(&own).map_err(Error::io("remove", &own))?,
    }
    atomic::sync_folder(out)
}

/// What a killed process was writing.
fn remove_unfinished(folder: &Path) -> Result<()> {
    for entry in fs::read_dir(folder).map_err(Error::io("read", folder))? {
        let path = entry.map_err(Error::io("read", folder))?.path();
        if path.is_dir() {
            remove_unfinished(&path)?;
        } else if path.extension().is_some_and(|extension| extension == UNFINISHED) {
            fs::remove_file(&path).map_err(Error::io("remove", &path))?;
        }
    }
    Ok(())
}
