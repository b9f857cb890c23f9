//! A network as OpenDRIVE 1.4, the version of CARLA's own maps.

use glam::DVec2;

use crate::{
    map::reference_line::{Piece, Shape},
    towns::{
        markings::{self, Mark},
        network::{Crosswalk, Junction, Network, Road, Tie},
        profile::{Section, Use},
        xml_text::{Xml, number},
    },
};

/// Extent of a crosswalk along the road, m.
const CROSSWALK_M: f64 = 3.0;

/// The text of a network. The same network gives the same bytes.
pub fn text(network: &Network) -> String {
    let mut xml = Xml::default();
    xml.open("OpenDRIVE", &[]);
    let [west, south, east, north] = bounds_m(network);
    xml.open(
        "header",
        &[
            ("revMajor", "1"),
            ("revMinor", "4"),
            ("name", network.name),
            ("version", "1.00"),
            ("north", &number(north)),
            ("south", &number(south)),
            ("east", &number(east)),
            ("west", &number(west)),
            ("vendor", "pmp"),
        ],
    );
    xml.line("<geoReference><![CDATA[+proj=tmerc +lat_0=0 +lon_0=0 +k=1 +x_0=0 +y_0=0 +datum=WGS84 +units=m +no_defs]]></geoReference>");
    xml.close("header");
    network.roads.iter().for_each(|road| add_road(&mut xml, road));
    network.junctions.iter().for_each(|junction| add_junction(&mut xml, junction));
    xml.close("OpenDRIVE");
    xml.text
}

fn add_road(xml: &mut Xml, road: &Road) {
    let id = road.id.to_string();
    let junction = road.junction.map_or("-1".to_string(), |id| id.to_string());
    let length_m = number(road.course.length_m());
    xml.open(
        "road",
        &[("name", &road.name), ("length", &length_m), ("id", &id), ("junction", &junction)],
    );
    xml.open("link", &[]);
    add_tie(xml, "predecessor", road.predecessor);
    add_tie(xml, "successor", road.successor);
    xml.close("link");
    xml.open("type", &[("s", "0"), ("type", road.class)]);
    xml.empty("speed", &[("max", &number(road.limit_kmh)), ("unit", "km/h")]);
    xml.close("type");
    xml.open("planView", &[]);
    road.course.pieces().iter().for_each(|piece| add_piece(xml, piece));
    xml.close("planView");
    xml.open("elevationProfile", &[]);
    add_polynomial(xml, "elevation", "s", [0.0; 4]);
    xml.close("elevationProfile");
    xml.open("lanes", &[]);
    add_polynomial(xml, "laneOffset", "s", [road.shift_m, 0.0, 0.0, 0.0]);
    for (i, section) in road.sections.iter().enumerate() {
        add_section(xml, road, i, section);
    }
    xml.close("lanes");
    if !road.crosswalks.is_empty() {
        xml.open("objects", &[]);
        for (i, crosswalk) in road.crosswalks.iter().enumerate() {
            add_crosswalk(xml, 100 * road.id + i as u32, crosswalk);
        }
        xml.close("objects");
    }
    xml.close("road");
}

fn add_tie(xml: &mut Xml, which: &str, tie: Tie) {
    let (kind, id, contact) = match tie {
        Tie::Junction(id) => ("junction", id, None),
        Tie::RoadStart(id) => ("road", id, Some("start")),
        Tie::RoadEnd(id) => ("road", id, Some("end")),
    };
    let id = id.to_string();
    let mut attributes = vec![("elementType", kind), ("elementId", id.as_str())];
    attributes.extend(contact.map(|end| ("contactPoint", end)));
    xml.empty(which, &attributes);
}

fn add_piece(xml: &mut Xml, piece: &Piece) {
    let numbers = [piece.s_m, piece.start_m.x, piece.start_m.y, piece.heading_rad, piece.length_m];
    let numbers = numbers.map(number);
    let [s, x, y, heading, length] = numbers.each_ref().map(String::as_str);
    xml.open("geometry", &[("s", s), ("x", x), ("y", y), ("hdg", heading), ("length", length)]);
    match piece.shape {
        Shape::Line => xml.empty("line", &[]),
        Shape::Arc { curvature_per_m } => {
            xml.empty("arc", &[("curvature", &number(curvature_per_m))]);
        }
        Shape::Spiral { start_per_m, end_per_m } => {
            let ends = [("curvStart", number(start_per_m)), ("curvEnd", number(end_per_m))];
            xml.empty("spiral", &ends.each_ref().map(|(key, value)| (*key, value.as_str())));
        }
        Shape::Poly3 { v } => add_cubics(xml, "poly3", &["a", "b", "c", "d"], &v, &[]),
        Shape::ParamPoly3 { u, v, p_end: _ } => {
            let keys = ["aU", "bU", "cU", "dU", "aV", "bV", "cV", "dV"];
            add_cubics(xml, "paramPoly3", &keys, &[u, v].concat(), &[("pRange", "normalized")]);
        }
    }
    xml.close("geometry");
}

fn add_cubics(xml: &mut Xml, name: &str, keys: &[&str], values: &[f64], more: &[(&str, &str)]) {
    let values: Vec<String> = values.iter().map(|value| number(*value)).collect();
    let cubics = keys.iter().copied().zip(values.iter().map(String::as_str));
    let attributes: Vec<(&str, &str)> = cubics.chain(more.iter().copied()).collect();
    xml.empty(name, &attributes);
}

