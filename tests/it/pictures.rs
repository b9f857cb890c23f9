//! Pictures of every kind to RGB and to the stored JPEG: against known pixels, and against OpenCV and
//! Pillow where they are.
#![allow(clippy::unwrap_used)]

use std::{path::Path, process::Command};

use jpeg_encoder::{ColorType, Encoder, SamplingFactor};
use pmp::{
    dataset::picture::{
        self, Content, Decoded, jpeg, jpeg_write,
        planes::Stored,
        rgb::{MAX_PIXELS, Rgb},
        scale::{self, Area},
    },
    log::{
        image::{Encoding, Picture, Pixels},
        profile::CameraRule,
        value::Endian,
    },
    projection::Crop,
};
use proptest::prelude::*;
use serde_json::Value as Json;

/// Smooth shades with edges and fine structure in them, as photographs have.
pub(crate) fn scene(width: usize, height: usize) -> Rgb {
    let pixel = |at: usize| {
        let (x, y) = ((at % width) as f64, (at / width) as f64);
        let shade = 110.0 + 70.0 * (x / 97.0).sin() * (y / 61.0).cos();
        let edge = if (x - y * 0.7).rem_euclid(160.0) < 50.0 { 35.0 } else { 0.0 };
        let grain = 6.0 * (x * 0.9 + y * 0.4).sin() * (y * 0.7).cos();
        [shade + edge, shade + grain, 0.6 * shade - edge + grain + 40.0].map(|v| v as u8)
    };
    Rgb { width, height, data: (0..width * height).flat_map(pixel).collect() }
}

fn jpeg_of(rgb: &Rgb, sampling: SamplingFactor, is_progressive: bool) -> Vec<u8> {
    let mut data = Vec::new();
    let mut encoder = Encoder::new(&mut data, 92);
    encoder.set_sampling_factor(sampling);
    encoder.set_progressive(is_progressive);
    let (width, height) = (rgb.width as u16, rgb.height as u16);
    encoder.encode(&rgb.data, width, height, ColorType::Rgb).unwrap();
    data
}

fn png_of(rgb: &Rgb) -> Vec<u8> {
    let mut data = Vec::new();
    let mut encoder = png::Encoder::new(&mut data, rgb.width as u32, rgb.height as u32);
    encoder.set_color(png::ColorType::Rgb);
    encoder.write_header().unwrap().write_image_data(&rgb.data).unwrap();
    data
}

fn webp_of(rgb: &Rgb) -> Vec<u8> {
    let mut data = Vec::new();
    let (width, height) = (rgb.width as u32, rgb.height as u32);
    image_webp::WebPEncoder::new(&mut data)
        .encode(&rgb.data, width, height, image_webp::ColorType::Rgb8)
        .unwrap();
    data
}

/// 33 x 24 pixels in the lossy form, written by OpenCV at quality 40.
const LOSSY_WEBP: [&str; 5] = [
    "52494646ac0000005745425056503820a00000009005009d012a210018003ee160a74da8a623a235",
    "5bf801101c096a00ac32fb392fc8219540c1461ec32117fa2b8218c64945ed790000fef45140bab4",
    "1a4f6181923b89735ecbac99ef6d46cf9414c0ef07a3a11ca0d1e164a26cb659069930ccf819be29",
    "3b3977f2fd5a743ad313f150d0d9b17ea3b8c38fb297db22ac7faced01b5e80f5bce8b2731b58762",
    "8bed9ad4ffc115be2fe2fdffc115be2d36000000",
];

fn lossy_webp() -> Vec<u8> {
    let hex = LOSSY_WEBP.concat();
    (0..hex.len() / 2).map(|at| u8::from_str_radix(&hex[2 * at..2 * at + 2], 16).unwrap()).collect()
}

/// A rule that stores pictures as large as they are, so that nothing is shrunk while decoding.
fn unscaled() -> CameraRule {
    CameraRule { width: 8192, height: 8192, ..CameraRule::default() }
}

fn decode(data: &[u8]) -> Result<Rgb, String> {
    picture::decode(&Picture::Compressed { data }, &unscaled()).map(rgb_of)
}

fn rgb_of(decoded: Decoded) -> Rgb {
    match decoded.content {
        Content::Rgb(rgb) => rgb,
        other => panic!("not every pixel was decoded: {other:?}"),
    }
}

