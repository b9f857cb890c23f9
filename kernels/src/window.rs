//! How a window moves over a padded picture.

/// Height and width of what a window of `kernel` makes of a picture of `size`, both down and right;
/// `None` if the padded picture is smaller than the window.
pub(crate) fn out_size(
    size: [usize; 2],
    kernel: [usize; 2],
    stride: [usize; 2],
    padding: [usize; 2],
) -> Option<[usize; 2]> {
    let side = |i: usize| {
        let room = (size[i] + 2 * padding[i]).checked_sub(kernel[i])?;
        Some(room / stride[i] + 1)
    };
    Some([side(0)?, side(1)?])
}
