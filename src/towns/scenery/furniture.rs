//! Street furniture: kerbs, lamps, posts, and the trees of verges and medians.

use glam::DVec2;
use rand::RngExt as _;

use crate::{
    map::{
        opendrive::{LaneKind, Road},
        road_map::RoadMap,
    },
    towns::scenery::{
        footprint::Footprint,
        ground::{Clearance, Ground, steps_m},
        roadside::{Character, Purpose, Roadside},
        things::{Kind, Thing, square},
    },
};

const KERB_WIDTH_M: f64 = 0.15;
const KERB_HEIGHT_M: f64 = 0.12;

/// Longest stone, m, and how far it may stand off a bent edge, m.
const KERB_M: f64 = 6.0;
const KERB_OFF_M: f64 = 0.02;

const LAMP_EVERY_M: f64 = 32.0;
const LAMP_HEIGHT_M: f64 = 6.5;
const POST_EVERY_M: f64 = 40.0;
const POST_HEIGHT_M: f64 = 0.9;

/// Trees along streets: distance, m, and the narrowest strips that they stand in, m.
const ALLEY_EVERY_M: f64 = 13.0;
const VERGE_M: f64 = 1.2;
const MEDIAN_M: f64 = 2.4;

const CLOSE: Clearance = Clearance { roads_m: 0.2, junctions_m: 2.0, things_m: 1.0 };

/// Kerbs of the whole map, junctions included, where a side-walk or a verge begins.
pub fn kerbs(map: &RoadMap, ground: &Ground, things: &mut Vec<Thing>) {
    for road in &map.opendrive().roads {
        for section in 0..road.sections.len() {
            let lanes = &road.sections[section].lanes;
            for (index, lane) in lanes.iter().enumerate() {
                let inwards = if lane.id > 0 { index + 1 } else { index.wrapping_sub(1) };
                let is_edge =
                    |kind: LaneKind| matches!(kind, LaneKind::Sidewalk | LaneKind::Border);
                let begins = lanes.get(inwards).is_some_and(|inner| {
                    !is_edge(inner.kind) && inner.id.signum() == lane.id.signum()
                });
                let is_walked = |i: usize| {
                    lanes[i].kind == LaneKind::Sidewalk && lanes[i].id.signum() == lane.id.signum()
                };
                if is_edge(lane.kind) && begins && (0..lanes.len()).any(is_walked) {
                    add_kerb(road, section, index, ground, things);
                }
            }
        }
    }
}

fn add_kerb(road: &Road, section: usize, index: usize, ground: &Ground, things: &mut Vec<Thing>) {
    let outwards = f64::from(road.sections[section].lanes[index].id.signum());
    let place = |s_m: f64| {
        let edge_m = road.borders(section, index, s_m).inner_t_m + outwards * 0.5 * KERB_WIDTH_M;
        road.place(s_m, edge_m).truncate()
    };
    let mut from_m: Option<f64> = None;
    for s_m in steps_m(road, section, 0.5) {
        let Some(start_m) = from_m else {
            from_m = Some(s_m);
            continue;
        };
        let (a, b) = (place(start_m), place(s_m));
        let middle_m = place(0.5 * (start_m + s_m));
        let is_bent = middle_m.distance(0.5 * (a + b)) > KERB_OFF_M;
        let (_, to_m) = road.section_range_m(section);
        if is_bent || a.distance(b) > KERB_M || s_m >= to_m {
            let footprint = Footprint {
                centre_m: 0.5 * (a + b),
                half_m: DVec2::new(0.5 * a.distance(b), 0.5 * KERB_WIDTH_M),
                heading_rad: (b - a).to_angle(),
            };
            let is_wide =
                road.borders(section, index, 0.5 * (start_m + s_m)).width_m() > KERB_WIDTH_M;
            if is_wide && !ground.is_driven(&footprint.grown(-0.05)) {
                things.push(Thing {
                    kind: Kind::Kerb,
                    footprint,
                    height_m: KERB_HEIGHT_M,
                    colour: 0,
                });
            }
            from_m = Some(s_m);
        }
    }
}

/// Lamps, posts and trees along one roadside.
pub fn along(side: &Roadside, seed: u64, ground: &mut Ground, things: &mut Vec<Thing>) {
    let mut noise = side.noise(seed, Purpose::Furniture);
    let (from_m, to_m) = side.range_m();
    let mut row = |every_m: f64, kind: Kind, side_m: f64, place: &dyn Fn(f64) -> DVec2| {
        // Opposite sides take turns.
        let mut s_m = from_m + every_m * if side.is_left { 0.25 } else { 0.75 };
        while s_m < to_m {
            let footprint = square(place(s_m), side.heading_rad(s_m), side_m);
            let height_m = match kind {
                Kind::Lamp => LAMP_HEIGHT_M,
                Kind::Post => POST_HEIGHT_M,
                _ => noise.random_range(5.0..9.0),
            };
            let colour = noise.random_range(0..kind.colours().len()) as u8;
            if ground.is_free(&footprint, &CLOSE) {
                ground.take(&footprint);
                things.push(Thing { kind, footprint, height_m, colour });
            }
            s_m += every_m;
        }
    };
    match side.character {
        Character::Town => row(LAMP_EVERY_M, Kind::Lamp, 0.2, &|s_m| side.beyond_m(s_m, 0.4)),
        Character::Motorway | Character::Country => {
            row(POST_EVERY_M, Kind::Post, 0.12, &|s_m| side.beyond_m(s_m, 0.6));
        }
        Character::Bare => {}
    }
    if side.character == Character::Motorway {
        return;
    }
    let lanes = &side.road.sections[side.section].lanes;
    let middle_m = 0.5 * (from_m + to_m);
    for index in side.own_lanes() {
        let borders = side.road.borders(side.section, index, middle_m);
        // The median is in two halves; the trees of its middle are the left one's.
        let t_m: Box<dyn Fn(f64) -> f64> = match lanes[index].kind {
            LaneKind::Border if borders.width_m() >= VERGE_M => {
                Box::new(move |s_m| side.road.borders(side.section, index, s_m).centre_t_m())
            }
            LaneKind::Median if side.is_left && 2.0 * borders.width_m() >= MEDIAN_M => {
                Box::new(move |s_m| side.road.borders(side.section, index, s_m).inner_t_m)
            }
            _ => continue,
        };
        row(ALLEY_EVERY_M, Kind::Tree, 0.35, &|s_m| side.road.place(s_m, t_m(s_m)).truncate());
    }
}