fn raw(width: usize, height: usize, encoding: &str, row_bytes: usize, data: &[u8]) -> Rgb {
    let encoding = Encoding::of(encoding).unwrap();
    let pixels = Pixels { width, height, encoding, row_bytes, endian: Endian::Little, data };
    rgb_of(picture::decode(&Picture::Raw(pixels), &unscaled()).unwrap())
}

fn psnr_db(a: &[u8], b: &[u8]) -> f64 {
    assert_eq!(a.len(), b.len());
    let squares: f64 = a.iter().zip(b).map(|(a, b)| f64::from(a.abs_diff(*b)).powi(2)).sum();
    10.0 * (255.0_f64.powi(2) * a.len() as f64 / squares.max(1e-9)).log10()
}

#[test]
fn a_picture_that_is_cut_off_is_an_error_or_whole_and_never_half() {
    let rgb = scene(49, 37);
    let grey: Vec<u8> = rgb.data.iter().step_by(3).copied().collect();
    let mut grey_jpeg = Vec::new();
    Encoder::new(&mut grey_jpeg, 92).encode(&grey, 49, 37, ColorType::Luma).unwrap();
    let files = [
        ("JPEG 4:2:0", jpeg_of(&rgb, SamplingFactor::F_2_2, false)),
        ("JPEG 4:4:4", jpeg_of(&rgb, SamplingFactor::F_1_1, false)),
        ("progressive JPEG", jpeg_of(&rgb, SamplingFactor::F_2_2, true)),
        ("grey JPEG", grey_jpeg),
        ("PNG", png_of(&rgb)),
        ("WebP", webp_of(&rgb)),
        ("lossy WebP", lossy_webp()),
    ];
    for (name, file) in &files {
        let whole = decode(file).unwrap();
        let size = if *name == "lossy WebP" { (33, 24) } else { (49, 37) };
        assert_eq!((whole.width, whole.height), size);
        let mut errors = 0;
        for len in (0..file.len()).rev() {
            match decode(&file[..len]) {
                Ok(cut) => assert!(cut == whole, "{name} cut to {len} of {} bytes", file.len()),
                Err(_) => errors += 1,
            }
        }
        assert!(errors + 20 > file.len(), "{name}: {errors} of {} lengths", file.len());
    }
}

#[test]
fn sizes_beyond_the_limits_are_refused_before_anything_is_allocated() {
    let mut jpeg = jpeg_of(&scene(16, 16), SamplingFactor::F_2_2, false);
    let frame = jpeg.windows(2).position(|two| two == [0xff, 0xc0]).unwrap();
    jpeg[frame + 5..frame + 9].copy_from_slice(&[0xff; 4]);
    let mut png = png_of(&scene(16, 16));
    png[16..24].copy_from_slice(&[0, 1, 0x86, 0xa0, 0, 1, 0x86, 0xa0]);
    let header = crc32fast::hash(&png[12..29]);
    png[29..33].copy_from_slice(&header.to_be_bytes());
    let mut webp = webp_of(&scene(16, 16));
    // 14 bits of width less 1, 14 of height less 1, behind the signature of the lossless form.
    let at = webp.windows(4).position(|four| four == b"VP8L").unwrap() + 9;
    let above = u32::from(webp[at + 3] >> 4) << 28;
    webp[at..at + 4].copy_from_slice(&(above | 16_382 << 14 | 16_382).to_le_bytes());
    for (file, side) in [(jpeg, "65535"), (png, "100000"), (webp, "16383")] {
        let why = decode(&file).unwrap_err();
        assert!(why.contains(&format!("{side} x {side} pixels")), "{side}: {why}");
        assert!(why.contains(&MAX_PIXELS.to_string()), "{why}");
    }
}

