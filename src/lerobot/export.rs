//! A dataset written in LeRobot's layout.

use std::{
    collections::BTreeSet,
    fs, io, mem,
    path::{Path, PathBuf},
};

use arrow::datatypes::SchemaRef;
use parquet::{
    arrow::ArrowWriter,
    basic::{Compression, ZstdLevel},
    file::properties::{EnabledStatistics, WriterProperties},
    schema::types::ColumnPath,
};
use rayon::prelude::*;
use serde_json::{Map, Value};

use crate::{
    atomic::{self, AtomicFile},
    dataset::{manifest::Manifest, picture::jpeg, shard::ShardReader, split::Split},
    error::{Error, Result},
    frame::Frame,
    lerobot::{
        cut::{Counts, Wanted, action, episodes, goes_on},
        layout::{
            ACTION, BYTES_PER_FILE, CHANNELS, Features, IMAGE, INDEXES, ROUTE, STATE, Totals,
            chunk_and_file, chunk_file, info, task_index,
        },
        statistics::{Colours, Summary, json_of},
        table::{self, EpisodeRow, Rows},
    },
    table_file::write_batches,
};

/// Rows of the largest row group; an episode of less is one.
const MOST_ROWS: usize = 4096;

/// Rows that are handed to the encoder in one piece.
const ROWS_AT_ONCE: usize = 64;

/// Write a dataset into a new folder, in LeRobot's layout v3.0.
///
/// Pictures are those of the dataset, byte for byte. Statistics of colours are of one picture a
/// second, all others of all frames.
///
/// # Errors
///
/// [`Error::Config`] if LeRobot cannot have it: a rate that is no whole number, no frame with an
/// action; [`Error::Dataset`] if the folder is not empty; and if the dataset is damaged or the disk
/// refuses.
pub fn export(dataset: &Path, out: &Path) -> Result<Counts> {
    let manifest = Manifest::read(dataset)?;
    let rate_hz = manifest.config.rate_hz;
    if rate_hz.fract() != 0.0 {
        return Err(Error::Config {
            key: "--format lerobot".into(),
            what: format!("LeRobot counts whole frames a second, the dataset has {rate_hz}"),
            hint: Some("ingest the logs again with a whole --rate".into()),
        });
    }
    let is_free = fs::read_dir(out).map_or_else(
        |error| error.kind() == io::ErrorKind::NotFound,
        |mut entries| entries.next().is_none(),
    );
    if !is_free {
        let what = "a folder that is not empty".to_string();
        let hint = Some("choose another --out, or remove what is there".to_string());
        return Err(Error::Dataset { path: out.to_path_buf(), what, hint });
    }
    let wanted = episodes(&manifest);
    let channels = channels(dataset, &wanted)?;
    let camera = &manifest.config.profile.camera;
    let features = Features { width: camera.width, height: camera.height, channels };
    let mut writer = Writer::new(dataset, out, features, rate_hz as u32);
    let mut train_episodes = 0;
    for episode in &wanted {
        writer.add(episode)?;
        if episode.log.split == Split::Train {
            train_episodes = writer.episodes.len();
        }
    }
    writer.finish(train_episodes)
}

/// Channels of the action that some frame has.
fn channels(dataset: &Path, wanted: &[Wanted]) -> Result<Vec<usize>> {
    let mut found = BTreeSet::new();
    for episode in wanted {
        if found.len() == CHANNELS.len() {
            break;
        }
        for action in actions(dataset, episode)? {
            found.extend((0..CHANNELS.len()).filter(|channel| action[*channel].is_some()));
        }
    }
    if found.is_empty() {
        return Err(Error::Config {
            key: "--format lerobot".into(),
            what: "no frame has steering, throttle or brake, and LeRobot's frames need an action"
                .into(),
            hint: Some("`pmp-ingest inspect LOG` shows what a log has".into()),
        });
    }
    Ok(found.into_iter().collect())
}

/// Steer, throttle, brake of every frame of an episode.
fn actions(dataset: &Path, episode: &Wanted) -> Result<Vec<[Option<f32>; 3]>> {
    let mut actions = Vec::new();
    for record in episode.log.shards_by_episode().nth(episode.number).unwrap_or_default() {
        actions.extend(ShardReader::open(dataset, record)?.actions()?);
    }
    Ok(actions)
}

/// A LeRobot dataset being written.
struct Writer<'o> {
    dataset: &'o Path,
    out: &'o Path,
    features: Features,
    fps: u32,
    schema: SchemaRef,
    file: Option<ArrowWriter<AtomicFile>>,
    file_number: usize,
    /// Of pictures, in the file that is open.
    file_bytes: u64,
    frames: usize,
    counts: Counts,
    episodes: Vec<EpisodeRow>,
    all: Gathered,
}

