//! Baseline JPEGs shrunk while they are decoded: to 1/2, 1/4 or 1/8.
//!
//! The mean of two (four, eight) neighbouring samples is a sum of cosines like the samples
//! themselves. Let `X[k]` be the coefficients of eight samples, `x[n] = sum of c[k] / 2 X[k]
//! cos((2n + 1) k pi / 16)` with `c[0] = 1 / sqrt 2`, else 1 (T.81, A.3.3). The means of each `R`
//! samples, `N = 8 / R` of them, are
//!
//! ```text
//! m[j] = sum of c[k] / 2 X[k] a[k] cos((2j + 1) k pi / 2N)
//! a[k] = sin(R k pi / 16) / (R sin(k pi / 16)), a[0] = 1
//! ```
//!
//! and since that cosine for `k >= N` is plus or minus one of those below `N`, or zero, every
//! coefficient adds to one of `N`, by a weight that is known beforehand. So a block takes a
//! multiplication for each of its coefficients and a transform of `N x N`; the result is that of
//! decoding it whole and taking means, up to rounding.

use std::{array, f32::consts::FRAC_1_SQRT_2, f64::consts::PI};

use glam::{Mat4, Vec4};
use pulp::{Arch, Simd, WithSimd};

use crate::dataset::picture::{
    jpeg_baseline::{Baseline, Block, Blocks, Component},
    jpeg_tables::{COEFFICIENTS, ZIGZAG},
    planes::{Plane, Planes},
};

/// By how much pictures can be shrunk, most first.
pub const REDUCTIONS: [usize; 3] = [8, 4, 2];

/// Most samples on a side of a shrunk block.
const MOST: usize = 4;

/// Decode at 1 / `reduction` of the size; `reduction` is one of [`REDUCTIONS`].
///
/// # Errors
///
/// A sentence: what is wrong with the picture.
pub fn decode(jpeg: &Baseline, reduction: usize) -> Result<Planes, String> {
    Arch::new().dispatch(Decoding { jpeg, reduction })
}

/// Decoding, to be compiled for each kind of vector unit; what it gives is the same.
struct Decoding<'j, 'd> {
    jpeg: &'j Baseline<'d>,
    reduction: usize,
}

impl WithSimd for Decoding<'_, '_> {
    type Output = Result<Planes, String>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) -> Self::Output {
        match self.reduction {
            8 => decode_to::<1>(self.jpeg),
            4 => decode_to::<2>(self.jpeg),
            _ => decode_to::<4>(self.jpeg),
        }
    }
}

/// Decode to `N` x `N` samples a block.
#[inline(always)]
fn decode_to<const N: usize>(jpeg: &Baseline) -> Result<Planes, String> {
    let (units_across, units_down) = jpeg.units();
    let luma = &jpeg.components[0];
    let plane = |of: &Component| {
        let (width, height) = (units_across * of.across * N, units_down * of.down * N);
        let pixels = [luma.across / of.across, luma.down / of.down].map(|n| n * 8 / N);
        Plane { width, height, data: vec![0; width * height], pixels }
    };
    let weights = |of: &Component| Weights::new(&of.quantiser, N);
    let weights: Vec<Weights> = jpeg.components.iter().map(weights).collect();
    let mut shrinking = Shrinking::<N> {
        planes: jpeg.components.iter().map(plane).collect(),
        blocks: array::from_fn(|at| Shrunk::new(&weights[at.min(weights.len() - 1)])),
    };
    jpeg.decode(&mut shrinking)?;
    let mut planes = shrinking.planes.into_iter();
    let luma = planes.next().ok_or("a JPEG without components")?;
    Ok(Planes { luma, colour: planes.next().zip(planes.next()).map(|(cb, cr)| [cb, cr]) })
}

/// The planes as far as they are made, and the block of each that is being read.
struct Shrinking<'w, const N: usize> {
    planes: Vec<Plane>,
    blocks: [Shrunk<'w>; 3],
}

impl<'w, const N: usize> Blocks for Shrinking<'w, N> {
    type Block = Shrunk<'w>;

    #[inline(always)]
    fn block(&mut self, component: usize) -> &mut Shrunk<'w> {
        &mut self.blocks[component]
    }

    #[inline(always)]
    fn done(&mut self, component: usize, column: usize, row: usize) {
        let plane = &mut self.planes[component];
        let start = row * N * plane.width + column * N;
        self.blocks[component].finish::<N>(plane.width, &mut plane.data[start..]);
    }
}

/// To which of the shrunk block's coefficients each one adds, and by how much, in the order in
/// which they are stored.
struct Weights([(u8, f32); COEFFICIENTS]);

