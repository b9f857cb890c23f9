//! The frames of a dataset as a table, through polars.
//!
//! The shards and their split are those of the manifest: what a killed ingest left behind does
//! not count, and a dataset may lie below a folder that looks like a hive partition. Polars looks at
//! the types of all columns, so it has to be built with half floats.

use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
};

use polars::{
    io::HiveOptions,
    prelude::{
        DataFrame, DataType, Expr, LazyFrame, PlRefPath, PolarsResult, ScanArgsParquet,
        ScanSources, UnionArgs, col, concat, lit,
    },
};

use crate::{
    dataset::{manifest::Manifest, split::Split},
    error::{Error, Result},
};

const NS_PER_MS: f64 = 1e6;

/// Planar speed, m/s, f64.
pub fn speed_mps() -> Expr {
    let axis = |i: i32| col("velocity").arr().get(lit(i), false).cast(DataType::Float64);
    (axis(0) * axis(0) + axis(1) * axis(1)).sqrt()
}

/// A skew in milliseconds, f64.
pub fn skew_ms(name: &str) -> Expr {
    col(name).cast(DataType::Float64) / lit(NS_PER_MS)
}

/// These columns of all frames after their split (`split`), one row a frame: train before
/// val, then by shard; `None` if there is no shard.
///
/// # Errors
///
/// [`Error::Dataset`] if a shard is missing or not as long as the manifest says; [`Error::Query`]
/// if one is damaged.
pub fn select(dataset: &Path, manifest: &Manifest, columns: &[Expr]) -> Result<Option<DataFrame>> {
    for shard in manifest.logs.iter().flat_map(|log| &log.shards) {
        let path = dataset.join(&shard.path);
        match fs::metadata(&path) {
            Ok(metadata) if metadata.len() == shard.bytes => (),
            Ok(_) => return Err(broken(&path, "a shard is not as long as it was".to_string())),
            Err(error) => return Err(broken(&path, format!("a shard cannot be read ({error})"))),
        }
    }
    let table = || -> PolarsResult<Option<DataFrame>> {
        let mut tables = Vec::new();
        for split in Split::ALL {
            let logs = manifest.logs.iter().filter(|log| log.split == split);
            // A file may hold shards of several logs.
            let shards: BTreeSet<_> =
                logs.flat_map(|log| &log.shards).map(|shard| &shard.path).collect();
            if !shards.is_empty() {
                let mut columns = columns.to_vec();
                columns.insert(0, lit(split.name()).alias("split"));
                let paths = shards.iter().map(|path| dataset.join(path));
                tables.push(scan(paths)?.select(columns));
            }
        }
        if tables.is_empty() {
            return Ok(None);
        }
        concat(tables, UnionArgs::default())?.collect().map(Some)
    };
    table().map_err(Error::query(dataset))
}

/// Exactly these files, whatever characters their names have.
///
/// # Errors
///
/// If a path is none that polars takes.
pub fn scan(paths: impl Iterator<Item = PathBuf>) -> PolarsResult<LazyFrame> {
    let paths: Vec<PlRefPath> =
        paths.map(|path| PlRefPath::try_from_path(&path)).collect::<PolarsResult<_>>()?;
    let args = ScanArgsParquet {
        hive_options: HiveOptions::new_disabled(),
        glob: false,
        ..Default::default()
    };
    LazyFrame::scan_parquet_sources(ScanSources::Paths(paths.into()), args)
}

/// A dataset that does not hold what its manifest says.
pub fn broken(path: &Path, what: String) -> Error {
    let hint = Some("remove the dataset and ingest the logs again".to_string());
    Error::Dataset { path: path.to_path_buf(), what, hint }
}
