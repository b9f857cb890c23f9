//! 3 x 3 convolutions of stride 1 on tiles: fewer multiplications, the same numbers.
//!
//! Tiles of `N` x `N` inputs become `N`^2 planes of numbers; in each plane the channels are
//! multiplied as matrices; the planes become tiles of `M` x `M` results, `M = N - 2`. The gradient
//! of the input is such a convolution as well, that of the weight the adjoint of it.
//!
//! Small weights stay in the cache, so a block of tiles goes through all three stages at once.
//! Large ones are brought into planes for a few channels at a time and multiplied with all tiles.

// Rows and columns of small matrices are counted, not walked.
#![allow(clippy::needless_range_loop)]

use std::ops::Range;

use pulp::{Simd, WithSimd};
use rayon::prelude::*;

use crate::{
    buffers::Buffer,
    conv::{Input, Shape, tile},
    foreign::{Matrix, multiply},
    norm::Affine,
    pieces::{Block, add_up, blocks, shares, split},
    simd::{load, store, widest},
};

/// Channels of a result that are multiplied together: what `gemm` takes at once.
const TOGETHER: usize = 64;

/// Channels of the input whose factors, `N`^2 planes of them, stay in a second-level cache.
const CHUNK: usize = 96;

/// Pairs of channels from which on a weight is large.
const LARGE: usize = 96 * 96;

/// Tiles of a block.
const TILES: usize = 48;

/// From a plane of `len` numbers to the next: an odd number of cache lines, or all planes would
/// compete for the same few places of the cache.
fn stride(len: usize) -> usize {
    16 * (len.div_ceil(16) | 1)
}

/// A cut of the results into tiles, and of those into blocks.
struct Grid {
    /// Tiles beside one another.
    across: usize,
    blocks: Vec<Block>,
}

impl Grid {
    fn new(shape: &Shape, side: usize) -> Self {
        let [height, width] = shape.out();
        let (down, across) = (height.div_ceil(side), width.div_ceil(side));
        Self { across, blocks: blocks(shape.batch, down, TILES.div_ceil(across)) }
    }

    /// Tiles of a block.
    fn tiles(&self, block: &Block) -> usize {
        block.len() * self.across
    }

    fn all_tiles(&self) -> usize {
        self.blocks.iter().map(|block| self.tiles(block)).sum()
    }

    /// The image and the place (down, across) of each tile of a block.
    fn places(&self, block: &Block) -> impl Iterator<Item = (usize, usize, usize)> + use<> {
        let (Block { images, rows }, across) = (block.clone(), self.across);
        let all = images.flat_map(move |image| rows.clone().map(move |down| (image, down)));
        all.flat_map(move |(image, down)| (0..across).map(move |across| (image, down, across)))
    }
}

