//! One moment as the sensors see it, by day and in a storm in the dark: the paper's figure 4.
//!
//! ```text
//! camera, clear day, with the boxes of all others    camera, storm in the dark
//! lidar on the picture, by height                    lidar in that storm, by height
//! lidar by distance                                  radar, by speed, over the camera
//! ```

use glam::{DAffine3, DVec3};

use crate::{
    error::Result,
    noise::{Noise, Purpose},
    projection::{self, Nearest},
    scene::{
        conditions::{Illumination, Sky, Weather},
        instant::Instant,
        shapes::Shapes,
    },
    sensors::{camera::Camera, lidar, radar, rays::Reach},
    sim::{
        drive::Demonstration,
        plan::Episode,
        reading::{Object, ObjectKind, objects},
        rig::Rig,
        sheet::{SHRUNK, Sheet, busiest},
        stage::Stage,
    },
    world::{density::Density, snapshot::Snapshot, town::Town},
};

const CLEAR_DAY: Sky = Sky { illumination: Illumination::Daytime, weather: Weather::Clear };
const STORM_DARK: Sky = Sky { illumination: Illumination::Dark, weather: Weather::Storm };

/// Heights above the ground and distances between which colours change, m, and speeds, m/s.
const HEIGHTS_M: [f64; 2] = [-0.2, 4.0];
const DISTANCES_M: [f64; 2] = [3.0, 50.0];
const SPEEDS_MPS: [f64; 2] = [-15.0, 15.0];

/// Colours of boxes: vehicles and people.
const VEHICLE: [u8; 3] = [255, 196, 0];
const PERSON: [u8; 3] = [255, 64, 160];

/// Pixels that a return is drawn large: of the lidar, which are dense, and of the radar.
const LIDAR_PX: usize = 3;
const RADAR_PX: usize = 7;

/// A moment in a town, with all that it takes to sense it.
struct Moment {
    rig: Rig,
    stage: Stage,
    snapshot: Snapshot,
    instant: Instant,
    world_from_ego: DAffine3,
    seed: u64,
}

/// The sheet of a town.
///
/// # Errors
///
/// As [`Demonstration::new`].
pub fn draw(town: Town, seed: u64) -> Result<Sheet> {
    let name = town.name.clone();
    let episode = Episode { number: 0, seed, town: name, sky: CLEAR_DAY, traffic: Density::Dense };
    let snapshot = busiest(Demonstration::new(&town, &episode, 0.0)?);
    let moment = Moment {
        rig: Rig::default(),
        stage: Stage::new(town),
        instant: Instant::of(&snapshot, &Shapes::new()),
        world_from_ego: snapshot.ego.world_from_ego(snapshot.ego_ground_m),
        snapshot,
        seed,
    };
    let day = moment.camera(CLEAR_DAY);
    let mut boxed = day.clone();
    moment.draw_boxes(&mut boxed);
    let black = vec![0; day.len()];
    let height = |point_m: DVec3| share(-point_m.y + moment.camera_height_m(), HEIGHTS_M);
    let distance = |point_m: DVec3| share(point_m.z, DISTANCES_M);
    let panels = [
        [boxed, moment.camera(STORM_DARK)],
        [
            moment.with_lidar(black.clone(), CLEAR_DAY, &height),
            moment.with_lidar(black.clone(), STORM_DARK, &height),
        ],
        [
            moment.with_lidar(black, CLEAR_DAY, &distance),
            moment.with_radar(day.iter().map(|value| value / 3).collect(), CLEAR_DAY),
        ],
    ];
    let projection::Camera { width, height, .. } = moment.rig.camera.intrinsics;
    let (across, down) = (width / SHRUNK, height / SHRUNK);
    let mut sheet = Sheet::blank(2 * across, panels.len() * down);
    for (row, panels) in panels.iter().enumerate() {
        for (column, panel) in panels.iter().enumerate() {
            sheet.put(panel, width, [column * across, row * down]);
        }
    }
    Ok(sheet)
}

impl Moment {
    fn camera(&self, sky: Sky) -> Vec<u8> {
        let mut camera = Camera::new(self.rig.camera.clone());
        let (surroundings, pose) = (&self.stage.surroundings, &self.world_from_ego);
        camera.picture(surroundings, &self.instant, pose, sky, self.seed).to_vec()
    }

    /// Of the camera above the ground, m.
    fn camera_height_m(&self) -> f64 {
        self.rig.camera.ego_from_camera.translation.z
    }

