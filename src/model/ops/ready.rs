//! Results that are computed already, made a part of candle's graph with their way back.

use std::sync::{Mutex, PoisonError};

use candle_core::{
    CpuStorage, CudaStorage, CustomOp1, CustomOp2, CustomOp3, Layout, Shape, Storage, Tensor,
    backend::BackendStorage,
};

use crate::error::Result;

/// The gradient of a result to those of the arguments, `None` where an argument needs none.
pub(super) type Back = Box<dyn Fn(&Tensor) -> Result<Vec<Option<Tensor>>> + Send + Sync>;

/// What was computed.
#[derive(Debug)]
pub enum Computed {
    /// On the CPU, f32.
    Numbers(Vec<f32>, Shape),
    /// Without a graph, on the device of the arguments.
    Tensor(Tensor),
}

impl From<(Vec<f32>, Shape)> for Computed {
    fn from((numbers, shape): (Vec<f32>, Shape)) -> Self {
        Computed::Numbers(numbers, shape)
    }
}

impl From<Tensor> for Computed {
    fn from(tensor: Tensor) -> Self {
        Computed::Tensor(tensor)
    }
}

/// A tensor of what was computed, which depends on up to three arguments by `back`.
///
/// # Errors
///
/// [`Error::Tensor`](crate::error::Error::Tensor) if the arguments are on another device.
pub fn with_gradient(
    name: &'static str,
    result: impl Into<Computed>,
    arguments: &[&Tensor],
    back: Back,
) -> Result<Tensor> {
    let result = match result.into() {
        // Nothing to go back for.
        Computed::Tensor(tensor) if !arguments.iter().any(|argument| argument.track_op()) => {
            return Ok(tensor.contiguous()?);
        }
        result => result,
    };
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
    result: Mutex<Option<Computed>>,
    back: Back,
}

impl Ready {
    fn take(&self) -> candle_core::Result<Computed> {
        let result = self.result.lock().unwrap_or_else(PoisonError::into_inner).take();
        result
            .ok_or_else(|| candle_core::Error::msg(format!("{}: applied once already", self.name)))
    }

    fn on_cpu(&self) -> candle_core::Result<(CpuStorage, Shape)> {
        let tensor = match self.take()? {
            Computed::Numbers(numbers, shape) => return Ok((CpuStorage::F32(numbers), shape)),
            Computed::Tensor(tensor) => tensor,
        };
        let (storage, layout) = tensor.storage_and_layout();
        match &*storage {
            Storage::Cpu(storage) => Ok((own(storage, layout)?, layout.shape().clone())),
            _ => candle_core::bail!("{}: arguments on the CPU, the result not", self.name),
        }
    }

    fn on_cuda(&self) -> candle_core::Result<(CudaStorage, Shape)> {
        let Computed::Tensor(tensor) = self.take()? else {
            candle_core::bail!("{}: arguments on a GPU, the result not", self.name);
        };
        let (storage, layout) = tensor.storage_and_layout();
        match &*storage {
            Storage::Cuda(storage) => Ok((own(storage, layout)?, layout.shape().clone())),
            _ => candle_core::bail!("{}: arguments on a GPU, the result not", self.name),
        }
    }

    fn back<const N: usize>(&self, grad: &Tensor) -> candle_core::Result<[Option<Tensor>; N]> {
        let grads = (self.back)(grad).map_err(|e| candle_core::Error::msg(e.to_string()))?;
        let other = |_: Vec<_>| candle_core::Error::msg(format!("{}: gradients", self.name));
        grads.try_into().map_err(other)
    }
}

/// The numbers of a tensor, whatever its layout, in memory of their own: times 1, plus 0.
fn own<S: BackendStorage>(storage: &S, layout: &Layout) -> candle_core::Result<S> {
    storage.affine(layout, 1.0, 0.0)
}

impl CustomOp1 for Ready {
    fn name(&self) -> &'static str {
        self.name
    }

    fn cpu_fwd(&self, _: &CpuStorage, _: &Layout) -> candle_core::Result<(CpuStorage, Shape)> {
        self.on_cpu()
    }

    fn cuda_fwd(&self, _: &CudaStorage, _: &Layout) -> candle_core::Result<(CudaStorage, Shape)> {
        self.on_cuda()
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
        self.on_cpu()
    }

    fn cuda_fwd(
        &self,
        _: &CudaStorage,
        _: &Layout,
        _: &CudaStorage,
        _: &Layout,
    ) -> candle_core::Result<(CudaStorage, Shape)> {
        self.on_cuda()
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
        self.on_cpu()
    }

    fn cuda_fwd(
        &self,
        _: &CudaStorage,
        _: &Layout,
        _: &CudaStorage,
        _: &Layout,
        _: &CudaStorage,
        _: &Layout,
    ) -> candle_core::Result<(CudaStorage, Shape)> {
        self.on_cuda()
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
