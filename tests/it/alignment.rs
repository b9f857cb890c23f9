//! From samples to the numbers of a frame: the grid, the ego motion, the future, the route, the
//! command, the controls and the projection, each against a closed form or a slow second way.
#![allow(clippy::unwrap_used)]

use std::{
    f64::consts::{FRAC_PI_2, PI},
    sync::Arc,
};

use glam::DVec3;
use pmp::{
    dataset::{
        align::{Grid, Signals, align},
        control::Controls,
        ego::{EgoState, EgoTrack, wrap_angle},
        future::future,
        ralidar::{lidar_pixels, radar_pixels},
        route::{Path, command},
    },
    drops::Reason,
    frame::{Command, FUTURE_STEPS, ROUTE_POINTS, Route, RouteSource},
    log::{
        cdr,
        decoder::Decoder,
        profile::{Profile, Required, Tolerance},
        reader::{Channel, Place},
        recording::{Series, Stamped, Topic, nearest},
        schema::{self, Schema},
        signals::{Control, Kind, Pose},
    },
    projection::{Camera, Crop, Distortion},
};
use proptest::prelude::*;

use crate::{
    definitions::definition,
    fixtures::{Cdr, ns},
};

const TOLERANCE_NS: i64 = 100_000_000;

/// A track of a state given by time, sampled at 100 Hz.
fn track(seconds: f64, state: impl Fn(f64) -> EgoState) -> EgoTrack {
    let count = (seconds * 100.0).round() as usize;
    let sample = |i: usize| {
        let t = i as f64 / 100.0;
        Stamped { stamp_ns: ns(t), value: state(t) }
    };
    EgoTrack::from_samples((0..=count).map(sample).collect(), TOLERANCE_NS)
}

fn at(x: f64, y: f64, yaw_rad: f64, speed_mps: f64) -> EgoState {
    EgoState {
        position_m: DVec3::new(x, y, 0.0),
        yaw_rad: wrap_angle(yaw_rad),
        velocity_mps: [speed_mps, 0.0],
    }
}

/// A circle of that radius to the left (to the right, if negative), from a heading.
fn circle(radius_m: f64, speed_mps: f64, heading_rad: f64) -> impl Fn(f64) -> EgoState {
    move |t| {
        let yaw = heading_rad + speed_mps / radius_m * t;
        let centre = [-heading_rad.sin() * radius_m, heading_rad.cos() * radius_m];
        let (x, y) = (centre[0] + radius_m * yaw.sin(), centre[1] - radius_m * yaw.cos());
        at(x, y, yaw, speed_mps)
    }
}

/// The route of a driver on a track.
fn driven_route(track: &EgoTrack, seconds: f64) -> Route {
    let now = track.at(ns(seconds)).unwrap();
    Path::driven(track).ahead_of_driver(ns(seconds), &now)
}

#[track_caller]
fn near(got: f64, expected: f64, tolerance: f64) {
    assert!((got - expected).abs() <= tolerance, "{got}, expected {expected} +- {tolerance}");
}

fn place(number: u32) -> Place {
    Place { segment: number, start: 0, len: 0 }
}

/// Samples at these seconds, each located by its number.
fn located(seconds: &[f64]) -> Vec<Stamped<Place>> {
    let sample = |(i, t): (usize, &f64)| Stamped { stamp_ns: ns(*t), value: place(i as u32) };
    seconds.iter().enumerate().map(sample).collect()
}

/// Every tenth of a second from one to another, in tenths.
fn tenths(from: i64, to: i64) -> Vec<f64> {
    (from..=to).map(|tenth| tenth as f64 / 10.0).collect()
}

fn grid(ego: &EgoTrack, camera: &[f64], lidar: &[f64], required: &Required) -> Option<Grid> {
    let (camera, lidar) = (located(camera), located(lidar));
    let signals = Signals { ego, camera: &camera, lidar: &lidar, radar: &[], control: &[] };
    align(&signals, &Tolerance::default(), required, 100_000_000)
}

fn straight(from_s: f64, to_s: f64) -> EgoTrack {
    let samples = track(to_s, |t| at(5.0 * t, 0.0, 0.0, 5.0)).samples().to_vec();
    let from = samples.into_iter().filter(|sample| sample.stamp_ns >= ns(from_s));
    EgoTrack::from_samples(from.collect(), TOLERANCE_NS)
}

