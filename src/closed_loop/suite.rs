//! A suite: which episodes a policy is judged by.
//!
//! A file of towns, densities, skies and rules; the paper's DeepTest comes with the package. An episode
//! is a function of the suite's seed, its town, its density and its number.

use std::{
    fmt, fs,
    path::{Path, PathBuf},
    sync::Arc,
};

use serde::{Deserialize, Serialize};

use crate::{
    error::{Error, Result},
    map::{leaderboard, planner::Planner},
    noise::{Noise, Purpose},
    scene::conditions::Sky,
    sim::plan,
    world::{
        density::Density,
        episode::Rules,
        route::Route,
        simulation::World,
        town::{LANE_CHANGE_M, Town},
    },
};

/// Suites of the package: name, file.
const SUITES: [(&str, &str); 2] = [
    ("deeptest", include_str!("../../schemas/suites/deeptest.toml")),
    ("empty", include_str!("../../schemas/suites/empty.toml")),
];

/// Version of the keys below.
const VERSION: u32 = 1;

/// Episodes to drive.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Suite {
    pub name: String,
    pub seed: u64,
    pub rules: Rules,
    /// Shortest and longest random route, m.
    pub route_m: [f64; 2],
    pub episodes: Vec<Episode>,
}

/// An episode of a suite.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Episode {
    /// The group of tasks that it belongs to.
    pub condition: String,
    pub town: String,
    pub traffic: Density,
    pub sky: Sky,
    /// Within its town and density, from 0.
    pub number: u32,
    pub seed: u64,
    /// The file with the route, and which one of its town it is; else it is drawn.
    pub listed: Option<(PathBuf, usize)>,
}

/// How many episodes of each task to take.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Extent {
    /// As many as the suite says.
    Full,
    /// As few as it says for a quick look.
    Quick,
    Of(u32),
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    version: u32,
    name: String,
    seed: u64,
    episodes: u32,
    quick_episodes: u32,
    route_m: [f64; 2],
    #[serde(default)]
    rules: Rules,
    task: Vec<Task>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Task {
    condition: String,
    town: String,
    traffic: Vec<Density>,
    skies: Vec<String>,
    /// Routes of the CARLA leaderboard, beside the file of the suite; those of the town are driven.
    routes: Option<PathBuf>,
}

impl Suite {
    /// The suite of that name, or in that file.
    ///
    /// # Errors
    ///
    /// [`Error::Config`] if there is no such suite, a key is unknown or missing, or a value makes no
    /// sense; [`Error::Io`] if a file cannot be read; [`Error::Map`] for a file of routes.
    pub fn open(name: &str, seed: Option<u64>, extent: Extent) -> Result<Suite> {
        if let Some((_, text)) = SUITES.iter().find(|(known, _)| *known == name) {
            return Suite::parse(text, Path::new(name), seed, extent);
        }
        let path = Path::new(name);
        if !path.is_file() {
            let names = SUITES.map(|(name, _)| name).join(", ");
            let hint = format!("suites are {names}; a file is TOML, as those in schemas/suites");
            return Err(hinted(path, "neither a suite nor a file".into(), Some(hint)));
        }
        let text = fs::read_to_string(path).map_err(Error::io("read", path))?;
        Suite::parse(&text, path, seed, extent)
    }

