//! The operations made of candle's own, for what `pmp_kernels` does not do: other devices and
//! other types than f32.
//!
//! Nothing here asks for a device, so it is tested on the CPU against `pmp_kernels`. Gradients are
//! written out: candle's own of a convolution fails where a stride leaves pixels over, that of a
//! maximum gives to every pixel that is the largest, and both keep what is not needed. Activations
//! are `[B, H, W, C]`. bf16 is normalised in f32; weights are taken in the type of the activation,
//! their gradients come in their own.

use candle_core::{DType, Tensor, Var};
use pmp_kernels::adam::Step;

use crate::{
    error::Result,
    model::ops::{numbers::wide, ready::with_gradient},
};

/// Convolve `x` `[B, H, W, C]` by a square kernel `[O, C, K, K]`, padding below K; all three passes
/// are candle's forward one.
///
/// # Errors
///
/// [`Error::Tensor`](crate::error::Error::Tensor) if shapes disagree or the device refuses.
pub fn conv2d(
    x: &Tensor,
    weight: &Tensor,
    bias: Option<&Tensor>,
    stride: usize,
    padding: usize,
) -> Result<Tensor> {
    let arguments: Vec<&Tensor> = [x, weight].into_iter().chain(bias).collect();
    let wanted: Vec<bool> = arguments.iter().map(|argument| argument.track_op()).collect();
    let types: Vec<DType> = arguments.iter().map(|argument| argument.dtype()).collect();
    let [x, weight] = [x.detach(), weight.detach().to_dtype(x.dtype())?];
    let planes = x.permute((0, 3, 1, 2))?; // [B, C, H, W]
    let out = planes.conv2d(&weight, padding, stride, 1, 1)?.permute((0, 2, 3, 1))?;
    let out = match bias {
        Some(bias) => out.broadcast_add(&bias.detach().to_dtype(x.dtype())?)?,
        None => out,
    };
    let back = move |grad: &Tensor| {
        let grad_planes = grad.permute((0, 3, 1, 2))?.contiguous()?; // [B, O, OH, OW]
        let of_x = || input_gradient(&planes, &weight, &grad_planes, stride, padding);
        let of_weight = || weight_gradient(&planes, &weight, &grad_planes, stride, padding);
        let of_bias = || Ok(grad.to_dtype(wide(grad.dtype()))?.flatten_to(2)?.sum(0)?);
        let gradients: [&dyn Fn() -> Result<Tensor>; 3] = [&of_x, &of_weight, &of_bias];
        let each = gradients.into_iter().zip(wanted.iter().zip(&types));
        each.map(|(gradient, (wanted, of_type))| {
            let gradient = wanted.then(gradient).transpose()?;
            Ok(gradient.map(|gradient| gradient.to_dtype(*of_type)).transpose()?)
        })
        .collect()
    };
    with_gradient("conv2d", out, &arguments, Box::new(back))
}

/// `[B, H, W, C]`: the gradient's pixels as far apart as the stride took them, by the kernel turned
/// around.
fn input_gradient(
    planes: &Tensor,
    weight: &Tensor,
    grad: &Tensor,
    stride: usize,
    padding: usize,
) -> Result<Tensor> {
    let (_, _, height, width) = planes.dims4()?;
    let kernel = weight.dim(3)?;
    let side = |side: usize| side + 2 * padding + 1 - kernel;
    let grad = spread(&spread(grad, 2, stride)?, 3, stride)?;
    let grad = grad.narrow(2, 0, side(height))?.narrow(3, 0, side(width))?;
    let turned = weight.flip(&[2, 3])?.transpose(0, 1)?.contiguous()?; // [C, O, K, K]
    let of_x = grad.contiguous()?.conv2d(&turned, kernel - 1 - padding, 1, 1, 1)?;
    Ok(of_x.permute((0, 2, 3, 1))?)
}

/// `[O, C, K, K]`: the picture by the gradient as a kernel, channels in the place of the batch.
fn weight_gradient(
    planes: &Tensor,
    weight: &Tensor,
    grad: &Tensor,
    stride: usize,
    padding: usize,
) -> Result<Tensor> {
    let kernel = weight.dim(3)?;
    let by = grad.transpose(0, 1)?.contiguous()?; // [O, B, OH, OW]
    let all = planes.transpose(0, 1)?.conv2d(&by, padding, 1, stride, 1)?; // [C, O, .., ..]
    // Pixels that the stride left over make it larger than the kernel.
    Ok(all.narrow(2, 0, kernel)?.narrow(3, 0, kernel)?.transpose(0, 1)?.contiguous()?)
}

