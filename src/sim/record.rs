//! Drives and recorders: a seed in, one MCAP file a drive out.
//!
//! Each sensor samples on its own clock, and its message reaches the recorder some time later,
//! not always the same; so log times lie behind header stamps, and messages of different topics
//! arrive out of stamp order, as in a car.

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
};

use rayon::prelude::*;

use crate::{
    error::{Error, Result},
    frame::Conditions,
    log::{
        APPLIED_CONTROL, CONDITIONS_RECORD,
        encode::Message,
        writer::{LogOptions, LogWriter},
    },
    noise::{Noise, Purpose},
    sim::{camera, lidar, messages, radar, world::World},
    world::ego::{Car, STEP_S},
};

/// Stamp of the first step of episode 0; episodes start [`EPISODE_APART_NS`] apart.
const START_NS: i64 = 1_750_000_000_000_000_000;
const EPISODE_APART_NS: i64 = 86_400_000_000_000;

const STEPS_PER_S: u64 = (1.0 / STEP_S) as u64;
const STEP_NS: i64 = 1_000_000_000 / STEPS_PER_S as i64;

/// What is recorded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Source {
    Camera,
    Lidar,
    Radar,
    Odometry,
    Control,
    Imu,
}

/// A sensor's clock and the way to the recorder.
struct Clock {
    source: Source,
    rate_hz: u64,
    /// Steps by which its first sample comes early: sensors do not tick together.
    phase: u64,
    /// From the stamp to the recorder: the least, and the mean of what comes on top, s.
    latency_s: f64,
    jitter_s: f64,
}

#[rustfmt::skip]
const CLOCKS: &[Clock] = &[
    Clock { source: Source::Imu,      rate_hz: 100, phase: 0, latency_s: 0.001, jitter_s: 0.0005 },
    Clock { source: Source::Odometry, rate_hz: 50,  phase: 1, latency_s: 0.003, jitter_s: 0.001 },
    Clock { source: Source::Control,  rate_hz: 20,  phase: 0, latency_s: 0.002, jitter_s: 0.001 },
    Clock { source: Source::Camera,   rate_hz: 20,  phase: 2, latency_s: 0.030, jitter_s: 0.006 },
    Clock { source: Source::Lidar,    rate_hz: 10,  phase: 7, latency_s: 0.045, jitter_s: 0.008 },
    Clock { source: Source::Radar,    rate_hz: 13,  phase: 3, latency_s: 0.025, jitter_s: 0.005 },
];

impl Clock {
    fn ticks_at(&self, step: u64) -> bool {
        (step + self.phase) * self.rate_hz % STEPS_PER_S < self.rate_hz
    }
}

/// One drive, whole: the same value gives the same file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drive {
    pub seed: u64,
    pub episode: u32,
    /// Length of the drive, s.
    pub seconds: f64,
}

impl Drive {
    pub fn file_name(&self) -> String {
        format!("plain-road-{}-{}.mcap", self.seed, self.episode)
    }

    /// What the road, the weather and the traffic are.
    pub fn conditions(&self) -> Conditions {
        Conditions {
            town: Some("PlainRoad".into()),
            weather: Some("clear".into()),
            illumination: Some("daytime".into()),
            traffic: Some("few".into()),
        }
    }
}

/// Drives to record.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordConfig {
    /// Directory for the logs; made if it is missing.
    pub out: PathBuf,
    pub seed: u64,
    pub episodes: u32,
    /// Length of each drive, s.
    pub seconds: f64,
    /// Drives at a time; 0 is one per core. No byte depends on it.
    pub jobs: usize,
    pub log: LogOptions,
}

