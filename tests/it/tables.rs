//! Driven episodes: kept, and made into tables.

use std::{fs, path::Path};

use arrow::{
    array::{ArrayRef, RecordBatch, StringArray},
    datatypes::{Field, Schema},
};
use parquet::arrow::{ArrowWriter, arrow_reader::ParquetRecordBatchReaderBuilder};
use pmp::{
    closed_loop::{results, row::EpisodeRow},
    error::Error,
};

/// An episode of 100 s and 500 m that reached its goal.
fn row(policy: &str, town: &str, traffic: &str, episode: u32) -> EpisodeRow {
    let condition = match town {
        "Town03" => "training conditions",
        "Town05" => "new weather",
        "Town07" => "new town",
        _ => "new town & weather",
    };
    EpisodeRow {
        policy: policy.into(),
        suite: "deeptest".into(),
        condition: condition.into(),
        town: town.into(),
        traffic: traffic.into(),
        weather: "clear".into(),
        illumination: "daytime".into(),
        episode,
        seed: u64::MAX,
        route_m: 500.0,
        progress_m: 496.0,
        driven_m: 500.0,
        duration_s: 100.0,
        time_limit_s: 200.0,
        goal_m: 4.0,
        success: true,
        reason: "goal".into(),
        ..EpisodeRow::default()
    }
}

fn kept(rows: &[EpisodeRow]) -> (tempfile::TempDir, std::path::PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(results::FILE);
    results::write(&path, rows).unwrap();
    (folder, path)
}

#[test]
fn episodes_come_back_sorted_and_exact_and_in_the_same_bytes_whatever_their_order() {
    let mut rows = vec![
        row("b", "Town03", "empty", 0),
        row("a", "Town05", "empty", 1),
        row("a", "Town05", "empty", 0),
        row("a", "Town05", "dense", 11),
        row("a", "Town03", "regular", 2),
    ];
    rows[1].least_ttc_s = Some(0.1 + 0.2);
    rows[1].error = Some("a \"quote\", and ünïcode".into());
    rows[2].at_fault = Some(false);
    rows[3].wrong_lane_s = f64::MIN_POSITIVE;
    rows[4].fused = u64::MAX;
    let (_folder, path) = kept(&rows);
    let bytes = fs::read(&path).unwrap();
    let sorted = [4, 3, 2, 1, 0].map(|i| rows[i].clone());
    assert_eq!(results::read(&path).unwrap(), sorted);
    rows.swap(0, 3);
    let (_folder, again) = kept(&rows);
    assert_eq!(fs::read(again).unwrap(), bytes);
}

#[test]
fn a_number_that_is_none_is_not_kept_as_one() {
    let mut rows = vec![row("a", "Town03", "empty", 7)];
    rows[0].wrong_lane_s = f64::NAN;
    let folder = tempfile::tempdir().unwrap();
    let error = results::write(&folder.path().join(results::FILE), &rows).unwrap_err();
    assert!(error.to_string().contains("`wrong_lane_s` of a's Town03 empty 7"), "{error}");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
}

/// The same file with its columns, or their metadata, changed.
fn spoilt(path: &Path, change: impl Fn(&mut Vec<(Field, ArrayRef)>), with_version: bool) {
    let reader = ParquetRecordBatchReaderBuilder::try_new(fs::File::open(path).unwrap()).unwrap();
    let metadata = reader.schema().metadata().clone();
    let batch = reader.build().unwrap().next().unwrap().unwrap();
    let fields = batch.schema().fields().clone();
    let mut columns: Vec<(Field, ArrayRef)> =
        fields.iter().map(|f| f.as_ref().clone()).zip(batch.columns().iter().cloned()).collect();
    change(&mut columns);
    let (fields, columns): (Vec<_>, Vec<_>) = columns.into_iter().unzip();
    let metadata = if with_version { metadata } else { Default::default() };
    let schema = std::sync::Arc::new(Schema::new_with_metadata(fields, metadata));
    let batch = RecordBatch::try_new(schema.clone(), columns).unwrap();
    let mut writer = ArrowWriter::try_new(fs::File::create(path).unwrap(), schema, None).unwrap();
    if with_version {
        let version = pmp_version();
        writer.append_key_value_metadata(version);
    }
    writer.write(&batch).unwrap();
    writer.close().unwrap();
}

fn pmp_version() -> parquet::file::metadata::KeyValue {
    parquet::file::metadata::KeyValue::new(results::VERSION_KEY.to_string(), "1".to_string())
}

/// What is said, and what to do about it.
#[track_caller]
fn refusal(path: &Path) -> (String, String) {
    let error = results::read(path).unwrap_err();
    assert!(matches!(error, Error::Report { .. }), "{error:?}");
    assert!(error.to_string().contains("episodes.parquet"), "{error}");
    (error.to_string(), error.hint().unwrap())
}

#[test]
fn a_file_with_other_columns_is_refused_by_the_name_of_the_column() {
    let rows = [row("a", "Town03", "empty", 0)];
    let (_folder, path) = kept(&rows);
    spoilt(&path, |columns| columns.retain(|(field, _)| field.name() != "overspeed_s"), true);
    let (what, hint) = refusal(&path);
    assert!(what.contains("no column `overspeed_s`"), "{what}");
    assert!(hint.contains("pmp-eval drive"), "{hint}");

    let (_folder, path) = kept(&rows);
    let text = |columns: &mut Vec<(Field, ArrayRef)>| {
        let i = columns.iter().position(|(field, _)| field.name() == "seed").unwrap();
        columns[i].0 = Field::new("seed", arrow::datatypes::DataType::Utf8, false);
        columns[i].1 = std::sync::Arc::new(StringArray::from(vec!["7"]));
    };
    spoilt(&path, text, true);
    assert!(refusal(&path).0.contains("column `seed` holds Utf8, not UInt64"));

    let (_folder, path) = kept(&rows);
    spoilt(&path, |_| (), false);
    let (what, hint) = refusal(&path);
    assert!(what.contains("no driven episodes"), "{what}");
    assert!(hint.contains("a dataset's"), "{hint}");

    // Order is nothing, and a column that a later version adds is left alone.
    let (_folder, path) = kept(&rows);
    let more = |columns: &mut Vec<(Field, ArrayRef)>| {
        let mut added = columns[0].clone();
        added.0 = added.0.with_name("new");
        columns.insert(0, added);
        columns.reverse();
    };
    spoilt(&path, more, true);
    assert_eq!(results::read(&path).unwrap(), rows);
}
