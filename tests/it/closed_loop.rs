//! The closed loop: what a policy is shown, how an episode ends, and what is counted of it.
#![allow(clippy::unwrap_used)]

use std::{
    path::Path,
    sync::{Arc, LazyLock, Mutex},
};

use glam::DVec2;
use pmp::{
    closed_loop::{
        comfort::{judge, smoothed},
        contest::{Contest, Entrant, MakePilot, Progress},
        oracle::OraclePilot,
        outing::{self, Setting},
        pilot::{ExpertPilot, Pilot, PolicyPilot},
        results,
        row::EpisodeRow,
        safety::time_to_collision_s,
        suite::{Episode, Extent, Suite},
    },
    control::{driver::ControlConfig, fusion::Fusion},
    error::{Error, Result},
    footprint::Footprint,
    frame::Frame,
    log::head,
    map::{
        planner::{LanePlace, Planner},
        route::MapRoute,
    },
    policy::{Action, Plan, Policy, Senses},
    scene::conditions::Sky,
    sim::{drive::Drive, record::OUTCOME_RECORD, rig::Rig},
    world::{
        contact::{Body, Fault, Other, contact},
        density::{Counts, Density},
        ego::{Car, SEDAN},
        episode::{End, Rules, Watch},
        expert::Decision,
        kind::VehicleKind,
        route::Route,
        scoring::Sums,
        simulation::{SUBSTEPS, Start, World},
        snapshot::{Snapshot, VehicleState},
        town::{LANE_CHANGE_M, Town},
    },
};

use crate::{
    ingest::{frames, into},
    recording::shared,
};

static TOWN: LazyLock<Town> = LazyLock::new(|| Town::open(None, "Town02").unwrap());

/// Episodes in the town that tests share, each of some seconds.
fn short_suite(traffic: Density, episodes: u32, seconds: f64) -> Suite {
    let episode = |number| Episode {
        condition: "a test".into(),
        town: "Town02".into(),
        traffic,
        sky: Sky::from_name("rainy-night").unwrap(),
        number,
        seed: 4,
        listed: None,
    };
    Suite {
        name: "short".into(),
        seed: 4,
        rules: Rules { slowest_kmph: 1e9, grace_s: seconds, ..Rules::default() },
        route_m: [350.0, 1500.0],
        episodes: (0..episodes).map(episode).collect(),
    }
}

/// Keeps what it is shown, and drives off.
struct Witness(Arc<Mutex<Vec<Frame>>>);

impl Policy for Witness {
    fn name(&self) -> &str {
        "witness"
    }

    fn reset(&mut self) {}

    fn plan(&mut self, frame: &Frame) -> Result<Plan> {
        self.0.lock().unwrap().push(frame.clone());
        let action = Action { steer: 0.02, throttle: 0.5, brake: 0.0 };
        Ok(Plan { action: Some(action), ..Plan::default() })
    }
}