/// What statistics are made of.
#[derive(Default)]
struct Gathered {
    /// By column and number of its vector.
    series: Vec<Vec<Vec<f32>>>,
    colours: Colours,
}

/// A stretch without a gap, as far as it was read.
struct Stretch {
    first_frame: u32,
    last_frame: u32,
    length: usize,
    tasks: BTreeSet<usize>,
    gathered: Gathered,
}

/// Columns with statistics but for the picture.
fn columns() -> impl Iterator<Item = &'static str> {
    [STATE, ROUTE, ACTION].into_iter().chain(INDEXES)
}

impl<'o> Writer<'o> {
    fn new(dataset: &'o Path, out: &'o Path, features: Features, fps: u32) -> Writer<'o> {
        Writer {
            dataset,
            out,
            schema: table::schema(&features),
            features,
            fps,
            file: None,
            file_number: 0,
            file_bytes: 0,
            frames: 0,
            counts: Counts::default(),
            episodes: Vec::new(),
            all: Gathered::default(),
        }
    }

    /// Add an episode of the dataset, as one or more of LeRobot's.
    fn add(&mut self, wanted: &Wanted) -> Result<()> {
        self.counts.drives += 1;
        let id = &wanted.log.episodes[wanted.number].id;
        let mut stretch: Option<Stretch> = None;
        for record in wanted.log.shards_by_episode().nth(wanted.number).unwrap_or_default() {
            let reader = ShardReader::open(self.dataset, record)?;
            for group in 0..reader.group_count() {
                let mut run: Vec<(Frame, Vec<f32>)> = Vec::new();
                for (_, frame) in reader.frames(group)? {
                    let Some(action) = action(&frame, &self.features.channels) else {
                        self.counts.without_action += 1;
                        continue;
                    };
                    let last = run.last().map(|(frame, _)| frame.index);
                    let last = last.or(stretch.as_ref().map(|stretch| stretch.last_frame));
                    if !goes_on(last, &frame) {
                        self.write(&mut stretch, mem::take(&mut run))?;
                        self.end(id, stretch.take())?;
                    }
                    run.push((frame, action));
                }
                self.write(&mut stretch, run)?;
            }
        }
        self.end(id, stretch)
    }

    /// Write frames that go on with a stretch or begin one.
    fn write(&mut self, stretch: &mut Option<Stretch>, run: Vec<(Frame, Vec<f32>)>) -> Result<()> {
        let (Some((first, _)), Some((last, _))) = (run.first(), run.last()) else {
            return Ok(());
        };
        let mut grown = stretch.take().unwrap_or_else(|| Stretch {
            first_frame: first.index,
            last_frame: first.index,
            length: 0,
            tasks: BTreeSet::new(),
            gathered: Gathered::default(),
        });
        grown.last_frame = last.index;
        grown.tasks.extend(run.iter().map(|(frame, _)| task_index(frame.command)));
        let colours = colours(&run, grown.length, self.fps as usize)?;
        grown.gathered.colours.add(&colours);
        for some in run.chunks(ROWS_AT_ONCE) {
            let rows = Rows {
                frames: some,
                fps: self.fps,
                episode_index: self.episodes.len(),
                frame_index: grown.length,
                index: self.frames,
            };
            grown.gathered.series.resize(columns().count(), Vec::new());
            for (sums, column) in grown.gathered.series.iter_mut().zip(columns()) {
                let series = rows.series(column);
                sums.resize(series.len(), Vec::new());
                sums.iter_mut().zip(series).for_each(|(sum, part)| sum.extend(part));
            }
            let path = self.file_path();
            let batch = rows.batch(&self.features).map_err(Error::arrow(&path))?;
            let file = match &mut self.file {
                Some(file) => file,
                None => self.file.insert(begin(&path, self.schema.clone())?),
            };
            file.write(&batch).map_err(Error::parquet(&path))?;
            self.file_bytes += some.iter().map(|(frame, _)| frame.image.len() as u64).sum::<u64>();
            self.frames += some.len();
            grown.length += some.len();
        }
        *stretch = Some(grown);
        Ok(())
    }

    fn file_path(&self) -> PathBuf {
        self.out.join(chunk_file("data", self.file_number))
    }

    /// The stretch is an episode of its own.
    fn end(&mut self, id: &str, stretch: Option<Stretch>) -> Result<()> {
        let Some(stretch) = stretch else { return Ok(()) };
        let series = stretch.gathered.series;
        self.all.series.resize(series.len(), Vec::new());
        for (all, own) in self.all.series.iter_mut().zip(&series) {
            all.resize(own.len(), Vec::new());
            all.iter_mut().zip(own).for_each(|(all, own)| all.extend(own));
        }
        self.all.colours.add(&stretch.gathered.colours);
        let statistics = summaries(series, &stretch.gathered.colours, stretch.length);
        self.episodes.push(EpisodeRow {
            tasks: stretch.tasks.into_iter().collect(),
            length: stretch.length,
            chunk_and_file: chunk_and_file(self.file_number),
            first_index: self.frames - stretch.length,
            cut_from: (id.to_string(), stretch.first_frame),
            statistics,
        });
        if let Some(file) = &mut self.file {
            let path = self.out.join(chunk_file("data", self.file_number));
            file.flush().map_err(Error::parquet(&path))?;
        }
        if self.file_bytes >= BYTES_PER_FILE {
            self.end_file()?;
        }
        Ok(())
    }

    fn end_file(&mut self) -> Result<()> {
        let path = self.file_path();
        if let Some(file) = self.file.take() {
            file.into_inner().map_err(Error::parquet(&path))?.commit()?;
            self.file_number += 1;
            self.file_bytes = 0;
        }
        Ok(())
    }

    fn finish(mut self, train_episodes: usize) -> Result<Counts> {
        self.end_file()?;
        let (frames, episodes) = (self.frames, self.episodes.len());
        let table = |name: String, batch: Result<_, arrow::error::ArrowError>| {
            let path = self.out.join(name);
            let batch: arrow::array::RecordBatch = batch.map_err(Error::arrow(&path))?;
            write_batches(&path, batch.schema(), [Ok(batch)], &[])
        };
        table(chunk_file("meta/episodes", 0), table::episodes(&self.episodes))?;
        table("meta/tasks.parquet".into(), table::tasks())?;
        let mut stats = Map::new();
        for (column, summaries, count) in summaries(self.all.series, &self.all.colours, frames) {
            let is_image = column == IMAGE;
            stats.insert(column, json_of(&summaries, count, is_image));
        }
        atomic::write_json(&self.out.join("meta/stats.json"), &Value::Object(stats))?;
        let totals = Totals { fps: self.fps, frames, train_episodes, episodes };
        atomic::write_json(&self.out.join("meta/info.json"), &info(&self.features, &totals))?;
        Ok(Counts { episodes, frames, ..self.counts })
    }
}

