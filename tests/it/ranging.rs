//! Lidar, radar and the sensors of motion: against another library's rays, closed forms, and
//! differences over time.

use std::{
    f64::consts::TAU,
    sync::{Arc, LazyLock},
};

use crate::scene::somebody;

use glam::{Affine3A, DAffine3, DQuat, DVec2, DVec3, Vec2, Vec3};
use parry3d::{
    math::Vector,
    query::{Ray, RayCast as _},
    shape::TriMesh,
};
use pmp::{
    noise::{Noise, Purpose},
    policy::Action,
    scene::{
        conditions::{Illumination, Sky, Weather},
        instant::{Body, Instant},
        mesh::{Material, Mesh, Triangle, Vertex},
        shapes::Shapes,
        surroundings::{Surroundings, Tile},
    },
    sensors::{
        gnss::{Gnss, GnssConfig},
        imu::{Imu, ImuConfig},
        lidar::{self, LidarConfig, LidarReturn},
        odometry::{self, OdometryConfig},
        radar::{self, RadarConfig, RadarReturn},
        rays::{Reach, Standing},
    },
    world::{
        ego::{self, Car},
        kind::{VehicleKind, WalkerKind},
        snapshot::{Snapshot, vehicle_states, walker_states},
        town::Town,
        traffic::Traffic,
        walkers::Walkers,
    },
};

const CLEAR_DAY: Sky = Sky { illumination: Illumination::Daytime, weather: Weather::Clear };
const STORM_DARK: Sky = Sky { illumination: Illumination::Dark, weather: Weather::Storm };

static SHAPES: LazyLock<Shapes> = LazyLock::new(Shapes::new);

/// A lidar that loses nothing and is never wrong.
fn exact_lidar() -> LidarConfig {
    LidarConfig { range_std_m: 0.0, dropped: 0.0, dropped_at_zero: 0.0, ..LidarConfig::default() }
}

/// A radar that is never wrong about what comes back.
fn exact_radar() -> RadarConfig {
    let (range_std_m, angle_std_rad, speed_std_mps) = (0.0, 0.0, 0.0);
    RadarConfig { range_std_m, angle_std_rad, speed_std_mps, ..RadarConfig::default() }
}

fn lidar_noise() -> Noise {
    Noise::new(3, 0, Purpose::Lidar)
}

/// A rectangle from three of its corners.
fn rectangle(from_m: Vec3, along_m: Vec3, across_m: Vec3, material: Material) -> Mesh {
    let places = [from_m, from_m + along_m, from_m + along_m + across_m, from_m + across_m];
    let vertex = |position_m| Vertex { position_m, texture_m: Vec2::ZERO };
    let triangle = |corners| Triangle { corners, material, colour: [128; 3] };
    let triangles = vec![triangle([0, 1, 2]), triangle([0, 2, 3])];
    Mesh { vertices: places.map(vertex).to_vec(), triangles }
}

fn town_of(meshes: Vec<Mesh>) -> Standing {
    let bound_m = Vec3::splat(1000.0);
    let tile = |mesh: Mesh| Tile { low_m: -bound_m, high_m: bound_m, mesh: mesh.into() };
    Standing::new(&Surroundings { tiles: meshes.into_iter().map(tile).collect() })
}

/// Asphalt all around at height zero.
fn plain() -> Standing {
    let (x, y) = (Vec3::X * 400.0, Vec3::Y * 400.0);
    town_of(vec![rectangle(-0.5 * (x + y), x, y, Material::Asphalt)])
}

/// A room of concrete, 60 m wide and long and 40 m high, around the origin.
fn room() -> Standing {
    let (x, y, z) = (Vec3::X * 60.0, Vec3::Y * 60.0, Vec3::Z * 40.0);
    let low = -0.5 * (x + y + z);
    let wall = |from_m, along_m, across_m| rectangle(from_m, along_m, across_m, Material::Concrete);
    let near = [wall(low, x, y), wall(low, y, z), wall(low, z, x)];
    let far = [wall(low + z, x, y), wall(low + x, y, z), wall(low + y, z, x)];
    town_of(near.into_iter().chain(far).collect())
}

