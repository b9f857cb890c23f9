//! Defects that towns of CARLA have, one small map each, and files that are no maps.

use glam::DVec2;
use pmp::{
    error::Error,
    map::{
        planner::{LanePlace, Planner},
        road_map::RoadMap,
        route::MapRoute,
    },
};

use crate::map_fixtures::{MapFile, StraightRoad, opendrive, section};

const ON: Option<i32> = Some(-1);

fn road<'a>(id: &'a str, x_m: f64, length_m: f64, lanes: &'a str) -> StraightRoad<'a> {
    StraightRoad { id, x_m, length_m, attributes: "", link: "", lanes }
}

fn map(roads: &[StraightRoad], junctions: &str) -> RoadMap {
    let roads: String = roads.iter().map(StraightRoad::xml).collect();
    MapFile::new(&opendrive(&(roads + junctions))).read().unwrap()
}

fn cost_m(map: &RoadMap, start: &str, goal: &str, lane_change_m: f64) -> Option<f64> {
    let planner = Planner::new(map, lane_change_m);
    planner.between_lanes(map.find(start)?, map.find(goal)?).map(|plan| plan.cost_m)
}

#[test]
fn sections_of_no_length_are_contracted_and_can_still_be_named() {
    let one = [(-1, ON, ON)];
    let lanes = [0.0, 50.0, 50.0, 50.2, 50.3].map(|s| section(s, &one)).concat();
    let map = map(&[road("7", 0.0, 100.0, &lanes)], "");
    let lanes = map.graph().lanes();
    assert_eq!(lanes.len(), 2);
    assert_eq!(map.name(lanes[0].successors[0]), "7/4/-1");
    assert_eq!(map.graph().contracted(), 3);
    for contracted in ["7/1/-1", "7/2/-1", "7/3/-1"] {
        assert_eq!(map.find(contracted), Some(&[1][..]));
    }
    assert_eq!(cost_m(&map, "7/0/-1", "7/2/-1", 0.0), cost_m(&map, "7/0/-1", "7/4/-1", 0.0));
    assert!((lanes[0].length_m + lanes[1].length_m - 99.7).abs() < 1e-9);
    assert_eq!(map.notes().len(), 1);
}

#[test]
fn a_contracted_section_without_links_is_joined_by_place() {
    let lanes = section(0.0, &[(-1, None, None), (-2, None, None)])
        + &section(40.0, &[(-1, None, None), (-2, None, None)])
        + &section(40.2, &[(-1, None, None), (-2, None, None)]);
    let map = map(&[road("1", 0.0, 80.0, &lanes)], "");
    assert_eq!(map.graph().lanes().len(), 4);
    let next: Vec<String> =
        map.graph().lanes()[1].successors.iter().map(|lane| map.name(*lane)).collect();
    assert_eq!(next, ["1/2/-2"]);
}

#[test]
fn roads_of_no_length_are_driven_through_and_missing_roads_are_counted() {
    let lanes = section(0.0, &[(-1, ON, ON)]);
    let link = |before: &str, after: &str| {
        let part = |name: &str, id: &str| {
            format!("<{name} elementType=\"road\" elementId=\"{id}\" contactPoint=\"start\"/>")
        };
        part("predecessor", before) + &part("successor", after)
    };
    let links = [link("9", "2"), link("1", "3"), link("2", "8")];
    let mut roads =
        [road("1", 0.0, 60.0, &lanes), road("2", 60.0, 0.0, &lanes), road("3", 60.0, 30.0, &lanes)];
    for (road, link) in roads.iter_mut().zip(&links) {
        road.link = link;
    }
    let map = map(&roads, "");
    assert_eq!(map.graph().lanes().len(), 2);
    assert!((cost_m(&map, "1/0/-1", "3/0/-1", 0.0).unwrap() - 60.0).abs() < 0.51);
    assert_eq!(cost_m(&map, "3/0/-1", "1/0/-1", 0.0), None, "there is no way back");
    assert_eq!(map.graph().broken_links().to_roads, 1);
    assert!(map.nearest(DVec2::new(59.9, -2.0)).is_some());
}