#[test]
fn the_grid_begins_where_the_last_required_signal_begins_and_ends_where_the_first_ends() {
    let (ego, camera) = (straight(0.25, 2.0), tenths(0, 18));
    let laid = grid(&ego, &camera, &[], &Required::default()).unwrap();
    assert_eq!(laid.start_ns, ns(0.25));
    let stamps: Vec<i64> = laid.ticks.iter().map(|tick| tick.stamp_ns).collect();
    assert_eq!(stamps, (0..16).map(|i| ns(0.25 + 0.1 * f64::from(i))).collect::<Vec<_>>());
    assert_eq!(laid.drops.total(), 0);

    let lidar = tenths(6, 30);
    let required = Required { lidar: true, ..Required::default() };
    assert_eq!(grid(&ego, &camera, &lidar, &required).unwrap().start_ns, ns(0.6));
    let optional = grid(&ego, &camera, &lidar, &Required::default()).unwrap();
    assert_eq!((optional.start_ns, optional.ticks[0].lidar.clone()), (ns(0.25), None));
}

#[test]
fn there_is_no_grid_where_required_signals_do_not_overlap() {
    assert!(grid(&straight(3.0, 4.0), &tenths(0, 20), &[], &Required::default()).is_none());
    assert!(grid(&straight(0.0, 4.0), &[], &[], &Required::default()).is_none());
    let required = Required { lidar: true, ..Required::default() };
    assert!(grid(&straight(0.0, 4.0), &tenths(0, 20), &[], &required).is_none());
}

#[test]
fn a_sample_belongs_to_a_tick_up_to_the_tolerance_and_not_a_nanosecond_further() {
    let ego = straight(0.0, 1.0);
    for (late_ns, kept) in [(60_000_000, true), (60_000_001, false)] {
        let mut camera = located(&[0.0, 0.1, 0.2, 0.3]);
        camera[1].stamp_ns += late_ns;
        camera.remove(2);
        let signals = Signals { ego: &ego, camera: &camera, lidar: &[], radar: &[], control: &[] };
        let tolerance = Tolerance::default();
        let laid = align(&signals, &tolerance, &Required::default(), 100_000_000).unwrap();
        assert_eq!(laid.ticks.iter().any(|tick| tick.index == 1), kept, "{late_ns} ns");
    }
}

#[test]
fn ticks_in_gaps_are_left_out_and_counted_by_reason() {
    // No pictures at 0.5 ... 0.9, no ego motion between 1.45 and 1.85 s, no lidar from 2.6 on.
    let samples = straight(0.0, 3.0).samples().to_vec();
    let kept = samples.into_iter().filter(|s| !(ns(1.451)..ns(1.85)).contains(&s.stamp_ns));
    let ego = EgoTrack::from_samples(kept.collect(), TOLERANCE_NS);
    let camera: Vec<f64> =
        tenths(0, 30).into_iter().filter(|t| !(0.45..0.95).contains(t)).collect();
    let mut lidar = tenths(0, 25);
    lidar.push(3.0);
    let required = Required { lidar: true, ..Required::default() };
    let laid = grid(&ego, &camera, &lidar, &required).unwrap();
    assert_eq!(laid.drops.count(Reason::ImageGap), 5);
    assert_eq!(laid.drops.count(Reason::EgoGap), 4);
    assert_eq!(laid.drops.count(Reason::LidarGap), 4);
    let firsts: Vec<i64> = laid.drops.iter().map(|(_, drop)| drop.first_ns).collect();
    assert_eq!(firsts, [ns(0.5), ns(1.5), ns(2.6)]);
    let indices: Vec<u32> = laid.ticks.iter().map(|tick| tick.index).collect();
    let expected: Vec<u32> =
        (0..=30).filter(|i| ![5..=9, 15..=18, 26..=29].iter().any(|r| r.contains(i))).collect();
    assert_eq!(indices, expected);
}

