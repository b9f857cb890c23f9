//! Driven episodes on disk: `episodes.parquet`, the only input of tables.
//!
//! `schemas/episodes.v1.json`, compiled in, is the list of columns. A row goes through its JSON
//! form, whose fields are the columns, so that nothing here repeats their names.

use std::{fs::File, path::Path, sync::Arc};

use arrow::{
    array::{
        Array, ArrayRef, AsArray, BooleanArray, Float64Array, RecordBatch, StringArray,
        UInt32Array, UInt64Array,
    },
    datatypes::{DataType, Field, Float64Type, Schema, UInt32Type, UInt64Type},
};
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use serde::Deserialize;
use serde_json::{Map, Value};

use crate::{
    closed_loop::row::EpisodeRow,
    error::{Error, Result},
    table_file::write_batches,
};

/// Name of the file in the directory of an evaluation.
pub const FILE: &str = "episodes.parquet";

/// Version of the columns.
pub const SCHEMA_VERSION: u32 = 1;

/// Key of [`SCHEMA_VERSION`] in the file's metadata.
pub const VERSION_KEY: &str = "pmp.episodes_schema";

const COLUMNS: &str = include_str!("../../schemas/episodes.v1.json");

/// What helps against a file that cannot be read.
const ANEW: &str = "drive the suite again with this build, `pmp-eval drive`";

#[derive(Deserialize)]
struct Listing {
    columns: Vec<Column>,
}

#[derive(Deserialize)]
struct Column {
    name: String,
    #[serde(rename = "type")]
    kind: Kind,
    nullable: bool,
}

/// Types of columns, as the schema file writes them.
#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Kind {
    String,
    Bool,
    U32,
    U64,
    F64,
}

impl Kind {
    fn data_type(self) -> DataType {
        match self {
            Kind::String => DataType::Utf8,
            Kind::Bool => DataType::Boolean,
            Kind::U32 => DataType::UInt32,
            Kind::U64 => DataType::UInt64,
            Kind::F64 => DataType::Float64,
        }
    }

    /// Values as a column; what is not of the type becomes null.
    fn column<'v>(self, values: impl Iterator<Item = &'v Value>) -> ArrayRef {
        match self {
            Kind::String => Arc::new(values.map(Value::as_str).collect::<StringArray>()),
            Kind::Bool => Arc::new(values.map(Value::as_bool).collect::<BooleanArray>()),
            Kind::U32 => {
                let number = |value: &Value| u32::try_from(value.as_u64()?).ok();
                Arc::new(values.map(number).collect::<UInt32Array>())
            }
            Kind::U64 => Arc::new(values.map(Value::as_u64).collect::<UInt64Array>()),
            Kind::F64 => Arc::new(values.map(Value::as_f64).collect::<Float64Array>()),
        }
    }

    /// The value in a row of a column of this type.
    fn value(self, column: &ArrayRef, row: usize) -> Value {
        if column.is_null(row) {
            return Value::Null;
        }
        match self {
            Kind::String => column.as_string::<i32>().value(row).into(),
            Kind::Bool => column.as_boolean().value(row).into(),
            Kind::U32 => column.as_primitive::<UInt32Type>().value(row).into(),
            Kind::U64 => column.as_primitive::<UInt64Type>().value(row).into(),
            Kind::F64 => column.as_primitive::<Float64Type>().value(row).into(),
        }
    }
}

fn columns() -> Result<Vec<Column>> {
    let listing: Listing =
        serde_json::from_str(COLUMNS).map_err(Error::json("schemas/episodes.v1.json"))?;
    Ok(listing.columns)
}

