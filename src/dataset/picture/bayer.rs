//! Colours of a picture taken through a Bayer mosaic.

use crate::dataset::picture::rgb::Rgb;

/// Give every pixel its three colours: its own, and of the others the mean of the nearest
/// neighbours that have them (bilinear). At the border, neighbours are mirrored, which keeps
/// their colours.
///
/// `mosaic` has one sample a pixel, row by row; `red` is column and row of the red one in each 2 x 2,
/// blue is diagonal to it, green are the others.
pub fn demosaic(width: usize, height: usize, red: [usize; 2], mosaic: &[u8]) -> Rgb {
    let mut data = Vec::with_capacity(3 * width * height);
    for y in 0..height {
        let (above, below) = neighbours(y, height);
        let [above, row, below] = [above, y, below].map(|row| &mosaic[row * width..][..width]);
        let is_red_row = y % 2 == red[1];
        for x in 0..width {
            let (left, right) = neighbours(x, width);
            let own = row[x];
            let beside = mean([row[left], row[right]]);
            let over = mean([above[x], below[x]]);
            data.extend_from_slice(&match (is_red_row, x % 2 == red[0]) {
                (true, true) | (false, false) => {
                    let cross = mean([row[left], row[right], above[x], below[x]]);
                    let corners = mean([above[left], above[right], below[left], below[right]]);
                    if is_red_row { [own, cross, corners] } else { [corners, cross, own] }
                }
                // Green between two reds, or between two blues.
                (true, false) => [beside, own, over],
                (false, true) => [over, own, beside],
            });
        }
    }
    Rgb { width, height, data }
}

/// The positions before and behind one; outside of the picture, those on the other side of it.
fn neighbours(at: usize, len: usize) -> (usize, usize) {
    let before = at.checked_sub(1);
    let behind = Some(at + 1).filter(|next| *next < len);
    (before.or(behind).unwrap_or(at), behind.or(before).unwrap_or(at))
}

/// Rounded to the nearest, halves up.
fn mean<const N: usize>(samples: [u8; N]) -> u8 {
    let sum: usize = samples.iter().map(|sample| usize::from(*sample)).sum();
    ((sum + N / 2) / N) as u8
}
