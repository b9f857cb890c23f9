//! The towns that pmp brings: sound maps, each with its own character.

use std::{collections::BTreeSet, fs, path::Path, process::Command as Process, sync::OnceLock};

use assert_cmd::Command;
use glam::DVec2;
use pmp::{
    dataset::ego::wrap_angle,
    error::Error,
    map::{
        graph::{GraphLane, LaneId},
        opendrive::{LaneKind, Road},
        planner::Planner,
        road_map::RoadMap,
    },
    towns::{
        catalogue::{plans, write_all},
        course::{Corner, Course, Pose},
        cross_sections::STREET,
        layout::lay_out,
        movement::{Exit, movements},
        network::Network,
        opendrive,
        plan::{Plan, at, bend},
    },
};
use proptest::prelude::*;
use tempfile::tempdir;

/// A town as it was laid out and as it is read back.
pub(crate) struct Town {
    pub(crate) network: Network,
    pub(crate) map: RoadMap,
}

/// All towns, in order.
pub(crate) fn towns() -> &'static [Town] {
    static TOWNS: OnceLock<Vec<Town>> = OnceLock::new();
    TOWNS.get_or_init(|| {
        let folder = tempdir().unwrap();
        let read = |plan: &Plan| {
            let network = lay_out(plan).unwrap();
            let path = folder.path().join("town.xodr");
            fs::write(&path, opendrive::text(&network)).unwrap();
            Town { network, map: RoadMap::read(&path).unwrap() }
        };
        plans().iter().map(read).collect()
    })
}

impl Town {
    fn name(&self) -> &'static str {
        self.network.name
    }

    /// Kilometres of driving lanes of roads that a test picks.
    fn lanes_km(&self, is_meant: impl Fn(&Road) -> bool) -> f64 {
        let lanes = self.map.graph().lanes().iter().enumerate();
        let meant = lanes.filter(|(id, _)| is_meant(self.map.road(*id)));
        meant.map(|(_, lane)| lane.length_m).sum::<f64>() / 1000.0
    }

    /// Ids of the roads of a street.
    fn street(&self, name: &str) -> BTreeSet<String> {
        let roads = self.network.roads.iter().filter(|road| road.name == name);
        roads.map(|road| road.id.to_string()).collect()
    }

    /// How many roads meet at each junction.
    fn arms(&self) -> Vec<usize> {
        let junctions = self.network.junctions.iter();
        junctions
            .map(|junction| {
                let ends = self.network.roads.iter().filter(|road| road.junction.is_none());
                let tie = pmp::towns::network::Tie::Junction(junction.id);
                ends.map(|road| {
                    usize::from(road.predecessor == tie) + usize::from(road.successor == tie)
                })
                .sum()
            })
            .collect()
    }
}

#[test]
fn every_town_reads_without_a_note_and_has_the_length_it_should() {
    let expected_km = [
        ("Town01", 5.0, 9.0),
        ("Town02", 2.5, 4.5),
        ("Town03", 18.0, 25.0),
        ("Town04", 18.0, 25.0),
        ("Town05", 15.0, 25.0),
        ("Town06", 18.0, 25.0),
        ("Town07", 8.0, 13.0),
    ];
    for (town, (name, least_km, most_km)) in towns().iter().zip(expected_km) {
        let km = town.lanes_km(|_| true);
        assert_eq!(town.name(), name);
        assert_eq!(town.map.notes(), Vec::<String>::new(), "{name}");
        assert!((least_km..most_km).contains(&km), "{name} has {km:.1} km of lanes");
    }
    assert_eq!(towns().len(), expected_km.len());
}

#[test]
fn every_lane_can_be_reached_from_every_other() {
    for town in towns() {
        let graph = town.map.graph();
        let reached: BTreeSet<LaneId> = graph.strongly_connected().into_iter().collect();
        let lost = (0..graph.lanes().len()).filter(|id| !reached.contains(id));
        let lost: Vec<String> = lost.map(|id| town.map.name(id)).collect();
        assert!(lost.is_empty(), "{}: {lost:?}", town.name());
    }
}