fn body(mesh: Arc<Mesh>, actor: u32, at_m: Vec3, heading_rad: f32, velocity_mps: DVec3) -> Body {
    let world_from_body =
        Affine3A::from_rotation_translation(glam::Quat::from_rotation_z(heading_rad), at_m);
    let colour = [120; 3];
    Body { actor, mesh, world_from_body, colour, velocity_mps, is_braking: false }
}

fn car(actor: u32, at_m: Vec3, heading_rad: f32, velocity_mps: DVec3) -> Body {
    body(SHAPES.vehicle(VehicleKind::Car, actor), actor, at_m, heading_rad, velocity_mps)
}

fn instant(bodies: Vec<Body>) -> Instant {
    Instant { time_s: 0.0, bodies }
}

/// A town with dense traffic.
struct Busy {
    surroundings: Surroundings,
    standing: Standing,
    snapshot: Snapshot,
}

static BUSY: LazyLock<Busy> = LazyLock::new(|| {
    let town = Town::choose(None, &["Town02".to_string()]).unwrap().remove(0);
    let mut noise = Noise::new(5, 0, Purpose::Traffic);
    let actor = |id| Noise::of_actor(5, 0, id);
    let traffic = Traffic::spawn(&town.streets, 60, DVec2::splat(1e4), 1.0, &mut noise, actor);
    let walkers = Walkers::spawn(&town.streets, 60, &mut noise, actor);
    let surroundings = Surroundings::of(&town.map, &town.scenery);
    Busy {
        standing: Standing::new(&surroundings),
        surroundings,
        snapshot: Snapshot {
            time_s: 0.0,
            ego: Car::default(),
            ego_ground_m: 0.0,
            vehicles: vehicle_states(&town.streets, &traffic),
            walkers: walker_states(&walkers),
        },
    }
});

/// Everything but the vehicle at `place`, and where that vehicle stands.
fn without(place: usize) -> (Instant, DAffine3) {
    let mut snapshot = BUSY.snapshot.clone();
    let ego = snapshot.vehicles.remove(place);
    let instant = Instant::of(&snapshot, &SHAPES);
    let heading_rad = ego.footprint.forward.to_angle();
    let ground_m = ego.footprint.centre_m.extend(ego.ground_m);
    (instant, DAffine3::from_translation(ground_m) * DAffine3::from_rotation_z(heading_rad))
}

/// The same triangles, as parry3d has them.
fn oracle(surroundings: &Surroundings, instant: &Instant) -> TriMesh {
    let (mut places, mut triangles) = (Vec::new(), Vec::new());
    let mut add = |mesh: &Mesh, world_from_mesh: &Affine3A| {
        let first = places.len() as u32;
        places.extend(mesh.vertices.iter().map(|vertex| {
            let [x, y, z] = world_from_mesh.transform_point3(vertex.position_m).to_array();
            Vector::new(x, y, z)
        }));
        triangles.extend(mesh.triangles.iter().map(|t| t.corners.map(|corner| corner + first)));
    };
    surroundings.tiles.iter().for_each(|tile| add(&tile.mesh, &Affine3A::IDENTITY));
    instant.bodies.iter().for_each(|body| add(&body.mesh, &body.world_from_body));
    TriMesh::new(places, triangles).unwrap()
}