/// Write `episodes.parquet`, sorted by policy, town, traffic and episode; the same rows in any
/// order give the same bytes.
///
/// # Errors
///
/// [`Error::Report`] naming the column whose number is not finite; [`Error::Io`],
/// [`Error::Arrow`] or [`Error::Parquet`] if the file cannot be written.
pub fn write(path: &Path, rows: &[EpisodeRow]) -> Result<()> {
    let mut rows: Vec<&EpisodeRow> = rows.iter().collect();
    rows.sort_by_key(|row| (&row.policy, &row.town, &row.traffic, row.episode, row.seed));
    let values = rows.iter().map(serde_json::to_value).collect::<Result<Vec<_>, _>>();
    let values = values.map_err(Error::json(path))?;

    let (mut fields, mut arrays) = (Vec::new(), Vec::new());
    for column in columns()? {
        let array = column.kind.column(values.iter().map(|row| &row[&column.name]));
        if !column.nullable
            && let Some(row) = (0..array.len()).find(|&row| array.is_null(row))
        {
            let EpisodeRow { policy, town, traffic, episode, .. } = rows[row];
            return Err(Error::Report {
                path: path.to_path_buf(),
                what: format!(
                    "`{}` of {policy}'s {town} {traffic} {episode} is no number",
                    column.name
                ),
                hint: None,
            });
        }
        fields.push(Field::new(column.name, column.kind.data_type(), column.nullable));
        arrays.push(array);
    }
    let schema = Arc::new(Schema::new(fields));
    let batch = RecordBatch::try_new(schema.clone(), arrays).map_err(Error::arrow(path))?;
    write_batches(path, schema, [Ok(batch)], &[(VERSION_KEY, SCHEMA_VERSION.to_string())])?;
    Ok(())
}

/// Read `episodes.parquet`; columns are found by name, and more than are known are left alone.
///
/// # Errors
///
/// [`Error::Report`] naming the file, and the column that is missing or of another type, or the
/// version if it is another; [`Error::Io`], [`Error::Arrow`] or [`Error::Parquet`] if it cannot
/// be read at all.
pub fn read(path: &Path) -> Result<Vec<EpisodeRow>> {
    let refuse = |what: String, hint: &str| Error::Report {
        path: path.to_path_buf(),
        what,
        hint: Some(hint.to_string()),
    };
    let file = File::open(path).map_err(Error::io("open", path))?;
    let reader = ParquetRecordBatchReaderBuilder::try_new(file).map_err(Error::parquet(path))?;
    match reader.schema().metadata().get(VERSION_KEY) {
        Some(version) if *version == SCHEMA_VERSION.to_string() => {}
        Some(version) => {
            let what = format!(
                "the episodes are of version {version}, this build reads version {SCHEMA_VERSION}"
            );
            return Err(refuse(what, ANEW));
        }
        None => {
            let what = format!("these are no driven episodes (no `{VERSION_KEY}` in the metadata)");
            return Err(refuse(
                what,
                "a dataset's episodes.parquet lists recorded drives; `pmp-eval drive` writes \
                 driven ones",
            ));
        }
    }
    let columns = columns()?;
    for column in &columns {
        let data_type = column.kind.data_type();
        match reader.schema().field_with_name(&column.name) {
            Ok(field) if *field.data_type() == data_type => {}
            Ok(field) => {
                let what = format!(
                    "column `{}` holds {}, not {data_type}",
                    column.name,
                    field.data_type()
                );
                return Err(refuse(what, ANEW));
            }
            Err(_missing) => return Err(refuse(format!("no column `{}`", column.name), ANEW)),
        }
    }
    let mut rows = Vec::new();
    for batch in reader.build().map_err(Error::parquet(path))? {
        let batch = batch.map_err(Error::arrow(path))?;
        let arrays: Vec<(&Column, &ArrayRef)> =
            columns.iter().filter_map(|c| Some((c, batch.column_by_name(&c.name)?))).collect();
        for row in 0..batch.num_rows() {
            let mut fields = Map::new();
            for (column, array) in &arrays {
                if array.is_null(row) && !column.nullable {
                    return Err(refuse(format!("column `{}` has a null", column.name), ANEW));
                }
                fields.insert(column.name.clone(), column.kind.value(array, row));
            }
            rows.push(serde_json::from_value(Value::Object(fields)).map_err(Error::json(path))?);
        }
    }
    Ok(rows)
}