/// A polynomial of the distance from its start, which is the road's or the section's.
fn add_polynomial(xml: &mut Xml, name: &str, start: &str, coefficients: [f64; 4]) {
    let [a, b, c, d] = coefficients.map(number);
    xml.empty(name, &[(start, "0"), ("a", &a), ("b", &b), ("c", &c), ("d", &d)]);
}

fn add_section(xml: &mut Xml, road: &Road, index: usize, section: &Section) {
    xml.open("laneSection", &[("s", &number(section.s_m))]);
    if !section.left.is_empty() {
        xml.open("left", &[]);
        (0..section.left.len()).rev().for_each(|place| add_lane(xml, road, index, true, place));
        xml.close("left");
    }
    xml.open("center", &[]);
    xml.open("lane", &[("id", "0"), ("type", "none"), ("level", "false")]);
    add_mark(xml, &markings::centre(road, section));
    xml.close("lane");
    xml.close("center");
    if !section.right.is_empty() {
        xml.open("right", &[]);
        (0..section.right.len()).for_each(|place| add_lane(xml, road, index, false, place));
        xml.close("right");
    }
    xml.close("laneSection");
}

fn add_lane(xml: &mut Xml, road: &Road, index: usize, is_left: bool, place: usize) {
    let section = &road.sections[index];
    let lane = if is_left { &section.left[place] } else { &section.right[place] };
    let id = (place as i32 + 1) * if is_left { 1 } else { -1 };
    let kind = match lane.used_for {
        Use::Median => "median",
        Use::Driving => "driving",
        Use::Shoulder => "shoulder",
        Use::Verge => "border",
        Use::Sidewalk => "sidewalk",
    };
    xml.open("lane", &[("id", &id.to_string()), ("type", kind), ("level", "false")]);
    if lane.predecessor.is_some() || lane.successor.is_some() {
        xml.open("link", &[]);
        for (which, linked) in [("predecessor", lane.predecessor), ("successor", lane.successor)] {
            if let Some(linked) = linked {
                xml.empty(which, &[("id", &linked.to_string())]);
            }
        }
        xml.close("link");
    }
    let grown_m = lane.end_m - lane.start_m;
    let cubic = [
        lane.start_m,
        0.0,
        3.0 * grown_m / section.length_m.powi(2),
        -2.0 * grown_m / section.length_m.powi(3),
    ];
    add_polynomial(xml, "width", "sOffset", cubic);
    markings::outer(road, index, is_left, place).iter().for_each(|mark| add_mark(xml, mark));
    xml.close("lane");
}

fn add_mark(xml: &mut Xml, mark: &Mark) {
    let Mark { start_m, kind, colour, change } = *mark;
    let start = number(start_m);
    let mut attributes = vec![
        ("sOffset", start.as_str()),
        ("type", kind),
        ("material", "standard"),
        ("color", colour),
    ];
    if kind != "none" {
        attributes.push(("width", "0.125"));
    }
    attributes.push(("laneChange", change));
    xml.empty("roadMark", &attributes);
}

fn add_crosswalk(xml: &mut Xml, id: u32, crosswalk: &Crosswalk) {
    let Crosswalk { s_m, left_m, right_m } = *crosswalk;
    let half_m = 0.5 * (left_m - right_m);
    let id = id.to_string();
    xml.open(
        "object",
        &[
            ("id", &id),
            ("name", "crosswalk"),
            ("type", "crosswalk"),
            ("s", &number(s_m)),
            ("t", &number(0.5 * (left_m + right_m))),
            ("zOffset", "0"),
            ("hdg", "0"),
            ("pitch", "0"),
            ("roll", "0"),
            ("orientation", "none"),
            ("length", &number(CROSSWALK_M)),
            ("width", &number(2.0 * half_m)),
        ],
    );
    xml.open("outline", &[]);
    for (u, v) in [(0.5, 1.0), (-0.5, 1.0), (-0.5, -1.0), (0.5, -1.0)] {
        let (u, v) = (number(u * CROSSWALK_M), number(v * half_m));
        xml.empty("cornerLocal", &[("u", &u), ("v", &v), ("z", "0")]);
    }
    xml.close("outline");
    xml.close("object");
}

fn add_junction(xml: &mut Xml, junction: &Junction) {
    let id = junction.id.to_string();
    xml.open("junction", &[("id", &id), ("name", "")]);
    for (i, connection) in junction.connections.iter().enumerate() {
        let (index, incoming) = (i.to_string(), connection.incoming.to_string());
        let connecting = connection.connecting.to_string();
        xml.open(
            "connection",
            &[
                ("id", &index),
                ("incomingRoad", &incoming),
                ("connectingRoad", &connecting),
                ("contactPoint", "start"),
            ],
        );
        for (from, to) in &connection.lanes {
            xml.empty("laneLink", &[("from", &from.to_string()), ("to", &to.to_string())]);
        }
        xml.close("connection");
    }
    xml.close("junction");
}

/// West, south, east and north of all that belongs to the roads, m.
fn bounds_m(network: &Network) -> [f64; 4] {
    let (mut low_m, mut high_m) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
    for road in &network.roads {
        let widest_m = road
            .sections
            .iter()
            .flat_map(|section| [&section.left, &section.right])
            .map(|lanes| lanes.iter().map(|lane| lane.start_m.max(lane.end_m)).sum::<f64>())
            .fold(0.0, f64::max);
        let reach_m = DVec2::splat(widest_m + road.shift_m.abs());
        for place_m in road.course.places_m() {
            low_m = low_m.min(place_m - reach_m);
            high_m = high_m.max(place_m + reach_m);
        }
    }
    [low_m.x, low_m.y, high_m.x, high_m.y]
}
