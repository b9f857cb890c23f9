//! A moving average of the weights, which judges steadier than the weights themselves.

use std::collections::{BTreeMap, HashMap};

use candle_core::Tensor;

use crate::{error::Result, model::init::Weights};

/// Exponential moving average of every weight.
///
/// After n steps the decay is at most (1 + n) / (10 + n), so that the start, which is noise, is
/// forgotten soon (as TensorFlow's `ExponentialMovingAverage` has it).
#[derive(Debug)]
pub struct Average {
    decay: f64,
    values: BTreeMap<String, Tensor>,
}

impl Average {
    /// The weights as they are, to begin with.
    ///
    /// # Errors
    ///
    /// [`Error::Tensor`](crate::error::Error::Tensor) if memory runs out.
    pub fn new(decay: f64, weights: &Weights) -> Result<Self> {
        Ok(Self { decay, values: weights.snapshot()? })
    }

    /// Move towards the weights after a step, `steps` with it.
    ///
    /// # Errors
    ///
    /// [`Error::Tensor`](crate::error::Error::Tensor) if memory runs out.
    pub fn follow(&mut self, weights: &Weights, steps: u64) -> Result<()> {
        let decay = self.decay.min((1.0 + steps as f64) / (10.0 + steps as f64));
        for (name, var) in weights.iter() {
            let Some(value) = self.values.get_mut(name) else { continue };
            let now = var.as_detached_tensor();
            *value = ((&*value * decay)? + (now * (1.0 - decay))?)?;
        }
        Ok(())
    }

    /// The average of now, by name.
    pub fn values(&self) -> BTreeMap<String, Tensor> {
        self.values.clone()
    }

    /// Continue from saved values.
    ///
    /// # Errors
    ///
    /// [`Error::Tensor`](crate::error::Error::Tensor) naming a value that is missing or of another
    /// shape.
    pub fn restore(&mut self, saved: &HashMap<String, Tensor>) -> Result<()> {
        for (name, value) in &mut self.values {
            match saved.get(name) {
                Some(saved) if saved.dims() == value.dims() => *value = saved.clone(),
                _ => {
                    let what = format!("no average {name} that fits");
                    return Err(candle_core::Error::msg(what).into());
                }
            }
        }
        Ok(())
    }
}
