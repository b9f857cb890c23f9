//! What Rust cannot check, all in this file: `gemm`, which takes raw pointers, and a switch of the
//! C library's allocator.
#![allow(unsafe_code)]

use gemm::Parallelism;

/// A matrix in a slice: number (i, j) lies at `i * down + j * right`.
#[derive(Clone, Copy)]
pub(crate) struct Matrix<'a> {
    pub(crate) numbers: &'a [f32],
    pub(crate) down: usize,
    pub(crate) right: usize,
}

/// `out += left * right` where `add`, else `out = left * right`, on this thread.
///
/// `left` is `m` x `k`, `right` is `k` x `n`. `out` is `m` x `n`, number (i, j) of it at
/// `i + j * stride`: whatever is multiplied here has its channels as rows, one beside another.
pub(crate) fn multiply(
    [m, n, k]: [usize; 3],
    left: Matrix,
    right: Matrix,
    out: &mut [f32],
    stride: usize,
    add: bool,
) {
    if m == 0 || n == 0 {
        return;
    }
    let last = |matrix: Matrix, rows: usize, columns: usize| {
        let down = (rows - 1).saturating_mul(matrix.down);
        down.saturating_add((columns - 1).saturating_mul(matrix.right))
    };
    assert!(k > 0, "a product sums over something");
    assert!(last(left, m, k) < left.numbers.len(), "the left matrix lies in its slice");
    assert!(last(right, k, n) < right.numbers.len(), "the right matrix lies in its slice");
    assert!(m <= stride || n == 1, "no two numbers of the product lie at one place");
    assert!(
        (n - 1).saturating_mul(stride).saturating_add(m - 1) < out.len(),
        "the product lies in its slice"
    );
    let sign = |stride: usize| isize::try_from(stride).expect("a stride within a slice");
    // SAFETY: `gemm` reads numbers (i, j) of both factors and reads and writes those of the
    // product, at the offsets asserted above to be within the slices. The slices are valid for
    // reads of initialised numbers, the product's for writes as well, for the length of the call,
    // and the product, borrowed mutably, overlaps neither factor.
    unsafe {
        gemm::gemm(
            m,
            n,
            k,
            out.as_mut_ptr(),
            sign(stride),
            1,
            add,
            left.numbers.as_ptr(),
            sign(left.right),
            sign(left.down),
            right.numbers.as_ptr(),
            sign(right.right),
            sign(right.down),
            1.0,
            1.0,
            false,
            false,
            false,
            Parallelism::None,
        );
    }
}

/// See [`crate::buffers::keep_freed_memory`].
#[cfg(all(target_os = "linux", target_env = "gnu"))]
pub(crate) fn keep_freed_memory() {
    use std::ffi::c_int;
    // Of glibc's malloc.h.
    const TRIM_THRESHOLD: c_int = -1;
    const MMAP_MAX: c_int = -4;
    const ARENA_MAX: c_int = -8;
    unsafe extern "C" {
        fn mallopt(parameter: c_int, value: c_int) -> c_int;
    }
    // SAFETY: glibc declares `int mallopt(int, int)`; it may be called at any time, locks what it
    // changes, and these parameters only tell when memory is given back to the system and
    // that what one thread frees another may have.
    unsafe {
        mallopt(MMAP_MAX, 0);
        mallopt(TRIM_THRESHOLD, c_int::MAX);
        mallopt(ARENA_MAX, 1);
    }
}
