//! A step of Adam on a variable, in place.

use std::cell::RefCell;

use candle_core::{CpuStorage, DType, InplaceOp1, Layout, Tensor, Var};
use pmp_kernels::adam;

use crate::{
    error::Result,
    model::ops::{
        composed,
        numbers::{Numbers, is_for_kernels},
    },
};

pub use pmp_kernels::adam::Step;

/// The first and the second moment of a variable, kept where it is.
#[derive(Clone, Debug)]
pub struct Moments(Kept);

#[derive(Clone, Debug)]
enum Kept {
    Numbers([Vec<f32>; 2]),
    Tensors([Tensor; 2]),
}

impl Moments {
    /// Those before the first step.
    ///
    /// # Errors
    ///
    /// [`Error::Tensor`](crate::error::Error::Tensor) if memory runs out.
    pub fn zeros(var: &Var) -> Result<Self> {
        Ok(Self(match is_for_kernels(var) {
            true => Kept::Numbers([vec![0.0; var.elem_count()], vec![0.0; var.elem_count()]]),
            false => Kept::Tensors([var.zeros_like()?, var.zeros_like()?]),
        }))
    }

    /// Those that were saved, of any device.
    ///
    /// # Errors
    ///
    /// [`Error::Tensor`](crate::error::Error::Tensor) if they are not of the variable's shape.
    pub fn of(var: &Var, [first, second]: [&Tensor; 2]) -> Result<Self> {
        if [first.dims(), second.dims()] != [var.dims(); 2] {
            let (first, second) = (first.dims(), second.dims());
            let what = format!("moments {first:?} and {second:?} of {:?}", var.dims());
            return Err(candle_core::Error::msg(what).into());
        }
        let numbers = |moment: &Tensor| moment.flatten_all()?.to_vec1::<f32>();
        let tensor = |moment: &Tensor| moment.to_device(var.device())?.to_dtype(var.dtype());
        Ok(Self(match is_for_kernels(var) {
            true => Kept::Numbers([numbers(first)?, numbers(second)?]),
            false => Kept::Tensors([tensor(first)?, tensor(second)?]),
        }))
    }

    /// To be saved, in the shape of their variable.
    ///
    /// # Errors
    ///
    /// [`Error::Tensor`](crate::error::Error::Tensor) if memory runs out.
    pub fn tensors(&self, var: &Var) -> Result<[Tensor; 2]> {
        let tensor = |numbers: &[f32]| Tensor::from_slice(numbers, var.shape(), var.device());
        Ok(match &self.0 {
            Kept::Numbers([first, second]) => [tensor(first)?, tensor(second)?],
            Kept::Tensors(tensors) => tensors.clone(),
        })
    }
}

/// Move a variable against its gradient.
///
/// # Errors
///
/// [`Error::Tensor`](crate::error::Error::Tensor) if the gradient or the moments are not of the
/// variable's size or device.
pub fn adam_step(var: &Var, grad: &Tensor, moments: &mut Moments, step: &Step) -> Result<()> {
    if grad.dims() != var.dims() {
        let what = format!("gradient {:?} of {:?}", grad.dims(), var.dims());
        return Err(candle_core::Error::msg(what).into());
    }
    match &mut moments.0 {
        Kept::Tensors(moments) => composed::adam_step(var, grad, moments, step),
        Kept::Numbers(moments) => {
            let grad = Numbers::of([grad])?;
            Ok(var.inplace_op1(&Take { step, grad, moments: RefCell::new(moments) })?)
        }
    }
}

/// The sum of squares of each gradient, not finite if one of its numbers is not.
///
/// # Errors
///
/// [`Error::Tensor`](crate::error::Error::Tensor) if they are not of one device.
pub fn sums_of_squares(grads: &[&Tensor]) -> Result<Vec<f64>> {
    if grads.iter().all(|grad| is_for_kernels(grad)) {
        let sum = |grad: &&Tensor| {
            Ok(Numbers::of([*grad])?.read(|slices| adam::sum_of_squares(slices[0])))
        };
        return grads.iter().map(sum).collect();
    }
    // The device is waited for once.
    let sum = |grad: &&Tensor| grad.sqr()?.sum_all()?.to_dtype(DType::F32);
    let sums = grads.iter().map(sum).collect::<candle_core::Result<Vec<_>>>()?;
    let sums = Tensor::stack(&sums, 0)?.to_vec1::<f32>()?;
    Ok(sums.into_iter().map(f64::from).collect())
}

struct Take<'a> {
    step: &'a Step,
    grad: Numbers,
    moments: RefCell<&'a mut [Vec<f32>; 2]>,
}

impl InplaceOp1 for Take<'_> {
    fn name(&self) -> &'static str {
        "adam"
    }

    fn cpu_fwd(&self, storage: &mut CpuStorage, layout: &Layout) -> candle_core::Result<()> {
        let [first, second] = &mut **self.moments.borrow_mut();
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