#[test]
fn png_of_every_colour_type_and_depth_is_read() {
    use png::{BitDepth, ColorType};
    // Two pixels, and what they are.
    let cases: [(ColorType, BitDepth, &[u8], [u8; 6]); 6] = [
        (ColorType::Grayscale, BitDepth::Eight, &[7, 250], [7, 7, 7, 250, 250, 250]),
        (ColorType::Grayscale, BitDepth::Sixteen, &[7, 200, 250, 1], [7, 7, 7, 250, 250, 250]),
        (ColorType::Grayscale, BitDepth::One, &[0x40], [0, 0, 0, 255, 255, 255]),
        (ColorType::GrayscaleAlpha, BitDepth::Eight, &[7, 0, 9, 255], [7, 7, 7, 9, 9, 9]),
        (ColorType::Rgba, BitDepth::Eight, &[1, 2, 3, 0, 4, 5, 6, 255], [1, 2, 3, 4, 5, 6]),
        (ColorType::Indexed, BitDepth::Eight, &[1, 0], [4, 5, 6, 1, 2, 3]),
    ];
    for (colour, depth, samples, expected) in cases {
        let mut file = Vec::new();
        let mut encoder = png::Encoder::new(&mut file, 2, 1);
        encoder.set_color(colour);
        encoder.set_depth(depth);
        encoder.set_palette(&[1, 2, 3, 4, 5, 6][..]);
        encoder.write_header().unwrap().write_image_data(samples).unwrap();
        assert_eq!(decode(&file).unwrap().data, expected, "{colour:?} {depth:?}");
    }
}

#[test]
fn webp_is_read_to_the_pixel_and_an_animation_is_refused() {
    let rgb = scene(33, 20);
    assert!(decode(&webp_of(&rgb)).unwrap() == rgb);
    let with_alpha: Vec<u8> =
        rgb.data.chunks_exact(3).flat_map(|p| [p[0], p[1], p[2], 128]).collect();
    let mut file = Vec::new();
    let encoder = image_webp::WebPEncoder::new(&mut file);
    encoder.encode(&with_alpha, 33, 20, image_webp::ColorType::Rgba8).unwrap();
    assert!(decode(&file).unwrap() == rgb);
    // VP8X with the bit that says animation, of 33 x 20, and an empty animation.
    let mut animation = b"RIFF\x24\0\0\0WEBPVP8X\x0a\0\0\0\x02\0\0\0\x20\0\0\x13\0\0".to_vec();
    animation.extend_from_slice(b"ANIM\x06\0\0\0\0\0\0\0\0\0");
    assert!(decode(&animation).is_err());
}

#[test]
fn samples_of_any_layout_become_red_green_blue() {
    let cases: [(&str, &[u8], [u8; 3]); 11] = [
        ("rgb8", &[1, 2, 3], [1, 2, 3]),
        ("bgr8", &[1, 2, 3], [3, 2, 1]),
        ("8UC3", &[1, 2, 3], [3, 2, 1]),
        ("rgba8", &[1, 2, 3, 4], [1, 2, 3]),
        ("bgra8", &[1, 2, 3, 4], [3, 2, 1]),
        ("mono8", &[9], [9, 9, 9]),
        ("8UC1", &[9], [9, 9, 9]),
        // 257 is 1 of 255; 128 more are nearer to 2.
        ("mono16", &[1, 1], [1, 1, 1]),
        ("16UC1", &[130, 1], [2, 2, 2]),
        ("rgb16", &[0, 0, 255, 255, 0, 128], [0, 255, 128]),
        ("bgra16", &[0, 0, 255, 255, 0, 128, 7, 7], [128, 255, 0]),
    ];
    for (name, pixel, expected) in cases {
        // Two rows of two pixels, with three bytes of padding between the rows.
        let row = [pixel, pixel, &[255; 3]].concat();
        let rgb = raw(2, 2, name, row.len(), &row.repeat(2));
        assert_eq!(rgb.data, expected.repeat(4), "{name}");
    }
    let encoding = Encoding::of("mono16").unwrap();
    let data = [255, 254, 0, 128];
    let pixels =
        Pixels { width: 2, height: 1, encoding, row_bytes: 4, endian: Endian::Big, data: &data };
    let rgb = rgb_of(picture::decode(&Picture::Raw(pixels), &unscaled()).unwrap());
    assert_eq!(rgb.data, [255, 255, 255, 0, 0, 0], "65278 and 128 of 65535");
}

/// Black, white and the primaries in BT.601 with luma 16 ... 235, as ITU-R BT.601 has them.
const SHADES: [([u8; 3], [u8; 3]); 5] = [
    ([16, 128, 128], [0, 0, 0]),
    ([235, 128, 128], [255, 255, 255]),
    ([81, 90, 240], [255, 0, 0]),
    ([145, 54, 34], [0, 255, 0]),
    ([41, 240, 110], [0, 0, 255]),
];

