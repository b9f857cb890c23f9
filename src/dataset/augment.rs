//! What is done to a frame before it is learned from, so that the same frame is never seen twice.
//!
//! The camera becomes lighter or darker, flatter or harder, and of another tint; points of lidar
//! and radar go missing; at times a sensor is not there at all, so that no branch rests on one
//! alone. Nothing is moved or mirrored: route, steering and yaw stay true.

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

/// How much is done; nothing by default.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct AugmentConfig {
    /// Brightness is multiplied by 1 - this ... 1 + this.
    pub brightness: f64,
    /// Contrast around the middle grey is multiplied by 1 - this ... 1 + this.
    pub contrast: f64,
    /// Each of red, green, blue is multiplied by 1 - this ... 1 + this.
    pub colour: f64,
    /// Probability that a point of lidar or radar goes missing.
    pub point_dropout: f64,
    /// Probabilities that a sensor of a frame is not there.
    pub camera_dropout: f64,
    pub ralidar_dropout: f64,
}

/// What is done to one frame.
#[derive(Clone, Debug)]
pub struct Disturbance {
    /// By channel: what a value of 0 ... 255 becomes, in 0 ... 1.
    pub tones: [[f32; 256]; 3],
    pub without_camera: bool,
    pub without_ralidar: bool,
    points: Option<(ChaCha8Rng, f64)>,
}

impl AugmentConfig {
    /// Whether nothing is done.
    pub fn is_nothing(&self) -> bool {
        *self == Self::default()
    }

    /// What is done to the `row`-th frame of the batch of a step: the same for the same seed.
    pub fn disturbance(&self, seed: u64, step: u64, row: u64) -> Disturbance {
        if self.is_nothing() {
            return Disturbance::none();
        }
        let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 0x6175_676d_656e_7431);
        // No batch has as many frames as a stream has room for.
        rng.set_stream(step << 16 | row & 0xffff);
        let mut around_1 = |by: f64| 1.0 + by * (2.0 * rng.random::<f64>() - 1.0);
        let (brightness, contrast) = (around_1(self.brightness), around_1(self.contrast));
        let colours = [(); 3].map(|()| around_1(self.colour));
        let tones = colours.map(|colour| {
            std::array::from_fn(|value| {
                let hard = (value as f64 / 255.0 - 0.5) * contrast + 0.5;
                (hard * brightness * colour).clamp(0.0, 1.0) as f32
            })
        });
        let without_camera = rng.random::<f64>() < self.camera_dropout;
        // One of both stays.
        let without_ralidar = rng.random::<f64>() < self.ralidar_dropout && !without_camera;
        let points = (self.point_dropout > 0.0).then_some((rng, self.point_dropout));
        Disturbance { tones, without_camera, without_ralidar, points }
    }
}

impl Disturbance {
    /// The frame as it is.
    pub fn none() -> Self {
        let tones = [std::array::from_fn(|value| value as f32 / 255.0); 3];
        Disturbance { tones, without_camera: false, without_ralidar: false, points: None }
    }

    /// Whether the next point stays; to be asked once for each, in their order.
    pub fn keeps_point(&mut self) -> bool {
        match &mut self.points {
            Some((rng, dropout)) => rng.random::<f64>() >= *dropout,
            None => true,
        }
    }
}
