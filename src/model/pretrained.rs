//! ResNet34 weights of torchvision or timm as a start.
//!
//! Read are `.safetensors` and PyTorch's `.pth`. Names are torchvision's, which timm's are too:
//! `conv1.weight`, `bn1.weight`, `bn1.bias`, `bn1.running_mean`, `bn1.running_var`,
//! `layer1.0.conv1.weight`, ..., `layer2.0.downsample.0.weight`, ...; `fc.*` and
//! `*.num_batches_tracked` are not used. Every ResNet34 of the network starts from them. The first
//! convolution of one that sees four channels has torchvision's kernels for the first three and
//! their mean for the fourth.

use std::{collections::HashMap, path::Path};

use candle_core::{Device, Tensor};

use crate::{
    error::{Error, Result},
    model::init::Weights,
};

/// A weight that every ResNet34 has, and nothing else.
const MARK: &str = ".layer4.2.conv2.weight";

/// Set the weights of every ResNet34 of a network from a file.
///
/// # Errors
///
/// [`Error::Config`] if the network has no ResNet34, or the file lacks a weight, has it in another
/// shape or cannot be read.
pub fn load(path: &Path, weights: &Weights) -> Result<()> {
    let wrong = |what: String, hint: Option<&str>| Error::Config {
        key: "pretrained".into(),
        what: format!("{what}: {}", path.display()),
        hint: hint.map(String::from),
    };
    let unreadable = |e: candle_core::Error| wrong(format!("cannot be read ({e})"), None);
    let file: HashMap<String, Tensor> = match path.extension().and_then(|e| e.to_str()) {
        Some("safetensors") => {
            candle_core::safetensors::load(path, &Device::Cpu).map_err(unreadable)?
        }
        Some("pth" | "pt") => {
            candle_core::pickle::read_all(path).map_err(unreadable)?.into_iter().collect()
        }
        _ => return Err(wrong("neither .safetensors nor .pth".into(), None)),
    };
    let resnets: Vec<String> =
        weights.iter().filter_map(|(name, _)| Some(name.strip_suffix(MARK)?.to_string())).collect();
    if resnets.is_empty() {
        let hint = "`encoder = \"resnet34\"` in [net.picture], or the preset `paper`";
        return Err(wrong("the network has no ResNet34 to start from".into(), Some(hint)));
    }
    for (name, var) in weights.iter() {
        let of = resnets.iter().find_map(|r| name.strip_prefix(r.as_str())?.strip_prefix('.'));
        // What follows the ResNet34 in its branch is ours.
        let Some(theirs) = of.filter(|theirs| !theirs.starts_with("fc")) else { continue };
        let Some(value) = file.get(theirs) else {
            let hint = "names are torchvision's, see the documentation of `pretrained`";
            return Err(wrong(format!("has no {theirs}"), Some(hint)));
        };
        let value = value.to_device(var.device())?.to_dtype(var.dtype())?;
        let value = match theirs {
            "conv1.weight" => with_channels(&value, var.dims()[1])?,
            _ => value,
        };
        if value.dims() != var.dims() {
            let (got, need) = (value.dims(), var.dims());
            return Err(wrong(format!("{theirs} is {got:?}, the network needs {need:?}"), None));
        }
        var.set(&value)?;
    }
    Ok(())
}

/// `[O, 3, K, K]` to `[O, channels, K, K]`: channels beyond the third are the mean of the three.
fn with_channels(kernel: &Tensor, channels: usize) -> Result<Tensor> {
    let have = kernel.dim(1)?;
    if have >= channels {
        return Ok(kernel.clone());
    }
    let mean = kernel.mean_keepdim(1)?;
    let more = vec![mean; channels - have];
    let all: Vec<&Tensor> = [kernel].into_iter().chain(&more).collect();
    Ok(Tensor::cat(&all, 1)?)
}
