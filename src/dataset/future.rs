//! What the car did next: 3 s of speed, yaw change and position, as far as the log goes.

use crate::{
    dataset::ego::{EgoState, EgoTrack, wrap_angle},
    frame::{FUTURE_STEPS, Future},
};

/// Nanoseconds between two steps of the future.
const STEP_NS: i64 = 100_000_000;

/// The future of one instant (paper §III.C4, choice U3).
///
/// Steps end where the track ends or has a gap; what follows is zero and not counted in `len`.
/// `now` must be the track's state at `stamp_ns`.
pub fn future(track: &EgoTrack, stamp_ns: i64, now: &EgoState) -> Future {
    let mut future = Future::UNKNOWN;
    for step in 0..FUTURE_STEPS {
        let (from_ns, to_ns) =
            (stamp_ns + step as i64 * STEP_NS, stamp_ns + (step as i64 + 1) * STEP_NS);
        let Some(then) = track.at(to_ns).filter(|_| track.is_continuous(from_ns, to_ns)) else {
            break;
        };
        let [x, y] = now.ego_from_world(then.position_m);
        future.speed_mps[step] = then.speed_mps() as f32;
        future.yaw_rad[step] = wrap_angle(then.yaw_rad - now.yaw_rad) as f32;
        future.xy_m[2 * step] = x as f32;
        future.xy_m[2 * step + 1] = y as f32;
        future.len = step as u8 + 1;
    }
    future
}