#[test]
fn a_late_lane_offset_moves_no_lane_sideways() {
    let offset =
        |s: f64, a: f64| format!("<laneOffset s=\"{s}\" a=\"{a}\" b=\"0\" c=\"0\" d=\"0\"/>");
    // A lane more to the left from 50 m on; the ids on the right count one more.
    let sections = section(0.0, &[(-1, None, Some(-2)), (-2, ON, Some(-3))])
        + &section(50.0, &[(-1, None, None), (-2, ON, None), (-3, Some(-2), None)]);
    for stray_m in [-0.7, -1e-7, 0.0, 1e-7, 0.7, 3.0] {
        let lanes = offset(0.0, 0.0) + &offset(50.0 + stray_m, 3.5) + &sections;
        let map = map(&[road("1", 0.0, 100.0, &lanes)], "");
        let start = map.find("1/0/-1").unwrap()[0];
        let goal = map.find("1/1/-2").unwrap()[0];
        assert_eq!(map.lane(start).successors, [goal]);
        for s_m in 1..100 {
            let s_m = f64::from(s_m);
            let lane = if s_m < 50.0 { start } else { goal };
            let y_m = map.centre(lane, s_m).position_m.y;
            assert!((y_m + 1.75).abs() < 1e-9, "offset {stray_m} m late: y {y_m} at {s_m}");
        }
        for lane in [start, goal] {
            for s_m in [map.lane(lane).from_m, map.lane(lane).to_m] {
                assert!((map.centre(lane, s_m).position_m.y + 1.75).abs() < 1e-9);
            }
        }
    }
}

#[test]
fn a_true_step_of_the_lane_offset_stays() {
    let lanes = "<laneOffset s=\"0\" a=\"0\"/><laneOffset s=\"20\" a=\"2\"/>".to_string()
        + &section(0.0, &[(-1, None, ON)])
        + &section(60.0, &[(-1, ON, None)]);
    let map = map(&[road("1", 0.0, 100.0, &lanes)], "");
    assert_eq!(map.centre(0, 19.0).position_m.y, -1.75);
    assert_eq!(map.centre(0, 21.0).position_m.y, 0.25);
}

#[test]
fn traffic_keeps_left_where_the_road_says_so() {
    let lanes = section(0.0, &[(1, None, None), (-1, None, None)]);
    for (attributes, heading_rad) in [("rule=\"RHT\"", 0.0), ("rule=\"LHT\"", std::f64::consts::PI)]
    {
        let road = StraightRoad { attributes, ..road("1", 0.0, 100.0, &lanes) };
        let map = map(&[road], "");
        let right = map.nearest(DVec2::new(30.0, -1.0)).unwrap();
        assert_eq!(map.name(right.lane), "1/0/-1");
        assert!((right.heading_rad - heading_rad).abs() < 1e-9);
        assert!((right.t_m + 1.0).abs() < 1e-9 && (right.s_m - 30.0).abs() < 1e-6);
    }
}

#[test]
fn junctions_lead_on_by_lane_and_links_to_missing_lanes_are_counted() {
    let lanes = section(0.0, &[(-1, ON, ON)]);
    let into = "<successor elementType=\"junction\" elementId=\"5\"/>";
    let on = "<successor elementType=\"road\" elementId=\"3\" contactPoint=\"start\"/>";
    let roads = [
        StraightRoad { link: into, ..road("1", 0.0, 50.0, &lanes) },
        StraightRoad { link: on, attributes: "junction=\"5\"", ..road("2", 50.0, 10.0, &lanes) },
        road("3", 60.0, 50.0, &lanes),
    ];
    let junction = "<junction id=\"5\" name=\"\">\
        <connection id=\"0\" incomingRoad=\"1\" connectingRoad=\"2\" contactPoint=\"start\">\
        <laneLink from=\"-1\" to=\"-1\"/><laneLink from=\"-1\" to=\"-4\"/></connection></junction>";
    let map = map(&roads, junction);
    assert!((cost_m(&map, "1/0/-1", "3/0/-1", 0.0).unwrap() - 60.0).abs() < 1.01);
    assert_eq!(map.graph().broken_links().to_lanes, 1);
    let planner = Planner::new(&map, 0.0);
    let places = [LanePlace { lane: 0, s_m: 0.0 }, LanePlace { lane: 2, s_m: 50.0 }];
    let route = MapRoute::through(&planner, &places).unwrap();
    assert!((route.length_m() - 110.0).abs() < 0.41);
    let commands: Vec<&str> = route.points.iter().map(|point| point.command.name()).collect();
    assert_eq!(commands[130], "straight");
    assert_eq!(*commands.last().unwrap(), "follow");
}