#[test]
fn one_wild_stamp_does_not_make_a_grid_of_years() {
    let mut samples = straight(0.0, 1.0).samples().to_vec();
    let mut camera = located(&tenths(0, 10));
    let year_ns = 365 * 86_400 * 1_000_000_000;
    samples.push(Stamped { stamp_ns: 50 * year_ns, value: samples[0].value });
    camera.push(Stamped { stamp_ns: 50 * year_ns, value: place(11) });
    let ego = EgoTrack::from_samples(samples, TOLERANCE_NS);
    let signals = Signals { ego: &ego, camera: &camera, lidar: &[], radar: &[], control: &[] };
    let laid = align(&signals, &Tolerance::default(), &Required::default(), 100_000_000).unwrap();
    assert_eq!(laid.ticks.iter().filter(|tick| tick.index <= 10).count(), 11);
    assert!(laid.drops.count(Reason::ImageGap) > 4_000_000_000);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 500, failure_persistence: None, ..Default::default() })]

    #[test]
    fn the_nearest_sample_is_the_one_that_a_search_of_all_finds(
        stamps in prop::collection::btree_set(-50_i64..50, 0..20),
        wanted in -60_i64..60,
    ) {
        let samples: Vec<Stamped<i64>> =
            stamps.iter().map(|stamp| Stamped { stamp_ns: *stamp, value: *stamp }).collect();
        let searched = stamps.iter().copied().min_by_key(|stamp| ((stamp - wanted).abs(), *stamp));
        prop_assert_eq!(nearest(&samples, wanted).map(|sample| sample.value), searched);
    }

    #[test]
    fn an_angle_is_wrapped_by_whole_turns(angle in -30.0_f64..30.0) {
        let wrapped = wrap_angle(angle);
        prop_assert!(wrapped > -PI && wrapped <= PI);
        let turns = (angle - wrapped) / (2.0 * PI);
        prop_assert!((turns - turns.round()).abs() < 1e-9);
    }
}

#[test]
fn yaw_is_interpolated_the_shorter_way_across_the_seam() {
    let samples = vec![
        Stamped { stamp_ns: 0, value: at(0.0, 0.0, PI - 0.03, 1.0) },
        Stamped { stamp_ns: ns(0.1), value: at(1.0, 2.0, -PI + 0.05, 3.0) },
    ];
    let track = EgoTrack::from_samples(samples, TOLERANCE_NS);
    near(track.at(ns(0.025)).unwrap().yaw_rad, PI - 0.01, 1e-12);
    let later = track.at(ns(0.075)).unwrap();
    near(later.yaw_rad, -PI + 0.03, 1e-12);
    near(later.position_m.x, 0.75, 1e-12);
    near(later.position_m.y, 1.5, 1e-12);
    near(later.velocity_mps[0], 2.5, 1e-12);
}

#[test]
fn the_ego_motion_is_not_interpolated_across_a_gap_nor_beyond_its_ends() {
    let sample = |t: f64| Stamped { stamp_ns: ns(t), value: at(t, 0.0, 0.0, 1.0) };
    let track = EgoTrack::from_samples([0.0, 0.2, 0.4001].map(sample).to_vec(), TOLERANCE_NS);
    assert!(track.at(ns(0.1)).is_some());
    assert!(track.at(ns(0.3)).is_none());
    assert!(track.at(ns(0.2)).is_some() && track.at(ns(0.4001)).is_some());
    assert!(track.at(-1).is_none() && track.at(ns(0.5)).is_none());
    assert!(track.is_continuous(0, ns(0.2)));
    assert!(!track.is_continuous(0, ns(0.3)));
    assert!(!track.is_continuous(ns(0.25), ns(0.3)));
}

#[test]
fn the_future_on_a_circle_is_the_circle() {
    for (radius, heading) in [(20.0, 0.3), (-35.0, 3.0), (12.0, -2.9)] {
        let (speed, now_s) = (8.0, 1.0);
        let track = track(6.0, circle(radius, speed, heading));
        let now = track.at(ns(now_s)).unwrap();
        let future = future(&track, ns(now_s), &now);
        assert_eq!(usize::from(future.len), FUTURE_STEPS);
        for step in 0..FUTURE_STEPS {
            let turned = speed / radius * 0.1 * (step + 1) as f64;
            near(f64::from(future.yaw_rad[step]), wrap_angle(turned), 1e-5);
            near(f64::from(future.xy_m[2 * step]), radius * turned.sin(), 1e-3);
            near(f64::from(future.xy_m[2 * step + 1]), radius * (1.0 - turned.cos()), 1e-3);
            near(f64::from(future.speed_mps[step]), speed, 1e-5);
        }
    }
}

