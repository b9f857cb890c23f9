//! A batch norm with its weights and running statistics, by torchvision's names.

use candle_core::Tensor;
use candle_nn::{
    Init, VarBuilder,
    init::{ONE, ZERO},
};
use pmp_kernels::norm::Moments;

use crate::{
    error::Result,
    model::{
        ops::{Norm, batch_norm, is_for_kernels, moments_of, tensors_of},
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
        self.running.normalise(x, [&self.scale, &self.shift], residual, true, pass)
    }
}

/// Running mean and variance of a norm, `[C]` each.
#[derive(Clone, Debug)]
pub struct Running([Tensor; 2]);

impl Running {
    /// Take `running_mean` and `running_var`, `[C]`.
    ///
    /// # Errors
    ///
    /// [`Error::Tensor`](crate::error::Error::Tensor) if the builder lacks one or has it in
    /// another shape.
    pub fn new(channels: usize, vb: &VarBuilder) -> Result<Self> {
        let get = |name: &str, start: Init| vb.get_with_hints(channels, name, start);
        Ok(Self([get("running_mean", ZERO)?, get("running_var", ONE)?]))
    }

    /// `norm(x) + residual`, both `[.., C]`, and a ReLU if `relu`; `scale` and `shift` are `[C]`. A
    /// pass that learns normalises by the batch and moves these towards it.
    ///
    /// # Errors
    ///
    /// [`Error::Tensor`](crate::error::Error::Tensor) if shapes disagree.
    pub fn normalise(
        &self,
        x: &Tensor,
        [scale, shift]: [&Tensor; 2],
        residual: Option<&Tensor>,
        relu: bool,
        pass: &Pass,
    ) -> Result<Tensor> {
        let moments = (!pass.learns()).then(|| self.0.clone());
        let norm = Norm { moments, eps: EPS, relu };
        let (out, moments) = batch_norm(x, scale, shift, residual, &norm)?;
        if pass.learns() {
            self.follow(&moments, x.elem_count() / scale.elem_count())?;
        }
        Ok(out)
    }

    /// What they are now.
    ///
    /// # Errors
    ///
    /// [`Error::Tensor`](crate::error::Error::Tensor) if they are not f32 on the CPU.
    pub fn moments(&self) -> Result<Moments> {
        moments_of(&self.0)
    }

    /// Write others in their place, for everyone who shares them.
    ///
    /// # Errors
    ///
    /// [`Error::Tensor`](crate::error::Error::Tensor) if they are of other sizes or devices.
    pub fn set(&self, moments: &[Tensor; 2]) -> Result<()> {
        for (kept, new) in self.0.iter().zip(moments) {
            kept.slice_set(new, 0, 0)?;
        }
        Ok(())
    }

    /// Move towards the moments of a batch of `pixels`.
    fn follow(&self, batch: &[Tensor; 2], pixels: usize) -> Result<()> {
        if self.0.iter().chain(batch).all(is_for_kernels) {
            let mut running = self.moments()?;
            running.follow(&moments_of(batch)?, pixels, MOMENTUM);
            return self.set(&tensors_of(&running)?);
        }
        let unbiased = pixels as f64 / (pixels as f64 - 1.0).max(1.0);
        let moved = |kept: &Tensor, new: &Tensor, factor: f64| {
            (kept * (1.0 - MOMENTUM))? + (new.to_dtype(kept.dtype())? * (MOMENTUM * factor))?
        };
        let [mean, variance] = &self.0;
        self.set(&[moved(mean, &batch[0], 1.0)?, moved(variance, &batch[1], unbiased)?])
    }
}
