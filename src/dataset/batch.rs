//! Samples in, tensors out: the last form of the data before the network.
//!
//! Nothing here is normalised: units are SI, so a network says itself how it scales its inputs
//! and drives with the same scaling it was trained with.

use candle_core::Tensor;

/// What the network sees. `B` = batch.
#[derive(Clone, Debug)]
pub struct Inputs {
    /// `[B, 3, H, W]` f32, RGB in 0 ... 1; `None` for a network without pictures.
    pub camera: Option<Tensor>,
    /// `[B, 4, H, W]` f32: x, y, z in metres (optical frame), relative speed in m/s; 0 = no return.
    pub ralidar: Option<Tensor>,
    /// `[B, 2]` f32, (vx, vy) m/s, ego frame.
    pub velocity: Tensor,
    /// `[B, 260]` f32, waypoints x1, y1, x2, y2, ... in metres, ego frame.
    pub route: Tensor,
    /// `[B]` u32, index in [`Command::ALL`](crate::frame::Command::ALL).
    pub command: Tensor,
    /// `[B, 2]` f32, 1 where the sensor delivered at this frame: camera, ralidar.
    pub present: Tensor,
}

/// What the network should say.
#[derive(Clone, Debug)]
pub struct Targets {
    /// `[B, 3]` f32: steer, throttle, brake; 0 where unknown.
    pub action: Tensor,
    /// `[B, 3]` f32, 1 where `action` is known.
    pub action_known: Tensor,
    /// `[B, 30, 2]` f32: speed (m/s) and yaw change from now (rad); 0 where invalid.
    pub motion: Tensor,
    /// `[B, 30]` f32, 1 where `motion` is valid.
    pub motion_valid: Tensor,
}

/// One batch.
#[derive(Clone, Debug)]
pub struct Batch {
    pub inputs: Inputs,
    pub targets: Targets,
}

/// Where batches come from. What comes at a step is a pure function of the step, so that a
/// resumed training sees what an uninterrupted one would have seen.
pub trait Batches {
    /// The batch of a step, from 0.
    ///
    /// # Errors
    ///
    /// If a shard cannot be read, or a picture in it cannot be decoded.
    fn batch(&mut self, step: u64) -> crate::error::Result<Batch>;
}
