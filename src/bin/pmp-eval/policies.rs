//! Policies by what they are called on the command line.

use std::path::Path;

use candle_core::Device;
use pmp::{
    error::{Error, Result},
    eval::baseline,
    model::learned::Learned,
    policy::Policy,
};

/// A baseline of that name, or the policy in that run directory.
pub(crate) fn open(name: &str) -> Result<Box<dyn Policy>> {
    if let Some(baseline) = baseline::baseline(name) {
        return Ok(baseline);
    }
    if !Path::new(name).is_dir() {
        return Err(Error::Run {
            path: name.into(),
            what: "neither a run directory nor a baseline".to_string(),
            hint: Some(format!("baselines are {}", baseline::NAMES.join(", "))),
        });
    }
    Ok(Box::new(Learned::open(Path::new(name), &Device::Cpu)?))
}
