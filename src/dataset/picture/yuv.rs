//! Luma and colour differences to red, green, blue.

/// Which colours luma and colour differences stand for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Colour {
    pub matrix: Matrix,
    /// 0 ... 255; otherwise luma has 16 ... 235 and colour differences 16 ... 240.
    pub is_full_range: bool,
}

/// Weights of red and blue in luma.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Matrix {
    /// ITU-R BT.601-7 section 2.5.1: 0.299 and 0.114.
    Bt601,
    /// ITU-R BT.709-6 section 3.2: 0.2126 and 0.0722.
    Bt709,
    /// ITU-R BT.2020-2 table 4, non-constant luminance: 0.2627 and 0.0593.
    Bt2020,
}

impl Colour {
    /// What cameras mean that do not say: BT.601 in 16 ... 235, as cv_bridge and OpenCV read it.
    pub const UNSAID: Colour = Colour { matrix: Matrix::Bt601, is_full_range: false };
}

/// A conversion made ready, in 1 / 2^14.
#[derive(Clone, Copy, Debug)]
pub struct ToRgb {
    luma_offset: i32,
    luma: i32,
    red_from_cr: i32,
    green_from_cb: i32,
    green_from_cr: i32,
    blue_from_cb: i32,
}

const FRACTION_BITS: u32 = 14;

impl ToRgb {
    pub fn new(colour: Colour) -> ToRgb {
        let (red, blue) = match colour.matrix {
            Matrix::Bt601 => (0.299, 0.114),
            Matrix::Bt709 => (0.2126, 0.0722),
            Matrix::Bt2020 => (0.2627, 0.0593),
        };
        let green: f64 = 1.0 - red - blue;
        let (luma, chroma) =
            if colour.is_full_range { (1.0, 1.0) } else { (255.0 / 219.0, 255.0 / 224.0) };
        let fixed = |factor: f64| (factor * f64::from(1 << FRACTION_BITS)).round() as i32;
        ToRgb {
            luma_offset: if colour.is_full_range { 0 } else { 16 },
            luma: fixed(luma),
            red_from_cr: fixed(chroma * 2.0 * (1.0 - red)),
            green_from_cb: fixed(-chroma * 2.0 * (1.0 - blue) * blue / green),
            green_from_cr: fixed(-chroma * 2.0 * (1.0 - red) * red / green),
            blue_from_cb: fixed(chroma * 2.0 * (1.0 - blue)),
        }
    }

    /// One pixel, rounded to the nearest.
    pub fn pixel(&self, luma: u8, cb: u8, cr: u8) -> [u8; 3] {
        let y = (i32::from(luma) - self.luma_offset) * self.luma + (1 << (FRACTION_BITS - 1));
        let (cb, cr) = (i32::from(cb) - 128, i32::from(cr) - 128);
        let byte = |sum: i32| (sum >> FRACTION_BITS).clamp(0, 255) as u8;
        [
            byte(y + self.red_from_cr * cr),
            byte(y + self.green_from_cb * cb + self.green_from_cr * cr),
            byte(y + self.blue_from_cb * cb),
        ]
    }
}