    fn parse(text: &str, path: &Path, seed: Option<u64>, extent: Extent) -> Result<Suite> {
        let file: File = toml::from_str(text).map_err(|e| wrong(path, e.to_string()))?;
        if file.version != VERSION {
            let what = format!("version {} of suites; this pmp reads {VERSION}", file.version);
            return Err(wrong(path, what));
        }
        let File { name, rules, route_m, .. } = file;
        let is_sensible = rules.goal_m > 0.0
            && rules.slowest_kmph > 0.0
            && rules.grace_s >= 0.0
            && rules.off_route_m > 0.0
            && 0.0 < route_m[0]
            && route_m[0] < route_m[1];
        if !is_sensible {
            return Err(wrong(path, "lengths, speeds and times have to be positive".into()));
        }
        let count = match extent {
            Extent::Full => file.episodes,
            Extent::Quick => file.quick_episodes,
            Extent::Of(count) => count,
        };
        let seed = seed.unwrap_or(file.seed);
        let mut episodes = Vec::new();
        for task in &file.task {
            let skies: Vec<Sky> = task
                .skies
                .iter()
                .map(|name| {
                    Sky::from_name(name).ok_or_else(|| {
                        let hint =
                            "a sky is WEATHER-ILLUMINATION: clear-daytime, storm-dark".into();
                        hinted(path, format!("`{name}` is no sky"), Some(hint))
                    })
                })
                .collect::<Result<_>>()?;
            if skies.is_empty() || task.traffic.is_empty() {
                let what = format!("the task of {} has no skies or no traffic", task.town);
                return Err(wrong(path, what));
            }
            let routes = task.routes.as_ref().map(|file| path.with_file_name(file));
            let listed = routes.as_deref().map(|file| routes_of(file, &task.town)).transpose()?;
            let count = listed.map_or(count, |listed| count.min(listed as u32));
            for traffic in &task.traffic {
                episodes.extend((0..count).map(|number| Episode {
                    condition: task.condition.clone(),
                    town: task.town.clone(),
                    traffic: *traffic,
                    sky: skies[number as usize % skies.len()],
                    number,
                    seed,
                    listed: routes.clone().map(|file| (file, number as usize)),
                }));
            }
        }
        if episodes.is_empty() {
            return Err(wrong(path, "it has no episodes".into()));
        }
        Ok(Suite { name, seed, rules, route_m, episodes })
    }

    /// Towns that are driven in, each once, in order.
    pub fn towns(&self) -> Vec<String> {
        let mut towns: Vec<String> = self.episodes.iter().map(|e| e.town.clone()).collect();
        towns.sort();
        towns.dedup();
        towns
    }

    /// The world of an episode before its first step.
    ///
    /// # Errors
    ///
    /// [`Error::Config`] if the town has no route of the suite's lengths; [`Error::Map`] if a listed
    /// route cannot be driven.
    pub fn world(&self, town: &Town, episode: &Episode) -> Result<World> {
        let route = self.route(town, episode)?;
        let plan::Episode { seed, number, traffic, .. } = episode.planned();
        let counts = traffic.draw(&mut Noise::new(seed, number, Purpose::Scenery));
        Ok(town.world(route, counts, seed, number))
    }

    fn route(&self, town: &Town, episode: &Episode) -> Result<Arc<Route>> {
        let Some((file, at)) = &episode.listed else {
            let [shortest_m, longest_m] = self.route_m;
            let route = town.route(episode.seed, episode.number, shortest_m..longest_m);
            return route.ok_or_else(|| {
                let what = format!("{} has no route of {shortest_m} to {longest_m} m", town.name);
                wrong(Path::new(&self.name), what)
            });
        };
        let routes = leaderboard::read(file)?;
        let route = routes.iter().filter(|route| route.town == town.name).nth(*at);
        let planner = Planner::new(&town.map, LANE_CHANGE_M);
        let planned = route.map(|route| route.plan(&planner)).transpose()?;
        let route = planned.and_then(|route| Route::new(&route, &town.streets));
        route
            .map(Arc::new)
            .ok_or_else(|| wrong(file, format!("route {at} of {} has no two waypoints", town.name)))
    }
}

impl Episode {
    /// The episode as the simulator takes it. Towns and densities have their own random numbers; the
    /// route is that of the number alone.
    pub fn planned(&self) -> plan::Episode {
        plan::Episode {
            number: self.number << 2 | self.traffic as u32,
            seed: self.seed,
            town: self.town.clone(),
            sky: self.sky,
            traffic: self.traffic,
        }
    }
}

impl fmt::Display for Episode {
    /// Town, density and number: what an episode of a suite is known by.
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{}-{}-{:02}", self.town, self.traffic.name(), self.number)
    }
}

/// How many routes of a file are a town's.
fn routes_of(file: &Path, town: &str) -> Result<usize> {
    let routes = leaderboard::read(file)?.iter().filter(|route| route.town == town).count();
    if routes == 0 {
        return Err(wrong(file, format!("no route is marked {town}")));
    }
    Ok(routes)
}

fn wrong(path: &Path, what: String) -> Error {
    hinted(path, what, None)
}

fn hinted(path: &Path, what: String, hint: Option<String>) -> Error {
    Error::Config { key: format!("suite {}", path.display()), what, hint }
}
