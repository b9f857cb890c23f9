//! A town left to itself, to know whether its traffic can be trusted: run, counted and told.

use std::fmt;

use glam::DVec2;
use serde::{Deserialize, Serialize};

use crate::{
    noise::{Noise, Purpose},
    world::{
        census::{Census, Minute, Tally},
        density::Counts,
        snapshot::{VehicleState, hash, vehicle_states, walker_states},
        spread::Quantiles,
        streets::Streets,
        traffic::{STEP_S, Traffic},
        walkers::Walkers,
    },
};

/// What is run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RushHour {
    pub counts: Counts,
    pub minutes: u32,
    pub seed: u64,
}

/// A town's run, counted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Report {
    pub town: String,
    pub seed: u64,
    /// Agents that there were: fewer than were asked for where the town has no room.
    pub counts: Counts,
    #[serde(flatten)]
    pub tally: Tally,
    /// Of the last state.
    pub hash: u64,
}

impl RushHour {
    /// Steps of the agents in a minute.
    pub fn steps_per_minute(&self) -> u64 {
        (60.0 / STEP_S) as u64
    }

    /// Run a town without an ego vehicle; `on_minute` is called after each minute.
    pub fn run(&self, town: &str, streets: &Streets, on_minute: &dyn Fn()) -> Report {
        let RushHour { counts, minutes, seed } = *self;
        let mut noise = Noise::new(seed, 0, Purpose::Traffic);
        let actor = |id| Noise::of_actor(seed, 0, id);
        let nobody_m = DVec2::INFINITY;
        let mut traffic =
            Traffic::spawn(streets, counts.vehicles, nobody_m, 0.0, &mut noise, actor);
        let mut walkers = Walkers::spawn(streets, counts.walkers, &mut noise, actor);
        let mut vehicles = vehicle_states(streets, &traffic);
        let mut people = walker_states(&walkers);
        let mut census = Census::default();
        for _ in 0..minutes {
            for _ in 0..self.steps_per_minute() {
                let hazards: Vec<_> = walkers.hazards().collect();
                let seen: Vec<_> = vehicles.iter().map(VehicleState::seen).collect();
                traffic.step(streets, None, &hazards);
                walkers.step(streets, &seen);
                vehicles = vehicle_states(streets, &traffic);
                people = walker_states(&walkers);
                census.count(streets, &traffic, &walkers, &vehicles, &people);
            }
            on_minute();
        }
        Report {
            town: town.to_string(),
            seed,
            counts: Counts { vehicles: vehicles.len(), walkers: people.len() },
            tally: census.tally(walkers.crossings),
            hash: hash(&[f64::from(minutes)], &vehicles, &people),
        }
    }
}

impl Report {
    /// Touches per 1000 km driven: between vehicles, and with people.
    pub fn touches_per_1000_km(&self) -> [f64; 2] {
        let tally = &self.tally;
        let counts = [tally.touches_between_vehicles.len(), tally.touches_with_walkers.len()];
        counts.map(|count| count as f64 / tally.driven_km.max(f64::MIN_POSITIVE) * 1000.0)
    }
}

/// Values as a row of bars, the highest one being `most`.
fn bars(values: impl Iterator<Item = f64>, most: f64) -> String {
    const BARS: [char; 8] = ['▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];
    let bar = |value: f64| BARS[((value / most * 8.0) as usize).min(7)];
    values.map(bar).collect()
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Report { town, counts, tally, seed, hash } = self;
        let (minutes, people) = (&tally.minutes, counts.walkers);
        writeln!(
            f,
            "{town}: {} vehicles, {people} on foot, {} min, seed {seed}",
            counts.vehicles,
            minutes.len()
        )?;
        let mean = |of: fn(&Minute) -> f64| {
            minutes.iter().map(of).sum::<f64>() / minutes.len().max(1) as f64
        };
        let most = |of: fn(&Minute) -> f64| minutes.iter().map(of).fold(0.0, f64::max);
        let speed = |minute: &Minute| minute.mean_speed_mps;
        let stopped = |minute: &Minute| minute.stopped_share;
        writeln!(
            f,
            "  mean speed       {:6.2} m/s        {}",
            mean(speed),
            bars(minutes.iter().map(speed), most(speed).max(1e-9))
        )?;
        writeln!(
            f,
            "  stopped          {:6.1} %, most {:.0} % {}",
            100.0 * mean(stopped),
            100.0 * most(stopped),
            bars(minutes.iter().map(stopped), 1.0)
        )?;
        let [vehicles, with_walkers] = self.touches_per_1000_km();
        writeln!(f, "  driven           {:6.1} km", tally.driven_km)?;
        writeln!(
            f,
            "  touches          {} between vehicles ({vehicles:.1} per 1000 km), {} with people ({with_walkers:.1})",
            tally.touches_between_vehicles.len(),
            tally.touches_with_walkers.len()
        )?;
        let quantiles = |of: &Option<Quantiles>| match of {
            None => "none seen".to_string(),
            Some(Quantiles { count, p05, median, p95 }) => {
                format!("{median:.2} (5 % {p05:.2}, 95 % {p95:.2}; {count} looks)")
            }
        };
        writeln!(f, "  gaps, m          {}", quantiles(&tally.gaps_m))?;
        writeln!(f, "  time gaps, s     {}", quantiles(&tally.time_gaps_s))?;
        writeln!(f, "  gaps to theory   {}", quantiles(&tally.steady_gaps_to_theory))?;
        writeln!(f, "  speed to limit   {} on free lanes", quantiles(&tally.free_speed_to_limit))?;
        let [minute, three, five] = tally.long_stands;
        writeln!(
            f,
            "  long stands      {minute} of 60 s, {three} of 180 s, {five} of 300 s; longest {:.0} s",
            tally.longest_stand_s
        )?;
        writeln!(f, "  lane changes     {}", tally.lane_changes)?;
        let (all, hard) = (&tally.crossings, &tally.hard_braking_for);
        writeln!(
            f,
            "  crossings        {} careful, {} without notice; hard braking for {} and {}",
            all.careful, all.without_notice, hard.careful, hard.without_notice
        )?;
        writeln!(f, "  hash             {hash:016x}")
    }
}
