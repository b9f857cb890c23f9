//! Where a network computes: on the CPU, or on one of NVIDIA's GPUs.

use std::{fmt, str::FromStr};

use candle_core::{Device, utils::cuda_is_available};
use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};

/// Where to compute: `auto`, `cpu`, `cuda`, `cuda:1`. On the CPU the same run has the same bits
/// whenever and on however many threads it is made; on a GPU that is not promised.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[serde(try_from = "String", into = "String")]
pub enum Place {
    /// The first GPU if the program was built for one and it answers, else the CPU.
    #[default]
    Auto,
    Cpu,
    /// A GPU by CUDA's number.
    Cuda(usize),
}

impl Place {
    /// The device.
    ///
    /// # Errors
    ///
    /// [`Error::Config`] for a GPU in a program that was not built for one, or that does not
    /// answer.
    pub fn open(self) -> Result<Device> {
        match self {
            Place::Cpu => Ok(Device::Cpu),
            Place::Auto if !cuda_is_available() => Ok(Device::Cpu),
            Place::Auto => Ok(Device::new_cuda(0).unwrap_or(Device::Cpu)),
            Place::Cuda(_) if !cuda_is_available() => Err(Error::Config {
                key: "device".into(),
                what: format!("{self} in a program that was built without CUDA"),
                hint: Some("scripts/build_cuda.sh builds one that has it".into()),
            }),
            Place::Cuda(number) => Device::new_cuda(number).map_err(|e| Error::Config {
                key: "device".into(),
                what: format!("{self} does not answer ({e})"),
                hint: Some("`nvidia-smi` lists those there are; `cpu` computes without".into()),
            }),
        }
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Place::Auto => f.write_str("auto"),
            Place::Cpu => f.write_str("cpu"),
            Place::Cuda(0) => f.write_str("cuda"),
            Place::Cuda(number) => write!(f, "cuda:{number}"),
        }
    }
}

impl FromStr for Place {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("`{text}` is none of auto, cpu, cuda, cuda:N");
        match (text, text.strip_prefix("cuda:")) {
            ("auto", _) => Ok(Place::Auto),
            ("cpu", _) => Ok(Place::Cpu),
            ("cuda", _) => Ok(Place::Cuda(0)),
            (_, Some(number)) => number.parse().map(Place::Cuda).map_err(|_not_a_number| wrong()),
            _ => Err(wrong()),
        }
    }
}

impl TryFrom<String> for Place {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        text.parse()
    }
}

impl From<Place> for String {
    fn from(place: Place) -> Self {
        place.to_string()
    }
}
