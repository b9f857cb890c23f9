//! A recorded drive, ingested, against what the simulator knew: the same episode driven again.
#![allow(clippy::unwrap_used)]

use std::{collections::BTreeMap, fmt::Write as _, fs, path::Path, sync::OnceLock};

use foxglove::messages::PointCloud;
use glam::{DAffine3, DVec3};
use mcap::MessageStream;
use pmp::{
    dataset::ego::{EgoState, wrap_angle},
    frame::{self, Command, Frame, RouteSource},
    sensors::radar::direction,
    sim::{
        clocks::{STEPS_PER_S, Source},
        drive::Demonstration,
        reading::Reading,
        senses::Senses,
    },
    world::{ego::Car, expert::Decision, snapshot::Snapshot},
};
use prost::Message as _;

use crate::{
    ingest::{frames, into},
    recording::{SECONDS, Shared, exact_rig, shared},
};

const STEP_NS: i64 = 1_000_000_000 / STEPS_PER_S as i64;

/// What the simulator knew at one step.
pub(crate) struct Known {
    pub(crate) car: Car,
    ground_m: f64,
    pub(crate) decision: Decision,
    in_junction: bool,
    limit_mps: f64,
    command: Command,
    route: frame::Route,
    pub(crate) snapshot: Snapshot,
}

/// Where a car is, by the words of frames.
pub(crate) fn state_of(car: &Car, ground_m: f64) -> EgoState {
    EgoState {
        position_m: car.position_m.extend(ground_m),
        yaw_rad: car.yaw_rad,
        velocity_mps: car.velocity_ego_mps().to_array(),
    }
}

fn drive() -> Demonstration {
    let shared = shared();
    Demonstration::new(&shared.stage.town, &shared.episode, Shared::BURST_CHANCE).unwrap()
}

/// Every step of the shared episode.
pub(crate) fn known() -> &'static [Known] {
    static KNOWN: OnceLock<Vec<Known>> = OnceLock::new();
    KNOWN.get_or_init(|| {
        let mut demonstration = drive();
        let steps = (SECONDS * STEPS_PER_S as f64) as usize;
        let mut known = Vec::new();
        for _ in 0..=steps {
            let drive = &demonstration.drive;
            let world = &drive.world;
            let waypoint = world.route.at(world.progress_m());
            known.push(Known {
                car: *world.ego(),
                ground_m: world.ground_m(),
                decision: *drive.decision(),
                in_junction: waypoint.in_junction,
                limit_mps: waypoint.limit_mps,
                command: waypoint.command,
                route: {
                    let now = state_of(world.ego(), world.ground_m());
                    world.route.local(world.progress_m(), &now).unwrap()
                },
                snapshot: world.snapshot(),
            });
            demonstration.step();
        }
        known
    })
}

/// The frames of the shared log.
pub(crate) fn ingested() -> &'static [Frame] {
    static FRAMES: OnceLock<Vec<Frame>> = OnceLock::new();
    FRAMES.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        let dataset = folder.path().join("data");
        let said = into(&dataset, &[shared().foxglove()]);
        assert_eq!(said.code, 0, "{}", said.err);
        frames(&dataset).into_iter().map(|(_, frame)| frame).collect()
    })
}

pub(crate) fn step_of(stamp_ns: i64) -> usize {
    let since_ns = stamp_ns - shared().episode.start_ns();
    assert_eq!(since_ns % STEP_NS, 0, "stamps are those of steps");
    (since_ns / STEP_NS) as usize
}

#[track_caller]
fn near(what: &str, frame: &Frame, got: f64, known: f64, tolerance: f64) {
    let tick = frame.index;
    assert!((got - known).abs() <= tolerance, "{what} of tick {tick}: {got}, and it was {known}");
}

/// Odometry comes every 20 ms and ticks lie between; straight lines between its samples are this far
/// from the car's way, which its brakes bend most.
const BETWEEN_M: f64 = 0.002;
const BETWEEN_MPS: f64 = 0.02;
const BETWEEN_RAD: f64 = 0.0005;

