//! ResNet34 from pictures to features (He et al., 2016, arXiv:1512.03385), by torchvision's names.
//!
//! On the CPU the whole network is one operation of candle's graph: its activations are kept and
//! given free by `pmp_kernels`, and the gradients of its weights go around candle's sums, so a loss
//! on it is gone back from by [`gradients::backward`]. Elsewhere it is made of the operations of
//! [`ops`](super::ops), one by one.

use std::sync::{Arc, Mutex, PoisonError};

use candle_core::{Shape, Tensor};
use candle_nn::{
    VarBuilder,
    init::{NonLinearity, ONE, ZERO},
};
use pmp_kernels::resnet::{self, Mode, Network, Weights};

use crate::{
    error::Result,
    model::{
        batch_norm::Running,
        describe,
        init::kaiming,
        ops::{
            Conv, Numbers, conv2d, gradients, is_for_kernels, max_pool, tensors_of, wide,
            with_gradient,
        },
        pass::Pass,
    },
};

/// The network, without torchvision's last layer, the classifier.
#[derive(Clone, Debug)]
pub struct ResNet34 {
    network: Network,
    /// Kernel, scale and shift of each layer.
    weights: Vec<Tensor>,
    running: Vec<Running>,
}

impl ResNet34 {
    /// Build with parameters named `conv1.weight`, `bn1.weight`, `bn1.bias`, `bn1.running_mean`,
    /// `bn1.running_var`, `layer1.0.conv1.weight`, ..., `layer2.0.downsample.0.weight`, ...;
    /// `width` channels in the first stage, 64 in the paper.
    ///
    /// # Errors
    ///
    /// [`Error::Tensor`](crate::error::Error::Tensor) if the builder lacks a parameter or has it
    /// in another shape.
    pub fn new(channels: usize, width: usize, vb: VarBuilder) -> Result<Self> {
        let network = Network { channels, width, depths: [3, 4, 6, 3] };
        let (mut weights, mut running) = (vec![], vec![]);
        for layer in network.layers() {
            let kernel = (layer.out_channels, layer.channels, layer.kernel, layer.kernel);
            let start = kaiming(NonLinearity::ReLU);
            weights.push(vb.pp(&layer.conv).get_with_hints(kernel, "weight", start)?);
            let norm = vb.pp(&layer.norm);
            weights.push(norm.get_with_hints(layer.out_channels, "weight", ONE)?);
            weights.push(norm.get_with_hints(layer.out_channels, "bias", ZERO)?);
            running.push(Running::new(layer.out_channels, &norm)?);
        }
        Ok(Self { network, weights, running })
    }

    /// Numbers of a feature.
    pub fn width(&self) -> usize {
        self.network.features()
    }

    /// The layers of a picture of a height and width, named below `name`.
    pub fn layers(&self, name: &str, size: [usize; 2]) -> Vec<describe::Layer> {
        let half = |[height, width]: [usize; 2]| [height.div_ceil(2), width.div_ceil(2)];
        let mut sizes = vec![half(size)];
        let mut at = half(half(size)); // behind the pooling
        let mut shortcut_from = at;
        for layer in self.network.layers().iter().skip(1) {
            if layer.kernel == 1 {
                sizes.push(half(shortcut_from));
                continue;
            }
            if layer.stride == 2 {
                shortcut_from = at;
                at = half(at);
            }
            sizes.push(at);
        }
        let line = |(layer, [height, width]): (resnet::Layer, [usize; 2])| {
            let (output, extra) = ([height, width, layer.out_channels], 2 * layer.out_channels);
            let name = format!("{name}.{}", layer.conv);
            describe::Layer::conv(name, layer.channels, layer.kernel, output, extra)
        };
        self.network.layers().into_iter().zip(sizes).map(line).collect()
    }

