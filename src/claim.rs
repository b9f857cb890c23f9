//! A folder that belongs to one job: a file says which, and is locked as long as a process works there.
//!
//! The lock is taken back by the system when the process ends, however it ends.

use std::{
    fs::{self, File},
    path::Path,
};

use serde::{Serialize, de::DeserializeOwned};

use crate::{
    atomic,
    error::{Error, Result},
};

/// Make a folder `wanted`'s by writing that into `path`, or see that it is, and lock it.
///
/// `differing` names the settings in which two are not the same; `job` is what is done there, as
/// "collection".
///
/// # Errors
///
/// [`Error::Exists`] if the folder is another's; [`Error::Config`] if another process is at work there.
pub fn claim<T: Serialize + DeserializeOwned + PartialEq>(
    path: &Path,
    wanted: &T,
    job: &str,
    differing: impl Fn(&T, &T) -> Vec<String>,
) -> Result<File> {
    let folder = path.parent().unwrap_or(path);
    fs::create_dir_all(folder).map_err(Error::io("create", folder))?;
    match atomic::read_json_if_exists::<T>(path)? {
        None => {
            atomic::write_json(path, wanted)?;
        }
        Some(found) if found == *wanted => {}
        Some(found) => {
            let differing = differing(&found, wanted).join(", ");
            return Err(Error::Exists {
                path: path.to_path_buf(),
                hint: format!(
                    "the folder has a {job} with other settings ({differing}); choose another --out, \
                     or give the same settings to go on"
                ),
            });
        }
    }
    let file = File::open(path).map_err(Error::io("open", path))?;
    file.try_lock().map_err(|error| match error {
        fs::TryLockError::WouldBlock => Error::Config {
            key: "--out".into(),
            what: format!("another process is at work on the {job} in {}", folder.display()),
            hint: Some("wait for it, or choose another folder".into()),
        },
        fs::TryLockError::Error(source) => {
            Error::Io { action: "lock", path: path.to_path_buf(), source }
        }
    })?;
    Ok(file)
}
