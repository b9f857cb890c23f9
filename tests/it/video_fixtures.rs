//! Videos made for tests by OpenH264's encoder and, where it is, by FFmpeg.
#![allow(clippy::unwrap_used)]

use std::process::Command;

use openh264::{
    OpenH264API,
    encoder::{
        BitRate, Encoder, EncoderConfig, IntraFramePeriod, QpRange, RateControlMode, VuiConfig,
    },
    formats::YUVBuffer,
};
use pmp::dataset::picture::rgb::Rgb;

pub(crate) const VIDEO_WIDTH: usize = 128;
pub(crate) const VIDEO_HEIGHT: usize = 96;

/// Bits of the index that is burnt into a picture.
const INDEX_BITS: usize = 7;

/// I420 of the picture of some index: a slope that moves, and the index in squares of 16 pixels, black
/// or white, along the top.
fn picture(index: usize) -> Vec<u8> {
    let luma = (0..VIDEO_WIDTH * VIDEO_HEIGHT).map(|at| {
        let (x, y) = (at % VIDEO_WIDTH, at / VIDEO_WIDTH);
        match (y < 16, x / 16 < INDEX_BITS, index >> (x / 16) & 1) {
            (true, true, 0) => 16,
            (true, true, _) => 235,
            _ => 40 + ((x + 2 * y + 3 * index) % 150) as u8,
        }
    });
    let quarter = VIDEO_WIDTH * VIDEO_HEIGHT / 4;
    luma.chain(std::iter::repeat_n(110, quarter)).chain(std::iter::repeat_n(150, quarter)).collect()
}

/// One packet a picture, every `key_every`th a key frame.
pub(crate) fn packets(count: usize, key_every: u32, colour: Option<VuiConfig>) -> Vec<Vec<u8>> {
    let mut config = EncoderConfig::new()
        .skip_frames(false)
        .scene_change_detect(false)
        .rate_control_mode(RateControlMode::Off)
        .bitrate(BitRate::from_bps(4_000_000))
        .qp(QpRange::new(18, 26))
        .intra_frame_period(IntraFramePeriod::from_num_frames(key_every));
    if let Some(colour) = colour {
        config = config.vui(colour);
    }
    let mut encoder = Encoder::with_api_config(OpenH264API::from_source(), config).unwrap();
    let frame = |index| YUVBuffer::from_vec(picture(index), VIDEO_WIDTH, VIDEO_HEIGHT);
    (0..count).map(|index| encoder.encode(&frame(index)).unwrap().to_vec()).collect()
}

/// The index that is burnt into a picture, whatever it was scaled to.
pub(crate) fn index_of(rgb: &Rgb) -> usize {
    let is_white = |bit: usize| {
        let x = (16 * bit + 8) * rgb.width / VIDEO_WIDTH;
        let y = 8 * rgb.height / VIDEO_HEIGHT;
        rgb.data[3 * (y * rgb.width + x) + 1] > 128
    };
    (0..INDEX_BITS).filter(|bit| is_white(*bit)).map(|bit| 1 << bit).sum()
}

/// FFmpeg of the Python package `imageio-ffmpeg`; `None`, said in a line, where it is not.
fn ffmpeg() -> Option<String> {
    let program = "import imageio_ffmpeg; print(imageio_ffmpeg.get_ffmpeg_exe(), end='')";
    let output = Command::new("python3").args(["-c", program]).output();
    let found = output.ok().filter(|output| output.status.success());
    if found.is_none() {
        eprintln!("skipped: python3 has no package imageio-ffmpeg");
    }
    Some(String::from_utf8(found?.stdout).unwrap())
}

type Packets = Vec<Vec<u8>>;

/// RGB, one picture after the other.
type Pictures = Vec<Vec<u8>>;

/// Packets of a test picture that FFmpeg moves and encodes with x264, and the RGB that FFmpeg decodes
/// from them.
pub(crate) fn ffmpeg_packets(
    width: usize,
    height: usize,
    count: usize,
    options: &[&str],
) -> Option<(Packets, Pictures)> {
    let ffmpeg = ffmpeg()?;
    let folder = tempfile::tempdir().unwrap();
    let run = |arguments: &[&str]| {
        let status = Command::new(&ffmpeg)
            .args(["-v", "error"])
            .args(arguments)
            .current_dir(folder.path())
            .status();
        assert!(status.unwrap().success(), "{arguments:?}");
    };
    let source = format!("testsrc2=size={width}x{height}:rate=20");
    let count = count.to_string();
    let input = ["-f", "lavfi", "-i", &source, "-frames:v", &count];
    // A delimiter before every picture says where to cut.
    let coder = [
        "-c:v",
        "libx264",
        "-pix_fmt",
        "yuv420p",
        "-g",
        "10",
        "-bsf:v",
        "h264_metadata=aud=insert",
    ];
    run(&[&input[..], &coder, options, &["a.h264"]].concat());
    run(&[
        "-i",
        "a.h264",
        "-pix_fmt",
        "rgb24",
        "-f",
        "rawvideo",
        "-sws_flags",
        "neighbor",
        "a.rgb",
    ]);
    let stream = std::fs::read(folder.path().join("a.h264")).unwrap();
    let delimiter = [0, 0, 0, 1, 9];
    let starts: Vec<usize> =
        (0..stream.len()).filter(|at| stream[*at..].starts_with(&delimiter)).collect();
    let ends = starts.iter().skip(1).copied().chain([stream.len()]);
    let packets = starts.iter().zip(ends).map(|(start, end)| stream[*start..end].to_vec());
    let rgb = std::fs::read(folder.path().join("a.rgb")).unwrap();
    let pictures = rgb.chunks_exact(3 * width * height).map(<[u8]>::to_vec);
    Some((packets.collect(), pictures.collect()))
}
