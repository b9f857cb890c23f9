//! Batch norm, with the addition of a residual and a ReLU in the same pass.

use std::sync::Arc;

use candle_core::{Device, Tensor};
use pmp_kernels::norm::{self, Backward, Gate, Moments, Residual};

use crate::{
    error::Result,
    model::ops::{
        composed,
        numbers::{Numbers, is_for_kernels},
        ready::with_gradient,
    },
};

/// What normalises.
#[derive(Clone, Debug)]
pub struct Norm {
    /// Mean and variance of each channel, `[C]`; `None` for those of the batch.
    pub moments: Option<[Tensor; 2]>,
    /// Added to the variance.
    pub eps: f64,
    pub relu: bool,
}

/// `relu(scale (x - mean) / sqrt(variance + eps) + shift + residual)`, and the mean and variance
/// that were used.
///
/// # Shapes
///
/// | name       | shape       | note                       |
/// |------------|-------------|----------------------------|
/// | `x`        | `[.., C]`   | channels last              |
/// | `scale`    | `[C]`       | PyTorch's `weight`         |
/// | `shift`    | `[C]`       | PyTorch's `bias`           |
/// | `residual` | `[.., C]`   | as `x`                     |
/// | returns    | `[.., C]`   | and `[C]`, biased variance |
///
/// # Errors
///
/// [`Error::Tensor`](crate::error::Error::Tensor) if shapes disagree, `x` is empty, or one of
/// several tensors is of another device.
pub fn batch_norm(
    x: &Tensor,
    scale: &Tensor,
    shift: &Tensor,
    residual: Option<&Tensor>,
    norm: &Norm,
) -> Result<(Tensor, [Tensor; 2])> {
    let channels = x.dims().last().copied().unwrap_or(0);
    let of = |moments: &[Tensor; 2]| moments.iter().all(|moment| moment.dims() == [channels]);
    let fits = [scale, shift].iter().all(|tensor| tensor.dims() == [channels])
        && residual.is_none_or(|residual| residual.dims() == x.dims())
        && norm.moments.as_ref().is_none_or(of)
        && x.elem_count() > 0;
    if !fits {
        let residual = residual.map(Tensor::dims);
        let (scale, shift) = (scale.dims(), shift.dims());
        let what = format!("norm of {:?} by {scale:?}, {shift:?}, + {residual:?}", x.dims());
        return Err(candle_core::Error::msg(what).into());
    }
    let both = Tensor::stack(&[scale, shift], 0)?; // candle's operations have three arguments
    if !is_for_kernels(x) {
        let moments = norm.moments.as_ref();
        return composed::batch_norm(x, &both, residual, moments, norm.eps, norm.relu);
    }
    let arguments: Vec<&Tensor> = [x, &both].into_iter().chain(residual).collect();
    let numbers = Numbers::of(arguments.iter().copied())?;
    let mut out = vec![0.0; x.elem_count()];
    let (eps, relu, of_batch) = (norm.eps, norm.relu, norm.moments.is_none());
    let given = norm.moments.as_ref().map(moments_of).transpose()?;
    let (moments, map) = numbers.read(|slices| {
        let moments = given.unwrap_or_else(|| Moments::of(channels, slices[0]));
        let (scale, shift) = slices[1].split_at(channels);
        let map = moments.map(scale, shift, eps);
        let residual = slices.get(2).map(|x| Residual { x, affine: None });
        norm::apply(slices[0], map.as_affine(), residual, relu, &mut out);
        (moments, map)
    });
    let used = tensors_of(&moments)?;
    let shape = x.shape().clone();
    // With a residual, where the ReLU is open is seen from the result only.
    let tracked = arguments.iter().any(|tensor| tensor.track_op());
    let kept = Arc::new((tracked && relu && residual.is_some()).then(|| out.clone()));
    let (count, x_shape, device) = (arguments.len(), x.shape().clone(), x.device().clone());
    let back = move |grad: &Tensor| {
        let mut grad = Numbers::of([grad])?.read(|slices| slices[0].to_vec());
        let mut grad_x = if count == 3 { vec![0.0; grad.len()] } else { vec![] };
        let back = numbers.read(|slices| {
            let (x, scale) = (slices[0], &slices[1][..channels]);
            let gate = match (&*kept, relu) {
                (_, false) => Gate::Open,
                (Some(out), true) => Gate::Output(out),
                (None, true) => Gate::Map(map.as_affine()),
            };
            let back = Backward::sums(x, &moments, of_batch, scale, eps, gate, &mut grad);
            match count {
                3 => back.input(x, Some(&grad), &mut grad_x),
                _ => back.input(x, None, &mut grad),
            }
            back
        });
        let tensor = |numbers: Vec<f32>| Tensor::from_vec(numbers, &x_shape, &device);
        let both = [back.grad_scale, back.grad_shift].concat();
        let both = Tensor::from_vec(both, (2, channels), &device)?;
        Ok(match count {
            3 => vec![Some(tensor(grad_x)?), Some(both), Some(tensor(grad)?)],
            _ => vec![Some(tensor(grad)?), Some(both)],
        })
    };
    let out = with_gradient("batch-norm", (out, shape), &arguments, Box::new(back))?;
    Ok((out, used))
}

/// Mean and variance, `[C]`, as the kernels take them.
///
/// # Errors
///
/// [`Error::Tensor`](crate::error::Error::Tensor) if they are not f32 on the CPU.
pub fn moments_of([mean, variance]: &[Tensor; 2]) -> Result<Moments> {
    let numbers = Numbers::of([mean, variance])?;
    Ok(numbers.read(|slices| Moments { mean: slices[0].into(), variance: slices[1].into() }))
}

/// And back.
///
/// # Errors
///
/// [`Error::Tensor`](crate::error::Error::Tensor) if memory runs out.
pub fn tensors_of(moments: &Moments) -> Result<[Tensor; 2]> {
    let tensor = |numbers: &[f32]| Tensor::new(numbers, &Device::Cpu);
    Ok([tensor(&moments.mean)?, tensor(&moments.variance)?])
}