pub(crate) fn forward<const N: usize, const M: usize>(
    shape: &Shape,
    x: Input,
    weight: &[f32],
    turned: bool,
    bias: Option<&[f32]>,
    out: &mut [f32],
) {
    let grid = Grid::new(shape, M);
    let (c, o) = (shape.channels, shape.out_channels);
    let [height, width] = shape.out();
    let out_len = |block: &Block| {
        let rows = (block.rows.end * M).min(height) - block.rows.start * M;
        block.images.len() * rows * width * o
    };
    let outs = split(out, grid.blocks.iter().map(out_len));
    let to_tiles = |block: &Block| {
        let mut planes = Buffer::any(N * N * stride(grid.tiles(block) * c));
        let to = &mut planes;
        widest(ToTiles::<N, M> { shape, grid: &grid, x, block, planes: to });
        planes
    };
    let kernel = |few: &Range<usize>, chunk: Range<usize>, planes: &mut [f32]| {
        let few = few.clone();
        widest(ToFactors::<N> { shape, weight, turned, few, chunk, planes });
    };
    // A plane of a block to products `[tiles][few]`, of a chunk of the input's channels.
    let pairs = |few: &Range<usize>,
                 chunk: &Range<usize>,
                 factors: &[f32],
                 plane: &[f32],
                 tiles,
                 to: &mut [f32]| {
        let left = Matrix { numbers: factors, down: 1, right: few.len() };
        let right = Matrix { numbers: &plane[chunk.start..], down: 1, right: c };
        multiply([few.len(), tiles, chunk.len()], left, right, to, few.len(), chunk.start > 0);
    };
    let together = shares(o, TOGETHER);
    if c * o < LARGE {
        let len = |few: &Range<usize>| N * N * stride(c * few.len());
        let mut factors = Buffer::any(together.iter().map(len).sum());
        let mut parts = split(&mut factors, together.iter().map(len));
        together.par_iter().zip(&mut parts).for_each(|(few, part)| kernel(few, 0..c, part));
        let factors = parts;
        grid.blocks.par_iter().zip(outs).for_each(|(block, out)| {
            let tiles = grid.tiles(block);
            let planes = to_tiles(block);
            let len = |few: &Range<usize>| N * N * stride(tiles * few.len());
            let mut products = Buffer::any(together.iter().map(len).sum());
            let mut products = split(&mut products, together.iter().map(len));
            for ((few, factors), products) in together.iter().zip(&factors).zip(&mut products) {
                for (plane, product) in
                    products.chunks_exact_mut(stride(tiles * few.len())).enumerate()
                {
                    let factors = &factors[plane * stride(c * few.len())..];
                    let plane = &planes[plane * stride(tiles * c)..];
                    pairs(few, &(0..c), factors, plane, tiles, product);
                }
            }
            for (few, numbers) in together.iter().zip(products) {
                let products = Products { numbers, tiles, first: 0, few };
                widest(FromTiles::<N, M> { shape, grid: &grid, products, block, bias, out });
            }
        });
        return;
    }
    let planes: Vec<Buffer> = grid.blocks.par_iter().map(to_tiles).collect();
    let tiles = grid.all_tiles();
    let len = |few: &Range<usize>| N * N * stride(tiles * few.len());
    let mut products = Buffer::any(together.iter().map(len).sum());
    let mut products = split(&mut products, together.iter().map(len));
    together.par_iter().zip(&mut products).for_each(|(few, products)| {
        let mut factors = Buffer::any(N * N * stride(CHUNK * few.len()));
        for chunk in shares(c, CHUNK) {
            kernel(few, chunk.clone(), &mut factors);
            for (plane, products) in
                products.chunks_exact_mut(stride(tiles * few.len())).enumerate()
            {
                let factors = &factors[plane * stride(chunk.len() * few.len())..];
                let mut products = products;
                for (block, planes) in grid.blocks.iter().zip(&planes) {
                    let tiles = grid.tiles(block);
                    let (product, rest) = products.split_at_mut(tiles * few.len());
                    products = rest;
                    let plane = &planes[plane * stride(tiles * c)..];
                    pairs(few, &chunk, factors, plane, tiles, product);
                }
            }
        }
    });
    drop(planes);
    let firsts = grid.blocks.iter().scan(0, |first, block| {
        *first += grid.tiles(block);
        Some(*first - grid.tiles(block))
    });
    let blocks: Vec<_> = grid.blocks.iter().zip(firsts).zip(outs).collect();
    blocks.into_par_iter().for_each(|((block, first), out)| {
        for (few, numbers) in together.iter().zip(&products) {
            let products = Products { numbers, tiles, first, few };
            widest(FromTiles::<N, M> { shape, grid: &grid, products, block, bias, out });
        }
    });
}

