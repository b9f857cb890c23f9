//! What the messages that some ticks need show: taken from stock, or fetched from the log and made
//! now.
//!
//! Message by message, where they lie in the file, so that nothing large is kept.

use std::collections::BTreeMap;

use crate::{
    dataset::{
        align::Tick,
        footage::LeftOut,
        picture::Decoded,
        senses::{Sensed, Senses, Signal},
        stock::Stock,
    },
    drops::Reason,
    error::Result,
    frame::{LidarPixels, RadarPixels},
    log::{
        reader::{Place, SegmentReader},
        recording::{Recording, Stamped},
    },
};

/// What some ticks' pictures and clouds show, by the place of their messages.
pub struct Shown(BTreeMap<Place, Sensed>);

impl Shown {
    /// What the pictures and clouds of some ticks show, by the place of their messages, each of
    /// which is read, decoded and brought down to what is stored once, in the order of the file;
    /// what is in stock need not be.
    ///
    /// # Errors
    ///
    /// If the log cannot be read any more.
    pub fn new(
        senses: &Senses,
        recording: &Recording,
        ticks: &[Tick],
        stock: &Stock,
    ) -> Result<Shown> {
        let mut wanted = BTreeMap::new();
        for tick in ticks {
            if senses.footage.is_none() {
                wanted.insert(tick.image.value, (Signal::Camera, tick.image.stamp_ns));
            }
            for (signal, sample) in [(Signal::Lidar, &tick.lidar), (Signal::Radar, &tick.radar)] {
                wanted.extend(sample.as_ref().map(|s| (s.value, (signal, s.stamp_ns))));
            }
        }
        let mut reader = SegmentReader::new(&recording.log);
        let mut sensed = BTreeMap::new();
        for (place, (signal, stamp_ns)) in wanted {
            let pose = senses.pose(recording, signal, stamp_ns);
            let shown = match stock.get(&place, signal, senses, &pose)? {
                Some(shown) => shown,
                None => senses.sense(recording, signal, reader.message(&place)?, &pose),
            };
            sensed.insert(place, shown);
        }
        if let Some(footage) = &senses.footage {
            let wanted: Vec<Place> = ticks.iter().map(|tick| tick.image.value).collect();
            let camera = senses.camera_topic(recording);
            footage.decode(&recording.log, camera, &wanted, &mut |place, picture| {
                let stored = picture.and_then(|rgb| {
                    let stored = senses.store(&Decoded::whole(rgb));
                    stored.map_err(|why| (Reason::ImageDamaged, why))
                });
                sensed.insert(place, Sensed::Picture(stored));
            })?;
        }
        Ok(Shown(sensed))
    }

    /// The stored picture of a tick.
    ///
    /// # Errors
    ///
    /// Why there is none.
    pub fn picture(&self, tick: &Tick) -> Result<&[u8], LeftOut> {
        match self.0.get(&tick.image.value) {
            Some(Sensed::Picture(picture)) => picture.as_deref().map_err(LeftOut::clone),
            _ => Err((Reason::ImageDamaged, "the decoder gave no picture for it".to_string())),
        }
    }

    /// The lidar returns of a tick, or why they cannot be had; `None` where it has no cloud.
    pub fn lidar(&self, tick: &Tick) -> Option<Result<&LidarPixels, &str>> {
        match self.of(&tick.lidar)? {
            Sensed::Lidar(pixels) => Some(pixels.as_ref().map_err(String::as_str)),
            _ => None,
        }
    }

    /// The radar returns of a tick, or why they cannot be had; `None` where it has no scan.
    pub fn radar(&self, tick: &Tick) -> Option<Result<&RadarPixels, &str>> {
        match self.of(&tick.radar)? {
            Sensed::Radar(pixels) => Some(pixels.as_ref().map_err(String::as_str)),
            _ => None,
        }
    }

    fn of(&self, sample: &Option<Stamped<Place>>) -> Option<&Sensed> {
        self.0.get(&sample.as_ref()?.value)
    }
}
