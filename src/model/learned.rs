//! A trained run as a policy: a frame in, the network's action and mixture out, in SI units.

use std::path::Path;

use candle_core::{DType, Device, Tensor};
use candle_nn::VarBuilder;

use crate::{
    dataset::{
        batch::Inputs,
        sample::{InputSize, Sample},
    },
    error::{Error, Result},
    frame::{FUTURE_STEPS, Frame},
    model::{
        mixture::{MOTION_SPEED_UNIT_MPS, Mixture},
        network::Network,
        output::Output,
        pass::Pass,
        run::{self, Trained},
    },
    policy::{Action, Mode, ModeStd, Plan, Policy, Senses},
};

/// A run directory that drives. It looks at one frame at a time and remembers nothing.
#[derive(Debug)]
pub struct Learned {
    name: String,
    net: Network,
    size: Option<InputSize>,
    device: Device,
    sha256: String,
}

impl Learned {
    /// The last checkpoint of a run; its name in tables is that of the directory.
    ///
    /// # Errors
    ///
    /// Those of [`run::trained`]; [`Error::Run`] if the weights do not fit the configuration.
    pub fn open(dir: &Path, device: &Device) -> Result<Self> {
        let Trained { config, weights, sha256 } = run::trained(dir, device)?;
        let vb = VarBuilder::from_tensors(weights, DType::F32, device);
        let net = Network::new(&config.net, vb).map_err(|e| Error::Run {
            path: dir.into(),
            what: format!("the weights are not those of the configuration ({e})"),
            hint: None,
        })?;
        let name = dir.file_name().unwrap_or(dir.as_os_str()).to_string_lossy().into_owned();
        Ok(Self { name, net, size: config.net.input_size(), device: device.clone(), sha256 })
    }

    /// What the network says of one frame, `B` = 1.
    ///
    /// # Errors
    ///
    /// [`Error::Picture`] if the frame's picture cannot be used, [`Error::Tensor`].
    pub fn output(&self, frame: &Frame) -> Result<Output> {
        let sample = Sample::new(frame, self.size)?;
        self.net.forward(&Inputs::stack(&[&sample], &self.device)?, &Pass::Judge)
    }

    /// SHA-256 of the file of its weights.
    pub fn sha256(&self) -> &str {
        &self.sha256
    }

    /// Whether it plans motion beside a direct action.
    pub fn plans_motion(&self) -> bool {
        self.net.plans_motion()
    }

    /// Whether it looks at no picture: neither the camera's nor that of lidar and radar.
    pub fn is_blind(&self) -> bool {
        self.size.is_none()
    }

    /// Names of [`Output::attention`].
    pub fn branches(&self) -> Vec<&'static str> {
        self.net.branches()
    }
}

impl Policy for Learned {
    fn name(&self) -> &str {
        &self.name
    }

    fn reset(&mut self) {}

    fn senses(&self) -> Senses {
        self.net.senses()
    }

    fn plan(&mut self, frame: &Frame) -> Result<Plan> {
        let output = self.output(frame)?;
        let action = output.action.flatten_all()?.to_vec1::<f32>()?;
        let action = Action { steer: action[0], throttle: action[1], brake: action[2] };
        let motion = output.motion.as_ref().map(modes).transpose()?.unwrap_or_default();
        let shares = output.attention.map(|shares| shares.flatten_all()?.to_vec1::<f32>());
        let shares = shares.transpose()?.unwrap_or_default();
        let attention = self.net.branches().into_iter().zip(shares).collect();
        Ok(Plan { action: Some(action), motion, attention })
    }
}

/// The modes of the first mixture of a batch, in m/s and rad. Of mixtures at each step, a mode's
/// weight is the mean of its weights over the steps.
fn modes(mixture: &Mixture) -> Result<Vec<Mode>> {
    let weights = mixture.log_weights()?.get(0)?.exp()?.mean(1)?.to_vec1::<f32>()?;
    let means = steps(&mixture.mean.get(0)?)?;
    let stds = steps(&mixture.log_std.get(0)?.exp()?)?;
    let mode = |((weight, mean), std): ((f32, Steps), Steps)| Mode {
        weight,
        speed_mps: mean.0,
        yaw_rad: mean.1,
        std: Some(ModeStd { speed_mps: std.0, yaw_rad: std.1 }),
    };
    Ok(weights.into_iter().zip(means).zip(stds).map(mode).collect())
}

/// Speeds (m/s) and yaw changes (rad) of one mode.
type Steps = ([f32; FUTURE_STEPS], [f32; FUTURE_STEPS]);

/// `[K, 30, 2]` in normalised units to the steps of each mode.
fn steps(numbers: &Tensor) -> Result<Vec<Steps>> {
    let scaled = |mode: Vec<Vec<f32>>| {
        let speed_mps = std::array::from_fn(|i| mode[i][0] * MOTION_SPEED_UNIT_MPS as f32);
        (speed_mps, std::array::from_fn(|i| mode[i][1]))
    };
    Ok(numbers.to_vec3::<f32>()?.into_iter().map(scaled).collect())
}
