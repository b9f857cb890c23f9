//! Time of the layers of a ResNet34, forwards and both ways backwards, by all methods: what
//! [`Shape::method`] is chosen by. `layers [full|mid|tiny|one] [rounds]`, on one thread.
#![allow(clippy::print_stdout)]

use pmp_kernels::conv::{self, Method, Shape};

/// CPU time of this thread, which other programs do not lengthen.
fn cpu_ms() -> f64 {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").expect("Linux");
    let nanos = text.split(' ').next().and_then(|nanos| nanos.parse::<f64>().ok());
    nanos.expect("nanoseconds come first") / 1e6
}

fn main() {
    let mut args = std::env::args().skip(1);
    let config = args.next().unwrap_or_else(|| "full".into());
    let rounds: u32 = args.next().and_then(|n| n.parse().ok()).unwrap_or(20);
    let (batch, height, width, channels) = match config.as_str() {
        "tiny" => (16, 64, 160, 16),
        "mid" => (8, 88, 200, 64),
        "one" => (1, 88, 200, 64),
        _ => (2, 250, 600, 64),
    };
    let half = |x: usize| x.div_ceil(2);
    let (mut h, mut w) = (half(half(height)), half(half(width)));
    let of = |height, width, channels, out_channels, kernel: usize, stride: usize| Shape {
        batch,
        height,
        width,
        channels,
        out_channels,
        kernel: [kernel; 2],
        stride: [stride; 2],
        padding: [kernel / 2; 2],
    };
    let mut layers = vec![(1, of(height, width, 3, channels, 7, 2))];
    let mut c = channels;
    for (i, blocks) in [3, 4, 6, 3].into_iter().enumerate() {
        if i > 0 {
            layers.push((1, of(h, w, c, 2 * c, 3, 2)));
            layers.push((1, of(h, w, c, 2 * c, 1, 2)));
            (h, w, c) = (half(h), half(w), 2 * c);
        }
        layers.push((2 * blocks - usize::from(i > 0), of(h, w, c, c, 3, 1)));
    }
    rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .use_current_thread()
        .build_global()
        .expect("no other pool yet");
    println!("ms of a layer: forward, gradient of the input, of the weight; * chosen");
    for (count, s) in layers {
        let flops = 2.0 * (s.output_len() * s.channels * s.kernel[0] * s.kernel[1]) as f64;
        print!(
            "{count:2} x {:3} x {:3}, {:3} -> {:3}, {}x{}/{}, {:6.2} GFLOP",
            s.height,
            s.width,
            s.channels,
            s.out_channels,
            s.kernel[0],
            s.kernel[1],
            s.stride[0],
            flops / 1e9
        );
        let x = vec![0.5; s.input_len()];
        let weight = vec![0.5; s.weight_len()];
        let (mut out, mut grad_x) = (vec![0.0; s.output_len()], vec![0.0; s.input_len()]);
        let mut grad_weight = vec![0.0; s.weight_len()];
        for method in [Method::Direct, Method::Tiles2, Method::Tiles4] {
            if method != Method::Direct && (s.kernel != [3, 3] || s.stride != [1, 1]) {
                continue;
            }
            // The clock ticks every few milliseconds: many calls between two looks at it.
            let each = |call: &mut dyn FnMut()| {
                call();
                let start = cpu_ms();
                (0..rounds).for_each(|_| call());
                (cpu_ms() - start) / f64::from(rounds)
            };
            let times = [
                each(&mut || {
                    conv::forward_by(method, &s, (&x[..]).into(), &weight, None, &mut out);
                }),
                each(&mut || conv::backward_input_by(method, &s, &out, &weight, &mut grad_x)),
                each(&mut || {
                    conv::backward_weight_by(method, &s, (&x[..]).into(), &out, &mut grad_weight);
                }),
            ];
            let chosen = if s.method() == method { '*' } else { ' ' };
            let [a, b, c] = times;
            print!("  {method:?}{chosen} {a:6.2} {b:6.2} {c:6.2}");
        }
        println!();
    }
}
