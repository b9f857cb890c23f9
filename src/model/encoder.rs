//! A picture to a vector: scaled, convolved, flattened.

use candle_core::{DType, Tensor};
use candle_nn::{VarBuilder, init::NonLinearity, init::ZERO};

use crate::{
    error::Result,
    model::{
        batch_norm::BatchNorm,
        describe,
        init::kaiming,
        net_config::{self, PictureConfig, Ranging},
        ops::{Conv, conv2d},
        pass::Pass,
        resnet::ResNet34,
    },
};

/// ImageNet's mean and standard deviation of R, G, B in 0 ... 1.
const CAMERA_MEAN: [f32; 3] = [0.485, 0.456, 0.406];
const CAMERA_STD: [f32; 3] = [0.229, 0.224, 0.225];

/// x, y, z are divided by 50 m, relative speeds by 20 m/s.
const METRES_UNITS: [f32; 4] = [50.0, 50.0, 50.0, 20.0];

/// x is divided by 10 m, y by 2 m, relative speeds by 10 m/s; nearness has no unit.
const NEARNESS_UNITS: [f32; 4] = [10.0, 2.0, 1.0, 10.0];

/// Depth at which nearness is 1/2.
const HALF_NEAR_M: f64 = 5.0;

/// Kernel sides and strides of CIL's eight convolutions, none of them padded (Codevilla 2018, its
/// authors' `imitation_learning_network.py`).
const CIL: [(usize, usize); 8] = [(5, 2), (3, 1), (3, 2), (3, 1), (3, 2), (3, 1), (3, 1), (3, 1)];

/// Which picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sensor {
    /// `[B, H, W, 3]`, RGB in 0 ... 1.
    Camera,
    /// `[B, H, W, 4]`: x, y, z in metres (camera, optical), relative speed in m/s, which is looked
    /// at with `radar` alone.
    Ralidar { ranging: Ranging, radar: bool },
}

impl Sensor {
    /// Mean and unit of each number of a pixel that is looked at.
    fn scale(self) -> (&'static [f32], &'static [f32]) {
        const ZERO: [f32; 4] = [0.0; 4];
        let (ranging, radar) = match self {
            Sensor::Camera => return (&CAMERA_MEAN, &CAMERA_STD),
            Sensor::Ralidar { ranging, radar } => (ranging, radar),
        };
        let units = match ranging {
            Ranging::Metres => &METRES_UNITS,
            Ranging::Nearness => &NEARNESS_UNITS,
        };
        let channels = if radar { 4 } else { 3 };
        (&ZERO[..channels], &units[..channels])
    }

    /// The numbers that are looked at.
    fn looked_at(self, picture: &Tensor) -> Result<Tensor> {
        let (ranging, radar) = match self {
            Sensor::Camera => return Ok(picture.clone()),
            // As it is: to cut it up and join it again would be a copy.
            Sensor::Ralidar { ranging: Ranging::Metres, radar: true } => return Ok(picture.clone()),
            Sensor::Ralidar { ranging, radar } => (ranging, radar),
        };
        let [across_down, depth_m, speed_mps] =
            [(0, 2), (2, 1), (3, 1)].map(|(from, len)| picture.narrow(3, from, len));
        let (across_down, depth_m) = (across_down?, depth_m?);
        let ahead = match ranging {
            Ranging::Metres => depth_m,
            Ranging::Nearness => {
                let nearness = ((&depth_m + HALF_NEAR_M)?.recip()? * HALF_NEAR_M)?;
                depth_m.gt(0.0)?.where_cond(&nearness, &depth_m.zeros_like()?)?
            }
        };
        match radar {
            true => Ok(Tensor::cat(&[across_down, ahead, speed_mps?], 3)?),
            false => Ok(Tensor::cat(&[across_down, ahead], 3)?),
        }
    }
}

/// The convolutional half of a picture's branch.
#[derive(Clone, Debug)]
pub struct Encoder {
    sensor: Sensor,
    /// `[C]`: the input is scaled to (x - mean) / unit.
    mean: Tensor,
    unit: Tensor,
    layers: Layers,
    name: String,
    /// Of the pictures that go in, pixels.
    size: [usize; 2],
    /// Numbers that come out.
    pub width: usize,
}

#[derive(Clone, Debug)]
enum Layers {
    Stack(Vec<Layer>),
    Resnet(ResNet34),
}

/// A convolution with its norm, a ReLU after both.
#[derive(Clone, Debug)]
struct Layer {
    weight: Tensor,
    /// Absent where a norm follows, which has one.
    bias: Option<Tensor>,
    norm: Option<BatchNorm>,
    conv: Conv,
}

