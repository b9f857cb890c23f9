//! The plan of a collection: which episodes, each a function of (seed, number, what there is to choose
//! from).
//!
//! Towns, weathers, illuminations and densities take turns. Whatever the number of episodes, each
//! value of one of them comes as often as every other, up to one; after as many episodes as there are
//! combinations, each combination has come once. A longer plan begins with the shorter one.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::{
    frame::Conditions,
    noise::{Noise, Purpose},
    scene::conditions::{Illumination, Sky, Weather},
    world::density::Density,
};

/// What the paper trained in (section III.B): five towns, three weathers, three illuminations and
/// four densities.
pub const TRAINING_TOWNS: [&str; 5] = ["Town01", "Town02", "Town03", "Town04", "Town05"];
pub const TRAINING_WEATHERS: [Weather; 3] = [Weather::Clear, Weather::Drizzle, Weather::Rainy];
pub const TRAINING_ILLUMINATIONS: [Illumination; 3] =
    [Illumination::Daytime, Illumination::Sunset, Illumination::Night];

/// What the episodes of a collection are drawn from. No list is empty.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    pub seed: u64,
    pub towns: Vec<String>,
    pub weathers: Vec<Weather>,
    pub illuminations: Vec<Illumination>,
    pub densities: Vec<Density>,
}

impl Plan {
    /// The paper's training conditions.
    pub fn training(seed: u64) -> Plan {
        Plan {
            seed,
            towns: TRAINING_TOWNS.map(str::to_string).to_vec(),
            weathers: TRAINING_WEATHERS.to_vec(),
            illuminations: TRAINING_ILLUMINATIONS.to_vec(),
            densities: Density::ALL.to_vec(),
        }
    }

    /// An episode of the plan.
    pub fn episode(&self, number: u32) -> Episode {
        let sizes =
            [self.weathers.len(), self.illuminations.len(), self.densities.len(), self.towns.len()];
        let turn = number as usize;
        let [weather, illumination, density, town] = turns(turn, sizes);
        // The order of the values is the seed's, and another one in each round of combinations.
        let round = (turn / sizes.iter().product::<usize>()) as u32;
        let mut noise = Noise::new(self.seed, round, Purpose::Plan);
        let [weathers, illuminations, densities, towns] = sizes.map(|size| order(size, &mut noise));
        Episode {
            number,
            seed: self.seed,
            town: self.towns[towns[town]].clone(),
            sky: Sky {
                illumination: self.illuminations[illuminations[illumination]],
                weather: self.weathers[weathers[weather]],
            },
            traffic: self.densities[densities[density]],
        }
    }

    /// The first episodes of the plan.
    pub fn episodes(&self, count: u32) -> Vec<Episode> {
        (0..count).map(|number| self.episode(number)).collect()
    }
}

/// Which value of each list has its turn.
///
/// Every list goes round and round. Two lists whose lengths have a common divisor would always meet
/// in the same pairs; so a list moves on by one more whenever it has met all that it can meet of the
/// lists before it, which is at the end of one of its own rounds.
fn turns<const N: usize>(turn: usize, sizes: [usize; N]) -> [usize; N] {
    let mut before = 1;
    sizes.map(|size| {
        let met = lcm(before, size);
        before *= size;
        (turn + turn / met % (before / met)) % size
    })
}

fn lcm(a: usize, b: usize) -> usize {
    let (mut x, mut y) = (a, b);
    while y > 0 {
        (x, y) = (y, x % y);
    }
    a / x * b
}

/// A random order of that many values.
fn order(size: usize, noise: &mut Noise) -> Vec<usize> {
    let mut order: Vec<usize> = (0..size).collect();
    for last in (1..size).rev() {
        order.swap(last, (noise.uniform(0.0, last as f64 + 1.0) as usize).min(last));
    }
    order
}

/// One drive of a collection.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Episode {
    /// In the plan, from 0; with the seed it decides the route, who is on the streets, and all noise.
    pub number: u32,
    pub seed: u64,
    pub town: String,
    pub sky: Sky,
    pub traffic: Density,
}

impl Episode {
    /// Stamp of its first step, ns since the Unix epoch: episodes start an hour apart, so that no two
    /// of a collection lie over each other. ROS can say times until 2038.
    pub fn start_ns(&self) -> i64 {
        const START_NS: i64 = 1_750_000_000_000_000_000;
        const APART_NS: i64 = 3_600_000_000_000;
        START_NS + i64::from(self.number) * APART_NS
    }

    /// What a log tells of its drive.
    pub fn conditions(&self) -> Conditions {
        Conditions {
            town: Some(self.town.clone()),
            weather: Some(self.sky.weather.name().to_string()),
            illumination: Some(self.sky.illumination.name().to_string()),
            traffic: Some(self.traffic.name().to_string()),
        }
    }

    /// Of its log.
    pub fn file_name(&self) -> String {
        format!("{self}.mcap")
    }
}

impl fmt::Display for Episode {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let Episode { number, town, sky: Sky { illumination, weather }, traffic, .. } = self;
        let (weather, illumination, traffic) =
            (weather.name(), illumination.name(), traffic.name());
        write!(f, "{town}-{weather}-{illumination}-{traffic}-{number:04}")
    }
}