#[test]
fn luma_and_colour_differences_become_the_colours_they_stand_for() {
    for ([y, u, v], expected) in SHADES {
        let (uyvy, yuyv) = ([u, y, v, y], [y, u, y, v]);
        let twice = [y; 2];
        let planes = |chroma: &[u8]| [&[y; 12][..], chroma].concat();
        let pictures = [
            ("yuv422", 4, uyvy.repeat(6)),
            ("uyvy", 4, uyvy.repeat(6)),
            ("yuyv", 4, yuyv.repeat(6)),
            ("yuv422_yuy2", 4, yuyv.repeat(6)),
            ("nv12", 4, planes(&[u, v].repeat(4))),
            ("nv21", 4, planes(&[v, u].repeat(4))),
            ("i420", 4, planes(&[[u; 4], [v; 4]].concat())),
        ];
        assert_eq!(twice, [y, y]);
        for (name, width, data) in pictures {
            let row_bytes =
                data.len() / if name.starts_with('y') || name == "uyvy" { 3 } else { 1 };
            let row_bytes = if row_bytes == data.len() { width } else { row_bytes };
            let rgb = raw(width, 3, name, row_bytes, &data);
            for pixel in rgb.data.chunks_exact(3) {
                let off = pixel.iter().zip(&expected).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
                assert!(off <= 2, "{name}: {pixel:?} for {expected:?}");
            }
        }
    }
    // Each luma has its place, and each pair its own colour.
    let data = [50, 90, 60, 240, 70, 128, 80, 128];
    let grey = raw(4, 1, "yuyv", 8, &data);
    let luma: Vec<u8> = grey.data.chunks_exact(3).skip(2).map(|pixel| pixel[0]).collect();
    assert_eq!(luma, [63, 75], "(70 - 16) and (80 - 16) times 255 / 219");
    assert!(grey.data[0] > 200 && grey.data[3] > grey.data[0], "{:?}", grey.data);
}

/// What a camera with a Bayer mosaic would have recorded of a picture.
fn mosaic(rgb: &Rgb, name: &str) -> Vec<u8> {
    let colours: Vec<usize> =
        name.bytes().map(|letter| b"rgb".iter().position(|c| *c == letter).unwrap()).collect();
    let sample = |at: usize| {
        let (x, y) = (at % rgb.width, at / rgb.width);
        rgb.data[3 * at + colours[y % 2 * 2 + x % 2]]
    };
    (0..rgb.width * rgb.height).map(sample).collect()
}

#[test]
fn a_bayer_mosaic_gives_back_flat_colours_everywhere_and_ramps_inside() {
    let flat = Rgb { width: 7, height: 5, data: [200, 100, 30].repeat(35) };
    let ramp =
        |at: usize| [20 + 4 * (at % 9) + 8 * (at / 9), 200 - 6 * (at / 9), 10 + 8 * (at % 9)];
    let ramp: Vec<u8> = (0..63).flat_map(ramp).map(|sample| sample as u8).collect();
    let ramp = Rgb { width: 9, height: 7, data: ramp };
    for name in ["rggb", "bggr", "gbrg", "grbg"] {
        assert!(raw(7, 5, &format!("bayer_{name}8"), 7, &mosaic(&flat, name)) == flat, "{name}");
        let coloured = raw(9, 7, &format!("bayer_{name}8"), 9, &mosaic(&ramp, name));
        let wide: Vec<u8> = mosaic(&ramp, name).iter().flat_map(|s| [*s, *s]).collect();
        assert!(raw(9, 7, &format!("bayer_{name}16"), 18, &wide) == coloured, "{name}");
        for (x, y) in (1..6).flat_map(|y| (1..8).map(move |x| (x, y))) {
            let at = 3 * (y * 9 + x);
            assert_eq!(coloured.data[at..at + 3], ramp.data[at..at + 3], "{name} at {x}, {y}");
        }
    }
}

