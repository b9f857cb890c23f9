//! The network of a run, whichever it is.

use candle_nn::VarBuilder;

use crate::{
    dataset::batch::Inputs,
    error::Result,
    model::{
        cil::Cil, describe::Layer, int::Int, net_config::NetConfig, output::Output, pass::Pass,
        pmp::Pmp,
    },
    policy::Senses,
};

/// One of the networks.
#[derive(Clone, Debug)]
pub enum Network {
    Pmp(Box<Pmp>),
    Cil(Cil),
    Int(Int),
}

impl Network {
    /// Build with the parameters of a builder.
    ///
    /// # Errors
    ///
    /// [`Error::Tensor`](crate::error::Error::Tensor) if the builder lacks a parameter or has it
    /// in another shape.
    pub fn new(cfg: &NetConfig, vb: VarBuilder) -> Result<Self> {
        Ok(match cfg {
            NetConfig::Pmp(cfg) => Network::Pmp(Box::new(Pmp::new(cfg, vb)?)),
            NetConfig::Cil(cfg) => Network::Cil(Cil::new(cfg, vb)?),
            NetConfig::Int(cfg) => Network::Int(Int::new(cfg, vb)?),
        })
    }

    /// Names of the branches, in the order of [`Output::attention`]; none without attention.
    pub fn branches(&self) -> Vec<&'static str> {
        match self {
            Network::Pmp(net) => net.branches(),
            Network::Cil(_) | Network::Int(_) => vec![],
        }
    }

    /// Whether it gives a mixture over future motion.
    pub fn plans_motion(&self) -> bool {
        matches!(self, Network::Pmp(_))
    }

    /// What the network looks at.
    pub fn senses(&self) -> Senses {
        match self {
            Network::Pmp(net) => net.senses(),
            Network::Cil(_) | Network::Int(_) => Senses { camera: true, ranging: false },
        }
    }

    /// The layers in the way of the data, for one frame.
    pub fn layers(&self) -> Vec<Layer> {
        match self {
            Network::Pmp(net) => net.layers(),
            Network::Cil(net) => net.layers(),
            Network::Int(net) => net.layers(),
        }
    }

    /// # Errors
    ///
    /// [`Error::Config`](crate::error::Error::Config) if the batch lacks a picture that the
    /// network has a branch for; [`Error::Tensor`](crate::error::Error::Tensor) if shapes
    /// disagree.
    pub fn forward(&self, inputs: &Inputs, pass: &Pass) -> Result<Output> {
        match self {
            Network::Pmp(net) => net.forward(inputs, pass),
            Network::Cil(net) => net.forward(inputs, pass),
            Network::Int(net) => net.forward(inputs, pass),
        }
    }
}