#[test]
fn the_future_ends_where_the_track_ends_or_has_a_gap_and_is_zero_behind() {
    let whole = track(5.0, |t| at(5.0 * t, 0.0, 0.0, 5.0));
    let cut = |samples: Vec<Stamped<EgoState>>, now_s: f64| {
        let track = EgoTrack::from_samples(samples, TOLERANCE_NS);
        future(&track, ns(now_s), &track.at(ns(now_s)).unwrap())
    };
    let samples = whole.samples().to_vec();
    assert_eq!(cut(samples.clone(), 2.0).len, 30);
    assert_eq!(cut(samples.clone(), 2.01).len, 29);
    assert_eq!(cut(samples.clone(), 5.0).len, 0);
    // Nothing between 3.01 and 3.26 s: the step at 3.3 s exists again, and does not count.
    let with_gap = samples.into_iter().filter(|s| !(ns(3.015)..ns(3.255)).contains(&s.stamp_ns));
    let future = cut(with_gap.collect(), 2.0);
    assert_eq!(future.len, 10);
    near(f64::from(future.xy_m[18]), 5.0, 1e-4);
    assert!(future.speed_mps[10..].iter().chain(&future.yaw_rad[10..]).all(|v| *v == 0.0));
    assert!(future.xy_m[20..].iter().all(|value| *value == 0.0));
}

#[test]
fn the_route_of_a_driver_is_the_driven_path_at_equal_arc_lengths() {
    for (radius, heading) in [(20.0, 0.0), (-50.0, 2.5)] {
        let track = track(10.0, circle(radius, 8.0, heading));
        let route = driven_route(&track, 1.234);
        assert_eq!((usize::from(route.len), route.source), (ROUTE_POINTS, RouteSource::Driven));
        assert_eq!(route.waypoints_m[..2], [0.0, 0.0]);
        for i in 0..ROUTE_POINTS {
            let turned: f64 = 0.4 * i as f64 / radius;
            near(f64::from(route.waypoints_m[2 * i]), radius * turned.sin(), 0.01);
            near(f64::from(route.waypoints_m[2 * i + 1]), radius * (1.0 - turned.cos()), 0.01);
        }
    }
}

#[test]
fn the_route_at_the_end_of_a_drive_is_short_and_padded_with_its_last_point() {
    let track = track(10.0, |t| at(5.0 * t, 0.0, 0.0, 5.0));
    // 10.25 m are left.
    let route = driven_route(&track, 7.95);
    assert_eq!(route.len, 26);
    for i in 0..ROUTE_POINTS {
        near(f64::from(route.waypoints_m[2 * i]), 0.4 * i.min(25) as f64, 1e-4);
        assert_eq!(route.waypoints_m[2 * i + 1], 0.0);
    }
    assert_eq!(driven_route(&track, 10.0).len, 1);
}

#[test]
fn the_route_of_a_driver_does_not_cross_a_gap() {
    let whole = track(10.0, |t| at(5.0 * t, 0.0, 0.0, 5.0));
    let kept = whole.samples().iter().filter(|s| !(ns(4.005)..ns(5.0)).contains(&s.stamp_ns));
    let track = EgoTrack::from_samples(kept.cloned().collect(), TOLERANCE_NS);
    let route = driven_route(&track, 2.0);
    // 10 m to the gap, and the last point kept may lie 0.1 m before it.
    assert!([25, 26].contains(&route.len), "{} waypoints", route.len);
}

#[test]
fn a_standing_car_has_a_route_of_one_point_and_a_future_of_zeros() {
    // A receiver's jitter of 2 cm is no way.
    let track = track(6.0, |t| at(0.02 * (40.0 * t).sin(), 0.02 * (31.0 * t).cos(), 0.5, 0.0));
    let route = driven_route(&track, 1.0);
    assert_eq!(route.len, 1);
    assert!(route.waypoints_m.iter().all(|value| *value == 0.0));
    assert_eq!(command(&route), Command::Follow);
    let now = track.at(ns(1.0)).unwrap();
    let future = future(&track, ns(1.0), &now);
    assert_eq!(future.len, 30);
    assert!(future.speed_mps.iter().all(|speed| *speed == 0.0));
    assert!(future.xy_m.iter().all(|value| value.abs() < 0.05));
}