#[test]
fn a_jpeg_of_the_stored_size_and_kind_is_kept_as_it_is_and_no_other() {
    let rule = CameraRule { width: 96, height: 64, ..CameraRule::default() };
    let rgb = scene(96, 64);
    let kept = |data: &[u8], rule: &CameraRule| {
        let decoded = picture::decode(&Picture::Compressed { data }, rule).unwrap();
        let stored = decoded.stored(rule).unwrap();
        let back = decode(&stored).unwrap();
        assert_eq!((back.width, back.height), (rule.width, rule.height));
        stored == data
    };
    let jpeg = jpeg_of(&rgb, SamplingFactor::F_2_2, false);
    assert!(kept(&jpeg, &rule));
    let whole = Some(Crop { x: 0, y: 0, width: 96, height: 64 });
    assert!(kept(&jpeg, &CameraRule { crop: whole, ..rule.clone() }));
    let part = Some(Crop { x: 0, y: 0, width: 96, height: 63 });
    assert!(!kept(&jpeg, &CameraRule { crop: part, ..rule.clone() }));
    assert!(!kept(&jpeg, &CameraRule { width: 95, ..rule.clone() }));
    assert!(!kept(&jpeg_of(&rgb, SamplingFactor::F_1_1, false), &rule), "4:4:4");
    assert!(!kept(&jpeg_of(&rgb, SamplingFactor::F_2_2, true), &rule), "progressive");
    let mut grey = Vec::new();
    Encoder::new(&mut grey, 92).encode(&rgb.data[..6144], 96, 64, ColorType::Luma).unwrap();
    assert!(!kept(&grey, &rule), "grey");
    assert!(!kept(&png_of(&rgb), &rule), "PNG");

    let beside = CameraRule { crop: Some(Crop { x: 1, y: 0, width: 96, height: 64 }), ..rule };
    let decoded = picture::decode(&Picture::Compressed { data: &jpeg }, &beside).unwrap();
    let why = decoded.stored(&beside).unwrap_err();
    assert_eq!(why, "the crop does not lie inside the 96 x 64 pixels");
}

proptest! {
    #[test]
    fn what_covers_a_stored_pixel_is_averaged_wherever_the_crop_lies(
        x in 0usize..20, y in 0usize..20, width in 60usize..120, height in 40usize..100,
    ) {
        // On a ramp, the mean of an area is the value at its centre: intrinsics stay exact if the
        // centre of stored pixel u is at crop.x + (u + 0.5) * crop.width / stored width.
        let (all_width, all_height) = (x + width + 7, y + height + 3);
        let ramp = |at: usize| [(at % all_width) as u8, (at / all_width) as u8, 0];
        let data = (0..all_width * all_height).flat_map(ramp).collect();
        let picture = Rgb { width: all_width, height: all_height, data };
        let area =
            Area { x: x as f64, y: y as f64, width: width as f64, height: height as f64 };
        let scaled = scale::resize(&picture, area, 30, 20).unwrap();
        for (at, pixel) in scaled.data.chunks_exact(3).enumerate() {
            let (u, v) = (at % 30, at / 30);
            let expected_x = x as f64 + (u as f64 + 0.5) * width as f64 / 30.0 - 0.5;
            let expected_y = y as f64 + (v as f64 + 0.5) * height as f64 / 20.0 - 0.5;
            prop_assert!((f64::from(pixel[0]) - expected_x).abs() <= 1.01, "{u}: {pixel:?}");
            prop_assert!((f64::from(pixel[1]) - expected_y).abs() <= 1.01, "{v}: {pixel:?}");
        }
    }

    #[test]
    fn any_bytes_are_a_picture_or_an_error(
        kind in 0usize..3, at in 0usize..4000, byte: u8, len in 0usize..4000,
    ) {
        let rgb = scene(40, 30);
        let files = [jpeg_of(&rgb, SamplingFactor::F_2_2, false), png_of(&rgb), webp_of(&rgb)];
        let mut file = files[kind].clone();
        file.truncate(len.max(12));
        let at = at % file.len();
        file[at] = byte;
        if let Ok(rgb) = decode(&file) {
            prop_assert_eq!(rgb.data.len(), 3 * rgb.width * rgb.height);
        }
    }
}

