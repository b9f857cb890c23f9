//! `errors.parquet`: one row per policy, episode and frame, from which every number of a report can
//! be made again.

use std::{collections::BTreeSet, path::Path, sync::Arc};

use arrow::{
    array::{
        Array, ArrayRef, FixedSizeListArray, Float32Array, Float64Array, Int64Array, RecordBatch,
        StringArray, UInt32Array,
    },
    buffer::NullBuffer,
    datatypes::{Field, Schema},
};

use crate::{
    error::{Error, Result},
    eval::offline::{
        definitions::{CURVES, METRICS, Measure},
        errors::{Errors, FrameKey, PolicyErrors, Row},
        metrics::SOURCES,
    },
    frame::{Conditions, FUTURE_STEPS, RecordedAction},
    policy::Action,
    table_file::write_batches,
};

/// Write all rows. What a frame or a policy does not have is null.
///
/// Columns: which frame it is and what was recorded there; what was planned; every metric that is a
/// mean and every curve, in its unit; and what the other metrics are made of (`pit_*`, `variance`).
///
/// # Errors
///
/// [`Error::Io`], [`Error::Arrow`] or [`Error::Parquet`] if the file cannot be written.
pub fn write(path: &Path, errors: &Errors) -> Result<()> {
    let branches: BTreeSet<&str> =
        errors.policies.iter().flat_map(|policy| policy.branches.iter().copied()).collect();
    let batch = |policy: &PolicyErrors| {
        let columns = columns(errors, policy, &branches);
        let fields =
            columns.iter().map(|(name, column)| Field::new(name, column.data_type().clone(), true));
        let schema = Arc::new(Schema::new(fields.collect::<Vec<_>>()));
        let arrays = columns.into_iter().map(|(_, column)| column).collect();
        RecordBatch::try_new(schema, arrays).map_err(Error::arrow(path))
    };
    let mut batches = errors.policies.iter().map(batch).peekable();
    let schema = match batches.peek() {
        Some(Ok(first)) => first.schema(),
        _ => Arc::new(Schema::empty()),
    };
    write_batches(path, schema, batches, &[])?;
    Ok(())
}

type Column = (String, ArrayRef);

/// The columns of one policy's rows, in their order.
fn columns(errors: &Errors, policy: &PolicyErrors, branches: &BTreeSet<&str>) -> Vec<Column> {
    let rows: Vec<Row> = errors
        .frames
        .iter()
        .zip(&policy.rows)
        .map(|(frame, errors)| Row { frame, errors })
        .collect();
    let mut columns = which(errors, policy, &rows);
    columns.extend(what_was_done(&rows));
    let number = |name: &str, of: &dyn Fn(&Row) -> Option<f64>| -> Column {
        (name.to_string(), Arc::new(rows.iter().map(of).collect::<Float64Array>()))
    };
    for metric in &METRICS {
        if let Measure::Mean(of) = metric.measure {
            columns.push(number(metric.key, &of));
        }
    }
    columns.push(number("variance", &|row| row.errors.variance));
    columns.push(number("lambda", &|row| row.errors.lambda));
    for branch in branches {
        let place = policy.branches.iter().position(|known| known == branch);
        let share = |row: &Row| row.errors.attention.get(place?).map(|share| f64::from(*share));
        columns.push(number(&format!("attention_{branch}"), &share));
    }
    for curve in CURVES {
        let values: Vec<_> = rows.iter().map(curve.of).collect();
        columns.push((format!("{}_by_horizon", curve.key), doubles(&values)));
    }
    for (d, name) in ["pit_speed", "pit_yaw"].into_iter().enumerate() {
        let of = |row: &Row| row.errors.mixture.as_ref().map(|mixture| mixture.pit[d]);
        columns.push((name.to_string(), floats(rows.iter().map(of).collect())));
    }
    columns
}

/// Which frame it is, and what it is sliced by.
fn which<'a>(errors: &'a Errors, policy: &'a PolicyErrors, rows: &[Row<'a>]) -> Vec<Column> {
    let text = |of: &dyn Fn(&'a FrameKey) -> Option<&'a str>| -> ArrayRef {
        Arc::new(rows.iter().map(|row| of(row.frame)).collect::<StringArray>())
    };
    let conditions =
        |frame: &FrameKey| -> &Conditions { &errors.conditions[frame.conditions as usize] };
    let frames = || rows.iter().map(|row| row.frame);
    let columns: [(&str, ArrayRef); 10] = [
        ("policy", text(&|_| Some(&policy.name))),
        ("episode", text(&|frame| Some(&errors.episodes[frame.episode as usize]))),
        ("frame", Arc::new(UInt32Array::from_iter_values(frames().map(|f| f.frame)))),
        ("stamp_ns", Arc::new(Int64Array::from_iter_values(frames().map(|f| f.stamp_ns)))),
        ("command", text(&|frame| Some(frame.command.name()))),
        ("town", text(&|frame| conditions(frame).town.as_deref())),
        ("weather", text(&|frame| conditions(frame).weather.as_deref())),
        ("illumination", text(&|frame| conditions(frame).illumination.as_deref())),
        ("traffic", text(&|frame| conditions(frame).traffic.as_deref())),
        ("speed_mps", Arc::new(Float32Array::from_iter_values(frames().map(|f| f.speed_mps)))),
    ];
    columns.into_iter().map(|(name, column)| (name.to_string(), column)).collect()
}

/// The recorded action, and those that were planned.
fn what_was_done(rows: &[Row]) -> Vec<Column> {
    type Channel = (&'static str, fn(&RecordedAction) -> Option<f32>, fn(&Action) -> f32);
    let channels: [Channel; 3] = [
        ("steer", |recorded| recorded.steer, |planned| planned.steer),
        ("throttle", |recorded| recorded.throttle, |planned| planned.throttle),
        ("brake", |recorded| recorded.brake, |planned| planned.brake),
    ];
    let mut columns = Vec::new();
    let mut add = |name: String, of: &dyn Fn(&Row) -> Option<f32>| {
        columns.push((name, Arc::new(rows.iter().map(of).collect::<Float32Array>()) as ArrayRef));
    };
    for (channel, recorded, _) in channels {
        add(format!("recorded_{channel}"), &|row| recorded(&row.frame.recorded));
    }
    for (source, name) in SOURCES.into_iter().enumerate() {
        for (channel, _, planned) in channels {
            add(format!("{name}_{channel}"), &|row| {
                row.errors.planned[source].as_ref().map(planned)
            });
        }
    }
    columns
}

/// A list of always so many numbers in each row; null where it has none of them.
fn doubles<const N: usize>(rows: &[[Option<f64>; N]]) -> ArrayRef {
    let is_there = rows.iter().map(|row| row.iter().any(Option::is_some)).collect();
    list(N, Arc::new(rows.as_flattened().iter().collect::<Float64Array>()), is_there)
}

/// As [`doubles`], of all numbers or none: one for each step of the future.
fn floats(rows: Vec<Option<[f32; FUTURE_STEPS]>>) -> ArrayRef {
    let numbers = rows.iter().flat_map(|row| row.unwrap_or([0.0; FUTURE_STEPS]));
    let numbers = Float32Array::from_iter_values(numbers);
    list(FUTURE_STEPS, Arc::new(numbers), rows.iter().map(Option::is_some).collect())
}

fn list(length: usize, numbers: ArrayRef, is_there: Vec<bool>) -> ArrayRef {
    let item = Arc::new(Field::new("item", numbers.data_type().clone(), true));
    let there = NullBuffer::from(is_there);
    Arc::new(FixedSizeListArray::new(item, length as i32, numbers, Some(there)))
}