#[test]
fn a_car_that_will_start_has_the_way_ahead_as_its_route() {
    let track = track(20.0, |t| at((t - 5.0).max(0.0) * 6.0, 0.0, 0.0, 6.0 * f64::from(t > 5.0)));
    let route = driven_route(&track, 2.0);
    assert_eq!(usize::from(route.len), ROUTE_POINTS);
    near(f64::from(route.waypoints_m[2]), 0.4, 1e-4);
    near(f64::from(route.waypoints_m[258]), 51.6, 1e-3);
}

#[test]
fn a_reversing_car_has_negative_speeds_and_its_way_behind_it() {
    let track = track(8.0, |t| at(-2.0 * t, 0.0, 0.0, -2.0));
    let now = track.at(ns(1.0)).unwrap();
    near(now.speed_mps(), -2.0, 1e-12);
    let future = future(&track, ns(1.0), &now);
    near(f64::from(future.speed_mps[29]), -2.0, 1e-6);
    near(f64::from(future.xy_m[58]), -6.0, 1e-4);
    near(f64::from(driven_route(&track, 1.0).waypoints_m[2 * 10]), -4.0, 1e-3);
}

#[test]
fn a_planned_route_begins_at_its_closest_point() {
    let planned: Vec<DVec3> = (0..40).map(|i| DVec3::new(5.0 * f64::from(i), 0.0, 0.0)).collect();
    let now = at(12.3, 1.5, FRAC_PI_2, 5.0);
    let route = Path::planned(&planned).ahead_on_route(&now).unwrap();
    assert_eq!((usize::from(route.len), route.source), (ROUTE_POINTS, RouteSource::Planned));
    // The car looks along y: the route leads to its right.
    for i in 0..ROUTE_POINTS {
        near(f64::from(route.waypoints_m[2 * i]), -1.5, 1e-4);
        near(f64::from(route.waypoints_m[2 * i + 1]), -0.4 * i as f64, 1e-4);
    }
    let at_end = Path::planned(&planned).ahead_on_route(&at(300.0, 0.0, 0.0, 5.0)).unwrap();
    assert_eq!(at_end.len, 1);
    near(f64::from(at_end.waypoints_m[0]), -105.0, 1e-3);
}

/// A way of straight and bent pieces, (length, turn to the left in rad), a point each 0.1 m.
fn way(pieces: &[(f64, f64)]) -> Path {
    let (mut point, mut heading) = (DVec3::ZERO, 0.0_f64);
    let mut points = vec![point];
    for (length_m, turn_rad) in pieces {
        let steps = (length_m / 0.125).round();
        for _ in 0..steps as usize {
            heading += turn_rad / steps / 2.0;
            point += DVec3::new(heading.cos(), heading.sin(), 0.0) * length_m / steps;
            heading += turn_rad / steps / 2.0;
            points.push(point);
        }
    }
    Path::planned(&points)
}

#[test]
fn the_command_tells_corners_from_curves() {
    let corner = 8.0 * FRAC_PI_2;
    let at_start = at(0.0, 0.0, 0.0, 8.0);
    let told = |pieces: &[(f64, f64)]| command(&way(pieces).ahead_on_route(&at_start).unwrap());
    assert_eq!(told(&[(20.0, 0.0), (corner, FRAC_PI_2), (50.0, 0.0)]), Command::Left);
    assert_eq!(told(&[(20.0, 0.0), (corner, -FRAC_PI_2), (50.0, 0.0)]), Command::Right);
    assert_eq!(told(&[(corner, FRAC_PI_2), (50.0, 0.0)]), Command::Left);
    assert_eq!(told(&[(90.0, 0.0)]), Command::Follow);
    assert_eq!(told(&[(55.0, 0.0), (corner, FRAC_PI_2), (50.0, 0.0)]), Command::Follow);
    // Curves of 300 and 80 m radius, and a change of lanes.
    assert_eq!(told(&[(100.0, 100.0 / 300.0)]), Command::Follow);
    assert_eq!(told(&[(100.0, -100.0 / 80.0)]), Command::Follow);
    assert_eq!(told(&[(10.0, 0.0), (15.0, 0.2), (15.0, -0.2), (30.0, 0.0)]), Command::Follow);
    // The stronger of two bends says it.
    let both = [(5.0, 0.0), (10.0, 0.9), (10.0, 0.0), (corner, -FRAC_PI_2), (20.0, 0.0)];
    assert_eq!(told(&both), Command::Right);
}

