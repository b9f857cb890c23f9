//! When each sensor samples, and when its message reaches the recorder.
//!
//! Each samples on its own clock, and its message arrives some time later, not always the same; so
//! log times lie behind header stamps, and messages of different topics arrive out of stamp order,
//! as in a car.

use crate::{noise::Noise, world::ego::STEP_S};

/// Steps of the world in a second.
pub const STEPS_PER_S: u64 = (1.0 / STEP_S) as u64;

/// What is recorded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    Imu,
    Odometry,
    Control,
    Situation,
    Camera,
    Objects,
    Lidar,
    Radar,
    Gnss,
    Route,
}

/// A sensor's clock and the way to the recorder.
#[derive(Clone, Copy, Debug)]
pub struct Clock {
    pub source: Source,
    rate_hz: u64,
    /// Steps by which its first sample comes early: sensors do not tick together.
    phase: u64,
    /// From the stamp to the recorder: the least, and the mean of what comes on top, s.
    latency_s: f64,
    jitter_s: f64,
}

/// The driver decides every 0.1 s and sees the world as it is then; the camera looks 20 ms before, at
/// the paper's 10 Hz (section III.B), and the objects are where the picture has them.
#[rustfmt::skip]
pub const CLOCKS: &[Clock] = &[
    Clock { source: Source::Imu,       rate_hz: 100, phase: 0, latency_s: 0.001, jitter_s: 0.0005 },
    Clock { source: Source::Odometry,  rate_hz: 50,  phase: 1, latency_s: 0.003, jitter_s: 0.001 },
    Clock { source: Source::Control,   rate_hz: 20,  phase: 0, latency_s: 0.002, jitter_s: 0.001 },
    Clock { source: Source::Situation, rate_hz: 10,  phase: 0, latency_s: 0.002, jitter_s: 0.001 },
    Clock { source: Source::Camera,    rate_hz: 10,  phase: 2, latency_s: 0.030, jitter_s: 0.006 },
    Clock { source: Source::Objects,   rate_hz: 10,  phase: 2, latency_s: 0.050, jitter_s: 0.005 },
    Clock { source: Source::Lidar,     rate_hz: 10,  phase: 7, latency_s: 0.045, jitter_s: 0.008 },
    Clock { source: Source::Radar,     rate_hz: 13,  phase: 3, latency_s: 0.025, jitter_s: 0.005 },
    Clock { source: Source::Gnss,      rate_hz: 10,  phase: 4, latency_s: 0.060, jitter_s: 0.010 },
    Clock { source: Source::Route,     rate_hz: 2,   phase: 0, latency_s: 0.004, jitter_s: 0.002 },
];

impl Clock {
    /// Whether it samples at a step of the world.
    pub fn ticks_at(&self, step: u64) -> bool {
        (step + self.phase) * self.rate_hz % STEPS_PER_S < self.rate_hz
    }

    /// How long a message takes to the recorder, ns.
    pub fn wait_ns(&self, noise: &mut Noise) -> i64 {
        ((self.latency_s + noise.normal(self.jitter_s).abs()) * 1e9) as i64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_clock_ticks_at_its_rate() {
        for clock in CLOCKS {
            let ticks = (0..10 * STEPS_PER_S).filter(|step| clock.ticks_at(*step)).count();
            assert_eq!(ticks as u64, 10 * clock.rate_hz, "{:?}", clock.source);
        }
    }
}