pub(crate) fn backward_weight<const N: usize, const M: usize>(
    shape: &Shape,
    x: Input,
    grad_out: &[f32],
    grad_weight: &mut [f32],
) {
    let grid = Grid::new(shape, M);
    let (c, o) = (shape.channels, shape.out_channels);
    let to_tiles = |block: &Block| {
        let tiles = grid.tiles(block);
        let mut planes = Buffer::any(N * N * stride(tiles * c));
        let mut grads = Buffer::any(N * N * stride(tiles * o));
        let to = &mut planes;
        widest(ToTiles::<N, M> { shape, grid: &grid, x, block, planes: to });
        let to = &mut grads;
        widest(ToProducts::<N, M> { shape, grid: &grid, grad_out, block, planes: to });
        (tiles, planes, grads)
    };
    // Adds the products of a block to the planes' factors `[chunk][few]`.
    let pairs = |few: &Range<usize>,
                 chunk: &Range<usize>,
                 block: &(usize, Buffer, Buffer),
                 sums: &mut [f32],
                 add| {
        let (tiles, planes, grads) = block;
        let factors = stride(chunk.len() * few.len());
        for (plane, sum) in sums.chunks_exact_mut(factors).enumerate() {
            let numbers = &grads[plane * stride(tiles * o) + few.start..];
            let left = Matrix { numbers, down: 1, right: o };
            let numbers = &planes[plane * stride(tiles * c) + chunk.start..];
            let right = Matrix { numbers, down: c, right: 1 };
            multiply([few.len(), chunk.len(), *tiles], left, right, sum, few.len(), add);
        }
    };
    let together = shares(o, TOGETHER);
    let grads = split(grad_weight, together.iter().map(|few| few.len() * c * 9));
    if c * o < LARGE {
        let len = |few: &Range<usize>| N * N * stride(c * few.len());
        let all: usize = together.iter().map(len).sum();
        let pieces = shares(grid.blocks.len(), grid.blocks.len().div_ceil(8));
        let mut sums = Buffer::any(pieces.len() * all);
        sums.par_chunks_exact_mut(all).zip(&pieces).for_each(|(sum, piece)| {
            for (i, block) in grid.blocks[piece.clone()].iter().enumerate() {
                let block = to_tiles(block);
                for (few, sum) in together.iter().zip(split(sum, together.iter().map(len))) {
                    pairs(few, &(0..c), &block, sum, i > 0);
                }
            }
        });
        let mut sum = Buffer::any(all);
        add_up(&sums, &mut sum);
        let sums = split(&mut sum, together.iter().map(len));
        for ((few, grad), planes) in together.iter().zip(grads).zip(sums) {
            let few = few.len();
            widest(FromFactors::<N> { channels: c, few, chunk: 0..c, planes, grad });
        }
        return;
    }
    let blocks: Vec<_> = grid.blocks.par_iter().map(to_tiles).collect();
    together.par_iter().zip(grads).for_each(|(few, grad)| {
        let mut sums = Buffer::any(N * N * stride(CHUNK * few.len()));
        for chunk in shares(c, CHUNK) {
            let sums = &mut sums[..N * N * stride(chunk.len() * few.len())];
            for (i, block) in blocks.iter().enumerate() {
                pairs(few, &chunk, block, sums, i > 0);
            }
            let few = few.len();
            widest(FromFactors::<N> { channels: c, few, chunk, planes: sums, grad });
        }
    });
}

/// Write a column of rows.
#[inline(always)]
fn put<V: Copy, const ROWS: usize, const COLUMNS: usize>(
    rows: &mut [[V; COLUMNS]; ROWS],
    at: usize,
    column: [V; ROWS],
) {
    rows.iter_mut().zip(column).for_each(|(row, value)| row[at] = value);
}

/// Inputs of a block to planes `[N * N][tiles][C]`.
struct ToTiles<'a, const N: usize, const M: usize> {
    shape: &'a Shape,
    grid: &'a Grid,
    x: Input<'a>,
    block: &'a Block,
    planes: &'a mut [f32],
}

impl<const N: usize, const M: usize> WithSimd for ToTiles<'_, N, M> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { shape, grid, x, block, planes } = self;
        let (c, height, width) = (shape.channels, shape.height, shape.width);
        let plane = stride(grid.tiles(block) * c);
        for (tile, (image, down, across)) in grid.places(block).enumerate() {
            let inside = |at: usize, padding: usize, side: usize| {
                let from = padding.saturating_sub(at).min(N);
                from..(side + padding).saturating_sub(at).min(N).max(from)
            };
            let ys = inside(down * M, shape.padding[0], height);
            let xs = inside(across * M, shape.padding[1], width);
            let whole = ys.len() == N && xs.len() == N;
            // Of the tile's corner; it may lie in the padding, so this may wrap around.
            let corner = (image * height + down * M).wrapping_sub(shape.padding[0]);
            let corner = corner.wrapping_mul(width).wrapping_add(across * M);
            let corner = corner.wrapping_sub(shape.padding[1]).wrapping_mul(c);
            for channel in (0..c).step_by(S::F32_LANES) {
                let map = |value: S::f32s| match x.affine {
                    Some(Affine { scale, shift }) => {
                        let (scale, shift) =
                            (load(simd, scale, channel), load(simd, shift, channel));
                        simd.max_f32s(simd.mul_add_f32s(value, scale, shift), simd.splat_f32s(0.0))
                    }
                    None => value,
                };
                let at = |y: usize, x: usize| corner.wrapping_add((y * width + x) * c + channel);
                let mut half = [[simd.splat_f32s(0.0); N]; N];
                for j in 0..N {
                    let mut column = [simd.splat_f32s(0.0); N];
                    if whole {
                        for (i, column) in column.iter_mut().enumerate() {
                            *column = map(load(simd, x.x, at(i, j)));
                        }
                    } else if xs.contains(&j) {
                        for (i, column) in column.iter_mut().enumerate() {
                            if ys.contains(&i) {
                                *column = map(load(simd, x.x, at(i, j)));
                            }
                        }
                    }
                    let column = tile::input::<S, N>(simd, column);
                    put(&mut half, j, column);
                }
                for (i, half) in half.into_iter().enumerate() {
                    let row = tile::input::<S, N>(simd, half);
                    for (j, value) in row.into_iter().enumerate() {
                        let to = &mut planes[(i * N + j) * plane + tile * c..][..c];
                        store(simd, to, channel, value);
                    }
                }
            }
        }
    }
}

