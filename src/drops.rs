//! What was left out, why, and how often: partial failure as data.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// Why something is not in the dataset. The order here is the order in reports.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Reason {
    /// No picture within the tolerance of the tick.
    ImageGap,
    /// A picture that cannot be decoded.
    ImageDamaged,
    /// A picture of a video that begins with a later key frame.
    ImageBeforeKeyFrame,
    /// The ego motion has a gap around the tick.
    EgoGap,
    /// A required lidar, radar or control has no sample within the tolerance.
    LidarGap,
    RadarGap,
    ControlGap,
}

impl Reason {
    pub const ALL: [Reason; 7] = [
        Reason::ImageGap,
        Reason::ImageDamaged,
        Reason::ImageBeforeKeyFrame,
        Reason::EgoGap,
        Reason::LidarGap,
        Reason::RadarGap,
        Reason::ControlGap,
    ];

    /// The name in reports and columns.
    pub fn name(self) -> &'static str {
        match self {
            Reason::ImageGap => "image_gap",
            Reason::ImageDamaged => "image_damaged",
            Reason::ImageBeforeKeyFrame => "image_before_key_frame",
            Reason::EgoGap => "ego_gap",
            Reason::LidarGap => "lidar_gap",
            Reason::RadarGap => "radar_gap",
            Reason::ControlGap => "control_gap",
        }
    }
}

/// How often, and where first.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Drop {
    pub count: u64,
    /// Stamp of the first, ns since the Unix epoch.
    pub first_ns: i64,
    /// What was wrong with the first, where there is more to say than the reason.
    pub example: Option<String>,
}

/// Ticks that did not become frames.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Drops(BTreeMap<Reason, Drop>);

impl Drops {
    /// Count one.
    pub fn add(&mut self, reason: Reason, stamp_ns: i64, example: Option<String>) {
        let drop = self.0.entry(reason).or_insert(Drop { count: 0, first_ns: stamp_ns, example });
        drop.count += 1;
        drop.first_ns = drop.first_ns.min(stamp_ns);
    }

    /// Count many in a row, of which the first is at `first_ns`.
    pub fn add_run(&mut self, reason: Reason, first_ns: i64, count: u64) {
        if count > 0 {
            self.add(reason, first_ns, None);
            self.0.entry(reason).and_modify(|drop| drop.count += count - 1);
        }
    }

    /// Count what was counted elsewhere.
    pub fn extend(&mut self, other: &Drops) {
        for (reason, drop) in &other.0 {
            let sum = self.0.entry(*reason).or_insert(Drop { count: 0, ..drop.clone() });
            sum.count += drop.count;
        }
    }

    pub fn count(&self, reason: Reason) -> u64 {
        self.0.get(&reason).map_or(0, |drop| drop.count)
    }

    pub fn total(&self) -> u64 {
        self.0.values().map(|drop| drop.count).sum()
    }

    /// By reason, in the order of [`Reason`].
    pub fn iter(&self) -> impl Iterator<Item = (Reason, &Drop)> {
        self.0.iter().map(|(reason, drop)| (*reason, drop))
    }
}
