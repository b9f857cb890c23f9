//! Rows of frames and of episodes as Arrow columns, by LeRobot's names and types.

use std::{collections::HashMap, sync::Arc};

use arrow::{
    array::{
        Array, ArrayRef, BinaryArray, FixedSizeListArray, Float32Array, Float64Array, Int64Array,
        ListArray, RecordBatch, StringArray, StructArray,
    },
    buffer::OffsetBuffer,
    datatypes::{DataType, Field, Fields, Schema, SchemaRef},
    error::ArrowError,
};
use serde_json::json;

use crate::{
    frame::{Command, Frame},
    lerobot::{
        layout::{ACTION, Features, IMAGE, INDEXES, ROUTE, STATE, task, task_index},
        statistics::{NAMES, Summary},
    },
};

/// Frames of one episode with their actions, and where they stand.
#[derive(Debug)]
pub struct Rows<'f> {
    pub frames: &'f [(Frame, Vec<f32>)],
    pub fps: u32,
    pub episode_index: usize,
    /// Of the first, in its episode and in the dataset.
    pub frame_index: usize,
    pub index: usize,
}

impl Rows<'_> {
    /// Seconds since the episode's begin.
    fn timestamps(&self) -> Vec<f32> {
        let places = self.frame_index..self.frame_index + self.frames.len();
        places.map(|place| (place as f64 / f64::from(self.fps)) as f32).collect()
    }

    /// The numbers of a column of [`INDEXES`] but for the time.
    fn numbers(&self, column: &str) -> Vec<i64> {
        let number = |(place, (frame, _)): (usize, &(Frame, Vec<f32>))| match column {
            "frame_index" => self.frame_index + place,
            "episode_index" => self.episode_index,
            "index" => self.index + place,
            _ => task_index(frame.command),
        };
        self.frames.iter().enumerate().map(number).map(|number| number as i64).collect()
    }

    /// Each number of a vector, all frames in turn, as statistics want them.
    pub fn series(&self, column: &str) -> Vec<Vec<f32>> {
        let vector = |(frame, action): &(Frame, Vec<f32>)| -> Vec<f32> {
            match column {
                STATE => frame.velocity_mps.to_vec(),
                ROUTE => frame.route.waypoints_m.to_vec(),
                _ => action.clone(),
            }
        };
        let vectors: Vec<Vec<f32>> = match column {
            STATE | ROUTE | ACTION => self.frames.iter().map(vector).collect(),
            "timestamp" => self.timestamps().into_iter().map(|time| vec![time]).collect(),
            other => self.numbers(other).into_iter().map(|number| vec![number as f32]).collect(),
        };
        let len = vectors.first().map_or(0, Vec::len);
        (0..len).map(|at| vectors.iter().map(|vector| vector[at]).collect()).collect()
    }

    /// The columns.
    ///
    /// # Errors
    ///
    /// If Arrow finds them inconsistent, which would be a bug.
    pub fn batch(&self, features: &Features) -> Result<RecordBatch, ArrowError> {
        let images = self.frames.iter().map(|(frame, _)| Some(frame.image.as_slice()));
        let bytes: ArrayRef = Arc::new(images.collect::<BinaryArray>());
        let paths: ArrayRef =
            Arc::new(self.frames.iter().map(|_| None::<&str>).collect::<StringArray>());
        let image = StructArray::try_new(image_fields(), vec![bytes, paths], None)?;
        let mut columns: Vec<ArrayRef> = vec![Arc::new(image)];
        for (name, len) in features.vectors() {
            let series = self.series(name);
            let values = (0..self.frames.len()).flat_map(|row| series.iter().map(move |s| s[row]));
            let values: ArrayRef = Arc::new(Float32Array::from_iter_values(values));
            let item = Arc::new(Field::new("item", DataType::Float32, true));
            columns.push(match len {
                1 => values,
                _ => Arc::new(FixedSizeListArray::try_new(item, len as i32, values, None)?),
            });
        }
        for name in INDEXES {
            columns.push(match name {
                "timestamp" => Arc::new(Float32Array::from(self.timestamps())),
                other => Arc::new(Int64Array::from(self.numbers(other))),
            });
        }
        RecordBatch::try_new(schema(features), columns)
    }
}

fn image_fields() -> Fields {
    let fields = [("bytes", DataType::Binary), ("path", DataType::Utf8)];
    fields.into_iter().map(|(name, data_type)| Field::new(name, data_type, true)).collect()
}

/// The columns of a file of rows.
pub fn schema(features: &Features) -> SchemaRef {
    let mut fields = vec![Field::new(IMAGE, DataType::Struct(image_fields()), true)];
    for (name, len) in features.vectors() {
        let item = Arc::new(Field::new("item", DataType::Float32, true));
        let data_type = match len {
            1 => DataType::Float32,
            _ => DataType::FixedSizeList(item, len as i32),
        };
        fields.push(Field::new(name, data_type, true));
    }
    for name in INDEXES {
        let data_type = if name == "timestamp" { DataType::Float32 } else { DataType::Int64 };
        fields.push(Field::new(name, data_type, true));
    }
    let footer = HashMap::from([("huggingface".to_string(), features.of_footer().to_string())]);
    Arc::new(Schema::new_with_metadata(fields, footer))
}

