//! Files that are either whole or not there.

use std::{
    fs::{self, File},
    io::{BufWriter, Write},
    path::{Path, PathBuf},
};

use sha2::{Digest, Sha256};

use crate::{
    error::{Error, Result},
    log::reader::hex,
};

/// Ending of files that are being written. What a killed process leaves behind has it.
pub const UNFINISHED: &str = "unfinished";

/// A file under a temporary name until [`commit`](AtomicFile::commit).
#[derive(Debug)]
pub struct AtomicFile {
    path: PathBuf,
    unfinished: PathBuf,
    file: BufWriter<File>,
    hasher: Sha256,
    bytes: u64,
}

/// A committed file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Committed {
    pub bytes: u64,
    /// SHA-256, lower-case hexadecimal.
    pub sha256: String,
}

impl AtomicFile {
    /// Begin a file; its folder is made if it does not exist.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] if the folder or the file cannot be made.
    pub fn create(path: &Path) -> Result<AtomicFile> {
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder).map_err(Error::io("create", folder))?;
        }
        let mut name = path.as_os_str().to_os_string();
        name.push(".");
        name.push(UNFINISHED);
        let unfinished = PathBuf::from(name);
        let file = File::create(&unfinished).map_err(Error::io("create", &unfinished))?;
        let file = BufWriter::with_capacity(1 << 20, file);
        Ok(AtomicFile {
            path: path.to_path_buf(),
            unfinished,
            file,
            hasher: Sha256::new(),
            bytes: 0,
        })
    }

    /// Flush to the disk and give the file its name.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] if the disk refuses.
    pub fn commit(mut self) -> Result<Committed> {
        self.file.flush().map_err(Error::io("write", &self.unfinished))?;
        self.file.get_ref().sync_all().map_err(Error::io("write", &self.unfinished))?;
        fs::rename(&self.unfinished, &self.path).map_err(Error::io("rename", &self.unfinished))?;
        Ok(Committed { bytes: self.bytes, sha256: hex(&self.hasher.finalize()) })
    }
}

impl Write for AtomicFile {
    fn write(&mut self, data: &[u8]) -> std::io::Result<usize> {
        let written = self.file.write(data)?;
        self.hasher.update(&data[..written]);
        self.bytes += written as u64;
        Ok(written)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.file.flush()
    }
}

/// Write a whole file at once.
///
/// # Errors
///
/// [`Error::Io`] if the disk refuses.
pub fn write(path: &Path, data: &[u8]) -> Result<Committed> {
    let mut file = AtomicFile::create(path)?;
    file.write_all(data).map_err(Error::io("write", path))?;
    file.commit()
}

/// Write a value as indented JSON with a final newline.
///
/// # Errors
///
/// [`Error::Io`] if the disk refuses.
pub fn write_json(path: &Path, value: &impl serde::Serialize) -> Result<Committed> {
    let mut text = serde_json::to_string_pretty(value).map_err(Error::json(path))?;
    text.push('\n');
    write(path, text.as_bytes())
}

/// Read a JSON file.
///
/// # Errors
///
/// [`Error::Io`] if it cannot be read, [`Error::Json`] if it does not have the fields.
pub fn read_json<T: serde::de::DeserializeOwned>(path: &Path) -> Result<T> {
    let text = fs::read_to_string(path).map_err(Error::io("read", path))?;
    serde_json::from_str(&text).map_err(Error::json(path))
}
