//! OpenDRIVE from XML. What pmp does not use is passed over; what it uses must make sense.

use std::{collections::HashSet, f64::consts::TAU, path::Path};

use glam::DVec2;

use crate::{
    error::Result,
    map::{
        opendrive::{
            Connection, Crosswalk, Junction, Lane, LaneChange, LaneKind, MarkKind, OpenDrive, Road,
            RoadLink, RoadMark, Section, SpeedLimit,
        },
        profile::{Cubic, Profile},
        reference_line::{Piece, ReferenceLine, Shape},
        xml::{self, Element},
    },
};

/// Longest road, m.
const MAX_ROAD_M: f64 = 100_000.0;

/// All roads together, m: what is made of a map grows with it.
const MAX_ROADS_M: f64 = 2_000_000.0;

/// Highest lane id on either side.
const MAX_LANES: i32 = 64;

/// Tightest curve, 1/m.
const MAX_CURVATURE_PER_M: f64 = 100.0;

/// Where a map lies: coordinates beyond lose millimetres, m.
const MAX_COORDINATE_M: f64 = 1e8;

/// Read a map.
///
/// # Errors
///
/// [`crate::error::Error::Io`] if the file cannot be read, [`crate::error::Error::Map`] with
/// element and line if it is no XML or no OpenDRIVE, or exceeds a limit.
pub fn read(path: &Path) -> Result<OpenDrive> {
    parse(path, &xml::read_text(path)?)
}

/// Read a map's text; `path` is what errors call it.
///
/// # Errors
///
/// As [`read`].
pub fn parse(path: &Path, text: &str) -> Result<OpenDrive> {
    let document = xml::parse(path, text)?;
    let root = Element::root(&document, path, "OpenDRIVE")?;
    let (mut roads, mut ids, mut total_m) = (Vec::new(), HashSet::new(), 0.0);
    for element in root.children("road") {
        let road = read_road(element)?;
        total_m += road.length_m;
        if total_m > MAX_ROADS_M {
            return Err(element.fault(format!("more than {MAX_ROADS_M} m of roads")));
        }
        if !ids.insert(road.id.clone()) {
            return Err(element.fault(format!("a second road with id `{}`", road.id)));
        }
        roads.push(road);
    }
    if roads.is_empty() {
        return Err(root.fault("a map without a <road>".into()));
    }
    let junctions = root.children("junction").map(read_junction).collect::<Result<_>>()?;
    Ok(OpenDrive { roads, junctions })
}

fn read_road(road: Element) -> Result<Road> {
    let length_m = road.number("length")?;
    if !(0.0..=MAX_ROAD_M).contains(&length_m) {
        return Err(road.fault(format!("length {length_m} m, 0 to {MAX_ROAD_M} m are possible")));
    }
    let link = |name| road.child("link").and_then(|link| link.child(name));
    let lanes = road.needed_child("lanes")?;
    Ok(Road {
        id: road.text("id")?.to_string(),
        length_m,
        junction: Some(road.attribute("junction").unwrap_or("-1"))
            .filter(|id| !id.is_empty() && *id != "-1")
            .map(str::to_string),
        left_hand: road.attribute("rule").is_some_and(|rule| rule.eq_ignore_ascii_case("LHT")),
        predecessor: link("predecessor").map(read_road_link).transpose()?,
        successor: link("successor").map(read_road_link).transpose()?,
        speed_limits: read_road_limits(road)?,
        reference_line: read_reference_line(road.needed_child("planView")?)?,
        elevation: read_profile(road.child("elevationProfile"), "elevation", "s")?,
        lane_offset: read_profile(Some(lanes), "laneOffset", "s")?,
        sections: read_sections(lanes)?,
        crosswalks: read_crosswalks(road.child("objects"))?,
    })
}

fn read_road_link(link: Element) -> Result<RoadLink> {
    let id = link.text("elementId")?.to_string();
    match link.text("elementType")? {
        "road" => Ok(RoadLink::Road(id)),
        "junction" => Ok(RoadLink::Junction(id)),
        other => Err(link.fault(format!("elementType `{other}` is neither road nor junction"))),
    }
}

fn read_road_limits(road: Element) -> Result<Vec<SpeedLimit>> {
    let mut limits = Vec::new();
    for kind in road.children("type") {
        let limit_mps = kind.child("speed").map(speed_mps).transpose()?.flatten();
        limits.push(SpeedLimit { s_m: kind.number("s")?, limit_mps });
    }
    limits.sort_by(|a, b| a.s_m.total_cmp(&b.s_m));
    Ok(limits)
}