impl Weights {
    fn new(quantiser: &[u16; COEFFICIENTS], samples: usize) -> Weights {
        let axis: [(usize, f64); 8] = array::from_fn(|k| fold(k, samples));
        let entry = |at: usize| {
            let (row, column) = (usize::from(ZIGZAG[at]) / 8, usize::from(ZIGZAG[at]) % 8);
            let ((down, over), (across, beside)) = (axis[row], axis[column]);
            let weight = f64::from(quantiser[at]) * over * beside;
            ((down * MOST + across) as u8, weight as f32)
        };
        Weights(array::from_fn(entry))
    }
}

/// To which coefficient of so many samples coefficient `k` of eight adds, and by what weight.
fn fold(k: usize, samples: usize) -> (usize, f64) {
    if k == 0 {
        return (0, 0.5 * 0.5_f64.sqrt());
    }
    let (angle, reduction) = (k as f64 * PI / 16.0, (8 / samples) as f64);
    let mean = 0.5 * (reduction * angle).sin() / (reduction * angle.sin());
    // The cosines repeat after 4 N, are mirrored at 2 N, and with the other sign at N.
    let within = k % (4 * samples);
    let within = if within > 2 * samples { 4 * samples - within } else { within };
    match within {
        near if near < samples => (near, mean),
        near if near == samples => (0, 0.0),
        far => (2 * samples - far, -mean),
    }
}

/// The coefficients of one shrunk block.
struct Shrunk<'w> {
    weights: &'w Weights,
    /// In rows of [`MOST`].
    sums: [f32; MOST * MOST],
}

impl Block for Shrunk<'_> {
    #[inline(always)]
    fn set(&mut self, at: usize, value: i32) {
        let (slot, weight) = self.weights.0[at % COEFFICIENTS];
        self.sums[usize::from(slot) % (MOST * MOST)] += value as f32 * weight;
    }
}

impl<'w> Shrunk<'w> {
    fn new(weights: &'w Weights) -> Shrunk<'w> {
        Shrunk { weights, sums: [0.0; MOST * MOST] }
    }

    /// The samples into rows of a plane; then begin anew.
    #[inline(always)]
    fn finish<const N: usize>(&mut self, row_len: usize, plane: &mut [u8]) {
        // Its columns are the rows of the block.
        let sums = Mat4::from_cols_array(&self.sums);
        self.sums = [0.0; MOST * MOST];
        let columns = match N {
            4 => four(four(sums).transpose()),
            2 => two(two(sums).transpose()),
            _ => sums,
        };
        for (row, samples) in rows(columns).iter().take(N).enumerate() {
            plane[row * row_len..][..N].copy_from_slice(&samples[..N]);
        }
    }
}

/// Columns of samples as rows of bytes, rounded to the nearest, with 128 in the middle.
#[inline(always)]
fn rows(columns: Mat4) -> [[u8; MOST]; MOST] {
    /// Added to a number below it, this leaves the number's integer in the lowest bits.
    const ROUNDING: f32 = 8_388_608.0;
    let [a, b, c, d] = [columns.x_axis, columns.y_axis, columns.z_axis, columns.w_axis]
        .map(|column| (column + 128.0).clamp(Vec4::ZERO, Vec4::splat(255.0)))
        .map(|column| (column + ROUNDING) - ROUNDING);
    // Two bytes of each row in one number: what four rows do at once, none has to do alone.
    let (left, right) = (b * 256.0 + a + ROUNDING, d * 256.0 + c + ROUNDING);
    let (left, right) = (left.to_array(), right.to_array());
    array::from_fn(|row| (right[row].to_bits() << 16 | left[row].to_bits() & 0xffff).to_le_bytes())
}

/// Four samples of each column from four coefficients.
#[inline(always)]
fn four(z: Mat4) -> Mat4 {
    // cos(pi / 8) and cos(3 pi / 8).
    const C1: f32 = 0.923_879_5;
    const C3: f32 = 0.382_683_43;
    let (even, odd) = (z.x_axis + z.z_axis * FRAC_1_SQRT_2, z.x_axis - z.z_axis * FRAC_1_SQRT_2);
    let (outer, inner) = (z.y_axis * C1 + z.w_axis * C3, z.y_axis * C3 - z.w_axis * C1);
    Mat4::from_cols(even + outer, odd + inner, odd - inner, even - outer)
}

/// Two samples of each column from two coefficients.
#[inline(always)]
fn two(z: Mat4) -> Mat4 {
    let odd = z.y_axis * FRAC_1_SQRT_2;
    Mat4::from_cols(z.x_axis + odd, z.x_axis - odd, Vec4::ZERO, Vec4::ZERO)
}