/// Direction of traffic at a place of a lane, rad.
fn heading_rad(map: &RoadMap, id: LaneId, s_m: f64) -> f64 {
    let turned_rad = if map.lane(id).along_s { 0.0 } else { std::f64::consts::PI };
    map.centre(id, s_m).heading_rad + turned_rad
}

#[test]
fn lanes_go_on_where_those_before_them_end() {
    for town in towns() {
        let map = &town.map;
        let mut links = 0;
        for (id, lane) in map.graph().lanes().iter().enumerate() {
            for next in &lane.successors {
                let (exit_m, entry_m) = (lane.exit_m(), map.lane(*next).entry_m());
                let (end, start) = (map.centre(id, exit_m), map.centre(*next, entry_m));
                let gap_m = end.position_m.distance(start.position_m);
                let turn_rad = heading_rad(map, id, exit_m) - heading_rad(map, *next, entry_m);
                let said = format!("{}: {} to {}", town.name(), map.name(id), map.name(*next));
                assert!(gap_m < 0.01, "{said}: {gap_m} m apart");
                assert!(
                    wrap_angle(turn_rad).abs() < 0.1_f64.to_radians(),
                    "{said}: {turn_rad} rad"
                );
                assert!((end.width_m - start.width_m).abs() < 0.01, "{said}: widths differ");
                links += 1;
            }
        }
        assert!(links > map.graph().lanes().len(), "{} has {links} links", town.name());
    }
}

#[test]
fn lanes_are_as_wide_as_lanes_are_and_no_turn_is_too_tight() {
    const STEP_M: f64 = 0.25;
    for town in towns() {
        for (id, lane) in town.map.graph().lanes().iter().enumerate() {
            let widths_m = [lane.from_m, lane.to_m].map(|s_m| town.map.centre(id, s_m).width_m);
            let said = format!("{}: {}", town.name(), town.map.name(id));
            // A lane that opens or closes begins or ends with nothing.
            let full_m = widths_m.iter().copied().filter(|width_m| *width_m > 1e-6);
            full_m.for_each(|width_m| {
                assert!((3.0 - 1e-6..=4.0 + 1e-6).contains(&width_m), "{said}: {width_m} m")
            });
            let steps = ((lane.to_m - lane.from_m) / STEP_M).floor() as u32;
            for step in 0..steps {
                let s_m = lane.from_m + f64::from(step) * STEP_M;
                let (a, b) = (town.map.centre(id, s_m), town.map.centre(id, s_m + STEP_M));
                let turn_rad = wrap_angle(b.heading_rad - a.heading_rad).abs();
                let radius_m = a.position_m.distance(b.position_m) / turn_rad.max(1e-9);
                assert!(radius_m >= 4.5, "{said}: a radius of {radius_m:.2} m at {s_m:.1} m");
            }
        }
    }
}

/// All lanes of a road, outlined piece by piece, with their kind.
pub(crate) fn outlines_m(road: &Road) -> Vec<(LaneKind, [DVec2; 4])> {
    const PIECE_M: f64 = 1.0;
    let mut outlines = Vec::new();
    for (section, data) in road.sections.iter().enumerate() {
        let (from_m, to_m) = road.section_range_m(section);
        let pieces = ((to_m - from_m) / PIECE_M).ceil().max(1.0);
        for piece in 0..pieces as u32 {
            let s_m = |i: u32| from_m + (to_m - from_m) * f64::from(i) / pieces;
            for (index, lane) in data.lanes.iter().enumerate() {
                let edge = |s_m: f64| {
                    let borders = road.borders(section, index, s_m);
                    [borders.inner_t_m, borders.outer_t_m].map(|t| road.place(s_m, t).truncate())
                };
                let ([a, b], [c, d]) = (edge(s_m(piece)), edge(s_m(piece + 1)));
                outlines.push((lane.kind, [a, b, d, c]));
            }
        }
    }
    outlines
}