#[test]
fn a_shrunk_decode_is_close_to_the_full_one_and_in_its_place() {
    // Odd sizes: the last column and row of the shrunk picture stand for less than the others.
    let rgb = scene(1281, 723);
    let grey: Vec<u8> = rgb.data.iter().step_by(3).copied().collect();
    let mut grey_jpeg = Vec::new();
    Encoder::new(&mut grey_jpeg, 92).encode(&grey, 1281, 723, ColorType::Luma).unwrap();
    let mut in_runs = Vec::new();
    let mut encoder = Encoder::new(&mut in_runs, 92);
    encoder.set_restart_interval(7);
    encoder.encode(&rgb.data, 1281, 723, ColorType::Rgb).unwrap();
    let files = [
        ("4:2:0", jpeg_of(&rgb, SamplingFactor::F_2_2, false)),
        ("4:2:2", jpeg_of(&rgb, SamplingFactor::F_2_1, false)),
        ("4:4:0", jpeg_of(&rgb, SamplingFactor::F_1_2, false)),
        ("4:4:4", jpeg_of(&rgb, SamplingFactor::F_1_1, false)),
        ("grey", grey_jpeg),
        ("with restarts", in_runs),
        ("progressive", jpeg_of(&rgb, SamplingFactor::F_2_2, true)),
    ];
    let cropped = |x, y, width, height| CameraRule {
        crop: Some(Crop { x, y, width, height }),
        ..CameraRule::default()
    };
    for (rule, reduction) in [
        (CameraRule::default(), 2),
        (CameraRule { width: 320, height: 180, ..CameraRule::default() }, 4),
        (CameraRule { width: 160, height: 90, ..CameraRule::default() }, 8),
        (cropped(101, 33, 1001, 555), 1),
        (cropped(3, 1, 1277, 719), 2),
        (CameraRule { width: 601, height: 251, ..CameraRule::default() }, 1),
    ] {
        for (name, file) in &files {
            let full = jpeg::decode(file).unwrap();
            let decoded = picture::decode(&Picture::Compressed { data: file }, &rule).unwrap();
            match &decoded.content {
                Content::Planes(planes) => assert_eq!(planes.luma.pixels, [reduction; 2], "{name}"),
                _ => assert!(reduction == 1 || *name == "progressive", "{name}"),
            }
            assert_eq!((decoded.width, decoded.height), (1281, 723));
            let stored = decode(&decoded.stored(&rule).unwrap()).unwrap();
            let crop = rule.crop.unwrap_or(Crop { x: 0, y: 0, width: 1281, height: 723 });
            let area = Area {
                x: crop.x as f64,
                y: crop.y as f64,
                width: crop.width as f64,
                height: crop.height as f64,
            };
            let expected = scale::resize(&full, area, rule.width, rule.height).unwrap();
            let close_db = psnr_db(&stored.data, &expected.data);
            // One sample a stored pixel: colours at half of that have little to be averaged from.
            let least_db = if reduction == 8 { 33.0 } else { 35.0 };
            assert!(close_db > least_db, "{name} at 1/{reduction}: {close_db} dB");
        }
    }
}

/// Luma and colour differences of a picture (JFIF), colours of 2 x 2 pixels shared.
fn stored_of(rgb: &Rgb) -> Stored {
    let Rgb { width, height, .. } = *rgb;
    let weighted = |x: usize, y: usize, weights: [f64; 3]| -> f64 {
        let pixel = &rgb.data[3 * (y * width + x)..][..3];
        pixel.iter().zip(weights).map(|(channel, weight)| f64::from(*channel) * weight).sum()
    };
    let mut data = Vec::new();
    for at in 0..width * height {
        data.push(weighted(at % width, at / width, [0.299, 0.587, 0.114]).round() as u8);
    }
    for weights in [[-0.168736, -0.331264, 0.5], [0.5, -0.418688, -0.081312]] {
        for at in 0..width * height / 4 {
            let (x, y) = (at % (width / 2) * 2, at / (width / 2) * 2);
            let four = [(x, y), (x + 1, y), (x, y + 1), (x + 1, y + 1)];
            let mean = four.map(|(x, y)| weighted(x, y, weights)).iter().sum::<f64>() / 4.0;
            data.push((mean + 128.0).round() as u8);
        }
    }
    Stored { width, height, data }
}

#[test]
fn what_is_written_is_as_near_and_as_short_as_what_a_library_writes() {
    let mut state = 1_u32;
    let noise = [(); 3 * 48 * 32].map(|()| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        if state >> 31 == 0 { 0 } else { 255 }
    });
    let noise = Rgb { width: 48, height: 32, data: noise.to_vec() };
    // Units that are whole, cut in one way, and in both; and a picture within one block.
    for rgb in [scene(320, 240), scene(600, 250), scene(34, 16), scene(6, 2), noise] {
        for quality in [30, 75, 90, 100] {
            let (width, height) = (rgb.width as u16, rgb.height as u16);
            let mut expected = Vec::new();
            let mut encoder = Encoder::new(&mut expected, quality);
            encoder.set_sampling_factor(SamplingFactor::F_2_2);
            encoder.encode(&rgb.data, width, height, ColorType::Rgb).unwrap();
            let written = jpeg_write::write(&stored_of(&rgb), quality).unwrap();
            let db = |file: &[u8]| psnr_db(&decode(file).unwrap().data, &rgb.data);
            let (ours_db, theirs_db) = (db(&written), db(&expected));
            let name = format!("{width} x {height} at {quality}");
            // Three shared colours of a tiny picture are rounded by chance.
            let margin_db = if rgb.data.len() < 3 * 64 { 1.0 } else { 0.3 };
            let least_db = theirs_db - margin_db;
            assert!(ours_db > least_db, "{name}: {ours_db}, the library {theirs_db} dB");
            let most = expected.len() as f64 * 1.01 + 64.0;
            assert!((written.len() as f64) < most, "{name}: {} bytes", written.len());
        }
    }
    let wide = Stored { width: 65_536, height: 2, data: vec![0; 65_536 * 3] };
    assert!(jpeg_write::write(&wide, 90).is_err());
}

