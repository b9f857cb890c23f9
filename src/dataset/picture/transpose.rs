//! Rows of bytes to columns.

use std::array;

/// Bytes on a side of the blocks that are turned at once.
const SIDE: usize = 8;

/// The columns of rows of `row_len` bytes, one after the other.
pub fn transposed(bytes: &[u8], row_len: usize) -> Vec<u8> {
    let rows = bytes.len() / row_len;
    let mut columns = vec![0; bytes.len()];
    let (whole_rows, whole_columns) = (rows - rows % SIDE, row_len - row_len % SIDE);
    for row in (0..whole_rows).step_by(SIDE) {
        for column in (0..whole_columns).step_by(SIDE) {
            let block = array::from_fn(|y| eight(&bytes[(row + y) * row_len + column..]));
            for (x, turned) in turned(block).into_iter().enumerate() {
                columns[(column + x) * rows + row..][..SIDE].copy_from_slice(&turned.to_le_bytes());
            }
        }
    }
    for row in 0..rows {
        let from = if row < whole_rows { whole_columns } else { 0 };
        for column in from..row_len {
            columns[column * rows + row] = bytes[row * row_len + column];
        }
    }
    columns
}

#[inline(always)]
fn eight(bytes: &[u8]) -> u64 {
    u64::from_le_bytes(bytes.first_chunk().copied().unwrap_or_default())
}

/// A block of eight rows, the first byte of each in its lowest bits: blocks of four, then of two,
/// then single bytes change places across the diagonal.
#[inline(always)]
fn turned(mut rows: [u64; SIDE]) -> [u64; SIDE] {
    for (side, kept) in
        [(4, 0x0000_0000_ffff_ffff), (2, 0x0000_ffff_0000_ffff), (1, 0x00ff_00ff_00ff_00ff)]
    {
        for upper in (0..SIDE).filter(|row| row & side == 0) {
            let lower = upper + side;
            let changed = (rows[upper] >> (8 * side) ^ rows[lower]) & kept;
            rows[lower] ^= changed;
            rows[upper] ^= changed << (8 * side);
        }
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::transposed;

    #[test]
    fn every_byte_changes_row_for_column() {
        for (rows, row_len) in [(1, 1), (8, 8), (16, 24), (3, 40), (17, 5), (250, 643)] {
            let bytes: Vec<u8> = (0..rows * row_len).map(|at| (at * 7919 / 16) as u8).collect();
            let columns = transposed(&bytes, row_len);
            for (row, column) in
                (0..rows).flat_map(|row| (0..row_len).map(move |column| (row, column)))
            {
                assert_eq!(columns[column * rows + row], bytes[row * row_len + column]);
            }
        }
    }
}
