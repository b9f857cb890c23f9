//! How the car moved from row to row, by its poses: what labels and sensors are held against.

use crate::{dataset::ego::wrap_angle, frame::signed_speed_mps, stats::check::track::Track};

/// How much longer or shorter than a tick a step may be and still be one.
const TICK_SLACK: f64 = 0.1;

/// The motion of an episode.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Motion {
    /// Seconds between two frames of the grid.
    pub tick_s: f64,
    /// Of each row, by the column `velocity`; negative when reversing.
    pub speed_mps: Vec<f64>,
    /// Whether the next row is the next tick, and both have a pose.
    pub is_step: Vec<bool>,
    /// Rows from this one on, without a missing tick.
    pub run: Vec<u32>,
    /// Displacement to the next row over the tick, seen along the mean yaw of both, m/s; zero
    /// where there is no step.
    pub moved_mps: Vec<[f64; 2]>,
    /// Change of yaw over the step, rad/s.
    pub yaw_rate_radps: Vec<f64>,
    /// Change of speed over the step, m/s2.
    pub acceleration_mps2: Vec<f64>,
    /// Yaw rate over speed, to the right as steering is, 1/m; `None` where the car is too slow to
    /// tell.
    pub curvature_1pm: Vec<Option<f64>>,
}

/// Slower than this, yaw over way is noise, m/s.
pub const TELLING_MPS: f64 = 2.0;

impl Motion {
    pub fn of(track: &Track, rate_hz: f64) -> Motion {
        let rows = track.len();
        let tick_s = 1.0 / rate_hz;
        let mut motion = Motion { tick_s, ..Motion::default() };
        motion.speed_mps =
            (0..rows).map(|row| f64::from(signed_speed_mps(track.velocity_of(row)))).collect();
        for row in 0..rows {
            let step = step(track, row, tick_s);
            motion.is_step.push(step.is_some());
            let Step { moved_mps, yaw_rate_radps } = step.clone().unwrap_or_default();
            let acceleration = match step {
                Some(_) => (motion.speed_mps[row + 1] - motion.speed_mps[row]) / tick_s,
                None => 0.0,
            };
            motion.moved_mps.push(moved_mps);
            motion.yaw_rate_radps.push(yaw_rate_radps);
            motion.acceleration_mps2.push(acceleration);
            let speed = moved_mps[0].hypot(moved_mps[1]);
            let tells = step.is_some() && speed > TELLING_MPS;
            motion.curvature_1pm.push(tells.then(|| -yaw_rate_radps / speed));
        }
        motion.run = vec![1; rows];
        for row in (0..rows.saturating_sub(1)).rev() {
            if motion.is_step[row] {
                motion.run[row] = motion.run[row + 1] + 1;
            }
        }
        motion
    }

    /// Rows that begin a step.
    pub fn steps(&self) -> impl Iterator<Item = usize> {
        self.is_step.iter().enumerate().filter_map(|(row, is_step)| is_step.then_some(row))
    }

    /// Ticks in so many seconds; `None` if that is no whole number of them.
    pub fn ticks_in(&self, seconds: f64) -> Option<usize> {
        let ticks = seconds / self.tick_s;
        ((ticks - ticks.round()).abs() < 1e-6).then_some(ticks.round() as usize)
    }
}

#[derive(Clone, Default)]
struct Step {
    moved_mps: [f64; 2],
    yaw_rate_radps: f64,
}

fn step(track: &Track, row: usize, tick_s: f64) -> Option<Step> {
    let next = row + 1;
    if next >= track.len() || track.frame[next] != track.frame[row].wrapping_add(1) {
        return None;
    }
    let seconds = track.stamp_ns[next].wrapping_sub(track.stamp_ns[row]) as f64 * 1e-9;
    if (seconds / tick_s - 1.0).abs() > TICK_SLACK {
        return None;
    }
    let (from, to) = (track.position_of(row), track.position_of(next));
    let (x, y) = (to[0] - from[0], to[1] - from[1]);
    let turned = wrap_angle(track.yaw_rad[next] - track.yaw_rad[row]);
    let (sin, cos) = (track.yaw_rad[row] + turned / 2.0).sin_cos();
    let moved_mps = [(x * cos + y * sin) / tick_s, (y * cos - x * sin) / tick_s];
    let is_finite = moved_mps.iter().all(|v| v.is_finite()) && turned.is_finite();
    is_finite.then_some(Step { moved_mps, yaw_rate_radps: turned / tick_s })
}

/// The middle one; `None` of nothing.
pub fn median(mut values: Vec<f64>) -> Option<f64> {
    let middle = values.len() / 2;
    let (_, median, _) =
        (!values.is_empty()).then(|| values.select_nth_unstable_by(middle, f64::total_cmp))?;
    Some(*median)
}

/// Pearson's correlation; `None` of fewer than `least` pairs, or where one side does not vary by
/// as much as its `spread` (standard deviation).
pub fn correlation(
    pairs: impl Iterator<Item = (f64, f64)>,
    least: usize,
    spread: [f64; 2],
) -> Option<f64> {
    let (mut n, mut sx, mut sy, mut sxx, mut syy, mut sxy) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    for (x, y) in pairs {
        n += 1.0;
        sx += x;
        sy += y;
        sxx += x * x;
        syy += y * y;
        sxy += x * y;
    }
    let (vx, vy) = (sxx / n - (sx / n) * (sx / n), syy / n - (sy / n) * (sy / n));
    let varies = n >= least as f64 && vx > spread[0] * spread[0] && vy > spread[1] * spread[1];
    varies.then(|| (sxy / n - sx / n * (sy / n)) / (vx * vy).sqrt())
}
