//! What a policy is shown while it drives: the frame that ingest would have made of this moment.
//!
//! Sensors are read at the moment of the decision. What they say goes the way of what is recorded:
//! pictures are JPEGs, clouds are rounded as in a log, and ingest's own code brings them onto the
//! picture.

use glam::{DAffine3, DVec3, EulerRot};

use crate::{
    dataset::{
        ego::EgoState,
        ralidar::{lidar_on_picture, radar_on_picture},
    },
    frame::{Conditions, Frame, Future, LidarPixels, RadarPixels, RecordedAction, Skew},
    log::signals::{Pose, RadarReturn},
    policy,
    scene::shapes::Shapes,
    sensors::{lidar::LidarReturn, odometry::OdometryReading, radar},
    sim::{
        clocks::{STEPS_PER_S, Source},
        clouds,
        drive::Drive,
        plan::Episode,
        reading::Reading,
        rig::Rig,
        senses::Senses,
        stage::Stage,
    },
};

/// Steps of the world in ns.
const STEP_NS: i64 = 1_000_000_000 / STEPS_PER_S as i64;

/// Looks at a drive through the sensors of its car.
pub struct Observer<'t> {
    senses: Senses<'t>,
    rig: &'t Rig,
    wanted: policy::Senses,
    conditions: Conditions,
    start_ns: i64,
    looked: u32,
}

/// A frame, and the readings that it was made of.
pub struct Observation {
    pub stamp_ns: i64,
    pub frame: Frame,
    pub readings: Vec<Reading>,
}

impl<'t> Observer<'t> {
    /// At the beginning of a drive; only the sensors that are wanted are read.
    pub fn new(
        rig: &'t Rig,
        stage: &'t Stage,
        shapes: &'t Shapes,
        episode: &Episode,
        drive: &Drive,
        wanted: policy::Senses,
    ) -> Observer<'t> {
        Observer {
            senses: Senses::new(rig, stage, shapes, episode, drive),
            rig,
            wanted,
            conditions: episode.conditions(),
            start_ns: episode.start_ns(),
            looked: 0,
        }
    }

    /// What the sensors say now.
    pub fn observe(&mut self, drive: &Drive) -> Observation {
        let sources = [
            (Source::Odometry, true),
            (Source::Camera, self.wanted.camera),
            (Source::Lidar, self.wanted.ranging),
            (Source::Radar, self.wanted.ranging),
        ];
        let wanted = sources.into_iter().filter(|(_, is_wanted)| *is_wanted);
        let readings: Vec<Reading> =
            wanted.map(|(source, _)| self.senses.read(source, drive)).collect();
        let world = &drive.world;
        let mut now = None;
        let (mut image, mut lidar, mut radar) = (Vec::new(), None, None);
        for reading in &readings {
            match reading {
                Reading::Odometry(odometry) => now = Some(state(odometry)),
                Reading::Picture(jpeg) => image.clone_from(jpeg),
                Reading::Lidar(returns) => lidar = Some(self.lidar_pixels(returns)),
                Reading::Radar(returns) => radar = Some(self.radar_pixels(returns)),
                _ => {}
            }
        }
        let now = now.unwrap_or_else(|| unreachable!("odometry answers with odometry"));
        let waypoint = world.route.at(world.progress_m());
        let stamp_ns = self.start_ns + drive.steps() as i64 * STEP_NS;
        let route = world.route.local(world.progress_m(), &now);
        let frame = Frame {
            index: self.looked,
            stamp_ns,
            image,
            lidar,
            radar,
            velocity_mps: now.velocity_mps.map(|value| value as f32),
            yaw_rad: now.yaw_rad,
            position_m: now.position_m.to_array(),
            action: RecordedAction::default(),
            route: route.unwrap_or_else(|| unreachable!("a route has two points")),
            command: waypoint.command,
            future: Future::UNKNOWN,
            skew: Skew::default(),
            conditions: self.conditions.clone(),
            in_junction: Some(waypoint.in_junction),
            speed_limit_mps: Some(waypoint.limit_mps as f32),
            perturbed: false,
        };
        self.looked += 1;
        Observation { stamp_ns, frame, readings }
    }

    /// What other sources than those of frames say now.
    pub fn read(&mut self, source: Source, drive: &Drive) -> Reading {
        self.senses.read(source, drive)
    }

    fn lidar_pixels(&self, returns: &[LidarReturn]) -> LidarPixels {
        let places = returns.iter().map(|point| {
            let [x, y, z] = point.position_m.map(|value| f64::from(clouds::told(value)));
            DVec3::new(x, y, z)
        });
        let camera_from_lidar = self.camera_from(&self.rig.lidar.ego_from_lidar);
        lidar_on_picture(places, &camera_from_lidar, &self.rig.camera.intrinsics)
    }

    fn radar_pixels(&self, returns: &[radar::RadarReturn]) -> RadarPixels {
        let told = |point: &radar::RadarReturn| {
            let [x, y, z] = clouds::place(point).map(f64::from);
            let radial_speed_mps = Some(f64::from(point.speed_mps as f32));
            RadarReturn { position_m: DVec3::new(x, y, z), radial_speed_mps }
        };
        let returns: Vec<RadarReturn> = returns.iter().map(told).collect();
        let camera_from_radar = self.camera_from(&self.rig.radar.ego_from_radar);
        let (_, rotation, position_m) = camera_from_radar.to_scale_rotation_translation();
        radar_on_picture(&returns, &Pose { position_m, rotation }, &self.rig.camera.intrinsics)
    }

    fn camera_from(&self, ego_from_sensor: &DAffine3) -> DAffine3 {
        self.rig.camera.ego_from_camera.inverse() * *ego_from_sensor
    }
}

/// Where the car believes itself to be.
fn state(odometry: &OdometryReading) -> EgoState {
    EgoState {
        position_m: odometry.position_m,
        yaw_rad: odometry.orientation.to_euler(EulerRot::ZYX).0,
        velocity_mps: [odometry.velocity_mps.x, odometry.velocity_mps.y],
    }
}
