//! Traffic beside the theory of its own models: flow against density, overtaking, and the census
//! that counts both.
#![allow(clippy::unwrap_used)]

use std::fs;

use assert_cmd::Command;
use glam::{DVec2, DVec3};
use pmp::{
    map::road_map::RoadMap,
    noise::Noise,
    world::{
        census::Census,
        density::Counts,
        kind::{VEHICLES, VehicleModel},
        paving::pave,
        reservation::ActorId,
        rush_hour::{Report, RushHour},
        snapshot::{vehicle_states, walker_states},
        streets::{Course, Lane, LaneId, Streets},
        touches::Touches,
        town::Town,
        traffic::{STEP_S, Traffic},
        vehicle::Vehicle,
        walkers::Walkers,
    },
};
use proptest::prelude::*;
use rayon::prelude::*;

use crate::fixtures::shared;

const LIMIT_MPS: f64 = 50.0 / 3.6;
const CAR: &VehicleModel = &VEHICLES[0];
const BICYCLE: &VehicleModel = &VEHICLES[6];

/// A vehicle of exactly this model, in the middle of its lane.
fn vehicle(
    id: ActorId,
    model: &'static VehicleModel,
    streets: &Streets,
    lane: LaneId,
    s_m: f64,
) -> Vehicle {
    let mut vehicle = Vehicle::new(id, Noise::of_actor(1, 0, id), streets, lane, s_m);
    (vehicle.model, vehicle.half_m) = (model, model.half_m);
    (vehicle.haste, vehicle.aside_m, vehicle.keeps_aside_m) = (1.0, 0.0, 0.0);
    vehicle
}

/// A straight street of four lanes in a row, whose end leads to its start.
fn endless(length_m: f64) -> Streets {
    let lane = |quarter: usize| {
        let x_m = |share: f64| DVec3::X * (quarter as f64 + share) * length_m / 4.0;
        let course = Course::through(&[x_m(0.0), x_m(1.0)]);
        let mut lane = Lane::new(format!("{quarter}/0/-1"), course, 3.5, LIMIT_MPS);
        lane.next = vec![(quarter + 1) % 4];
        lane
    };
    Streets::new((0..4).map(lane).collect(), Vec::new())
}

/// The fundamental diagram: at each density the flow is the one at which the model's gap of steady
/// traffic, (s0 + v T) / sqrt(1 - (v / v0)^4), is the one that vehicles have.
#[test]
fn flow_against_density_is_that_of_the_models_own_equilibrium() {
    const CARS: usize = 24;
    let idm = CAR.idm();
    let mut flows = Vec::new();
    for speed_mps in [1.0, 3.0, 6.0, 9.0, 11.5, 13.0_f64] {
        let free = (1.0 - (speed_mps / LIMIT_MPS).powi(4)).sqrt();
        let gap_m = (idm.rest_gap_m + speed_mps * idm.time_gap_s) / free;
        let each_m = gap_m + 2.0 * CAR.half_m.x;
        let streets = endless(CARS as f64 * each_m);
        let quarter_m = streets.lanes[0].length_m();
        let mut traffic = Traffic::default();
        for index in 0..CARS {
            let s_m = index as f64 * each_m;
            let lane = ((s_m / quarter_m) as usize).min(3);
            let mut car =
                vehicle(1 + index as ActorId, CAR, &streets, lane, s_m - lane as f64 * quarter_m);
            // A jolt, which has to fade.
            car.speed_mps = if index % 6 == 0 { 0.5 * speed_mps } else { speed_mps };
            traffic.vehicles.push(car);
        }
        let (mut driven_m, mut counted_s) = (0.0, 0.0);
        for step in 0..9000 {
            traffic.step(&streets, None, &[]);
            if step >= 8000 {
                counted_s += STEP_S;
                driven_m += traffic.vehicles.iter().map(|v| v.speed_mps * STEP_S).sum::<f64>();
            }
        }
        // Flow by Edie's definition: distance driven over the area of road and time.
        let flow_per_s = driven_m / (CARS as f64 * each_m * counted_s);
        let theory_per_s = speed_mps / each_m;
        let off = (flow_per_s / theory_per_s - 1.0).abs();
        assert!(off < 0.02, "{speed_mps} m/s: {flow_per_s} vehicles/s and not {theory_per_s}");
        flows.push(flow_per_s);
    }
    let most = flows.iter().copied().fold(0.0, f64::max);
    assert!(flows[0] < 0.6 * most && flows[5] < 0.95 * most, "no top in between: {flows:?}");
}

