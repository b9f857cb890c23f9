//! Samples in, tensors out: the last form of the data before the network.
//!
//! Nothing here is normalised: units are SI, so a network says itself how it scales its inputs
//! and drives with the same scaling it was trained with.

use std::borrow::Borrow;

use candle_core::{Device, Tensor};
use rayon::prelude::*;

use crate::{
    dataset::{augment::Disturbance, sample::Sample},
    error::Result,
    frame::{FUTURE_STEPS, ROUTE_POINTS},
};

/// What the network sees. `B` = batch.
#[derive(Clone, Debug)]
pub struct Inputs {
    /// `[B, H, W, 3]` f32, RGB in 0 ... 1; `None` for a network without pictures.
    pub camera: Option<Tensor>,
    /// `[B, H, W, 4]` f32: x, y, z in metres (optical frame), relative speed in m/s; 0 = no return.
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
    pub fn stack<S: Borrow<Sample> + Sync>(samples: &[S], device: &Device) -> Result<Self> {
        Self::stack_disturbed(samples, &|_row| Disturbance::none(), device)
    }

    /// The same, with something done to each row.
    ///
    /// # Errors
    ///
    /// As [`stack`](Self::stack).
    pub fn stack_disturbed<S: Borrow<Sample> + Sync>(
        samples: &[S],
        disturbance: &(dyn Fn(u64) -> Disturbance + Sync),
        device: &Device,
    ) -> Result<Self> {
        let n = samples.len();
        let rows = || samples.iter().map(Borrow::borrow);
        let mut present: Vec<[bool; 2]> = rows().map(|sample| sample.present).collect();
        let (mut camera, mut ralidar) = (None, None);
        if let Some(size) = rows().next().and_then(|s| s.size) {
            let area = size.height * size.width;
            if rows().any(|sample| sample.size != Some(size)) {
                return Err(candle_core::Error::msg("samples of several sizes").into());
            }
            let (mut rgb, mut returns) = (vec![0f32; 3 * n * area], vec![0f32; 4 * n * area]);
            let pictures = rgb.par_chunks_mut(3 * area).zip(returns.par_chunks_mut(4 * area));
            let each = pictures.zip(samples).zip(&mut present).enumerate();
            each.for_each(|(row, (((rgb, returns), sample), present))| {
                let mut disturbance = disturbance(row as u64);
                present[0] &= !disturbance.without_camera;
                present[1] &= !disturbance.without_ralidar;
                fill(sample.borrow(), *present, &mut disturbance, rgb, returns);
            });
            let shape = |channels| (n, size.height, size.width, channels);
            camera = Some(Tensor::from_vec(rgb, shape(3), device)?);
            ralidar = Some(Tensor::from_vec(returns, shape(4), device)?);
        }
        let floats = |each: fn(&Sample) -> Vec<f32>, width: usize| {
            Tensor::from_vec(rows().flat_map(each).collect(), (n, width), device)
        };
        let present: Vec<f32> = present.iter().flatten().map(|p| f32::from(u8::from(*p))).collect();
        Ok(Self {
            camera,
            ralidar,
            velocity: floats(|s| s.velocity_mps.to_vec(), 2)?,
            route: floats(|s| s.route_m.to_vec(), 2 * ROUTE_POINTS)?,
            command: Tensor::from_vec(rows().map(|s| s.command).collect(), n, device)?,
            present: Tensor::from_vec(present, (n, 2), device)?,
        })
    }
}

/// The pictures of a sample, `[H, W, 3]` and `[H, W, 4]`, into zeros.
fn fill(
    sample: &Sample,
    present: [bool; 2],
    disturbance: &mut Disturbance,
    rgb: &mut [f32],
    returns: &mut [f32],
) {
    if present[0] {
        let [red, green, blue] = &disturbance.tones;
        for (to, from) in rgb.chunks_exact_mut(3).zip(sample.camera.chunks_exact(3)) {
            let [r, g, b] = [from[0], from[1], from[2]].map(usize::from);
            to.copy_from_slice(&[red[r], green[g], blue[b]]);
        }
    }
    if present[1] {
        for (&pixel, value) in sample.ralidar_pixel.iter().zip(&sample.ralidar) {
            if disturbance.keeps_point() {
                let at = 4 * pixel as usize;
                returns[at..at + 4].copy_from_slice(&value.map(f32::from));
            }
        }
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
    /// `[B]` f32: the speed of now, m/s.
    pub speed_mps: Tensor,
}

impl Targets {
    /// Samples as tensors on a device.
    ///
    /// # Errors
    ///
    /// [`Error::Tensor`](crate::error::Error::Tensor) if the device refuses.
    pub fn stack<S: Borrow<Sample>>(samples: &[S], device: &Device) -> Result<Self> {
        let n = samples.len();
        let speed = |s: &S| s.borrow().velocity_mps[0].hypot(s.borrow().velocity_mps[1]);
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
            speed_mps: Tensor::from_vec(samples.iter().map(speed).collect(), n, device)?,
        })
    }
}

/// One batch.
#[derive(Clone, Debug)]
pub struct Batch {
    pub inputs: Inputs,
    pub targets: Targets,
    /// Where each frame comes from, `episode/frame`, to name those that broke a training.
    pub frames: Vec<String>,
}

impl Batch {
    /// Samples with their names as one batch on a device, something done to the inputs of each
    /// row; errors as [`Inputs::stack`] and [`Targets::stack`].
    pub fn stack<S: Borrow<Sample> + Sync>(
        samples: &[S],
        frames: Vec<String>,
        disturbance: &(dyn Fn(u64) -> Disturbance + Sync),
        device: &Device,
    ) -> Result<Self> {
        Ok(Self {
            inputs: Inputs::stack_disturbed(samples, disturbance, device)?,
            targets: Targets::stack(samples, device)?,
            frames,
        })
    }

    /// Frames in it.
    ///
    /// # Errors
    ///
    /// [`Error::Tensor`](crate::error::Error::Tensor) if the velocities are no `[B, 2]`.
    pub fn size(&self) -> Result<usize> {
        Ok(self.inputs.velocity.dim(0)?)
    }

    /// The batch cut into at most `parts` of nearly the same size, in order.
    ///
    /// # Errors
    ///
    /// [`Error::Tensor`](crate::error::Error::Tensor) if the tensors do not have the same first
    /// dimension.
    pub fn split(&self, parts: usize) -> Result<Vec<Batch>> {
        let frames = self.size()?;
        let size = frames.div_ceil(parts).max(1);
        let cut = |start: usize| {
            let count = size.min(frames - start);
            let rows = |t: &Tensor| t.narrow(0, start, count);
            let (inputs, targets) = (&self.inputs, &self.targets);
            let names = self.frames.iter().skip(start).take(count);
            Ok(Batch {
                inputs: Inputs {
                    camera: inputs.camera.as_ref().map(rows).transpose()?,
                    ralidar: inputs.ralidar.as_ref().map(rows).transpose()?,
                    velocity: rows(&inputs.velocity)?,
                    route: rows(&inputs.route)?,
                    command: rows(&inputs.command)?,
                    present: rows(&inputs.present)?,
                },
                targets: Targets {
                    action: rows(&targets.action)?,
                    action_known: rows(&targets.action_known)?,
                    motion: rows(&targets.motion)?,
                    motion_valid: rows(&targets.motion_valid)?,
                    speed_mps: rows(&targets.speed_mps)?,
                },
                frames: names.cloned().collect(),
            })
        };
        (0..frames).step_by(size).map(cut).collect()
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
