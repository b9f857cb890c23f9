//! The sensors of one drive, each with its own random numbers.

use glam::DAffine3;

use crate::{
    dataset::picture::{jpeg, rgb::Rgb},
    noise::{Noise, Purpose},
    projection,
    scene::{conditions::Sky, instant::Instant, shapes::Shapes},
    sensors::{
        camera::Camera,
        gnss::Gnss,
        imu::Imu,
        lidar, odometry,
        radar::{self, RadarReturn},
        rays::Reach,
    },
    sim::{
        clocks::{STEPS_PER_S, Source},
        drive::Drive,
        plan::Episode,
        reading::{Reading, objects, way_ahead},
        rig::Rig,
        stage::Stage,
    },
    world::ego::{Car, STEP_S},
};

/// Quality of pictures, as CARLA's bridge stores them.
const JPEG_QUALITY: u8 = 90;

/// The sensors of a drive, with what they remember.
pub struct Senses<'t> {
    rig: &'t Rig,
    stage: &'t Stage,
    shapes: &'t Shapes,
    sky: Sky,
    camera: Camera,
    /// What drops of rain are drawn from.
    camera_seed: u64,
    unit: Imu,
    receiver: Gnss,
    last_fix_step: u64,
    lidar: Noise,
    radar: Noise,
    odometry: Noise,
    imu: Noise,
    gnss: Noise,
    /// The car one step ago.
    before: Car,
}

impl<'t> Senses<'t> {
    /// The sensors at the beginning of a drive.
    pub fn new(
        rig: &'t Rig,
        stage: &'t Stage,
        shapes: &'t Shapes,
        episode: &Episode,
        drive: &Drive,
    ) -> Senses<'t> {
        let noise = |purpose| Noise::new(episode.seed, episode.number, purpose);
        let (mut imu, mut gnss) = (noise(Purpose::Imu), noise(Purpose::Gnss));
        Senses {
            rig,
            stage,
            shapes,
            sky: episode.sky,
            camera: Camera::new(rig.camera.clone()),
            camera_seed: episode.seed.rotate_left(32) ^ u64::from(episode.number),
            unit: Imu::new(rig.imu, &mut imu),
            receiver: Gnss::new(rig.gnss, &mut gnss),
            last_fix_step: 0,
            lidar: noise(Purpose::Lidar),
            radar: noise(Purpose::Radar),
            odometry: noise(Purpose::Odometry),
            imu,
            gnss,
            before: *drive.world.ego(),
        }
    }

    /// Remember the car as it is before its next step.
    pub fn before_step(&mut self, drive: &Drive) {
        self.before = *drive.world.ego();
    }

    /// What a source says now.
    pub fn read(&mut self, source: Source, drive: &Drive) -> Reading {
        let world = &drive.world;
        let (ego, ground_m) = (world.ego(), world.ground_m());
        match source {
            Source::Camera => Reading::Picture(self.picture(drive)),
            Source::Lidar => {
                let instant = Instant::of(&world.snapshot(), self.shapes);
                let (config, pose) = (&self.rig.lidar, ego.world_from_ego(ground_m));
                let reach = self.reach(&instant, &pose, config.range_m);
                Reading::Lidar(lidar::turn(config, &reach, &pose, self.sky, &mut self.lidar))
            }
            Source::Radar => Reading::Radar(self.scan(drive)),
            Source::Odometry => {
                let config = &self.rig.odometry;
                Reading::Odometry(odometry::measure(config, ego, ground_m, &mut self.odometry))
            }
            Source::Imu => {
                Reading::Imu(self.unit.measure(&self.before, ego, STEP_S, &mut self.imu))
            }
            Source::Gnss => {
                let elapsed = drive.steps() - self.last_fix_step;
                self.last_fix_step = drive.steps();
                let elapsed_s = elapsed as f64 / STEPS_PER_S as f64;
                Reading::Fix(self.receiver.measure(ego, ground_m, elapsed_s, &mut self.gnss))
            }
            Source::Control => {
                let decision = drive.decision();
                let (wanted, applied) = (decision.wanted, decision.applied);
                Reading::Control { wanted, applied, car: *ego }
            }
            Source::Situation => {
                let waypoint = world.route.at(world.progress_m());
                Reading::Situation {
                    in_junction: waypoint.in_junction,
                    speed_limit_mps: waypoint.limit_mps,
                    command: waypoint.command,
                }
            }
            Source::Route => Reading::Route(way_ahead(&world.route, world.progress_m())),
            Source::Objects => Reading::Objects(objects(&world.snapshot())),
        }
    }

    /// A picture as JPEG.
    ///
    /// # Panics
    ///
    /// If the camera gives a picture of another size than it says.
    fn picture(&mut self, drive: &Drive) -> Vec<u8> {
        let world = &drive.world;
        let instant = Instant::of(&world.snapshot(), self.shapes);
        let pose = world.ego().world_from_ego(world.ground_m());
        let (sky, seed) = (self.sky, self.camera_seed);
        let surroundings = &self.stage.surroundings;
        let data = self.camera.picture(surroundings, &instant, &pose, sky, seed).to_vec();
        let projection::Camera { width, height, .. } = self.rig.camera.intrinsics;
        jpeg::encode(&Rgb { width, height, data }, JPEG_QUALITY)
            .expect("a picture of the camera's size fits a JPEG")
    }

    /// What a sensor on the car can reach.
    fn reach<'i>(&self, instant: &'i Instant, pose: &DAffine3, range_m: f64) -> Reach<'i>
    where
        't: 'i,
    {
        let place_m = pose.translation.as_vec3();
        Reach::new(&self.stage.standing, instant, place_m, range_m as f32)
    }

    fn scan(&mut self, drive: &Drive) -> Vec<RadarReturn> {
        let (world, config) = (&drive.world, &self.rig.radar);
        let instant = Instant::of(&world.snapshot(), self.shapes);
        let pose = world.ego().world_from_ego(world.ground_m());
        let reach = self.reach(&instant, &pose, config.range_m);
        let radar_mps = config.velocity_world_mps(world.ego());
        radar::scan(config, &reach, &pose, radar_mps, self.sky, &mut self.radar)
    }
}
