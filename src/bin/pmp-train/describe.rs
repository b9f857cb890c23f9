//! `pmp-train --describe`: what a network is, without training it.

use candle_core::Device;
use pmp::{
    cli::{self, Outcome},
    error::Result,
    model::{describe, init::Weights, network::Network},
};

use crate::options::Options;

pub(crate) fn run(options: &Options) -> Result<Outcome> {
    let config = options.config(None)?;
    let (_, net) = Weights::new(0, &Device::Cpu, |vb| Network::new(&config.net, vb))?;
    cli::print(&describe::table(&net.layers()))?;
    Ok(Outcome::Done)
}