/// An episode, as written.
#[derive(Clone, Debug, PartialEq)]
pub struct EpisodeRow {
    /// Which of the tasks it has, ascending.
    pub tasks: Vec<usize>,
    pub length: usize,
    pub chunk_and_file: [usize; 2],
    /// Of its first frame in the dataset.
    pub first_index: usize,
    /// Id of the episode of pmp's dataset that it was cut from, and the index of its first frame.
    pub cut_from: (String, u32),
    /// By column, with the number of frames or pictures that they are of.
    pub statistics: Vec<(String, Vec<Summary>, usize)>,
}

/// `meta/episodes/*.parquet`.
///
/// # Errors
///
/// If Arrow finds the columns inconsistent, which would be a bug.
pub fn episodes(rows: &[EpisodeRow]) -> Result<RecordBatch, ArrowError> {
    let number = |pick: &dyn Fn(usize, &EpisodeRow) -> usize| -> ArrayRef {
        let numbers = rows.iter().enumerate().map(|(place, row)| pick(place, row) as i64);
        Arc::new(Int64Array::from_iter_values(numbers))
    };
    let names =
        rows.iter().flat_map(|row| row.tasks.iter().map(|at| Some(task(Command::ALL[*at]))));
    let tasks = list(Arc::new(names.collect::<StringArray>()), rows.iter().map(|r| r.tasks.len()));
    let cut_from = rows.iter().map(|row| Some(row.cut_from.0.as_str())).collect::<StringArray>();
    let mut columns: Vec<(String, ArrayRef)> = vec![
        ("episode_index".into(), number(&|place, _| place)),
        ("tasks".into(), tasks),
        ("length".into(), number(&|_, row| row.length)),
        ("data/chunk_index".into(), number(&|_, row| row.chunk_and_file[0])),
        ("data/file_index".into(), number(&|_, row| row.chunk_and_file[1])),
        ("dataset_from_index".into(), number(&|_, row| row.first_index)),
        ("dataset_to_index".into(), number(&|_, row| row.first_index + row.length)),
        ("meta/episodes/chunk_index".into(), number(&|_, _| 0)),
        ("meta/episodes/file_index".into(), number(&|_, _| 0)),
        ("pmp/episode".into(), Arc::new(cut_from)),
        ("pmp/first_frame".into(), number(&|_, row| row.cut_from.1 as usize)),
    ];
    let count = rows.first().map_or(0, |row| row.statistics.len());
    for at in 0..count {
        let column = &rows[0].statistics[at].0;
        for (place, name) in NAMES.into_iter().enumerate() {
            let of_row = |row: &EpisodeRow| row.statistics[at].1.len();
            let values = rows.iter().flat_map(|row| &row.statistics[at].1);
            let values = values.map(|summary| summary.value(place));
            let mut values: ArrayRef = Arc::new(Float64Array::from_iter_values(values));
            if column == IMAGE {
                // Colour, 1, 1.
                for _ in 0..2 {
                    let len = values.len();
                    values = list(values, (0..len).map(|_| 1));
                }
            }
            columns.push((format!("stats/{column}/{name}"), list(values, rows.iter().map(of_row))));
        }
        let counts = rows.iter().map(|row| row.statistics[at].2 as i64);
        let counts: ArrayRef = Arc::new(Int64Array::from_iter_values(counts));
        columns.push((format!("stats/{column}/count"), list(counts, rows.iter().map(|_| 1))));
    }
    RecordBatch::try_from_iter(columns)
}

fn list(values: ArrayRef, lengths: impl Iterator<Item = usize>) -> ArrayRef {
    let item = Arc::new(Field::new("item", values.data_type().clone(), true));
    Arc::new(ListArray::new(item, OffsetBuffer::from_lengths(lengths), values, None))
}

/// `meta/tasks.parquet`, which LeRobot reads with pandas: the sentences are the index of its table.
///
/// # Errors
///
/// If Arrow finds the columns inconsistent, which would be a bug.
pub fn tasks() -> Result<RecordBatch, ArrowError> {
    let numbers: ArrayRef = Arc::new(Int64Array::from_iter_values(0..Command::ALL.len() as i64));
    let sentences: ArrayRef = Arc::new(StringArray::from(Command::ALL.map(task).to_vec()));
    let batch = RecordBatch::try_from_iter([("task_index", numbers), ("task", sentences)])?;
    let column = |name: &str, pandas: &str, numpy: &str| {
        json!({
            "name": name, "field_name": name, "pandas_type": pandas, "numpy_type": numpy,
            "metadata": null,
        })
    };
    let pandas = json!({
        "index_columns": ["task"],
        "column_indexes": [],
        "columns": [column("task_index", "int64", "int64"), column("task", "unicode", "object")],
        "creator": { "library": "pmp", "version": env!("CARGO_PKG_VERSION") },
        "pandas_version": "2.0.0",
    });
    let footer = HashMap::from([("pandas".to_string(), pandas.to_string())]);
    let schema = Arc::new(Schema::new_with_metadata(batch.schema().fields().clone(), footer));
    batch.with_schema(schema)
}
