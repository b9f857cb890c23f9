//! Shares of work whose bounds depend on shapes only.

use std::ops::Range;

/// `count` things in shares of `each`, the last one smaller.
pub(crate) fn shares(count: usize, each: usize) -> Vec<Range<usize>> {
    (0..count).step_by(each.max(1)).map(|from| from..(from + each).min(count)).collect()
}

/// Parts of a slice, one after another, of these lengths.
pub(crate) fn split<T>(
    mut whole: &mut [T],
    lens: impl IntoIterator<Item = usize>,
) -> Vec<&mut [T]> {
    let mut parts = vec![];
    for len in lens {
        let (part, rest) = whole.split_at_mut(len);
        parts.push(part);
        whole = rest;
    }
    assert!(whole.is_empty(), "the parts are the whole");
    parts
}

/// Add the parts of `len` numbers, first to last, into `sum`.
pub(crate) fn add_up(parts: &[f32], sum: &mut [f32]) {
    let mut parts = parts.chunks_exact(sum.len());
    sum.copy_from_slice(parts.next().expect("there is a part"));
    for part in parts {
        sum.iter_mut().zip(part).for_each(|(sum, x)| *sum += x);
    }
}

/// Rows of some images of a batch: either whole images or some rows of one, so that they lie one
/// behind another in memory.
#[derive(Clone, Debug)]
pub(crate) struct Block {
    pub(crate) images: Range<usize>,
    pub(crate) rows: Range<usize>,
}

impl Block {
    /// Rows in it.
    pub(crate) fn len(&self) -> usize {
        self.images.len() * self.rows.len()
    }
}

/// A batch of images of `rows` rows in blocks of about `each` rows.
pub(crate) fn blocks(batch: usize, rows: usize, each: usize) -> Vec<Block> {
    if each >= rows {
        let images = shares(batch, each / rows.max(1)).into_iter();
        return images.map(|images| Block { images, rows: 0..rows }).collect();
    }
    let of_image = |image: usize| {
        let even = rows.div_ceil(rows.div_ceil(each.max(1)));
        shares(rows, even).into_iter().map(move |rows| Block { images: image..image + 1, rows })
    };
    (0..batch).flat_map(of_image).collect()
}
