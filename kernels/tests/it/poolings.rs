//! The maximum of windows, the mean of pictures, and what goes back.

use pmp_kernels::pooling::{self, Shape};
use proptest::prelude::*;

use crate::naive::{self, numbers, off, same_bits};

fn shapes() -> impl Strategy<Value = Shape> {
    let sizes = (1..4usize, 1..14usize, 1..14usize, prop_oneof![1..5usize, 15..18usize]);
    let window = ([1..5usize, 1..5usize], [1..4usize, 1..4usize], [0..4usize, 0..4usize]);
    (sizes, window)
        .prop_map(|((batch, height, width, channels), (kernel, stride, padding))| {
            let padding = [0, 1].map(|i| padding[i].min(kernel[i] - 1));
            Shape { batch, height, width, channels, kernel, stride, padding }
        })
        .prop_filter("no window, or one wholly in the padding", |s| {
            let Some(out) = s.out_size() else { return false };
            let side = [s.height, s.width];
            (0..2).all(|i| (out[i] - 1) * s.stride[i] < side[i] + s.padding[i])
        })
}

fn max(s: &Shape, x: &[f32]) -> (Vec<f32>, Vec<u8>) {
    let (mut out, mut which) = (vec![f32::NAN; s.output_len()], vec![255; s.output_len()]);
    pooling::max(s, x, &mut out, &mut which);
    (out, which)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 100, failure_persistence: None, ..Default::default() })]

    #[test]
    fn maxima_and_gradients_are_those_of_the_definition(s in shapes(), seed: u64) {
        // Few values, so that many windows have several largest.
        let x: Vec<f32> = numbers(seed, s.input_len()).iter().map(|x| (x * 4.0).round()).collect();
        let (want, from) = naive::max(&s, &x);
        let (out, which) = max(&s, &x);
        prop_assert_eq!(out, want);
        let grad = numbers(seed ^ 1, s.output_len());
        let mut sums = vec![0.0; s.input_len()];
        from.iter().zip(&grad).for_each(|(from, grad)| sums[*from] += f64::from(*grad));
        let mut grad_x = vec![f32::NAN; s.input_len()];
        pooling::backward_max(&s, &grad, &which, &mut grad_x);
        prop_assert!(off(&grad_x, &sums) < 1e-6);
    }

    #[test]
    fn means_and_gradients_are_those_of_the_definition(
        batch in 1..4usize, pixels in 1..50usize, channels in 1..20usize, seed: u64,
    ) {
        let x = numbers(seed, batch * pixels * channels);
        let mut want = vec![0.0; batch * channels];
        for (i, x) in x.iter().enumerate() {
            let image = i / (pixels * channels);
            want[image * channels + i % channels] += f64::from(*x) / pixels as f64;
        }
        let mut out = vec![f32::NAN; want.len()];
        pooling::mean(pixels, channels, &x, &mut out);
        prop_assert!(off(&out, &want) < 1e-5);
        let mut grad_x = vec![f32::NAN; x.len()];
        pooling::backward_mean(pixels, channels, &out, &mut grad_x);
        for (i, grad) in grad_x.iter().enumerate() {
            let image = i / (pixels * channels);
            prop_assert_eq!(*grad, out[image * channels + i % channels] / pixels as f32);
        }
    }
}

#[test]
fn a_number_that_is_not_one_comes_through() {
    let s = Shape {
        batch: 1,
        height: 2,
        width: 2,
        channels: 1,
        kernel: [2, 2],
        stride: [1, 1],
        padding: [0, 0],
    };
    assert!(max(&s, &[1.0, f32::NAN, 5.0, 2.0]).0[0].is_nan());
    assert_eq!(max(&s, &[f32::NEG_INFINITY; 4]), (vec![f32::NEG_INFINITY], vec![0]));
}

#[test]
fn poolings_have_the_same_bits_on_any_number_of_threads() {
    let s = Shape {
        batch: 2,
        height: 33,
        width: 41,
        channels: 19,
        kernel: [3, 3],
        stride: [2, 2],
        padding: [1, 1],
    };
    let x = numbers(3, s.input_len());
    same_bits(|| max(&s, &x).0);
    let (_, which) = max(&s, &x);
    let grad = numbers(4, s.output_len());
    same_bits(|| {
        let mut grad_x = vec![0.0; s.input_len()];
        pooling::backward_max(&s, &grad, &which, &mut grad_x);
        grad_x
    });
    same_bits(|| {
        let mut out = vec![0.0; 2 * 19];
        pooling::mean(33 * 41, 19, &x, &mut out);
        out
    });
    let grad = numbers(5, 2 * 19);
    same_bits(|| {
        let mut grad_x = vec![0.0; s.input_len()];
        pooling::backward_mean(33 * 41, 19, &grad, &mut grad_x);
        grad_x
    });
}
