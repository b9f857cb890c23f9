//! One pass through a network: whether it learns, and what chance does in it.

use candle_core::{DType, Tensor};
use rand_chacha::{
    ChaCha8Rng,
    rand_core::{Rng as _, SeedableRng as _},
};
use sha2::{Digest as _, Sha256};

use crate::error::Result;

/// How a network is run. What chance does is a function of what is named here, so that a resumed
/// training drops what an uninterrupted one would have dropped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pass {
    /// It drives or is judged: nothing is dropped, running statistics normalise.
    Judge,
    /// It learns: numbers are dropped, the statistics of the batch normalise.
    Learn {
        seed: u64,
        /// Optimiser steps taken.
        step: u64,
        /// Which of the step's micro-batches.
        part: u64,
        /// Type of the encoders' activations; `None` for that of their pictures.
        activations: Option<DType>,
    },
}

impl Pass {
    pub fn learns(&self) -> bool {
        matches!(self, Pass::Learn { .. })
    }

    /// The type of the encoders' activations; `None` for that of their pictures.
    pub fn activations(&self) -> Option<DType> {
        match self {
            Pass::Judge => None,
            Pass::Learn { activations, .. } => *activations,
        }
    }

    /// Set a share of the numbers to 0 and scale up the others, so that the mean stays (Srivastava
    /// et al., 2014); any shape to the same shape. `layer` names the place in the network. Nothing
    /// is dropped while the network is judged.
    ///
    /// # Errors
    ///
    /// [`Error::Tensor`](crate::error::Error::Tensor) if memory runs out.
    pub fn dropout(&self, x: &Tensor, share: f64, layer: &str) -> Result<Tensor> {
        let &Pass::Learn { seed, step, part, .. } = self else { return Ok(x.clone()) };
        if share == 0.0 {
            return Ok(x.clone());
        }
        let key = [seed, step, part].map(u64::to_le_bytes).concat();
        let key = Sha256::new().chain_update(key).chain_update(layer).finalize();
        let mut rng = ChaCha8Rng::from_seed(key.into());
        let kept = (1.0 / (1.0 - share)) as f32;
        let mut draw = || match f64::from(rng.next_u32()) < share * f64::from(u32::MAX) {
            true => 0.0,
            false => kept,
        };
        let mask: Vec<f32> = (0..x.elem_count()).map(|_| draw()).collect();
        let mask = Tensor::from_vec(mask, x.shape(), x.device())?.to_dtype(x.dtype())?;
        Ok((x * mask)?)
    }
}
