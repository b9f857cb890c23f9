//! Every operation as its definition says, in f64, and numbers to feed it with.

use pmp_kernels::{conv, pooling};

/// `count` numbers in -1 ... 1 that look random and are the same everywhere.
pub(crate) fn numbers(seed: u64, count: usize) -> Vec<f32> {
    let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15).wrapping_add(0x1234_5678_9abc_def1);
    let mut next = || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 40) as f32 / (1u64 << 23) as f32 - 1.0
    };
    (0..count + 4).map(|_| next()).skip(4).collect()
}

/// Calls `f` with the index of each (output, input, weight) that are multiplied.
pub(crate) fn products(s: &conv::Shape, mut f: impl FnMut(usize, usize, usize)) {
    let [height, width] = s.out_size().unwrap();
    for b in 0..s.batch {
        for oy in 0..height {
            for ox in 0..width {
                for ky in 0..s.kernel[0] {
                    for kx in 0..s.kernel[1] {
                        let y = (oy * s.stride[0] + ky) as isize - s.padding[0] as isize;
                        let x = (ox * s.stride[1] + kx) as isize - s.padding[1] as isize;
                        let inside = (0..s.height as isize).contains(&y)
                            && (0..s.width as isize).contains(&x);
                        if !inside {
                            continue;
                        }
                        let pixel = (b * s.height + y as usize) * s.width + x as usize;
                        for o in 0..s.out_channels {
                            let out = ((b * height + oy) * width + ox) * s.out_channels + o;
                            for c in 0..s.channels {
                                let tap = ky * s.kernel[1] + kx;
                                let taps = s.kernel[0] * s.kernel[1];
                                let weight = (o * s.channels + c) * taps + tap;
                                f(out, pixel * s.channels + c, weight);
                            }
                        }
                    }
                }
            }
        }
    }
}

pub(crate) fn conv(s: &conv::Shape, x: &[f32], weight: &[f32], bias: Option<&[f32]>) -> Vec<f64> {
    let channel = |i: usize| bias.map_or(0.0, |bias| f64::from(bias[i % s.out_channels]));
    let mut out: Vec<f64> = (0..s.output_len()).map(channel).collect();
    products(s, |o, i, w| out[o] += f64::from(x[i]) * f64::from(weight[w]));
    out
}

pub(crate) fn conv_input(s: &conv::Shape, grad: &[f32], weight: &[f32]) -> Vec<f64> {
    let mut out = vec![0.0; s.input_len()];
    products(s, |o, i, w| out[i] += f64::from(grad[o]) * f64::from(weight[w]));
    out
}

pub(crate) fn conv_weight(s: &conv::Shape, x: &[f32], grad: &[f32]) -> Vec<f64> {
    let mut out = vec![0.0; s.weight_len()];
    products(s, |o, i, w| out[w] += f64::from(grad[o]) * f64::from(x[i]));
    out
}

/// Maxima and the pixels they come from.
pub(crate) fn max(s: &pooling::Shape, x: &[f32]) -> (Vec<f32>, Vec<usize>) {
    let [height, width] = s.out_size().unwrap();
    let (mut out, mut from) = (vec![], vec![]);
    for b in 0..s.batch {
        for (oy, ox) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
            for c in 0..s.channels {
                let mut best: Option<(f32, usize)> = None;
                for ky in 0..s.kernel[0] {
                    for kx in 0..s.kernel[1] {
                        let y = (oy * s.stride[0] + ky) as isize - s.padding[0] as isize;
                        let x_at = (ox * s.stride[1] + kx) as isize - s.padding[1] as isize;
                        if !(0..s.height as isize).contains(&y)
                            || !(0..s.width as isize).contains(&x_at)
                        {
                            continue;
                        }
                        let pixel = (b * s.height + y as usize) * s.width + x_at as usize;
                        let value = x[pixel * s.channels + c];
                        if best.is_none_or(|(best, _)| value > best) {
                            best = Some((value, pixel * s.channels + c));
                        }
                    }
                }
                let (value, pixel) = best.unwrap();
                out.push(value);
                from.push(pixel);
            }
        }
    }
    (out, from)
}

/// Largest difference, as a share of the largest number.
pub(crate) fn off(got: &[f32], want: &[f64]) -> f64 {
    assert_eq!(got.len(), want.len());
    let size = want.iter().fold(0.0, |size: f64, x| size.max(x.abs()));
    let off = got.iter().zip(want).fold(0.0, |off: f64, (got, want)| {
        assert!(got.is_finite());
        off.max((f64::from(*got) - want).abs())
    });
    if size == 0.0 { off } else { off / size }
}

/// What `f` gives on 1, 2 and 3 threads.
pub(crate) fn on_threads<T: Send>(f: impl Fn() -> T + Sync) -> [T; 3] {
    [1, 2, 3].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(&f)
    })
}

/// Asserts that `f` gives the same bits on 1, 2 and 3 threads.
pub(crate) fn same_bits(f: impl Fn() -> Vec<f32> + Sync) {
    let [one, two, three] = on_threads(|| f().iter().map(|x| x.to_bits()).collect::<Vec<_>>());
    assert!(one == two, "two threads differ from one");
    assert!(one == three, "three threads differ from one");
}
