//! The world as it is used: drives in towns with traffic, the same for the same seed.

use std::sync::Arc;

use assert_cmd::Command;
use glam::DVec2;
use pmp::{
    map::{planner::Planner, route::MapRoute},
    policy::Action,
    world::{
        contact::{Fault, Other},
        density::{Counts, Density},
        drill::{Drill, Drive, run},
        ego::{Car, SEDAN},
        episode::{End, drive},
        expert::{Expert, ExpertConfig},
        route::Route,
        scoring::Sums,
        simulation::{SUBSTEPS, Start, World},
        town::{LENGTHS_M, Town},
    },
};
use proptest::prelude::*;

use crate::replay::state_of;

fn town(name: &str) -> Town {
    Town::choose(None, &[name.to_string()]).unwrap().swap_remove(0)
}

fn route(town: &Town, seed: u64) -> Arc<Route> {
    let planner = Planner::new(&town.map, 30.0);
    let route = MapRoute::random(&planner, seed, LENGTHS_M).unwrap();
    Arc::new(Route::new(&route, &town.streets).unwrap())
}

fn at_start(route: &Route) -> Car {
    Car::at_rest(SEDAN, route.waypoints()[0].position_m, route.forward(0.0).to_angle())
}

fn world(town: &Town, seed: u64, counts: Counts) -> World {
    let route = route(town, seed);
    World::new(Start {
        streets: town.streets.clone(),
        scenery: town.scenery.clone(),
        ego: at_start(&route),
        route,
        counts,
        seed,
        episode: 0,
    })
}

/// Hashes of the states of a drive of the expert, ten a second.
fn hashes(town: &Town, seed: u64, seconds: usize) -> Vec<u64> {
    let mut world = world(town, seed, Counts { vehicles: 40, walkers: 60 });
    let mut expert =
        Expert::new(ExpertConfig { burst_chance: 0.02, ..Default::default() }, seed, 0);
    let step = |_| {
        let decision = expert.decide(&world);
        (0..SUBSTEPS).for_each(|_| world.step(decision.applied));
        world.snapshot().hash()
    };
    (0..10 * seconds).map(step).collect()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 6, ..ProptestConfig::default() })]

    #[test]
    fn the_same_seed_gives_the_same_states_and_another_one_others(seed in 0_u64..1 << 40) {
        let town = town("Town02");
        let states = hashes(&town, seed, 12);
        prop_assert_eq!(&states, &hashes(&town, seed, 12));
        let other = hashes(&town, seed ^ 1, 12);
        prop_assert!(states.iter().zip(&other).all(|(a, b)| a != b));
    }
}

fn drill(densities: Vec<Density>, threads: usize) -> Vec<Drive> {
    let towns = [town("Town01"), town("Town03")];
    let expert = ExpertConfig::default();
    let drill = Drill { densities, episodes: 2, lengths_m: 350.0..500.0, seed: 4, expert };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    pool.install(|| run(&towns, &drill, &|_| ()))
}

#[test]
fn drives_are_the_same_on_any_number_of_threads() {
    let drives = drill(vec![Density::Few], 1);
    assert_eq!(drives.len(), 4);
    assert_eq!(drives, drill(vec![Density::Few], 3));
}

#[test]
fn the_expert_arrives_in_its_lane_at_the_speeds_of_the_paper() {
    for drive in drill(vec![Density::Empty, Density::Regular], 2) {
        let sums = &drive.outcome.sums;
        assert_eq!(drive.outcome.end, End::Goal, "{drive:?}");
        assert_eq!((sums.wrong_lane_s, sums.overspeed_s), (0.0, 0.0), "{drive:?}");
        let mean_mps = sums.driven_m / (sums.driven_s - sums.standing_s);
        assert!((4.0..40.0 / 3.6).contains(&mean_mps), "{mean_mps}");
        assert!((sums.driven_m - drive.outcome.progress_m).abs() < 0.03 * sums.driven_m + 10.0);
    }
}

/// Equation 1 of the paper: 130 waypoints in the frame of the car, the first one the nearest.
#[test]
fn the_local_route_lies_ahead_of_the_car_and_ends_with_the_route() {
    let town = town("Town03");
    let route = route(&town, 2);
    for at_m in [0.0, 37.3, 120.0, route.length_m() - 20.0] {
        let spot = route.at(at_m);
        let yaw_rad = route.forward(at_m).to_angle();
        let aside = route.forward(at_m).perp() * -0.8;
        let car = Car::at_rest(SEDAN, spot.position_m + aside, yaw_rad);
        let local = route.local(at_m, &state_of(&car, route.at(at_m).height_m)).unwrap();
        let left = ((route.length_m() - spot.at_m) / 0.4).round() as usize + 1;
        assert!(usize::from(local.len).abs_diff(left.min(130)) <= 1, "{} of {left}", local.len);
        let points: Vec<&[f32]> = local.waypoints_m.chunks(2).collect();
        assert!(points[0][0].abs() < 0.3 && (points[0][1] - 0.8).abs() < 0.05, "{:?}", points[0]);
        assert!(points[10][0] > 3.0, "{:?}", points[10]);
        for pair in points[..usize::from(local.len)].windows(2) {
            let step_m = (pair[1][0] - pair[0][0]).hypot(pair[1][1] - pair[0][1]);
            assert!((step_m - 0.4).abs() < 0.02, "{step_m}");
        }
    }
}

