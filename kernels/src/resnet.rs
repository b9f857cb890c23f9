//! A residual network of basic blocks, from pictures to features, and back.
//!
//! He et al., 2016, arXiv:1512.03385, with the names and details of torchvision's ResNet18 and 34:
//!
//! ```text
//! [B,H,W,C] - conv 7x7/2 - norm - relu - max 3x3/2 - stage 1 ... 4 - mean - [B, 8 width]
//! block: x - conv 3x3 - norm - relu - conv 3x3 - norm - (+ x, or conv 1x1 - norm of it) - relu
//! ```
//!
//! The first block of stages 2 to 4 halves the picture and doubles the channels. Kept for the way
//! back are what comes out of each convolution and each block; what is normalised in between is
//! never written down. The way back gives memory free as it goes.

use crate::{
    buffers::Buffer,
    conv::{self, Input},
    norm::{self, Backward, Gate, Map, Moments, Residual},
    pooling,
};

/// Added to variances, as in torchvision.
pub const EPS: f64 = 1e-5;

/// Share of the batch in the moments that are kept, as in torchvision.
pub const MOMENTUM: f64 = 0.1;

/// Numbers from which on the first convolution, the largest activation and for large pictures a
/// fiftieth of the work, is not kept but done again on the way back.
const LARGE: usize = 1 << 22;

/// Sizes of a network.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Network {
    /// Of the picture.
    pub channels: usize,
    /// Channels of the first stage; 64 in the paper.
    pub width: usize,
    /// Blocks of each stage; 3, 4, 6, 3 of ResNet34.
    pub depths: [usize; 4],
}

/// A convolution and the norm behind it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Layer {
    /// torchvision's name of the convolution, such as `layer2.0.downsample.0`.
    pub conv: String,
    /// And of the norm, such as `layer2.0.downsample.1`.
    pub norm: String,
    pub channels: usize,
    pub out_channels: usize,
    /// Of both sides.
    pub kernel: usize,
    pub stride: usize,
}

/// What is trained of a [`Layer`].
#[derive(Clone, Copy, Debug)]
pub struct Weights<'a> {
    /// `[O, C, K, K]`.
    pub conv: &'a [f32],
    /// `[O]` each.
    pub scale: &'a [f32],
    pub shift: &'a [f32],
}

/// Gradients of a layer's [`Weights`].
#[derive(Clone, Debug, PartialEq)]
pub struct Gradients {
    pub conv: Vec<f32>,
    pub scale: Vec<f32>,
    pub shift: Vec<f32>,
}

/// How norms normalise.
#[derive(Debug)]
pub enum Mode<'a> {
    /// By the batch; the moments kept, one for each layer, move towards its.
    Train(&'a mut [Moments]),
    /// By the moments kept.
    Eval(&'a [Moments]),
}

/// What the way back needs.
#[derive(Debug)]
pub struct Tape {
    batch: [usize; 3],
    of_batch: bool,
    layers: Vec<Normed>,
    pool: (pooling::Shape, Vec<u8>),
    /// Out of the pooling, and of each block.
    outs: Vec<Buffer>,
}

/// A layer's convolved input, and how it is normalised.
#[derive(Debug)]
struct Normed {
    shape: conv::Shape,
    x: Buffer,
    moments: Moments,
    map: Map,
}

impl Normed {
    fn input(&self) -> Input<'_> {
        Input { x: &self.x, affine: Some(self.map.as_affine()) }
    }

    fn backward(&self, of_batch: bool, scale: &[f32], gate: Gate, grad: &mut [f32]) -> Backward {
        Backward::sums(&self.x, &self.moments, of_batch, scale, EPS, gate, grad)
    }
}

impl Network {
    /// In the order of use, of a block the shortcut last.
    pub fn layers(&self) -> Vec<Layer> {
        let layer =
            |conv: String, norm: String, [channels, out_channels]: [usize; 2], kernel, stride| {
                Layer { conv, norm, channels, out_channels, kernel, stride }
            };
        let first = [self.channels, self.width];
        let mut layers = vec![layer("conv1".into(), "bn1".into(), first, 7, 2)];
        for (block, [c, o], stride) in self.blocks() {
            let conv = |i: usize| (format!("{block}.conv{i}"), format!("{block}.bn{i}"));
            let (name, norm) = conv(1);
            layers.push(layer(name, norm, [c, o], 3, stride));
            let (name, norm) = conv(2);
            layers.push(layer(name, norm, [o, o], 3, 1));
            if stride != 1 || c != o {
                let [name, norm] = [0, 1].map(|i| format!("{block}.downsample.{i}"));
                layers.push(layer(name, norm, [c, o], 1, stride));
            }
        }
        layers
    }

