//! Fully connected layers `fc0`, `fc1`, ..., a ReLU between them.

use candle_core::Tensor;
use candle_nn::{
    Linear, Module as _, VarBuilder,
    init::{NonLinearity, ZERO},
};

use crate::{
    error::Result,
    model::{describe::Layer, init::kaiming, pass::Pass},
};

/// Layers of the widths of `sizes`, first the input's.
#[derive(Clone, Debug)]
pub struct Dense {
    layers: Vec<Linear>,
    name: String,
    /// Share of the numbers between two layers that a training pass drops.
    dropout: f64,
}

impl Dense {
    /// Layers from `sizes[0]` numbers to `sizes.last()`; `last` is what the caller does to the
    /// output, and what the last layer starts for.
    ///
    /// # Errors
    ///
    /// [`Error::Tensor`](crate::error::Error::Tensor) if the builder lacks a parameter or has it
    /// in another shape.
    pub fn new(sizes: &[usize], last: NonLinearity, vb: VarBuilder) -> Result<Self> {
        let mut layers = vec![];
        for (i, pair) in sizes.windows(2).enumerate() {
            let after = if i + 2 < sizes.len() { NonLinearity::ReLU } else { last };
            let vb = vb.pp(format!("fc{i}"));
            let weight = vb.get_with_hints((pair[1], pair[0]), "weight", kaiming(after))?;
            let bias = vb.get_with_hints(pair[1], "bias", ZERO)?;
            layers.push(Linear::new(weight, Some(bias)));
        }
        Ok(Self { layers, name: vb.prefix(), dropout: 0.0 })
    }

    /// The same layers, dropping numbers after each ReLU between them while they learn.
    pub fn with_dropout(self, share: f64) -> Self {
        Self { dropout: share, ..self }
    }

    /// `[B, sizes[0]]` to `[B, sizes.last()]`, nothing after the last layer.
    ///
    /// # Errors
    ///
    /// [`Error::Tensor`](crate::error::Error::Tensor) if shapes disagree.
    pub fn forward(&self, x: &Tensor, pass: &Pass) -> Result<Tensor> {
        let mut x = x.clone();
        for (i, layer) in self.layers.iter().enumerate() {
            if i > 0 {
                x = pass.dropout(&x.relu()?, self.dropout, &format!("{}.{i}", self.name))?;
            }
            x = layer.forward(&x)?;
        }
        Ok(x)
    }

    /// The layers, for one frame.
    pub fn layers(&self) -> Vec<Layer> {
        let sizes = self.layers.iter().map(|layer| layer.weight().dims());
        let layer = |(i, size): (usize, &[usize])| {
            Layer::dense(format!("{}.fc{i}", self.name), size[1], size[0])
        };
        sizes.enumerate().map(layer).collect()
    }
}
