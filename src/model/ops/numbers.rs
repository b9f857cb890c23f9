//! The numbers of tensors as slices.

use candle_core::{CpuStorage, DType, Storage, Tensor};

use crate::error::Result;

/// Whether `pmp_kernels` computes on it; if not, candle does.
pub fn is_for_kernels(x: &Tensor) -> bool {
    x.device().is_cpu() && x.dtype() == DType::F32
}

/// The type that numbers of a type are summed up in.
pub fn wide(kind: DType) -> DType {
    if kind == DType::F64 { DType::F64 } else { DType::F32 }
}

/// Contiguous f32 tensors on the CPU, to be read as slices.
#[derive(Clone, Debug)]
pub struct Numbers(Vec<Tensor>);

impl Numbers {
    /// Tensors that are not contiguous are copied.
    ///
    /// # Errors
    ///
    /// [`Error::Tensor`](crate::error::Error::Tensor) if a tensor is of another type or device.
    pub fn of<'t>(tensors: impl IntoIterator<Item = &'t Tensor>) -> Result<Self> {
        let contiguous = |tensor: &Tensor| {
            if !is_for_kernels(tensor) {
                let (kind, place) = (tensor.dtype(), tensor.device().location());
                let what = format!("operation for f32 on the CPU, not {kind:?} on {place:?}");
                return Err(candle_core::Error::msg(what).into());
            }
            // Without its graph, or that would live as long as this.
            Ok(tensor.detach().contiguous()?)
        };
        Ok(Self(tensors.into_iter().map(contiguous).collect::<Result<_>>()?))
    }

    /// Do something with the slices.
    pub fn read<R>(&self, with: impl FnOnce(&[&[f32]]) -> R) -> R {
        let locked: Vec<_> = self.0.iter().map(Tensor::storage_and_layout).collect();
        let slices: Vec<&[f32]> = locked
            .iter()
            .map(|(storage, layout)| match &**storage {
                Storage::Cpu(CpuStorage::F32(numbers)) => {
                    &numbers[layout.start_offset()..][..layout.shape().elem_count()]
                }
                _ => unreachable!("of another type or device, it was refused"),
            })
            .collect();
        with(&slices)
    }
}
