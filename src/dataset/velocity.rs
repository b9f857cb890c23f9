//! The planar velocity of the car at every pose: the odometry's own, else that of a velocity topic,
//! else the derivative of the pose.

use glam::DVec3;

use crate::{
    dataset::{
        base_frame::BaseFrame,
        dead_reckoning::{at_base, speeds},
        world::WorldAxes,
    },
    log::{
        recording::{Series, Stamped, Topic, nearest},
        signals::{Odometry, Pose},
        transforms::TransformTree,
    },
};

/// Below this distance over a whole log the car counts as standing, metres.
const STANDING_M: f64 = 0.5;

/// Whether poses lead anywhere.
pub fn moves(poses: &[Stamped<Pose>]) -> bool {
    let moved = poses.windows(2).map(|w| w[0].value.position_m.distance(w[1].value.position_m));
    moved.sum::<f64>() > STANDING_M
}

/// The twists of an odometry, brought to the car; `None` if they stay at zero although it moves.
pub fn of_odometry(
    samples: &[Stamped<Odometry>],
    base: &BaseFrame,
    axes: &WorldAxes,
    moves: bool,
) -> Option<Vec<[f64; 2]>> {
    let is_silent = samples.iter().all(|sample| sample.value.velocity_mps == DVec3::ZERO);
    if is_silent && moves {
        return None;
    }
    let base_from_child = base.child_from_base.inverse();
    let planar = |sample: &Stamped<Odometry>| {
        let Odometry { velocity_mps, angular_velocity_radps, .. } = sample.value;
        let velocity = at_base(&base_from_child, velocity_mps, angular_velocity_radps);
        let velocity = axes.body_vector(velocity);
        [velocity.x, velocity.y]
    };
    Some(samples.iter().map(planar).collect())
}

/// Velocities of a topic at the poses of the car; where it has none near, the derivative of the
/// pose. A twist that is told in the poses' world frame is turned into the car's.
pub fn of_topic(
    topic: &Topic,
    poses: &[Stamped<Pose>],
    world_frame: Option<&str>,
    (base, axes): (&BaseFrame, &WorldAxes),
    transforms: &TransformTree,
    tolerance_ns: i64,
) -> Vec<[f64; 2]> {
    let derived = derivative(poses);
    let near = |stamp_ns: i64, other_ns: i64| stamp_ns.abs_diff(other_ns) <= tolerance_ns as u64;
    if let Series::Twist(samples) = &topic.series
        && world_frame == Some(topic.frame_id.as_str())
    {
        let at = |(pose, derived): (&Stamped<Pose>, &[f64; 2])| {
            let sample = nearest(samples, pose.stamp_ns);
            sample.filter(|s| near(s.stamp_ns, pose.stamp_ns)).map_or(*derived, |sample| {
                let body = pose.value.rotation.inverse() * axes.vector(sample.value.0);
                [body.x, body.y]
            })
        };
        return poses.iter().zip(&derived).map(at).collect();
    }
    let samples = speeds(topic, base, axes, transforms);
    let at = |(pose, derived): (&Stamped<Pose>, &[f64; 2])| {
        let sample = nearest(&samples, pose.stamp_ns);
        sample.filter(|s| near(s.stamp_ns, pose.stamp_ns)).map_or(*derived, |sample| sample.value)
    };
    poses.iter().zip(&derived).map(at).collect()
}

/// Velocity from the poses: central differences over about 0.2 s, which halves the noise of
/// positions without smearing a manoeuvre.
pub fn derivative(poses: &[Stamped<Pose>]) -> Vec<[f64; 2]> {
    const HALF_WINDOW_NS: i64 = 100_000_000;
    let bound = |from: usize, stamp_ns: i64, step: isize| {
        let mut at = from;
        while let Some(next) = at.checked_add_signed(step).filter(|next| *next < poses.len()) {
            if poses[next].stamp_ns.abs_diff(stamp_ns) > HALF_WINDOW_NS as u64 && at != from {
                break;
            }
            at = next;
            if poses[at].stamp_ns.abs_diff(stamp_ns) >= HALF_WINDOW_NS as u64 {
                break;
            }
        }
        at
    };
    (0..poses.len())
        .map(|i| {
            let (a, b) = (bound(i, poses[i].stamp_ns, -1), bound(i, poses[i].stamp_ns, 1));
            let seconds = (poses[b].stamp_ns - poses[a].stamp_ns) as f64 * 1e-9;
            if seconds <= 0.0 {
                return [0.0, 0.0];
            }
            let world = (poses[b].value.position_m - poses[a].value.position_m) / seconds;
            // The chord of a bend lies along the attitude of its middle.
            let attitude = poses[a].value.rotation.slerp(poses[b].value.rotation, 0.5);
            let body = attitude.inverse() * world;
            [body.x, body.y]
        })
        .collect()
}
