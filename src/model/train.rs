//! The training loop: state is (weights, moments, step), the rest is a function of the step.
//!
//! [`train`] is the loop and tells what happens through [`Event`]; it does not print, write or
//! draw. [`train_run`] is the loop on a run directory, and what `pmp-train` calls.

use std::path::Path;

use candle_core::{DType, Device};
use candle_nn::VarBuilder;

use crate::{
    dataset::batch::{Batch, Batches},
    error::{Error, Result},
    model::{
        adam::Adam,
        average::Average,
        config::{Optimizer, TrainConfig},
        gradient::Gradient,
        init::Weights,
        loss::{Known, LossSums, Tally, Terms},
        metrics::{Side, TrainLine, ValidationLine},
        network::Network,
        ops::gradients::backward,
        pass::Pass,
        pretrained,
        run::{Best, Checkpoint, Progress, RunDir, Snapshot},
    },
};

/// Everything that changes while training.
#[derive(Debug)]
pub struct State {
    pub net: Network,
    pub weights: Weights,
    pub adam: Adam,
    /// Of the weights; `None` where the configuration has none.
    pub average: Option<Average>,
    pub progress: Progress,
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
    Started { step: u64, parameters: usize },
    /// After every step; `log` on those that belong into the curves.
    Trained { line: TrainLine, log: bool },
    /// After a validation; `best` if none before was better.
    Validated { line: ValidationLine, best: bool },
    /// The state is to be saved; from [`train_run`]: has been saved.
    Checkpoint { step: u64 },
    /// No validation improved for as long as the configuration waits.
    StoppedEarly { step: u64 },
}

impl State {
    /// Fresh weights from the configuration's seed, or pretrained ones where it names them, no
    /// step taken.
    ///
    /// # Errors
    ///
    /// [`Error::Tensor`] if memory runs out; those of [`pretrained::load`].
    pub fn new(cfg: &TrainConfig, device: &Device) -> Result<Self> {
        let (weights, net) = Weights::new(cfg.seed, device, |vb| Network::new(&cfg.net, vb))?;
        if cfg.pretrained != Path::new("") {
            pretrained::load(&cfg.pretrained, &weights)?;
        }
        let weight_decay = match cfg.optimizer {
            Optimizer::Adam => 0.0,
            Optimizer::Adamw => cfg.weight_decay,
        };
        let adam = Adam::new(&weights, weight_decay)?;
        let average = (cfg.ema > 0.0).then(|| Average::new(cfg.ema, &weights)).transpose()?;
        Ok(Self { net, weights, adam, average, progress: Progress::default() })
    }

    /// Continue from a checkpoint.
    ///
    /// # Errors
    ///
    /// [`Error::Tensor`] naming a tensor that does not fit the network.
    pub fn restore(&mut self, checkpoint: &Checkpoint) -> Result<()> {
        self.weights.set(&checkpoint.weights)?;
        if let (Some(average), Some(saved)) = (&mut self.average, &checkpoint.average) {
            average.restore(saved)?;
        }
        self.progress = checkpoint.progress.clone();
        self.adam.restore(checkpoint.step, &checkpoint.moments)
    }

    /// What a checkpoint holds.
    ///
    /// # Errors
    ///
    /// [`Error::Tensor`] if memory runs out.
    pub fn snapshot(&self) -> Result<Snapshot> {
        Ok(Snapshot {
            step: self.adam.steps(),
            weights: self.weights.snapshot()?,
            average: self.average.as_ref().map(Average::values),
            moments: self.adam.moments()?,
            progress: self.progress.clone(),
        })
    }
}

/// Train up to `cfg.steps`, from wherever `state` stands.
///
/// # Errors
///
/// [`Error::Diverged`] naming step, term and frames, at the first loss or gradient that is not
/// finite; those of the batches and of `on`.
pub fn train(
    cfg: &TrainConfig,
    state: &mut State,
    data: &mut Data,
    on: &mut dyn FnMut(&State, Event) -> Result<()>,
) -> Result<()> {
    let due = |every: u64, step: u64| step == cfg.steps || step.is_multiple_of(every);

    while state.adam.steps() < cfg.steps && !state.progress.stopped_early {
        let before = state.adam.steps();
        let (lr, step) = (cfg.lr_at(before), before + 1);
        let batch = data.train.batch(before)?;

        let (terms, gradient) = descend(cfg, state, &batch)?;
        let moved = state.adam.step(&gradient, lr, cfg.clip_norm);
        let grad_norm = moved.map_err(|e| e.of_frames(&batch.frames))?;
        drop(gradient);
        if let Some(average) = &mut state.average {
            average.follow(&state.weights, step)?;
        }

        let line = TrainLine { step, split: Side::Train, terms, lr, grad_norm };
        on(state, Event::Trained { line, log: due(cfg.log_every, step) })?;
        let mut best = false;
        if data.validation_batches > 0 && due(cfg.eval_every, step) {
            let line = validate(cfg, state, data)?;
            best = judge(cfg, &mut state.progress, &line);
            on(state, Event::Validated { line, best })?;
        }
        if best || state.progress.stopped_early || due(cfg.save_every, step) {
            on(state, Event::Checkpoint { step })?;
        }
        if state.progress.stopped_early {
            on(state, Event::StoppedEarly { step })?;
        }
    }
    Ok(())
}