    fn reach(&self, range_m: f64) -> Reach<'_> {
        let place_m = self.world_from_ego.translation.as_vec3();
        Reach::new(&self.stage.standing, &self.instant, place_m, range_m as f32)
    }

    /// Lidar returns on a picture, coloured by a share that their place in the camera's frame has.
    fn with_lidar(&self, mut rgb: Vec<u8>, sky: Sky, colour: &dyn Fn(DVec3) -> f64) -> Vec<u8> {
        let config = &self.rig.lidar;
        let mut noise = Noise::new(self.seed, 0, Purpose::Lidar);
        let reach = self.reach(config.range_m);
        let returns = lidar::turn(config, &reach, &self.world_from_ego, sky, &mut noise);
        let camera_from_lidar = self.rig.camera.ego_from_camera.inverse() * config.ego_from_lidar;
        let camera = &self.rig.camera.intrinsics;
        let mut nearest = Nearest::new(camera);
        for point in returns {
            let point_m =
                camera_from_lidar.transform_point3(DVec3::from(point.position_m.map(f64::from)));
            nearest.add(point_m, point_m);
        }
        for (pixel, point_m) in nearest.finish() {
            dot(&mut rgb, camera, pixel, LIDAR_PX, ramp(colour(point_m)));
        }
        rgb
    }

    /// Radar returns on a picture, coloured by their speed.
    fn with_radar(&self, mut rgb: Vec<u8>, sky: Sky) -> Vec<u8> {
        let config = &self.rig.radar;
        let mut noise = Noise::new(self.seed, 0, Purpose::Radar);
        let reach = self.reach(config.range_m);
        let radar_mps = config.velocity_world_mps(&self.snapshot.ego);
        let returns = radar::scan(config, &reach, &self.world_from_ego, radar_mps, sky, &mut noise);
        let camera_from_radar = self.rig.camera.ego_from_camera.inverse() * config.ego_from_radar;
        let camera = &self.rig.camera.intrinsics;
        let mut nearest = Nearest::new(camera);
        for r in returns {
            let point_m = r.range_m * radar::direction(r.azimuth_rad, r.elevation_rad);
            nearest.add(camera_from_radar.transform_point3(point_m), r.speed_mps);
        }
        for (pixel, speed_mps) in nearest.finish() {
            dot(&mut rgb, camera, pixel, RADAR_PX, ramp(share(speed_mps, SPEEDS_MPS)));
        }
        rgb
    }

    /// The edges of the boxes of all others that the camera could see.
    fn draw_boxes(&self, rgb: &mut [u8]) {
        let camera_from_world = (self.world_from_ego * self.rig.camera.ego_from_camera).inverse();
        let camera = &self.rig.camera.intrinsics;
        for object in objects(&self.snapshot) {
            let colour = match object.kind {
                ObjectKind::Vehicle(_) => VEHICLE,
                ObjectKind::Walker(_) => PERSON,
            };
            for [from_m, to_m] in edges_m(&object) {
                let ends_m = [from_m, to_m].map(|m| camera_from_world.transform_point3(m));
                for step in 0..=EDGE_STEPS {
                    let share = f64::from(step) / f64::from(EDGE_STEPS);
                    let point_m = ends_m[0].lerp(ends_m[1], share);
                    if let Some(pixel) = camera.pixel(point_m.to_array()) {
                        dot(rgb, camera, pixel, SHRUNK, colour);
                    }
                }
            }
        }
    }
}

/// Points that an edge of a box is drawn with.
const EDGE_STEPS: u32 = 200;

/// The twelve edges of a box, world frame.
fn edges_m(object: &Object) -> Vec<[DVec3; 2]> {
    let corner = |index: usize| {
        let sign = |axis: usize| if index >> axis & 1 == 1 { 0.5 } else { -0.5 };
        let local_m = DVec3::new(sign(0), sign(1), sign(2)) * object.size_m;
        object.pose.position_m + object.pose.orientation * local_m
    };
    let along = |axis: usize| (0..8).filter(move |index| index >> axis & 1 == 0);
    let edges = (0..3).flat_map(|axis| along(axis).map(move |index| [index, index | 1 << axis]));
    edges.map(|ends| ends.map(corner)).collect()
}

/// A square of `size` pixels around one.
fn dot(rgb: &mut [u8], camera: &projection::Camera, pixel: u32, size: usize, colour: [u8; 3]) {
    let (row, column) = (pixel as usize / camera.width, pixel as usize % camera.width);
    let around =
        |at: usize, end: usize| at.saturating_sub(size / 2)..(at + size.div_ceil(2)).min(end);
    for row in around(row, camera.height) {
        for column in around(column, camera.width) {
            let place = 3 * (row * camera.width + column);
            rgb[place..place + 3].copy_from_slice(&colour);
        }
    }
}

/// Where a value lies between two, in [0, 1].
fn share(value: f64, [low, high]: [f64; 2]) -> f64 {
    ((value - low) / (high - low)).clamp(0.0, 1.0)
}

/// From blue over green to red.
fn ramp(share: f64) -> [u8; 3] {
    let bump = |middle: f64| (1.5 - 4.0 * (share - middle).abs()).clamp(0.0, 1.0);
    [0.75, 0.5, 0.25].map(|middle| (255.0 * bump(middle)) as u8)
}
