//! Reports of the same frames put side by side.

use std::path::PathBuf;

use crate::{
    error::{Error, Result},
    eval::offline::report::{Dataset, Report},
};

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