/// A limit in metres per second; none if the file says that there is none.
fn speed_mps(speed: Element) -> Result<Option<f64>> {
    if matches!(speed.text("max")?, "no limit" | "undefined") {
        return Ok(None);
    }
    let factor = match speed.attribute("unit").unwrap_or("m/s") {
        "m/s" | "" => 1.0,
        "km/h" => 1.0 / 3.6,
        "mph" => 0.44704,
        other => return Err(speed.fault(format!("unit `{other}` is none of m/s, km/h, mph"))),
    };
    Ok(Some(speed.number("max")? * factor))
}

fn read_reference_line(plan: Element) -> Result<ReferenceLine> {
    let mut pieces = Vec::new();
    for geometry in plan.children("geometry") {
        let length_m = geometry.number("length")?;
        if !(0.0..=2.0 * MAX_ROAD_M).contains(&length_m) {
            return Err(geometry.fault(format!("length {length_m} m is not possible")));
        }
        let start_m = DVec2::new(geometry.number("x")?, geometry.number("y")?);
        if start_m.abs().max_element() > MAX_COORDINATE_M {
            return Err(geometry.fault(format!("coordinates beyond {MAX_COORDINATE_M} m")));
        }
        pieces.push(Piece {
            s_m: geometry.number("s")?,
            length_m,
            start_m,
            heading_rad: geometry.number("hdg")?,
            shape: read_shape(geometry, length_m)?,
        });
    }
    ReferenceLine::new(pieces).ok_or_else(|| plan.fault("<geometry> is missing".into()))
}

fn read_shape(geometry: Element, length_m: f64) -> Result<Shape> {
    let known = ["line", "arc", "spiral", "poly3", "paramPoly3"];
    let Some(shape) = geometry.elements().find(|child| known.contains(&child.name())) else {
        return Err(geometry.fault(format!("a geometry that is none of {}", known.join(", "))));
    };
    let curvature = |name| {
        let curvature = shape.number(name)?;
        if curvature.abs() <= MAX_CURVATURE_PER_M {
            return Ok(curvature);
        }
        Err(shape.fault(format!("`{name}` of {curvature} /m is tighter than any road")))
    };
    let cubic = |names: [&str; 4]| -> Result<[f64; 4]> {
        let [a, b, c, d] = names.map(|name| shape.number(name));
        Ok([a?, b?, c?, d?])
    };
    Ok(match shape.name() {
        "line" => Shape::Line,
        "arc" => Shape::Arc { curvature_per_m: curvature("curvature")? },
        "spiral" => {
            Shape::Spiral { start_per_m: curvature("curvStart")?, end_per_m: curvature("curvEnd")? }
        }
        "poly3" => Shape::Poly3 { v: cubic(["a", "b", "c", "d"])? },
        _ => Shape::ParamPoly3 {
            u: cubic(["aU", "bU", "cU", "dU"])?,
            v: cubic(["aV", "bV", "cV", "dV"])?,
            p_end: match shape.attribute("pRange").unwrap_or("normalized") {
                "arcLength" => length_m,
                "normalized" => 1.0,
                other => {
                    let what = format!("pRange `{other}` is neither arcLength nor normalized");
                    return Err(shape.fault(what));
                }
            },
        },
    })
}

fn read_profile(parent: Option<Element>, name: &'static str, start: &str) -> Result<Profile> {
    let Some(parent) = parent else { return Ok(Profile::default()) };
    let records = parent.children(name).map(|record| {
        Ok(Cubic {
            start_m: record.number(start)?,
            a: record.number("a")?,
            b: record.number_or("b", 0.0)?,
            c: record.number_or("c", 0.0)?,
            d: record.number_or("d", 0.0)?,
        })
    });
    Ok(Profile::new(records.collect::<Result<_>>()?))
}

fn read_sections(lanes: Element) -> Result<Vec<Section>> {
    let mut sections = Vec::new();
    for element in lanes.children("laneSection") {
        let s_m = element.number("s")?;
        if !(0.0..=MAX_ROAD_M).contains(&s_m) {
            return Err(element.fault(format!("s of {s_m} m lies on no road")));
        }
        let mut section = Section { s_m, lanes: Vec::new(), centre_marks: Vec::new() };
        for side in ["left", "center", "right"] {
            let Some(side) = element.child(side) else { continue };
            for lane in side.children("lane") {
                read_lane(lane, side.name(), &mut section)?;
            }
        }
        section.lanes.sort_by_key(|lane| -lane.id);
        if let Some(twice) = section.lanes.windows(2).find(|pair| pair[0].id == pair[1].id) {
            return Err(element.fault(format!("two lanes with id {}", twice[0].id)));
        }
        sections.push(section);
    }
    if sections.is_empty() {
        return Err(lanes.fault("<laneSection> is missing".into()));
    }
    // Sections that begin together keep the order of the file: the links go by it.
    sections.sort_by(|a, b| a.s_m.total_cmp(&b.s_m));
    Ok(sections)
}

