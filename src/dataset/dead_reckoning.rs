//! A pose from speed and yaw rate, for logs that have none.
//!
//! Positions drift with time, so the world frame is only the car's own; over the 3 s of a label
//! and the 52 m of a route the drift is that of the sensors: 1 % of speed is 0.5 m in 52 m.

use glam::{DQuat, DVec3};

use crate::{
    dataset::{base_frame::BaseFrame, world::WorldAxes},
    log::{
        recording::{Series, Stamped, Topic, nearest},
        signals::Pose,
        transforms::TransformTree,
    },
};

/// Where the car went, beginning at the origin and heading along x.
///
/// `speeds` are forward and left, m/s; `rates_radps` turn to the left. Between two samples of speed
/// the car drives at their mean along their mean heading. Where samples of speed are further apart
/// than `gap_ns`, or there is no rate that near, the heading is carried on unchanged; the track
/// that is made of the poses has a gap there anyway.
pub fn integrate(
    speeds: &[Stamped<[f64; 2]>],
    rates_radps: &[Stamped<f64>],
    gap_ns: i64,
) -> Vec<Stamped<Pose>> {
    let rate_at = |stamp_ns: i64| {
        nearest(rates_radps, stamp_ns)
            .filter(|rate| rate.stamp_ns.abs_diff(stamp_ns) <= gap_ns as u64)
            .map_or(0.0, |rate| rate.value)
    };
    let (mut position_m, mut heading_rad) = (DVec3::ZERO, 0.0_f64);
    let mut last: Option<&Stamped<[f64; 2]>> = None;
    let mut poses = Vec::with_capacity(speeds.len());
    for sample in speeds {
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

/// Planar velocities of the car, forward and left, m/s.
pub fn speeds(
    topic: &Topic,
    base: &BaseFrame,
    axes: &WorldAxes,
    transforms: &TransformTree,
) -> Vec<Stamped<[f64; 2]>> {
    match &topic.series {
        Series::Twist(samples) => {
            let base_from_sensor = base.base_from_sensor(&topic.frame_id, transforms);
            let planar = |sample: &Stamped<(DVec3, DVec3)>| {
                let (velocity, turn) = sample.value;
                let value = axes.body_vector(at_base(&base_from_sensor, velocity, turn));
                Stamped { stamp_ns: sample.stamp_ns, value: [value.x, value.y] }
            };
            samples.iter().map(planar).collect()
        }
        Series::Status(samples) => samples
            .iter()
            .map(|s| Stamped { stamp_ns: s.stamp_ns, value: [s.value.speed_mps, 0.0] })
            .collect(),
        _ => Vec::new(),
    }
}

/// The velocity of the car's origin, in its axes, from that of a sensor, in the sensor's: a sensor
/// off the origin moves sideways where the car turns.
pub fn at_base(base_from_sensor: &Pose, velocity_mps: DVec3, turn_radps: DVec3) -> DVec3 {
    let (velocity, turn) =
        (base_from_sensor.rotation * velocity_mps, base_from_sensor.rotation * turn_radps);
    velocity - turn.cross(base_from_sensor.position_m)
}
