//! Weights from a seed, kept in name order.
//!
//! candle's CPU generator cannot be seeded and its `VarMap` is a hash map, so both are ours. Each
//! parameter has its own stream, of the seed and its name: neither the order of construction nor
//! a branch more or less changes what another parameter starts from.

use std::{
    collections::{BTreeMap, HashMap},
    sync::{Arc, Mutex},
};

use candle_core::{DType, Device, Shape, Tensor, Var};
use candle_nn::{Init, VarBuilder, init::NonLinearity, var_builder::SimpleBackend};
use rand_chacha::{
    ChaCha8Rng,
    rand_core::{Rng as _, SeedableRng as _},
};
use sha2::{Digest as _, Sha256};

use crate::error::Result;

/// Kaiming-uniform over the fan-in (He et al., 2015, arXiv:1502.01852), for a layer followed by
/// `after`: outputs keep the variance of the inputs.
pub fn kaiming(after: NonLinearity) -> Init {
    Init::Kaiming {
        dist: candle_nn::init::NormalOrUniform::Uniform,
        fan: candle_nn::init::FanInOut::FanIn,
        non_linearity: after,
    }
}

/// The weights of a network by name: what is trained, and the running statistics of batch norms.
#[derive(Clone, Debug)]
pub struct Weights(BTreeMap<String, Var>);

impl Weights {
    /// Build a network with fresh parameters, all f32.
    ///
    /// `network` asks its builder for parameters with a hint of how to start: a constant or
    /// [`kaiming`].
    ///
    /// # Errors
    ///
    /// Those of `network`; [`Error::Tensor`](crate::error::Error::Tensor) for another hint.
    pub fn new<N>(
        seed: u64,
        device: &Device,
        network: impl FnOnce(VarBuilder) -> Result<N>,
    ) -> Result<(Self, N)> {
        let made = Arc::new(Mutex::new(BTreeMap::new()));
        let source = Seeded { seed, made: Arc::clone(&made) };
        let built = network(VarBuilder::from_backend(Box::new(source), DType::F32, device.clone()));
        let made = std::mem::take(&mut *made.lock().expect("no thread panicked holding it"));
        Ok((Self(made), built?))
    }

    /// All, in name order.
    pub fn iter(&self) -> impl Iterator<Item = (&str, &Var)> {
        self.0.iter().map(|(name, var)| (name.as_str(), var))
    }

    /// Those that a gradient moves, in name order.
    pub fn parameters(&self) -> impl Iterator<Item = (&str, &Var)> {
        self.iter().filter(|(name, _)| !is_statistic(name))
    }

    /// How many numbers a gradient moves.
    pub fn count(&self) -> usize {
        self.parameters().map(|(_, var)| var.elem_count()).sum()
    }

    /// The values of now, without a graph and not sharing memory with what is trained on.
    ///
    /// # Errors
    ///
    /// [`Error::Tensor`](crate::error::Error::Tensor) if memory runs out.
    pub fn snapshot(&self) -> Result<BTreeMap<String, Tensor>> {
        let copy =
            |(name, var): (&String, &Var)| Ok((name.clone(), var.as_detached_tensor().copy()?));
        self.0.iter().map(copy).collect()
    }

    /// Set every parameter.
    ///
    /// # Errors
    ///
    /// [`Error::Tensor`](crate::error::Error::Tensor) naming a parameter that is missing, unknown
    /// or of another shape.
    pub fn set(&self, values: &HashMap<String, Tensor>) -> Result<()> {
        for (name, var) in &self.0 {
            let Some(value) = values.get(name) else {
                return Err(candle_core::Error::msg(format!("no parameter {name}")).into());
            };
            var.set(value).map_err(|e| e.context(format!("parameter {name}")))?;
        }
        match values.keys().filter(|name| !self.0.contains_key(*name)).min() {
            Some(name) => Err(candle_core::Error::msg(format!("unknown parameter {name}")).into()),
            None => Ok(()),
        }
    }
}

/// Whether a weight is a running statistic of a batch norm, by torchvision's name.
fn is_statistic(name: &str) -> bool {
    let last = name.rsplit('.').next();
    matches!(last, Some("running_mean" | "running_var"))
}

/// Makes each parameter when the network first asks for it.
struct Seeded {
    seed: u64,
    made: Arc<Mutex<BTreeMap<String, Var>>>,
}

impl SimpleBackend for Seeded {
    fn get(
        &self,
        shape: Shape,
        name: &str,
        hint: Init,
        _dtype: DType,
        device: &Device,
    ) -> candle_core::Result<Tensor> {
        let bound = match hint {
            Init::Const(_) => 0.0,
            Init::Kaiming { fan, non_linearity, .. } => {
                non_linearity.gain() * (3.0 / fan.for_shape(&shape) as f64).sqrt()
            }
            other => candle_core::bail!("{name}: no seeded start of kind {other:?}"),
        };
        let centre = if let Init::Const(value) = hint { value } else { 0.0 };
        let key = Sha256::new().chain_update(self.seed.to_le_bytes()).chain_update(name).finalize();
        let mut rng = ChaCha8Rng::from_seed(key.into());
        let mut draw = || {
            let unit = f64::from(rng.next_u32()) / f64::from(u32::MAX);
            (centre + bound * (2.0 * unit - 1.0)) as f32
        };
        let values: Vec<f32> = (0..shape.elem_count()).map(|_| draw()).collect();
        let var = Var::from_vec(values, shape, device)?;
        let tensor = var.as_tensor().clone();
        self.made.lock().expect("no thread panicked holding it").insert(name.into(), var);
        Ok(tensor)
    }

    fn get_unchecked(&self, name: &str, _: DType, _: &Device) -> candle_core::Result<Tensor> {
        candle_core::bail!("{name}: a fresh parameter needs a shape")
    }

    fn contains_tensor(&self, _name: &str) -> bool {
        true
    }
}