fn read_lane(lane: Element, side: &str, section: &mut Section) -> Result<()> {
    let id = lane.integer("id")?;
    let fits = match side {
        "left" => (1..=MAX_LANES).contains(&id),
        "right" => (-MAX_LANES..=-1).contains(&id),
        _ => id == 0,
    };
    if !fits {
        return Err(lane.fault(format!("lane id {id} within <{side}>")));
    }
    let marks = read_marks(lane)?;
    if id == 0 {
        section.centre_marks = marks;
        return Ok(());
    }
    if lane.child("border").is_some() && lane.child("width").is_none() {
        let what = "a lane given by borders, which pmp does not read".into();
        return Err(lane.fault_with(what, "export the map with lane widths"));
    }
    let width = read_profile(Some(lane), "width", "sOffset")?;
    let link = |name| -> Result<Option<i32>> {
        let link = lane.child("link").and_then(|link| link.child(name));
        link.map(|link| link.integer("id")).transpose()
    };
    let mut speed_limits = Vec::new();
    for speed in lane.children("speed") {
        speed_limits
            .push(SpeedLimit { s_m: speed.number("sOffset")?, limit_mps: speed_mps(speed)? });
    }
    speed_limits.sort_by(|a, b| a.s_m.total_cmp(&b.s_m));
    section.lanes.push(Lane {
        id,
        kind: LaneKind::from_name(lane.text("type")?),
        width,
        predecessor: link("predecessor")?,
        successor: link("successor")?,
        marks,
        speed_limits,
    });
    Ok(())
}

fn read_marks(lane: Element) -> Result<Vec<RoadMark>> {
    let mut marks = Vec::new();
    for mark in lane.children("roadMark") {
        let change = mark.attribute("laneChange").unwrap_or("both").to_ascii_lowercase();
        marks.push(RoadMark {
            start_m: mark.number_or("sOffset", 0.0)?,
            kind: MarkKind::from_name(mark.attribute("type").unwrap_or("none")),
            yellow: mark.attribute("color").is_some_and(|color| color == "yellow"),
            width_m: mark.number_or("width", 0.125)?.clamp(0.0, 1.0),
            change: match change.as_str() {
                "increase" => LaneChange::Increase,
                "decrease" => LaneChange::Decrease,
                "none" => LaneChange::None,
                _ => LaneChange::Both,
            },
        });
    }
    marks.sort_by(|a, b| a.start_m.total_cmp(&b.start_m));
    Ok(marks)
}

fn read_junction(junction: Element) -> Result<Junction> {
    let mut connections = Vec::new();
    for connection in junction.children("connection") {
        // Direct and virtual junctions link roads by other attributes and have no road within.
        let (Some(incoming), Some(connecting)) =
            (connection.attribute("incomingRoad"), connection.attribute("connectingRoad"))
        else {
            continue;
        };
        let links = connection
            .children("laneLink")
            .map(|link| Ok((link.integer("from")?, link.integer("to")?)));
        connections.push(Connection {
            incoming_road: incoming.to_string(),
            connecting_road: connecting.to_string(),
            lane_links: links.collect::<Result<_>>()?,
        });
    }
    Ok(Junction { id: junction.text("id")?.to_string(), connections })
}

fn read_crosswalks(objects: Option<Element>) -> Result<Vec<Crosswalk>> {
    let mut crosswalks = Vec::new();
    for object in objects.into_iter().flat_map(|objects| objects.children("object")) {
        let is_crosswalk = object.attribute("type").is_some_and(|kind| kind == "crosswalk");
        let outline =
            object.child("outline").or_else(|| object.child("outlines")?.child("outline"));
        let (true, Some(outline)) = (is_crosswalk, outline) else { continue };
        let corners_m = outline
            .children("cornerLocal")
            .map(|corner| Ok([corner.number("u")?, corner.number("v")?]));
        crosswalks.push(Crosswalk {
            s_m: object.number("s")?,
            t_m: object.number("t")?,
            heading_rad: object.number_or("hdg", 0.0)?.rem_euclid(TAU),
            corners_m: corners_m.collect::<Result<_>>()?,
        });
    }
    Ok(crosswalks)
}
