//! Adam and AdamW whose state can be saved: moments by name, in name order.
//!
//! candle's own hides its moments, so a resumed run would not be the run that was stopped.

use std::collections::{BTreeMap, HashMap};

use candle_core::{Tensor, Var};

use crate::{
    error::{Error, Result},
    model::{
        gradient::Gradient,
        init::Weights,
        ops::adam::{Moments, Step, adam_step, sums_of_squares},
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
    ///
    /// # Errors
    ///
    /// [`Error::Tensor`] if memory runs out.
    pub fn new(weights: &Weights, weight_decay: f64) -> Result<Self> {
        let slot = |(name, var): (&str, &Var)| {
            Ok(Slot { name: name.into(), var: var.clone(), moments: Moments::zeros(var)? })
        };
        let slots = weights.parameters().map(slot).collect::<Result<_>>()?;
        Ok(Self { slots, steps: 0, weight_decay })
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
        let names = self.slots.iter().map(|slot| slot.name.as_str());
        let with_gradient = names.filter_map(|name| Some((name, gradient.get(name)?)));
        let (names, grads): (Vec<_>, Vec<_>) = with_gradient.unzip();
        let squares = sums_of_squares(&grads)?;
        if let Some(i) = squares.iter().position(|squares| !squares.is_finite()) {
            let term = format!("gradient of {}", names[i]);
            return Err(Error::Diverged { step: self.steps + 1, term, frames: vec![] });
        }
        let norm = squares.iter().sum::<f64>().sqrt();
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
            let both = slot.moments.tensors(&slot.var)?;
            for (which, tensor) in ["first", "second"].into_iter().zip(both) {
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
                let fits = moments.get(&name).filter(|moment| moment.dims() == slot.var.dims());
                let none = || candle_core::Error::msg(format!("no moment {name} that fits"));
                fits.ok_or_else(none)
            };
            slot.moments = Moments::of(&slot.var, [moment("first")?, moment("second")?])?;
        }
        self.steps = steps;
        Ok(())
    }
}