/// The largest of each `kernel` x `kernel` window of `x` `[B, H, W, C]`, padding below `kernel`; a
/// gradient goes to the first pixel that is the largest.
///
/// # Errors
///
/// [`Error::Tensor`](crate::error::Error::Tensor) if shapes disagree or the device refuses.
pub fn max_pool(x: &Tensor, kernel: usize, stride: usize, padding: usize) -> Result<Tensor> {
    let argument = x;
    let x = x.detach();
    let (_, height, width, _) = x.dims4()?;
    let sides = [height, width];
    let counts = sides.map(|side| (side + 2 * padding - kernel) / stride + 1);
    // Below and to the right as much as whole strides need.
    let after = |i: usize| kernel - 1 + stride * counts[i] - sides[i] - padding;
    let afters = [after(0), after(1)];
    let padded =
        pad_with_least(&pad_with_least(&x, 1, padding, afters[0])?, 2, padding, afters[1])?;
    let places = (0..kernel * kernel).map(move |i| [i / kernel, i % kernel]);
    let window = move |[down, right]: [usize; 2]| {
        every(&every(&padded, 1, down, stride, counts[0])?, 2, right, stride, counts[1])
    };
    let mut out = window([0, 0])?;
    for place in places.clone().skip(1) {
        out = out.maximum(&window(place)?)?;
    }
    let largest = out.clone();
    let back = move |grad: &Tensor| {
        let mut sum: Option<Tensor> = None;
        let mut open = grad.ones_like()?; // where no pixel has been the largest yet
        for place in places.clone() {
            let its = (window(place)?.eq(&largest)?.to_dtype(grad.dtype())? * &open)?;
            open = (open - &its)?;
            let mut its = (its * grad)?;
            for (dim, (at, after)) in (1..).zip(place.into_iter().zip([kernel - 1; 2])) {
                its = spread(&its, dim, stride)?.pad_with_zeros(dim, at, after - at)?;
            }
            sum = Some(match sum {
                Some(others) => (others + its)?,
                None => its,
            });
        }
        let sum = sum.map(|sum| sum.narrow(1, padding, height)?.narrow(2, padding, width));
        Ok(vec![sum.transpose()?])
    };
    with_gradient("max-pool", out, &[argument], Box::new(back))
}

/// `relu(scale (x - mean) / sqrt(variance + eps) + shift + residual)` and the moments that were
/// used, as [`batch_norm`](super::batch_norm) has it; `both` `[2, C]` are scale and shift.
///
/// # Errors
///
/// [`Error::Tensor`](crate::error::Error::Tensor) if shapes disagree or the device refuses.
pub fn batch_norm(
    x: &Tensor,
    both: &Tensor,
    residual: Option<&Tensor>,
    moments: Option<&[Tensor; 2]>,
    eps: f64,
    relu: bool,
) -> Result<(Tensor, [Tensor; 2])> {
    let arguments: Vec<&Tensor> = [x, both].into_iter().chain(residual).collect();
    let (kind, shape, of_both) = (x.dtype(), x.shape().clone(), both.dtype());
    let wide = wide(kind);
    let channels = both.dim(1)?;
    let rows = move |x: &Tensor| x.detach().to_dtype(wide)?.reshape(((), channels)); // [N, C]
    let of_batch = moments.is_none();
    let (mean, variance) = match moments {
        Some([mean, variance]) => (mean.to_dtype(wide)?, variance.to_dtype(wide)?),
        None => {
            let mean = rows(x)?.mean(0)?;
            let variance = rows(x)?.broadcast_sub(&mean)?.sqr()?.mean(0)?;
            (mean, variance)
        }
    };
    let slope = (&variance + eps)?.sqrt()?.recip()?; // [C]
    let (x, both) = (x.detach(), both.detach().to_dtype(wide)?);
    let normal = {
        let (mean, slope) = (mean.clone(), slope.clone());
        // Not kept: it is as large as the activation, and wider.
        move || rows(&x)?.broadcast_sub(&mean)?.broadcast_mul(&slope)
    };
    let mut out = normal()?.broadcast_mul(&both.get(0)?)?.broadcast_add(&both.get(1)?)?;
    if let Some(residual) = residual {
        out = (out + rows(residual)?)?;
    }
    let gate = relu.then(|| out.gt(0.0)).transpose()?;
    if relu {
        out = out.relu()?;
    }
    let out = out.reshape(&shape)?.to_dtype(kind)?;
    let with_residual = residual.is_some();
    let back = move |grad: &Tensor| {
        let mut grad = rows(grad)?;
        if let Some(gate) = &gate {
            grad = (grad * gate.to_dtype(wide)?)?;
        }
        let normal = normal()?;
        let [of_scale, of_shift] = [(&grad * &normal)?.sum(0)?, grad.sum(0)?];
        let pixels = grad.dim(0)? as f64;
        let mut of_x = grad.clone();
        if of_batch {
            of_x = of_x.broadcast_sub(&(&of_shift / pixels)?)?;
            of_x = (of_x - normal.broadcast_mul(&(&of_scale / pixels)?)?)?;
        }
        let of_x = of_x.broadcast_mul(&(&slope * both.get(0)?)?)?;
        let shaped = |rows: Tensor| rows.reshape(&shape)?.to_dtype(kind);
        let of_both = Tensor::stack(&[of_scale, of_shift], 0)?.to_dtype(of_both)?;
        let mut all = vec![Some(shaped(of_x)?), Some(of_both)];
        if with_residual {
            all.push(Some(shaped(grad)?));
        }
        Ok(all)
    };
    Ok((with_gradient("batch-norm", out, &arguments, Box::new(back))?, [mean, variance]))
}

