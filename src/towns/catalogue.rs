//! The towns by name.

use std::path::{Path, PathBuf};

use crate::{
    atomic,
    error::{Error, Result},
    towns::{
        layout::lay_out, network::Network, opendrive, plan::Plan, town01, town02, town03, town04,
        town05, town06, town07,
    },
};

/// Plans of all towns, by name.
pub fn plans() -> Vec<Plan> {
    vec![
        town01::plan(),
        town02::plan(),
        town03::plan(),
        town04::plan(),
        town05::plan(),
        town06::plan(),
        town07::plan(),
    ]
}

/// A town as OpenDRIVE.
///
/// # Errors
///
/// [`Error::Map`] if the plan cannot be laid out.
pub fn text(plan: &Plan) -> Result<String> {
    let network: Network = lay_out(plan)?;
    Ok(opendrive::text(&network))
}

/// Write every town as `NAME.xodr` into a directory, which is made if it is missing. A file that
/// is there with the same bytes stays.
///
/// # Errors
///
/// [`Error::Exists`] if a file is there with other bytes; none is written then. [`Error::Io`] if
/// the disk refuses.
pub fn write_all(out: &Path) -> Result<Vec<PathBuf>> {
    let mut towns = Vec::new();
    for plan in plans() {
        let path = out.join(format!("{}.xodr", plan.name));
        let text = text(&plan)?;
        let is_there = match std::fs::read(&path) {
            Ok(bytes) if bytes == text.as_bytes() => true,
            Ok(_) => {
                let hint = "give another --out, or move the file away".to_string();
                return Err(Error::Exists { path, hint });
            }
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => false,
            Err(error) => return Err(Error::io("read", &path)(error)),
        };
        towns.push((path, text, is_there));
    }
    for (path, text, is_there) in &towns {
        if !is_there {
            atomic::write(path, text.as_bytes())?;
        }
    }
    Ok(towns.into_iter().map(|(path, ..)| path).collect())
}