#[test]
fn state_route_and_labels_of_every_frame_are_what_the_simulator_knew() {
    let (frames, known) = (ingested(), known());
    assert!(frames.len() >= 65, "{} frames", frames.len());
    let mut full_futures = 0;
    for frame in frames {
        let step = step_of(frame.stamp_ns);
        let now = &known[step];
        let velocity = now.car.velocity_ego_mps();
        near("vx", frame, frame.velocity_mps[0].into(), velocity.x, BETWEEN_MPS);
        near("vy", frame, frame.velocity_mps[1].into(), velocity.y, BETWEEN_MPS);
        near("yaw", frame, wrap_angle(frame.yaw_rad - now.car.yaw_rad), 0.0, BETWEEN_RAD);
        let [x, y, z] = frame.position_m;
        near("x", frame, x, now.car.position_m.x, BETWEEN_M);
        near("y", frame, y, now.car.position_m.y, BETWEEN_M);
        near("z", frame, z, now.ground_m, 0.02);

        let then = step_of(frame.stamp_ns + i64::from(frame.skew.control_ns.unwrap()));
        let decision = &known[then].decision;
        let action = &frame.action;
        let wanted = [decision.wanted.steer, decision.wanted.throttle, decision.wanted.brake];
        let got = [action.steer, action.throttle, action.brake];
        // A channel that is never used counts as not recorded.
        for (got, wanted) in got.into_iter().zip(wanted) {
            assert!(got.is_none() || got == Some(wanted), "{got:?} {wanted}");
        }
        let pull = (decision.wanted.steer - decision.applied.steer).abs();
        if !(0.0199..0.0201).contains(&pull) {
            assert_eq!(frame.perturbed, pull > 0.02, "tick {}", frame.index);
        }

        // The driver decides two steps after the picture, and is told of the place then.
        let told = &known[step.next_multiple_of(10)];
        assert_eq!(frame.in_junction, Some(told.in_junction));
        assert_eq!(frame.speed_limit_mps, Some(told.limit_mps as f32));
        assert_eq!(frame.command, told.command);

        assert_eq!((frame.route.source, frame.route.len), (RouteSource::Planned, now.route.len));
        for (got, known) in frame.route.waypoints_m.iter().zip(&now.route.waypoints_m) {
            // 52 m ahead, an angle is a length.
            near("route", frame, (*got).into(), (*known).into(), BETWEEN_M + 52.0 * BETWEEN_RAD);
        }
        let future = &frame.future;
        full_futures += usize::from(future.len == 30);
        for index in 0..usize::from(future.len) {
            let later = &known[step + 10 * (index + 1)].car;
            let (speed, yaw) = (later.velocity_ego_mps().length(), later.yaw_rad - now.car.yaw_rad);
            near("future speed", frame, future.speed_mps[index].into(), speed, BETWEEN_MPS);
            near("future yaw", frame, future.yaw_rad[index].into(), yaw, 2.0 * BETWEEN_RAD);
            let moved_m = later.position_m - now.car.position_m;
            let moved_m = glam::DVec2::from_angle(-now.car.yaw_rad).rotate(moved_m);
            let tolerance_m = 2.0 * BETWEEN_M + BETWEEN_RAD * moved_m.length();
            near("future x", frame, future.xy_m[2 * index].into(), moved_m.x, tolerance_m);
            near("future y", frame, future.xy_m[2 * index + 1].into(), moved_m.y, tolerance_m);
        }
    }
    assert!(full_futures >= 35, "{full_futures}");
    assert!(frames.iter().any(|frame| frame.perturbed), "no burst in this drive");
    assert!(frames.iter().any(|frame| !frame.perturbed));
    assert!(frames.iter().all(|frame| frame.lidar.is_some()));
    let turned_rad = wrap_angle(frames[frames.len() - 1].yaw_rad - frames[0].yaw_rad);
    assert!(turned_rad > 0.5, "the drive turns left: {turned_rad}");
}

/// Returns of each radar scan by step: place, radial speed.
fn scans(log: &Path) -> BTreeMap<usize, Vec<(DVec3, f64)>> {
    let bytes = fs::read(log).unwrap();
    let mut scans = BTreeMap::new();
    for message in MessageStream::new(&bytes).unwrap() {
        let message = message.unwrap();
        if message.channel.topic != "/radar/front" {
            continue;
        }
        let cloud = PointCloud::decode(&*message.data).unwrap();
        let stamp = cloud.timestamp.unwrap();
        let stamp_ns = i64::from(stamp.sec()) * 1_000_000_000 + i64::from(stamp.nsec());
        let returns = cloud.data.chunks_exact(cloud.point_stride as usize).map(|point| {
            let value = |i: usize| f32::from_le_bytes(point[4 * i..4 * i + 4].try_into().unwrap());
            let [x, y, z, speed] = [0, 1, 2, 3].map(|i| f64::from(value(i)));
            (DVec3::new(x, y, z), speed)
        });
        scans.insert(step_of(stamp_ns), returns.collect());
    }
    scans
}