    /// `[B, H, W, C]` to `[B, 8 width]`, all 0 or more, f32 if `x` is bf16. A pass that learns normalises by the batch
    /// and moves the running statistics.
    ///
    /// # Errors
    ///
    /// [`Error::Tensor`](crate::error::Error::Tensor) if the picture has other channels or no
    /// pixels.
    pub fn forward(&self, x: &Tensor, pass: &Pass) -> Result<Tensor> {
        let (batch, height, width, channels) = x.dims4()?;
        if channels != self.network.channels || x.elem_count() == 0 {
            let what =
                format!("{:?} for a network of {} channels", x.dims(), self.network.channels);
            return Err(candle_core::Error::msg(what).into());
        }
        if !is_for_kernels(x) {
            return self.by_operations(x, pass);
        }
        let numbers = Numbers::of([x].into_iter().chain(&self.weights))?;
        let running = self.running.iter().map(Running::moments).collect::<Result<Vec<_>>>()?;
        let of_x = x.track_op();
        let keep = of_x || self.weights[0].track_op();
        let mut moved = running.clone();
        let (features, tape) = numbers.read(|slices| {
            let mode = match pass.learns() {
                true => Mode::Train(&mut moved),
                false => Mode::Eval(&running),
            };
            let size = [batch, height, width];
            resnet::forward(&self.network, size, slices[0], &weights(slices), mode, keep)
        });
        if pass.learns() {
            for (running, moved) in self.running.iter().zip(moved) {
                running.set(&tensors_of(&moved)?)?;
            }
        }
        let shape = Shape::from((batch, self.network.features()));
        let Some(tape) = tape else {
            return Ok(Tensor::from_vec(features, shape, x.device())?);
        };
        let tape = Arc::new(Mutex::new(Some(tape)));
        let (network, all, size) = (self.network.clone(), self.weights.clone(), x.shape().clone());
        let back = move |grad: &Tensor| {
            let Some(tape) = tape.lock().unwrap_or_else(PoisonError::into_inner).take() else {
                let what = "a second way back through one forward pass of a ResNet34";
                return Err(candle_core::Error::msg(what).into());
            };
            let grad = Numbers::of([grad])?;
            let (gradients, grad_x) = numbers.read(|slices| {
                grad.read(|grad| {
                    let all = weights(slices);
                    resnet::backward(&network, tape, slices[0], &all, grad[0], of_x)
                })
            });
            let each =
                gradients.into_iter().flat_map(|layer| [layer.conv, layer.scale, layer.shift]);
            for (weight, grad) in all.iter().zip(each).filter(|(weight, _)| weight.track_op()) {
                let grad = Tensor::from_vec(grad, weight.shape(), weight.device())?;
                gradients::leave(weight, grad)?;
            }
            let grad_x = grad_x.map(|grad| Tensor::from_vec(grad, &size, weight_device(&all)));
            Ok(vec![grad_x.transpose()?, None])
        };
        // One of the weights, so that candle knows that there is something to go back for.
        with_gradient("resnet34", (features, shape), &[x, &self.weights[0]], Box::new(back))
    }
}

impl ResNet34 {
    /// The same, an operation after the other.
    fn by_operations(&self, x: &Tensor, pass: &Pass) -> Result<Tensor> {
        let layers = self.network.layers();
        let normed = |at: usize, x: &Tensor, residual: Option<&Tensor>, relu: bool| {
            let (layer, weights) = (&layers[at], &self.weights[3 * at..]);
            let conv = Conv { stride: layer.stride, padding: layer.kernel / 2 };
            let x = conv2d(x, &weights[0], None, conv)?;
            self.running[at].normalise(&x, [&weights[1], &weights[2]], residual, relu, pass)
        };
        let mut x = max_pool(&normed(0, x, None, true)?, 3, Conv { stride: 2, padding: 1 })?;
        let mut at = 1;
        while at < layers.len() {
            // Of a block the shortcut is the last.
            let has_shortcut = layers.get(at + 2).is_some_and(|layer| layer.kernel == 1);
            let shortcut = match has_shortcut {
                true => normed(at + 2, &x, None, false)?,
                false => x.clone(),
            };
            let inner = normed(at, &x, None, true)?;
            x = normed(at + 1, &inner, Some(&shortcut), true)?;
            at += 2 + usize::from(has_shortcut);
        }
        Ok(x.to_dtype(wide(x.dtype()))?.mean((1, 2))?)
    }
}

/// Of slices of the picture and the weights, the latter.
fn weights<'s>(slices: &[&'s [f32]]) -> Vec<Weights<'s>> {
    let layer = |layer: &[&'s [f32]]| Weights { conv: layer[0], scale: layer[1], shift: layer[2] };
    slices[1..].chunks_exact(3).map(layer).collect()
}

fn weight_device(weights: &[Tensor]) -> &candle_core::Device {
    weights[0].device()
}
