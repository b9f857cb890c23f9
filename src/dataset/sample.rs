//! One frame made ready for a network: pictures decoded and shrunk, labels and masks in place.
//!
//! This is the costly half of making a batch. It works on one frame and knows no tensors, so a
//! loader can do it on any thread and keep the result; stacking is the cheap half. Pictures stay
//! in the precision they were recorded in (8 and 16 bits), lidar and radar as the pixels that have
//! returns: a sample of 600 x 250 is half a megabyte.
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
    /// Where there is a return, row x W + column, each once; empty without a size.
    pub ralidar_pixel: Vec<u32>,
    /// What is there: x, y, z in metres (optical frame), relative speed in m/s, 0 = no return.
    pub ralidar: Vec<[f16; 4]>,
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
        let (mut camera, mut ralidar) = (Vec::new(), Returns::default());
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
            ralidar = Returns::shrunk(frame, stored, size).map_err(wrong)?;
        }
        let future = &frame.future;
        Ok(Self {
            size,
            camera,
            ralidar_pixel: ralidar.pixel,
            ralidar: ralidar.values,
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

/// Returns by pixel, in the order in which they were met.
#[derive(Default)]
struct Returns {
    pixel: Vec<u32>,
    values: Vec<[f16; 4]>,
}

impl Returns {
    /// Lidar and radar returns of the stored picture on the pixels of the shrunk one.
    fn shrunk(frame: &Frame, from: InputSize, to: InputSize) -> Result<Self, String> {
        let target = |pixel: u32, sensor: &str| {
            let (row, column) = (pixel as usize / from.width, pixel as usize % from.width);
            if row >= from.height {
                let InputSize { height, width } = from;
                return Err(format!("{sensor} pixel {pixel} is outside of {width} x {height}"));
            }
            Ok(row * to.height / from.height * to.width + column * to.width / from.width)
        };
        let mut returns = Returns::default();
        // Where the returns of a pixel are, from 1; 0 where it has none yet.
        let mut place = vec![0u32; to.height * to.width];
        if let Some(lidar) = &frame.lidar {
            let xyz = lidar.x.iter().zip(&lidar.y).zip(&lidar.z);
            for (&pixel, ((&x, &y), &z)) in lidar.pixel.iter().zip(xyz) {
                let at = target(pixel, "lidar")?;
                let is_new = place[at] == 0;
                let value = returns.at(at, &mut place);
                if is_new || z < value[2] {
                    [value[0], value[1], value[2]] = [x, y, z];
                }
            }
        }
        // Returns of a radar without speeds have nothing to say in the channel of speeds.
        if let Some(radar) = &frame.radar
            && let Some(speeds) = &radar.speed_mps
        {
            for (&pixel, &speed) in radar.pixel.iter().zip(speeds) {
                let value = returns.at(target(pixel, "radar")?, &mut place);
                if speed.to_f32().abs() > value[3].to_f32().abs() {
                    value[3] = speed;
                }
            }
        }
        Ok(returns)
    }

    fn at(&mut self, pixel: usize, place: &mut [u32]) -> &mut [f16; 4] {
        if place[pixel] == 0 {
            self.pixel.push(pixel as u32);
            self.values.push([f16::ZERO; 4]);
            place[pixel] = self.values.len() as u32;
        }
        &mut self.values[place[pixel] as usize - 1]
    }
}