#[test]
fn a_jpeg_that_lacks_data_inside_is_damaged_although_it_ends_as_it_should() {
    let rgb = scene(320, 240);
    let mut in_runs = Vec::new();
    let mut encoder = Encoder::new(&mut in_runs, 92);
    encoder.set_restart_interval(5);
    encoder.encode(&rgb.data, 320, 240, ColorType::Rgb).unwrap();
    let kept = CameraRule { width: 320, height: 240, ..CameraRule::default() };
    let shrunk = CameraRule { width: 160, height: 120, ..CameraRule::default() };
    let restart = |two: &[u8]| matches!(two, [0xff, 0xd0..=0xd7]);
    let run = in_runs.windows(2).position(restart).unwrap();
    let next = run + 2 + in_runs[run + 2..].windows(2).position(restart).unwrap();
    let without_run = [&in_runs[..run], &in_runs[next..]].concat();
    let mut files = vec![without_run];
    for file in [jpeg_of(&rgb, SamplingFactor::F_2_2, false), in_runs] {
        // A byte or two may be missed: codes find each other again.
        for (cut, at) in [(100, 0.3), (300, 0.9), (1000, 0.4), (3000, 0.7)] {
            let at = (at * file.len() as f64) as usize;
            files.push([&file[..at], &file[at + cut..]].concat());
        }
        assert!(decode(&file).unwrap().width == 320);
    }
    for (number, file) in files.iter().enumerate() {
        for rule in [&kept, &shrunk, &unscaled()] {
            let decoded = picture::decode(&Picture::Compressed { data: file }, rule);
            assert!(decoded.is_err(), "file {number}, stored as {} pixels", rule.width);
        }
    }
}

#[test]
fn pictures_of_opencv_and_pillow_decode_to_their_pixels() {
    let has_peer = Command::new("python3").args(["-c", "import cv2, numpy, PIL"]).output();
    if !has_peer.is_ok_and(|output| output.status.success()) {
        eprintln!("skipped: python3 has no packages opencv-python-headless, numpy and pillow");
        return;
    }
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/peers/pictures.py");
    let output = Command::new("python3").arg(script).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let lines = String::from_utf8(output.stdout).unwrap();
    for line in lines.lines() {
        let said: Json = serde_json::from_str(line).unwrap();
        let bytes = |key: &str| {
            let hex = said[key].as_str().unwrap();
            let byte = |at: usize| u8::from_str_radix(&hex[2 * at..2 * at + 2], 16).unwrap();
            (0..hex.len() / 2).map(byte).collect::<Vec<u8>>()
        };
        let number = |key: &str| said[key].as_u64().unwrap() as usize;
        let (data, expected) = (bytes("data"), bytes("rgb"));
        let (name, width, height) =
            (said["name"].as_str().unwrap(), number("width"), number("height"));
        let rgb = match said["encoding"].as_str() {
            Some(encoding) => raw(width, height, encoding, number("step"), &data),
            None => decode(&data).unwrap(),
        };
        assert_eq!((rgb.width, rgb.height), (width, height), "{name}");
        // Decoders round differently; `border` is where they may look beyond the picture differently.
        let border = number("border");
        let inside = |at: usize| {
            let (x, y) = (at % width, at / width);
            (border..width - border).contains(&x) && (border..height - border).contains(&y)
        };
        let off = (0..width * height).filter(|at| inside(*at)).flat_map(|at| 3 * at..3 * at + 3);
        let off = off.map(|at| rgb.data[at].abs_diff(expected[at])).max().unwrap();
        assert!(usize::from(off) <= number("most"), "{name}: off by {off}");
    }
    assert_eq!(lines.lines().count(), 17);
}