/// Colours of one picture in `every`; so many frames of the episode came before.
fn colours(run: &[(Frame, Vec<f32>)], before: usize, every: usize) -> Result<Colours> {
    let places = run.par_iter().enumerate();
    let looked_at = places.filter(|(place, _)| (before + place).is_multiple_of(every));
    let colours = looked_at.map(|(_, (frame, _))| match jpeg::decode(&frame.image) {
        Ok(picture) => Ok(Colours::of(&picture)),
        Err(what) => Err(Error::Picture { frame: frame.index, what }),
    });
    let colours: Vec<Colours> = colours.collect::<Result<_>>()?;
    let mut sum = Colours::default();
    colours.iter().for_each(|colours| sum.add(colours));
    Ok(sum)
}

/// By column, with the number of frames or pictures that they are of.
fn summaries(
    series: Vec<Vec<Vec<f32>>>,
    colours: &Colours,
    frames: usize,
) -> Vec<(String, Vec<Summary>, usize)> {
    let image = (IMAGE.to_string(), colours.summaries().to_vec(), colours.pictures);
    let others = columns().zip(series).map(|(column, series)| {
        (column.to_string(), series.into_iter().map(Summary::of).collect(), frames)
    });
    [image].into_iter().chain(others).collect()
}

/// Begin a file of rows. Pictures do not compress again.
fn begin(path: &Path, schema: SchemaRef) -> Result<ArrowWriter<AtomicFile>> {
    let image = ColumnPath::new(vec![IMAGE.to_string(), "bytes".to_string()]);
    let properties = WriterProperties::builder()
        .set_created_by(concat!("pmp ", env!("CARGO_PKG_VERSION")).to_string())
        .set_compression(Compression::ZSTD(ZstdLevel::default()))
        .set_column_compression(image.clone(), Compression::UNCOMPRESSED)
        .set_column_dictionary_enabled(image.clone(), false)
        .set_column_statistics_enabled(image, EnabledStatistics::None)
        .set_max_row_group_row_count(Some(MOST_ROWS))
        .build();
    ArrowWriter::try_new(AtomicFile::create(path)?, schema, Some(properties))
        .map_err(Error::parquet(path))
}