impl Encoder {
    /// Build with parameters named `conv0.weight`, `conv0.bias`, `norm0.weight`, ..., or those of
    /// torchvision's ResNet34.
    ///
    /// # Errors
    ///
    /// [`Error::Tensor`](crate::error::Error::Tensor) if the builder lacks a parameter or has it
    /// in another shape.
    pub fn new(sensor: Sensor, cfg: &PictureConfig, vb: VarBuilder) -> Result<Self> {
        let (mean, unit) = sensor.scale();
        let constant = |values: &[f32]| Tensor::new(values, vb.device())?.to_dtype(vb.dtype());
        let (mean, unit) = (constant(mean)?, constant(unit)?);
        let (name, size) = (vb.prefix(), [cfg.height, cfg.width]);
        let (layers, width) = match cfg.encoder {
            net_config::Encoder::Resnet34 => {
                let net = ResNet34::new(mean.elem_count(), cfg.channels[0], vb)?;
                let width = net.width();
                (Layers::Resnet(net), width)
            }
            net_config::Encoder::Strided => {
                let kernels = vec![(3, 2, 1); cfg.channels.len()];
                stack(mean.elem_count(), cfg, &kernels, &vb)?
            }
            net_config::Encoder::Cil => {
                let kernels = CIL.map(|(side, stride)| (side, stride, 0));
                stack(mean.elem_count(), cfg, &kernels, &vb)?
            }
        };
        Ok(Self { sensor, mean, unit, layers, name, size, width })
    }

    /// `[B, H, W, C]` and `[B, 1]` to `[B, width]`, all 0 or more, of the picture's type; computed
    /// in that of the pass. Where the sensor is not present, the picture is not looked at: not even
    /// an infinity in it comes through.
    ///
    /// # Errors
    ///
    /// [`Error::Tensor`](crate::error::Error::Tensor) if shapes disagree.
    pub fn forward(&self, picture: &Tensor, present: &Tensor, pass: &Pass) -> Result<Tensor> {
        let scaled =
            self.sensor.looked_at(picture)?.broadcast_sub(&self.mean)?.broadcast_div(&self.unit)?;
        let x = match all_present(present)? {
            true => scaled,
            false => {
                let present = present.reshape(((), 1, 1, 1))?.gt(0.0)?;
                let present = present.broadcast_as(scaled.shape())?;
                present.where_cond(&scaled, &scaled.zeros_like()?)?
            }
        };
        let x = x.to_dtype(pass.activations().unwrap_or(picture.dtype()))?;
        let x = match &self.layers {
            Layers::Resnet(net) => net.forward(&x, pass)?,
            Layers::Stack(layers) => {
                let x = layers.iter().try_fold(x, |x, layer| layer.forward(&x, pass))?;
                x.flatten_from(1)?
            }
        };
        Ok(x.to_dtype(picture.dtype())?)
    }
}

impl Encoder {
    /// The layers, for one frame.
    pub fn layers(&self) -> Vec<describe::Layer> {
        let layers = match &self.layers {
            Layers::Resnet(net) => return net.layers(&self.name, self.size),
            Layers::Stack(layers) => layers,
        };
        let mut size = self.size;
        let line = |(i, layer): (usize, &Layer)| {
            let kernel = layer.weight.dims();
            size = size.map(|pixels| layer.conv.out(pixels, kernel[2]));
            let (output, extra) = ([size[0], size[1], kernel[0]], layer.extra_parameters());
            let name = format!("{}.conv{i}", self.name);
            describe::Layer::conv(name, kernel[1], kernel[2], output, extra)
        };
        layers.iter().enumerate().map(line).collect()
    }
}

/// Whether every sample has the sensor, which spares a pass over the pictures.
fn all_present(present: &Tensor) -> Result<bool> {
    Ok(present.to_dtype(DType::F32)?.min_all()?.to_scalar::<f32>()? > 0.0)
}

/// Convolutions of (side, stride, padding), and the numbers that come out of the last.
fn stack(
    channels: usize,
    cfg: &PictureConfig,
    kernels: &[(usize, usize, usize)],
    vb: &VarBuilder,
) -> Result<(Layers, usize)> {
    let (mut layers, mut c_in) = (vec![], channels);
    let (mut height, mut width) = (cfg.height, cfg.width);
    for (i, (&c_out, &(side, stride, padding))) in cfg.channels.iter().zip(kernels).enumerate() {
        let at = vb.pp(format!("conv{i}"));
        let start = kaiming(NonLinearity::ReLU);
        let weight = at.get_with_hints((c_out, c_in, side, side), "weight", start)?;
        let (bias, norm) = match cfg.batch_norm {
            true => (None, Some(BatchNorm::new(c_out, vb.pp(format!("norm{i}")))?)),
            false => (Some(at.get_with_hints(c_out, "bias", ZERO)?), None),
        };
        let conv = Conv { stride, padding };
        (height, width) = (conv.out(height, side), conv.out(width, side));
        layers.push(Layer { weight, bias, norm, conv });
        c_in = c_out;
    }
    Ok((Layers::Stack(layers), c_in * height * width))
}

impl Layer {
    fn forward(&self, x: &Tensor, pass: &Pass) -> Result<Tensor> {
        let x = conv2d(x, &self.weight, self.bias.as_ref(), self.conv)?;
        match &self.norm {
            Some(norm) => norm.forward_relu(&x, None, pass),
            None => Ok(x.relu()?),
        }
    }

    /// A bias for each channel, or a norm's scale and shift.
    fn extra_parameters(&self) -> usize {
        let channels = self.weight.dims()[0];
        if self.norm.is_some() { 2 * channels } else { channels }
    }
}
