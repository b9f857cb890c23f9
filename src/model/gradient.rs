//! The gradient of a step: by parameter name, summed over the step's micro-batches.

use std::collections::BTreeMap;

use candle_core::{Tensor, backprop::GradStore};

use crate::{error::Result, model::init::Weights};

/// A gradient for every parameter that had one.
#[derive(Clone, Debug, Default)]
pub struct Gradient(BTreeMap<String, Tensor>);

impl Gradient {
    /// Add that of a micro-batch.
    ///
    /// # Errors
    ///
    /// [`Error::Tensor`](crate::error::Error::Tensor) if memory runs out.
    pub fn add(&mut self, weights: &Weights, mut grads: GradStore) -> Result<()> {
        for (name, var) in weights.parameters() {
            let Some(grad) = grads.remove(var.as_tensor()) else { continue };
            let sum = match self.0.remove(name) {
                Some(others) => (others + grad)?,
                None => grad,
            };
            self.0.insert(name.to_string(), sum);
        }
        Ok(())
    }

    /// That of a parameter; `None` if the loss does not depend on it.
    pub fn get(&self, name: &str) -> Option<&Tensor> {
        self.0.get(name)
    }
}