/// The loss of a batch and its gradient, worked through in micro-batches.
fn descend(cfg: &TrainConfig, state: &State, batch: &Batch) -> Result<(Terms, Gradient)> {
    let (step, known) = (state.adam.steps(), Known::of(&batch.targets)?);
    let activations = cfg.precision.on(batch.targets.action.device())?;
    let (mut tally, mut gradient) = (Tally::default(), Gradient::default());
    for (part, micro) in (0..).zip(batch.split(cfg.micro_batches)?) {
        let pass = Pass::Learn { seed: cfg.seed, step, part, activations };
        let output = state.net.forward(&micro.inputs, &pass)?;
        let sums = LossSums::new(&output, &micro.targets, cfg.loss.assign)?;
        let its = sums.read()?;
        if let Some(term) = its.terms(&cfg.loss).broken() {
            let error = Error::Diverged { step: step + 1, term: term.into(), frames: vec![] };
            return Err(error.of_frames(&micro.frames));
        }
        tally.add(&its);
        gradient.add(&state.weights, backward(&sums.total(&cfg.loss, &known)?)?)?;
    }
    Ok((tally.terms(&cfg.loss), gradient))
}

/// Remember a validation: whether it is the best so far, and whether it is time to end.
fn judge(cfg: &TrainConfig, progress: &mut Progress, line: &ValidationLine) -> bool {
    let total = line.terms.total;
    let best = progress.best.as_ref().is_none_or(|best| total < best.total);
    if best {
        progress.best = Some(Best { step: line.step, total });
        progress.validations_since_best = 0;
    } else {
        progress.validations_since_best += 1;
    }
    progress.stopped_early = cfg.patience > 0
        && progress.validations_since_best >= cfg.patience
        && line.step < cfg.steps;
    best
}

/// The loss over the validation batches, on a copy of the weights, or of their average, that
/// keeps no graph.
///
/// # Errors
///
/// [`Error::Diverged`] if it is not finite; those of the batches.
pub fn validate(cfg: &TrainConfig, state: &State, data: &mut Data) -> Result<ValidationLine> {
    let frozen = match &state.average {
        Some(average) => average.values(),
        None => state.weights.snapshot()?,
    };
    let device = data.validation.batch(0)?.inputs.velocity.device().clone();
    let vb = VarBuilder::from_tensors(frozen.into_iter().collect(), DType::F32, &device);
    let net = Network::new(&cfg.net, vb)?;
    let mut tally = Tally::default();
    for i in 0..data.validation_batches {
        let batch = data.validation.batch(i)?;
        let output = net.forward(&batch.inputs, &Pass::Judge)?;
        let its = LossSums::new(&output, &batch.targets, cfg.loss.assign)?.read()?;
        if let Some(term) = its.terms(&cfg.loss).broken() {
            let term = format!("validation {term}");
            let error = Error::Diverged { step: state.adam.steps(), term, frames: vec![] };
            return Err(error.of_frames(&batch.frames));
        }
        tally.add(&its);
    }
    let (step, terms) = (state.adam.steps(), tally.terms(&cfg.loss));
    Ok(ValidationLine { step, split: Side::Val, terms })
}

/// Train on a run directory: start it, or with `resume` continue it from its last checkpoint.
///
/// The same configuration and data end in the same files, however often the run was stopped, on
/// the CPU.
///
/// # Errors
///
/// [`Error::Config`] for a precision that the device is not for; those of [`RunDir::open`] and
/// [`train`]; the run then stands at its last checkpoint.
pub fn train_run(
    cfg: &TrainConfig,
    out: &Path,
    resume: bool,
    data: &mut Data,
    device: &Device,
    on: &mut dyn FnMut(&Event) -> Result<()>,
) -> Result<()> {
    cfg.validate()?;
    cfg.precision.on(device)?;
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
            Event::Validated { line, .. } => dir.append(line)?,
            Event::Checkpoint { .. } => dir.commit(&state.snapshot()?)?,
            Event::Started { .. }
            | Event::Trained { log: false, .. }
            | Event::StoppedEarly { .. } => {}
        }
        on(&event)
    })
}
