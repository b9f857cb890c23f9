//! Convolutions of all shapes, their gradients, by all methods.

use pmp_kernels::{
    conv::{self, Input, Method, Shape},
    norm::Map,
};
use proptest::prelude::*;

use crate::naive::{self, numbers, off, same_bits};

const METHODS: [Method; 3] = [Method::Direct, Method::Tiles2, Method::Tiles4];

fn shapes() -> impl Strategy<Value = Shape> {
    let channels = || prop_oneof![1..6usize, 14..20usize, Just(33)];
    let any = (1..4usize, 1..20usize, 1..20usize, channels(), channels());
    let window = prop_oneof![
        2 => Just([[3, 3], [1, 1], [1, 1]]),
        1 => (0..3usize, 0..3usize).prop_map(|(y, x)| [[3, 3], [1, 1], [y, x]]),
        1 => Just([[3, 3], [2, 2], [1, 1]]),
        1 => Just([[7, 7], [2, 2], [3, 3]]),
        1 => (1..3usize, 1..3usize).prop_map(|(y, x)| [[1, 1], [y, x], [0, 0]]),
        2 => ([1..6usize, 1..6usize], [1..4usize, 1..4usize], [0..4usize, 0..4usize])
            .prop_map(|(kernel, stride, padding)| [kernel, stride, padding]),
    ];
    (any, window)
        .prop_map(|((batch, height, width, channels, out_channels), [kernel, stride, padding])| {
            Shape { batch, height, width, channels, out_channels, kernel, stride, padding }
        })
        .prop_filter("the kernel is larger than the padded picture", |s| s.out_size().is_some())
}

/// Rounding of f32 after so many sums; tiles of 4 x 4 lose a digit.
fn rounding(method: Method) -> f64 {
    if method == Method::Tiles4 { 1e-4 } else { 1e-5 }
}

fn can(method: Method, s: &Shape) -> bool {
    let tiles = s.kernel == [3, 3] && s.stride == [1, 1] && s.padding.iter().all(|p| *p <= 2);
    method == Method::Direct || tiles
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 150, failure_persistence: None, ..Default::default() })]

    #[test]
    fn convolution_and_gradients_are_those_of_the_definition(s in shapes(), seed: u64) {
        let (x, weight) = (numbers(seed, s.input_len()), numbers(seed ^ 1, s.weight_len()));
        let (bias, grad) = (numbers(seed ^ 2, s.out_channels), numbers(seed ^ 3, s.output_len()));
        let forward = naive::conv(&s, &x, &weight, Some(&bias));
        let of_input = naive::conv_input(&s, &grad, &weight);
        let of_weight = naive::conv_weight(&s, &x, &grad);
        for method in METHODS.into_iter().filter(|method| can(*method, &s)) {
            let near = rounding(method);
            let mut out = vec![f32::NAN; s.output_len()];
            conv::forward_by(method, &s, (&x[..]).into(), &weight, Some(&bias), &mut out);
            prop_assert!(off(&out, &forward) < near, "{method:?} {:e}", off(&out, &forward));
            let mut out = vec![f32::NAN; s.input_len()];
            conv::backward_input_by(method, &s, &grad, &weight, &mut out);
            prop_assert!(off(&out, &of_input) < near, "{method:?} {:e}", off(&out, &of_input));
            let mut out = vec![f32::NAN; s.weight_len()];
            conv::backward_weight_by(method, &s, (&x[..]).into(), &grad, &mut out);
            prop_assert!(off(&out, &of_weight) < near, "{method:?} {:e}", off(&out, &of_weight));
        }
        let mut out = vec![f32::NAN; s.out_channels];
        conv::backward_bias(&grad, &mut out);
        let mut sums = vec![0.0; s.out_channels];
        grad.iter().enumerate().for_each(|(i, g)| sums[i % s.out_channels] += f64::from(*g));
        prop_assert!(off(&out, &sums) < 1e-5);
    }

    #[test]
    fn input_that_is_mapped_while_read_is_the_mapped_input(s in shapes(), seed: u64) {
        let (x, weight) = (numbers(seed, s.input_len()), numbers(seed ^ 1, s.weight_len()));
        let grad = numbers(seed ^ 3, s.output_len());
        let scale = numbers(seed ^ 4, s.channels);
        let map = Map { scale, shift: numbers(seed ^ 5, s.channels) };
        let mapped = |(i, x): (usize, &f32)| {
            (x * map.scale[i % s.channels] + map.shift[i % s.channels]).max(0.0)
        };
        let written: Vec<f32> = x.iter().enumerate().map(mapped).collect();
        let read = Input { x: &x, affine: Some(map.as_affine()) };
        let forward = naive::conv(&s, &written, &weight, None);
        let of_weight = naive::conv_weight(&s, &written, &grad);
        for method in METHODS.into_iter().filter(|method| can(*method, &s)) {
            let mut out = vec![f32::NAN; s.output_len()];
            conv::forward_by(method, &s, read, &weight, None, &mut out);
            prop_assert!(off(&out, &forward) < rounding(method));
            let mut out = vec![f32::NAN; s.weight_len()];
            conv::backward_weight_by(method, &s, read, &grad, &mut out);
            prop_assert!(off(&out, &of_weight) < rounding(method));
        }
    }
}

