//! Adam and AdamW whose state can be saved: moments by name, in name order.
//!
//! candle's own hides its moments, so a resumed run would not be the run that was stopped.

use std::collections::{BTreeMap, HashMap};

use candle_core::{Tensor, Var};

use crate::{
    error::{Error, Result},
    model::{gradient::Gradient, init::Weights},
};

/// Decay of the first and second moment, as everywhere (Kingma & Ba, 2015, arXiv:1412.6980).
const BETA: [f64; 2] = [0.9, 0.999];

/// Added to the root of the second moment, as everywhere.
const EPS: f64 = 1e-8;

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
    first: Tensor,
    second: Tensor,
}

impl Adam {
    /// No step taken, moments 0.
    ///
    /// # Errors
    ///
    /// [`Error::Tensor`] if memory runs out.
    pub fn new(weights: &Weights, weight_decay: f64) -> Result<Self> {
        let slot = |(name, var): (&str, &Var)| {
            let (first, second) = (var.zeros_like()?, var.zeros_like()?);
            Ok(Slot { name: name.into(), var: var.clone(), first, second })
        };
        Ok(Self {
            slots: weights.parameters().map(slot).collect::<Result<_>>()?,
            steps: 0,
            weight_decay,
        })
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
        let mut squares = vec![];
        for slot in &self.slots {
            let Some(grad) = gradient.get(&slot.name) else { continue };
            let square = f64::from(grad.sqr()?.sum_all()?.to_scalar::<f32>()?);
            if !square.is_finite() {
                let term = format!("gradient of {}", slot.name);
                return Err(Error::Diverged { step: self.steps + 1, term, frames: vec![] });
            }
            squares.push(square);
        }
        let norm = squares.iter().sum::<f64>().sqrt();
        let clipped = clip_norm > 0.0 && norm + 1e-6 > clip_norm;
        let scale = if clipped { clip_norm / (norm + 1e-6) } else { 1.0 };

        self.steps += 1;
        let [bias1, bias2] = BETA.map(|b| 1.0 - b.powf(self.steps as f64));
        for slot in &mut self.slots {
            let Some(grad) = gradient.get(&slot.name) else { continue };
            let grad = (grad.detach() * scale)?;
            slot.first = ((&slot.first * BETA[0])? + (&grad * (1.0 - BETA[0]))?)?;
            slot.second = ((&slot.second * BETA[1])? + (grad.sqr()? * (1.0 - BETA[1]))?)?;
            let size = ((slot.second.sqrt()? * (1.0 / bias2.sqrt()))? + EPS)?;
            let kept = (slot.var.as_detached_tensor() * (1.0 - lr * self.weight_decay))?;
            slot.var.set(&(kept - ((&slot.first / size)? * (lr / bias1))?)?)?;
        }
        Ok(norm)
    }

    /// Both moments: `first.NAME` and `second.NAME`.
    pub fn moments(&self) -> BTreeMap<String, Tensor> {
        let both = |slot: &Slot| {
            let first = (format!("first.{}", slot.name), slot.first.clone());
            [first, (format!("second.{}", slot.name), slot.second.clone())]
        };
        self.slots.iter().flat_map(both).collect()
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
                    Some(m) if m.dims() == slot.var.dims() => Ok(m.clone()),
                    _ => Err(candle_core::Error::msg(format!("no moment {name} that fits"))),
                }
            };
            (slot.first, slot.second) = (moment("first")?, moment("second")?);
        }
        self.steps = steps;
        Ok(())
    }
}
