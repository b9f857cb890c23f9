//! A step of Adam on a variable, in place.

use std::cell::RefCell;

use candle_core::{CpuStorage, InplaceOp1, Layout, Tensor, Var};
use pmp_kernels::adam;

use crate::{error::Result, model::ops::numbers::Numbers};

pub use pmp_kernels::adam::Step;

/// Both moments of a variable, as many numbers as it has.
#[derive(Clone, Debug, PartialEq)]
pub struct Moments {
    pub first: Vec<f32>,
    pub second: Vec<f32>,
}

impl Moments {
    /// Those before the first step of a variable of `len` numbers.
    pub fn zeros(len: usize) -> Self {
        Self { first: vec![0.0; len], second: vec![0.0; len] }
    }
}

/// Move a variable against its gradient.
///
/// # Errors
///
/// [`Error::Tensor`](crate::error::Error::Tensor) if the gradient or the moments are not of the
/// variable's size, or a tensor not f32 on the CPU.
pub fn adam_step(var: &Var, grad: &Tensor, moments: &mut Moments, step: &Step) -> Result<()> {
    if grad.dims() != var.dims() {
        let what = format!("gradient {:?} of {:?}", grad.dims(), var.dims());
        return Err(candle_core::Error::msg(what).into());
    }
    let grad = Numbers::of([grad])?;
    Ok(var.inplace_op1(&Take { step, grad, moments: RefCell::new(moments) })?)
}

/// The sum of a gradient's squares, not finite if one of its numbers is not.
///
/// # Errors
///
/// [`Error::Tensor`](crate::error::Error::Tensor) if it is not f32 on the CPU.
pub fn sum_of_squares(grad: &Tensor) -> Result<f64> {
    Ok(Numbers::of([grad])?.read(|slices| adam::sum_of_squares(slices[0])))
}

struct Take<'a> {
    step: &'a Step,
    grad: Numbers,
    moments: RefCell<&'a mut Moments>,
}

impl InplaceOp1 for Take<'_> {
    fn name(&self) -> &'static str {
        "adam"
    }

    fn cpu_fwd(&self, storage: &mut CpuStorage, layout: &Layout) -> candle_core::Result<()> {
        let Moments { first, second } = &mut **self.moments.borrow_mut();
        let (CpuStorage::F32(weights), Some((from, to))) = (storage, layout.contiguous_offsets())
        else {
            candle_core::bail!("adam: a contiguous variable, f32");
        };
        let weights = &mut weights[from..to];
        if [first.len(), second.len()] != [weights.len(); 2] {
            candle_core::bail!("adam: moments of {} numbers of {}", first.len(), weights.len());
        }
        self.grad.read(|grad| self.step.take(weights, grad[0], first, second));
        Ok(())
    }
}