    /// Numbers of a feature.
    pub fn features(&self) -> usize {
        8 * self.width
    }

    /// Name, channels in and out, and stride of each block.
    fn blocks(&self) -> Vec<(String, [usize; 2], usize)> {
        let mut blocks = vec![];
        for (stage, depth) in self.depths.into_iter().enumerate() {
            let o = self.width << stage;
            for i in 0..depth {
                let halves = i == 0 && stage > 0;
                let (c, stride) = if halves { (o / 2, 2) } else { (o, 1) };
                blocks.push((format!("layer{}.{i}", stage + 1), [c, o], stride));
            }
        }
        blocks
    }
}

/// `x` `[B, H, W, C]` to features `[B, 8 width]`, and what the way back needs, if it is wanted.
///
/// `weights` are those of [`Network::layers`], in their order.
///
/// # Panics
///
/// If lengths disagree.
pub fn forward(
    network: &Network,
    size: [usize; 3],
    x: &[f32],
    weights: &[Weights],
    mode: Mode,
    keep: bool,
) -> (Vec<f32>, Option<Tape>) {
    // On a thread of the pool, or each operation would wake one and wait for it.
    rayon::scope(|_| forward_here(network, size, x, weights, mode, keep))
}

fn forward_here(
    network: &Network,
    [batch, height, width]: [usize; 3],
    x: &[f32],
    weights: &[Weights],
    mut mode: Mode,
    keep: bool,
) -> (Vec<f32>, Option<Tape>) {
    let layers = network.layers();
    assert_eq!(layers.len(), weights.len(), "weights of each layer");
    let of_batch = matches!(mode, Mode::Train(_));
    let buffer = if keep { Buffer::passing } else { Buffer::any };
    let mut at = 0;
    let mut normed = |input: Input, [height, width]: [usize; 2]| {
        let (layer, weights) = (&layers[at], &weights[at]);
        let shape = layer.shape([batch, height, width]);
        let mut out = buffer(shape.output_len());
        conv::forward(&shape, input, weights.conv, None, &mut out);
        let moments = match &mut mode {
            Mode::Eval(kept) => kept[at].clone(),
            Mode::Train(kept) => {
                let moments = Moments::of(layer.out_channels, &out);
                kept[at].follow(&moments, out.len() / layer.out_channels, MOMENTUM);
                moments
            }
        };
        at += 1;
        let map = moments.map(weights.scale, weights.shift, EPS);
        Normed { shape, x: out, moments, map }
    };
    let side = |normed: &Normed| normed.shape.out_size().expect("it was convolved");

    let stem = normed(x.into(), [height, width]);
    let [h, w] = side(&stem);
    let pool = pooling::Shape {
        batch,
        height: h,
        width: w,
        channels: network.width,
        kernel: [3, 3],
        stride: [2, 2],
        padding: [1, 1],
    };
    let mut out = buffer(pool.output_len());
    let mut which = vec![0; out.len()];
    pooling::max(&pool, stem.input(), &mut out, &mut which);
    let mut size = pool.out_size().expect("it was pooled");
    let (mut kept, mut outs) = (vec![], vec![out]);
    match keep {
        true if stem.x.len() > LARGE => kept.push(Normed { x: Buffer::passing(0), ..stem }),
        true => kept.push(stem),
        false => drop(stem),
    }
    for (_, [c, o], stride) in network.blocks() {
        let x = outs.last().expect("the pooling's at least");
        let one = normed(x[..].into(), size);
        let two = normed(one.input(), side(&one));
        let shortcut = (stride != 1 || c != o).then(|| normed(x[..].into(), size));
        let residual = match &shortcut {
            Some(own) => Residual { x: &own.x, affine: Some(own.map.as_affine()) },
            None => Residual { x, affine: None },
        };
        let mut out = buffer(two.x.len());
        norm::apply(&two.x, two.map.as_affine(), Some(residual), true, &mut out);
        size = side(&two);
        if keep {
            kept.extend([Some(one), Some(two), shortcut].into_iter().flatten());
        } else {
            outs.clear();
        }
        outs.push(out);
    }
    let mut features = vec![0.0; batch * network.features()];
    let last = outs.last().expect("the pooling's at least");
    pooling::mean(size[0] * size[1], network.features(), last, &mut features);
    let tape =
        Tape { batch: [batch, height, width], of_batch, layers: kept, pool: (pool, which), outs };
    (features, keep.then_some(tape))
}

