//! A network's layers as a table: what each makes of one frame, and what that costs.

use std::fmt::Write as _;

use crate::digits::grouped;

/// A layer, for one frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Layer {
    /// As its weights are named.
    pub name: String,
    /// Shape of what comes out, without the batch.
    pub output: Vec<usize>,
    /// Numbers that are trained.
    pub parameters: usize,
    /// Multiplications, each with an addition.
    pub multiply_adds: usize,
}

impl Layer {
    /// A fully connected layer.
    pub fn dense(name: String, from: usize, to: usize) -> Self {
        Self { name, output: vec![to], parameters: from * to + to, multiply_adds: from * to }
    }

    /// A convolution of a square kernel to `[H, W, C]`; `extra` are parameters besides the
    /// kernel's: a bias, or the scale and shift of a norm.
    pub fn conv(name: String, from: usize, side: usize, output: [usize; 3], extra: usize) -> Self {
        let kernel = from * side * side * output[2];
        let parameters = kernel + extra;
        let multiply_adds = kernel * output[0] * output[1];
        Self { name, output: output.to_vec(), parameters, multiply_adds }
    }
}

/// The layers in the way of the data, with sums at the end.
pub fn table(layers: &[Layer]) -> String {
    let shape = |layer: &Layer| layer.output.iter().map(usize::to_string).collect::<Vec<_>>();
    let count = |number: usize| grouped(number as u64);
    let rows: Vec<[String; 4]> = layers
        .iter()
        .map(|layer| {
            let (parameters, cost) = (count(layer.parameters), count(layer.multiply_adds));
            [layer.name.clone(), shape(layer).join(" x "), parameters, cost]
        })
        .collect();
    let head = ["layer", "output of one frame", "parameters", "multiply-adds"].map(String::from);
    let sum = |each: fn(&Layer) -> usize| count(layers.iter().map(each).sum());
    let foot = ["all".into(), String::new(), sum(|l| l.parameters), sum(|l| l.multiply_adds)];
    let all: Vec<_> = [&head].into_iter().chain(&rows).chain([&foot]).collect();
    let width = |i: usize| all.iter().map(|row| row[i].len()).max().unwrap_or(0);
    let widths: [usize; 4] = std::array::from_fn(width);
    let mut text = String::new();
    for row in all {
        let [a, b, c, d] = widths;
        let _ = writeln!(text, "{:<a$}  {:>b$}  {:>c$}  {:>d$}", row[0], row[1], row[2], row[3]);
    }
    text
}
