//! Samples in, tensors out: the last form of the data before the network.
//!
//! Nothing here is normalised: units are SI, so a network says itself how it scales its inputs
//! and drives with the same scaling it was trained with.

use std::borrow::Borrow;

use candle_core::{DType, Device, Tensor};

use crate::{
    dataset::sample::Sample,
    error::Result,
    frame::{FUTURE_STEPS, ROUTE_POINTS},
};

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

impl Inputs {
    /// Samples, all prepared for one size, as tensors on a device.
    ///
    /// # Errors
    ///
    /// [`Error::Tensor`](crate::error::Error::Tensor) if there is no sample, or their sizes differ.
    pub fn stack<S: Borrow<Sample>>(samples: &[S], device: &Device) -> Result<Self> {
        let n = samples.len();
        let rows = || samples.iter().map(Borrow::borrow);
        let (mut camera, mut ralidar) = (None, None);
        if let Some(size) = rows().next().and_then(|s| s.size) {
            let shape = |channels| (n, channels, size.height, size.width);
            let rgb: Vec<u8> = rows().flat_map(|s| &s.camera).copied().collect();
            let rgb = Tensor::from_vec(rgb, shape(3), device)?.to_dtype(DType::F32)?;
            camera = Some((rgb / 255.0)?);
            let returns: Vec<_> = rows().flat_map(|s| &s.ralidar).copied().collect();
            ralidar = Some(Tensor::from_vec(returns, shape(4), device)?.to_dtype(DType::F32)?);
        }
        let floats = |each: fn(&Sample) -> Vec<f32>, width: usize| {
            Tensor::from_vec(rows().flat_map(each).collect(), (n, width), device)
        };
        Ok(Self {
            camera,
            ralidar,
            velocity: floats(|s| s.velocity_mps.to_vec(), 2)?,
            route: floats(|s| s.route_m.to_vec(), 2 * ROUTE_POINTS)?,
            command: Tensor::from_vec(rows().map(|s| s.command).collect(), n, device)?,
            present: floats(|s| s.present.map(|p| f32::from(u8::from(p))).to_vec(), 2)?,
        })
    }
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

impl Targets {
    /// Samples as tensors on a device.
    ///
    /// # Errors
    ///
    /// [`Error::Tensor`](crate::error::Error::Tensor) if the device refuses.
    pub fn stack<S: Borrow<Sample>>(samples: &[S], device: &Device) -> Result<Self> {
        let n = samples.len();
        let mut motion = vec![0f32; n * FUTURE_STEPS * 2];
        let mut valid = vec![0f32; n * FUTURE_STEPS];
        let (mut action, mut known) = (vec![0f32; n * 3], vec![0f32; n * 3]);
        for (i, sample) in samples.iter().map(Borrow::borrow).enumerate() {
            for (channel, value) in sample.action.iter().enumerate() {
                if let Some(value) = value {
                    (action[3 * i + channel], known[3 * i + channel]) = (*value, 1.0);
                }
            }
            for (step, pair) in sample.motion.iter().take(sample.motion_len).enumerate() {
                let at = i * FUTURE_STEPS + step;
                valid[at] = 1.0;
                motion[2 * at..2 * at + 2].copy_from_slice(pair);
            }
        }
        Ok(Self {
            action: Tensor::from_vec(action, (n, 3), device)?,
            action_known: Tensor::from_vec(known, (n, 3), device)?,
            motion: Tensor::from_vec(motion, (n, FUTURE_STEPS, 2), device)?,
            motion_valid: Tensor::from_vec(valid, (n, FUTURE_STEPS), device)?,
        })
    }
}

/// One batch.
#[derive(Clone, Debug)]
pub struct Batch {
    pub inputs: Inputs,
    pub targets: Targets,
}

impl Batch {
    /// Samples as one batch on a device; errors as [`Inputs::stack`] and [`Targets::stack`].
    pub fn stack<S: Borrow<Sample>>(samples: &[S], device: &Device) -> Result<Self> {
        Ok(Self {
            inputs: Inputs::stack(samples, device)?,
            targets: Targets::stack(samples, device)?,
        })
    }
}

/// Where batches come from. What comes at a step is a pure function of the step, so that a
/// resumed training sees what an uninterrupted one would have seen.
pub trait Batches {
    /// The batch of a step, from 0.
    ///
    /// # Errors
    ///
    /// If a shard cannot be read, or a picture in it cannot be decoded.
    fn batch(&mut self, step: u64) -> Result<Batch>;
}