/// Gradients of the results of a block to planes `[N * N][tiles][O]`.
struct ToProducts<'a, const N: usize, const M: usize> {
    shape: &'a Shape,
    grid: &'a Grid,
    grad_out: &'a [f32],
    block: &'a Block,
    planes: &'a mut [f32],
}

impl<const N: usize, const M: usize> WithSimd for ToProducts<'_, N, M> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { shape, grid, grad_out, block, planes } = self;
        let o = shape.out_channels;
        let [height, width] = shape.out();
        let plane = stride(grid.tiles(block) * o);
        for (tile, (image, down, across)) in grid.places(block).enumerate() {
            let (ys, xs) = ((height - down * M).min(M), (width - across * M).min(M));
            let corner = ((image * height + down * M) * width + across * M) * o;
            for channel in (0..o).step_by(S::F32_LANES) {
                let mut half = [[simd.splat_f32s(0.0); M]; N];
                for j in 0..M.min(xs) {
                    let mut column = [simd.splat_f32s(0.0); M];
                    for (i, column) in column.iter_mut().enumerate() {
                        if i < ys {
                            let at = corner + (i * width + j) * o + channel;
                            *column = load(simd, grad_out, at);
                        }
                    }
                    let column = tile::output_adjoint::<S, N, M>(simd, column);
                    put(&mut half, j, column);
                }
                for (i, half) in half.into_iter().enumerate() {
                    let row = tile::output_adjoint::<S, N, M>(simd, half);
                    for (j, value) in row.into_iter().enumerate() {
                        let to = &mut planes[(i * N + j) * plane + tile * o..][..o];
                        store(simd, to, channel, value);
                    }
                }
            }
        }
    }
}

/// Products of a few channels, `[N * N][tiles][few]`.
struct Products<'a> {
    numbers: &'a [f32],
    tiles: usize,
    /// The first tile of the block.
    first: usize,
    few: &'a Range<usize>,
}

/// Products of a block to its results.
struct FromTiles<'a, const N: usize, const M: usize> {
    shape: &'a Shape,
    grid: &'a Grid,
    products: Products<'a>,
    block: &'a Block,
    bias: Option<&'a [f32]>,
    out: &'a mut [f32],
}

impl<const N: usize, const M: usize> WithSimd for FromTiles<'_, N, M> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { shape, grid, products, block, bias, out } = self;
        let o = shape.out_channels;
        let [height, width] = shape.out();
        let first_row = block.rows.start * M;
        let rows = (block.rows.end * M).min(height) - first_row;
        for (tile, (image, down, across)) in grid.places(block).enumerate() {
            let (ys, xs) = ((height - down * M).min(M), (width - across * M).min(M));
            let row = (image - block.images.start) * rows + down * M - first_row;
            let corner = (row * width + across * M) * o;
            let (numbers, few) = (products.numbers, products.few);
            let plane = stride(products.tiles * few.len());
            for channel in (0..few.len()).step_by(S::F32_LANES) {
                let at = (products.first + tile) * few.len() + channel;
                let mut half = [[simd.splat_f32s(0.0); N]; M];
                for j in 0..N {
                    let mut column = [simd.splat_f32s(0.0); N];
                    for (i, column) in column.iter_mut().enumerate() {
                        *column = load(simd, numbers, (i * N + j) * plane + at);
                    }
                    let column = tile::output::<S, N, M>(simd, column);
                    put(&mut half, j, column);
                }
                let channel = few.start + channel;
                let bias = bias.map(|bias| load(simd, &bias[..few.end], channel));
                for (i, half) in half.into_iter().enumerate().take(ys) {
                    let row = tile::output::<S, N, M>(simd, half);
                    for (j, value) in row.into_iter().enumerate().take(xs) {
                        let value = bias.map_or(value, |bias| simd.add_f32s(value, bias));
                        let to = &mut out[corner + (i * width + j) * o..][..few.end];
                        store(simd, to, channel, value);
                    }
                }
            }
        }
    }
}

