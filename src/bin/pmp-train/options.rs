//! What a training is asked to be, on the command line.

use std::{
    fs,
    path::{Path, PathBuf},
    sync::Arc,
};

use candle_core::Device;
use clap::Args;
use pmp::{
    dataset::{
        loader::{TrainBatches, ValidationBatches},
        open::Dataset,
    },
    error::{Error, Result},
    model::{
        config::TrainConfig,
        device::Place,
        net_config::{Model, Part, Preset},
        train::Data,
    },
};

#[derive(Args)]
pub(crate) struct Options {
    /// Network to train [default: pmp]
    #[arg(long, value_name = "NAME", help_heading = "Configuration")]
    pub(crate) model: Option<Model>,

    /// Sizes to start from [default: tiny]
    #[arg(long, value_name = "NAME", help_heading = "Configuration")]
    pub(crate) preset: Option<Preset>,

    /// TOML file with what differs from the preset; the options below win over it
    #[arg(long, value_name = "FILE", help_heading = "Configuration")]
    pub(crate) config: Option<PathBuf>,

    /// Optimiser steps, in all [default: 3000, of the larger presets more]
    #[arg(long, value_name = "N", help_heading = "Configuration")]
    pub(crate) steps: Option<u64>,

    /// Seed of the weights and of the order of frames [default: 0]
    #[arg(long, value_name = "S", help_heading = "Configuration")]
    pub(crate) seed: Option<u64>,

    /// Frames per step [default: 32, of `paper` 90]
    #[arg(long, value_name = "N", help_heading = "Configuration")]
    pub(crate) batch_size: Option<usize>,

    /// Where to compute: auto, cpu, cuda or cuda:N [default: auto, a GPU if this program was built
    /// for one and it answers]
    #[arg(long, value_name = "WHERE", help_heading = "Configuration")]
    pub(crate) device: Option<Place>,

    /// Do without a part, to see what it is worth
    #[arg(long, value_name = "PART", value_delimiter = ',', help_heading = "Configuration")]
    pub(crate) disable: Vec<Part>,
}

impl Options {
    /// The configuration; where neither a file nor options say otherwise, that of a run which is
    /// to be continued.
    pub(crate) fn config(&self, saved: Option<TrainConfig>) -> Result<TrainConfig> {
        let mut config = match (&self.config, saved) {
            (Some(file), _) => {
                let text = fs::read_to_string(file).map_err(Error::io("read", file))?;
                TrainConfig::from_toml(&text, self.model, self.preset)?
            }
            (None, Some(saved)) if self.says_nothing_new(&saved) => saved,
            (None, _) => {
                TrainConfig::preset(self.model.unwrap_or_default(), self.preset.unwrap_or_default())
            }
        };
        config.steps = self.steps.unwrap_or(config.steps);
        config.seed = self.seed.unwrap_or(config.seed);
        config.batch_size = self.batch_size.unwrap_or(config.batch_size);
        config.device = self.device.unwrap_or(config.device);
        config.net.disable(&self.disable)?;
        config.validate()?;
        Ok(config)
    }

    /// Whether model and preset are those of a run, or not asked for.
    fn says_nothing_new(&self, saved: &TrainConfig) -> bool {
        self.model.is_none_or(|model| model == saved.model)
            && self.preset.is_none_or(|preset| preset == saved.preset)
    }
}

/// The batches of a dataset for a configuration.
pub(crate) fn open_data(path: &Path, config: &TrainConfig, device: &Device) -> Result<Data> {
    let dataset = Arc::new(Dataset::open(path)?);
    let size = config.net.input_size();
    let (batch_size, seed) = (config.batch_size, config.seed);
    let sampling = &config.sampling;
    let train = TrainBatches::new(dataset.clone(), size, batch_size, seed, sampling, device)?;
    if sampling.balance > 0.0 {
        eprint!("{}", train.balance.table());
    }
    let validation = ValidationBatches::new(dataset.clone(), size, device);
    Ok(Data {
        validation_batches: validation.count().min(config.eval_batches),
        train: Box::new(train),
        validation: Box::new(validation),
        identity: dataset.manifest.identity(),
    })
}

/// Threads for everything.
pub(crate) fn use_threads(jobs: Option<usize>) -> Result<()> {
    let Some(jobs) = jobs else { return Ok(()) };
    let wrong = |what: String| Error::Config { key: "--jobs".into(), what, hint: None };
    if jobs == 0 {
        return Err(wrong("at least 1 is needed".into()));
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(jobs).build_global();
    pool.map_err(|e| wrong(e.to_string()))
}
