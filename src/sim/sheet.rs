//! A picture of pictures: the same moment under every sky, and under one sky with more and more
//! traffic.
//!
//! ```text
//! daytime, sunset, night, dark (down) x clear, drizzle, rainy, storm (across): dense traffic
//! empty, few, regular, dense: clear day
//! ```

use glam::DVec2;

use crate::{
    error::Result,
    scene::{
        conditions::{Illumination, Sky, Weather},
        instant::Instant,
        shapes::Shapes,
        surroundings::Surroundings,
    },
    sensors::camera::{Camera, CameraConfig},
    sim::{drive::Demonstration, plan::Episode},
    world::{density::Density, ego::Car, snapshot::Snapshot, town::Town},
};

/// How long a drive is looked at for the moment with most to see, s.
const WATCHED_S: f64 = 60.0;

/// Moments that are compared lie so far apart, in steps of the world.
const BETWEEN_STEPS: u64 = 50;

/// Pixels of a picture that become one, along each side.
pub const SHRUNK: usize = 2;

/// Brightness is told apart in steps of this.
const LEVELS: u8 = 5;

const CLEAR_DAY: Sky = Sky { illumination: Illumination::Daytime, weather: Weather::Clear };

/// RGB, row by row, 3 bytes a pixel.
#[derive(Clone, Debug)]
pub struct Sheet {
    pub width: usize,
    pub height: usize,
    pub rgb: Vec<u8>,
}

impl Sheet {
    pub fn blank(width: usize, height: usize) -> Sheet {
        Sheet { width, height, rgb: vec![255; 3 * width * height] }
    }

    /// Put a picture of a width at a place (column, row), shrunk.
    pub fn put(&mut self, picture: &[u8], width: usize, at: [usize; 2]) {
        let rows = picture.len() / (3 * width) / SHRUNK;
        for row in 0..rows {
            for column in 0..width / SHRUNK {
                for channel in 0..3 {
                    let place = |i: usize| {
                        let (x, y) = (column * SHRUNK + i % SHRUNK, row * SHRUNK + i / SHRUNK);
                        usize::from(picture[3 * (y * width + x) + channel])
                    };
                    let sum: usize = (0..SHRUNK * SHRUNK).map(place).sum();
                    let pixel = (at[1] + row) * self.width + at[0] + column;
                    let mean = (sum / (SHRUNK * SHRUNK)) as u8;
                    // Noise in the last bits would make up most of the file.
                    self.rgb[3 * pixel + channel] = mean - mean % LEVELS;
                }
            }
        }
    }
}

/// The sheet of a town.
///
/// # Errors
///
/// As [`Demonstration::new`].
pub fn draw(town: &Town, seed: u64) -> Result<Sheet> {
    let surroundings = Surroundings::of(&town.map, &town.scenery);
    let shapes = Shapes::new();
    let config = CameraConfig::default();
    let (width, height) = (config.intrinsics.width, config.intrinsics.height);
    let (across, down) = (width / SHRUNK, height / SHRUNK);
    let mut camera = Camera::new(config);
    let mut sheet = Sheet::blank(4 * across, 5 * down);
    let mut take = |snapshot: &Snapshot, sky: Sky, column: usize, row: usize| {
        let world_from_ego = snapshot.ego.world_from_ego(snapshot.ego_ground_m);
        let instant = Instant::of(snapshot, &shapes);
        let picture = camera.picture(&surroundings, &instant, &world_from_ego, sky, seed);
        sheet.put(picture, width, [column * across, row * down]);
    };
    for (column, traffic) in Density::ALL.into_iter().enumerate() {
        let episode = Episode { number: 0, seed, town: town.name.clone(), sky: CLEAR_DAY, traffic };
        let moment = busiest(Demonstration::new(town, &episode, 0.0)?);
        take(&moment, CLEAR_DAY, column, Illumination::ALL.len());
        if traffic == Density::Dense {
            for (row, illumination) in Illumination::ALL.into_iter().enumerate() {
                for (column, weather) in Weather::ALL.into_iter().enumerate() {
                    take(&moment, Sky { illumination, weather }, column, row);
                }
            }
        }
    }
    Ok(sheet)
}

/// The moment of a drive with most people and vehicles close ahead.
pub fn busiest(mut demonstration: Demonstration) -> Snapshot {
    let mut best = (0.0, demonstration.drive.world.snapshot());
    while demonstration.drive.world.time_s() < WATCHED_S && !demonstration.drive.is_over() {
        demonstration.step();
        let drive = &demonstration.drive;
        if drive.steps().is_multiple_of(BETWEEN_STEPS) {
            let snapshot = drive.world.snapshot();
            let worth = worth(&snapshot);
            if worth > best.0 {
                best = (worth, snapshot);
            }
        }
    }
    best.1
}

/// How much there is to see from a vehicle's seat.
fn worth(snapshot: &Snapshot) -> f64 {
    let ego = &snapshot.ego;
    let people = snapshot.walkers.iter().map(|walker| 2.0 * seen(ego, walker.footprint.centre_m));
    let vehicles = snapshot.vehicles.iter().map(|vehicle| seen(ego, vehicle.footprint.centre_m));
    // A driver who moves sees more of the town.
    people.chain(vehicles).sum::<f64>() + 0.1 * ego.speed_mps.min(5.0)
}

/// How well a place is seen, in [0, 1].
fn seen(ego: &Car, place_m: DVec2) -> f64 {
    let offset_m = DVec2::from_angle(-ego.yaw_rad).rotate(place_m - ego.position_m);
    let is_ahead = (9.0..45.0).contains(&offset_m.x) && offset_m.y.abs() < 0.7 * offset_m.x;
    if is_ahead { 9.0 / offset_m.x } else { 0.0 }
}
