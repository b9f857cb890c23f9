//! Towns to drive in: the package's own, or OpenDRIVE files in their place.

use std::{fs, ops::Range, path::Path, sync::Arc};

use crate::{
    atomic::file_name,
    error::{Error, Result},
    map::{planner::Planner, reader, road_map::RoadMap, route::MapRoute},
    towns::{catalogue, scenery::collection::Scenery},
    world::{
        density::Counts,
        ego::{Car, SEDAN},
        paving::pave,
        route::Route,
        simulation::{Start, World},
        streets::Streets,
    },
};

/// Lengths of routes, m (paper, section III.B).
pub const LENGTHS_M: Range<f64> = 350.0..1500.0;

/// What a lane change costs the planner, m.
pub const LANE_CHANGE_M: f64 = 30.0;

/// Routes that are drawn before a town counts as one without any.
const ATTEMPTS: u64 = 64;

/// Scenery is the same in all episodes of a town.
const SCENERY_SEED: u64 = 0;

/// A town, ready to be driven in.
#[derive(Clone, Debug)]
pub struct Town {
    pub name: String,
    pub map: Arc<RoadMap>,
    pub streets: Arc<Streets>,
    pub scenery: Arc<Scenery>,
}

impl Town {
    /// A map with the scenery that it is given.
    pub fn new(name: String, map: RoadMap) -> Town {
        let streets = Arc::new(pave(&map));
        let scenery = Arc::new(Scenery::derive(&map, SCENERY_SEED));
        Town { name, map: Arc::new(map), streets, scenery }
    }

    /// Towns by name, all if none is named: the files `NAME.xodr` of a folder, or the package's own.
    ///
    /// # Errors
    ///
    /// [`Error::Config`] if there is no town of a name, with those that there are; if a map cannot
    /// be read, as [`RoadMap::read`].
    pub fn choose(maps: Option<&Path>, names: &[String]) -> Result<Vec<Town>> {
        Town::names(maps, names)?.iter().map(|name| Town::open(maps, name)).collect()
    }

    /// Names of the towns that are asked for, all if none is, in order and each once.
    ///
    /// # Errors
    ///
    /// [`Error::Config`] if there is no town of a name, with those that there are.
    pub fn names(maps: Option<&Path>, names: &[String]) -> Result<Vec<String>> {
        let known = match maps {
            None => catalogue::plans().iter().map(|plan| plan.name.to_string()).collect(),
            Some(folder) => names_in(folder)?,
        };
        if let Some(unknown) = names.iter().find(|name| !known.contains(name)) {
            return Err(Error::Config {
                key: "--town".into(),
                what: format!("there is no town `{unknown}`"),
                hint: Some(format!("there are {}", known.join(", "))),
            });
        }
        Ok(known.into_iter().filter(|name| names.is_empty() || names.contains(name)).collect())
    }

    /// The route of an episode: any with a length within `lengths_m` that keeps to its lanes. `None`
    /// if the town seems to have none.
    pub fn route(&self, seed: u64, episode: u32, lengths_m: Range<f64>) -> Option<Arc<Route>> {
        let planner = Planner::new(&self.map, LANE_CHANGE_M);
        let draw = |attempt: u64| {
            let seed = seed << 32 | u64::from(episode) << 8 | attempt;
            let route = MapRoute::random(&planner, seed, lengths_m.clone())?;
            Route::new(&route, &self.streets).filter(|route| !route.strays())
        };
        (0..ATTEMPTS).find_map(draw).map(Arc::new)
    }

    /// The town with a car at rest where a route begins, and with agents.
    pub fn world(&self, route: Arc<Route>, counts: Counts, seed: u64, episode: u32) -> World {
        let start_m = route.waypoints()[0].position_m;
        World::new(Start {
            streets: self.streets.clone(),
            scenery: self.scenery.clone(),
            ego: Car::at_rest(SEDAN, start_m, route.forward(0.0).to_angle()),
            route,
            counts,
            seed,
            episode,
        })
    }

    /// A town by its name: the file `NAME.xodr` of a folder, or one of the package's own.
    ///
    /// # Errors
    ///
    /// If its map cannot be read, as [`RoadMap::read`].
    pub fn open(maps: Option<&Path>, name: &str) -> Result<Town> {
        let map = match maps {
            Some(folder) => RoadMap::read(&folder.join(format!("{name}.xodr")))?,
            None => {
                let plans = catalogue::plans();
                let plan = plans.iter().find(|plan| plan.name == name);
                let text = plan.map(catalogue::text).transpose()?.unwrap_or_default();
                RoadMap::new(reader::parse(name.as_ref(), &text)?)
            }
        };
        Ok(Town::new(name.to_string(), map))
    }
}

/// Names of the maps in a folder, in order.
fn names_in(folder: &Path) -> Result<Vec<String>> {
    let mut names = Vec::new();
    for entry in fs::read_dir(folder).map_err(Error::io("read", folder))? {
        let path = entry.map_err(Error::io("read", folder))?.path();
        names.extend(file_name(&path).strip_suffix(".xodr").map(str::to_string));
    }
    names.sort();
    if names.is_empty() {
        return Err(Error::Config {
            key: "--maps".into(),
            what: format!("no .xodr file in {}", folder.display()),
            hint: Some("`pmp-sim towns --out DIR` writes seven".into()),
        });
    }
    Ok(names)
}