/// Controls of a topic of that kind, one sample each.
fn controls(kind: Kind, samples: &[Control], profile: &Profile, track: &EgoTrack) -> Controls {
    let stamped = samples.iter().enumerate();
    let stamped = stamped.map(|(i, value)| Stamped { stamp_ns: i as i64, value: *value }).collect();
    let topic = Topic {
        name: "/control".into(),
        kind,
        channel: Arc::new(Channel {
            id: 1,
            topic: "/control".into(),
            message_encoding: "cdr".into(),
            schema: None,
        }),
        decoder: Arc::new(Decoder::Cdr(Schema { types: Vec::new() })),
        series: Series::Control(stamped),
        video: None,
        frame_id: String::new(),
        child_frame_id: None,
        cloud_fields: Vec::new(),
        uses_log_time: false,
        undecodable: (0, None),
        out_of_order: 0,
    };
    Controls::new(Some(&topic), None, profile, track)
}

fn pedals(steer: f64, throttle: f64, brake: f64) -> Control {
    Control {
        steer: Some(steer),
        throttle: Some(throttle),
        brake: Some(brake),
        wheel_angle_rad: None,
    }
}

#[test]
fn a_channel_frozen_at_zero_while_the_car_does_what_it_causes_is_not_recorded() {
    // Speeds up for 10 s by 1.5 m/s2, then slows down by 1.5 m/s2.
    let speed = |t: f64| if t < 10.0 { 1.5 * t } else { 30.0 - 1.5 * t };
    let stops = track(20.0, |t| at(0.0, 0.0, 0.0, speed(t)));
    let profile = Profile::default();
    let samples = [pedals(0.0, 0.0, 0.0), pedals(0.0, 0.4, 0.0)];
    let made = controls(Kind::CarlaControl, &samples, &profile, &stops);
    let action = made.action(Some(&samples[1]));
    assert_eq!((action.steer, action.throttle, action.brake), (Some(0.0), Some(0.4), None));
    assert!(made.notes.iter().any(|note| note.starts_with("brake: zero in all of /control")));

    let cruises = track(20.0, |t| at(10.0 * t, 0.0, 0.0, 10.0));
    let action =
        controls(Kind::CarlaControl, &samples, &profile, &cruises).action(Some(&samples[0]));
    assert_eq!((action.throttle, action.brake), (Some(0.0), Some(0.0)));

    let frozen = [pedals(0.0, 0.0, 0.0)];
    let turns = track(20.0, circle(30.0, 5.0, 0.0));
    let action = controls(Kind::CarlaControl, &frozen, &profile, &turns).action(Some(&frozen[0]));
    assert_eq!((action.steer, action.throttle, action.brake), (None, Some(0.0), Some(0.0)));

    // Coasting at half a metre per second squared needs no brake.
    let coasts = track(20.0, |t| at(0.0, 0.0, 0.0, 20.0 - 0.5 * t));
    let action = controls(Kind::CarlaControl, &frozen, &profile, &coasts).action(Some(&frozen[0]));
    assert_eq!(action.brake, Some(0.0));
}

#[test]
fn wheel_angles_become_steering_with_the_right_sign_and_stay_in_range() {
    let cruises = track(3.0, |t| at(10.0 * t, 0.0, 0.0, 10.0));
    let wheel = |angle: f64| Control {
        steer: None,
        throttle: None,
        brake: None,
        wheel_angle_rad: Some(angle),
    };
    let mut profile = Profile::default();
    profile.control.steering_lock_rad = Some(0.5);
    let samples = [wheel(0.25), wheel(-0.1), wheel(-0.9)];
    let made = controls(Kind::Ackermann, &samples, &profile, &cruises);
    let steer: Vec<_> = samples.iter().map(|sample| made.action(Some(sample)).steer).collect();
    assert_eq!(steer, [Some(-0.5), Some(0.2), Some(1.0)]);
    let action = made.action(Some(&samples[0]));
    assert_eq!((action.throttle, action.brake), (None, None));
    assert_eq!(made.action(None).steer, None);

    let made = controls(Kind::CarlaControl, &[pedals(2.0, f64::NAN, -1.0)], &profile, &cruises);
    let action = made.action(Some(&pedals(2.0, f64::NAN, -1.0)));
    assert_eq!((action.steer, action.throttle, action.brake), (Some(1.0), None, Some(0.0)));
}