/// What a policy was shown, and what ingest makes of the log of the same drive.
#[test]
fn a_policy_is_shown_the_frames_that_ingest_makes_of_a_log_of_its_drive() {
    let folder = tempfile::tempdir().unwrap();
    let (shared, rig) = (shared(), Rig::default());
    let suite = short_suite(Density::Dense, 1, 4.0);
    let setting =
        Setting { suite: &suite, stage: &shared.stage, shapes: &shared.shapes, rig: &rig };
    let shown = Arc::new(Mutex::new(Vec::new()));
    let mut pilot =
        PolicyPilot::new(Box::new(Witness(shown.clone())), ControlConfig::default(), Fusion::A1);
    let log = folder.path().join("witness.mcap");
    let outing =
        outing::drive(&setting, &suite.episodes[0], "witness", &mut pilot, Some(&log)).unwrap();
    assert_eq!(outing.row.reason, "timeout");
    assert!(outing.row.driven_m > 5.0, "{}", outing.row.driven_m);
    let told = head::metadata(&log, OUTCOME_RECORD);
    assert!(told.is_ok());

    let dataset = folder.path().join("data");
    let said = into(&dataset, &[&log]);
    assert_eq!(said.code, 0, "{}", said.err);
    let ingested: Vec<Frame> = frames(&dataset).into_iter().map(|(_, frame)| frame).collect();
    let shown = shown.lock().unwrap();
    assert_eq!(ingested.len(), shown.len());
    for (ours, theirs) in shown.iter().zip(&ingested) {
        let at = ours.index;
        assert_eq!(ours.stamp_ns, theirs.stamp_ns);
        assert!(ours.image == theirs.image, "the picture of frame {at}");
        assert_eq!(ours.lidar, theirs.lidar, "frame {at}");
        assert_eq!(ours.radar, theirs.radar, "frame {at}");
        assert_eq!(ours.velocity_mps, theirs.velocity_mps, "frame {at}");
        assert!((ours.yaw_rad - theirs.yaw_rad).abs() < 1e-9, "frame {at}");
        assert_eq!(ours.route.len, theirs.route.len, "frame {at}");
        let pairs = ours.route.waypoints_m.iter().zip(&theirs.route.waypoints_m);
        let furthest = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(furthest < 1e-4, "frame {at}: routes {furthest} m apart");
        assert_eq!(ours.command, theirs.command, "frame {at}");
        assert_eq!(ours.in_junction, theirs.in_junction, "frame {at}");
        assert_eq!(ours.speed_limit_mps, theirs.speed_limit_mps, "frame {at}");
        assert_eq!(ours.conditions, theirs.conditions, "frame {at}");
        assert_eq!(ours.skew.image_ns, theirs.skew.image_ns, "frame {at}");
        assert_eq!(theirs.action.throttle, Some(0.5), "frame {at}");
    }
    let lidar = shown[0].lidar.as_ref().unwrap();
    assert!(lidar.pixel.len() > 1000 && shown[0].image.len() > 10_000);
}

/// A straight way of 40 m along one lane of the town, and where a car on it would be.
fn straight() -> (Arc<Route>, LanePlace) {
    let planner = Planner::new(&TOWN.map, LANE_CHANGE_M);
    let lanes = 0..TOWN.map.graph().lanes().len();
    let route = lanes.into_iter().find_map(|lane| {
        let (from, to) = (LanePlace { lane, s_m: 20.0 }, LanePlace { lane, s_m: 60.0 });
        let route = MapRoute::through(&planner, &[from, to]).ok()?;
        let route = Route::new(&route, &TOWN.streets)?;
        let is_plain = (35.0..45.0).contains(&route.length_m())
            && route.waypoints().iter().all(|w| !w.in_junction && w.curvature_per_m < 1e-3);
        is_plain.then(|| (Arc::new(route), from))
    });
    route.unwrap()
}

fn world(route: &Arc<Route>, ego: Car) -> World {
    World::new(Start {
        streets: TOWN.streets.clone(),
        scenery: TOWN.scenery.clone(),
        route: route.clone(),
        ego,
        counts: Counts { vehicles: 0, walkers: 0 },
        seed: 0,
        episode: 0,
    })
}

#[test]
fn the_goal_is_reached_4_9_m_before_it_and_not_5_1_m_before_it() {
    let (route, _) = straight();
    let end_of = |before_m: f64| {
        let forward = route.forward(route.length_m());
        let place_m = route.goal_m() - forward * before_m;
        // The nearest waypoint is looked for up to 30 m ahead of the last one.
        let start = Car::at_rest(SEDAN, route.goal_m() - forward * 25.0, forward.to_angle());
        let mut world = world(&route, start);
        let brake = Action { brake: 1.0, ..Action::default() };
        world.step(brake);
        let mut watch = Watch::new(&world, Rules::default());
        assert_eq!(watch.look(&world), None, "25 m before the goal");
        let mut there = world.clone();
        there.place_ego(Car::at_rest(SEDAN, place_m, forward.to_angle()));
        there.step(brake);
        watch.look(&there)
    };
    assert_eq!(end_of(4.9), Some(End::Goal));
    assert_eq!(end_of(5.1), None);
}

