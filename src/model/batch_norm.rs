//! A batch norm with its weights and running statistics, by torchvision's names.

use candle_core::{CpuStorage, InplaceOp1, Layout, Tensor};
use candle_nn::{
    Init, VarBuilder,
    init::{ONE, ZERO},
};
use pmp_kernels::norm::Moments;

use crate::{
    error::Result,
    model::{
        ops::{Norm, Numbers, batch_norm},
        pass::Pass,
    },
};

/// Added to variances, as in torchvision.
const EPS: f64 = 1e-5;

/// Share of the batch in the running statistics, as in torchvision.
const MOMENTUM: f64 = 0.1;

/// The norm. `running_mean` and `running_var` are weights that no gradient moves: each pass that
/// learns does, so micro-batches move them one after another, each normalised by itself.
#[derive(Clone, Debug)]
pub struct BatchNorm {
    scale: Tensor,
    shift: Tensor,
    running: Running,
}

impl BatchNorm {
    /// Build with `weight`, `bias`, `running_mean` and `running_var`, `[C]`.
    ///
    /// # Errors
    ///
    /// [`Error::Tensor`](crate::error::Error::Tensor) if the builder lacks one or has it in
    /// another shape.
    pub fn new(channels: usize, vb: VarBuilder) -> Result<Self> {
        let running = Running::new(channels, &vb)?;
        let get = |name: &str, start: Init| vb.get_with_hints(channels, name, start);
        Ok(Self { scale: get("weight", ONE)?, shift: get("bias", ZERO)?, running })
    }

    /// `relu(norm(x) + residual)`, both `[.., C]`.
    ///
    /// # Errors
    ///
    /// [`Error::Tensor`](crate::error::Error::Tensor) if shapes disagree.
    pub fn forward_relu(
        &self,
        x: &Tensor,
        residual: Option<&Tensor>,
        pass: &Pass,
    ) -> Result<Tensor> {
        let moments = if pass.learns() { None } else { Some(self.running.moments()?) };
        let norm = Norm { moments, eps: EPS, relu: true };
        let (out, moments) = batch_norm(x, &self.scale, &self.shift, residual, &norm)?;
        if pass.learns() {
            let mut running = self.running.moments()?;
            running.follow(&moments, x.elem_count() / self.scale.elem_count(), MOMENTUM);
            self.running.set(running)?;
        }
        Ok(out)
    }
}

/// Running mean and variance of a norm.
#[derive(Clone, Debug)]
pub struct Running {
    mean: Tensor,
    variance: Tensor,
}

impl Running {
    /// Take `running_mean` and `running_var`, `[C]`.
    ///
    /// # Errors
    ///
    /// [`Error::Tensor`](crate::error::Error::Tensor) if the builder lacks one or has it in
    /// another shape.
    pub fn new(channels: usize, vb: &VarBuilder) -> Result<Self> {
        let get = |name: &str, start: Init| vb.get_with_hints(channels, name, start);
        Ok(Self { mean: get("running_mean", ZERO)?, variance: get("running_var", ONE)? })
    }

    /// What they are now.
    ///
    /// # Errors
    ///
    /// [`Error::Tensor`](crate::error::Error::Tensor) if they are not f32 on the CPU.
    pub fn moments(&self) -> Result<Moments> {
        let numbers = Numbers::of([&self.mean, &self.variance])?;
        Ok(numbers.read(|slices| Moments { mean: slices[0].into(), variance: slices[1].into() }))
    }

    /// Write others in their place, for everyone who shares them.
    ///
    /// # Errors
    ///
    /// [`Error::Tensor`](crate::error::Error::Tensor) if they are not f32 on the CPU.
    pub fn set(&self, moments: Moments) -> Result<()> {
        self.mean.inplace_op1(&Write(moments.mean))?;
        Ok(self.variance.inplace_op1(&Write(moments.variance))?)
    }
}

/// Writes these numbers.
struct Write(Vec<f32>);

impl InplaceOp1 for Write {
    fn name(&self) -> &'static str {
        "write"
    }

    fn cpu_fwd(&self, storage: &mut CpuStorage, layout: &Layout) -> candle_core::Result<()> {
        match (storage, layout.contiguous_offsets()) {
            (CpuStorage::F32(numbers), Some((from, to))) if to - from == self.0.len() => {
                numbers[from..to].copy_from_slice(&self.0);
                Ok(())
            }
            _ => candle_core::bail!("statistics are f32, contiguous, one for each channel"),
        }
    }
}
