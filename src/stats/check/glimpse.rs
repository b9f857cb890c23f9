//! Pictures and sensor returns of a sample of frames, or of all.
//!
//! A sample is spread evenly over the frames in the order of the manifest, so the same dataset has
//! the same sample everywhere. Of each place the frame after it is read as well, within its row
//! group, to tell a camera that hangs.

use std::{collections::BTreeMap, fs::File, path::Path};

use arrow::{
    array::{Array, ArrowPrimitiveType, AsArray, RecordBatch},
    datatypes::{Float16Type, Float32Type, UInt32Type},
};
use half::f16;
use parquet::arrow::{
    ProjectionMask,
    arrow_reader::{ArrowReaderMetadata, ParquetRecordBatchReaderBuilder, RowSelection},
};
use rayon::prelude::*;

use crate::{
    dataset::{manifest::Manifest, shard::ShardRecord},
    frame::{IMAGE_HEIGHT, IMAGE_WIDTH},
    projection::Camera,
};

/// Frames that are looked at if nothing else is asked for.
pub const DEFAULT_SAMPLE: u64 = 48;

/// Which frames to look at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sample {
    /// So many, spread evenly; 0 is none.
    Spread(u64),
    All,
}

const COLUMNS: [&str; 9] = [
    "frame",
    "image",
    "velocity",
    "lidar_pixel",
    "lidar_x",
    "lidar_y",
    "lidar_z",
    "radar_pixel",
    "radar_speed",
];

/// Lidar returns as stored.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LidarReturns {
    pub pixel: Vec<u32>,
    /// Camera's optical frame, m.
    pub x: Vec<f16>,
    pub y: Vec<f16>,
    pub z: Vec<f16>,
}

/// Radar returns as stored.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RadarReturns {
    pub pixel: Vec<u32>,
    /// `None` of a radar that measures no speeds.
    pub speed_mps: Option<Vec<f16>>,
}

/// A frame with its pictures and returns.
pub struct Sight<'m> {
    /// Index of the episode among all of the manifest.
    pub episode: usize,
    pub frame: u32,
    /// Ego frame, x, m/s.
    pub forward_mps: f32,
    pub image: Vec<u8>,
    /// Whether the next row of the group has the same picture to the byte; `None` of the last.
    pub is_same_as_next: Option<bool>,
    pub lidar: Option<LidarReturns>,
    pub radar: Option<RadarReturns>,
    pub camera: Option<&'m Camera>,
    /// Size that pictures should have.
    pub size: (usize, usize),
}

/// A row group to look into.
struct Group<'m> {
    episode: usize,
    shard: &'m ShardRecord,
    camera: Option<&'m Camera>,
    metadata: ArrowReaderMetadata,
    number: usize,
    /// Ascending.
    rows: Vec<usize>,
}

/// Look at frames; what cannot be read is left out, since reading the columns told of it.
pub fn look<T: Send>(
    dataset: &Path,
    manifest: &Manifest,
    sample: Sample,
    look: impl Fn(&Sight) -> T + Sync,
) -> Vec<T> {
    let rule = &manifest.config.profile.camera;
    let size = match (rule.width, rule.height) {
        (0, _) | (_, 0) => (IMAGE_WIDTH, IMAGE_HEIGHT),
        size => size,
    };
    let groups = groups(dataset, manifest, sample);
    let of_group = |group: &Group| -> Vec<T> {
        let sights = read(dataset, group, size).unwrap_or_default();
        sights.iter().map(&look).collect()
    };
    groups.par_iter().flat_map_iter(of_group).collect()
}

