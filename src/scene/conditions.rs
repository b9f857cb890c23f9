//! Light and weather, in the words of the paper (section III.B) and of the dataset's columns.

use clap::ValueEnum;
use serde::{Deserialize, Serialize};

/// Where the light comes from.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, ValueEnum, Serialize, Deserialize,
)]
#[serde(rename_all = "kebab-case")]
pub enum Illumination {
    Daytime,
    Sunset,
    /// Moon and street lamps.
    Night,
    /// The head lamps alone.
    Dark,
}

/// What falls from the sky.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, ValueEnum, Serialize, Deserialize,
)]
#[serde(rename_all = "kebab-case")]
pub enum Weather {
    Clear,
    Drizzle,
    Rainy,
    Storm,
}

impl Illumination {
    pub const ALL: [Illumination; 4] =
        [Illumination::Daytime, Illumination::Sunset, Illumination::Night, Illumination::Dark];

    /// As the dataset's column `illumination` has it.
    pub fn name(self) -> &'static str {
        match self {
            Illumination::Daytime => "daytime",
            Illumination::Sunset => "sunset",
            Illumination::Night => "night",
            Illumination::Dark => "dark",
        }
    }
}

impl Weather {
    pub const ALL: [Weather; 4] =
        [Weather::Clear, Weather::Drizzle, Weather::Rainy, Weather::Storm];

    /// As the dataset's column `weather` has it.
    pub fn name(self) -> &'static str {
        match self {
            Weather::Clear => "clear",
            Weather::Drizzle => "drizzle",
            Weather::Rainy => "rainy",
            Weather::Storm => "storm",
        }
    }

    /// How hard it rains, in [0, 1].
    pub fn rain(self) -> f64 {
        match self {
            Weather::Clear => 0.0,
            Weather::Drizzle => 0.25,
            Weather::Rainy => 0.6,
            Weather::Storm => 1.0,
        }
    }
}

/// Light and weather of an episode.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
pub struct Sky {
    pub illumination: Illumination,
    pub weather: Weather,
}

impl Sky {
    /// The sky of a name: weather, then illumination, as `storm-dark`.
    pub fn from_name(name: &str) -> Option<Sky> {
        let (weather, illumination) = name.split_once('-')?;
        Some(Sky {
            illumination: Illumination::ALL.into_iter().find(|i| i.name() == illumination)?,
            weather: Weather::ALL.into_iter().find(|w| w.name() == weather)?,
        })
    }
}
