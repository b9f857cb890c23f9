//! The report: what was evaluated, on what, and what came out, as data.
//!
//! It is the same whatever it is rendered to; `schemas/report.v2.json` lists its fields.

use std::{collections::BTreeMap, path::PathBuf};

use serde::{Deserialize, Serialize};

use crate::{
    control::fusion::Fusion,
    error::{Error, Result},
    eval::{
        offline::{
            definitions::{CURVES, Curve, METRICS, Metric},
            errors::Sight,
        },
        statistics::{Bootstrap, Unit},
    },
};

/// Version of the fields below.
pub const VERSION: u32 = 2;

/// An offline evaluation of several policies on the same frames.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// [`VERSION`].
    pub version: u32,
    /// What a reader has to know before the numbers, most important first.
    pub caveats: Vec<String>,
    pub dataset: Dataset,
    pub holdout: Holdout,
    pub evaluated: Evaluated,
    pub intervals: Intervals,
    pub metrics: Vec<Definition>,
    /// Of what is given at each horizon.
    pub curves: Vec<Definition>,
    /// Horizons of the curves, s.
    pub horizons_s: Vec<f64>,
    pub policies: Vec<PolicyReport>,
}

/// Which dataset it was.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Dataset {
    /// Name of its directory.
    pub name: String,
    /// SHA-256 of its `manifest.json`, hexadecimal: what tells datasets apart.
    pub manifest_sha256: String,
}

/// Which frames no policy was trained on.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Holdout {
    pub kind: HoldoutKind,
    /// How it was chosen, one sentence.
    pub how: String,
    /// Whether good numbers on it say little of other drives.
    pub weak: bool,
    /// Frames in it.
    pub frames: u64,
    /// Episodes in it.
    pub episodes: u64,
}

/// What was set apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum HoldoutKind {
    /// Whole episodes.
    Episodes,
    /// A stretch of time of episodes that were trained on.
    TimeBlock,
}

impl HoldoutKind {
    /// As written in tables.
    pub fn text(self) -> &'static str {
        match self {
            HoldoutKind::Episodes => "episodes",
            HoldoutKind::TimeBlock => "time block",
        }
    }
}

/// Which frames were evaluated.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Evaluated {
    pub frames: u64,
    pub episodes: u64,
    /// SHA-256 over the lines `episode TAB frame`, in order, hexadecimal.
    pub sha256: String,
}

/// How intervals were made.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Intervals {
    pub bootstrap: Bootstrap,
    /// What was resampled.
    pub unit: Unit,
    /// How many of them there are.
    pub units: u64,
}

/// A row of [`METRICS`] or [`CURVES`], for readers of the JSON.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Definition {
    pub key: String,
    /// What it is about.
    pub group: String,
    pub title: String,
    pub unit: String,
    /// `lower`, `higher`, or `near` and a value; `none` of what is neither good nor bad.
    pub better: String,
    pub definition: String,
}

/// What one policy reached.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PolicyReport {
    pub name: String,
    /// An oracle, not a driver.
    pub sees_the_future: bool,
    pub sight: Sight,
    /// Constants of eq. (3), where they are known.
    pub fusion: Option<Fusion>,
    /// By metric key, all of [`METRICS`].
    pub metrics: BTreeMap<String, Estimate>,
    /// By key, all of [`CURVES`], one number for each horizon.
    pub curves: BTreeMap<String, Vec<Estimate>>,
    /// By command, speed, then by what is known of the surroundings.
    pub slices: Vec<Slice>,
    /// Against the reference and every blind policy; none for the reference itself, an oracle, and
    /// where either plans no motion.
    pub paired: Vec<Paired>,
    /// Of a policy that plans deviations.
    pub pit: Option<Pit>,
    /// Of a policy that plans deviations.
    pub variance: Option<Variance>,
    /// Mean share of each branch, of a policy that has them.
    pub attention: BTreeMap<String, f64>,
}

/// Where what was recorded lay in what was planned: counts of the probability integral transform.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Pit {
    /// For the first, second and third second of the plan, numbers in each twentieth of [0, 1].
    pub speed: Vec<Vec<u64>>,
    pub yaw: Vec<Vec<u64>>,
}

/// S of eq. (3) against the displacement at the target.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Variance {
    /// Frames that have both.
    pub frames: u64,
    pub s_median: f64,
    pub s_q95: f64,
    /// Frames by S in ten parts of one size, the most certain first.
    pub tenths: Vec<Tenth>,
    pub grid: Grid,
    /// Where the constants of eq. (3) are known.
    pub lambda: Option<Lambda>,
}

/// A tenth of the frames, by their S.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Tenth {
    pub frames: u64,
    /// Median of S.
    pub s: f64,
    /// Displacement at the target, m.
    pub median_m: f64,
    pub q90_m: f64,
}

/// Frames by S and error, both as their logarithms to base 10.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Grid {
    /// From the least to the greatest, without the outermost hundredths, which count into the
    /// border cells.
    pub log10_s: [f64; 2],
    pub log10_error_m: [f64; 2],
    /// Frames in each cell: rows of ascending error, each of ascending S.
    pub counts: Vec<Vec<u64>>,
}