/// Whether a place lies inside of an outline, by the edges that a ray to the east crosses.
pub(crate) fn contains(outline_m: &[DVec2], place_m: DVec2) -> bool {
    let edges = outline_m.iter().zip(outline_m.iter().cycle().skip(1));
    let crossed = edges.filter(|(a, b)| {
        let is_level = (a.y > place_m.y) != (b.y > place_m.y);
        is_level && place_m.x < a.x + (place_m.y - a.y) / (b.y - a.y) * (b.x - a.x)
    });
    crossed.count() % 2 == 1
}

#[test]
fn roads_overlap_in_junctions_only() {
    for town in towns() {
        let roads = &town.map.opendrive().roads;
        let outside: Vec<&Road> = roads.iter().filter(|road| road.junction.is_none()).collect();
        let outlines: Vec<_> = outside.iter().map(|road| outlines_m(road)).collect();
        let bounds: Vec<(DVec2, DVec2)> = outlines
            .iter()
            .map(|of_road| {
                let points = || of_road.iter().flat_map(|(_, outline)| outline.iter().copied());
                (points().reduce(DVec2::min).unwrap(), points().reduce(DVec2::max).unwrap())
            })
            .collect();
        for (i, of_road) in outlines.iter().enumerate() {
            // Middles of lanes, and places just within their edges.
            let places = of_road.iter().flat_map(|(_, [a, b, c, d])| {
                let middle = 0.25 * (*a + *b + *c + *d);
                [*a, *b, *c, *d, middle].map(|corner| corner.lerp(middle, 0.05))
            });
            for place_m in places {
                for j in (0..outlines.len()).filter(|j| *j != i) {
                    let (low, high) = bounds[j];
                    let is_near = place_m.cmpge(low).all() && place_m.cmple(high).all();
                    let covers = |(_, outline): &(LaneKind, [DVec2; 4])| contains(outline, place_m);
                    assert!(
                        !(is_near && outlines[j].iter().any(covers)),
                        "{}: roads {} and {} overlap at {place_m}",
                        town.name(),
                        outside[i].id,
                        outside[j].id
                    );
                }
            }
        }
    }
}

#[test]
fn routes_of_useful_lengths_can_be_found() {
    for town in towns() {
        let planner = Planner::new(&town.map, 30.0);
        let outside: Vec<LaneId> = (0..town.map.graph().lanes().len())
            .filter(|id| !town.map.lane(*id).in_junction)
            .collect();
        let mut useful = 0;
        for (i, start) in outside.iter().enumerate().step_by(outside.len() / 8) {
            for goal in outside.iter().skip(i % 3).step_by(3) {
                let cost_m = planner.between_lanes(&[*start], &[*goal]).unwrap().cost_m;
                useful += usize::from((350.0..=1500.0).contains(&cost_m));
            }
        }
        assert!(useful >= 18, "{}: {useful} routes of 350 to 1500 m", town.name());
    }
}

