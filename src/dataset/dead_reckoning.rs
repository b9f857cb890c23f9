//! A pose from speed and yaw rate, for logs that have none.
//!
//! Positions drift with time, so the world frame is only the car's own; over the 3 s of a label
//! and the 52 m of a route the drift is that of the sensors: 1 % of speed is 0.5 m in 52 m.

use glam::{DQuat, DVec3};

use crate::log::{
    recording::{Series, Stamped, Topic, nearest},
    signals::Pose,
};

/// Where the car went, beginning at the origin and heading along x.
///
/// Between two samples of speed the car drives at their mean along their mean heading. Where
/// samples of `speed` are further apart than `gap_ns`, or `yaw_rate` has none that near, the
/// heading is carried on unchanged; the track that is made of the poses has a gap there anyway.
pub fn integrate(speed: &Topic, yaw_rate: &Topic, gap_ns: i64) -> Vec<Stamped<Pose>> {
    let speeds = speeds(speed);
    let rates = yaw_rates(yaw_rate);
    let rate_at = |stamp_ns: i64| {
        nearest(&rates, stamp_ns)
            .filter(|rate| rate.stamp_ns.abs_diff(stamp_ns) <= gap_ns as u64)
            .map_or(0.0, |rate| rate.value)
    };
    let (mut position_m, mut heading_rad) = (DVec3::ZERO, 0.0_f64);
    let mut last: Option<&Stamped<[f64; 2]>> = None;
    let mut poses = Vec::with_capacity(speeds.len());
    for sample in &speeds {
        if let Some(last) = last.filter(|last| sample.stamp_ns - last.stamp_ns <= gap_ns) {
            let seconds = (sample.stamp_ns - last.stamp_ns) as f64 * 1e-9;
            let turn_rad = rate_at(last.stamp_ns + (sample.stamp_ns - last.stamp_ns) / 2) * seconds;
            let [forward, left] = [0, 1].map(|axis| (last.value[axis] + sample.value[axis]) / 2.0);
            let (sin, cos) = (heading_rad + turn_rad / 2.0).sin_cos();
            position_m.x += (forward * cos - left * sin) * seconds;
            position_m.y += (forward * sin + left * cos) * seconds;
            heading_rad += turn_rad;
        }
        let pose = Pose { position_m, rotation: DQuat::from_rotation_z(heading_rad) };
        poses.push(Stamped { stamp_ns: sample.stamp_ns, value: pose });
        last = Some(sample);
    }
    poses
}

/// Planar velocity in the ego frame, m/s.
fn speeds(topic: &Topic) -> Vec<Stamped<[f64; 2]>> {
    match &topic.series {
        Series::Twist(samples) => samples
            .iter()
            .map(|s| Stamped { stamp_ns: s.stamp_ns, value: [s.value.0.x, s.value.0.y] })
            .collect(),
        Series::Status(samples) => samples
            .iter()
            .map(|s| Stamped { stamp_ns: s.stamp_ns, value: [s.value.speed_mps, 0.0] })
            .collect(),
        _ => Vec::new(),
    }
}

/// Rate of turning to the left, rad/s: about the sensor's z axis, which points up (REP-103).
fn yaw_rates(topic: &Topic) -> Vec<Stamped<f64>> {
    match &topic.series {
        Series::Imu(samples) => {
            samples.iter().map(|s| Stamped { stamp_ns: s.stamp_ns, value: s.value.z }).collect()
        }
        Series::Twist(samples) => {
            samples.iter().map(|s| Stamped { stamp_ns: s.stamp_ns, value: s.value.1.z }).collect()
        }
        _ => Vec::new(),
    }
}