/// Points of the optical frame and where OpenCV 5.0.0 puts them: `projectPoints` and
/// `fisheye.projectPoints` with fx = 500, fy = 520, cx = 320, cy = 240.
const POINTS: [[f64; 3]; 4] =
    [[1.0, -0.5, 4.0], [-3.0, 1.0, 6.0], [0.2, 0.1, 2.0], [2.5, 1.2, 5.0]];

#[rustfmt::skip]
fn projected_by_opencv() -> [(Distortion, [[f64; 2]; 4]); 3] {
    [
        (
            Distortion::PlumbBob([-0.3, 0.09, 0.001, -0.0005, -0.01]),
            [[442.05635, 176.561167], [88.873028, 320.244387], [369.810077, 265.909365], [548.904239, 354.467336]],
        ),
        (
            Distortion::RationalPolynomial([0.4, -0.1, 0.0008, 0.0003, 0.02, 0.7, -0.05, 0.03]),
            [[442.19018, 176.4997], [88.393589, 320.420222], [369.822612, 265.911983], [550.1377, 354.989669]],
        ),
        (
            Distortion::Equidistant([0.02, -0.01, 0.003, -0.0005]),
            [[442.063864, 176.526791], [88.956774, 320.094985], [369.805485, 265.898852], [549.288647, 354.460893]],
        ),
    ]
}

fn camera(distortion: Distortion) -> Camera {
    Camera { width: 640, height: 480, fx: 500.0, fy: 520.0, cx: 320.0, cy: 240.0, distortion }
}

#[test]
fn points_fall_where_opencv_puts_them() {
    for (distortion, pixels) in projected_by_opencv() {
        let camera = camera(distortion);
        for (point, [u, v]) in POINTS.into_iter().zip(pixels) {
            let [got_u, got_v] = camera.project(point).unwrap();
            near(got_u, u, 1e-5);
            near(got_v, v, 1e-5);
        }
    }
}

#[test]
fn points_fall_where_a_pinhole_puts_them() {
    let camera = camera(Distortion::None);
    assert_eq!(camera.project([1.0, -0.5, 4.0]), Some([445.0, 175.0]));
    assert_eq!(camera.project([-3.0, 1.5, 5.0]), Some([20.0, 396.0]));
    assert_eq!(camera.pixel([1.0, -0.5, 4.0]), Some(175 * 640 + 445));
    assert_eq!(camera.project([0.0, 0.0, 0.5]), None, "too near");
    assert_eq!(camera.project([0.0, 0.0, -3.0]), None, "behind");
    assert_eq!(camera.project([4.0, 0.0, 4.0]), None, "off to the right");
    assert_eq!(camera.project([f64::NAN, 0.0, 4.0]), None);
    assert_eq!(camera.project([0.0, 0.0, f64::NAN]), None);
    let wide = Camera::from_fov(100, 50, FRAC_PI_2);
    near(wide.project([1.0, 0.5, 2.0]).unwrap()[0], 75.0, 1e-9);
    near(wide.project([1.0, 0.5, 2.0]).unwrap()[1], 37.5, 1e-9);
}

