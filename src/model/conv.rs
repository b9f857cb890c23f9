//! The convolution of the encoders: 3 x 3, stride 2, padding 1, as a matrix product.
//!
//! candle's own backward pass is a naive transposed convolution, several times as slow as its
//! forward pass. Here the nine pixels under the kernel are laid out as rows of a matrix, and both
//! passes are matrix products. Activations are `[C, B, H, W]`, so that the product of
//! `[C_out, 9 C]` and `[9 C, B H W]` is the next activation, and nothing is ever transposed.
//! Every output number is summed in one order, so the result does not depend on the threads.

use candle_core::{CpuStorage, CustomOp1, Layout, Shape, Tensor};
use rayon::prelude::*;

use crate::error::Result;

/// Convolve and halve the picture.
///
/// # Shapes
///
/// | name     | shape                   | note                              |
/// |----------|-------------------------|-----------------------------------|
/// | `x`      | `[C, B, H, W]`          | channels first; H and W even      |
/// | `weight` | `[C_out, C, 3, 3]`      | as PyTorch and candle have it     |
/// | `bias`   | `[C_out]`               |                                   |
/// | returns  | `[C_out, B, H/2, W/2]`  |                                   |
///
/// # Errors
///
/// [`Error::Tensor`](crate::error::Error::Tensor) if shapes disagree, a side is odd, or the type
/// is neither f32 nor f64.
pub fn conv3x3_stride2(x: &Tensor, weight: &Tensor, bias: &Tensor) -> Result<Tensor> {
    let (channels, batch, height, width) = x.dims4()?;
    let picture = Picture { channels, batch, height, width };
    let columns = x.contiguous()?.apply_op1(Gather(picture))?; // [9 C, B H/2 W/2]
    let kernel = weight.permute((0, 2, 3, 1))?.flatten_from(1)?; // [C_out, 9 C], C fastest
    let out = kernel.matmul(&columns)?.broadcast_add(&bias.unsqueeze(1)?)?;
    Ok(out.reshape(((), batch, height / 2, width / 2))?)
}

/// Shape of an activation.
#[derive(Clone, Copy, Debug)]
struct Picture {
    channels: usize,
    batch: usize,
    height: usize,
    width: usize,
}

impl Picture {
    /// Pixels of a channel.
    fn area(self) -> usize {
        self.batch * self.height * self.width
    }

    /// Call `pair` with each row of a channel's pixels under a tap of the kernel: where it starts
    /// in the channel, where its column numbers start in the row of the matrix, and how many
    /// numbers there are. Successive numbers are two pixels apart. What is left out is padding.
    fn rows(self, tap: usize, mut pair: impl FnMut(usize, usize, usize)) {
        let (h, w) = (self.height / 2, self.width / 2);
        let (down, right) = (tap / 3, tap % 3); // pixel = 2 x output + this - 1
        for image in 0..self.batch {
            for row in usize::from(down == 0)..h {
                let pixels = (image * self.height + 2 * row + down - 1) * self.width;
                let skip = usize::from(right == 0);
                let first = pixels + 2 * skip + right - 1;
                pair(first, (image * h + row) * w + skip, w - skip);
            }
        }
    }

    /// `[C, B, H, W]` to `[9 C, B H/2 W/2]`.
    fn gather<T: Copy + Default + Send + Sync>(self, x: &[T]) -> Vec<T> {
        let mut out = vec![T::default(); 9 * self.channels * self.area() / 4];
        out.par_chunks_mut(self.area() / 4).enumerate().for_each(|(i, out)| {
            let channel = &x[i % self.channels * self.area()..][..self.area()];
            self.rows(i / self.channels, |from, to, count| {
                let pixels = channel[from..].iter().step_by(2);
                out[to..to + count].iter_mut().zip(pixels).for_each(|(out, x)| *out = *x);
            });
        });
        out
    }

    /// The gradient of that: `[9 C, B H/2 W/2]` summed into `[C, B, H, W]`.
    fn scatter<T>(self, columns: &[T]) -> Vec<T>
    where
        T: Copy + Default + Send + Sync + std::ops::AddAssign,
    {
        let mut out = vec![T::default(); self.channels * self.area()];
        out.par_chunks_mut(self.area()).enumerate().for_each(|(channel, out)| {
            for tap in 0..9 {
                let columns = &columns[(tap * self.channels + channel) * self.area() / 4..];
                self.rows(tap, |to, from, count| {
                    let pixels = out[to..].iter_mut().step_by(2);
                    pixels.zip(&columns[from..from + count]).for_each(|(out, x)| *out += *x);
                });
            }
        });
        out
    }
}

struct Gather(Picture);

struct Scatter(Picture);

impl CustomOp1 for Gather {
    fn name(&self) -> &'static str {
        "conv3x3-stride2-columns"
    }

    fn cpu_fwd(
        &self,
        storage: &CpuStorage,
        layout: &Layout,
    ) -> candle_core::Result<(CpuStorage, Shape)> {
        let picture = self.0;
        if !(picture.height.is_multiple_of(2) && picture.width.is_multiple_of(2)) {
            candle_core::bail!("{}: sides must be even, got {picture:?}", self.name());
        }
        let shape = Shape::from((9 * picture.channels, picture.area() / 4));
        let out = match (storage, span(layout)?) {
            (CpuStorage::F32(x), span) => CpuStorage::F32(picture.gather(&x[span])),
            (CpuStorage::F64(x), span) => CpuStorage::F64(picture.gather(&x[span])),
            _ => candle_core::bail!("{}: neither f32 nor f64", self.name()),
        };
        Ok((out, shape))
    }

    fn bwd(&self, _: &Tensor, _: &Tensor, grad: &Tensor) -> candle_core::Result<Option<Tensor>> {
        Ok(Some(grad.contiguous()?.apply_op1_no_bwd(&Scatter(self.0))?))
    }
}

impl CustomOp1 for Scatter {
    fn name(&self) -> &'static str {
        "conv3x3-stride2-pixels"
    }

    fn cpu_fwd(
        &self,
        storage: &CpuStorage,
        layout: &Layout,
    ) -> candle_core::Result<(CpuStorage, Shape)> {
        let picture @ Picture { channels, batch, height, width } = self.0;
        let out = match (storage, span(layout)?) {
            (CpuStorage::F32(x), span) => CpuStorage::F32(picture.scatter(&x[span])),
            (CpuStorage::F64(x), span) => CpuStorage::F64(picture.scatter(&x[span])),
            _ => candle_core::bail!("{}: neither f32 nor f64", self.name()),
        };
        Ok((out, Shape::from((channels, batch, height, width))))
    }
}

/// Where the numbers of a contiguous tensor lie in its storage.
fn span(layout: &Layout) -> candle_core::Result<std::ops::Range<usize>> {
    match layout.contiguous_offsets() {
        Some((from, to)) => Ok(from..to),
        None => candle_core::bail!("columns of a tensor that is not contiguous"),
    }
}
