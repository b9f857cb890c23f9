//! `pmp-eval calibrate`: a run and a dataset in, the constants of eq. (3) beside the run.

use std::{fmt::Write as _, path::PathBuf};

use clap::Args;
use pmp::{
    cli::{self, Outcome},
    control::fusion::Fusion,
    dataset::open,
    error::{Error, Result},
    eval::{
        calibration::{self, Calibration},
        offline::{evaluate::evaluate, report::Dataset},
    },
    model::run,
};

use crate::{offline::holdout, policies};

/// Choose how far a run's plans are followed (c1 and c2 of eq. (3)), on the frames held out from training
///
/// Writes RUN/fusion.json. The constants make the plan count fully for the more certain half of the
/// frames, and half at the 95th percentile of the variance; what they do to the error is said beside
/// them, with warnings where it speaks against fusing at all.
#[derive(Args)]
#[command(after_help = crate::AFTER)]
pub(crate) struct Calibrate {
    /// Run directory that pmp-train made
    #[arg(long, value_name = "RUN")]
    policy: PathBuf,
    /// Dataset made by pmp-ingest: the one that the run was trained on
    #[arg(long, value_name = "DATASET")]
    data: PathBuf,
    /// Replace constants that are there
    #[arg(long)]
    force: bool,
}

pub(crate) fn run(args: &Calibrate) -> Result<Outcome> {
    if !args.force {
        calibration::refuse_existing(&args.policy)?;
    }
    let Some(manifest) = run::manifest(&args.policy)? else {
        return Err(Error::Run {
            path: args.policy.clone(),
            what: "no trained run, there is no checkpoint".to_string(),
            hint: Some("`pmp-train --out` makes one".to_string()),
        });
    };
    let mut contenders = [policies::open(&args.policy.to_string_lossy())?];
    let dataset = open::Dataset::open(&args.data)?;
    let holdout = holdout(&dataset)?;
    let bar = cli::progress(holdout.frames, "frames", "planning");
    let frames = dataset.frames(&dataset.val).inspect(|_| bar.inc(1));
    let errors = evaluate(&mut contenders, frames)?;
    bar.finish_and_clear();
    let sha256 = Dataset::of(&args.data)?.manifest_sha256;
    let found =
        calibration::calibration(&errors, &errors.policies[0], manifest.checkpoint, sha256)?;
    calibration::write(&args.policy, &found, args.force)?;
    cli::print(&described(&found))?;
    let all = errors.frames.len() as u64 == holdout.frames;
    Ok(if all { Outcome::Done } else { Outcome::DoneWithLoss })
}

/// What was found, in lines.
fn described(found: &Calibration) -> String {
    let mut text = String::new();
    if let Fusion::Variance { c1, c2 } = found.fusion {
        let _ = writeln!(text, "c1 = {c1:.6}, c2 = {c2:.6} on {} held-out frames", found.frames);
    }
    let number = |value: Option<f64>| value.map_or("unknown".to_string(), |v| format!("{v:.4}"));
    let _ = writeln!(
        text,
        "mean |error| of steer, throttle, brake: a1 {}, a2 {}, fused {}\n\
         plan up to 5 m ahead: ADE {} m; variance against error: Spearman {}",
        number(found.a1_l1),
        number(found.a2_l1),
        number(found.fused_l1),
        number(found.ade_at_target_m),
        number(found.s_spearman),
    );
    for warning in &found.warnings {
        let _ = writeln!(text, "warning: {warning}");
    }
    text
}