/// Shapes as networks have them, with more channels than fit into a cache, cut into many pieces.
fn large() -> [Shape; 4] {
    let square = |side: usize| [side, side];
    let of = |[batch, height, width, channels, out_channels]: [usize; 5], kernel, stride| Shape {
        batch,
        height,
        width,
        channels,
        out_channels,
        kernel: square(kernel),
        stride: square(stride),
        padding: square(kernel / 2),
    };
    [
        of([2, 37, 41, 24, 100], 3, 1),
        of([3, 9, 11, 100, 130], 3, 1),
        of([2, 23, 30, 64, 130], 3, 2),
        of([2, 61, 50, 3, 20], 7, 2),
    ]
}

#[test]
fn large_convolutions_are_those_of_the_definition() {
    for (i, s) in large().into_iter().enumerate() {
        let seed = i as u64;
        let (x, weight) = (numbers(seed, s.input_len()), numbers(seed ^ 7, s.weight_len()));
        let grad = numbers(seed ^ 3, s.output_len());
        let forward = naive::conv(&s, &x, &weight, None);
        let of_input = naive::conv_input(&s, &grad, &weight);
        let of_weight = naive::conv_weight(&s, &x, &grad);
        for method in METHODS.into_iter().filter(|method| can(*method, &s)) {
            let mut out = vec![f32::NAN; s.output_len()];
            conv::forward_by(method, &s, (&x[..]).into(), &weight, None, &mut out);
            assert!(off(&out, &forward) < rounding(method), "{s:?} {method:?}");
            let mut out = vec![f32::NAN; s.input_len()];
            conv::backward_input_by(method, &s, &grad, &weight, &mut out);
            assert!(off(&out, &of_input) < rounding(method), "{s:?} {method:?}");
            let mut out = vec![f32::NAN; s.weight_len()];
            conv::backward_weight_by(method, &s, (&x[..]).into(), &grad, &mut out);
            assert!(off(&out, &of_weight) < rounding(method), "{s:?} {method:?}");
        }
    }
}

#[test]
fn convolutions_have_the_same_bits_on_any_number_of_threads() {
    for s in large() {
        let (x, weight) = (numbers(1, s.input_len()), numbers(2, s.weight_len()));
        let (bias, grad) = (numbers(3, s.out_channels), numbers(4, s.output_len()));
        for method in METHODS.into_iter().filter(|method| can(*method, &s)) {
            same_bits(|| {
                let mut out = vec![0.0; s.output_len()];
                conv::forward_by(method, &s, (&x[..]).into(), &weight, Some(&bias), &mut out);
                out
            });
            same_bits(|| {
                let mut out = vec![0.0; s.input_len()];
                conv::backward_input_by(method, &s, &grad, &weight, &mut out);
                out
            });
            same_bits(|| {
                let mut out = vec![0.0; s.weight_len()];
                conv::backward_weight_by(method, &s, (&x[..]).into(), &grad, &mut out);
                out
            });
        }
        same_bits(|| {
            let mut out = vec![0.0; s.out_channels];
            conv::backward_bias(&grad, &mut out);
            out
        });
    }
}
