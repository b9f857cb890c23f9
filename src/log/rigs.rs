//! Rigs: cars, bridges and converters whose topic names are known.
//!
//! Each is a file of `schemas/profiles/`, compiled in. What a rig says is a preference: where one
//! of its topics is not in the log, the signal is found by type.

use serde::Deserialize;

use crate::log::{
    conventions::{ControlRule, EgoRule, RadarRule},
    topics::{Names, Topics, matches},
};

/// Name and text of every rig, in the order in which they are tried on a log.
const FILES: [(&str, &str); 6] = [
    ("carla-ros-bridge", include_str!("../../schemas/profiles/carla-ros-bridge.toml")),
    ("nuscenes2mcap", include_str!("../../schemas/profiles/nuscenes2mcap.toml")),
    ("kitti", include_str!("../../schemas/profiles/kitti.toml")),
    ("autoware", include_str!("../../schemas/profiles/autoware.toml")),
    ("pmp", include_str!("../../schemas/profiles/pmp.toml")),
    ("comma", include_str!("../../schemas/profiles/comma.toml")),
];

/// What is known of a rig.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rig {
    #[serde(skip)]
    pub name: &'static str,
    /// What it is, for `--help`.
    pub about: String,
    pub recognise: Recognise,
    #[serde(default)]
    pub topics: Topics,
    #[serde(default)]
    pub ego: EgoRule,
    #[serde(default)]
    pub radar: RadarRule,
    #[serde(default)]
    pub control: ControlRule,
}

/// What a log of the rig has without fail, and no log of another rig.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Recognise {
    /// Of each of these, one is there.
    pub topics: Vec<Names>,
}

impl Rig {
    /// Names of all rigs.
    pub fn names() -> impl Iterator<Item = &'static str> {
        FILES.iter().map(|(name, _)| *name)
    }

    /// The rig of that name.
    pub fn named(name: &str) -> Option<Rig> {
        let (name, text) = FILES.iter().find(|(known, _)| *known == name)?;
        // A file that does not parse is found by the tests, which read them all.
        let mut rig: Rig = toml::from_str(text).ok()?;
        rig.name = name;
        Some(rig)
    }

    /// The first rig that could have written a log with these topics.
    pub fn of_log(topics: &[&str]) -> Option<Rig> {
        Rig::names().filter_map(Rig::named).find(|rig| {
            let has = |name: &str| topics.iter().any(|topic| matches(name, topic));
            rig.recognise.topics.iter().all(|names| names.iter().any(has))
        })
    }
}
