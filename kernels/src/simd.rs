//! Vectors of as many channels as the processor takes at once.

use pulp::Simd;

/// Run with the widest vectors that this processor has.
pub(crate) fn widest<Op: pulp::WithSimd>(op: Op) -> Op::Output {
    pulp::Arch::new().dispatch(op)
}

/// The vector that begins at a number; zeros behind the end of the slice.
#[inline(always)]
pub(crate) fn load<S: Simd>(simd: S, x: &[f32], at: usize) -> S::f32s {
    let x = &x[at..];
    match x.first_chunk_of::<S>() {
        Some(whole) => whole,
        None => simd.partial_load_f32s(x),
    }
}

/// Store what fits in front of the end of the slice.
#[inline(always)]
pub(crate) fn store<S: Simd>(simd: S, x: &mut [f32], at: usize, value: S::f32s) {
    let x = &mut x[at..];
    if x.len() >= S::F32_LANES {
        S::as_mut_simd_f32s(&mut x[..S::F32_LANES]).0[0] = value;
    } else {
        simd.partial_store_f32s(x, value);
    }
}

trait FirstVector {
    fn first_chunk_of<S: Simd>(&self) -> Option<S::f32s>;
}

impl FirstVector for [f32] {
    #[inline(always)]
    fn first_chunk_of<S: Simd>(&self) -> Option<S::f32s> {
        (self.len() >= S::F32_LANES).then(|| S::as_simd_f32s(&self[..S::F32_LANES]).0[0])
    }
}
