//! The training loop: state is (weights, moments, step), the rest is a function of the step.
//!
//! [`train`] is the loop and tells what happens through [`Event`]; it does not print, write or
//! draw. [`train_run`] is the loop on a run directory, and what `pmp-train` calls.

use std::path::Path;

use candle_core::{DType, Device};
use candle_nn::VarBuilder;
use serde::Serialize;

use crate::{
    dataset::batch::Batches,
    error::{Error, Result},
    model::{
        adam::AdamW,
        config::TrainConfig,
        init::Weights,
        loss::{LossSums, LossWeights, Tally, Terms},
        pmp::Pmp,
        run::{Checkpoint, RunDir},
    },
};

/// Everything that changes while training.
#[derive(Debug)]
pub struct State {
    pub net: Pmp,
    pub weights: Weights,
    pub adam: AdamW,
}

/// What to train on.
pub struct Data {
    pub train: Box<dyn Batches>,
    /// Never trained on; its first `validation_batches` are looked at, none if that is 0.
    pub validation: Box<dyn Batches>,
    pub validation_batches: u64,
    /// Says which dataset it is, the same for the same content.
    pub identity: String,
}

/// What the loop tells the outside.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// Before anything else: the step it starts from and the number of parameters.
    Started {
        step: u64,
        parameters: usize,
    },
    /// After every step; `log` on those that belong into the curves.
    Trained {
        line: TrainLine,
        log: bool,
    },
    Validated(ValidationLine),
    /// The state is to be saved; from [`train_run`]: has been saved.
    Checkpoint {
        step: u64,
    },
}

/// A step: the loss of its batch before the weights were moved, as in `metrics.jsonl`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TrainLine {
    /// Steps taken, with this one.
    pub step: u64,
    /// `train`.
    pub split: &'static str,
    #[serde(flatten)]
    pub terms: Terms,
    pub lr: f64,
    /// Global L2 norm of the gradient, before clipping.
    pub grad_norm: f64,
}

/// A validation: the loss over all of its frames, as in `metrics.jsonl`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ValidationLine {
    /// Steps taken.
    pub step: u64,
    /// `val`.
    pub split: &'static str,
    #[serde(flatten)]
    pub terms: Terms,
}

impl State {
    /// Fresh weights from the configuration's seed, no step taken.
    ///
    /// # Errors
    ///
    /// [`Error::Tensor`] if memory runs out.
    pub fn new(cfg: &TrainConfig, device: &Device) -> Result<Self> {
        let (weights, net) = Weights::new(cfg.seed, device, |vb| Pmp::new(&cfg.net, vb))?;
        let adam = AdamW::new(&weights, cfg.weight_decay)?;
        Ok(Self { net, weights, adam })
    }

    /// Continue from a checkpoint.
    ///
    /// # Errors
    ///
    /// [`Error::Tensor`] naming a tensor that does not fit the network.
    pub fn restore(&mut self, checkpoint: &Checkpoint) -> Result<()> {
        self.weights.set(&checkpoint.weights)?;
        self.adam.restore(checkpoint.step, &checkpoint.moments)
    }
}

/// Train up to `cfg.steps`, from wherever `state` stands.
///
/// # Errors
///
/// [`Error::Diverged`] naming step and term, at the first loss or gradient that is not finite;
/// those of the batches and of `on`.
pub fn train(
    cfg: &TrainConfig,
    state: &mut State,
    data: &mut Data,
    on: &mut dyn FnMut(&State, Event) -> Result<()>,
) -> Result<()> {
    let weights = LossWeights::from(cfg);
    let due = |every: u64, step: u64| step == cfg.steps || step.is_multiple_of(every);

    while state.adam.steps() < cfg.steps {
        let before = state.adam.steps();
        let (lr, step) = (cfg.lr_at(before), before + 1);
        let batch = data.train.batch(before)?;

        let sums = LossSums::new(&state.net.forward(&batch.inputs)?, &batch.targets)?;
        let terms = sums.read()?.terms(&weights);
        if let Some(term) = terms.broken() {
            return Err(Error::Diverged { step, term: term.into() });
        }
        let gradient = sums.total(&weights)?.backward()?;
        let grad_norm = state.adam.step(&gradient, lr, cfg.clip_norm)?;
        drop((sums, gradient)); // the graph of this step, before that of the next is built

        let line = TrainLine { step, split: "train", terms, lr, grad_norm };
        on(state, Event::Trained { line, log: due(cfg.log_every, step) })?;
        if data.validation_batches > 0 && due(cfg.eval_every, step) {
            on(state, Event::Validated(validate(cfg, state, data)?))?;
        }
        if due(cfg.save_every, step) {
            on(state, Event::Checkpoint { step })?;
        }
    }
    Ok(())
}

/// The loss over the validation batches, on a copy of the weights that keeps no graph.
///
/// # Errors
///
/// [`Error::Diverged`] if it is not finite; those of the batches.
pub fn validate(cfg: &TrainConfig, state: &State, data: &mut Data) -> Result<ValidationLine> {
    let frozen = state.weights.snapshot()?.into_iter().collect();
    let device = data.validation.batch(0)?.inputs.velocity.device().clone();
    let net = Pmp::new(&cfg.net, VarBuilder::from_tensors(frozen, DType::F32, &device))?;
    let mut tally = Tally::default();
    for i in 0..data.validation_batches {
        let batch = data.validation.batch(i)?;
        tally.add(&LossSums::new(&net.forward(&batch.inputs)?, &batch.targets)?.read()?);
    }
    let (step, terms) = (state.adam.steps(), tally.terms(&LossWeights::from(cfg)));
    match terms.broken() {
        Some(term) => Err(Error::Diverged { step, term: format!("validation {term}") }),
        None => Ok(ValidationLine { step, split: "val", terms }),
    }
}

/// Train on a run directory: start it, or with `resume` continue it from its last checkpoint.
///
/// The same configuration and data end in the same files, however often the run was stopped.
///
/// # Errors
///
/// Those of [`RunDir::open`] and [`train`]; the run then stands at its last checkpoint.
pub fn train_run(
    cfg: &TrainConfig,
    out: &Path,
    resume: bool,
    data: &mut Data,
    device: &Device,
    on: &mut dyn FnMut(&Event) -> Result<()>,
) -> Result<()> {
    cfg.validate()?;
    let (mut dir, checkpoint) = RunDir::open(out, cfg, &data.identity, resume, device)?;
    let cfg = dir.config().clone();
    let mut state = State::new(&cfg, device)?;
    if let Some(checkpoint) = checkpoint {
        state.restore(&checkpoint)?;
    }
    on(&Event::Started { step: state.adam.steps(), parameters: state.weights.count() })?;
    train(&cfg, &mut state, data, &mut |state, event| {
        match &event {
            Event::Trained { line, log: true } => dir.append(line)?,
            Event::Validated(line) => dir.append(line)?,
            Event::Checkpoint { step } => {
                dir.commit(*step, &state.weights.snapshot()?, &state.adam.moments())?;
            }
            Event::Started { .. } | Event::Trained { log: false, .. } => {}
        }
        on(&event)
    })
}
