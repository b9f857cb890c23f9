//! A report on disk: `table.md`, `table.csv`, `table.tex`, `speed.svg`, `report.html`,
//! `errors.parquet`, and `report.json` last, whose presence means that the directory is whole.

use std::{fs, path::Path};

use crate::{
    atomic,
    error::{Error, Result},
    eval::offline::{
        errors::Errors,
        errors_parquet,
        html::page::page,
        plot, render,
        report::{Dataset, Report, VERSION},
    },
};

impl Dataset {
    /// Which dataset is in that directory.
    ///
    /// # Errors
    ///
    /// [`Error::Dataset`] if it has no `manifest.json` that can be read.
    pub fn of(directory: &Path) -> Result<Dataset> {
        let manifest = directory.join("manifest.json");
        let bytes = fs::read(&manifest).map_err(|error| Error::Dataset {
            path: directory.to_path_buf(),
            what: format!("not a whole dataset, cannot read its manifest.json ({error})"),
            hint: Some("make one from logs with `pmp-ingest --out DATASET LOG...`".to_string()),
        })?;
        let name = directory.file_name().map_or("dataset".into(), |name| name.to_string_lossy());
        Ok(Dataset { name: name.into_owned(), manifest_sha256: atomic::sha256(&bytes) })
    }
}

/// Refuse a directory that already holds a report; for before the work and before writing.
///
/// # Errors
///
/// [`Error::Report`] if `directory/report.json` exists.
pub fn refuse_existing(directory: &Path) -> Result<()> {
    let path = directory.join("report.json");
    if path.exists() {
        return Err(Error::Report {
            path,
            what: "a report is already here".to_string(),
            hint: Some("choose another directory with `--out`, or remove this one".to_string()),
        });
    }
    Ok(())
}

/// Write a report and the errors it was made of, every file under a temporary name first.
///
/// # Errors
///
/// [`Error::Report`] if the directory already holds a report; [`Error::Io`], [`Error::Arrow`],
/// [`Error::Parquet`] or [`Error::Json`] if a file cannot be written.
pub fn write(directory: &Path, report: &Report, errors: &Errors) -> Result<()> {
    refuse_existing(directory)?;
    errors_parquet::write(&directory.join("errors.parquet"), errors)?;
    let texts = [
        ("table.md", render::markdown(report)),
        ("table.csv", render::csv(report)),
        ("table.tex", render::latex(report)),
        ("speed.svg", plot::speed_errors(report)),
        ("report.html", page(report)),
        ("report.json", json(report)?),
    ];
    for (name, text) in texts {
        atomic::write(&directory.join(name), text.as_bytes())?;
    }
    Ok(())
}

/// A report as JSON; what is missing is `null`.
///
/// # Errors
///
/// [`Error::Json`] if it cannot be written, which only a bug can bring about.
pub fn json(report: &Report) -> Result<String> {
    let text = serde_json::to_string_pretty(report).map_err(Error::json("report.json"))?;
    Ok(text + "\n")
}

/// Read the report in a directory.
///
/// # Errors
///
/// [`Error::Report`] if there is none or it is of another version; [`Error::Json`] if its fields
/// are not those of [`Report`].
pub fn read(directory: &Path) -> Result<Report> {
    let path = directory.join("report.json");
    let refuse = |what: String, hint: &str| Error::Report {
        path: path.clone(),
        what,
        hint: Some(hint.to_string()),
    };
    let bytes = fs::read(&path).map_err(|error| {
        let how = "make one with `pmp-eval offline --policy P --data DATASET --out DIR`";
        refuse(format!("no report can be read ({error})"), how)
    })?;
    let value: serde_json::Value = serde_json::from_slice(&bytes).map_err(Error::json(&path))?;
    let version = value.get("version").and_then(serde_json::Value::as_u64);
    if version != Some(u64::from(VERSION)) {
        let found = version.map_or("no version".to_string(), |v| format!("version {v}"));
        let what = format!("the report has {found}, this build reads version {VERSION}");
        return Err(refuse(what, "evaluate the policies again with this build"));
    }
    serde_json::from_value(value).map_err(Error::json(&path))
}
