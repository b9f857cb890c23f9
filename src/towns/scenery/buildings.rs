//! Buildings along a roadside, row by row.

use std::ops::Range;

use glam::DVec2;
use rand::RngExt as _;

use crate::footprint::Footprint;
use crate::towns::scenery::{
    ground::{Clearance, Ground},
    roadside::{Character, Purpose, Roadside},
    things::{Kind, Thing},
};

const STOREY_M: f64 = 3.1;

/// Room around buildings: drivers must see into junctions.
const CLEAR: Clearance = Clearance { roads_m: 0.8, junctions_m: 6.0, things_m: 0.4 };

/// How a street is built up; ranges in metres.
struct Custom {
    kind: Kind,
    front_m: Range<f64>,
    depth_m: Range<f64>,
    set_back_m: Range<f64>,
    gap_m: Range<f64>,
    storeys: Range<u32>,
    /// Share of plots that stay empty.
    empty: f64,
}

/// What is usual on a roadside; none where nobody builds.
fn custom(side: &Roadside) -> Option<Custom> {
    match (side.character, side.lanes) {
        (Character::Bare | Character::Motorway, _) => None,
        (Character::Country, _) => Some(Custom {
            kind: Kind::House,
            front_m: 9.0..16.0,
            depth_m: 8.0..12.0,
            set_back_m: 5.0..14.0,
            gap_m: 25.0..130.0,
            storeys: 1..3,
            empty: 0.35,
        }),
        (Character::Town, ..=2) => Some(Custom {
            kind: Kind::House,
            front_m: 8.0..16.0,
            depth_m: 9.0..13.0,
            set_back_m: 1.0..4.5,
            gap_m: 0.6..6.0,
            storeys: 2..5,
            empty: 0.08,
        }),
        (Character::Town, 3..=4) => Some(Custom {
            kind: Kind::Block,
            front_m: 14.0..30.0,
            depth_m: 12.0..18.0,
            set_back_m: 1.2..4.0,
            gap_m: 0.6..9.0,
            storeys: 3..8,
            empty: 0.06,
        }),
        (Character::Town, _) => Some(Custom {
            kind: Kind::Block,
            front_m: 18.0..42.0,
            depth_m: 16.0..24.0,
            set_back_m: 2.0..6.0,
            gap_m: 1.0..14.0,
            storeys: 5..15,
            empty: 0.08,
        }),
    }
}

/// Build along one roadside; a plot that is too small is tried narrower and less deep.
pub fn along(side: &Roadside, seed: u64, ground: &mut Ground, things: &mut Vec<Thing>) {
    const STEP_M: f64 = 3.0;
    let Some(custom) = custom(side) else { return };
    let mut noise = side.noise(seed, Purpose::Buildings);
    let (from_m, to_m) = side.range_m();
    let mut s_m = from_m + noise.random_range(0.0..0.3) * custom.gap_m.end;
    while s_m + custom.front_m.start < to_m {
        let front_m = noise.random_range(custom.front_m.clone()).min(to_m - s_m);
        let depth_m = noise.random_range(custom.depth_m.clone());
        let set_back_m = noise.random_range(custom.set_back_m.clone());
        let gap_m = noise.random_range(custom.gap_m.clone());
        let storeys = noise.random_range(custom.storeys.clone());
        let is_barn = custom.kind == Kind::House
            && side.character == Character::Country
            && noise.random_bool(0.3);
        let kind = if is_barn { Kind::Barn } else { custom.kind };
        let colour = noise.random_range(0..kind.colours().len()) as u8;
        if noise.random_bool(custom.empty) {
            s_m += front_m + gap_m;
            continue;
        }
        let sizes = [(1.0, 1.0), (1.0, 0.7), (0.6, 0.8)];
        let plots = sizes
            .map(|(front, depth)| plot(side, s_m, front * front_m, depth * depth_m, set_back_m));
        let Some(footprint) = plots.into_iter().find(|plot| ground.is_free(plot, &CLEAR)) else {
            s_m += STEP_M;
            continue;
        };
        ground.take(&footprint);
        let height_m = f64::from(storeys) * STOREY_M + if is_barn { 2.0 } else { 0.6 };
        things.push(Thing { kind, footprint, height_m, colour });
        s_m += 2.0 * footprint.half_m.x + gap_m;
    }
}

fn plot(side: &Roadside, s_m: f64, front_m: f64, depth_m: f64, set_back_m: f64) -> Footprint {
    let middle_m = s_m + 0.5 * front_m;
    Footprint::new(
        side.beyond_m(middle_m, set_back_m + 0.5 * depth_m),
        side.heading_rad(middle_m),
        0.5 * DVec2::new(front_m, depth_m),
    )
}