#[test]
fn three_seconds_in_the_wrong_lane_and_one_too_fast_in_a_junction_are_just_that() {
    let (route, _) = straight();
    let at_m = 20.0;
    let lane_m = TOWN.streets.lanes[route.at(at_m).lane].width_m;
    let forward = route.forward(at_m);
    let car = |aside_m: f64, speed_mps: f64| {
        let position_m = route.at(at_m).position_m + forward.perp() * aside_m;
        Car { speed_mps, ..Car::at_rest(SEDAN, position_m, forward.to_angle()) }
    };
    let mut sums = Sums::default();
    let mut drive = |steps: usize, aside_m: f64, speed_mps: f64| {
        (0..steps).for_each(|_| sums.add(&TOWN.streets, &route, at_m, &car(aside_m, speed_mps)));
    };
    drive(40, 0.0, 8.0);
    drive(30, lane_m, 8.0);
    drive(50, 0.0, 8.0);
    assert!((sums.wrong_lane_s - 3.0).abs() < 1e-9, "{}", sums.wrong_lane_s);
    assert!((sums.wrong_lane_m - 24.0).abs() < 1e-9);
    assert!((sums.driven_s - 12.0).abs() < 1e-9);
    assert_eq!(sums.overspeed_s, 0.0);

    let town_route = TOWN.route(4, 0, 350.0..1500.0).unwrap();
    let junction = town_route.waypoints().iter().find(|w| w.in_junction).unwrap();
    let forward = town_route.forward(junction.at_m);
    let mut sums = Sums::default();
    for (steps, kmph) in [(20, 20.0), (10, 20.1), (30, 19.0)] {
        let car = Car {
            speed_mps: kmph / 3.6,
            ..Car::at_rest(SEDAN, junction.position_m, forward.to_angle())
        };
        (0..steps).for_each(|_| sums.add(&TOWN.streets, &town_route, junction.at_m, &car));
    }
    assert!((sums.overspeed_s - 1.0).abs() < 1e-9, "{}", sums.overspeed_s);
    assert!((sums.junction_s - 6.0).abs() < 1e-9);
    assert_eq!(sums.wrong_lane_s, 0.0, "lanes do not count in junctions");
}

#[test]
fn a_touch_at_a_tenth_of_a_metre_a_second_is_a_contact() {
    let parked = Body {
        other: Other::Vehicle(VehicleKind::Van),
        actor: Some(3),
        footprint: Footprint::new(DVec2::new(6.0, 0.0), 0.0, DVec2::new(2.0, 1.0)),
        velocity_mps: DVec2::ZERO,
    };
    let ego = |x_m: f64| Body {
        other: Other::Static,
        actor: None,
        footprint: Footprint::new(DVec2::new(x_m, 0.0), 0.0, DVec2::new(2.45, 0.93)),
        velocity_mps: DVec2::new(0.1, 0.0),
    };
    // 1.55 m to go, 1 mm in 10 ms.
    let touch = (0..2000).find_map(|step| contact(&ego(0.001 * f64::from(step)), &parked, 0.0));
    let touch = touch.unwrap();
    assert!((touch.relative_speed_mps - 0.1).abs() < 1e-12);
    assert_eq!(touch.fault, Fault::Ego);
    assert_eq!(contact(&ego(1.54), &parked, 0.0), None);
}

fn snapshot(ego_mps: f64, others: &[(DVec2, f64, DVec2)]) -> Snapshot {
    let ego = Car { speed_mps: ego_mps, ..Car::at_rest(SEDAN, DVec2::ZERO, 0.0) };
    let vehicle = |(at, (place_m, heading_rad, velocity_mps)): (usize, &(DVec2, f64, DVec2))| {
        let footprint = Footprint::new(*place_m, *heading_rad, DVec2::new(2.0, 1.0));
        VehicleState { id: at as u32, footprint, velocity_mps: *velocity_mps, ..state() }
    };
    let vehicles = others.iter().enumerate().map(vehicle).collect();
    Snapshot { time_s: 0.0, ego, ego_ground_m: 0.0, vehicles, walkers: Vec::new() }
}

fn state() -> VehicleState {
    let route = TOWN.route(4, 0, 350.0..1500.0).unwrap();
    let world = TOWN.world(route, Counts { vehicles: 1, walkers: 0 }, 4, 0);
    VehicleState { ground_m: 0.0, ..world.snapshot().vehicles[0] }
}