#[test]
fn a_level_of_traffic_has_its_numbers_and_they_are_recorded() {
    let regular = drill(vec![Density::Regular], 2);
    let in_large_town: Vec<_> = regular.iter().filter(|drive| drive.town == "Town03").collect();
    for drive in in_large_town {
        assert_eq!(drive.counts.vehicles, 60);
        assert!((40..=75).contains(&drive.counts.walkers), "{:?}", drive.counts);
    }
}

#[test]
fn who_drives_straight_on_with_closed_eyes_hits_something_and_is_at_fault() {
    let town = town("Town01");
    let mut world = world(&town, 5, Counts { vehicles: 0, walkers: 0 });
    let blind = Action { steer: 0.3, throttle: 0.4, brake: 0.0 };
    let outcome = drive(&mut world, &mut |_| blind);
    let End::Contact(contact) = outcome.end else { panic!("{outcome:?}") };
    assert_eq!((contact.other, contact.fault), (Other::Static, Fault::Ego));
    assert!(contact.relative_speed_mps > 1.0);
    let at_m = DVec2::from_array(contact.position_m);
    assert!(at_m.distance(world.ego().position_m) < 2.0 * SEDAN.half_length_m, "{contact:?}");
}

#[test]
fn a_car_that_never_moves_runs_out_of_time_and_counts_as_standing() {
    let town = town("Town02");
    let mut world = world(&town, 3, Counts { vehicles: 0, walkers: 0 });
    let outcome = drive(&mut world, &mut |_| Action { steer: 0.0, throttle: 0.0, brake: 1.0 });
    assert_eq!(outcome.end, End::Timeout);
    let limit_s = outcome.route_m / (10.0 / 3.6) + 20.0;
    assert!((outcome.sums.driven_s - limit_s).abs() < 0.2);
    assert_eq!(outcome.sums.standing_s, outcome.sums.driven_s);
}

#[test]
fn the_wrong_side_of_the_road_counts_and_so_does_speed() {
    let town = town("Town01");
    let route = route(&town, 9);
    // In the middle of a stretch between junctions.
    let is_open = |at_m: f64| {
        let near = (-40..=40).map(|step| f64::from(step) + at_m);
        near.into_iter().all(|at_m| !route.at(at_m).in_junction)
    };
    let at_m = (50..).map(f64::from).find(|at_m| is_open(*at_m)).unwrap();
    let lane_m = town.streets.lanes[route.at(at_m).lane].width_m;
    let place = |aside_m: f64, speed_mps: f64| {
        let forward = route.forward(at_m);
        let position_m = route.at(at_m).position_m + forward.perp() * aside_m;
        let car = Car { speed_mps, ..Car::at_rest(SEDAN, position_m, forward.to_angle()) };
        let mut sums = Sums::default();
        sums.add(&town.streets, &route, at_m, &car);
        sums
    };
    let wrong = |aside_m| place(aside_m, 5.0).wrong_lane_s;
    assert_eq!([wrong(0.0), wrong(0.3 * lane_m)], [0.0, 0.0]);
    assert!(wrong(lane_m) > 0.09, "the lane of the others, on the left");
    assert!(wrong(-0.5 * lane_m - 1.0) > 0.09, "beside the road, on the right");
    assert_eq!(place(0.0, 50.0 / 3.6).overspeed_s, 0.0);
    assert!(place(0.0, 50.1 / 3.6).overspeed_s > 0.09);
}

fn pmp_sim(args: &[&str]) -> Command {
    let mut command = Command::cargo_bin("pmp-sim").unwrap();
    command.arg("drill").args(args);
    command
}

#[test]
fn the_command_prints_the_same_for_any_number_of_jobs() {
    let args = ["--town", "Town02", "--traffic", "few", "--episodes", "2", "--jobs"];
    let run = |jobs: &str, more: &[&str]| {
        let args: Vec<&str> = args.iter().chain([&jobs]).chain(more).copied().collect();
        let output = pmp_sim(&args).output().unwrap();
        assert!(output.status.success());
        assert!(!output.stderr.contains(&0x1b), "no escape codes off a terminal");
        String::from_utf8(output.stdout).unwrap()
    };
    let text = run("1", &[]);
    assert_eq!(text, run("2", &[]));
    assert!(text.contains("| Town02 | few |") && text.contains("| all |"), "{text}");
    let json = run("2", &["--json"]);
    let drives: Vec<Drive> = json.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(drives.len(), 2);
    assert!(drives.iter().all(|drive| drive.traffic == Density::Few));
}

#[test]
fn a_town_that_is_not_there_is_an_error_that_names_those_that_are() {
    let output = pmp_sim(&["--town", "Town99"]).output().unwrap();
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(stderr.contains("no town `Town99`") && stderr.contains("Town07"), "{stderr}");
}
