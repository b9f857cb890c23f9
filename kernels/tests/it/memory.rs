//! Memory that is used again.

use pmp_kernels::buffers::{Buffer, KEPT_BYTES};

#[test]
fn what_was_given_back_is_given_out_again() {
    let mut one = Buffer::any(1_234_567);
    one[0] = 42.0;
    let place = one.as_ptr();
    drop(one);
    // No other test asks for so much.
    let again = Buffer::any(1_234_000);
    assert_eq!(again.as_ptr(), place);
    assert_eq!(again.len(), 1_234_000);
    drop(again);
    assert!(Buffer::zeros(1_234_000).iter().all(|x| *x == 0.0));
}

#[test]
fn more_than_the_bound_is_not_kept() {
    // Never touched, so never really there.
    let huge = Buffer::any(KEPT_BYTES / 4 + 1);
    assert_eq!(huge.len(), KEPT_BYTES / 4 + 1);
    drop(huge);
}