#[test]
fn ranges_are_those_of_another_library() {
    let config = LidarConfig { columns: 125, ..exact_lidar() };
    let (mut asked, mut alike, mut on_actors) = (0, 0, 0);
    let (mut apart_m, mut both) = (0.0, 0);
    for (place, tilt_rad) in [(0, 0.0), (20, 0.12), (40, -0.2)] {
        let (instant, world_from_ego) = without(place);
        let lean = DQuat::from_rotation_x(tilt_rad) * DQuat::from_rotation_y(0.5 * tilt_rad);
        let ego_from_lidar = config.ego_from_lidar * DAffine3::from_quat(lean);
        let config = LidarConfig { ego_from_lidar, ..config };
        let other = oracle(&BUSY.surroundings, &instant);
        let world_from_lidar = world_from_ego * config.ego_from_lidar;
        let origin_m = world_from_lidar.translation.as_vec3();
        let reach = Reach::new(&BUSY.standing, &instant, origin_m, 50.0);
        let (rays, mut met) = (reach.rays(), 0_usize);
        for column in 0..config.columns {
            for ring in 0..config.beams {
                let beam = radar::direction(config.azimuth_rad(column), config.elevation_rad(ring));
                let ray = world_from_lidar.transform_vector3(beam).as_vec3();
                let hit = rays.hit(origin_m, ray, 50.0);
                let [o, d] = [origin_m, ray].map(|v| Vector::new(v.x, v.y, v.z));
                let told_m = other.cast_local_ray(&Ray::new(o, d), 50.0, false);
                asked += 1;
                met += usize::from(told_m.is_some());
                alike += usize::from(hit.is_some() == told_m.is_some());
                if let (Some(hit), Some(told_m)) = (hit, told_m) {
                    on_actors += usize::from(hit.actor.is_some());
                    apart_m += f64::from((hit.range_m - told_m).abs());
                    both += 1;
                }
            }
        }
        let turn = lidar::turn(&config, &reach, &world_from_ego, CLEAR_DAY, &mut lidar_noise());
        let off_m: Vec<f64> = (turn.iter())
            .map(|point| {
                let place_m =
                    world_from_lidar.transform_point3(Vec3::from(point.position_m).as_dvec3());
                let way_m = place_m.as_vec3() - origin_m;
                let [o, d] = [origin_m, way_m.normalize()].map(|v| Vector::new(v.x, v.y, v.z));
                let told_m = other.cast_local_ray(&Ray::new(o, d), 51.0, false);
                told_m.map_or(f64::INFINITY, |told_m| f64::from((told_m - way_m.length()).abs()))
            })
            .collect();
        let near: Vec<f64> = off_m.iter().copied().filter(|off_m| *off_m < 0.002).collect();
        let (all, elsewhere) = (turn.len(), turn.len() - near.len());
        assert!(all > 1000 && elsewhere * 1000 < all, "{elsewhere} of {all} returns are elsewhere");
        let mean_mm = 1000.0 * near.iter().sum::<f64>() / near.len() as f64;
        println!("turn: {elsewhere} of {all} ({met}) elsewhere, others {mean_mm:.4} mm apart");
        assert!(mean_mm < 0.1, "{mean_mm} mm apart");
        assert!(all.abs_diff(met) * 1000 < met, "{all} returns of {met} rays that meet something");
    }
    let mean_mm = 1000.0 * apart_m / f64::from(both);
    println!("{alike} of {asked} alike, {mean_mm:.4} mm apart, {on_actors} on actors");
    assert!(mean_mm < 1.0, "{mean_mm} mm apart");
    assert!(1000 * alike > 999 * asked, "{alike} of {asked} alike");
    assert!(on_actors > 50, "{on_actors} rays meet traffic");
}

#[test]
fn rings_look_from_30_degrees_down_to_10_up() {
    for beams in [32, 64] {
        let config = LidarConfig { beams, columns: 90, ..exact_lidar() };
        let (room, empty) = (room(), Instant::default());
        let reach = Reach::new(&room, &empty, Vec3::ZERO, 50.0);
        let returns =
            lidar::turn(&config, &reach, &DAffine3::IDENTITY, CLEAR_DAY, &mut lidar_noise());
        assert_eq!(returns.len(), beams * 90, "all of them meet a wall");
        for LidarReturn { position_m, intensity, ring } in returns {
            let [x, y, z] = position_m.map(f64::from);
            let up_deg = z.atan2(x.hypot(y)).to_degrees();
            let wanted_deg = -30.0 + 40.0 * f64::from(ring) / (beams - 1) as f64;
            assert!((up_deg - wanted_deg).abs() < 1e-3, "ring {ring} looks {up_deg} up");
            assert!((0.0..=1.0).contains(&intensity) && intensity > 0.05);
        }
    }
}

