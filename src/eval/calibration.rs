//! The constants of eq. (3), chosen on frames that the policy was not trained on, and kept in its
//! run directory.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::{
    atomic,
    control::fusion::{Fusion, fuse},
    error::{Error, Result},
    eval::{
        offline::errors::{Errors, PolicyErrors},
        statistics::{
            mean,
            rank::{quantile, spearman},
        },
    },
};

/// Version of the fields of [`Calibration`].
pub const VERSION: u32 = 1;

/// Name of the file in a run directory.
pub const FILE: &str = "fusion.json";

/// A plan whose way up to the target, 5 m ahead, is off by more than a tenth of it is not one to
/// follow, m.
pub const MOST_ADE_AT_TARGET_M: f64 = 0.5;

/// a2 is not to be trusted beside a1 if its error is more than this many times a1's.
pub const MOST_A2_BY_A1: f64 = 2.0;

/// Below this Spearman correlation with the error, the variance does not tell when to trust a2.
pub const LEAST_SPEARMAN: f64 = 0.1;

/// How a1 and a2 of a run are fused, and what speaks for and against it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Calibration {
    /// [`VERSION`].
    pub version: u32,
    /// The checkpoint that planned: constants do not outlast a training.
    pub checkpoint: String,
    /// SHA-256 of the dataset's `manifest.json`.
    pub dataset_sha256: String,
    pub fusion: Fusion,
    /// Frames with an S, the variance of eq. (3).
    pub frames: u64,
    pub s_median: f64,
    pub s_q95: f64,
    /// Spearman's correlation of S with the displacement at the target.
    pub s_spearman: Option<f64>,
    /// Mean |planned - recorded| over steer, throttle and brake, on the same frames for all three:
    /// of a1, of a2, and of both fused by these constants. `None` where no action was recorded.
    pub a1_l1: Option<f64>,
    pub a2_l1: Option<f64>,
    pub fused_l1: Option<f64>,
    /// Mean displacement of the plan up to its target, 5 m ahead, m.
    pub ade_at_target_m: Option<f64>,
    /// What speaks against fusing at all, in sentences; empty if nothing does.
    pub warnings: Vec<String>,
}

/// The constants of a policy, and what they do, from its errors on frames never trained on.
///
/// # Errors
///
/// [`Error::Run`] if its plans have too few deviations, or always the same.
pub fn calibration(
    errors: &Errors,
    policy: &PolicyErrors,
    checkpoint: String,
    dataset_sha256: String,
) -> Result<Calibration> {
    let mut s: Vec<f64> = policy.rows.iter().filter_map(|row| row.variance).collect();
    let fusion = Fusion::calibrated(&s).ok_or_else(|| Error::Run {
        path: PathBuf::from(&policy.name),
        what: "there is nothing to calibrate".to_string(),
        hint: Some(
            "eq. (3) needs plans with standard deviations that differ, on 20 frames or more"
                .to_string(),
        ),
    })?;
    s.sort_by(f64::total_cmp);
    let l1 = actions_l1(errors, policy, &fusion);
    let pairs: Vec<[f64; 2]> =
        policy.rows.iter().filter_map(|row| Some([row.variance?, row.target_m?])).collect();
    let ade = mean(&policy.rows.iter().map(|row| row.target_ade_m).collect::<Vec<_>>());
    let mut calibration = Calibration {
        version: VERSION,
        checkpoint,
        dataset_sha256,
        fusion,
        frames: s.len() as u64,
        s_median: quantile(&s, 0.5),
        s_q95: quantile(&s, 0.95),
        s_spearman: spearman(&pairs),
        a1_l1: l1.map(|[a1, _, _]| a1),
        a2_l1: l1.map(|[_, a2, _]| a2),
        fused_l1: l1.map(|[_, _, fused]| fused),
        ade_at_target_m: ade.0,
        warnings: Vec::new(),
    };
    calibration.warnings = warnings(&calibration);
    Ok(calibration)
}