/// Gradients of all weights, in the order of [`Network::layers`], and if it is wanted that of `x`.
///
/// # Panics
///
/// If lengths disagree.
pub fn backward(
    network: &Network,
    tape: Tape,
    x: &[f32],
    weights: &[Weights],
    grad_features: &[f32],
    of_x: bool,
) -> (Vec<Gradients>, Option<Vec<f32>>) {
    rayon::scope(|_| backward_here(network, tape, x, weights, grad_features, of_x))
}

fn backward_here(
    network: &Network,
    tape: Tape,
    x: &[f32],
    weights: &[Weights],
    grad_features: &[f32],
    of_x: bool,
) -> (Vec<Gradients>, Option<Vec<f32>>) {
    let Tape { batch, of_batch, mut layers, pool: (pool, which), mut outs } = tape;
    assert_eq!(layers.len(), weights.len(), "weights of each layer");
    assert_eq!(grad_features.len(), batch[0] * network.features(), "a gradient of each feature");
    let mut gradients = vec![];
    let mut give = |normed: &Normed, back: Backward, input: Input, grad: &[f32]| {
        let mut conv = vec![0.0; normed.shape.weight_len()];
        conv::backward_weight(&normed.shape, input, grad, &mut conv);
        gradients.push(Gradients { conv, scale: back.grad_scale, shift: back.grad_shift });
    };
    let mut out = outs.pop().expect("the last block's");
    let mut grad = Buffer::any(out.len());
    let pixels = out.len() / grad_features.len();
    pooling::backward_mean(pixels, network.features(), grad_features, &mut grad);
    for (_, [c, o], stride) in network.blocks().into_iter().rev() {
        let mut pop = || {
            let normed = layers.pop().expect("of each layer");
            (normed, &weights[layers.len()])
        };
        let shortcut = (stride != 1 || c != o).then(&mut pop);
        let ((two, weights_two), (one, weights_one)) = (pop(), pop());
        let x = outs.pop().expect("of each block, and the pooling's");

        let back = two.backward(of_batch, weights_two.scale, Gate::Output(&out), &mut grad);
        drop(out);
        let mut grad_two = Buffer::any(two.x.len());
        back.input(&two.x, Some(&grad), &mut grad_two);
        let mut grad_x = Buffer::any(x.len());
        if let Some((own, weights)) = &shortcut {
            let back = own.backward(of_batch, weights.scale, Gate::Open, &mut grad);
            back.input(&own.x, None, &mut grad);
            give(own, back, x[..].into(), &grad);
            conv::backward_input(&own.shape, &grad, weights.conv, &mut grad_x);
        }
        drop(shortcut.map(|(own, _)| own));
        give(&two, back, one.input(), &grad_two);
        let mut grad_one = Buffer::any(one.x.len());
        conv::backward_input(&two.shape, &grad_two, weights_two.conv, &mut grad_one);
        drop((two, grad_two));
        let gate = Gate::Map(one.map.as_affine());
        let back = one.backward(of_batch, weights_one.scale, gate, &mut grad_one);
        back.input(&one.x, None, &mut grad_one);
        give(&one, back, x[..].into(), &grad_one);
        if stride != 1 || c != o {
            let mut rest = Buffer::any(x.len());
            conv::backward_input(&one.shape, &grad_one, weights_one.conv, &mut rest);
            norm::add(&rest, &mut grad_x);
        } else {
            conv::backward_input(&one.shape, &grad_one, weights_one.conv, &mut grad_x);
            norm::add(&grad, &mut grad_x);
        }
        grad = grad_x;
        out = x;
    }
    drop(out);
    let mut stem = layers.pop().expect("the first layer");
    if stem.x.is_empty() {
        stem.x = Buffer::passing(stem.shape.output_len());
        conv::forward(&stem.shape, x, weights[0].conv, None, &mut stem.x);
    }
    let mut grad_stem = Buffer::passing(stem.x.len());
    pooling::backward_max(&pool, &grad, &which, &mut grad_stem);
    drop(grad);
    let gate = Gate::Map(stem.map.as_affine());
    let back = stem.backward(of_batch, weights[0].scale, gate, &mut grad_stem);
    back.input(&stem.x, None, &mut grad_stem);
    give(&stem, back, x.into(), &grad_stem);
    let grad_x = of_x.then(|| {
        let mut grad_x = vec![0.0; x.len()];
        conv::backward_input(&stem.shape, &grad_stem, weights[0].conv, &mut grad_x);
        grad_x
    });
    gradients.reverse();
    (gradients, grad_x)
}

impl Layer {
    fn shape(&self, [batch, height, width]: [usize; 3]) -> conv::Shape {
        conv::Shape {
            batch,
            height,
            width,
            channels: self.channels,
            out_channels: self.out_channels,
            kernel: [self.kernel; 2],
            stride: [self.stride; 2],
            padding: [self.kernel / 2; 2],
        }
    }
}
