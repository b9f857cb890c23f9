//! One frame made ready for a network: pictures decoded and shrunk, labels and masks in place.
//!
//! This is the costly half of making a batch. It works on one frame and knows no tensors, so a
//! loader can do it on any thread and keep the result; stacking is the cheap half. Pictures stay
//! in the precision they were recorded in (8 and 16 bits): a sample of 32 x 80 is 28 kB.
//! Nothing is normalised here, see [`batch`](crate::dataset::batch).

use half::f16;

use crate::{
    dataset::picture::{
        jpeg,
        scale::{self, Area},
    },
    error::{Error, Result},
    frame::{Command, FUTURE_STEPS, Frame, IMAGE_HEIGHT, IMAGE_WIDTH, ROUTE_POINTS},
};

/// Size of the pictures a network sees, pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InputSize {
    pub height: usize,
    pub width: usize,
}

/// One frame as a network takes it, before stacking. SI units.
#[derive(Clone, Debug, PartialEq)]
pub struct Sample {
    /// Of both pictures; `None` for a network without pictures.
    pub size: Option<InputSize>,
    /// `[H, W, 3]` RGB, 0 ... 255; empty without a size.
    pub camera: Vec<u8>,
    /// `[H, W, 4]`: x, y, z in metres (optical frame), relative speed in m/s, 0 = no return; empty
    /// without a size.
    pub ralidar: Vec<f16>,
    /// Which sensors delivered: camera, ralidar.
    pub present: [bool; 2],
    /// (vx, vy), ego frame.
    pub velocity_mps: [f32; 2],
    /// x1, y1, x2, y2, ... in the ego frame.
    pub route_m: [f32; 2 * ROUTE_POINTS],
    /// Index in [`Command::ALL`].
    pub command: u32,
    /// Steer, throttle, brake.
    pub action: [Option<f32>; 3],
    /// Speed (m/s) and yaw change from now (rad) at t = 0.1 ... 3.0 s.
    pub motion: [[f32; 2]; FUTURE_STEPS],
    /// Valid steps of `motion`, from the first. A loader that knows the whole episode may lower
    /// it, where the steps after it are not what the driver wanted.
    pub motion_len: usize,
}

impl Sample {
    /// Prepare a frame for a network with pictures of `size`, or without any.
    ///
    /// The picture is shrunk by averaging over areas (the aspect ratio may change). Of several
    /// lidar returns on one pixel the nearest (smallest z) stays, of several radar returns the
    /// one with the largest |speed|; the first of equals. An empty JPEG is an absent camera;
    /// ralidar is present if lidar or radar is. While the driving is disturbed on purpose, what
    /// the car did next is not what the driver wanted, so no step of motion is valid then.
    ///
    /// # Errors
    ///
    /// [`Error::Picture`] if the JPEG cannot be decoded, is larger than [`MAX_SIDE`](crate::dataset::picture::rgb::MAX_SIDE), or a
    /// return lies outside of the picture.
    pub fn new(frame: &Frame, size: Option<InputSize>) -> Result<Self> {
        let wrong = |what: String| Error::Picture { frame: frame.index, what };
        let (mut camera, mut ralidar) = (Vec::new(), Vec::new());
        if let Some(size) = size {
            let stored = if frame.image.is_empty() {
                camera = vec![0; 3 * size.height * size.width];
                InputSize { height: IMAGE_HEIGHT, width: IMAGE_WIDTH }
            } else {
                let stored = jpeg::decode(&frame.image).map_err(wrong)?;
                let shrunk = scale::resize(&stored, Area::whole(&stored), size.width, size.height);
                camera = shrunk.map_err(wrong)?.into_owned().data;
                InputSize { height: stored.height, width: stored.width }
            };
            ralidar = scatter(frame, stored, size).map_err(wrong)?;
        }
        let future = &frame.future;
        Ok(Self {
            size,
            camera,
            ralidar,
            present: [!frame.image.is_empty(), frame.lidar.is_some() || frame.radar.is_some()],
            velocity_mps: frame.velocity_mps,
            route_m: frame.route.waypoints_m,
            command: Command::ALL.iter().take_while(|c| **c != frame.command).count() as u32,
            action: [frame.action.steer, frame.action.throttle, frame.action.brake],
            motion: std::array::from_fn(|i| [future.speed_mps[i], future.yaw_rad[i]]),
            motion_len: if frame.perturbed { 0 } else { usize::from(future.len) },
        })
    }
}

/// Lidar and radar returns of the stored picture on the pixels of the shrunk one: `[H, W, 4]`.
fn scatter(frame: &Frame, from: InputSize, to: InputSize) -> Result<Vec<f16>, String> {
    let area = to.height * to.width;
    let mut out = vec![f16::ZERO; 4 * area];
    let target = |pixel: u32, sensor: &str| {
        let (row, column) = (pixel as usize / from.width, pixel as usize % from.width);
        if row >= from.height {
            let InputSize { height, width } = from;
            return Err(format!("{sensor} pixel {pixel} is outside of {width} x {height}"));
        }
        Ok(row * to.height / from.height * to.width + column * to.width / from.width)
    };
    if let Some(lidar) = &frame.lidar {
        let mut nearest = vec![f16::INFINITY; area];
        let xyz = lidar.x.iter().zip(&lidar.y).zip(&lidar.z);
        for (&pixel, ((&x, &y), &z)) in lidar.pixel.iter().zip(xyz) {
            let at = target(pixel, "lidar")?;
            if z < nearest[at] {
                nearest[at] = z;
                out[4 * at..4 * at + 3].copy_from_slice(&[x, y, z]);
            }
        }
    }
    // Returns of a radar without speeds have nothing to say in the channel of speeds.
    if let Some(radar) = &frame.radar
        && let Some(speeds) = &radar.speed_mps
    {
        for (&pixel, &speed) in radar.pixel.iter().zip(speeds) {
            let at = 4 * target(pixel, "radar")? + 3;
            if speed.to_f32().abs() > out[at].to_f32().abs() {
                out[at] = speed;
            }
        }
    }
    Ok(out)
}