/// Record all drives of a configuration; the files in the order of episodes.
///
/// `progress` is called after each simulated second of any drive.
///
/// # Errors
///
/// [`Error::Exists`] if a log is there already, before anything is driven; [`Error::Config`] if
/// the length makes no sense; [`Error::Io`] if a file cannot be written.
pub fn record_all(config: &RecordConfig, progress: &(dyn Fn() + Sync)) -> Result<Vec<PathBuf>> {
    check_seconds(config.seconds)?;
    fs::create_dir_all(&config.out).map_err(Error::io("create", &config.out))?;
    let drives: Vec<(Drive, PathBuf)> = (0..config.episodes)
        .map(|episode| Drive { seed: config.seed, episode, seconds: config.seconds })
        .map(|drive| (drive, config.out.join(drive.file_name())))
        .collect();
    if let Some((_, path)) = drives.iter().find(|(_, path)| path.exists()) {
        return Err(Error::Exists {
            path: path.clone(),
            hint: "choose another --seed or --out, or move the old logs away".into(),
        });
    }
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(config.jobs)
        .build()
        .map_err(|e| Error::Config { key: "jobs".into(), what: e.to_string(), hint: None })?;
    pool.install(|| {
        drives
            .into_par_iter()
            .map(|(drive, path)| record(&drive, &path, config.log, progress).map(|()| path))
            .collect()
    })
}

/// Record one drive into a new log.
///
/// `progress` is called after each simulated second.
///
/// # Errors
///
/// [`Error::Exists`] if the log is there already; [`Error::Config`] if the length makes no
/// sense; [`Error::Io`] if the file cannot be written.
pub fn record(
    drive: &Drive,
    path: &Path,
    options: LogOptions,
    progress: &(dyn Fn() + Sync),
) -> Result<()> {
    check_seconds(drive.seconds)?;
    let mut log = LogWriter::create(path, options)?;
    log.write_metadata(CONDITIONS_RECORD, &words(&drive.conditions()))?;
    let mut recorder = Recorder::new(drive);
    recorder.send("/tf_static", messages::static_transforms(recorder.stamp_ns), 0);
    let steps = (drive.seconds * STEPS_PER_S as f64).round() as u64;
    for step in 0..=steps {
        recorder.sample();
        for (log_time_ns, sent) in recorder.arrived() {
            log.write(sent.topic, sent.message.as_ref(), log_time_ns)?;
        }
        if step > 0 && step.is_multiple_of(STEPS_PER_S) {
            progress();
        }
        recorder.step();
    }
    log.finish()
}

fn check_seconds(seconds: f64) -> Result<()> {
    const LONGEST_S: f64 = 3600.0;
    if (STEP_S..=LONGEST_S).contains(&seconds) {
        return Ok(());
    }
    Err(Error::Config {
        key: "seconds".into(),
        what: format!("a drive of {seconds} s cannot be recorded"),
        hint: Some(format!("give {STEP_S} to {LONGEST_S} s; record more episodes for more data")),
    })
}

/// What a log tells of its drive, as key and value.
fn words(conditions: &Conditions) -> BTreeMap<String, String> {
    let Conditions { town, weather, illumination, traffic } = conditions;
    let applied = Some("/vehicle/status".to_owned());
    let words = [
        ("town", town),
        ("weather", weather),
        ("illumination", illumination),
        ("traffic", traffic),
        (APPLIED_CONTROL, &applied),
    ];
    words.into_iter().filter_map(|(key, value)| Some((key.to_owned(), value.clone()?))).collect()
}

/// A message on its way to the recorder.
struct Sent {
    topic: &'static str,
    message: Box<dyn Message>,
}

/// A world, its sensors, and the messages that are on their way.
struct Recorder {
    world: World,
    before: Car,
    stamp_ns: i64,
    lidar: Noise,
    radar: Noise,
    odometry: Noise,
    imu: Noise,
    latency: Noise,
    /// By log time; messages of one instant in the order they were sent.
    under_way: BTreeMap<(i64, u64), Sent>,
    sent: u64,
}