#[test]
fn time_to_collision_is_that_of_bodies_that_keep_their_velocities() {
    let ttc_s = |ego_mps, others: &[_]| time_to_collision_s(&snapshot(ego_mps, others));
    let ahead = |gap_m: f64| DVec2::new(2.45 + gap_m + 2.0, 0.0);
    // 19 m at 10 m/s.
    assert_eq!(ttc_s(10.0, &[(ahead(19.0), 0.0, DVec2::ZERO)]), Some(1.9000000000000001));
    assert_eq!(ttc_s(10.0, &[(ahead(19.0), 0.0, DVec2::new(10.0, 0.0))]), None, "as fast");
    assert_eq!(ttc_s(10.0, &[(ahead(31.0), 0.0, DVec2::ZERO)]), None, "further than 3 s");
    assert_eq!(ttc_s(10.0, &[(DVec2::new(10.0, 3.0), 0.0, DVec2::ZERO)]), None, "beside the way");
    assert_eq!(ttc_s(0.0, &[(ahead(1.0), 0.0, DVec2::new(-9.0, 0.0))]), None, "who stands");
    let behind = DVec2::new(-8.0, 0.0);
    assert_eq!(ttc_s(5.0, &[(behind, 0.0, DVec2::new(15.0, 0.0))]), None, "hit from behind");
    // From the right across the way: there when we are.
    let crossing = (DVec2::new(20.0, -12.0), std::f64::consts::FRAC_PI_2, DVec2::new(0.0, 6.0));
    let crossing_s = ttc_s(10.0, &[crossing]).unwrap();
    assert!((1.5..2.0).contains(&crossing_s), "{crossing_s}");
}

/// scipy.signal.savgol_filter(samples, 7, 2, deriv=0, 1, 2, delta=0.1)[3], scipy 1.16.
#[test]
fn smoothing_is_scipys() {
    let [value, slope, bend] = smoothed(&[0.0, 1.3, 2.9, 3.1, 4.7, 4.4, 6.2]);
    for (ours, theirs) in [(value, SCIPY[0]), (slope, SCIPY[1]), (bend, SCIPY[2])] {
        assert!((ours - theirs).abs() < 1e-9, "{ours} {theirs}");
    }
}

const SCIPY: [f64; 3] = [3.428571428571432, 9.499999999999979, -10.00000000000005];

#[test]
fn comfort_counts_the_time_outside_of_each_bound() {
    // 3 m/s2 for 2 s, then constant: accelerations above 2.4 are uncomfortable.
    let speed_mps = |step: i32| 3.0 * 0.1 * f64::from(step.min(20));
    let motion: Vec<[f64; 2]> = (0..60).map(|step| [speed_mps(step), 0.0]).collect();
    let comfort = judge(&motion);
    assert!((1.5..=2.0).contains(&comfort.longitudinal_s), "{comfort:?}");
    assert_eq!((comfort.lateral_s, comfort.yaw_rate_s), (0.0, 0.0));
    // A circle at 10 m/s and 0.6 rad/s: 6 m/s2 to the side, all the time that is judged.
    let motion = vec![[10.0, 0.6]; 40];
    let comfort = judge(&motion);
    assert!((comfort.lateral_s - 3.4).abs() < 1e-9, "{comfort:?}");
    assert!((comfort.any_s - 3.4).abs() < 1e-9 && comfort.jerk_s == 0.0);
    assert_eq!(judge(&motion[..6]), judge(&[]), "too short to be judged");
}

fn entrant(name: &str, make: MakePilot) -> Entrant {
    Entrant { name: name.into(), identity: serde_json::json!(null), make }
}

/// Stands for three decisions and then fails, by an error or by a panic.
struct Failing {
    decisions: u32,
    panics: bool,
}

impl Policy for Failing {
    fn name(&self) -> &str {
        "failing"
    }

    fn reset(&mut self) {
        self.decisions = 0;
    }

    fn senses(&self) -> Senses {
        Senses::NONE
    }

    fn plan(&mut self, frame: &Frame) -> Result<Plan> {
        self.decisions += 1;
        if self.decisions <= 3 {
            return Ok(Plan::default());
        }
        assert!(!self.panics, "out of its depth");
        Err(Error::Picture { frame: frame.index, what: "cannot be read".into() })
    }
}

fn failing(panics: bool) -> MakePilot {
    Box::new(move || {
        let policy = Box::new(Failing { decisions: 0, panics });
        Ok(Box::new(PolicyPilot::new(policy, ControlConfig::default(), Fusion::A1)) as _)
    })
}

