//! Adam and AdamW whose state can be saved: moments by name, in name order.
//!
//! candle's own hides its moments, so a resumed run would not be the run that was stopped.

use std::{
    cell::RefCell,
    collections::{BTreeMap, HashMap},
};

use candle_core::{CpuStorage, Device, InplaceOp2, Layout, Storage, Tensor, Var};
use pmp_kernels::adam::{Step, sum_of_squares};

use crate::{
    error::{Error, Result},
    model::{gradient::Gradient, init::Weights},
};

/// AdamW (Loshchilov & Hutter, 2019, arXiv:1711.05101) as PyTorch has it, with clipping of the
/// global norm; without decay it is Adam.
#[derive(Debug)]
pub struct Adam {
    slots: Vec<Slot>,
    steps: u64,
    weight_decay: f64,
}

#[derive(Debug)]
struct Slot {
    name: String,
    var: Var,
    first: Vec<f32>,
    second: Vec<f32>,
}

impl Adam {
    /// No step taken, moments 0.
    pub fn new(weights: &Weights, weight_decay: f64) -> Self {
        let slot = |(name, var): (&str, &Var)| {
            let zeros = || vec![0.0; var.elem_count()];
            Slot { name: name.into(), var: var.clone(), first: zeros(), second: zeros() }
        };
        Self { slots: weights.parameters().map(slot).collect(), steps: 0, weight_decay }
    }

    /// Steps taken.
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// Move the weights against the gradient, scaled down to `clip_norm` where its global L2 norm
    /// is larger and `clip_norm` is not 0; returns the norm before that. A parameter without a
    /// gradient, on which the loss does not depend, stays as it is.
    ///
    /// # Errors
    ///
    /// [`Error::Diverged`] naming the first parameter whose gradient is not finite, before
    /// anything is changed; [`Error::Tensor`] if memory runs out.
    pub fn step(&mut self, gradient: &Gradient, lr: f64, clip_norm: f64) -> Result<f64> {
        let mut squares = 0.0;
        for slot in &self.slots {
            let Some(grad) = gradient.get(&slot.name) else { continue };
            let its = sum_over(grad)?;
            if !its.is_finite() {
                let term = format!("gradient of {}", slot.name);
                return Err(Error::Diverged { step: self.steps + 1, term, frames: vec![] });
            }
            squares += its;
        }
        let norm = squares.sqrt();
        let clipped = clip_norm > 0.0 && norm + 1e-6 > clip_norm;
        let grad_scale = if clipped { clip_norm / (norm + 1e-6) } else { 1.0 };

        self.steps += 1;
        let (number, weight_decay) = (self.steps, self.weight_decay);
        let step =
            Step { number, lr, weight_decay, decoupled: true, grad_scale, ..Step::default() };
        for slot in &mut self.slots {
            let Some(grad) = gradient.get(&slot.name) else { continue };
            let moments = RefCell::new((&mut slot.first[..], &mut slot.second[..]));
            slot.var.inplace_op2(&grad.contiguous()?, &Move { step, moments })?;
        }
        Ok(norm)
    }

    /// Both moments: `first.NAME` and `second.NAME`.
    ///
    /// # Errors
    ///
    /// [`Error::Tensor`] if memory runs out.
    pub fn moments(&self) -> Result<BTreeMap<String, Tensor>> {
        let mut moments = BTreeMap::new();
        for slot in &self.slots {
            for (which, values) in [("first", &slot.first), ("second", &slot.second)] {
                let tensor = Tensor::from_slice(values, slot.var.shape(), &Device::Cpu)?;
                moments.insert(format!("{which}.{}", slot.name), tensor);
            }
        }
        Ok(moments)
    }

    /// Continue after `steps` steps with their moments.
    ///
    /// # Errors
    ///
    /// [`Error::Tensor`] naming a moment that is missing or of another shape.
    pub fn restore(&mut self, steps: u64, moments: &HashMap<String, Tensor>) -> Result<()> {
        for slot in &mut self.slots {
            let moment = |which: &str| {
                let name = format!("{which}.{}", slot.name);
                match moments.get(&name) {
                    Some(m) if m.dims() == slot.var.dims() => m.flatten_all()?.to_vec1::<f32>(),
                    _ => Err(candle_core::Error::msg(format!("no moment {name} that fits"))),
                }
            };
            (slot.first, slot.second) = (moment("first")?, moment("second")?);
        }
        self.steps = steps;
        Ok(())
    }
}

/// One parameter's share of a step, in place.
struct Move<'m> {
    step: Step,
    /// First and second; candle hands out a shared reference to the operation.
    moments: RefCell<(&'m mut [f32], &'m mut [f32])>,
}

impl InplaceOp2 for Move<'_> {
    fn name(&self) -> &'static str {
        "adam"
    }

    fn cpu_fwd(
        &self,
        weights: &mut CpuStorage,
        at: &Layout,
        grad: &CpuStorage,
        grad_at: &Layout,
    ) -> candle_core::Result<()> {
        let (Some(at), Some(grad_at)) = (at.contiguous_offsets(), grad_at.contiguous_offsets())
        else {
            candle_core::bail!("adam: weights and gradients have to be contiguous")
        };
        let (CpuStorage::F32(weights), CpuStorage::F32(grad)) = (weights, grad) else {
            candle_core::bail!("adam: weights and gradients have to be f32")
        };
        let (first, second) = &mut *self.moments.borrow_mut();
        self.step.take(&mut weights[at.0..at.1], &grad[grad_at.0..grad_at.1], first, second);
        Ok(())
    }
}

/// The sum of the squares of a gradient on the CPU.
fn sum_over(grad: &Tensor) -> Result<f64> {
    let grad = grad.contiguous()?;
    let (storage, layout) = grad.storage_and_layout();
    match (&*storage, layout.contiguous_offsets()) {
        (Storage::Cpu(CpuStorage::F32(numbers)), Some((from, to))) => {
            Ok(sum_of_squares(&numbers[from..to]))
        }
        _ => Err(candle_core::Error::msg("adam: gradients have to be f32 on the CPU").into()),
    }
}
