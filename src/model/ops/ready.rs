//! Results that are computed already, made a part of candle's graph with their way back.

use std::sync::{Mutex, PoisonError};

use candle_core::{CpuStorage, CustomOp1, CustomOp2, CustomOp3, Layout, Shape, Tensor};

use crate::error::Result;

/// The gradient of a result to those of the arguments, `None` where an argument needs none.
pub(super) type Back = Box<dyn Fn(&Tensor) -> Result<Vec<Option<Tensor>>> + Send + Sync>;

/// A tensor of these numbers, which depends on up to three arguments by `back`.
///
/// # Errors
///
/// [`Error::Tensor`](crate::error::Error::Tensor) if the arguments are not on the CPU.
pub fn with_gradient(
    name: &'static str,
    result: (Vec<f32>, Shape),
    arguments: &[&Tensor],
    back: Back,
) -> Result<Tensor> {
    let op = Ready { name, result: Mutex::new(Some(result)), back };
    Ok(match arguments {
        [a] => a.apply_op1(op)?,
        [a, b] => a.apply_op2(b, op)?,
        [a, b, c] => a.apply_op3(b, c, op)?,
        _ => return Err(candle_core::Error::msg("an operation of one to three arguments").into()),
    })
}

struct Ready {
    name: &'static str,
    result: Mutex<Option<(Vec<f32>, Shape)>>,
    back: Back,
}

impl Ready {
    fn result(&self) -> candle_core::Result<(CpuStorage, Shape)> {
        let result = self.result.lock().unwrap_or_else(PoisonError::into_inner).take();
        let none = || candle_core::Error::msg(format!("{}: applied once already", self.name));
        result.map(|(numbers, shape)| (CpuStorage::F32(numbers), shape)).ok_or_else(none)
    }

    fn back<const N: usize>(&self, grad: &Tensor) -> candle_core::Result<[Option<Tensor>; N]> {
        let grads = (self.back)(grad).map_err(|e| candle_core::Error::msg(e.to_string()))?;
        let other = |_: Vec<_>| candle_core::Error::msg(format!("{}: gradients", self.name));
        grads.try_into().map_err(other)
    }
}

impl CustomOp1 for Ready {
    fn name(&self) -> &'static str {
        self.name
    }

    fn cpu_fwd(&self, _: &CpuStorage, _: &Layout) -> candle_core::Result<(CpuStorage, Shape)> {
        self.result()
    }

    fn bwd(&self, _: &Tensor, _: &Tensor, grad: &Tensor) -> candle_core::Result<Option<Tensor>> {
        let [a] = self.back(grad)?;
        Ok(a)
    }
}

impl CustomOp2 for Ready {
    fn name(&self) -> &'static str {
        self.name
    }

    fn cpu_fwd(
        &self,
        _: &CpuStorage,
        _: &Layout,
        _: &CpuStorage,
        _: &Layout,
    ) -> candle_core::Result<(CpuStorage, Shape)> {
        self.result()
    }

    fn bwd(
        &self,
        _: &Tensor,
        _: &Tensor,
        _: &Tensor,
        grad: &Tensor,
    ) -> candle_core::Result<(Option<Tensor>, Option<Tensor>)> {
        let [a, b] = self.back(grad)?;
        Ok((a, b))
    }
}

impl CustomOp3 for Ready {
    fn name(&self) -> &'static str {
        self.name
    }

    fn cpu_fwd(
        &self,
        _: &CpuStorage,
        _: &Layout,
        _: &CpuStorage,
        _: &Layout,
        _: &CpuStorage,
        _: &Layout,
    ) -> candle_core::Result<(CpuStorage, Shape)> {
        self.result()
    }

    fn bwd(
        &self,
        _: &Tensor,
        _: &Tensor,
        _: &Tensor,
        _: &Tensor,
        grad: &Tensor,
    ) -> candle_core::Result<(Option<Tensor>, Option<Tensor>, Option<Tensor>)> {
        let [a, b, c] = self.back(grad)?;
        Ok((a, b, c))
    }
}
