//! The lines of `metrics.jsonl`.

use serde::{Deserialize, Serialize};

use crate::model::loss::Terms;

/// Which frames a line is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Side {
    Train,
    Val,
}

/// A step: the loss of its batch before the weights were moved.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
pub struct TrainLine {
    /// Steps taken, with this one.
    pub step: u64,
    pub split: Side,
    #[serde(flatten)]
    pub terms: Terms,
    pub lr: f64,
    /// Global L2 norm of the gradient, before clipping.
    pub grad_norm: f64,
}

/// A validation: the loss over all of its frames.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
pub struct ValidationLine {
    /// Steps taken.
    pub step: u64,
    pub split: Side,
    #[serde(flatten)]
    pub terms: Terms,
}