/// A ring of one or two lanes side by side.
fn ring(lanes: usize) -> Streets {
    const RADIUS_M: f64 = 320.0;
    let half = |aside: usize, part: usize| {
        let radius_m = RADIUS_M + 3.5 * aside as f64;
        let at = |i: usize| {
            let angle = (part as f64 + i as f64 / 1000.0) * std::f64::consts::PI;
            (radius_m * DVec2::from_angle(angle)).extend(0.0)
        };
        let points: Vec<DVec3> = (0..=1000).map(at).collect();
        let name = format!("{part}/0/{}", -1 - aside as i64);
        let mut lane = Lane::new(name, Course::through(&points), 3.5, LIMIT_MPS);
        lane.next = vec![2 * aside + 1 - part];
        // Counter-clockwise, so the inner lane is the left one.
        lane.right = (aside + 1 < lanes).then_some(2 * (aside + 1) + part);
        lane.left = aside.checked_sub(1).map(|inner| 2 * inner + part);
        lane
    };
    let all = (0..lanes).flat_map(|aside| [0, 1].map(|part| half(aside, part)));
    Streets::new(all.collect(), Vec::new())
}

/// Cars behind bicycles: their mean speed over the last ten minutes, and the touches.
fn cars_among_bicycles(lanes: usize) -> (f64, usize) {
    let streets = ring(lanes);
    let mut traffic = Traffic::default();
    for index in 0..18_u32 {
        let s_m = 20.0 + 100.0 * f64::from(index % 9);
        let model = if index % 6 == 0 { BICYCLE } else { CAR };
        traffic.vehicles.push(vehicle(1 + index, model, &streets, (index / 9) as usize, s_m));
    }
    let (mut touches, mut sum_mps, mut looks) = (Touches::default(), 0.0, 0.0);
    for step in 0..12_000 {
        traffic.step(&streets, None, &[]);
        touches.look(f64::from(step) * STEP_S, &vehicle_states(&streets, &traffic), &[]);
        for car in traffic.vehicles.iter().filter(|v| v.model.kind == CAR.kind && step >= 6000) {
            (sum_mps, looks) = (sum_mps + car.speed_mps, looks + 1.0);
        }
    }
    (sum_mps / looks, touches.between_vehicles.len())
}

#[test]
fn who_is_slow_is_overtaken_where_there_is_a_second_lane() {
    let (behind_mps, touches) = cars_among_bicycles(1);
    assert!((behind_mps - BICYCLE.fastest_mps).abs() < 0.3 && touches == 0, "{behind_mps} m/s");
    let (free_mps, touches) = cars_among_bicycles(2);
    assert!(free_mps > 0.9 * LIMIT_MPS, "{free_mps} m/s");
    assert_eq!(touches, 0);
}

/// Two cars of which one drives through the other, one that stands, and one that changes its lane.
#[test]
fn the_census_counts_what_happens() {
    let streets = ring(2);
    let mut traffic = Traffic::default();
    for (id, lane, s_m) in [(1, 0, 100.0), (2, 0, 120.0), (3, 0, 400.0), (4, 0, 600.0)] {
        traffic.vehicles.push(vehicle(id, CAR, &streets, lane, s_m));
    }
    let walkers = Walkers::default();
    let mut census = Census::default();
    for step in 0..1200 {
        traffic.vehicles[0].speed_mps = 4.0;
        traffic.vehicles[0].s_m = 100.0 + 0.4 * f64::from(step);
        traffic.vehicles[2].standing_s += STEP_S;
        if step == 50 {
            traffic.vehicles[3].change_lane(&streets, 2);
        }
        let states = vehicle_states(&streets, &traffic);
        census.count(&streets, &traffic, &walkers, &states, &walker_states(&walkers));
    }
    let tally = census.tally(walkers.crossings);
    let pairs: Vec<_> = tally.touches_between_vehicles.iter().map(|touch| touch.actors).collect();
    // It leaves the ground of the standing one again, and comes to the next.
    assert_eq!(pairs, [[1, 2], [1, 3]]);
    let [driver_mps, standing_mps] = tally.touches_between_vehicles[0].speeds_mps;
    assert!((driver_mps - 4.0).abs() < 1e-9 && standing_mps == 0.0, "{driver_mps} m/s");
    // Bumpers meet after 20 m less a car's length.
    let expected_s = (20.0 - 2.0 * CAR.half_m.x) / 4.0;
    assert!((tally.touches_between_vehicles[0].time_s - expected_s).abs() < 0.3);
    assert!((tally.driven_km - 0.48).abs() < 1e-9, "{}", tally.driven_km);
    assert_eq!(tally.long_stands, [1, 0, 0]);
    assert!((tally.longest_stand_s - 120.0).abs() < 1e-6);
    assert_eq!(tally.lane_changes, 1);
    assert_eq!(tally.minutes.len(), 2);
    assert!((tally.minutes[1].mean_speed_mps - 1.0).abs() < 1e-9);
    assert!((tally.minutes[1].stopped_share - 0.75).abs() < 1e-9);
}