/// The share of a2 in the fused action.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Lambda {
    pub frames: u64,
    pub mean: f64,
    /// Share of frames where it is above 0.99, and below 0.5.
    pub above_099: f64,
    pub below_05: f64,
    /// Frames in each tenth of [0, 1].
    pub counts: Vec<u64>,
}

/// One number.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// In the metric's unit; `None` where no frame has it.
    pub value: Option<f64>,
    /// Lower and upper end; `None` with fewer than two units.
    pub interval: Option<[f64; 2]>,
    /// Frames it is over.
    pub frames: u64,
}

/// The same numbers over some of the frames, without intervals.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Slice {
    /// `command`, `speed`, `town`, `weather`, `illumination` or `traffic`.
    pub by: String,
    /// A command, the range of |speed| in m/s, or what the surroundings are called.
    pub name: String,
    /// Frames in it.
    pub frames: u64,
    /// Those that a frame of it has.
    pub metrics: BTreeMap<String, Estimate>,
    /// Mean share of each branch, of a policy that has them.
    pub attention: BTreeMap<String, f64>,
}

/// Two policies frame by frame, on the headline metric.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Paired {
    pub reference: String,
    /// Key of the metric.
    pub metric: String,
    /// Frames where both have it.
    pub frames: u64,
    /// Units these frames are of.
    pub units: u64,
    /// Means over these frames, in the metric's unit.
    pub policy: f64,
    pub of_reference: f64,
    /// `policy - of_reference`.
    pub difference: f64,
    pub interval: Option<[f64; 2]>,
    pub verdict: Verdict,
    /// The verdict in words.
    pub sentence: String,
}

/// What the paired difference allows to say.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// The whole interval is on the better side.
    Beats,
    /// The whole interval is on the worse side.
    Worse,
    /// The interval holds 0.
    NoDifference,
    /// Too few units for any claim.
    TooFew,
}

impl Definition {
    /// All of [`METRICS`].
    pub fn metrics() -> Vec<Definition> {
        let of = |metric: &Metric| Definition {
            key: metric.key.to_string(),
            group: metric.group.to_string(),
            title: metric.title.to_string(),
            unit: metric.unit.to_string(),
            better: metric.better.text(),
            definition: metric.definition.to_string(),
        };
        METRICS.iter().map(of).collect()
    }

    /// All of [`CURVES`].
    pub fn curves() -> Vec<Definition> {
        let of = |curve: &Curve| Definition {
            key: curve.key.to_string(),
            group: "horizon".to_string(),
            title: curve.title.to_string(),
            unit: curve.unit.to_string(),
            better: curve.better.map_or("none".to_string(), |better| better.text()),
            definition: curve.definition.to_string(),
        };
        CURVES.iter().map(of).collect()
    }
}

impl Report {
    /// One report of the policies of several; each comes with where it was read.
    ///
    /// A policy that is in more than one with the same numbers is kept once.
    ///
    /// # Errors
    ///
    /// [`Error::Report`] naming the report that is of another dataset, of other frames, made with
    /// other intervals, or that holds other numbers of a policy of the same name.
    pub fn merge(reports: Vec<(PathBuf, Report)>) -> Result<Report> {
        let mut reports = reports.into_iter();
        let Some((first, mut merged)) = reports.next() else {
            return Err(Error::Config {
                key: "reports".to_string(),
                what: "none given".to_string(),
                hint: None,
            });
        };
        for (path, report) in reports {
            let refuse = |what: String, hint: &str| {
                Err(Error::Report { path: path.clone(), what, hint: Some(hint.to_string()) })
            };
            if report.dataset.manifest_sha256 != merged.dataset.manifest_sha256 {
                return refuse(
                    format!(
                        "this report is of dataset {} and {} is of dataset {}",
                        describe(&report.dataset),
                        first.display(),
                        describe(&merged.dataset)
                    ),
                    "one table holds one dataset: make one table for each",
                );
            }
            if report.evaluated != merged.evaluated || report.holdout != merged.holdout {
                return refuse(
                    format!(
                        "this report is over other frames ({} held out by {}) than {} ({} by {})",
                        report.evaluated.frames,
                        report.holdout.kind.text(),
                        first.display(),
                        merged.evaluated.frames,
                        merged.holdout.kind.text()
                    ),
                    "one table holds one set of frames: evaluate the policies again, together",
                );
            }
            if report.intervals != merged.intervals
                || report.metrics != merged.metrics
                || report.curves != merged.curves
            {
                return refuse(
                    format!("other metrics or intervals than in {}", first.display()),
                    "evaluate the policies again with one version of pmp-eval",
                );
            }
            for policy in report.policies {
                match merged.policies.iter().find(|known| known.name == policy.name) {
                    None => merged.policies.push(policy),
                    Some(known) if *known == policy => {}
                    Some(_) => {
                        return refuse(
                            format!("another `{}` than in {}", policy.name, first.display()),
                            "rename one of the run directories and evaluate it again",
                        );
                    }
                }
            }
            for caveat in report.caveats {
                if !merged.caveats.contains(&caveat) {
                    merged.caveats.push(caveat);
                }
            }
        }
        Ok(merged)
    }
}

fn describe(dataset: &Dataset) -> String {
    let checksum = dataset.manifest_sha256.get(..12).unwrap_or(&dataset.manifest_sha256);
    format!("{} ({checksum})", dataset.name)
}
