//! Random numbers of the simulator: one stream per purpose, all from the seed of the drive.

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

/// What a stream of random numbers is for. Streams never mix, so a sensor added or left out
/// changes no other part of a drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    Road,
    Scenery,
    Traffic,
    Driver,
    Lidar,
    Radar,
    Odometry,
    Imu,
    Latency,
    Gnss,
    Plan,
    Camera,
    Rain,
    Lens,
}

/// A stream of random numbers.
#[derive(Clone, Debug)]
pub struct Noise(ChaCha8Rng);

impl Noise {
    /// The stream of `purpose` in episode `episode` of `seed`.
    pub fn new(seed: u64, episode: u32, purpose: Purpose) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(u64::from(episode) << 8 | purpose as u64);
        Noise(rng)
    }

    /// The stream of one actor's own: what others draw changes nothing for it.
    pub fn of_actor(seed: u64, episode: u32, actor: u32) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(1 << 63 | u64::from(episode) << 31 | u64::from(actor));
        Noise(rng)
    }

    /// Uniform in [`low`, `high`).
    pub fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.0.random::<f64>()
    }

    /// True with probability `p`.
    pub fn chance(&mut self, p: f64) -> bool {
        self.0.random::<f64>() < p
    }

    /// Normal with mean zero (Box-Muller).
    pub fn normal(&mut self, std: f64) -> f64 {
        let (radius, angle) = self.polar();
        std * radius * angle.cos()
    }

    /// Two of them, which know nothing of each other, for little more than one.
    pub fn normal_pair(&mut self, std: f64) -> [f64; 2] {
        let (radius, angle) = self.polar();
        let (sin, cos) = angle.sin_cos();
        [std * radius * cos, std * radius * sin]
    }

    /// Distance and angle of a place on the plane whose coordinates are normal.
    fn polar(&mut self) -> (f64, f64) {
        // 1 - u lies in (0, 1], where the logarithm is finite.
        let radius = (-2.0 * (1.0 - self.0.random::<f64>()).ln()).sqrt();
        (radius, std::f64::consts::TAU * self.0.random::<f64>())
    }

    /// One of `choices`, which must not be empty.
    pub fn pick<T: Copy>(&mut self, choices: &[T]) -> T {
        choices[self.0.random_range(0..choices.len())]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn streams_of_one_seed_differ_and_repeat() {
        let draw = |episode, purpose| Noise::new(7, episode, purpose).uniform(0.0, 1.0);
        assert_eq!(draw(0, Purpose::Road), draw(0, Purpose::Road));
        assert_ne!(draw(0, Purpose::Road), draw(1, Purpose::Road));
        assert_ne!(draw(0, Purpose::Road), draw(0, Purpose::Imu));
    }

    #[test]
    fn normal_has_the_spread_that_was_asked_for() {
        let mut noise = Noise::new(1, 0, Purpose::Imu);
        let single: Vec<f64> = (0..20_000).map(|_| noise.normal(2.0)).collect();
        let pairs: Vec<[f64; 2]> = (0..20_000).map(|_| noise.normal_pair(2.0)).collect();
        let of = |place: usize| pairs.iter().map(|pair| pair[place]).collect();
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        for draws in [single, of(0), of(1)] {
            let squares: Vec<f64> = draws.iter().map(|x| x * x).collect();
            let (mean, std) = (mean(&draws), mean(&squares).sqrt());
            assert!(mean.abs() < 0.06 && (std - 2.0).abs() < 0.06, "mean {mean}, std {std}");
        }
        let products: Vec<f64> = pairs.iter().map(|[a, b]| a * b).collect();
        assert!(mean(&products).abs() < 0.12, "one of a pair tells of the other");
    }
}