fn groups<'m>(dataset: &Path, manifest: &'m Manifest, sample: Sample) -> Vec<Group<'m>> {
    let mut shards = Vec::new();
    let mut episode = 0;
    for log in &manifest.logs {
        for (record, own) in log.episodes.iter().zip(log.shards_by_episode()) {
            let camera = record.calibration.camera.as_ref();
            shards.extend(own.iter().map(|shard| (episode, camera, shard)));
            episode += 1;
        }
    }
    let frames: u64 = shards.iter().map(|(.., shard)| shard.rows).sum();
    let places: Option<Vec<u64>> = match sample {
        Sample::All => None,
        Sample::Spread(count) => {
            let count = count.min(frames);
            // Through u128, since a product of two counts may be large.
            let place = |at: u64| {
                (u128::from(2 * at + 1) * u128::from(frames) / u128::from(2 * count)) as u64
            };
            Some((0..count).map(place).collect())
        }
    };
    let mut begin = 0;
    let mut groups = Vec::new();
    for (episode, camera, shard) in shards {
        let range = begin..begin + shard.rows;
        begin = range.end;
        let of_shard = places.as_ref().map(|places| {
            let inside = places.iter().filter(|place| range.contains(place));
            inside.map(|place| (place - range.start) as usize).collect::<Vec<_>>()
        });
        if of_shard.as_ref().is_some_and(Vec::is_empty) {
            continue;
        }
        let Some(metadata) = open(dataset, shard) else { continue };
        let in_file = metadata.metadata().num_row_groups();
        let [first, count] = shard.groups.unwrap_or([0, in_file]);
        let mut row = 0;
        let mut picked: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for number in first..first.saturating_add(count).min(in_file) {
            let rows = metadata.metadata().row_group(number).num_rows() as usize;
            let inside: Vec<usize> = match &of_shard {
                None => (0..rows).collect(),
                Some(wanted) => {
                    let inside = wanted.iter().filter(|at| (row..row + rows).contains(*at));
                    // The last row has no next one.
                    inside.map(|at| (at - row).min(rows.saturating_sub(2))).collect()
                }
            };
            if !inside.is_empty() {
                picked.insert(number, inside);
            }
            row += rows;
        }
        groups.extend(picked.into_iter().map(|(number, rows)| Group {
            episode,
            shard,
            camera,
            metadata: metadata.clone(),
            number,
            rows,
        }));
    }
    groups
}

fn open(dataset: &Path, shard: &ShardRecord) -> Option<ArrowReaderMetadata> {
    let file = File::open(dataset.join(&shard.path)).ok()?;
    ArrowReaderMetadata::load(&file, Default::default()).ok()
}

fn read<'m>(dataset: &Path, group: &Group<'m>, size: (usize, usize)) -> Option<Vec<Sight<'m>>> {
    let in_group = group.metadata.metadata().row_group(group.number).num_rows() as usize;
    let mut wanted: Vec<usize> = group.rows.iter().flat_map(|row| [*row, *row + 1]).collect();
    wanted.retain(|row| *row < in_group);
    wanted.sort_unstable();
    wanted.dedup();
    let ranges = wanted.iter().map(|row| *row..*row + 1);
    let file = File::open(dataset.join(&group.shard.path)).ok()?;
    let columns = ProjectionMask::columns(group.metadata.parquet_schema(), COLUMNS);
    let reader = ParquetRecordBatchReaderBuilder::new_with_metadata(file, group.metadata.clone())
        .with_projection(columns)
        .with_row_groups(vec![group.number])
        .with_row_selection(RowSelection::from_consecutive_ranges(ranges, in_group))
        .with_batch_size(in_group)
        .build()
        .ok()?;
    let batch = reader.into_iter().next()?.ok()?;
    let seen = wanted.iter().enumerate().filter(|(_, row)| group.rows.contains(row));
    seen.map(|(at, row)| {
        let next = wanted.get(at + 1).filter(|next| **next == row + 1).map(|_| at + 1);
        sight(&batch, at, next, group, size)
    })
    .collect()
}

fn sight<'m>(
    batch: &RecordBatch,
    row: usize,
    next: Option<usize>,
    group: &Group<'m>,
    size: (usize, usize),
) -> Option<Sight<'m>> {
    let images = batch.column_by_name("image")?.as_binary_opt::<i32>()?;
    let frames = batch.column_by_name("frame")?.as_primitive_opt::<UInt32Type>()?;
    let velocities = batch.column_by_name("velocity")?.as_fixed_size_list_opt()?.values();
    let velocities = velocities.as_primitive_opt::<Float32Type>()?;
    let lidar = list::<UInt32Type>(batch, "lidar_pixel", row).map(|pixel| {
        let axis = |name| list::<Float16Type>(batch, name, row).unwrap_or_default();
        LidarReturns { pixel, x: axis("lidar_x"), y: axis("lidar_y"), z: axis("lidar_z") }
    });
    let radar = list::<UInt32Type>(batch, "radar_pixel", row).map(|pixel| RadarReturns {
        pixel,
        speed_mps: list::<Float16Type>(batch, "radar_speed", row),
    });
    Some(Sight {
        episode: group.episode,
        frame: frames.value(row),
        forward_mps: velocities.value(2 * row),
        image: images.value(row).to_vec(),
        is_same_as_next: next.map(|next| images.value(next) == images.value(row)),
        lidar,
        radar,
        camera: group.camera,
        size,
    })
}

fn list<T: ArrowPrimitiveType>(
    batch: &RecordBatch,
    name: &str,
    row: usize,
) -> Option<Vec<T::Native>> {
    let lists = batch.column_by_name(name)?.as_list_opt::<i32>()?;
    let values = lists.is_valid(row).then(|| lists.value(row))?;
    Some(values.as_primitive_opt::<T>()?.values().to_vec())
}
