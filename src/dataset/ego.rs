//! The ego vehicle's motion over a log: pose and velocity at any instant that the log covers.

use glam::{DQuat, DVec3};

use crate::log::recording::Stamped;

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

    /// A point of the ego frame of this instant, in the world; the car is taken to be level.
    pub fn world_from_ego(&self, point_m: DVec3) -> DVec3 {
        self.position_m + DQuat::from_rotation_z(self.yaw_rad) * point_m
    }

    /// A point of the world in the ego frame of this instant, seen from above.
    pub fn ego_from_world(&self, point_m: DVec3) -> [f64; 2] {
        let (sin, cos) = self.yaw_rad.sin_cos();
        let offset = point_m - self.position_m;
        [offset.x * cos + offset.y * sin, offset.y * cos - offset.x * sin]
    }
}

/// The motion of the ego vehicle, sampled as the log has it.
#[derive(Clone, Debug, Default)]
pub struct EgoTrack {
    /// Ascending by stamp.
    samples: Vec<Stamped<EgoState>>,
    /// Furthest that a neighbour may be from an instant that is asked for.
    tolerance_ns: i64,
}

impl EgoTrack {
    /// A track from ready samples, ascending by stamp.
    pub fn from_samples(samples: Vec<Stamped<EgoState>>, tolerance_ns: i64) -> EgoTrack {
        EgoTrack { samples, tolerance_ns }
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
