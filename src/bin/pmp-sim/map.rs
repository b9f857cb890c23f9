//! `pmp-sim map`: what a map has.

use std::path::PathBuf;

use clap::Args;
use pmp::{
    cli::{self, Outcome},
    error::Result,
    map::{answers::MapAnswers, picture::draw, road_map::RoadMap},
    towns::scenery::{collection::Scenery, drawing::outlines},
};

/// Read an OpenDRIVE map: its figures, nearest lanes, routes and a picture of it
///
/// Places are in the map's frame: x east, y north, metres (CARLA's y has the opposite sign).
/// Lanes are named road/section/lane. Lengths and costs are counted as CARLA counts its
/// waypoints, between the first and the last half metre of each lane.
#[derive(Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Map {
    /// OpenDRIVE file
    #[arg(value_name = "FILE.xodr")]
    file: PathBuf,

    /// Print JSON; answers to --points and --routes are in it as `points` and `routes`
    #[arg(long)]
    json: bool,

    /// Find the nearest driving lane to each place of a file: [[x, y], ...]
    #[arg(long, value_name = "FILE.json")]
    points: Option<PathBuf>,

    /// Plan the ways of a file: [{"start": "road/section/lane", "goal": "road/section/lane",
    /// "lane_change_m": 30.0}, ...], from lane start to lane start
    #[arg(long, value_name = "FILE.json")]
    routes: Option<PathBuf>,

    /// Draw the map, north up; SVG or PNG by the ending of the name. Replaces what is there
    #[arg(long, value_name = "FILE.png|svg")]
    picture: Option<PathBuf>,

    /// Draw the buildings, trees and fields of this seed as well
    #[arg(long, value_name = "SEED", requires = "picture")]
    scenery: Option<u64>,
}

const EXAMPLES: &str = "\
Examples:
  pmp-sim map Town01.xodr                                what the map has
  pmp-sim map Town01.xodr --picture Town01.png           and what it looks like
  pmp-sim map Town01.xodr --picture Town01.png --scenery 1   with houses and trees
  pmp-sim map Town01.xodr --json --points places.json    the lanes that places lie on

JSON goes to stdout, notes on what was mended or left out to stderr.

Exit codes: 0 done; 1 error; 2 bad usage";

pub(crate) fn run(args: Map) -> Result<Outcome> {
    let Map { file, json, points, routes, picture, scenery } = args;
    let map = RoadMap::read(&file)?;
    let mut answers = MapAnswers::new(&map);
    if let Some(points) = points {
        answers = answers.with_points(&map, &points)?;
    }
    if let Some(routes) = routes {
        answers = answers.with_routes(&map, &routes)?;
    }
    if let Some(picture) = picture {
        let beside = scenery.map(|seed| outlines(&Scenery::derive(&map, seed)));
        draw(&map, &beside.unwrap_or_default(), &picture)?;
    }
    for note in map.notes() {
        eprintln!("note: {note}");
    }
    cli::print(&if json { answers.json() } else { answers.text(&map) })?;
    Ok(Outcome::Done)
}