#[test]
fn points_beyond_the_view_do_not_fold_back_onto_the_picture() {
    // Beyond r = 1.05 the polynomial turns round; a point at r = 1.5 would come out at r = 0.49.
    let mut folding = camera(Distortion::PlumbBob([-0.3, 0.0, 0.0, 0.0, 0.0]));
    (folding.fx, folding.fy) = (150.0, 150.0);
    assert!(folding.project([2.0, 0.0, 2.0]).is_some());
    assert_eq!(folding.project([3.0, 0.0, 2.0]), None);
    folding.distortion = Distortion::RationalPolynomial([-0.3, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    assert_eq!(folding.project([3.0, 0.0, 2.0]), None);
    folding.distortion = Distortion::Equidistant([-0.5, 0.0, 0.0, 0.0]);
    assert_eq!(folding.project([3.0, 0.0, 2.0]), None);
}

#[test]
fn a_cropped_and_scaled_camera_sees_what_the_cropped_and_scaled_picture_shows() {
    let crop = Crop { x: 40, y: 100, width: 560, height: 300 };
    for (distortion, pixels) in projected_by_opencv() {
        let small = camera(distortion).cropped_and_scaled(crop, 600, 250).unwrap();
        for (point, [u, v]) in POINTS.into_iter().zip(pixels) {
            let [got_u, got_v] = small.project(point).unwrap();
            near(got_u, (u - 40.0) * 600.0 / 560.0, 1e-4);
            near(got_v, (v - 100.0) * 250.0 / 300.0, 1e-4);
        }
    }
    let outside = Crop { x: 100, y: 0, width: 560, height: 480 };
    let error = camera(Distortion::None).cropped_and_scaled(outside, 600, 250).unwrap_err();
    assert!(error.to_string().starts_with("camera.crop: 560 x 480 at (100, 0)"), "{error}");
}

/// `sensor_msgs/PointCloud2` of x, y, z points, after some padding at the front of each.
fn cloud(points: &[[f32; 3]]) -> Vec<u8> {
    let mut cdr = Cdr::new(false);
    cdr.header(0, "lidar").u32(1).u32(points.len() as u32).u32(3);
    for (i, name) in ["z", "x", "y"].into_iter().enumerate() {
        cdr.text(name).u32(4 + 4 * i as u32).u8(7).u32(1);
    }
    let numbers = points.iter().flat_map(|[x, y, z]| [f32::NAN, *z, *x, *y]);
    let data: Vec<u8> = numbers.flat_map(f32::to_le_bytes).collect();
    cdr.u8(0).u32(16).u32(data.len() as u32).bytes(&data).u8(1).finish()
}

#[test]
fn of_several_returns_on_a_pixel_the_nearest_wins() {
    let schema =
        schema::parse("sensor_msgs/msg/PointCloud2", &definition("sensor_msgs/PointCloud2"))
            .unwrap();
    let camera = Camera::from_fov(100, 50, FRAC_PI_2);
    // Focal length 50: the first three fall on (51, 25), the fourth on (20, 40).
    let points =
        [[0.25, 0.125, 10.0], [0.125, 0.0625, 5.0], [0.5, 0.25, 20.0], [-1.1875, 0.625, 2.0]];
    let hidden = [[f32::NAN, 0.0, 5.0], [0.0, 0.0, 0.25], [9.0, 0.0, 2.0]];
    let message = cloud(&[points.as_slice(), &hidden].concat());
    let value = cdr::decode(&schema, &message).unwrap();
    let pixels = lidar_pixels(&value, &Pose::IDENTITY, &camera).unwrap();
    assert_eq!(pixels.pixel, [25 * 100 + 51, 40 * 100 + 20]);
    let numbers = |list: &[half::f16]| list.iter().map(|n| n.to_f32()).collect::<Vec<_>>();
    assert_eq!(numbers(&pixels.x), [0.125, -1.1875]);
    assert_eq!(numbers(&pixels.y), [0.0625, 0.625]);
    assert_eq!(numbers(&pixels.z), [5.0, 2.0]);
}

#[test]
fn radar_returns_are_projected_by_range_azimuth_and_elevation() {
    let schema = schema::parse("radar_msgs/msg/RadarScan", &definition("radar_msgs/RadarScan"));
    let mut cdr = Cdr::new(true);
    cdr.header(0, "radar").u32(3);
    for [range, azimuth, elevation, doppler] in
        [[10.0, 0.2, 0.1, -3.5], [30.0, 0.2, 0.1, 8.0], [12.0, -0.3, 0.0001, 1.25_f32]]
    {
        cdr.f32(range).f32(azimuth).f32(elevation).f32(doppler).f32(0.0);
    }
    let (schema, message) = (schema.unwrap(), cdr.finish());
    let value = cdr::decode(&schema, &message).unwrap();
    // The radar looks along x, the camera along z.
    let optical =
        Pose { position_m: DVec3::ZERO, rotation: glam::DQuat::from_xyzw(0.5, -0.5, 0.5, 0.5) };
    let camera = Camera::from_fov(600, 250, FRAC_PI_2);
    let pixels = radar_pixels(Kind::RadarScan, &value, &optical, &camera).unwrap();
    // u = 300 - 300 tan(azimuth), v = 125 - 300 tan(elevation) / cos(azimuth).
    assert_eq!(pixels.pixel, [94 * 600 + 239, 124 * 600 + 392]);
    let speeds: Vec<f32> = pixels.speed_mps.iter().map(|speed| speed.to_f32()).collect();
    assert_eq!(speeds, [-3.5, 1.25]);
}