/// Ranges, losses and intensities on flat ground, where all are known in closed form.
#[test]
fn noise_and_losses_are_those_asked_for() {
    let config = LidarConfig { columns: 4000, ..LidarConfig::default() };
    let (plain, empty) = (plain(), Instant::default());
    let reach = Reach::new(&plain, &empty, Vec3::ZERO, 60.0);
    let returns = lidar::turn(&config, &reach, &DAffine3::IDENTITY, CLEAR_DAY, &mut lidar_noise());
    let (mut sum, mut squares, mut count) = (0.0, 0.0, 0.0);
    for ring in 0..config.beams {
        let down = -config.elevation_rad(ring).sin();
        let range_m = 1.8 / down;
        let of_ring: Vec<_> =
            returns.iter().filter(|point| usize::from(point.ring) == ring).collect();
        if !(0.0..49.9).contains(&range_m) {
            assert!(of_ring.is_empty());
            continue;
        }
        // Asphalt sends 11 % back, by Lambert's law.
        let intensity = 0.11 * down * (-0.004 * range_m).exp();
        let kept = 0.55 * (1.0 - 0.4 * (1.0 - intensity / 0.8));
        let tried = config.columns as f64;
        let off = (of_ring.len() as f64 - kept * tried) / (tried * kept * (1.0 - kept)).sqrt();
        assert!(off.abs() < 4.5, "ring {ring}: {} points, {off} sigma", of_ring.len());
        for point in of_ring {
            assert!((f64::from(point.intensity) - intensity).abs() < 1e-4);
            let error_m = f64::from(Vec3::from(point.position_m).length()) - range_m;
            (sum, squares, count) = (sum + error_m, squares + error_m * error_m, count + 1.0);
        }
    }
    let (mean_m, std_m) = (sum / count, (squares / count).sqrt());
    assert!(mean_m.abs() < 5.0 * 0.02 / f64::sqrt(count), "mean {mean_m}");
    assert!((std_m / 0.02 - 1.0).abs() < 0.02, "standard deviation {std_m}");
}

#[test]
fn what_stands_left_has_positive_y_and_azimuth() {
    let plain = plain();
    for (yaw_rad, left) in [(0.0_f64, Vec3::Y), (TAU / 4.0, Vec3::NEG_X), (2.0, Vec3::ZERO)] {
        // Ahead, and some way to the left.
        let forward = DVec2::from_angle(yaw_rad).extend(0.0).as_vec3();
        let left = if left == Vec3::ZERO { Vec3::Z.cross(forward) } else { left };
        let bodies = vec![car(7, forward * 20.0 + left * 4.0, yaw_rad as f32, DVec3::ZERO)];
        let instant = instant(bodies);
        let reach = Reach::new(&plain, &instant, Vec3::ZERO, 100.0);
        let world_from_ego = DAffine3::from_rotation_z(yaw_rad);
        let points =
            lidar::turn(&exact_lidar(), &reach, &world_from_ego, CLEAR_DAY, &mut lidar_noise());
        let on_car: Vec<_> = points.iter().filter(|p| p.position_m[2] > -1.7).collect();
        assert!(on_car.len() > 50);
        let is_there = |p: &&LidarReturn| {
            let [x, y, _] = p.position_m;
            (17.0..23.0).contains(&x) && (2.5..5.5).contains(&y)
        };
        assert!(on_car.iter().all(is_there), "{on_car:?}");
        let returns = scans(&reach, &world_from_ego, DVec3::ZERO, 20);
        let on_car: Vec<_> = returns.iter().filter(|r| r.actor == Some(7)).collect();
        assert!(on_car.len() > 20);
        assert!(on_car.iter().all(|r| (0.1..0.31).contains(&r.azimuth_rad)), "{on_car:?}");
    }
}

/// Scans of a radar that is exact.
fn scans(
    reach: &Reach,
    world_from_ego: &DAffine3,
    radar_mps: DVec3,
    times: usize,
) -> Vec<RadarReturn> {
    let mut noise = Noise::new(1, 0, Purpose::Radar);
    let scan =
        |_| radar::scan(&exact_radar(), reach, world_from_ego, radar_mps, CLEAR_DAY, &mut noise);
    (0..times).flat_map(scan).collect()
}