fn contest(out: &Path, jobs: usize, episodes: u32) -> Contest {
    let expert: MakePilot = Box::new(|| Ok(Box::new(ExpertPilot::default())));
    let oracle: MakePilot = Box::new(|| Ok(Box::new(OraclePilot::new(ControlConfig::default()))));
    Contest {
        suite: short_suite(Density::Few, episodes, 6.0),
        entrants: vec![
            entrant("expert", expert),
            entrant("oracle", oracle),
            entrant("error", failing(false)),
            entrant("panic", failing(true)),
        ],
        maps: None,
        record: false,
        jobs,
        out: out.to_path_buf(),
    }
}

/// Rows as bytes, and how many episodes were driven for them.
fn driven(contest: &Contest) -> (Vec<u8>, Vec<EpisodeRow>, usize) {
    let driven = Mutex::new(0);
    let (rows, _) = contest
        .drive(&|progress| {
            if let Progress::Driven(_) = progress {
                *driven.lock().unwrap() += 1;
            }
        })
        .unwrap();
    let path = contest.out.join("rows.parquet");
    let _ = std::fs::remove_file(&path);
    results::write(&path, &rows).unwrap();
    let driven = driven.into_inner().unwrap();
    (std::fs::read(&path).unwrap(), rows, driven)
}

#[test]
fn a_contest_gives_the_same_rows_for_any_number_of_jobs_and_goes_on_where_it_was() {
    let folder = tempfile::tempdir().unwrap();
    let alone = contest(&folder.path().join("alone"), 1, 2);
    let (bytes, rows, count) = driven(&alone);
    assert_eq!(count, 8);
    let (again, _, count) = driven(&alone);
    assert_eq!((again == bytes, count), (true, 0), "nothing is driven twice");

    let both = contest(&folder.path().join("both"), 3, 2);
    assert!(driven(&both).0 == bytes);
    // As if it had been killed before two episodes were kept.
    for lost in ["expert/Town02-few-01.json", "oracle/Town02-few-00.json"] {
        std::fs::remove_file(both.out.join("episodes").join(lost)).unwrap();
    }
    let (resumed, _, count) = driven(&both);
    assert_eq!((resumed == bytes, count), (true, 2));

    let reasons: Vec<_> = rows.iter().map(|row| (&*row.policy, &*row.reason)).collect();
    assert_eq!(
        &reasons[..4],
        [
            ("expert", "timeout"),
            ("expert", "timeout"),
            ("oracle", "timeout"),
            ("oracle", "timeout")
        ]
    );
    assert!(rows[..4].iter().all(|row| row.driven_m > 5.0), "{rows:?}");
    for row in &rows[4..] {
        assert_eq!((&*row.reason, row.success), ("crashed", false));
        assert_eq!((row.suite.as_str(), row.town.as_str()), ("short", "Town02"));
    }
    assert!(rows[4].error.as_ref().unwrap().contains("cannot be read"), "{:?}", rows[4].error);
    assert!((rows[4].duration_s - 0.3).abs() < 1e-9);
    assert!(rows[6].error.as_ref().unwrap().contains("out of its depth"), "{:?}", rows[6].error);

    let other = contest(&both.out, 1, 1);
    let refused = other.drive(&|_| ()).unwrap_err();
    assert!(refused.hint().unwrap().contains("(suite)"), "{refused} {:?}", refused.hint());
}

/// PAPER's reading of table III: bearings in radians. The whole of it (216 episodes) is a suite,
/// `pmp-eval drive --policy oracle-plan --suite empty`.
#[test]
fn a_true_plan_is_driven_with_the_gains_of_the_paper_in_radians_and_not_in_degrees() {
    let progress = |control: ControlConfig| {
        let mut suite = short_suite(Density::Empty, 1, 0.0);
        suite.rules = Rules::default();
        let world = suite.world(&TOWN, &suite.episodes[0]).unwrap();
        let mut drive = Drive::new(world, suite.rules);
        let mut pilot = OraclePilot::new(control);
        pilot.begin(&suite.episodes[0].planned());
        let mut furthest_m: f64 = 0.0;
        while !drive.is_over() {
            if drive.is_due() {
                let action = pilot.act(&drive.world, &blank()).unwrap().action;
                drive.decide(Decision { wanted: action, applied: action, is_emergency: false });
            }
            drive.step();
            if drive.steps().is_multiple_of(SUBSTEPS) {
                let world = &drive.world;
                let aside_m = world.route.aside_m(world.ego().position_m, world.progress_m());
                furthest_m = furthest_m.max(aside_m.abs());
            }
        }
        (*drive.end().unwrap(), furthest_m)
    };
    let radians = ControlConfig::default();
    let (end, aside_m) = progress(radians);
    assert_eq!(end, End::Goal);
    assert!(aside_m < 1.5, "{aside_m} m beside the route");
    let mut degrees = radians;
    degrees.lateral.p = radians.lateral.p.to_degrees();
    let (_, aside_in_degrees_m) = progress(degrees);
    assert!(aside_in_degrees_m > 1.5 * aside_m, "{aside_in_degrees_m} {aside_m}");
}

