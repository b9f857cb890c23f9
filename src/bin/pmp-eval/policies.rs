//! Policies by what they are called on the command line.

use std::path::Path;

use candle_core::Device;
use pmp::{
    error::{Error, Result},
    eval::{
        baseline, calibration,
        offline::{errors::Sight, evaluate::Contender},
    },
    model::learned::Learned,
};

/// A baseline of that name, or the policy in that run directory with its calibration.
pub(crate) fn open(name: &str) -> Result<Contender> {
    if let Some(baseline) = baseline::baseline(name) {
        return Ok(baseline.into());
    }
    if !Path::new(name).is_dir() {
        return Err(Error::Run {
            path: name.into(),
            what: "neither a run directory nor a baseline".to_string(),
            hint: Some(format!("baselines are {}", baseline::NAMES.join(", "))),
        });
    }
    let learned = Learned::open(Path::new(name), &Device::Cpu)?;
    let calibration = calibration::read(Path::new(name))?;
    Ok(Contender {
        sight: if learned.is_blind() { Sight::Blind } else { Sight::Seeing },
        policy: Box::new(learned),
        fusion: calibration.map(|calibration| calibration.fusion),
    })
}
