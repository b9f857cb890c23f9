//! How far the samples of frames are from their ticks.

use serde::{Deserialize, Serialize};

use crate::frame::Skew;

/// Distances of one sensor's samples from their ticks, in milliseconds, never negative.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SensorSkew {
    /// Frames that have a sample.
    pub frames: u64,
    pub median_ms: f64,
    /// 95 of 100 frames have less.
    pub p95_ms: f64,
    pub largest_ms: f64,
}

/// The skews of a log; `None` where no frame has a sample.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Skews {
    pub image: Option<SensorSkew>,
    pub lidar: Option<SensorSkew>,
    pub radar: Option<SensorSkew>,
    pub control: Option<SensorSkew>,
}

impl Skews {
    /// Of all frames of a log.
    pub fn of(frames: &[Skew]) -> Skews {
        let of = |pick: fn(&Skew) -> Option<i32>| SensorSkew::of(frames.iter().filter_map(pick));
        Skews {
            image: of(|skew| Some(skew.image_ns)),
            lidar: of(|skew| skew.lidar_ns),
            radar: of(|skew| skew.radar_ns),
            control: of(|skew| skew.control_ns),
        }
    }

    /// With their names.
    pub fn iter(&self) -> impl Iterator<Item = (&'static str, SensorSkew)> {
        let all = [
            ("image", self.image),
            ("lidar", self.lidar),
            ("radar", self.radar),
            ("control", self.control),
        ];
        all.into_iter().filter_map(|(name, skew)| Some((name, skew?)))
    }
}

impl SensorSkew {
    fn of(skews_ns: impl Iterator<Item = i32>) -> Option<SensorSkew> {
        let mut apart_ns: Vec<u32> = skews_ns.map(i32::unsigned_abs).collect();
        apart_ns.sort_unstable();
        let last = apart_ns.len().checked_sub(1)?;
        // Linear between the two nearest values, as the quantiles of pmp-stats.
        let quantile_ms = |share: f64| {
            let at = share * last as f64;
            let (below, above) = (at.floor() as usize, at.ceil() as usize);
            let (low, high) = (f64::from(apart_ns[below]), f64::from(apart_ns[above]));
            (low + (high - low) * at.fract()) * 1e-6
        };
        Some(SensorSkew {
            frames: apart_ns.len() as u64,
            median_ms: quantile_ms(0.5),
            p95_ms: quantile_ms(0.95),
            largest_ms: quantile_ms(1.0),
        })
    }
}
