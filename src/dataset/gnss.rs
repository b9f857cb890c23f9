//! Poses from positions of satellites and headings, carried from one position to the next by the
//! speed where there is one.

use glam::{DQuat, DVec3};

use crate::{
    dataset::{base_frame::BaseFrame, heading::Headings, world::WorldAxes},
    geodesy::TangentPlane,
    log::{
        recording::{Series, Stamped, Topic},
        signals::{Fix, Pose},
        transforms::TransformTree,
    },
};

/// Longest time over which a speed and a heading carry the pose from one fix to the next: 1 % of
/// speed is 1 m in 5 s at 20 m/s, as much as a receiver is wrong.
const CARRIED_NS: i64 = 5_000_000_000;

/// Positions of the antenna, in the plane that touches the earth at the first fix. Fixes that the
/// receiver itself does not believe are left out, and counted.
pub fn positions(
    fixes: &[Stamped<Fix>],
    topic: &str,
    notes: &mut Vec<String>,
) -> Vec<Stamped<DVec3>> {
    let valid: Vec<_> = fixes.iter().filter(|fix| fix.value.is_valid).collect();
    if valid.len() < fixes.len() {
        let (out, all) = (fixes.len() - valid.len(), fixes.len());
        notes.push(format!("pose: {out} of {all} messages of {topic} are no fix and not used"));
    }
    let Some(first) = valid.first().map(|fix| fix.value) else { return Vec::new() };
    let plane = TangentPlane::new(first.latitude_deg, first.longitude_deg, first.altitude_m);
    let place = |fix: &&Stamped<Fix>| {
        let Fix { latitude_deg, longitude_deg, altitude_m, .. } = fix.value;
        let value = plane.enu(latitude_deg, longitude_deg, altitude_m);
        Stamped { stamp_ns: fix.stamp_ns, value }
    };
    valid.iter().map(place).collect()
}

/// Headings of the car from a topic that has attitudes or rates of turn; `None` if it has neither,
/// or the car never moves far enough for a course.
pub fn headings(
    topic: &Topic,
    positions: &[Stamped<DVec3>],
    antenna_ahead_m: f64,
    (base, axes): (&BaseFrame, &WorldAxes),
    transforms: &TransformTree,
    notes: &mut Vec<String>,
) -> Option<Headings> {
    if let Series::Imu(samples) = &topic.series
        && samples.iter().all(|sample| sample.value.attitude.is_some())
    {
        let sensor_from_base = base.base_from_sensor(&topic.frame_id, transforms).inverse();
        let attitudes = samples.iter().filter_map(|sample| {
            let world_from_sensor =
                Pose { position_m: DVec3::ZERO, rotation: sample.value.attitude? };
            let attitude = axes.pose(&world_from_sensor.then(&sensor_from_base)).rotation;
            Some(Stamped { stamp_ns: sample.stamp_ns, value: attitude })
        });
        return Some(Headings::measured(attitudes, positions, antenna_ahead_m, notes));
    }
    let rates = yaw_rates(topic, base, axes, transforms);
    Headings::from_courses(positions, &rates, antenna_ahead_m)
}

/// Rates of turning to the left, rad/s.
pub fn yaw_rates(
    topic: &Topic,
    base: &BaseFrame,
    axes: &WorldAxes,
    transforms: &TransformTree,
) -> Vec<Stamped<f64>> {
    let base_from_sensor = base.base_from_sensor(&topic.frame_id, transforms).rotation;
    let left = |stamp_ns: i64, turn_radps: DVec3| {
        let value = axes.body_turn(base_from_sensor * turn_radps).z;
        Stamped { stamp_ns, value }
    };
    match &topic.series {
        Series::Imu(samples) => {
            samples.iter().map(|s| left(s.stamp_ns, s.value.angular_velocity_radps)).collect()
        }
        Series::Twist(samples) => samples.iter().map(|s| left(s.stamp_ns, s.value.1)).collect(),
        _ => Vec::new(),
    }
}

/// Poses of the car: at the fixes, and at the samples of its speed between fixes that are near
/// enough to one another.
///
/// `base_from_antenna_m` is where the antenna sits on the car; `speeds` are forward and left, m/s.
pub fn poses(
    positions: &[Stamped<DVec3>],
    headings: &Headings,
    base_from_antenna_m: DVec3,
    speeds: &[Stamped<[f64; 2]>],
) -> Vec<Stamped<Pose>> {
    let at_fix = |fix: &Stamped<DVec3>| {
        let rotation = DQuat::from_rotation_z(headings.at(fix.stamp_ns)?);
        let position_m = fix.value - rotation * base_from_antenna_m;
        Some(Stamped { stamp_ns: fix.stamp_ns, value: Pose { position_m, rotation } })
    };
    let fixes: Vec<_> = positions.iter().filter_map(at_fix).collect();
    let mut poses = Vec::with_capacity(fixes.len() + speeds.len());
    for pair in fixes.windows(2) {
        poses.push(pair[0].clone());
        if pair[1].stamp_ns - pair[0].stamp_ns <= CARRIED_NS {
            poses.extend(carried(&pair[0], &pair[1], headings, speeds));
        }
    }
    poses.extend(fixes.last().cloned());
    poses
}

/// Poses at the samples of speed between two fixes: driven from the first, and what that misses
/// the second by spread over the time between them.
fn carried(
    from: &Stamped<Pose>,
    to: &Stamped<Pose>,
    headings: &Headings,
    speeds: &[Stamped<[f64; 2]>],
) -> Vec<Stamped<Pose>> {
    let begin = speeds.partition_point(|speed| speed.stamp_ns <= from.stamp_ns);
    let end = speeds.partition_point(|speed| speed.stamp_ns < to.stamp_ns);
    let (Some(before), Some(after)) =
        (begin.checked_sub(1).and_then(|at| speeds.get(at)), speeds.get(end))
    else {
        return Vec::new();
    };
    let mut driven = Vec::with_capacity(end - begin);
    let mut last = (from.stamp_ns, from.value.position_m);
    let mut last_speed = before.value;
    let inside = speeds[begin..end].iter().map(|speed| (speed.stamp_ns, speed.value));
    for (stamp_ns, speed) in inside.chain([(to.stamp_ns, after.value)]) {
        let middle_ns = last.0 + (stamp_ns - last.0) / 2;
        let (Some(heading), Some(middle)) = (headings.at(stamp_ns), headings.at(middle_ns)) else {
            return Vec::new();
        };
        let seconds = (stamp_ns - last.0) as f64 * 1e-9;
        let [forward, left] = [0, 1].map(|axis| (last_speed[axis] + speed[axis]) / 2.0);
        let step = DVec3::new(forward * seconds, left * seconds, 0.0);
        let position_m = last.1 + DQuat::from_rotation_z(middle) * step;
        let rotation = DQuat::from_rotation_z(heading);
        driven.push(Stamped { stamp_ns, value: Pose { position_m, rotation } });
        last = (stamp_ns, position_m);
        last_speed = speed;
    }
    // The last is the second fix, reached by driving.
    driven.pop();
    let missed_m = to.value.position_m - last.1;
    let whole_ns = (to.stamp_ns - from.stamp_ns) as f64;
    for pose in &mut driven {
        pose.value.position_m += missed_m * ((pose.stamp_ns - from.stamp_ns) as f64 / whole_ns);
    }
    driven
}
