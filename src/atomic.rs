//! Files that are either whole or not there, and checksums that tell.

use std::{
    fs::{self, File},
    io::{BufWriter, Read, Write},
    path::{Path, PathBuf},
};

use sha2::{Digest, Sha256};

use crate::error::{Error, Result};

/// Ending of files that are being written. What a killed process leaves behind has it.
pub const UNFINISHED: &str = "unfinished";

/// The name that a file has while it is being written.
pub fn unfinished_name(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_os_string();
    name.push(".");
    name.push(UNFINISHED);
    PathBuf::from(name)
}

/// The name of a file without its folder.
pub fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}

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
        let unfinished = unfinished_name(path);
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
        self.path.parent().map_or(Ok(()), sync_folder)?;
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

/// Make sure that a rename within a folder outlasts a loss of power.
///
/// # Errors
///
/// [`Error::Io`] if the disk refuses.
pub fn sync_folder(folder: &Path) -> Result<()> {
    // The parent of a bare file name is the empty path.
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    File::open(folder).and_then(|folder| folder.sync_all()).map_err(Error::io("flush", folder))
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

/// Read a JSON file; `None` if it does not exist.
///
/// # Errors
///
/// As [`read_json`].
pub fn read_json_if_exists<T: serde::de::DeserializeOwned>(path: &Path) -> Result<Option<T>> {
    match read_json(path) {
        Err(Error::Io { source, .. }) if source.kind() == std::io::ErrorKind::NotFound => Ok(None),
        read => read.map(Some),
    }
}

/// SHA-256, lower-case hexadecimal.
pub fn sha256(data: &[u8]) -> String {
    hex(&Sha256::digest(data))
}

/// SHA-256 of a whole file, lower-case hexadecimal.
///
/// # Errors
///
/// [`Error::Io`] if the file cannot be read.
pub fn sha256_of_file(path: &Path) -> Result<String> {
    let mut file = File::open(path).map_err(Error::io("open", path))?;
    let mut hasher = Sha256::new();
    let mut buffer = vec![0; 1 << 20];
    loop {
        match file.read(&mut buffer).map_err(Error::io("read", path))? {
            0 => return Ok(hex(&hasher.finalize())),
            len => hasher.update(&buffer[..len]),
        }
    }
}

/// Lower-case hexadecimal.
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}