#[test]
fn radar_speeds_in_log_and_frames_are_the_relative_radial_speeds_of_who_was_hit() {
    let (shared, known) = (shared(), known());
    let scans = scans(shared.foxglove());
    assert!(scans.len() >= 90);
    let rig = exact_rig();
    let mut again = drive();
    let mut senses =
        Senses::new(&rig, &shared.stage, &shared.shapes, &shared.episode, &again.drive);
    let mut moving = 0;
    for (step, returns) in &scans {
        while (again.drive.steps() as usize) < *step {
            again.step();
        }
        let Reading::Radar(expected) = senses.read(Source::Radar, &again.drive) else { panic!() };
        assert_eq!(returns.len(), expected.len(), "step {step}");
        let now = &known[*step];
        // Velocity of the radar by its place a step ago and now.
        let place = |known: &Known| {
            let ego = known.car.world_from_ego(0.0) * rig.radar.ego_from_radar;
            (ego, ego.translation)
        };
        let (world_from_radar, _): (DAffine3, _) = place(now);
        let radar_mps = rig.radar.velocity_world_mps(&now.car);
        if *step > 0 {
            let moved = (place(now).1 - place(&known[step - 1]).1) * STEPS_PER_S as f64;
            assert!((moved - radar_mps).length() < 0.1, "{moved} {radar_mps}");
        }
        for ((place_m, speed_mps), hit) in returns.iter().zip(&expected) {
            let ray = direction(hit.azimuth_rad, hit.elevation_rad);
            assert!((*place_m - ray * hit.range_m).length() < 1e-4);
            let velocity_mps = hit.actor.map_or(DVec3::ZERO, |actor| {
                let vehicles = now.snapshot.vehicles.iter().map(|v| (v.id, v.velocity_mps));
                let walkers = now.snapshot.walkers.iter().map(|w| (w.id, w.velocity_mps));
                let mut all = vehicles.chain(walkers);
                all.find(|(id, _)| *id == actor).unwrap().1.extend(0.0)
            });
            moving += usize::from(velocity_mps.length() > 1.0);
            let ray = world_from_radar.transform_vector3(ray);
            let wanted = (velocity_mps - radar_mps).dot(ray);
            assert!((speed_mps - wanted).abs() < 1e-4, "step {step}: {speed_mps} {wanted}");
        }
    }
    assert!(moving > 20, "{moving} returns of somebody who moves");

    for frame in ingested() {
        let stamp_ns = frame.stamp_ns + i64::from(frame.skew.radar_ns.unwrap());
        let returns = &scans[&step_of(stamp_ns)];
        for speed in frame.radar.as_ref().unwrap().speed_mps.iter().flatten() {
            let is_one = |(_, logged): &(DVec3, f64)| half::f16::from_f64(*logged) == *speed;
            assert!(returns.iter().any(is_one), "tick {}: {speed}", frame.index);
        }
    }
}

/// What frames say of the drive, one line each half second: nothing that sensors measure.
fn as_text(frames: &[Frame]) -> String {
    let mut text = String::new();
    for frame in frames.iter().step_by(5) {
        let [x, y, z] = frame.position_m;
        let point = |xy: &[f32], index: usize| (xy[2 * index], xy[2 * index + 1]);
        let (near, far) =
            (point(&frame.route.waypoints_m, 25), point(&frame.route.waypoints_m, 129));
        let then = point(&frame.future.xy_m, 29);
        let or_none = |value: Option<f32>| value.map_or("-".into(), |value| format!("{value:.3}"));
        let last = usize::from(frame.future.len).max(1) - 1;
        writeln!(
            text,
            "{:3} v {:.2}  yaw {:.3}  at {x:.2} {y:.2} {z:.2}  steer {} throttle {} brake {}{}  {}{} \
             limit {:.1}  route {} {:.1} {:.1} {:.1} {:.1}  future {} {:.2} {:.3} {:.1} {:.1}",
            frame.index,
            frame.velocity_mps[0],
            frame.yaw_rad,
            or_none(frame.action.steer),
            or_none(frame.action.throttle),
            or_none(frame.action.brake),
            if frame.perturbed { " perturbed" } else { "" },
            frame.command.name(),
            if frame.in_junction == Some(true) { " in a junction" } else { "" },
            frame.speed_limit_mps.unwrap(),
            frame.route.len,
            near.0,
            near.1,
            far.0,
            far.1,
            frame.future.len,
            frame.future.speed_mps[last],
            frame.future.yaw_rad[last],
            then.0,
            then.1,
        )
        .unwrap();
    }
    text
}

/// `scripts/golden.sh` rewrites the text; review its difference as you would review code.
#[test]
#[allow(clippy::disallowed_methods, reason = "the script has no other way to speak to a test")]
fn a_town_drive_gives_the_frames_it_gave_before() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/it/golden/town-drive.frames.txt");
    let text = as_text(ingested());
    if std::env::var("PMP_UPDATE_GOLDEN").is_ok() {
        fs::write(&path, &text).unwrap();
    }
    let before = fs::read_to_string(&path).unwrap_or_default();
    for (got, before) in text.lines().zip(before.lines()) {
        assert_eq!(got, before, "scripts/golden.sh rewrites the text, if this is meant");
    }
    assert_eq!(text, before);
}
