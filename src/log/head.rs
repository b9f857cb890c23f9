//! What stands at the very beginning of a log, without reading the rest.

use std::{collections::BTreeMap, fs::File, io::Read, path::Path};

use mcap::{
    read::{LinearReader, Options},
    records::Record,
};

use crate::error::{Error, Result};

/// Bytes that are looked at.
const HEAD_BYTES: u64 = 1 << 16;

/// The metadata record of a name, if it stands before all messages of a log; `None` as well where
/// the file is no log.
///
/// # Errors
///
/// [`Error::Io`] if the file cannot be read.
pub fn metadata(path: &Path, name: &str) -> Result<Option<BTreeMap<String, String>>> {
    let mut head = Vec::new();
    let file = File::open(path).map_err(Error::io("open", path))?;
    file.take(HEAD_BYTES).read_to_end(&mut head).map_err(Error::io("read", path))?;
    let Ok(records) = LinearReader::new_with_options(&head, Options::IgnoreEndMagic.into()) else {
        return Ok(None);
    };
    let found = records.map_while(|record| record.ok()).find_map(|record| match record {
        Record::Metadata(metadata) if metadata.name == name => Some(metadata.metadata),
        _ => None,
    });
    Ok(found)
}
