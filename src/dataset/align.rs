//! Samples onto the grid: which sample of each signal belongs to which tick.
//!
//! The grid starts at the first instant at which every required signal exists and ticks every
//! 0.1 s until the first of them ends. A tick takes the nearest sample of each sensor within the
//! tolerance, interpolates the ego motion between its neighbours, and is left out where a
//! required signal has nothing near: nothing is filled across a gap.

use std::collections::BTreeSet;

use crate::{
    dataset::ego::{EgoState, EgoTrack},
    drops::{Drops, Reason},
    log::{
        profile::{Required, Tolerance},
        reader::Place,
        recording::{Stamped, nearest},
        signals::Control,
    },
};

/// Samples of one drive, ascending by stamp; empty where the log has no such signal.
#[derive(Clone, Copy, Debug)]
pub struct Signals<'r> {
    pub ego: &'r EgoTrack,
    pub camera: &'r [Stamped<Place>],
    pub lidar: &'r [Stamped<Place>],
    pub radar: &'r [Stamped<Place>],
    pub control: &'r [Stamped<Control>],
}

/// One tick with the samples that belong to it.
#[derive(Clone, Debug, PartialEq)]
pub struct Tick {
    pub index: u32,
    pub stamp_ns: i64,
    pub ego: EgoState,
    pub image: Stamped<Place>,
    pub lidar: Option<Stamped<Place>>,
    pub radar: Option<Stamped<Place>>,
    pub control: Option<Stamped<Control>>,
}

/// The grid of a drive.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    /// Ticks that will become frames, ascending.
    pub ticks: Vec<Tick>,
    /// Ticks that will not.
    pub drops: Drops,
    /// Samples that belong to those.
    pub dropped: SampleStamps,
    /// Stamp of tick 0, ns since the Unix epoch.
    pub start_ns: i64,
    /// Stamp of the last tick, ns since the Unix epoch.
    pub end_ns: i64,
}

/// Samples by their stamps.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SampleStamps {
    pub camera: BTreeSet<i64>,
    pub lidar: BTreeSet<i64>,
    pub radar: BTreeSet<i64>,
    pub control: BTreeSet<i64>,
}

/// Lay the grid over a drive; `None` if there is no instant at which all required signals exist.
pub fn align(
    signals: &Signals,
    tolerance: &Tolerance,
    required: &Required,
    period_ns: i64,
) -> Option<Grid> {
    let (start_ns, end_ns) = common_span(signals, required)?;
    let near = |samples, stamp_ns, tolerance_ms| within(samples, stamp_ns, nanos(tolerance_ms));
    let last = (end_ns - start_ns) / period_ns;
    let mut grid = Grid {
        ticks: Vec::new(),
        drops: Drops::default(),
        dropped: SampleStamps::default(),
        start_ns,
        end_ns: start_ns + last * period_ns,
    };
    let mut at = 0;
    while at <= last {
        let stamp_ns = start_ns + at * period_ns;
        // A gap is passed over at once: one wrong stamp may make it years long.
        let next = next_with(signals.camera, stamp_ns, nanos(tolerance.camera));
        let next = next.map_or(last + 1, |ns| (ns - start_ns + period_ns - 1) / period_ns);
        // Nor is there an index for a tick that is 13 years away.
        let next = if next > i64::from(u32::MAX) { last + 1 } else { next.min(last + 1) };
        if next > at {
            grid.drops.add_run(Reason::ImageGap, stamp_ns, (next - at) as u64);
            at = next;
            continue;
        }
        let index = at as u32;
        at += 1;
        let lidar = near(signals.lidar, stamp_ns, tolerance.lidar);
        let radar = near(signals.radar, stamp_ns, tolerance.radar);
        let control = within(signals.control, stamp_ns, nanos(tolerance.control));
        let image = near(signals.camera, stamp_ns, tolerance.camera);
        let ego = signals.ego.at(stamp_ns);
        let missing = match (&image, &ego) {
            (None, _) => Some(Reason::ImageGap),
            (_, None) => Some(Reason::EgoGap),
            _ if required.lidar && lidar.is_none() => Some(Reason::LidarGap),
            _ if required.radar && radar.is_none() => Some(Reason::RadarGap),
            _ if required.control && control.is_none() => Some(Reason::ControlGap),
            _ => None,
        };
        match (missing, image, ego) {
            (None, Some(image), Some(ego)) => {
                grid.ticks.push(Tick { index, stamp_ns, ego, image, lidar, radar, control });
            }
            (Some(reason), image, _) => {
                grid.drops.add(reason, stamp_ns, None);
                let stamp = |sample: Option<Stamped<Place>>| sample.map(|sample| sample.stamp_ns);
                grid.dropped.camera.extend(stamp(image));
                grid.dropped.lidar.extend(stamp(lidar));
                grid.dropped.radar.extend(stamp(radar));
                grid.dropped.control.extend(control.map(|sample| sample.stamp_ns));
            }
            (None, ..) => unreachable!("a missing image or ego state is a reason"),
        }
    }
    Some(grid)
}

/// From tick to tick.
pub fn period_ns(rate_hz: f64) -> i64 {
    (1e9 / rate_hz) as i64
}

/// Milliseconds to nanoseconds.
pub fn nanos(milliseconds: f64) -> i64 {
    (milliseconds * 1e6) as i64
}

fn within<T: Clone>(
    samples: &[Stamped<T>],
    stamp_ns: i64,
    tolerance_ns: i64,
) -> Option<Stamped<T>> {
    nearest(samples, stamp_ns)
        .filter(|sample| sample.stamp_ns.abs_diff(stamp_ns) <= tolerance_ns as u64)
        .cloned()
}

/// The first instant from `stamp_ns` on that has a sample within the tolerance.
fn next_with<T>(samples: &[Stamped<T>], stamp_ns: i64, tolerance_ns: i64) -> Option<i64> {
    let next = samples.partition_point(|sample| sample.stamp_ns < stamp_ns - tolerance_ns);
    Some(stamp_ns.max(samples.get(next)?.stamp_ns - tolerance_ns))
}

fn common_span(signals: &Signals, required: &Required) -> Option<(i64, i64)> {
    fn span<T>(samples: &[Stamped<T>]) -> Option<(i64, i64)> {
        Some((samples.first()?.stamp_ns, samples.last()?.stamp_ns))
    }
    let mut spans = vec![span(signals.camera)?, signals.ego.span_ns()?];
    if required.lidar {
        spans.push(span(signals.lidar)?);
    }
    if required.radar {
        spans.push(span(signals.radar)?);
    }
    if required.control {
        spans.push(span(signals.control)?);
    }
    let start_ns = spans.iter().map(|(first, _)| *first).max()?;
    let end_ns = spans.iter().map(|(_, last)| *last).min()?;
    (start_ns <= end_ns).then_some((start_ns, end_ns))
}
