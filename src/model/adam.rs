//! Adam and AdamW whose state can be saved: moments by name, in name order.
//!
//! candle's own hides its moments, so a resumed run would not be the run that was stopped.

use std::collections::{BTreeMap, HashMap};

use candle_core::{Device, Tensor, Var};

use crate::{
    error::{Error, Result},
    model::{
        gradient::Gradient,
        init::Weights,
        ops::adam::{Moments, Step, adam_step, sum_of_squares},
    },
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
    moments: Moments,
}

impl Adam {
    /// No step taken, moments 0.
    pub fn new(weights: &Weights, weight_decay: f64) -> Self {
        let slot = |(name, var): (&str, &Var)| {
            let moments = Moments::zeros(var.elem_count());
            Slot { name: name.into(), var: var.clone(), moments }
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
            let its = sum_of_squares(grad)?;
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
            adam_step(&slot.var, grad, &mut slot.moments, &step)?;
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
            let Moments { first, second } = &slot.moments;
            for (which, values) in [("first", first), ("second", second)] {
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
            slot.moments = Moments { first: moment("first")?, second: moment("second")? };
        }
        self.steps = steps;
        Ok(())
    }
}