#[test]
fn each_town_has_its_character() {
    let [t1, t2, t3, t4, t5, t6, t7] = towns() else { panic!("not seven towns") };
    let count = |town: &Town, arms: usize| town.arms().iter().filter(|n| **n == arms).count();

    // Small grids: Ts before crossings of four, nothing larger; 02 has Ts alone and is smaller.
    assert!(count(t1, 3) > 2 * count(t1, 4) && count(t1, 4) > 0);
    assert_eq!(count(t1, 3) + count(t1, 4), t1.arms().len());
    assert_eq!(count(t2, 3), t2.arms().len());
    assert!(t2.lanes_km(|_| true) < t1.lanes_km(|_| true));

    // A roundabout of two lanes with four arms in 03: four quarters, driven anticlockwise.
    assert_eq!(t3.street("Plaza").len(), 4);
    let (turn_rad, lanes) = around(t3, "Plaza");
    assert!((turn_rad - std::f64::consts::TAU).abs() < 1e-6, "{turn_rad} rad around the plaza");
    assert_eq!(lanes, 8, "four quarters, four ways from one into the next");
    let multi_lane = |road: &Road| driving_lanes(road) >= 4 && road.junction.is_none();
    assert!(t3.lanes_km(multi_lane) > 5.0);

    // Motorways above 80 km/h in 04 alone; narrow town streets beside them.
    let is_fast = |road: &Road| limit_kmh(road) > 81.0;
    for town in towns() {
        let km = town.lanes_km(is_fast);
        assert_eq!(km > 8.0, town.name() == "Town04", "{}: {km:.1} km", town.name());
    }
    assert!(t4.lanes_km(|road| limit_kmh(road) < 51.0) > 4.0);

    // Wide crossings of streets of many lanes in 05.
    let share = t5.lanes_km(multi_lane) / t5.lanes_km(|road| road.junction.is_none());
    assert!(share > 0.9, "{share} of the lanes are in wide streets");
    assert_eq!(count(t5, 4), 4);

    // An expressway of one-way carriageways in 06, with loops to turn back.
    let is_carriageway = |road: &Road| limit_kmh(road) > 70.0 && driving_lanes(road) == 3;
    assert!(t6.lanes_km(is_carriageway) > 5.0);
    assert_eq!(t6.street("Turnaround").len(), 4);
    let ramps = t6.street("Entry").len() + t6.street("Exit").len();
    assert_eq!(ramps, 8);

    // Narrow lanes without side-walks in 07, and only there.
    for town in towns() {
        let sections = town.map.opendrive().roads.iter().flat_map(|road| &road.sections);
        let mut lanes = sections.flat_map(|section| &section.lanes);
        let has_sidewalks = lanes.any(|lane| lane.kind == LaneKind::Sidewalk);
        assert_eq!(has_sidewalks, town.name() != "Town07");
    }
    let widest_m = (0..t7.map.graph().lanes().len())
        .map(|id| t7.map.centre(id, t7.map.lane(id).from_m).width_m)
        .fold(0.0, f64::max);
    assert!(widest_m <= 3.25 + 1e-9);
}

fn limit_kmh(road: &Road) -> f64 {
    road.speed_limit_mps(0, -1, 0.0).unwrap() * 3.6
}

fn driving_lanes(road: &Road) -> usize {
    let lanes = road.sections[0].lanes.iter();
    lanes.filter(|lane| lane.kind == LaneKind::Driving).count()
}

/// Drive around a street that ends where it begins, in its outermost lane: the sum of all turns,
/// and the lanes that were driven.
fn around(town: &Town, name: &str) -> (f64, usize) {
    let (map, street) = (&town.map, town.street(name));
    let is_of_street = |id: LaneId| street.contains(&map.road(id).id);
    let start = (0..map.graph().lanes().len()).find(|id| is_of_street(*id)).unwrap();
    let (mut lane, mut turn_rad, mut driven) = (start, 0.0, 0);
    loop {
        turn_rad += turned_rad(map, lane);
        driven += 1;
        let ahead = map.lane(lane).successors.iter().copied();
        let stays = |id: &LaneId| {
            is_of_street(*id) || map.lane(*id).successors.iter().any(|next| is_of_street(*next))
        };
        lane = ahead.clone().find(stays).unwrap();
        if lane == start {
            return (turn_rad, driven);
        }
    }
}

/// How far a lane turns, positive to the left.
fn turned_rad(map: &RoadMap, id: LaneId) -> f64 {
    let GraphLane { from_m, to_m, .. } = map.lane(id);
    let at = |i: u32| heading_rad(map, id, from_m + (to_m - from_m) * f64::from(i) / 64.0);
    (0..64).map(|i| wrap_angle(at(i + 1) - at(i))).sum()
}

