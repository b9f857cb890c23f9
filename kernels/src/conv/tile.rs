//! Winograd's minimal filtering of three taps, in one dimension, on vectors of channels.
//!
//! F(2, 3) and F(4, 3) of Lavin & Gray, 2016, arXiv:1509.09308: `y = A' ((G g) . (B' d))`, for `N`
//! inputs `d`, three taps `g` and `M` outputs `y`. `N` is 4 or 6 and `M` is `N - 2`; the same maps
//! in both directions of a picture make tiles of `M` x `M`. The gradients are the adjoint maps.

use pulp::Simd;

/// `B' d`: inputs to products.
#[inline(always)]
pub(crate) fn input<S: Simd, const N: usize>(simd: S, d: [S::f32s; N]) -> [S::f32s; N] {
    let add = |a, b| simd.add_f32s(a, b);
    let sub = |a, b| simd.sub_f32s(a, b);
    let times = |k: f32, a, b| simd.mul_add_f32s(simd.splat_f32s(k), a, b);
    let mut v = d;
    if N == 4 {
        v[0] = sub(d[0], d[2]);
        v[1] = add(d[1], d[2]);
        v[2] = sub(d[2], d[1]);
        v[3] = sub(d[1], d[3]);
        // The sign of the last is that of `output`.
    } else {
        let even = times(-4.0, d[2], d[4]);
        let odd = times(-4.0, d[1], d[3]);
        v[0] = times(4.0, d[0], times(-5.0, d[2], d[4]));
        v[1] = add(even, odd);
        v[2] = sub(even, odd);
        let (even, odd) = (sub(d[4], d[2]), sub(d[3], d[1]));
        v[3] = times(2.0, odd, even);
        v[4] = times(-2.0, odd, even);
        v[5] = times(4.0, d[1], times(-5.0, d[3], d[5]));
    }
    v
}

/// `A' m`: products to outputs.
#[inline(always)]
pub(crate) fn output<S: Simd, const N: usize, const M: usize>(
    simd: S,
    m: [S::f32s; N],
) -> [S::f32s; M] {
    let add = |a, b| simd.add_f32s(a, b);
    let sub = |a, b| simd.sub_f32s(a, b);
    let times = |k: f32, a, b| simd.mul_add_f32s(simd.splat_f32s(k), a, b);
    let mut y = [simd.splat_f32s(0.0); M];
    if N == 4 {
        y[0] = add(m[0], add(m[1], m[2]));
        y[1] = sub(sub(m[1], m[2]), m[3]);
    } else {
        let (sum, difference) = (add(m[1], m[2]), sub(m[1], m[2]));
        let (sum2, difference2) = (add(m[3], m[4]), sub(m[3], m[4]));
        y[0] = add(m[0], add(sum, sum2));
        y[1] = times(2.0, difference2, difference);
        y[2] = times(4.0, sum2, sum);
        y[3] = add(times(8.0, difference2, difference), m[5]);
    }
    y
}

/// `A y`, the adjoint of [`output`]: gradients of outputs to those of products.
#[inline(always)]
pub(crate) fn output_adjoint<S: Simd, const N: usize, const M: usize>(
    simd: S,
    y: [S::f32s; M],
) -> [S::f32s; N] {
    let add = |a, b| simd.add_f32s(a, b);
    let sub = |a, b| simd.sub_f32s(a, b);
    let times = |k: f32, a, b| simd.mul_add_f32s(simd.splat_f32s(k), a, b);
    let mut m = [simd.splat_f32s(0.0); N];
    if N == 4 {
        m[0] = y[0];
        m[1] = add(y[0], y[1]);
        m[2] = sub(y[0], y[1]);
        m[3] = simd.neg_f32s(y[1]);
    } else {
        let (even, odd) = (add(y[0], y[2]), add(y[1], y[3]));
        let even2 = times(4.0, y[2], y[0]);
        let odd2 = times(4.0, y[3], y[1]);
        m[0] = y[0];
        m[1] = add(even, odd);
        m[2] = sub(even, odd);
        m[3] = times(2.0, odd2, even2);
        m[4] = times(-2.0, odd2, even2);
        m[5] = y[3];
    }
    m
}

/// `G g`: taps to factors.
#[inline(always)]
pub(crate) fn kernel<S: Simd, const N: usize>(simd: S, g: [S::f32s; 3]) -> [S::f32s; N] {
    let add = |a, b| simd.add_f32s(a, b);
    let sub = |a, b| simd.sub_f32s(a, b);
    let scale = |k: f32, a| simd.mul_f32s(simd.splat_f32s(k), a);
    let times = |k: f32, a, b| simd.mul_add_f32s(simd.splat_f32s(k), a, b);
    let mut u = [simd.splat_f32s(0.0); N];
    u[N - 1] = g[2];
    if N == 4 {
        let ends = add(g[0], g[2]);
        u[0] = g[0];
        u[1] = scale(0.5, add(ends, g[1]));
        u[2] = scale(0.5, sub(ends, g[1]));
    } else {
        let ends = add(g[0], g[2]);
        let ends4 = times(4.0, g[2], g[0]);
        u[0] = scale(0.25, g[0]);
        u[1] = scale(-1.0 / 6.0, add(ends, g[1]));
        u[2] = scale(-1.0 / 6.0, sub(ends, g[1]));
        u[3] = scale(1.0 / 24.0, times(2.0, g[1], ends4));
        u[4] = scale(1.0 / 24.0, times(-2.0, g[1], ends4));
    }
    u
}

/// `G' u`, the adjoint of [`kernel`]: gradients of factors to those of taps.
#[inline(always)]
pub(crate) fn kernel_adjoint<S: Simd, const N: usize>(simd: S, u: [S::f32s; N]) -> [S::f32s; 3] {
    let add = |a, b| simd.add_f32s(a, b);
    let sub = |a, b| simd.sub_f32s(a, b);
    let scale = |k: f32, a| simd.mul_f32s(simd.splat_f32s(k), a);
    let times = |k: f32, a, b| simd.mul_add_f32s(simd.splat_f32s(k), a, b);
    if N == 4 {
        let (sum, difference) = (add(u[1], u[2]), sub(u[1], u[2]));
        [times(0.5, sum, u[0]), scale(0.5, difference), times(0.5, sum, u[3])]
    } else {
        let (sum, difference) = (add(u[1], u[2]), sub(u[1], u[2]));
        let (sum2, difference2) = (add(u[3], u[4]), sub(u[3], u[4]));
        let ends = scale(-1.0 / 6.0, sum);
        [
            times(0.25, u[0], times(1.0 / 24.0, sum2, ends)),
            times(1.0 / 12.0, difference2, scale(-1.0 / 6.0, difference)),
            add(u[5], times(1.0 / 6.0, sum2, ends)),
        ]
    }
}
