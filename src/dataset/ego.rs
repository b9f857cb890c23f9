//! The ego vehicle's motion over a log: pose and velocity at any instant that the log covers.

use glam::{DQuat, DVec3, EulerRot};

use crate::{
    dataset::dead_reckoning::integrate,
    error::Result,
    log::{
        mapping::{Mapping, PoseSource},
        recording::{Recording, Series, Stamped, mapping_error, nearest},
        signals::Pose,
    },
};

/// Below this distance over a whole log the car counts as standing, metres.
const STANDING_M: f64 = 0.5;

/// Pose and velocity at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EgoState {
    /// World frame, metres.
    pub position_m: DVec3,
    /// World frame, rad in (-pi, pi].
    pub yaw_rad: f64,
    /// Planar, ego frame (x forward, y left), m/s.
    pub velocity_mps: [f64; 2],
}

impl EgoState {
    /// Planar speed, negative when reversing, m/s.
    pub fn speed_mps(&self) -> f64 {
        let [vx, vy] = self.velocity_mps;
        vx.hypot(vy).copysign(vx)
    }

    /// A point of the world in the ego frame of this instant, seen from above.
    pub fn ego_from_world(&self, point_m: DVec3) -> [f64; 2] {
        let (sin, cos) = self.yaw_rad.sin_cos();
        let offset = point_m - self.position_m;
        [offset.x * cos + offset.y * sin, offset.y * cos - offset.x * sin]
    }
}

/// The motion of the ego vehicle, sampled as the log has it.
#[derive(Clone, Debug)]
pub struct EgoTrack {
    /// Ascending by stamp.
    samples: Vec<Stamped<EgoState>>,
    /// Furthest that a neighbour may be from an instant that is asked for.
    tolerance_ns: i64,
    /// How the track was made, for people.
    pub notes: Vec<String>,
}

impl EgoTrack {
    /// Build the track from the chosen topics.
    ///
    /// Velocity is the odometry's own where it has one, else that of a velocity topic, else the
    /// derivative of the pose.
    ///
    /// # Errors
    ///
    /// [`Error::Mapping`](crate::error::Error::Mapping) if the log has no pose.
    pub fn new(recording: &Recording, mapping: &Mapping, tolerance_ns: i64) -> Result<EgoTrack> {
        let Some(source) = &mapping.pose else {
            let hint = "frames need odometry, a pose topic, /tf of the vehicle, or a speed and \
                        a yaw rate; \
                        `pmp-ingest inspect LOG` shows what the log has";
            return Err(mapping_error(&recording.log, "no ego pose".into(), hint));
        };
        let poses = poses(recording, source, 2 * tolerance_ns);
        let mut notes = Vec::new();
        let velocities = velocities(recording, mapping, &poses, tolerance_ns, &mut notes);
        let samples = poses
            .iter()
            .zip(velocities)
            .map(|(pose, velocity_mps)| Stamped {
                stamp_ns: pose.stamp_ns,
                value: EgoState {
                    position_m: pose.value.position_m,
                    yaw_rad: yaw_of(pose.value.rotation),
                    velocity_mps,
                },
            })
            .collect();
        Ok(EgoTrack { samples, tolerance_ns, notes })
    }

    /// A track from ready samples, ascending by stamp.
    pub fn from_samples(samples: Vec<Stamped<EgoState>>, tolerance_ns: i64) -> EgoTrack {
        EgoTrack { samples, tolerance_ns, notes: Vec::new() }
    }

    /// The first and the last instant.
    pub fn span_ns(&self) -> Option<(i64, i64)> {
        Some((self.samples.first()?.stamp_ns, self.samples.last()?.stamp_ns))
    }

    /// All samples, ascending.
    pub fn samples(&self) -> &[Stamped<EgoState>] {
        &self.samples
    }

    /// The state at an instant, interpolated between its neighbours; `None` outside the track,
    /// or where a neighbour is further away than the tolerance: nothing is invented across a gap.
    pub fn at(&self, stamp_ns: i64) -> Option<EgoState> {
        let after = self.samples.partition_point(|sample| sample.stamp_ns < stamp_ns);
        let later = self.samples.get(after)?;
        if later.stamp_ns == stamp_ns {
            return Some(later.value);
        }
        let earlier = &self.samples[after.checked_sub(1)?];
        let gap_ns = later.stamp_ns - earlier.stamp_ns;
        if gap_ns > 2 * self.tolerance_ns {
            return None;
        }
        let fraction = (stamp_ns - earlier.stamp_ns) as f64 / gap_ns as f64;
        Some(interpolate(&earlier.value, &later.value, fraction))
    }

    /// Whether the track has no gap between two instants.
    pub fn is_continuous(&self, from_ns: i64, to_ns: i64) -> bool {
        let first = self.samples.partition_point(|sample| sample.stamp_ns <= from_ns);
        let last = self.samples.partition_point(|sample| sample.stamp_ns < to_ns);
        let inside = &self.samples[first.saturating_sub(1)..(last + 1).min(self.samples.len())];
        inside.windows(2).all(|w| w[1].stamp_ns - w[0].stamp_ns <= 2 * self.tolerance_ns)
    }
}

fn interpolate(a: &EgoState, b: &EgoState, fraction: f64) -> EgoState {
    let between = |a: f64, b: f64| a + (b - a) * fraction;
    EgoState {
        position_m: a.position_m.lerp(b.position_m, fraction),
        yaw_rad: wrap_angle(a.yaw_rad + wrap_angle(b.yaw_rad - a.yaw_rad) * fraction),
        velocity_mps: [
            between(a.velocity_mps[0], b.velocity_mps[0]),
            between(a.velocity_mps[1], b.velocity_mps[1]),
        ],
    }
}