/// A round road with two lanes and a side-walk, as OpenDRIVE.
fn round_road() -> String {
    const RADIUS_M: f64 = 120.0;
    let length_m = std::f64::consts::TAU * RADIUS_M;
    let curvature = 1.0 / RADIUS_M;
    let lane = |id: i32, kind: &str, width_m: f64| {
        let link = match kind {
            "driving" => format!(r#"<link><predecessor id="{id}"/><successor id="{id}"/></link>"#),
            _ => String::new(),
        };
        format!(
            r#"<lane id="{id}" type="{kind}" level="false">{link}<width sOffset="0" a="{width_m}" b="0" c="0" d="0"/></lane>"#
        )
    };
    let lanes = [lane(-1, "driving", 3.5), lane(-2, "driving", 3.5), lane(-3, "sidewalk", 2.0)];
    format!(
        r#"<?xml version="1.0"?>
<OpenDRIVE><header revMajor="1" revMinor="4"/>
<road name="" length="{length_m}" id="1" junction="-1">
<link><predecessor elementType="road" elementId="1" contactPoint="end"/><successor elementType="road" elementId="1" contactPoint="start"/></link>
<planView><geometry s="0" x="0" y="0" hdg="0" length="{length_m}"><arc curvature="{curvature}"/></geometry></planView>
<lanes><laneSection s="0"><center><lane id="0" type="none" level="false"/></center><right>{}</right></laneSection></lanes>
</road></OpenDRIVE>"#,
        lanes.concat()
    )
}

fn round_town() -> Streets {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("round.xodr");
    fs::write(&path, round_road()).unwrap();
    pave(&RoadMap::read(&path).unwrap())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(6))]

    /// The same seed, the same figures and the same last state, alone or beside others.
    #[test]
    fn a_rush_hour_is_the_same_on_any_number_of_threads(seed in 0..1_000_000_u64) {
        let streets = round_town();
        let counts = Counts { vehicles: 20, walkers: 20 };
        let hours = [seed, seed + 1, seed + 2].map(|seed| RushHour { counts, minutes: 2, seed });
        let run = |hour: &RushHour| hour.run("round", &streets, &|| ());
        let alone: Vec<Report> = hours.iter().map(run).collect();
        let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap();
        let beside: Vec<Report> = pool.install(|| hours.par_iter().map(run).collect());
        prop_assert_eq!(&alone, &beside);
        prop_assert_ne!(alone[0].hash, alone[1].hash);
    }
}

#[test]
fn the_command_tells_of_each_town_and_repeats_itself() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("round.xodr");
    fs::write(&path, round_road()).unwrap();
    let told = |jobs: &str, options: &[&str]| {
        let mut command = Command::cargo_bin("pmp-sim").unwrap();
        command.args(["traffic", "--vehicles", "10", "--walkers", "12", "--minutes", "2"]);
        command.args(["--seed", "5", "--jobs", jobs]).args(options).args([&path, &path]);
        let output = command.assert().success().get_output().clone();
        assert!(String::from_utf8(output.stderr).unwrap().contains("steps/s"));
        String::from_utf8(output.stdout).unwrap()
    };
    let json = told("1", &["--json"]);
    assert_eq!(json, told("2", &["--json"]));
    let reports: Vec<Report> = serde_json::from_str(&json).unwrap();
    assert_eq!(reports[0], reports[1]);
    assert_eq!(reports[0].counts, Counts { vehicles: 10, walkers: 12 });
    assert_eq!(reports[0].tally.minutes.len(), 2);
    let text = told("1", &[]);
    assert!(text.starts_with("round: 10 vehicles, 12 on foot, 2 min, seed 5\n"), "{text}");
    assert!(text.contains("touches          0 between vehicles"), "{text}");

    let missing = folder.path().join("none.xodr");
    Command::cargo_bin("pmp-sim").unwrap().arg("traffic").arg(missing).assert().code(1);
}

