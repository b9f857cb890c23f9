//! Where copies lie while they are used, and what is known of objects between runs.
//!
//! ```text
//! SPOOL/copies-N/     logs that a process is working on; it holds the lock of copies-N.lock
//! SPOOL/dataset-ID/   a dataset on its way to the URL whose hash is ID, until all of it is there
//! SPOOL/known/        the SHA-256 of logs that were read, by URL, size and entity tag
//! ```
//!
//! What a killed process left under `copies-N/` is removed by the next one that takes the number.

use std::{
    fs::{self, File, TryLockError},
    io::Write,
    path::{Path, PathBuf},
    sync::Arc,
};

use crate::{
    atomic::{self, sha256},
    error::{Error, Result},
    remote::{
        bucket::{Bucket, Object},
        location::ObjectUrl,
    },
};

/// Processes that may share a folder.
const MOST_PROCESSES: usize = 4096;

/// The spool folder, where none is given.
pub fn default_folder() -> PathBuf {
    std::env::temp_dir().join("pmp-spool")
}

/// Where the dataset for a URL is made.
pub fn dataset_folder(spool: &Path, url: &ObjectUrl) -> PathBuf {
    spool.join(format!("dataset-{}", &sha256(url.to_string().as_bytes())[..16]))
}

/// A process's part of the spool folder.
#[derive(Debug)]
pub struct Spool {
    folder: PathBuf,
    copies: PathBuf,
    _lock: File,
}

/// A copy of a log; it is removed with this value.
#[derive(Debug)]
pub struct Copied {
    pub path: PathBuf,
    folder: PathBuf,
    _spool: Arc<Spool>,
}

impl Spool {
    /// Take the first number that no process has.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] if the folder cannot be made or written.
    pub fn new(folder: &Path) -> Result<Spool> {
        fs::create_dir_all(folder).map_err(Error::io("create", folder))?;
        for number in 0..MOST_PROCESSES {
            let copies = folder.join(format!("copies-{number}"));
            let path = copies.with_extension("lock");
            let lock = File::create(&path).map_err(Error::io("create", &path))?;
            match lock.try_lock() {
                Err(TryLockError::WouldBlock) => continue,
                Err(TryLockError::Error(error)) => return Err(Error::io("lock", &path)(error)),
                Ok(()) => {}
            }
            if copies.exists() {
                fs::remove_dir_all(&copies).map_err(Error::io("remove", &copies))?;
            }
            return Ok(Spool { folder: folder.to_path_buf(), copies, _lock: lock });
        }
        let what = format!("{MOST_PROCESSES} processes are at work in {}", folder.display());
        Err(Error::Config { key: "--spool".into(), what, hint: None })
    }

    /// Copy an object to a file of the same name.
    ///
    /// # Errors
    ///
    /// [`Error::Remote`] if the store refuses, [`Error::Io`] if the disk does.
    pub fn copy(
        self: &Arc<Spool>,
        bucket: &Bucket,
        object: &Object,
        on_bytes: &dyn Fn(u64),
    ) -> Result<Copied> {
        let url = object.url.to_string();
        let folder = self.copies.join(&sha256(url.as_bytes())[..16]);
        fs::create_dir_all(&folder).map_err(Error::io("create", &folder))?;
        let path = folder.join(atomic::file_name(Path::new(&url)));
        // Made first, so that the file goes whatever becomes of it.
        let copied = Copied { path: path.clone(), folder, _spool: self.clone() };
        let mut file = File::create(&path).map_err(Error::io("create", &path))?;
        bucket.read(object, &mut |piece| {
            on_bytes(piece.len() as u64);
            file.write_all(piece).map_err(Error::io("write", &path))
        })?;
        Ok(copied)
    }

    /// The SHA-256 of an object, if it was read before and has not changed since.
    pub fn known_sha256(&self, object: &Object) -> Option<String> {
        let text = fs::read_to_string(self.known_path(object)?).ok()?;
        let is_sha256 = text.len() == 64 && text.bytes().all(|byte| byte.is_ascii_hexdigit());
        is_sha256.then_some(text)
    }

    /// Remember the SHA-256 of an object.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] if the disk refuses.
    pub fn remember(&self, object: &Object, sha256: &str) -> Result<()> {
        let Some(path) = self.known_path(object) else { return Ok(()) };
        atomic::write(&path, sha256.as_bytes())?;
        Ok(())
    }

    fn known_path(&self, object: &Object) -> Option<PathBuf> {
        let e_tag = object.e_tag.as_ref()?;
        let identity = format!("{}\n{}\n{e_tag}", object.url, object.bytes);
        Some(self.folder.join("known").join(sha256(identity.as_bytes())))
    }
}

impl Drop for Spool {
    fn drop(&mut self) {
        // Empty by now; what cannot be removed, the next process will.
        let _ = fs::remove_dir(&self.copies);
    }
}

impl Drop for Copied {
    fn drop(&mut self) {
        // The next process to take the number removes what is left.
        let _ = fs::remove_dir_all(&self.folder);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn processes_have_parts_of_their_own_and_clear_what_a_killed_one_left() {
        let folder = tempfile::tempdir().unwrap();
        let left = folder.path().join("copies-0/abc");
        fs::create_dir_all(&left).unwrap();
        fs::write(left.join("drive.mcap"), b"half").unwrap();
        let first = Spool::new(folder.path()).unwrap();
        assert!(!left.exists());
        let second = Spool::new(folder.path()).unwrap();
        assert_ne!(first.copies, second.copies);
        drop(first);
        assert_eq!(Spool::new(folder.path()).unwrap().copies, folder.path().join("copies-0"));
    }

    #[test]
    fn a_checksum_is_known_as_long_as_size_and_tag_are_the_same() {
        let folder = tempfile::tempdir().unwrap();
        let spool = Spool::new(folder.path()).unwrap();
        let url = ObjectUrl::parse("s3://bucket/drive.mcap").unwrap();
        let object = Object { url, bytes: 5, e_tag: Some("a".to_string()) };
        let sha = sha256(b"bytes");
        assert_eq!(spool.known_sha256(&object), None);
        spool.remember(&object, &sha).unwrap();
        assert_eq!(spool.known_sha256(&object), Some(sha.clone()));
        assert_eq!(spool.known_sha256(&Object { bytes: 6, ..object.clone() }), None);
        assert_eq!(spool.known_sha256(&Object { e_tag: Some("b".into()), ..object.clone() }), None);
        let untagged = Object { e_tag: None, ..object };
        spool.remember(&untagged, &sha).unwrap();
        assert_eq!(spool.known_sha256(&untagged), None);
    }
}