#[test]
fn the_same_plan_gives_the_same_text_on_any_thread() {
    let text = || plans().iter().map(|plan| opendrive::text(&lay_out(plan).unwrap())).collect();
    let here: Vec<String> = text();
    let there: Vec<String> = std::thread::spawn(text).join().unwrap();
    assert!(here == there);
    assert!(here.iter().all(|text| !text.contains("NaN") && !text.contains("inf")));
}

#[test]
fn plans_that_cannot_be_built_say_what_is_wrong() {
    let ring = |plan: &mut Plan| {
        plan.street(
            "North",
            &STREET,
            &[at(0.0, 0.0), bend(0.0, 80.0, 20.0), bend(100.0, 80.0, 20.0), at(100.0, 0.0)],
        );
        plan.street(
            "South",
            &STREET,
            &[at(0.0, 0.0), bend(0.0, -80.0, 20.0), bend(100.0, -80.0, 20.0), at(100.0, 0.0)],
        );
    };
    let fault = |draw: &dyn Fn(&mut Plan)| {
        let mut plan = Plan::new("Nowhere");
        ring(&mut plan);
        draw(&mut plan);
        match lay_out(&plan) {
            Err(Error::Config { key, what, .. }) => format!("{key}: {what}"),
            other => panic!("{other:?}"),
        }
    };
    let dead_end = fault(&|plan| plan.street("Lane", &STREET, &[at(0.0, 0.0), at(40.0, 0.0)]));
    assert!(dead_end.contains("fewer than three streets meet at"), "{dead_end}");
    let tight = fault(&|plan| {
        plan.street("Lane", &STREET, &[at(0.0, 0.0), bend(50.0, 30.0, 200.0), at(100.0, 0.0)]);
    });
    assert!(tight.contains("Lane: the corner at (50, 30) has no room"), "{tight}");
    let short = fault(&|plan| {
        plan.street("Lane", &STREET, &[at(0.0, 0.0), at(20.0, 0.0), at(100.0, 0.0)]);
        plan.street("Alley", &STREET, &[at(20.0, 0.0), bend(20.0, 40.0, 9.0), at(100.0, 0.0)]);
    });
    assert!(short.contains("too short"), "{short}");
}

#[test]
fn lanes_keep_their_order_through_a_junction() {
    let exit = |turn_deg: f64, lanes| Exit { turn_rad: turn_deg.to_radians(), lanes };
    let ways = |lanes, exits: &[Exit]| -> Vec<(usize, usize, usize)> {
        let found = movements(lanes, exits);
        found.iter().map(|way| (way.exit, way.from_lane, way.to_lane)).collect()
    };
    // One lane goes everywhere.
    let cross = [exit(90.0, 1), exit(0.0, 1), exit(-90.0, 1)];
    assert_eq!(ways(1, &cross), [(0, 0, 0), (1, 0, 0), (2, 0, 0)]);
    // A further lane on the right turns right.
    assert_eq!(ways(2, &cross), [(0, 0, 0), (1, 0, 0), (2, 1, 0)]);
    // The stem of a T: the left lane turns left.
    assert_eq!(ways(2, &[exit(90.0, 2), exit(-90.0, 2)]), [(0, 0, 0), (1, 1, 1)]);
    // Who joins a motorway from the right joins its outermost lane, from the left the innermost.
    assert_eq!(ways(1, &[exit(-25.0, 3)]), [(0, 0, 2)]);
    assert_eq!(ways(1, &[exit(25.0, 3)]), [(0, 0, 0)]);
    assert_eq!(ways(2, &[exit(0.0, 3)]), [(0, 0, 0), (0, 1, 1)]);
    // Where a lane ends, it leads into the last that goes on.
    assert_eq!(ways(2, &[exit(0.0, 1)]), [(0, 0, 0), (0, 1, 0)]);
}

