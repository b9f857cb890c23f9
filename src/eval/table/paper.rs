//! The paper's own table I, as a reference beside what was driven, or alone.

use serde::Deserialize;

use crate::{
    error::{Error, Result},
    eval::table::report::{Cell, Estimate, Source, System, Task},
};

const PRINTED: &str = include_str!("paper.json");

/// The paper's conditions in its order, as [`plain`] writes them.
const CONDITIONS: [&str; 4] = ["training", "newweather", "newtown", "newtownweather"];

#[derive(Deserialize)]
struct Printed {
    episodes_per_task: u64,
    conditions: Vec<Place>,
    traffic: Vec<String>,
    systems: Vec<PrintedSystem>,
}

#[derive(Deserialize)]
struct Place {
    condition: String,
    town: String,
}

#[derive(Deserialize)]
struct PrintedSystem {
    name: String,
    sr: Vec<u64>,
    wl: Vec<f64>,
    ovsp: Vec<Option<f64>>,
}

/// The paper's table.
#[derive(Clone, Debug)]
pub struct Paper {
    pub tasks: Vec<Task>,
    /// With `sr`, `wl` and `ovsp_success` of each task, and `sr` of all together.
    pub systems: Vec<System>,
}

/// Where a condition stands among the paper's; others come behind.
pub fn rank(condition: &str) -> usize {
    let plain = plain(condition);
    CONDITIONS.iter().position(|known| *known == plain).unwrap_or(CONDITIONS.len())
}

/// Whether two tasks are the same in other words: `New town & weather` is `new-town-and-weather`.
fn alike(a: &Task, b: &Task) -> bool {
    let of = |task: &Task| (plain(&task.condition), plain(&task.town), plain(&task.traffic));
    of(a) == of(b)
}

fn plain(text: &str) -> String {
    let text = text.to_lowercase();
    let words = text.split(|c: char| !c.is_alphanumeric());
    words.filter(|word| !["and", "condition", "conditions"].contains(word)).collect()
}

/// Successes in `n` episodes of a rate that was cut to whole per cents.
///
/// The least `k` with `100 k / n` not below it; for fewer than 100 episodes there is no other.
pub fn successes(floored_percent: u64, n: u64) -> u64 {
    (floored_percent * n).div_ceil(100)
}

impl Paper {
    /// The fixture.
    ///
    /// # Errors
    ///
    /// [`Error::Json`] if it cannot be read, which only a bug can bring about.
    pub fn table() -> Result<Paper> {
        let printed: Printed =
            serde_json::from_str(PRINTED).map_err(Error::json("src/eval/table/paper.json"))?;
        let task = |place: &Place, traffic: &String| Task {
            condition: place.condition.clone(),
            town: place.town.clone(),
            traffic: traffic.clone(),
        };
        let of_place = |place| printed.traffic.iter().map(move |traffic| task(place, traffic));
        let tasks: Vec<Task> = printed.conditions.iter().flat_map(of_place).collect();
        let n = printed.episodes_per_task;
        let systems = printed.systems.iter().map(|system| of_system(system, n)).collect();
        Ok(Paper { tasks, systems })
    }

    /// The systems over those tasks alone, in their order; a task that the paper does not have is a
    /// cell of no episodes.
    pub fn over(&self, tasks: &[Task]) -> Vec<System> {
        let place = |task: &Task| self.tasks.iter().position(|own| alike(own, task));
        let places: Vec<Option<usize>> = tasks.iter().map(place).collect();
        let of_system = |system: &System| {
            let cell = |place: &Option<usize>| {
                place.and_then(|i| system.tasks.get(i)).cloned().unwrap_or_default()
            };
            let tasks: Vec<Cell> = places.iter().map(cell).collect();
            System { pooled: pooled(&tasks), tasks, ..system.clone() }
        };
        self.systems.iter().map(of_system).collect()
    }
}

fn of_system(system: &PrintedSystem, n: u64) -> System {
    let printed = |value: Option<f64>, n: u64| Estimate { value, n, ..Estimate::default() };
    let cells = system.sr.iter().zip(&system.wl).zip(&system.ovsp);
    let cells = cells.map(|((&sr, &wl), &ovsp)| {
        let k = successes(sr, n);
        let metrics = [
            ("sr", Estimate::share(k, n)),
            ("wl", printed(Some(wl), n)),
            ("ovsp_success", printed(ovsp, k)),
        ];
        let metrics = metrics.map(|(key, estimate)| (key.to_string(), estimate));
        Cell { episodes: n, metrics: metrics.into(), ..Cell::default() }
    });
    let tasks: Vec<Cell> = cells.collect();
    System {
        name: system.name.clone(),
        source: Source::Paper,
        seeds: Vec::new(),
        pooled: pooled(&tasks),
        tasks,
        conditions: Default::default(),
        touched: Default::default(),
    }
}

/// Success over all; the paper does not say how long each task was driven, so no time is pooled.
fn pooled(tasks: &[Cell]) -> Cell {
    let episodes = tasks.iter().map(|cell| cell.episodes).sum();
    let k = tasks.iter().filter_map(|cell| cell.of("sr").k).sum();
    let metrics = [("sr".to_string(), Estimate::share(k, episodes))];
    Cell { episodes, metrics: metrics.into(), ..Cell::default() }
}
