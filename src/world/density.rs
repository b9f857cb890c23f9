//! How much traffic: the paper's levels (table II; "few" has no numbers there and is ours).

use std::ops::RangeInclusive;

use clap::ValueEnum;
use serde::{Deserialize, Serialize};

use crate::noise::Noise;

/// A level of traffic.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, ValueEnum, Serialize, Deserialize,
)]
#[serde(rename_all = "kebab-case")]
pub enum Density {
    Empty,
    Few,
    Regular,
    Dense,
}

/// Agents of an episode.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Counts {
    pub vehicles: usize,
    pub walkers: usize,
}

impl Density {
    pub const ALL: [Density; 4] = [Density::Empty, Density::Few, Density::Regular, Density::Dense];

    /// As the dataset's column `traffic` has it.
    pub fn name(self) -> &'static str {
        match self {
            Density::Empty => "empty",
            Density::Few => "few",
            Density::Regular => "regular",
            Density::Dense => "dense",
        }
    }

    /// How many vehicles and pedestrians there may be.
    pub fn ranges(self) -> (RangeInclusive<usize>, RangeInclusive<usize>) {
        match self {
            Density::Empty => (0..=0, 0..=0),
            Density::Few => (20..=20, 20..=20),
            Density::Regular => (60..=60, 40..=75),
            Density::Dense => (80..=120, 60..=150),
        }
    }

    /// Numbers of an episode, each as likely.
    pub fn draw(self, noise: &mut Noise) -> Counts {
        let (vehicles, walkers) = self.ranges();
        let mut draw = |range: RangeInclusive<usize>| {
            let (low, high) = (*range.start() as f64, *range.end() as f64);
            (noise.uniform(low, high + 1.0) as usize).min(*range.end())
        };
        Counts { vehicles: draw(vehicles), walkers: draw(walkers) }
    }
}