/// Follow the points that were hit for a hundredth of a second: their distance changes as the
/// returns said, for a car that turns and others on the move.
#[test]
fn a_radar_s_speed_is_the_change_of_the_distance() {
    let plain = plain();
    let ego = Car {
        position_m: DVec2::new(3.0, -2.0),
        yaw_rad: 0.4,
        speed_mps: 12.0,
        steer_rad: 0.12,
        ..Car::default()
    };
    let forward = DVec2::from_angle(0.4).extend(0.0);
    let ahead = |along_m: f64, left_m: f64| {
        (ego.position_m.extend(0.0) + forward * along_m + forward.cross(DVec3::NEG_Z) * left_m)
            .as_vec3()
    };
    let bodies = vec![
        car(1, ahead(18.0, 3.0), 0.4, forward * 15.0),
        car(2, ahead(25.0, -4.0), 3.5, forward * -9.0),
        car(3, ahead(32.0, 1.0), 1.9, DVec3::new(-6.0, 5.0, 0.0)),
    ];
    let instant = instant(bodies);
    let reach = Reach::new(&plain, &instant, ego.position_m.extend(0.0).as_vec3(), 100.0);
    let config = exact_radar();
    let radar_mps = config.velocity_world_mps(&ego);
    let returns = scans(&reach, &ego.world_from_ego(0.0), radar_mps, 60);
    let hold = Action { steer: ego.config.steer(0.12, 12.0) as f32, throttle: 0.2, brake: 0.0 };
    let later = ego.step(hold);
    let [now, then] = [ego, later].map(|car| car.world_from_ego(0.0) * config.ego_from_radar);
    let mut seen = [0; 4];
    for r in &returns {
        let beam = radar::direction(r.azimuth_rad, r.elevation_rad);
        let place_m = now.transform_point3(beam * r.range_m);
        let body = instant.bodies.iter().find(|body| Some(body.actor) == r.actor);
        let moved_m = body.map_or(DVec3::ZERO, |body| body.velocity_mps * ego::STEP_S);
        let after_m = then.translation.distance(place_m + moved_m);
        let rate_mps = (after_m - r.range_m) / ego::STEP_S;
        assert!((rate_mps - r.speed_mps).abs() < 0.06, "{rate_mps}, but {r:?}");
        seen[r.actor.unwrap_or(0) as usize] += 1;
    }
    assert!(seen.iter().all(|count| *count > 10), "{seen:?}");
    // Who drives away faster has a positive speed, who comes closer a negative one.
    for r in returns.iter().filter(|r| r.actor.is_some_and(|actor| actor < 3)) {
        assert_eq!(r.speed_mps > 0.0, r.actor == Some(1), "{r:?}");
    }
}

