//! Real towns against what CARLA says about them, and `pmp-sim map` as a process.

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::{Path, PathBuf},
};

use assert_cmd::Command;
use glam::{DVec2, DVec3};
use pmp::{
    frame,
    map::{leaderboard, planner::Planner, road_map::RoadMap, route::MapRoute},
};
use serde_json::{Value, json};
use tempfile::tempdir;

use crate::fixtures::shared;

const TOWNS: [&str; 3] = ["Town01", "Town02", "Town04"];

struct Town {
    name: &'static str,
    file: PathBuf,
    map: RoadMap,
    facts: Value,
}

/// The towns whose maps and facts are there.
fn towns() -> impl Iterator<Item = Town> {
    TOWNS.into_iter().filter_map(|name| {
        let facts = shared(&format!("facts/carla_{name}.json"))?;
        let file = shared(&format!("maps/{name}.xodr"))?;
        let facts = serde_json::from_slice(&fs::read(facts).unwrap()).unwrap();
        Some(Town { name, map: RoadMap::read(&file).unwrap(), file, facts })
    })
}

fn list(value: &Value) -> &[Value] {
    value.as_array().unwrap()
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

/// A place of CARLA's world in the map's frame.
fn place(xyz: &Value) -> DVec3 {
    DVec3::new(number(&xyz[0]), -number(&xyz[1]), number(&xyz[2]))
}

fn name(waypoint: &Value) -> String {
    format!("{}/{}/{}", waypoint["road"], waypoint["section"], waypoint["lane"])
}

fn near_percent(ours: f64, theirs: f64) -> bool {
    (ours / theirs - 1.0).abs() < 0.01
}

#[test]
fn lane_places_are_carlas_to_5_mm_and_headings_to_a_tenth_of_a_degree() {
    for Town { name: town, map, facts, .. } in towns() {
        for fact in list(&facts["xodr_points"]) {
            let got = &fact["got"];
            let lane = map.find(&name(got)).unwrap()[0];
            let centre = map.centre(lane, number(&got["s"]));
            let off_m = centre.position_m.distance(place(&got["xyz"]));
            assert!(off_m < 0.005, "{town} {got}: {off_m} m off");
            assert!((centre.width_m - number(&got["width"])).abs() < 0.01, "{town} {got}");
            let back = if map.lane(lane).along_s { 0.0 } else { 180.0 };
            let turned = centre.heading_rad.to_degrees() + back + number(&got["yaw"]);
            let off_deg = (turned + 180.0).rem_euclid(360.0) - 180.0;
            assert!(off_deg.abs() < 0.1, "{town} {got}: {off_deg} degrees off");
        }
    }
}

#[test]
fn lanes_are_as_many_and_as_long_as_carlas() {
    for Town { name: town, file, facts, map } in towns() {
        let answer = answer(&file, &[]);
        assert_eq!(answer["roads"], facts["xml"]["roads"], "{town}");
        assert_eq!(answer["junctions"], facts["xml"]["junctions"], "{town}");
        let carla = &facts["carla"];
        assert_eq!(answer["driving_lanes"], carla["driving_lanes"], "{town}");
        for key in ["driving_lane_length", "driving_lane_length_in_junctions"] {
            let (ours, theirs) = (number(&answer[format!("{key}_m")]), number(&carla[key]));
            assert!((ours / theirs - 1.0).abs() < 1e-4, "{town} {key}: {ours} {theirs}");
        }
        let exact_m: f64 = map.graph().lanes().iter().map(|lane| lane.length_m).sum();
        assert!(near_percent(exact_m, number(&carla["driving_lane_length"])), "{town} {exact_m}");
    }
}

#[test]
fn nearest_lanes_agree_where_lanes_do_not_overlap() {
    for Town { name: town, map, facts, .. } in towns() {
        let (mut agree, mut unexplained) = (0, Vec::new());
        for fact in list(&facts["points"]) {
            let place_m = place(&fact["q"]).truncate();
            let theirs = &fact["nearest_driving"];
            let ours = map.nearest(place_m).unwrap();
            if map.name(ours.lane) == name(theirs) {
                agree += 1;
                continue;
            }
            // CARLA measures to a polyline, and in space where we look from above.
            let their_m = place(&theirs["xyz"]).truncate().distance(place_m);
            println!(
                "{town} {place_m}: {} at {:.4} m, CARLA has {} at {their_m:.4} m",
                map.name(ours.lane),
                ours.distance_m,
                name(theirs)
            );
            if ours.distance_m > their_m + 1e-3 {
                unexplained.push(place_m);
            }
        }
        assert!(agree >= 190, "{town}: {agree} of 200 agree");
        assert_eq!(unexplained, [DVec2::ZERO; 0], "{town}: CARLA's lane is nearer");
    }
}

#[test]
fn successors_and_lane_changes_are_carlas() {
    for Town { name: town, map, facts, .. } in towns() {
        let lanes = facts["lane_graph"].as_object().unwrap();
        let found = |names: &Value| -> BTreeSet<usize> {
            list(names)
                .iter()
                .flat_map(|n| map.find(n.as_str().unwrap()).unwrap())
                .copied()
                .collect()
        };
        let mut compared = 0;
        for (name, fact) in lanes {
            let [id] = map.find(name).unwrap()[..] else { panic!("{name} is contracted in two") };
            if map.name(id) != *name {
                println!("{town} {name} is contracted into {}", map.name(id));
                continue;
            }
            let lane = map.lane(id);
            assert_eq!(lane.in_junction, fact["junction"], "{town} {name}");
            let changes: BTreeSet<usize> = lane.changes().collect();
            assert_eq!(changes, found(&fact["lc"]), "{town} changes from {name}");
            // CARLA's successors are what lies a metre ahead, beyond lanes shorter than that.
            let ours: BTreeSet<usize> = lane.successors.iter().copied().collect();
            assert_eq!(ours, found(&fact["next1m"]), "{town} successors of {name}");
            compared += 1;
        }
        assert!(compared + 1 >= lanes.len(), "{town}: {compared} of {} compared", lanes.len());
        let connected = map.graph().strongly_connected().len() as u64;
        let theirs = facts["strongly_connected_lanes"].as_u64().unwrap();
        assert!(
            theirs - connected <= map.graph().contracted() as u64,
            "{town} {connected} {theirs}"
        );
    }
}

#[test]
fn costs_of_metric_routes_are_carlas() {
    for Town { name: town, file, facts, .. } in towns() {
        let routes = list(&facts["metric_routes"]);
        let question = |route: &Value| json!({"start": route["start"], "goal": route["goal"], "lane_change_m": route["penalty"]});
        let questions: Vec<Value> = routes.iter().map(question).collect();
        let answer = answer(&file, &[("--routes", &json!(questions))]);
        assert_eq!(list(&answer["routes"]).len(), 40);
        for (ours, theirs) in list(&answer["routes"]).iter().zip(routes) {
            let (cost_m, their_m) = (number(&ours["cost_m"]), number(&theirs["cost"]));
            assert!(near_percent(cost_m, their_m), "{town} {theirs}: {cost_m}");
            assert_eq!(list(&ours["lanes"])[0], theirs["start"]);
            assert_eq!(list(&ours["lanes"]).last().unwrap(), &theirs["goal"]);
        }
    }
}

#[test]
fn turns_along_carlas_own_routes_are_carlas() {
    let mut told = 0;
    for Town { name: town, map, facts, .. } in towns() {
        for route in list(&facts["routes"]) {
            let named: Vec<usize> = list(&route["lanes"])
                .iter()
                .flat_map(|l| map.find(&format!("{}/{}/{}", l[0], l[1], l[2])).unwrap())
                .copied()
                .collect();
            let Some(lanes) = connected(&map, &named) else {
                println!("{town} {}: CARLA names lanes that do not lead on", name(&route["start"]));
                continue;
            };
            let (start, goal) = (&route["start"], &route["goal"]);
            let first = number(&start["s"]);
            let laid = MapRoute::along(&map, &lanes, first, number(&goal["s"]));
            if map.lane(lanes[0]).in_junction || map.lane(*lanes.last().unwrap()).in_junction {
                continue;
            }
            let turns: Vec<&str> = laid.turns.iter().map(|turn| turn.name()).collect();
            let theirs: Vec<String> = list(&route["options"])
                .iter()
                .map(|option| option.as_str().unwrap().to_lowercase())
                .filter(|option| ["left", "right", "straight"].contains(&option.as_str()))
                .collect();
            assert_eq!(turns.len(), theirs.len(), "{town} {}", name(start));
            for (ours, theirs) in turns.iter().zip(&theirs) {
                // At a fork of the motorway CARLA says which arm; by the angle it is straight.
                let is_fork = town == "Town04" && *ours == "straight";
                assert!(ours == theirs || is_fork, "{town} {}: {ours} {theirs}", name(start));
                told += usize::from(ours == theirs);
            }
        }
    }
    println!("{told} turns are CARLA's");
    assert!(told >= 150 || shared("maps").is_none(), "{told}");
}

/// The lanes of a list that lead on from each other; CARLA's traces name overlapping ones too.
fn connected(map: &RoadMap, named: &[usize]) -> Option<Vec<usize>> {
    let leads_on = |from: usize, to: usize| {
        let lane = map.lane(from);
        lane.successors.contains(&to) || lane.changes().any(|beside| beside == to)
    };
    // The most lanes from the first to each.
    let mut chains: Vec<Option<Vec<usize>>> = vec![Some(vec![named[0]])];
    for (index, lane) in named.iter().enumerate().skip(1) {
        let before =
            chains.iter().flatten().filter(|chain| leads_on(*chain.last().unwrap(), *lane));
        let shortest = before.min_by_key(|chain| index - chain.len());
        let chain = shortest.map(|chain| chain.iter().copied().chain([*lane]).collect());
        chains.push(chain);
    }
    chains.pop().flatten()
}

fn check_spacing(route: &MapRoute) {
    for pair in route.points.windows(2) {
        let step_m = (pair[1].position_m - pair[0].position_m).truncate().length();
        // A chord is shorter than the arc it spans, by little.
        assert!((0.38..0.4 + 1e-6).contains(&step_m), "{step_m} between {pair:?}");
    }
    for three in route.points.windows(3) {
        let heading = |a: usize| (three[a + 1].position_m - three[a].position_m).truncate();
        let bend = heading(0).angle_to(heading(1)).abs();
        assert!(bend < 0.35, "a bend of {bend} rad at {three:?}");
    }
}

#[test]
fn random_routes_have_the_length_asked_for_and_no_jump() {
    for Town { name: town, map, .. } in towns() {
        let planner = Planner::new(&map, 30.0);
        let mut commands = BTreeMap::new();
        for seed in 0..20 {
            let route = MapRoute::random(&planner, seed, 350.0..1500.0).unwrap();
            assert!((350.0..1500.0).contains(&route.length_m()), "{town} {}", route.length_m());
            assert_eq!(Some(&route), MapRoute::random(&planner, seed, 350.0..1500.0).as_ref());
            check_spacing(&route);
            for point in &route.points {
                *commands.entry(point.command.name()).or_insert(0_usize) += 1;
                let in_junction = map.lane(point.lane).in_junction;
                assert!(!in_junction || point.command != frame::Command::Follow);
            }
        }
        assert_eq!(commands.len(), 4, "{town} {commands:?}");
    }
}

#[test]
fn leaderboard_routes_follow_their_waypoints() {
    for (town, file) in [("Town01", "town01"), ("Town02", "town02"), ("Town04", "town04")] {
        let Some(xml) = shared(&format!("maps/routes/routes_{file}_tiny.xml")) else { return };
        let map = RoadMap::read(&shared(&format!("maps/{town}.xodr")).unwrap()).unwrap();
        let planner = Planner::new(&map, 30.0);
        let routes = leaderboard::read(&xml).unwrap();
        assert!(routes.len() >= 10, "{town}");
        for route in &routes {
            assert_eq!(route.town, town);
            let planned = route.plan(&planner).unwrap();
            check_spacing(&planned);
        }
    }
}

#[test]
fn a_leaderboard_route_with_an_end_off_the_road_is_named() {
    let Some(file) = shared("maps/Town01.xodr") else { return };
    let map = RoadMap::read(&file).unwrap();
    let folder = tempdir().unwrap();
    let path = folder.path().join("routes.xml");
    let start = "<waypoint x=\"92.404404\" y=\"226.299698\" z=\"0\" yaw=\"269.99\"/>";
    let end = "<waypoint x=\"2000.0\" y=\"186.3\" z=\"0\" yaw=\"269.99\"/>";
    let route = |id: u32, a: &str, b: &str| {
        format!("<route id=\"{id}\" town=\"Town01\">\n{a}\n{b}\n</route>\n")
    };
    let text = format!("<routes>\n{}{}</routes>", route(3, start, start), route(7, start, end));
    fs::write(&path, text).unwrap();
    let routes = leaderboard::read(&path).unwrap();
    let error = routes[1].plan(&Planner::new(&map, 30.0)).unwrap_err().to_string();
    for part in ["route 7", "end", "(2000.00, -186.30)", "off the road", "line 8"] {
        assert!(error.contains(part), "{error}");
    }
}

fn pmp_sim() -> Command {
    Command::new(env!("CARGO_BIN_EXE_pmp-sim"))
}

/// What the command prints as JSON, with questions as files.
fn answer(map: &Path, questions: &[(&str, &Value)]) -> Value {
    let folder = tempdir().unwrap();
    let mut command = pmp_sim();
    command.arg("map").arg(map).arg("--json");
    for (flag, question) in questions {
        let path = folder.path().join(format!("{}.json", flag.trim_matches('-')));
        fs::write(&path, question.to_string()).unwrap();
        command.arg(flag).arg(path);
    }
    let output = command.output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

#[test]
fn pictures_are_drawn_by_the_ending_of_their_name() {
    let Some(map) = shared("maps/Town02.xodr") else { return };
    let folder = tempdir().unwrap();
    let picture = |name: &str| {
        let path = folder.path().join(name);
        let output = pmp_sim().arg("map").arg(&map).arg("--picture").arg(&path).output().unwrap();
        (output.status.code(), fs::read(path).unwrap_or_default())
    };
    let (code, png) = picture("town.png");
    assert_eq!(code, Some(0));
    let mut reader = png::Decoder::new(std::io::Cursor::new(&png)).read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut pixels).unwrap();
    assert!((1000..=2400).contains(&info.width.max(info.height)));
    let share = |colour: [u8; 3]| {
        let same = pixels.chunks_exact(3).filter(|pixel| *pixel == colour).count();
        same as f64 / (pixels.len() / 3) as f64
    };
    // Two kilometres of road, 8 m wide, in 230 m by 220 m.
    assert!((0.1..0.5).contains(&share([92, 95, 102])), "{}", share([92, 95, 102]));
    let (code, svg) = picture("town.svg");
    let svg = String::from_utf8(svg).unwrap();
    assert_eq!(code, Some(0));
    assert!(roxmltree::Document::parse(&svg).unwrap().descendants().count() > 500);
    assert_eq!(picture("town.bmp"), (Some(1), Vec::new()));
    assert_eq!(picture("again.png").1, png, "the same map gives the same bytes");
}