/// Mean absolute errors of a1, a2 and the fused action over frames that have all of them.
fn actions_l1(errors: &Errors, policy: &PolicyErrors, fusion: &Fusion) -> Option<[f64; 3]> {
    let (mut sums, mut count) = ([0.0; 3], 0u64);
    for (frame, row) in errors.frames.iter().zip(&policy.rows) {
        let [Some(a1), Some(a2), _] = row.planned else { continue };
        let recorded = frame.recorded;
        let (Some(steer), Some(throttle), Some(brake)) =
            (recorded.steer, recorded.throttle, recorded.brake)
        else {
            continue;
        };
        let fused = fuse(a1, a2, fusion.lambda(row.variance));
        for (sum, action) in sums.iter_mut().zip([a1, a2, fused]) {
            let off = [action.steer - steer, action.throttle - throttle, action.brake - brake];
            *sum += off.iter().map(|off| f64::from(off.abs())).sum::<f64>() / 3.0;
        }
        count += 1;
    }
    (count > 0).then(|| sums.map(|sum| sum / count as f64))
}

/// lambda is 1 for half of the frames however bad a2 is, so its error has to be looked at too.
fn warnings(of: &Calibration) -> Vec<String> {
    let mut warnings = Vec::new();
    if let Some(ade) = of.ade_at_target_m.filter(|ade| *ade > MOST_ADE_AT_TARGET_M) {
        warnings.push(format!(
            "the plan is off by {ade:.2} m on its way to the target 5 m ahead, more than \
             {MOST_ADE_AT_TARGET_M} m: eq. (3) would trust it all the same; drive by a1"
        ));
    }
    if let (Some(a1), Some(a2)) = (of.a1_l1, of.a2_l1)
        && a2 > MOST_A2_BY_A1 * a1
    {
        warnings.push(format!(
            "a2 is off by {a2:.3} on average, more than {MOST_A2_BY_A1} times the {a1:.3} of a1: \
             half of all frames would be driven by the worse of the two"
        ));
    }
    if of.s_spearman.is_none_or(|correlation| correlation < LEAST_SPEARMAN) {
        let correlation = of.s_spearman.map_or("none".to_string(), |c| format!("{c:.2}"));
        warnings.push(format!(
            "the variance does not tell where the plan is wrong (Spearman's correlation \
             {correlation}, below {LEAST_SPEARMAN})"
        ));
    }
    warnings
}

/// Keep a calibration in its run directory.
///
/// # Errors
///
/// [`Error::Run`] if there is one and it may not be replaced, [`Error::Io`] if the disk refuses.
pub fn write(run_dir: &Path, calibration: &Calibration, replace: bool) -> Result<()> {
    if !replace {
        refuse_existing(run_dir)?;
    }
    atomic::write_json(&run_dir.join(FILE), calibration).map(|_| ())
}

/// Refuse a run that is calibrated, before work is done for nothing.
///
/// # Errors
///
/// [`Error::Run`] if it is.
pub fn refuse_existing(run_dir: &Path) -> Result<()> {
    let path = run_dir.join(FILE);
    if path.exists() {
        return Err(Error::Run {
            path,
            what: "the run is calibrated already".to_string(),
            hint: Some("`--force` replaces it".to_string()),
        });
    }
    Ok(())
}

/// The calibration of a run; `None` if it has none.
///
/// # Errors
///
/// [`Error::Run`] if it is of another version, [`Error::Json`] if it does not have the fields,
/// [`Error::Io`] if it cannot be read.
pub fn read(run_dir: &Path) -> Result<Option<Calibration>> {
    let path = run_dir.join(FILE);
    let Some(value) = atomic::read_json_if_exists::<serde_json::Value>(&path)? else {
        return Ok(None);
    };
    if value["version"] != VERSION {
        return Err(Error::Run {
            what: format!(
                "the calibration has version {}, this build reads {VERSION}",
                value["version"]
            ),
            path,
            hint: Some("`pmp-eval calibrate --force` makes it again".to_string()),
        });
    }
    serde_json::from_value(value).map(Some).map_err(Error::json(&path))
}