/// An angle in (-pi, pi].
pub fn wrap_angle(angle_rad: f64) -> f64 {
    let wrapped = angle_rad.rem_euclid(std::f64::consts::TAU);
    if wrapped > std::f64::consts::PI { wrapped - std::f64::consts::TAU } else { wrapped }
}

/// Heading of a frame's x axis, seen from above.
fn yaw_of(rotation: DQuat) -> f64 {
    rotation.to_euler(EulerRot::ZYX).0
}

fn poses(recording: &Recording, source: &PoseSource, gap_ns: i64) -> Vec<Stamped<Pose>> {
    match source {
        PoseSource::Topic(topic) => match recording.topics.get(topic).map(|topic| &topic.series) {
            Some(Series::Odometry(samples)) => samples
                .iter()
                .map(|sample| Stamped { stamp_ns: sample.stamp_ns, value: sample.value.pose })
                .collect(),
            Some(Series::Pose(samples)) => samples.clone(),
            _ => Vec::new(),
        },
        PoseSource::Integrated { speed, yaw_rate } => {
            let topics = recording.topics.get(speed).zip(recording.topics.get(yaw_rate));
            topics.map_or_else(Vec::new, |(speed, rate)| integrate(speed, rate, gap_ns))
        }
        PoseSource::Transform(frame) => {
            let poses = recording.transforms.track(frame).map(|(_, poses)| poses);
            let mut poses: Vec<_> = poses
                .unwrap_or_default()
                .iter()
                .map(|(stamp_ns, pose)| Stamped { stamp_ns: *stamp_ns, value: *pose })
                .collect();
            poses.dedup_by_key(|pose| pose.stamp_ns);
            poses
        }
    }
}

/// Planar velocity in the ego frame at every pose.
fn velocities(
    recording: &Recording,
    mapping: &Mapping,
    poses: &[Stamped<Pose>],
    tolerance_ns: i64,
    notes: &mut Vec<String>,
) -> Vec<[f64; 2]> {
    let derived = derivative(poses);
    let moved = poses.windows(2).map(|w| w[0].value.position_m.distance(w[1].value.position_m));
    let moves = moved.sum::<f64>() > STANDING_M;

    if let Some(PoseSource::Topic(topic)) = &mapping.pose
        && let Some(Series::Odometry(samples)) = recording.topics.get(topic).map(|t| &t.series)
    {
        let silent = samples.iter().all(|sample| sample.value.velocity_mps == DVec3::ZERO);
        if !(silent && moves) {
            let planar = |sample: &Stamped<_>| {
                let sample: &Stamped<crate::log::signals::Odometry> = sample;
                [sample.value.velocity_mps.x, sample.value.velocity_mps.y]
            };
            return samples.iter().map(planar).collect();
        }
        notes.push(format!("velocity: {topic} leaves its twist at zero while the car moves"));
    }
    let topic = mapping.velocity.as_ref().and_then(|name| recording.topics.get(name));
    match topic.map(|topic| (topic, &topic.series)) {
        Some((topic, Series::Twist(samples))) => {
            let in_world = world_frame(recording, mapping) == Some(topic.frame_id.as_str());
            notes.push(format!("velocity: from {}", topic.name));
            let at = |(pose, derived): (&Stamped<Pose>, &[f64; 2])| {
                let near = nearest(samples, pose.stamp_ns)
                    .filter(|near| near.stamp_ns.abs_diff(pose.stamp_ns) <= tolerance_ns as u64);
                match near {
                    Some(near) if in_world => {
                        let body = pose.value.rotation.inverse() * near.value.0;
                        [body.x, body.y]
                    }
                    Some(near) => [near.value.0.x, near.value.0.y],
                    None => *derived,
                }
            };
            poses.iter().zip(&derived).map(at).collect()
        }
        Some((topic, Series::Status(samples))) => {
            notes.push(format!("velocity: from {}", topic.name));
            let at = |(pose, derived): (&Stamped<Pose>, &[f64; 2])| {
                let near = nearest(samples, pose.stamp_ns)
                    .filter(|near| near.stamp_ns.abs_diff(pose.stamp_ns) <= tolerance_ns as u64);
                near.map_or(*derived, |near| [near.value.speed_mps, 0.0])
            };
            poses.iter().zip(&derived).map(at).collect()
        }
        _ => {
            notes.push("velocity: from the derivative of the pose".to_string());
            derived
        }
    }
}

/// The frame that poses are given in, where they come from a topic.
fn world_frame<'r>(recording: &'r Recording, mapping: &'r Mapping) -> Option<&'r str> {
    match mapping.pose.as_ref()? {
        PoseSource::Topic(topic) => {
            recording.topics.get(topic).map(|topic| topic.frame_id.as_str())
        }
        PoseSource::Transform(frame) => recording.transforms.track(frame).map(|(parent, _)| parent),
        PoseSource::Integrated { .. } => None,
    }
}

/// Velocity from the poses: central differences over about 0.2 s, which halves the noise of
/// positions without smearing a manoeuvre.
fn derivative(poses: &[Stamped<Pose>]) -> Vec<[f64; 2]> {
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
            let body = poses[i].value.rotation.inverse() * world;
            [body.x, body.y]
        })
        .collect()
}