/// Ten minutes of dense traffic: people get on, and no more than so many are touched.
fn assert_flows(town: &str, streets: &Streets, most_touches: usize) {
    let counts = Counts { vehicles: 120, walkers: 150 };
    let report = RushHour { counts, minutes: 10, seed: 1 }.run(town, streets, &|| ());
    let tally = &report.tally;
    assert!(tally.longest_stand_s < 180.0, "{town}: somebody stood {} s", tally.longest_stand_s);
    let last = &tally.minutes[9];
    assert!(last.stopped_share < 0.4 && last.mean_speed_mps > 2.0, "{town}: {last:?}");
    let touches = tally.touches_between_vehicles.len() + tally.touches_with_walkers.len();
    assert!(touches <= most_touches, "{town}: {touches} touches");
    let theory = tally.steady_gaps_to_theory.unwrap();
    assert!((theory.median - 1.0).abs() < 0.1, "{town}: gaps beside theory {theory:?}");
}

#[test]
fn real_towns_neither_jam_nor_crash() {
    for town in ["Town01", "Town02", "Town04"] {
        let Some(path) = shared(&format!("maps/{town}.xodr")) else { return };
        assert_flows(town, &pave(&RoadMap::read(&path).unwrap()), 3);
    }
}

/// The narrow streets of 01, where a large bus still touches who waits beside its turn, and the
/// roundabout of 04, which filled up when no way led out of its inner lane.
#[test]
fn narrow_streets_and_a_wide_roundabout_do_not_jam() {
    for town in Town::choose(None, &["Town01".to_string(), "Town04".to_string()]).unwrap() {
        assert_flows(&town.name, &town.streets, 6);
    }
}

/// Stop lines stand back where a bus comes round the corner, and nowhere else.
#[test]
fn lines_stand_back_where_buses_turn() {
    let town = Town::choose(None, &["Town01".to_string()]).unwrap().swap_remove(0);
    let leads_in = |lane: &&Lane| {
        lane.junction.is_none()
            && lane.next.iter().any(|next| town.streets.lanes[*next].junction.is_some())
    };
    let lines_m: Vec<f64> =
        town.streets.lanes.iter().filter(leads_in).map(|lane| lane.line_m).collect();
    let back = lines_m.iter().filter(|line_m| **line_m >= 2.0).count();
    assert!(back > lines_m.len() / 5, "{back} of {}: streets are narrow there", lines_m.len());
    assert!(lines_m.iter().all(|line_m| *line_m <= 10.0));
    // Nobody turns out of the way of a lane that goes on.
    let others = town.streets.lanes.iter().filter(|lane| !leads_in(lane));
    assert!(others.map(|lane| lane.line_m).all(|line_m| line_m < 1.0));
}

/// A bus that stands at the end of a lane that narrows to nothing gets out of it, and nobody stands
/// where the lane is too narrow.
#[test]
fn a_lane_that_drops_is_left_in_time_and_from_standstill() {
    let town = Town::choose(None, &["Town04".to_string()]).unwrap().swap_remove(0);
    let lanes = &town.streets.lanes;
    let drops: Vec<LaneId> = (0..lanes.len()).filter(|id| lanes[*id].next.is_empty()).collect();
    assert!(!drops.is_empty());
    for drop in drops {
        let lane = &lanes[drop];
        assert!(lane.usable_m < lane.length_m() - 10.0, "{} m", lane.usable_m);
        let before = lane.previous[0];
        assert_eq!(lanes[before].dead_end_m, Some(lanes[before].length_m() + lane.usable_m));
        let mut traffic = Traffic::default();
        traffic.vehicles.push(vehicle(1, &VEHICLES[4], &town.streets, drop, 5.0));
        for _ in 0..300 {
            traffic.step(&town.streets, None, &[]);
        }
        let bus = &traffic.vehicles[0];
        assert!(
            bus.lane != drop && bus.speed_mps > 3.0,
            "{} m/s on {}",
            bus.speed_mps,
            lanes[bus.lane].name
        );
    }
}