/// The weight of a few channels, and a chunk of the input's, to factors `[N * N][chunk][few]`.
struct ToFactors<'a, const N: usize> {
    shape: &'a Shape,
    /// `[O, C, 3, 3]`; of the forward pass `[C, O, 3, 3]` where turned.
    weight: &'a [f32],
    turned: bool,
    few: Range<usize>,
    chunk: Range<usize>,
    planes: &'a mut [f32],
}

/// Numbers of the widest vector there is.
const WIDEST: usize = 16;

impl<const N: usize> WithSimd for ToFactors<'_, N> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { shape, weight, turned, few, chunk, planes } = self;
        let (c, o) = (shape.channels, shape.out_channels);
        let plane = stride(chunk.len() * few.len());
        let (next_out, next_in) = if turned { (9, 9 * o) } else { (9 * c, 9) };
        for first in (0..few.len()).step_by(S::F32_LANES) {
            let lanes = (few.len() - first).min(S::F32_LANES);
            for (at, channel) in chunk.clone().enumerate() {
                let mut taps = [[0.0; WIDEST]; 9];
                let from = (few.start + first) * next_out + channel * next_in;
                for lane in 0..lanes {
                    let kernel = &weight[from + lane * next_out..][..9];
                    for tap in 0..9 {
                        taps[tap][lane] = kernel[if turned { 8 - tap } else { tap }];
                    }
                }
                let mut half = [[simd.splat_f32s(0.0); 3]; N];
                for j in 0..3 {
                    let column = [0, 3, 6].map(|i| load(simd, &taps[i + j], 0));
                    let column = tile::kernel::<S, N>(simd, column);
                    put(&mut half, j, column);
                }
                for (i, half) in half.into_iter().enumerate() {
                    let row = tile::kernel::<S, N>(simd, half);
                    for (j, value) in row.into_iter().enumerate() {
                        let to = (i * N + j) * plane + at * few.len();
                        store(simd, &mut planes[to..][..few.len()], first, value);
                    }
                }
            }
        }
    }
}

/// Gradients of factors `[N * N][chunk][few]` to those of the weight `[few, C, 3, 3]`.
struct FromFactors<'a, const N: usize> {
    channels: usize,
    few: usize,
    chunk: Range<usize>,
    planes: &'a [f32],
    grad: &'a mut [f32],
}

impl<const N: usize> WithSimd for FromFactors<'_, N> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { channels: c, few, chunk, planes, grad } = self;
        let plane = stride(chunk.len() * few);
        for first in (0..few).step_by(S::F32_LANES) {
            let lanes = (few - first).min(S::F32_LANES);
            for (at, channel) in chunk.clone().enumerate() {
                let mut half = [[simd.splat_f32s(0.0); N]; 3];
                for j in 0..N {
                    let mut column = [simd.splat_f32s(0.0); N];
                    for (i, column) in column.iter_mut().enumerate() {
                        let at = (i * N + j) * plane + at * few + first;
                        *column = load(simd, planes, at);
                    }
                    let column = tile::kernel_adjoint::<S, N>(simd, column);
                    put(&mut half, j, column);
                }
                let mut taps = [[0.0; WIDEST]; 9];
                for (i, half) in half.into_iter().enumerate() {
                    let row = tile::kernel_adjoint::<S, N>(simd, half);
                    for (j, value) in row.into_iter().enumerate() {
                        store(simd, &mut taps[i * 3 + j], 0, value);
                    }
                }
                for lane in 0..lanes {
                    let kernel = &mut grad[((first + lane) * c + channel) * 9..][..9];
                    for tap in 0..9 {
                        kernel[tap] = taps[tap][lane];
                    }
                }
            }
        }
    }
}
