//! A report on disk: `table.md`, `table.csv`, `table.tex`, `speed.svg`, `errors.parquet`, and
//! `report.json` last, whose presence means that the directory is whole.

use std::{fs, path::Path, sync::Arc};

use arrow::{
    array::{
        ArrayRef, Float32Array, Float64Array, Int64Array, RecordBatch, StringArray, UInt32Array,
    },
    datatypes::{DataType, Field, Schema},
};
use parquet::{
    arrow::ArrowWriter,
    basic::{Compression, ZstdLevel},
    file::properties::WriterProperties,
};

use crate::{
    atomic::{self, AtomicFile},
    error::{Error, Result},
    eval::offline::{
        definitions::{Aggregate, METRICS, Metric},
        evaluate::{Errors, PolicyErrors},
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
    write_errors(&directory.join("errors.parquet"), errors)?;
    let texts = [
        ("table.md", render::markdown(report)),
        ("table.csv", render::csv(report)),
        ("table.tex", render::latex(report)),
        ("speed.svg", plot::speed_errors(report)),
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

/// One row per policy, episode and frame; one column per metric that is a mean, in its unit, null
/// where the frame does not count. Exact, so that every table can be made again from it.
fn write_errors(path: &Path, errors: &Errors) -> Result<()> {
    let per_frame: Vec<&Metric> =
        METRICS.iter().filter(|metric| metric.aggregate == Aggregate::Mean).collect();
    let mut fields = vec![
        Field::new("policy", DataType::Utf8, false),
        Field::new("episode", DataType::Utf8, false),
        Field::new("frame", DataType::UInt32, false),
        Field::new("stamp_ns", DataType::Int64, false),
        Field::new("command", DataType::Utf8, false),
        Field::new("speed_mps", DataType::Float32, false),
    ];
    fields.extend(per_frame.iter().map(|m| Field::new(m.key, DataType::Float64, true)));
    let schema = Arc::new(Schema::new(fields));
    let level = ZstdLevel::try_new(3).map_err(Error::parquet(path))?;
    let properties = WriterProperties::builder().set_compression(Compression::ZSTD(level)).build();

    let batch = |policy: &PolicyErrors| {
        let frames = &errors.frames;
        let episode = |i: u32| errors.episodes[i as usize].as_str();
        let mut columns: Vec<ArrayRef> = vec![
            Arc::new(StringArray::from_iter_values(frames.iter().map(|_| policy.name.as_str()))),
            Arc::new(StringArray::from_iter_values(frames.iter().map(|f| episode(f.episode)))),
            Arc::new(UInt32Array::from_iter_values(frames.iter().map(|f| f.frame))),
            Arc::new(Int64Array::from_iter_values(frames.iter().map(|f| f.stamp_ns))),
            Arc::new(StringArray::from_iter_values(frames.iter().map(|f| f.command.name()))),
            Arc::new(Float32Array::from_iter_values(frames.iter().map(|f| f.speed_mps))),
        ];
        for metric in &per_frame {
            columns.push(Arc::new(policy.rows.iter().map(metric.of).collect::<Float64Array>()));
        }
        RecordBatch::try_new(schema.clone(), columns).map_err(Error::arrow(path))
    };
    let file = AtomicFile::create(path)?;
    let mut writer = ArrowWriter::try_new(file, schema.clone(), Some(properties))
        .map_err(Error::parquet(path))?;
    for policy in &errors.policies {
        writer.write(&batch(policy)?).map_err(Error::parquet(path))?;
    }
    writer.into_inner().map_err(Error::parquet(path))?.commit()?;
    Ok(())
}
