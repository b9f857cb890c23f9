//! How fast one core senses, and how fast it records: milliseconds by sensor, and steps a second.
//!
//! `scripts/bench_sensors.sh` runs it. A step is a tenth of a second with a picture, a turn of the
//! lidar and a scan of the radar, in dense traffic; the world's own time is in it. Time is that of the
//! thread on its core, so others on the machine count for little.
#![allow(clippy::unwrap_used, clippy::print_stdout)]

use std::{collections::BTreeMap, fs, sync::LazyLock, time};

use pmp::{
    noise::{Noise, Purpose},
    scene::{
        conditions::{Illumination, Sky, Weather},
        instant::Instant,
        shapes::Shapes,
    },
    sensors::{camera::Camera, lidar, radar, rays::Reach},
    sim::{
        drive::Demonstration,
        plan::Episode,
        record::{Recipe, record},
        rig::Rig,
        stage::Stage,
    },
    world::{density::Density, simulation::SUBSTEPS, town::Town},
};

/// The town with most triangles.
const TOWN: &str = "Town03";
const SEED: u64 = 0;

/// Steps that are measured, and steps before them: routes begin at rest.
const STEPS: u32 = 200;
const WARM_UP: u32 = 50;

const SKIES: [Sky; 3] = [
    Sky { illumination: Illumination::Daytime, weather: Weather::Clear },
    Sky { illumination: Illumination::Sunset, weather: Weather::Drizzle },
    Sky { illumination: Illumination::Night, weather: Weather::Storm },
];

fn main() {
    let town = Town::choose(None, &[TOWN.to_string()]).unwrap().remove(0);
    let stage = Stage::new(town);
    let triangles = stage.surroundings.triangles();
    println!("{TOWN}, {triangles} triangles, dense traffic, {STEPS} steps, one thread\n");
    println!(
        "| sky | camera, ms | lidar, ms | radar, ms | world, ms | steps/s | recorded, steps/s |"
    );
    println!("|---|---:|---:|---:|---:|---:|---:|");
    for sky in SKIES {
        let episode =
            Episode { number: 0, seed: SEED, town: TOWN.to_string(), sky, traffic: Density::Dense };
        let spent = sense(&stage, &episode);
        let ms = |of: &str| 1e3 * spent[of] / f64::from(STEPS);
        let [camera, lidar, radar, world] = ["camera", "lidar", "radar", "world"].map(ms);
        println!(
            "| {} {} | {camera:.1} | {lidar:.1} | {radar:.2} | {world:.2} | {:.0} | {:.0} |",
            sky.weather.name(),
            sky.illumination.name(),
            1e3 / (camera + lidar + radar + world),
            recorded(&stage, &episode),
        );
    }
}

/// Time that this thread was on a core, s, to some milliseconds; where the system does not tell, time
/// that passed.
fn spent_s() -> f64 {
    static START: LazyLock<time::Instant> = LazyLock::new(time::Instant::now);
    let told = fs::read_to_string("/proc/thread-self/schedstat").ok();
    let told_ns = told.and_then(|told| told.split(' ').next()?.parse::<f64>().ok());
    told_ns.map_or_else(|| START.elapsed().as_secs_f64(), |ns| 1e-9 * ns)
}

/// Seconds spent on each part of the measured steps.
fn sense(stage: &Stage, episode: &Episode) -> BTreeMap<&'static str, f64> {
    let (rig, shapes) = (Rig::default(), Shapes::new());
    let mut demonstration = Demonstration::new(&stage.town, episode, 0.0).unwrap();
    let mut camera = Camera::new(rig.camera.clone());
    let noise = |purpose| Noise::new(episode.seed, episode.number, purpose);
    let (mut lidar_noise, mut radar_noise) = (noise(Purpose::Lidar), noise(Purpose::Radar));
    let mut spent = BTreeMap::new();
    for step in 0..WARM_UP + STEPS {
        let mut last = spent_s();
        let mut lap = |what: &'static str| {
            let (before, now) = (last, spent_s());
            last = now;
            if step >= WARM_UP {
                *spent.entry(what).or_default() += now - before;
            }
        };
        for _ in 0..SUBSTEPS {
            demonstration.step();
        }
        let drive = &demonstration.drive;
        lap("world");
        let (ego, ground_m) = (*drive.world.ego(), drive.world.ground_m());
        let instant = Instant::of(&drive.world.snapshot(), &shapes);
        let pose = ego.world_from_ego(ground_m);
        camera.picture(&stage.surroundings, &instant, &pose, episode.sky, SEED);
        lap("camera");
        let place_m = pose.translation.as_vec3();
        let reach = Reach::new(&stage.standing, &instant, place_m, rig.lidar.range_m as f32);
        lidar::turn(&rig.lidar, &reach, &pose, episode.sky, &mut lidar_noise);
        lap("lidar");
        let reach = Reach::new(&stage.standing, &instant, place_m, rig.radar.range_m as f32);
        let own_mps = rig.radar.velocity_world_mps(&ego);
        radar::scan(&rig.radar, &reach, &pose, own_mps, episode.sky, &mut radar_noise);
        lap("radar");
    }
    spent
}

/// Steps a second of recording into a file, from the first to the last byte.
fn recorded(stage: &Stage, episode: &Episode) -> f64 {
    let folder = tempfile::tempdir().unwrap();
    let seconds = f64::from(STEPS) / 10.0;
    let recipe = Recipe { seconds: Some(seconds), ..Recipe::default() };
    let start = spent_s();
    let path = folder.path().join(episode.file_name());
    let identity = ("pmp.episode", &BTreeMap::new());
    record(stage, &Shapes::new(), episode, &recipe, &path, identity, &|| ()).unwrap();
    f64::from(STEPS) / (spent_s() - start)
}