#[test]
fn what_stands_ahead_approaches_at_the_car_s_speed() {
    let (plain, instant) = (plain(), instant(vec![car(4, Vec3::X * 30.0, 0.0, DVec3::ZERO)]));
    let reach = Reach::new(&plain, &instant, Vec3::ZERO, 100.0);
    let mut noise = Noise::new(1, 0, Purpose::Radar);
    let config = RadarConfig::default();
    let (at, speed) = (DAffine3::IDENTITY, DVec3::X * 10.0);
    let scan = |_| radar::scan(&config, &reach, &at, speed, CLEAR_DAY, &mut noise);
    let returns: Vec<_> = (0..100).flat_map(scan).collect();
    let errors: Vec<f64> = (returns.iter())
        .map(|r| r.speed_mps + 10.0 * r.azimuth_rad.cos() * r.elevation_rad.cos())
        .collect();
    let std = (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt();
    assert!((std / 0.08 - 1.0).abs() < 0.15, "noise of {std} m/s");
    let on_car = returns.iter().filter(|r| r.actor == Some(4)).count();
    // It covers a fiftieth of the field, asphalt half of it: ray by ray metal answers ten times as
    // often.
    let ground = returns.len() - on_car;
    assert!(ground > 20 && on_car * 24 > 10 * ground, "metal {on_car}, asphalt {ground}");
}

#[test]
fn the_same_seed_gives_the_same_returns() {
    let (instant, world_from_ego) = without(10);
    let place_m = world_from_ego.translation.as_vec3();
    let reach = Reach::new(&BUSY.standing, &instant, place_m, 100.0);
    let config = LidarConfig { columns: 100, ..LidarConfig::default() };
    let turn = |seed| {
        let mut noise = Noise::new(seed, 0, Purpose::Lidar);
        lidar::turn(&config, &reach, &world_from_ego, STORM_DARK, &mut noise)
    };
    let scan = |seed| {
        let mut noise = Noise::new(seed, 0, Purpose::Radar);
        let config = RadarConfig::default();
        radar::scan(&config, &reach, &world_from_ego, DVec3::X, STORM_DARK, &mut noise)
    };
    assert_eq!(turn(1), turn(1));
    assert_eq!(scan(1), scan(1));
    assert_ne!(turn(1), turn(2));
    assert_ne!(scan(1), scan(2));
}

/// People on foot 15 m away come back as often under any sky as on a clear day.
#[test]
fn no_sky_hides_anybody_from_lidar_and_radar() {
    const TURNS: usize = 20;
    const SCANS: usize = 200;
    const PEOPLE: u32 = 24;
    let plain = plain();
    let mesh = SHAPES.walker(&somebody(WalkerKind::Adult, 9, 0.0, 0.0));
    // All around the car; the radar sees the one ahead.
    let place = |id: u32| {
        let angle_rad = TAU as f32 * id as f32 / PEOPLE as f32;
        let at_m = Vec2::from_angle(angle_rad).extend(0.0) * 15.0;
        body(mesh.clone(), id, at_m, angle_rad + 1.6, DVec3::ZERO)
    };
    let instant = instant((0..PEOPLE).map(place).collect());
    let reach = Reach::new(&plain, &instant, Vec3::ZERO, 100.0);
    let at = DAffine3::IDENTITY;
    let seen = |sky: Sky| {
        let mut noise = lidar_noise();
        let mut turn = || lidar::turn(&LidarConfig::default(), &reach, &at, sky, &mut noise);
        let is_on = |p: &LidarReturn| {
            let [x, y, z] = p.position_m;
            (14.5..15.5).contains(&x.hypot(y)) && z > -1.6
        };
        let points: usize =
            (0..TURNS).map(|_| turn().iter().filter(|point| is_on(point)).count()).sum();
        let mut noise = Noise::new(8, 0, Purpose::Radar);
        let config = RadarConfig::default();
        let mut scan = || radar::scan(&config, &reach, &at, DVec3::ZERO, sky, &mut noise);
        let echoes: usize =
            (0..SCANS).map(|_| scan().iter().filter(|r| r.actor == Some(0)).count()).sum();
        [points as f64 / (TURNS as f64 * f64::from(PEOPLE)), echoes as f64 / SCANS as f64]
    };
    let day = seen(CLEAR_DAY);
    for (illumination, weather) in
        Illumination::ALL.into_iter().flat_map(|light| Weather::ALL.map(|weather| (light, weather)))
    {
        let now = seen(Sky { illumination, weather });
        println!(
            "{} {}: {:.2} returns a turn, {:.2} a scan",
            weather.name(),
            illumination.name(),
            now[0],
            now[1]
        );
        for (day, now) in day.into_iter().zip(now) {
            assert!(day > 0.5 && (now / day - 1.0).abs() < 0.3, "{day} by day, {now} now");
        }
    }
}

#[test]
fn a_storm_sends_some_light_back_from_close_by_and_weakens_the_rest() {
    let far = room();
    let (nothing, empty) = (town_of(Vec::new()), Instant::default());
    let turn = |town: &Standing, weather: Weather| {
        let sky = Sky { weather, ..CLEAR_DAY };
        let reach = Reach::new(town, &empty, Vec3::ZERO, 50.0);
        lidar::turn(&LidarConfig::default(), &reach, &DAffine3::IDENTITY, sky, &mut lidar_noise())
    };
    assert!(turn(&nothing, Weather::Clear).is_empty());
    let counts = Weather::ALL.map(|weather| {
        let drops = turn(&nothing, weather);
        assert!(drops.iter().all(|p| Vec3::from(p.position_m).length() < 25.0));
        assert!(drops.iter().all(|p| p.intensity <= 0.1));
        drops.len()
    });
    assert!(counts.is_sorted() && (50..500).contains(&counts[3]), "{counts:?}");
    let mean = Weather::ALL.map(|weather| {
        let points = turn(&far, weather);
        let sum: f64 = points.iter().map(|point| f64::from(point.intensity)).sum();
        sum / points.len() as f64
    });
    assert!(mean.is_sorted_by(|a, b| a > b), "{mean:?}");
}

/// A car on a circle: the middle of the car is pulled to the middle of the circle by v2/r.
#[test]
fn a_turn_to_the_left_pulls_to_the_left() {
    let held = Action { steer: -0.2, throttle: 0.0, brake: 0.0 };
    let steer_rad = Car::default().config.wheel_rad(f64::from(-0.2_f32), 9.0);
    let mut before = Car { speed_mps: 9.0, steer_rad, yaw_rad: 1.0, ..Car::default() };
    before = before.step(held);
    let now = before.step(held);
    let config = ImuConfig {
        yaw_std_rad: 0.0,
        turn_std_radps: 0.0,
        turn_offset_std_radps: 0.0,
        acceleration_std_mps2: 0.0,
        acceleration_offset_std_mps2: 0.0,
    };
    let mut noise = Noise::new(1, 0, Purpose::Imu);
    let reading = Imu::new(config, &mut noise).measure(&before, &now, ego::STEP_S, &mut noise);
    // The rear axle draws a circle of wheelbase over tangent; the middle of the car is half a
    // wheelbase ahead of it.
    let axle_m = now.config.wheelbase_m / steer_rad.tan();
    let radius_m = axle_m.hypot(now.config.wheelbase_m / 2.0);
    let speed_mps = now.velocity_ego_mps().length();
    let pull_mps2 = speed_mps * speed_mps / radius_m;
    let [ahead, left, up] = reading.acceleration_mps2.to_array();
    assert!(left > 2.0 && (left - pull_mps2 * axle_m / radius_m).abs() < 0.1, "{left} {pull_mps2}");
    // The middle of the circle lies beside the rear axle, and a coasting car slows down.
    assert!(ahead < 0.0 && ahead > -1.0 - pull_mps2 * now.config.wheelbase_m / 2.0 / radius_m);
    assert!((up - 9.81).abs() < 1e-12);
    assert!((reading.turn_radps.z - now.speed_mps / axle_m).abs() < 0.02);
    assert!(reading.turn_radps.z > 0.3, "left is positive");
    let (axis, angle) = reading.orientation.to_axis_angle();
    assert!(axis.z > 0.0 && (angle - now.yaw_rad).abs() < 1e-9);
}

/// Mean and standard deviation.
fn spread(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let values: Vec<f64> = values.collect();
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    (mean, (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / count).sqrt())
}

#[test]
fn sensors_of_motion_are_as_wrong_as_they_say() {
    let ego = Car {
        position_m: DVec2::new(40.0, -7.0),
        yaw_rad: 0.7,
        speed_mps: 8.0,
        steer_rad: -0.1,
        ..Car::default()
    };
    let mut noise = Noise::new(2, 0, Purpose::Odometry);
    let config = OdometryConfig::default();
    let readings: Vec<_> =
        (0..4000).map(|_| odometry::measure(&config, &ego, 3.5, &mut noise)).collect();
    let check = |values: &mut dyn Iterator<Item = f64>, mean: f64, std: f64| {
        let (got_mean, got_std) = spread(values);
        assert!((got_mean - mean).abs() < 5.0 * std / 4000_f64.sqrt(), "{got_mean}, not {mean}");
        assert!((got_std / std - 1.0).abs() < 0.06, "{got_std}, not {std}");
    };
    check(&mut readings.iter().map(|r| r.position_m.x), 40.0, config.position_std_m);
    check(&mut readings.iter().map(|r| r.position_m.y), -7.0, config.position_std_m);
    check(&mut readings.iter().map(|r| r.velocity_mps.x), 8.0, config.velocity_std_mps);
    let aside_mps = ego.velocity_ego_mps().y;
    check(&mut readings.iter().map(|r| r.velocity_mps.y), aside_mps, config.velocity_std_mps);
    let turn_radps = ego.yaw_rate_radps();
    check(&mut readings.iter().map(|r| r.yaw_rate_radps), turn_radps, config.yaw_rate_std_radps);
    let yaw = |r: &odometry::OdometryReading| 2.0 * r.orientation.z.atan2(r.orientation.w);
    check(&mut readings.iter().map(yaw), 0.7, config.yaw_std_rad);
    assert!(readings.iter().all(|r| r.position_m.z == 3.5));

    let config = ImuConfig { acceleration_offset_std_mps2: 0.0, ..ImuConfig::default() };
    let imu = Imu::new(config, &mut noise);
    let up: Vec<f64> = (0..4000)
        .map(|_| imu.measure(&ego, &ego, ego::STEP_S, &mut noise).acceleration_mps2.z)
        .collect();
    check(&mut up.into_iter(), 9.81, config.acceleration_std_mps2);
}

/// East, north and up of a place on earth seen from another, by the textbook.
fn enu_m(origin: [f64; 3], place: [f64; 3]) -> DVec3 {
    let earth_centred = |[latitude_deg, longitude_deg, height_m]: [f64; 3]| {
        let (a, b) = (6_378_137.0_f64, 6_356_752.314_245_f64);
        let (phi, lambda) = (latitude_deg.to_radians(), longitude_deg.to_radians());
        let n = a * a / ((a * phi.cos()).powi(2) + (b * phi.sin()).powi(2)).sqrt();
        DVec3::new(
            (n + height_m) * phi.cos() * lambda.cos(),
            (n + height_m) * phi.cos() * lambda.sin(),
            (n * b * b / (a * a) + height_m) * phi.sin(),
        )
    };
    let d = earth_centred(place) - earth_centred(origin);
    let (phi, lambda) = (origin[0].to_radians(), origin[1].to_radians());
    let towards_axis = d.x * lambda.cos() + d.y * lambda.sin();
    DVec3::new(
        d.y * lambda.cos() - d.x * lambda.sin(),
        d.z * phi.cos() - towards_axis * phi.sin(),
        d.z * phi.sin() + towards_axis * phi.cos(),
    )
}

#[test]
fn fixes_lead_back_to_the_map() {
    let exact = GnssConfig {
        level_std_m: 0.0,
        up_std_m: 0.0,
        level_offset_std_m: 0.0,
        up_offset_std_m: 0.0,
        ..GnssConfig::default()
    };
    let mut noise = Noise::new(4, 0, Purpose::Gnss);
    for (latitude_deg, longitude_deg) in [(49.0, 8.0), (-33.9, 151.2), (0.0, 0.0), (64.1, -21.9)] {
        let config = GnssConfig { latitude_deg, longitude_deg, altitude_m: 80.0, ..exact };
        let mut gnss = Gnss::new(config, &mut noise);
        let ego = Car::at_rest(ego::SEDAN, DVec2::new(1234.5, -876.0), TAU / 4.0);
        let fix = gnss.measure(&ego, 12.0, 0.1, &mut noise);
        let place = [fix.latitude_deg, fix.longitude_deg, fix.altitude_m];
        let back_m = enu_m([latitude_deg, longitude_deg, 80.0], place);
        // The antenna is half a metre behind the middle, and the car looks north.
        let antenna_m = DVec3::new(1234.5, -876.5, 12.0 + 1.4);
        assert!(back_m.distance(antenna_m) < 1e-4, "{back_m}");
    }
}

#[test]
fn fixes_wander_slowly_as_far_as_they_say() {
    let config = GnssConfig { forgets_s: 20.0, ..GnssConfig::default() };
    let mut noise = Noise::new(4, 0, Purpose::Gnss);
    let mut gnss = Gnss::new(config, &mut noise);
    let ego = Car::default();
    let errors: Vec<DVec3> = (0..60_000)
        .map(|_| {
            let fix = gnss.measure(&ego, 0.0, 0.1, &mut noise);
            assert!((fix.std_m.x - 0.05_f64.hypot(0.5)).abs() < 1e-12);
            let place = [fix.latitude_deg, fix.longitude_deg, fix.altitude_m];
            enu_m([49.0, 8.0, 0.0], place) - DVec3::new(-0.5, 0.0, 1.4)
        })
        .collect();
    // 6,000 s hold 150 independent offsets: the spread is known to a tenth or so.
    let (_, east_m) = spread(errors.iter().map(|e| e.x));
    let (_, up_m) = spread(errors.iter().map(|e| e.z));
    assert!((east_m / 0.5 - 1.0).abs() < 0.3, "{east_m}");
    assert!((up_m / 1.0 - 1.0).abs() < 0.3, "{up_m}");
    // From one fix to the next mostly the noise changes: twice its variance, and the offset's step.
    let (_, step_m) = spread(errors.windows(2).map(|pair| pair[1].x - pair[0].x));
    let wanted_m = (2.0 * 0.05_f64.powi(2) + 2.0 * 0.5_f64.powi(2) * 0.1 / 20.0).sqrt();
    assert!((step_m / wanted_m - 1.0).abs() < 0.05, "{step_m}, not {wanted_m}");
}