/// A frame for pilots that do not look at it.
fn blank() -> Frame {
    static FRAME: LazyLock<Frame> = LazyLock::new(|| {
        let shown = Arc::new(Mutex::new(Vec::new()));
        let (shared, rig) = (shared(), Rig::default());
        let suite = short_suite(Density::Empty, 1, 0.15);
        let setting =
            Setting { suite: &suite, stage: &shared.stage, shapes: &shared.shapes, rig: &rig };
        let witness = Box::new(Witness(shown.clone()));
        let mut pilot = PolicyPilot::new(witness, ControlConfig::default(), Fusion::A1);
        outing::drive(&setting, &suite.episodes[0], "witness", &mut pilot, None).unwrap();
        shown.lock().unwrap()[0].clone()
    });
    FRAME.clone()
}

#[test]
fn deeptest_is_what_the_paper_says_of_it() {
    let full = Suite::open("deeptest", None, Extent::Full).unwrap();
    assert_eq!(full.episodes.len(), 216);
    assert_eq!(full.towns(), ["Town03", "Town05", "Town06", "Town07"]);
    let empty = Suite::open("empty", None, Extent::Full).unwrap();
    assert_eq!((empty.episodes.len(), empty.towns()), (216, full.towns()));
    assert_eq!((empty.seed, empty.rules), (full.seed, full.rules));
    assert_eq!(Suite::open("deeptest", None, Extent::Quick).unwrap().episodes.len(), 36);
    let of = |town: &str, traffic| {
        let of_task = full.episodes.iter().filter(move |e| e.town == town && e.traffic == traffic);
        of_task.map(|e| (e.sky.weather.name(), e.sky.illumination.name())).collect::<Vec<_>>()
    };
    for (town, kinds) in [("Town03", 9), ("Town07", 9), ("Town05", 4), ("Town06", 4)] {
        for traffic in [Density::Empty, Density::Regular, Density::Dense] {
            let mut skies = of(town, traffic);
            assert_eq!(skies.len(), 18);
            skies.sort();
            skies.dedup();
            assert_eq!(skies.len(), kinds, "{town}");
            let is_new = |sky: &(&str, &str)| sky.1 == "dark" || sky.0 == "storm";
            assert!(skies.iter().all(|sky| is_new(sky) == (kinds == 4)), "{town}: {skies:?}");
        }
    }
    let routes_of = |traffic| {
        let of_task =
            full.episodes.iter().filter(move |e| e.town == "Town07" && e.traffic == traffic);
        of_task.map(|e| e.number).collect::<Vec<_>>()
    };
    assert_eq!(routes_of(Density::Empty), routes_of(Density::Dense), "the same routes");
}

#[test]
fn what_a_suite_cannot_say_is_an_error_that_tells_where() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("suite.toml");
    let deeptest = include_str!("../../schemas/suites/deeptest.toml");
    let refused = |text: &str| {
        std::fs::write(&path, text).unwrap();
        let error = Suite::open(path.to_str().unwrap(), None, Extent::Full).unwrap_err();
        format!("{error} {}", error.hint().unwrap_or_default())
    };
    let said = refused(&deeptest.replace("goal_m", "goal_metres"));
    assert!(said.contains("goal_metres") && said.contains("goal_m"), "{said}");
    assert!(refused(&deeptest.replace("storm-dark", "storm-black")).contains("storm-black"));
    assert!(
        refused(&deeptest.replace("slowest_kmph = 10.0", "slowest_kmph = 0.0"))
            .contains("positive")
    );
    assert!(refused("version = 7").contains("missing field"), "{}", refused("version = 7"));
    let unknown = Suite::open("deeptset", None, Extent::Full).unwrap_err();
    assert!(unknown.hint().unwrap().contains("deeptest"), "{unknown}");
}