proptest! {
    #[test]
    fn every_lane_leads_somewhere_and_no_two_cross(
        lanes in 1_usize..6,
        mut turns in prop::collection::vec((-2.3_f64..2.3, 1_usize..5), 1..5),
    ) {
        turns.sort_by(|a, b| b.0.total_cmp(&a.0));
        let exits: Vec<Exit> =
            turns.iter().map(|(turn_rad, lanes)| Exit { turn_rad: *turn_rad, lanes: *lanes }).collect();
        let found = movements(lanes, &exits);
        let used: BTreeSet<usize> = found.iter().map(|way| way.from_lane).collect();
        prop_assert_eq!(used, (0..lanes).collect());
        let reached: BTreeSet<usize> = found.iter().map(|way| way.exit).collect();
        prop_assert_eq!(reached, (0..exits.len()).collect());
        for a in &found {
            prop_assert!(a.to_lane < exits[a.exit].lanes);
            for b in found.iter().filter(|b| a.from_lane < b.from_lane) {
                prop_assert!((a.exit, a.to_lane) <= (b.exit, b.to_lane), "{:?} crosses {:?}", a, b);
            }
        }
    }

    #[test]
    fn courses_are_smooth_and_end_where_they_should(
        ahead in 60.0_f64..300.0, aside in -120.0_f64..120.0, radius_m in 10.0_f64..40.0,
        spiral_m in prop_oneof![Just(0.0), 5.0_f64..15.0],
    ) {
        prop_assume!(aside.abs() > 20.0);
        let corners = [Corner { at_m: DVec2::new(ahead, 0.0), radius_m, spiral_m }];
        let to_m = DVec2::new(ahead + 150.0, aside);
        if let Ok(course) = Course::through(DVec2::ZERO, &corners, to_m) {
            prop_assert!(course.end().position_m.distance(to_m) < 1e-6);
            is_smooth(&course)?;
            let part = course.cut(10.0, course.length_m() - 10.0);
            prop_assert!((part.length_m() - course.length_m() + 20.0).abs() < 1e-6);
            prop_assert!(part.end().position_m.distance(to_m) - 10.0 < 1e-6);
            is_smooth(&part)?;
        }
    }

    #[test]
    fn ways_through_junctions_leave_and_arrive_in_the_lanes_directions(
        x in 8.0_f64..40.0, y in -40.0_f64..40.0, turn_rad in -2.3_f64..2.3, heading_rad in -3.0_f64..3.0,
    ) {
        let from = Pose { position_m: DVec2::new(5.0, -7.0), heading_rad };
        let offset = DVec2::from_angle(heading_rad).rotate(DVec2::new(x, y));
        let to = Pose { position_m: from.position_m + offset, heading_rad: heading_rad + turn_rad };
        let course = Course::joining(from, to);
        prop_assert!(course.start().position_m.distance(from.position_m) < 1e-9);
        prop_assert!(course.end().position_m.distance(to.position_m) < 1e-6);
        prop_assert!(wrap_angle(course.start().heading_rad - from.heading_rad).abs() < 1e-9);
        prop_assert!(wrap_angle(course.end().heading_rad - to.heading_rad).abs() < 1e-6);
        is_smooth(&course)?;
    }
}

/// Each piece begins where the one before ends.
fn is_smooth(course: &Course) -> Result<(), TestCaseError> {
    for pieces in course.pieces().windows(2) {
        let end = pieces[0].at(pieces[0].length_m);
        prop_assert!(end.position_m.distance(pieces[1].start_m) < 1e-9);
        prop_assert!(wrap_angle(end.heading_rad - pieces[1].heading_rad).abs() < 1e-9);
        prop_assert!((pieces[0].s_m + pieces[0].length_m - pieces[1].s_m).abs() < 1e-9);
    }
    Ok(())
}

