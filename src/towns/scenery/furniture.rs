//! Street furniture: kerbs, lamps, posts, and the trees of verges and medians.

use glam::DVec2;
use rand::RngExt as _;

use crate::{
    footprint::Footprint,
    map::{
        opendrive::{LaneKind, Road},
        road_map::RoadMap,
    },
    towns::scenery::{
        ground::{Clearance, Ground, steps_m},
        roadside::{Character, Purpose, Roadside},
        things::{Kind, Thing, square},
    },
};

pub const KERB_WIDTH_M: f64 = 0.15;
pub const KERB_HEIGHT_M: f64 = 0.12;

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

/// Kerbs of the whole map, junctions included: where the carriageway ends and a side-walk, or a
/// verge before one, begins.
pub fn kerbs(map: &RoadMap, ground: &Ground, things: &mut Vec<Thing>) {
    for road in &map.opendrive().roads {
        for (section, data) in road.sections.iter().enumerate() {
            for is_left in [true, false] {
                // From the middle outwards.
                let mut side: Vec<usize> =
                    (0..data.lanes.len()).filter(|i| (data.lanes[*i].id > 0) == is_left).collect();
                side.sort_by_key(|index| data.lanes[*index].id.abs());
                let kind = |index: &usize| data.lanes[*index].kind;
                let is_beside = |kind| matches!(kind, LaneKind::Sidewalk | LaneKind::Border);
                let first = side.iter().position(|index| is_beside(kind(index)));
                let is_walked = side.iter().any(|index| kind(index) == LaneKind::Sidewalk);
                if let Some(first) = first.filter(|first| is_walked && *first > 0) {
                    add_kerb(road, section, side[first], ground, things);
                }
            }
        }
    }
}

/// Stones along the inner edge of a lane, each as long as the edge is straight.
fn add_kerb(road: &Road, section: usize, index: usize, ground: &Ground, things: &mut Vec<Thing>) {
    let outwards = f64::from(road.sections[section].lanes[index].id.signum());
    let place = |s_m: f64| {
        let edge_m = road.borders(section, index, s_m).inner_t_m + outwards * 0.5 * KERB_WIDTH_M;
        road.place(s_m, edge_m).truncate()
    };
    let steps_m = steps_m(road, section, 0.5);
    let (mut from_m, to_m) = road.section_range_m(section);
    for s_m in steps_m.into_iter().skip(1) {
        let (start, end) = (place(from_m), place(s_m));
        let middle_s_m = 0.5 * (from_m + s_m);
        let off_m = place(middle_s_m).distance(0.5 * (start + end));
        let length_m = start.distance(end);
        if off_m < KERB_OFF_M && length_m < KERB_M && s_m < to_m {
            continue;
        }
        from_m = s_m;
        let half_m = 0.5 * DVec2::new(length_m, KERB_WIDTH_M);
        let footprint = Footprint::new(0.5 * (start + end), (end - start).to_angle(), half_m);
        let is_there = road.borders(section, index, middle_s_m).width_m() > KERB_WIDTH_M;
        // Edges touch what they bound: a little less must be free.
        let core = Footprint { half_m: 0.5 * footprint.half_m, ..footprint };
        if is_there && !ground.is_driven(&core) {
            things.push(Thing { kind: Kind::Kerb, footprint, height_m: KERB_HEIGHT_M, colour: 0 });
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
