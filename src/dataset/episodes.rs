//! `episodes.parquet`: one row an episode, with what was left out of it.

use std::{path::Path, sync::Arc};

use crate::{
    dataset::{
        account::TopicAccount,
        manifest::{EpisodeRecord, LogRecord},
    },
    drops::Reason,
    error::{Error, Result},
    table_file::write_batches,
};
use arrow::{
    array::{
        Array, ArrayRef, Float64Array, ListArray, RecordBatch, StringArray, StructArray,
        UInt32Array, UInt64Array,
    },
    buffer::OffsetBuffer,
    datatypes::{Field, Fields, Schema},
};

/// Columns that may be null.
const NULLABLE: [&str; 5] = ["town", "weather", "illumination", "traffic", "use"];

/// Write `episodes.parquet`: one row an episode.
///
/// # Errors
///
/// If the disk refuses.
pub fn write_episodes(path: &Path, logs: &[LogRecord]) -> Result<()> {
    let of_log = |log| move |episode| (log, episode);
    let rows: Vec<(&LogRecord, &EpisodeRecord)> =
        logs.iter().flat_map(|log| log.episodes.iter().map(of_log(log))).collect();
    let text = |pick: &dyn Fn(&LogRecord) -> Option<String>| -> ArrayRef {
        Arc::new(rows.iter().map(|(log, _)| pick(log)).collect::<StringArray>())
    };
    let float = |pick: fn(&EpisodeRecord) -> f64| -> ArrayRef {
        Arc::new(rows.iter().map(|(_, episode)| Some(pick(episode))).collect::<Float64Array>())
    };
    let frames = rows.iter().map(|(_, episode)| Some(episode.frames as u32));
    let ids = rows.iter().map(|(_, episode)| Some(episode.id.clone()));
    let mut columns: Vec<(String, ArrayRef)> = vec![
        ("id".into(), Arc::new(ids.collect::<StringArray>())),
        ("source_log".into(), text(&|log| Some(log.source_log.clone()))),
        ("split".into(), text(&|log| Some(log.split.name().to_string()))),
        ("town".into(), text(&|log| log.conditions.town.clone())),
        ("weather".into(), text(&|log| log.conditions.weather.clone())),
        ("illumination".into(), text(&|log| log.conditions.illumination.clone())),
        ("traffic".into(), text(&|log| log.conditions.traffic.clone())),
        ("frames".into(), Arc::new(frames.collect::<UInt32Array>())),
        ("duration_s".into(), float(|episode| episode.duration_s)),
        ("distance_m".into(), float(|episode| episode.distance_m)),
    ];
    for reason in Reason::ALL {
        let counts = rows.iter().map(|(_, episode)| Some(episode.drops.count(reason)));
        let column: ArrayRef = Arc::new(counts.collect::<UInt64Array>());
        columns.push((format!("dropped_{}", reason.name()), column));
    }
    let topics: Vec<&[TopicAccount]> =
        rows.iter().map(|(_, episode)| episode.topics.as_slice()).collect();
    columns.push(("topics".into(), accounts(&topics)));

    let fields = fields(&columns);
    let columns = columns.into_iter().map(|(_, column)| column).collect();
    let schema = Arc::new(Schema::new(fields));
    let batch = RecordBatch::try_new(schema.clone(), columns).map_err(Error::arrow(path))?;
    write_batches(path, schema, [Ok(batch)], &[])?;
    Ok(())
}

/// The accounts of each row as a list of structs.
fn accounts(rows: &[&[TopicAccount]]) -> ArrayRef {
    let all = || rows.iter().flat_map(|accounts| accounts.iter());
    let left_out = || all().flat_map(|account| account.left_out.iter());
    let text = |pick: fn(&TopicAccount) -> Option<&str>| -> ArrayRef {
        Arc::new(all().map(pick).collect::<StringArray>())
    };
    let number = |pick: fn(&TopicAccount) -> u64| -> ArrayRef {
        Arc::new(all().map(|account| Some(pick(account))).collect::<UInt64Array>())
    };
    let reasons = left_out().map(|(why, _)| Some(why.name())).collect::<StringArray>();
    let counts = left_out().map(|(_, count)| Some(*count)).collect::<UInt64Array>();
    let left_out = list(
        vec![("reason".into(), Arc::new(reasons)), ("count".into(), Arc::new(counts))],
        all().map(|account| account.left_out.len()),
    );
    list(
        vec![
            ("topic".into(), text(|account| Some(&account.topic))),
            ("type".into(), text(|account| Some(&account.type_name))),
            ("use".into(), text(|account| account.used_as.as_deref())),
            ("read".into(), number(|account| account.read)),
            ("used".into(), number(|account| account.used)),
            ("left_out".into(), left_out),
        ],
        rows.iter().map(|accounts| accounts.len()),
    )
}

/// A list of structs, one of each length.
fn list(columns: Vec<(String, ArrayRef)>, lengths: impl Iterator<Item = usize>) -> ArrayRef {
    let fields = fields(&columns);
    let columns = columns.into_iter().map(|(_, column)| column).collect();
    let structs = StructArray::new(fields, columns, None);
    let item = Arc::new(Field::new("item", structs.data_type().clone(), false));
    Arc::new(ListArray::new(item, OffsetBuffer::from_lengths(lengths), Arc::new(structs), None))
}

fn fields(columns: &[(String, ArrayRef)]) -> Fields {
    let field = |(name, column): &(String, ArrayRef)| {
        Field::new(name, column.data_type().clone(), NULLABLE.contains(&name.as_str()))
    };
    columns.iter().map(field).collect()
}
