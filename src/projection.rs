//! Points onto the picture: the camera model that ingest and the simulator share.

use glam::DVec3;

use crate::error::{Error, Result};

/// Nearest depth that is projected, metres: closer returns hit the ego vehicle or the lens.
pub const NEAR_M: f64 = 0.5;

/// Lens distortion, applied to normalised coordinates (x/z, y/z).
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(tag = "model", content = "coefficients", rename_all = "snake_case")]
pub enum Distortion {
    None,
    /// k1, k2, p1, p2, k3 (ROS `plumb_bob`; Brown-Conrady as in OpenCV).
    PlumbBob([f64; 5]),
    /// k1, k2, p1, p2, k3, k4, k5, k6 (ROS `rational_polynomial`).
    RationalPolynomial([f64; 8]),
    /// k1 ... k4 (ROS `equidistant`; OpenCV's fisheye).
    Equidistant([f64; 4]),
}

/// A pinhole camera with distortion; optical frame x right, y down, z forward, metres.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Camera {
    /// Pixels.
    pub width: usize,
    pub height: usize,
    /// Focal lengths and principal point, pixels.
    pub fx: f64,
    pub fy: f64,
    pub cx: f64,
    pub cy: f64,
    pub distortion: Distortion,
}

/// A rectangle of a picture, pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Crop {
    pub x: usize,
    pub y: usize,
    pub width: usize,
    pub height: usize,
}

impl Crop {
    /// Whether it is a part of a picture of that size.
    pub fn lies_inside(&self, width: usize, height: usize) -> bool {
        self.width > 0
            && self.height > 0
            && self.x.checked_add(self.width).is_some_and(|right| right <= width)
            && self.y.checked_add(self.height).is_some_and(|bottom| bottom <= height)
    }
}

impl Camera {
    /// A distortion-free camera from its horizontal field of view, square pixels, centred.
    pub fn from_fov(width: usize, height: usize, horizontal_fov_rad: f64) -> Self {
        let f = width as f64 / 2.0 / (horizontal_fov_rad / 2.0).tan();
        Camera {
            width,
            height,
            fx: f,
            fy: f,
            cx: width as f64 / 2.0,
            cy: height as f64 / 2.0,
            distortion: Distortion::None,
        }
    }

    /// The camera that would have taken the picture after it was cropped and scaled.
    ///
    /// Each axis has its own scale, so a picture of any shape fills the stored one.
    ///
    /// # Errors
    ///
    /// [`Error::Config`] if the crop does not lie inside the picture.
    pub fn cropped_and_scaled(&self, crop: Crop, width: usize, height: usize) -> Result<Camera> {
        if !crop.lies_inside(self.width, self.height) {
            return Err(Error::Config {
                key: "camera.crop".into(),
                what: format!(
                    "{} x {} at ({}, {}) does not lie inside the picture of {} x {}",
                    crop.width, crop.height, crop.x, crop.y, self.width, self.height
                ),
                hint: Some("give x, y, width and height in pixels of the recorded picture".into()),
            });
        }
        let (sx, sy) = (width as f64 / crop.width as f64, height as f64 / crop.height as f64);
        Ok(Camera {
            width,
            height,
            fx: self.fx * sx,
            fy: self.fy * sy,
            cx: (self.cx - crop.x as f64) * sx,
            cy: (self.cy - crop.y as f64) * sy,
            distortion: self.distortion.clone(),
        })
    }

    /// Where a point of the optical frame falls on the picture: (u, v) in pixels, (0, 0) being
    /// the outer corner of the first pixel. `None` if it lies nearer than [`NEAR_M`], or off the
    /// picture.
    pub fn project(&self, [x, y, z]: [f64; 3]) -> Option<[f64; 2]> {
        if z.is_nan() || z <= NEAR_M {
            return None;
        }
        let [xd, yd] = self.distortion.distort(x / z, y / z)?;
        let (u, v) = (self.fx * xd + self.cx, self.fy * yd + self.cy);
        let inside = u >= 0.0 && v >= 0.0 && u < self.width as f64 && v < self.height as f64;
        inside.then_some([u, v])
    }

    /// The pixel that a point falls on: row x width + column.
    pub fn pixel(&self, point_m: [f64; 3]) -> Option<u32> {
        let [u, v] = self.project(point_m)?;
        Some((v as usize * self.width + u as usize) as u32)
    }
}

