//! candle's backward pass, with gradients that go around its sums.
//!
//! candle adds every gradient to zeros, two passes over memory that a large network's weights
//! need not. An operation with many weights leaves their gradients here while [`backward`] runs.

use std::cell::RefCell;

use candle_core::{Tensor, TensorId, backprop::GradStore};

use crate::error::Result;

thread_local! {
    /// Gradients left on the way back that is under way on this thread.
    static LEFT: RefCell<Option<Vec<(TensorId, Tensor)>>> = const { RefCell::new(None) };
}

/// Gradients of all that `loss`, `[]`, depends on. A network with operations that leave gradients
/// here has to be gone back through by this, once for each forward pass.
///
/// # Errors
///
/// Those of the operations.
pub fn backward(loss: &Tensor) -> Result<GradStore> {
    LEFT.set(Some(vec![]));
    let grads = loss.backward();
    let left = LEFT.take().unwrap_or_default();
    let mut grads = grads?;
    for (id, grad) in left {
        let sum = match grads.get_id(id) {
            Some(other) => (other + grad)?,
            None => grad,
        };
        grads.insert_id(id, sum);
    }
    Ok(grads)
}

/// Leave the gradient of a weight for [`backward`].
///
/// # Errors
///
/// [`Error::Tensor`](crate::error::Error::Tensor) if the way back is not by [`backward`].
pub fn leave(weight: &Tensor, grad: Tensor) -> Result<()> {
    LEFT.with_borrow_mut(|left| match left {
        Some(left) => {
            left.push((weight.id(), grad));
            Ok(())
        }
        None => {
            let what = "gradients of this network are computed by model::ops::gradients::backward";
            Err(candle_core::Error::msg(what).into())
        }
    })
}
