//! What messages show, made before it was asked for, while the log was scanned.
//!
//! What a message shows is a function of its bytes, of the sensors as they were placed, and of
//! where its own sensor sat at its time. All three are noted beside it, and it is given out only
//! where they are what is asked for: a guess that was wrong costs time and never a frame.
//!
//! It lies in a file that has no name, so memory does not grow with the log, and nothing is left
//! behind by a process that is killed.

use std::{
    collections::BTreeMap,
    fs::{self, File},
    os::unix::fs::FileExt,
    path::{Path, PathBuf},
    process,
    sync::{
        Arc,
        atomic::{AtomicUsize, Ordering},
    },
};

use half::f16;

use crate::{
    atomic::unfinished_name,
    dataset::senses::{Sensed, Senses, Signal},
    error::{Error, Result},
    frame::{LidarPixels, RadarPixels},
    log::{reader::Place, signals::Pose},
};

/// Bytes of a pixel's number, and of a half float.
const PIXEL_BYTES: usize = 4;
const HALF_BYTES: usize = 2;

/// Number of the next file, of all that this process makes.
static NEXT_FILE: AtomicUsize = AtomicUsize::new(0);

/// What was made of some messages of a log.
#[derive(Debug, Default)]
pub struct Stock {
    scratch: Option<Scratch>,
    /// The sensors as they were placed when something was made.
    senses: Vec<Arc<Senses>>,
    entries: BTreeMap<Place, Entry>,
}

#[derive(Debug)]
struct Scratch {
    /// The name that it had.
    path: PathBuf,
    file: File,
    bytes: u64,
}

#[derive(Debug)]
struct Entry {
    signal: Signal,
    /// Index in [`Stock::senses`].
    senses: usize,
    pose: Option<Pose>,
    offset: u64,
    len: usize,
    /// Of radar returns.
    has_speeds: bool,
}

impl Stock {
    /// Nothing yet, to lie in a file in `folder`.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] if the file cannot be made.
    pub fn within(folder: &Path) -> Result<Stock> {
        let number = NEXT_FILE.fetch_add(1, Ordering::Relaxed);
        let name = format!("stock-{}-{number}", process::id());
        let path = unfinished_name(&folder.join(name));
        let file = File::options().read(true).write(true).create_new(true).open(&path);
        let file = file.map_err(Error::io("create", &path))?;
        fs::remove_file(&path).map_err(Error::io("remove", &path))?;
        Ok(Stock { scratch: Some(Scratch { path, file, bytes: 0 }), ..Stock::default() })
    }

    /// Messages of which something was made.
    pub fn len(&self) -> usize {
        self.entries.len()
    }

    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// Keep what a message shows, unless it shows nothing.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] if the disk refuses.
    pub fn add(
        &mut self,
        place: Place,
        senses: &Arc<Senses>,
        pose: Option<Pose>,
        sensed: &Sensed,
    ) -> Result<()> {
        let Some(scratch) = &mut self.scratch else { return Ok(()) };
        let mut pixel_bytes = Vec::new();
        let (signal, bytes, has_speeds) = match sensed {
            Sensed::Picture(Ok(jpeg)) => (Signal::Camera, jpeg, false),
            Sensed::Lidar(Ok(lidar)) => {
                put_pixels(&mut pixel_bytes, &lidar.pixel);
                for metres in [&lidar.x, &lidar.y, &lidar.z] {
                    put_halves(&mut pixel_bytes, metres);
                }
                (Signal::Lidar, &pixel_bytes, false)
            }
            Sensed::Radar(Ok(radar)) => {
                put_pixels(&mut pixel_bytes, &radar.pixel);
                radar.speed_mps.iter().for_each(|speeds| put_halves(&mut pixel_bytes, speeds));
                (Signal::Radar, &pixel_bytes, radar.speed_mps.is_some())
            }
            _ => return Ok(()),
        };
        let (offset, len) = (scratch.bytes, bytes.len());
        scratch.file.write_all_at(bytes, offset).map_err(Error::io("write", &scratch.path))?;
        scratch.bytes += len as u64;
        if self.senses.last().is_none_or(|last| last != senses) {
            self.senses.push(senses.clone());
        }
        let senses = self.senses.len() - 1;
        self.entries.insert(place, Entry { signal, senses, pose, offset, len, has_speeds });
        Ok(())
    }

    /// What a message shows, if it was made, and of the same sensors in the same places.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] if it cannot be read back.
    pub fn get(
        &self,
        place: &Place,
        signal: Signal,
        senses: &Senses,
        pose: &Result<Option<Pose>, String>,
    ) -> Result<Option<Sensed>> {
        let Some((entry, scratch)) = self.entries.get(place).zip(self.scratch.as_ref()) else {
            return Ok(None);
        };
        let is_same = entry.signal == signal
            && pose.as_ref().is_ok_and(|pose| *pose == entry.pose)
            && *self.senses[entry.senses] == *senses;
        if !is_same {
            return Ok(None);
        }
        let mut bytes = vec![0; entry.len];
        let read = scratch.file.read_exact_at(&mut bytes, entry.offset);
        read.map_err(Error::io("read", &scratch.path))?;
        Ok(Some(match signal {
            Signal::Camera => Sensed::Picture(Ok(bytes)),
            Signal::Lidar => {
                let (pixel, metres) = pixels(&bytes, 3);
                let mut metres = metres.chunks(pixel.len().max(1) * HALF_BYTES).map(halves);
                let mut axis = || metres.next().unwrap_or_default();
                let (x, y, z) = (axis(), axis(), axis());
                Sensed::Lidar(Ok(LidarPixels { pixel, x, y, z }))
            }
            Signal::Radar => {
                let (pixel, speeds) = pixels(&bytes, usize::from(entry.has_speeds));
                let speed_mps = entry.has_speeds.then(|| halves(speeds));
                Sensed::Radar(Ok(RadarPixels { pixel, speed_mps }))
            }
        }))
    }
}

fn put_pixels(bytes: &mut Vec<u8>, pixels: &[u32]) {
    for (pixel, bytes) in pixels.iter().zip(more(bytes, pixels.len())) {
        *bytes = pixel.to_le_bytes();
    }
}

fn put_halves(bytes: &mut Vec<u8>, halves: &[f16]) {
    for (half, bytes) in halves.iter().zip(more(bytes, halves.len())) {
        *bytes = half.to_le_bytes();
    }
}

/// Room for so many numbers of `N` bytes more.
fn more<const N: usize>(bytes: &mut Vec<u8>, count: usize) -> &mut [[u8; N]] {
    let from = bytes.len();
    bytes.resize(from + N * count, 0);
    bytes[from..].as_chunks_mut().0
}

/// The pixels at the beginning of bytes that have so many half floats for each of them behind.
fn pixels(bytes: &[u8], halves_each: usize) -> (Vec<u32>, &[u8]) {
    let count = bytes.len() / (PIXEL_BYTES + halves_each * HALF_BYTES);
    let (pixels, halves) = bytes.split_at(count * PIXEL_BYTES);
    (pixels.as_chunks().0.iter().map(|bytes| u32::from_le_bytes(*bytes)).collect(), halves)
}

fn halves(bytes: &[u8]) -> Vec<f16> {
    bytes.as_chunks().0.iter().map(|bytes| f16::from_le_bytes(*bytes)).collect()
}