impl Distortion {
    /// Distorted normalised coordinates; `None` beyond the angle up to which the polynomial is
    /// one-to-one, where it would fold points from outside the view back onto the picture.
    fn distort(&self, x: f64, y: f64) -> Option<[f64; 2]> {
        let r2 = x * x + y * y;
        match self {
            Distortion::None => Some([x, y]),
            Distortion::PlumbBob([k1, k2, p1, p2, k3]) => {
                let radial = |r2: f64| 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
                let slope = 1.0 + r2 * (3.0 * k1 + r2 * (5.0 * k2 + r2 * 7.0 * k3));
                (slope > 0.0).then(|| brown(x, y, r2, radial(r2), *p1, *p2))
            }
            Distortion::RationalPolynomial([k1, k2, p1, p2, k3, k4, k5, k6]) => {
                let (num, den) =
                    (1.0 + r2 * (k1 + r2 * (k2 + r2 * k3)), 1.0 + r2 * (k4 + r2 * (k5 + r2 * k6)));
                let num_slope = k1 + r2 * (2.0 * k2 + 3.0 * r2 * k3);
                let den_slope = k4 + r2 * (2.0 * k5 + 3.0 * r2 * k6);
                let radial = num / den;
                // d(r * radial)/dr, with d/dr = 2 r d/d(r2).
                let slope = radial + 2.0 * r2 * (num_slope - radial * den_slope) / den;
                (den > 0.0 && slope > 0.0).then(|| brown(x, y, r2, radial, *p1, *p2))
            }
            Distortion::Equidistant([k1, k2, k3, k4]) => {
                let r = r2.sqrt();
                if r < 1e-9 {
                    return Some([x, y]);
                }
                let theta = r.atan();
                let t2 = theta * theta;
                let poly = 1.0 + t2 * (k1 + t2 * (k2 + t2 * (k3 + t2 * k4)));
                let slope =
                    1.0 + t2 * (3.0 * k1 + t2 * (5.0 * k2 + t2 * (7.0 * k3 + t2 * 9.0 * k4)));
                (slope > 0.0).then(|| [x * theta * poly / r, y * theta * poly / r])
            }
        }
    }
}

/// Radial and tangential parts together, as OpenCV's camera model writes them.
fn brown(x: f64, y: f64, r2: f64, radial: f64, p1: f64, p2: f64) -> [f64; 2] {
    [
        x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
        y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
    ]
}

/// The nearest return of each pixel: of a lidar's, a radar's, in a log or simulated.
pub struct Nearest<'c, T> {
    camera: &'c Camera,
    /// Pixel, then index of the return: a few thousand numbers, which are faster to sort than a
    /// table of all pixels is to clear.
    hits: Vec<u64>,
    /// Squared distance, and what the return says.
    returns: Vec<(f64, T)>,
}

impl<'c, T: Copy> Nearest<'c, T> {
    pub fn new(camera: &'c Camera) -> Self {
        Nearest { camera, hits: Vec::new(), returns: Vec::new() }
    }

    /// A return at a point of the optical frame; NaNs fall off the picture. Of two equally near
    /// returns the first stays.
    #[inline]
    pub fn add(&mut self, point_m: DVec3, says: T) {
        let Some(pixel) = self.camera.pixel(point_m.to_array()) else { return };
        self.hits.push(u64::from(pixel) << 32 | self.returns.len() as u64);
        self.returns.push((point_m.length_squared(), says));
    }

    /// Ascending by pixel.
    pub fn finish(mut self) -> impl Iterator<Item = (u32, T)> {
        self.hits.sort_unstable();
        let Nearest { hits, returns, .. } = self;
        let mut at = 0;
        std::iter::from_fn(move || {
            let pixel = hits.get(at)? >> 32;
            let mut nearest = &returns[*hits.get(at)? as u32 as usize];
            at += 1;
            while let Some(hit) = hits.get(at).filter(|hit| *hit >> 32 == pixel) {
                let other = &returns[*hit as u32 as usize];
                nearest = if other.0 < nearest.0 { other } else { nearest };
                at += 1;
            }
            Some((pixel as u32, nearest.1))
        })
    }
}