impl Recorder {
    fn new(drive: &Drive) -> Self {
        let noise = |purpose| Noise::new(drive.seed, drive.episode, purpose);
        let world = World::new(drive.seed, drive.episode, drive.seconds);
        Recorder {
            before: *world.ego(),
            world,
            stamp_ns: START_NS + i64::from(drive.episode) * EPISODE_APART_NS,
            lidar: noise(Purpose::Lidar),
            radar: noise(Purpose::Radar),
            odometry: noise(Purpose::Odometry),
            imu: noise(Purpose::Imu),
            latency: noise(Purpose::Latency),
            under_way: BTreeMap::new(),
            sent: 0,
        }
    }

    fn step(&mut self) {
        self.before = *self.world.ego();
        self.world.step();
        self.stamp_ns += STEP_NS;
    }

    /// Take what every clock that ticks now asks for.
    fn sample(&mut self) {
        let step = self.world.steps();
        for clock in CLOCKS.iter().filter(|clock| clock.ticks_at(step)) {
            let wait_s = clock.latency_s + self.latency.normal(clock.jitter_s).abs();
            self.publish(clock.source, (wait_s * 1e9) as i64);
        }
    }

    fn publish(&mut self, source: Source, wait_ns: i64) {
        let (ego, s_m, stamp_ns) = (*self.world.ego(), self.world.s_m(), self.stamp_ns);
        match source {
            Source::Camera => {
                let scene = self.world.scene();
                let rgb = camera::picture(&scene, &self.world.road, &ego.world_from_ego(), s_m);
                self.send(
                    "/camera/front/image/compressed",
                    messages::image(stamp_ns, &rgb),
                    wait_ns,
                );
                self.send("/camera/front/camera_info", messages::camera_info(stamp_ns), wait_ns);
            }
            Source::Lidar => {
                let scene = self.world.scene();
                let pose = ego.world_from_ego();
                let turn = lidar::turn(&scene, &self.world.road, &pose, s_m, &mut self.lidar);
                self.send("/lidar/points", messages::point_cloud(stamp_ns, &turn), wait_ns);
            }
            Source::Radar => {
                let returns = radar::scan(&self.world.scene(), &ego, &mut self.radar);
                self.send("/radar/front", messages::radar_scan(stamp_ns, &returns), wait_ns);
            }
            Source::Odometry => {
                let odometry = messages::odometry(stamp_ns, &ego, &mut self.odometry);
                self.send("/tf", messages::ego_transform(&odometry), wait_ns);
                self.send("/odom", odometry, wait_ns);
            }
            Source::Control => {
                let decision = *self.world.decision();
                let control = messages::control(stamp_ns, &decision.wanted);
                self.send("/vehicle/control", control, wait_ns);
                let status = messages::status(stamp_ns, &ego, &decision.applied);
                self.send("/vehicle/status", status, wait_ns);
            }
            Source::Imu => {
                let change = ego.velocity_world_mps() - self.before.velocity_world_mps();
                let imu = messages::imu(stamp_ns, &ego, change / STEP_S, &mut self.imu);
                self.send("/imu", imu, wait_ns);
            }
        }
    }

    fn send(&mut self, topic: &'static str, message: impl Message + 'static, wait_ns: i64) {
        let key = (self.stamp_ns + wait_ns, self.sent);
        self.sent += 1;
        self.under_way.insert(key, Sent { topic, message: Box::new(message) });
    }

    /// Messages that have reached the recorder, with their log times, in the order they did.
    fn arrived(&mut self) -> impl Iterator<Item = (i64, Sent)> + use<> {
        let later = self.under_way.split_off(&(self.stamp_ns + 1, 0));
        let arrived = std::mem::replace(&mut self.under_way, later);
        arrived.into_iter().map(|((log_time_ns, _), sent)| (log_time_ns, sent))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_clock_ticks_at_its_rate() {
        for clock in CLOCKS {
            let ticks = (0..10 * STEPS_PER_S).filter(|step| clock.ticks_at(*step)).count();
            assert_eq!(ticks as u64, 10 * clock.rate_hz, "{:?}", clock.source);
        }
    }
}
