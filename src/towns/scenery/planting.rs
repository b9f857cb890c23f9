//! Fields along country roads, and trees wherever there is room.

use glam::DVec2;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use crate::footprint::Footprint;
use crate::towns::scenery::{
    ground::{Clearance, Ground},
    roadside::{Character, Purpose, Roadside},
    things::{Kind, Thing, square},
};

/// Trees stand at most this far from a road, m.
const NEAR_M: f64 = 70.0;

/// One tree a cell at most: its side, m, and the share of cells that have one.
const CELL_M: f64 = 9.0;
const WOODED: f64 = 0.3;

const TREES: Clearance = Clearance { roads_m: 1.0, junctions_m: 4.0, things_m: 1.5 };
const FIELDS: Clearance = Clearance { roads_m: 2.5, junctions_m: 5.0, things_m: 1.5 };

/// The stream of random numbers of what belongs to no road.
const EVERYWHERE: u64 = u64::MAX;

/// Fields along one roadside.
pub fn fields(side: &Roadside, seed: u64, ground: &mut Ground, things: &mut Vec<Thing>) {
    if side.character != Character::Country {
        return;
    }
    let mut noise = side.noise(seed, Purpose::Planting);
    let (from_m, to_m) = side.range_m();
    let mut s_m = from_m;
    while s_m < to_m {
        let long_m: f64 = noise.random_range(30.0..80.0);
        let deep_m: f64 = noise.random_range(25.0..70.0);
        let colour = noise.random_range(0..Kind::Field.colours().len()) as u8;
        let height_m = noise.random_range(0.1..0.9);
        let middle_m = s_m + 0.5 * long_m;
        let footprint = Footprint::new(
            side.beyond_m(middle_m.min(to_m), 4.0 + 0.5 * deep_m),
            side.heading_rad(middle_m.min(to_m)),
            0.5 * DVec2::new(long_m, deep_m),
        );
        if ground.is_free(&footprint, &FIELDS) {
            ground.take(&footprint);
            things.push(Thing { kind: Kind::Field, footprint, height_m, colour });
            s_m += long_m + 4.0;
        } else {
            s_m += 8.0;
        }
    }
}

/// Trees on what is left of the ground near roads.
pub fn trees(seed: u64, ground: &mut Ground, things: &mut Vec<Thing>) {
    let mut noise = ChaCha8Rng::seed_from_u64(seed);
    noise.set_stream(EVERYWHERE);
    let (low_m, high_m) = (ground.bounds_m.0 - NEAR_M, ground.bounds_m.1 + NEAR_M);
    let cells = ((high_m - low_m) / CELL_M).ceil();
    for row in 0..cells.y as u32 {
        for column in 0..cells.x as u32 {
            let within = DVec2::new(noise.random_range(0.0..1.0), noise.random_range(0.0..1.0));
            let is_wooded = noise.random_bool(WOODED);
            let height_m = noise.random_range(4.0..11.0);
            let colour = noise.random_range(0..Kind::Tree.colours().len()) as u8;
            let corner = DVec2::new(f64::from(column), f64::from(row));
            let place_m = low_m + CELL_M * (corner + within);
            if !is_wooded || !ground.has_road_near(place_m, NEAR_M) {
                continue;
            }
            let footprint = square(place_m, 0.0, 0.4);
            if ground.is_free(&footprint, &TREES) {
                ground.take(&footprint);
                things.push(Thing { kind: Kind::Tree, footprint, height_m, colour });
            }
        }
    }
}