#[test]
fn pmp_sim_writes_the_towns_and_overwrites_nothing() {
    let folder = tempdir().unwrap();
    let out = folder.path().join("maps");
    let run = || Command::cargo_bin("pmp-sim").unwrap().args(["towns", "--out"]).arg(&out).output();
    let first = run().unwrap();
    assert_eq!(first.status.code(), Some(0), "{first:?}");
    let paths: Vec<_> = (1..=7).map(|i| out.join(format!("Town0{i}.xodr"))).collect();
    let said = String::from_utf8(first.stdout).unwrap();
    assert_eq!(
        said.lines().collect::<Vec<_>>(),
        paths.iter().map(|p| p.to_str().unwrap()).collect::<Vec<_>>()
    );
    let texts: Vec<_> = paths.iter().map(|path| fs::read(path).unwrap()).collect();
    assert_eq!(run().unwrap().status.code(), Some(0), "the same bytes may be there");

    fs::remove_file(&paths[0]).unwrap();
    fs::write(&paths[4], "mine").unwrap();
    let refused = run().unwrap();
    assert_eq!(refused.status.code(), Some(1));
    let message = String::from_utf8(refused.stderr).unwrap();
    assert!(message.contains("will not overwrite") && message.contains("Town05.xodr"), "{message}");
    assert_eq!(fs::read(&paths[4]).unwrap(), b"mine");
    assert!(!paths[0].exists(), "all or nothing");
    fs::remove_file(&paths[4]).unwrap();
    write_all(&out).unwrap();
    assert!(paths.iter().zip(&texts).all(|(path, text)| fs::read(path).unwrap() == *text));
}

/// Eclipse SUMO's converter: beside the build (`pip install eclipse-sumo`), or on the path.
fn netconvert() -> Option<Process> {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("target/peers/bin/netconvert");
    let names = [beside.as_path(), Path::new("netconvert")];
    let found = names.into_iter().find(|name| Process::new(name).arg("--version").output().is_ok());
    if found.is_none() {
        eprintln!("skipped: no netconvert of Eclipse SUMO");
    }
    found.map(Process::new)
}

#[test]
fn another_reader_of_opendrive_sees_the_same_lanes() {
    if netconvert().is_none() {
        return;
    }
    let folder = tempdir().unwrap();
    for town in towns() {
        let (map, net) = (folder.path().join("town.xodr"), folder.path().join("town.net.xml"));
        fs::write(&map, opendrive::text(&town.network)).unwrap();
        let mut process = netconvert().unwrap();
        process.args(["--geometry.remove", "false", "--no-turnarounds", "--opendrive-files"]);
        let out = process.arg(&map).arg("--output-file").arg(&net).output().unwrap();
        let said = String::from_utf8_lossy(&out.stderr).into_owned();
        assert!(out.status.success() && !said.contains("Error"), "{}: {said}", town.name());
        // Lanes of edges that lie outside of junctions, whose ids begin with a colon.
        let text = fs::read_to_string(&net).unwrap();
        let value = |line: &str, key: &str| {
            let rest = line.split_once(&format!(" {key}=\"")).unwrap().1;
            rest.split('"').next().unwrap().to_string()
        };
        let lanes = text.lines().map(str::trim).filter(|line| line.starts_with("<lane "));
        let outside = lanes.filter(|line| !value(line, "id").starts_with(':'));
        let theirs_m: f64 = outside.map(|line| value(line, "length").parse::<f64>().unwrap()).sum();
        // Lanes that open or close are no lanes there.
        let lanes = town.map.graph().lanes().iter().enumerate();
        let full = lanes.filter(|(id, lane)| {
            let is_there = |s_m: f64| town.map.centre(*id, s_m).width_m > 1e-6;
            !lane.in_junction && is_there(lane.from_m) && is_there(lane.to_m)
        });
        let ours_m: f64 = full.map(|(_, lane)| lane.length_m).sum();
        assert!(
            (theirs_m / ours_m - 1.0).abs() < 0.01,
            "{}: {theirs_m} m, {ours_m} m",
            town.name()
        );
    }
}