#[test]
fn lane_changes_are_smooth_and_cost_what_was_asked() {
    let lanes = section(0.0, &[(-1, None, None), (-2, None, None), (-3, None, None)]);
    let map = map(&[road("1", 0.0, 120.0, &lanes)], "");
    assert_eq!(cost_m(&map, "1/0/-1", "1/0/-3", 30.0), Some(60.0));
    let planner = Planner::new(&map, 30.0);
    let places = [LanePlace { lane: 0, s_m: 10.0 }, LanePlace { lane: 2, s_m: 110.0 }];
    let route = MapRoute::through(&planner, &places).unwrap();
    let y_m: Vec<f64> = route.points.iter().map(|point| point.position_m.y).collect();
    assert!((y_m[0] + 1.75).abs() < 1e-6 && (y_m.last().unwrap() + 8.75).abs() < 1e-3);
    // 3.5 m over 40 m, 1.875 times as steep in the middle.
    let steepest = y_m.windows(2).map(|y| (y[1] - y[0]).abs()).fold(0.0, f64::max);
    assert!((0.06..0.07).contains(&steepest), "{steepest}");
    // With no room to change, the way reaches the other lane as it goes on.
    let short = [LanePlace { lane: 0, s_m: 100.0 }, LanePlace { lane: 1, s_m: 106.0 }];
    let route = MapRoute::through(&planner, &short).unwrap();
    let steps = route.points.windows(2).map(|p| (p[1].position_m.y - p[0].position_m.y).abs());
    assert!(steps.fold(0.0, f64::max) < 0.06);
    let behind = LanePlace { lane: 0, s_m: 5.0 };
    assert_eq!(planner.between_places(places[0], behind), None, "no way round this block");
}

#[test]
fn files_that_are_no_maps_are_refused_with_element_and_line() {
    let lanes = section(0.0, &[(-1, None, None)]);
    let good = opendrive(&road("1", 0.0, 50.0, &lanes).xml());
    assert!(MapFile::new(&good).read().is_ok());
    let replaced = |from: &str, to: &str| good.replacen(from, to, 1);
    let twice =
        opendrive(&(road("1", 0.0, 50.0, &lanes).xml() + &road("1", 0.0, 5.0, &lanes).xml()));
    let cases = [
        (String::new(), "file", 1, "no well-formed XML"),
        (good[..good.len() / 2].to_string(), "center", 7, "no well-formed XML"),
        (replaced("</planView>", "</plan>"), "plan", 6, "no well-formed XML"),
        (opendrive(""), "OpenDRIVE", 2, "without a <road>"),
        ("<net>\n</net>".into(), "net", 1, "should be <OpenDRIVE>"),
        (replaced("length=\"50\"", "length=\"long\""), "road", 4, "`long`, not a number"),
        (replaced("length=\"50\"", "length=\"-1\""), "road", 4, "length -1 m"),
        (replaced("length=\"50\"", "length=\"1e300\""), "road", 4, "are possible"),
        (replaced("x=\"0\"", "x=\"nan\""), "geometry", 6, "a finite number"),
        (replaced("x=\"0\"", "x=\"1e20\""), "geometry", 6, "coordinates beyond"),
        (replaced("hdg=\"0\"", ""), "geometry", 6, "`hdg` is missing"),
        (replaced("<line/>", "<bezier/>"), "geometry", 6, "none of line, arc"),
        (replaced("<line/>", "<arc curvature=\"1e9\"/>"), "arc", 6, "tighter than any road"),
        (replaced("<line/>", "<spiral curvStart=\"0\"/>"), "spiral", 6, "`curvEnd` is missing"),
        (replaced("lane id=\"-1\"", "lane id=\"1\""), "lane", 7, "lane id 1 within <right>"),
        (replaced("lane id=\"-1\"", "lane id=\"-1.5\""), "lane", 7, "not a whole number"),
        (
            replaced("laneSection s=\"0\"", "laneSection s=\"-3\""),
            "laneSection",
            7,
            "lies on no road",
        ),
        (twice, "road", 10, "a second road with id `1`"),
    ];
    for (text, element, line, what) in cases {
        let error = MapFile::new(&text).read().unwrap_err();
        let message = error.to_string();
        let Error::Map { element: found, line: at, .. } = &error else { panic!("{message}") };
        assert_eq!((found.as_str(), *at), (element, line), "{message}");
        assert!(message.contains(what) && message.contains("map.xodr"), "{message}");
        assert!(error.hint().is_some(), "{message}");
    }
}

#[test]
fn text_that_is_no_utf8_is_refused_at_its_line() {
    let file = MapFile::new("");
    std::fs::write(&file.path, b"<OpenDRIVE>\n\xff\xfe</OpenDRIVE>").unwrap();
    let message = file.read().unwrap_err().to_string();
    assert!(message.contains("line 2") && message.contains("UTF-8"), "{message}");
}