/// Move a variable and its moments, the first and the second, by a step of Adam.
///
/// # Errors
///
/// [`Error::Tensor`](crate::error::Error::Tensor) if shapes disagree or the device refuses.
pub fn adam_step(var: &Var, grad: &Tensor, moments: &mut [Tensor; 2], step: &Step) -> Result<()> {
    let [beta1, beta2] = step.betas;
    let [bias1, bias2] = step.betas.map(|beta| 1.0 - beta.powf(step.number as f64));
    let weight = var.as_detached_tensor();
    let mut grad = (grad * step.grad_scale)?;
    let mut kept = 1.0;
    match step.decoupled {
        true => kept -= step.lr * step.weight_decay,
        false => grad = (grad + (&weight * step.weight_decay)?)?,
    }
    let [first, second] = moments;
    *first = ((&*first * beta1)? + (&grad * (1.0 - beta1))?)?;
    *second = ((&*second * beta2)? + (grad.sqr()? * (1.0 - beta2))?)?;
    let size = ((second.sqrt()? / bias2.sqrt())? + step.eps)?;
    Ok(var.set(&((weight * kept)? - ((&*first / size)? * (step.lr / bias1))?)?)?)
}

/// Each number of a dimension followed by `stride - 1` zeros.
fn spread(x: &Tensor, dim: usize, stride: usize) -> candle_core::Result<Tensor> {
    if stride == 1 {
        return Ok(x.clone());
    }
    x.unsqueeze(dim + 1)?.pad_with_zeros(dim + 1, 0, stride - 1)?.flatten(dim, dim + 1)
}

/// `count` numbers of a dimension from `from` on, each `stride` after the last; the dimension goes
/// a stride beyond the last of them.
fn every(
    x: &Tensor,
    dim: usize,
    from: usize,
    stride: usize,
    count: usize,
) -> candle_core::Result<Tensor> {
    let run = x.narrow(dim, from, stride * count)?;
    if stride == 1 {
        return Ok(run);
    }
    let mut dims = x.dims().to_vec();
    dims.splice(dim..=dim, [count, stride]);
    run.reshape(dims)?.narrow(dim + 1, 0, 1)?.squeeze(dim + 1)
}

/// A dimension with numbers before and after it that are never the largest.
fn pad_with_least(x: &Tensor, dim: usize, before: usize, after: usize) -> Result<Tensor> {
    let least = |count: usize| {
        let mut dims = x.dims().to_vec();
        dims[dim] = count;
        Tensor::full(f32::NEG_INFINITY, dims, x.device())?.to_dtype(x.dtype())
    };
    let mut parts = vec![x.clone()];
    if before > 0 {
        parts.insert(0, least(before)?);
    }
    if after > 0 {
        parts.push(least(after)?);
    }
    Ok(Tensor::cat(&parts, dim)?)
}
