//! Compressed video: every picture is the one of its stamp, and none is shown that cannot be whole.
#![allow(clippy::unwrap_used)]

use std::{fs, path::Path};

use openh264::encoder::VuiConfig;
use pmp::{
    dataset::{
        drive::{Drive, Made},
        picture::{h264::Decoder, jpeg},
    },
    drops::Reason,
    log::{
        h264::{Access, Parser},
        profile::Profile,
        reader::Place,
        video::{Broken, Packet, Parameters, Video},
    },
};
use proptest::prelude::*;
use serde_json::json;

use crate::{
    fixtures::{Cdr, DriveLog, Recorded, mcap_bytes, ns},
    foxglove::told,
    foxglove_fixtures::{FORMS, Told, base64, time},
    video_fixtures::{VIDEO_HEIGHT, VIDEO_WIDTH, ffmpeg_packets, index_of, packets},
};

/// The fixture's drive with a video of 20 pictures a second instead of its pictures.
fn log_of(drive: &DriveLog, packets: &[(usize, Vec<u8>)], encoding: &str) -> Vec<u8> {
    let mut messages = drive.messages();
    messages.retain(|message| message.type_name != "sensor_msgs/CompressedImage");
    for (index, packet) in packets {
        let log_time_ns = drive.start_ns + ns(*index as f64 / 20.0);
        let mut cdr = Cdr::new(false);
        cdr.header(log_time_ns, "camera");
        cdr.i32(VIDEO_WIDTH as i32).i32(VIDEO_HEIGHT as i32).text(encoding);
        cdr.number((*index as u64).to_le_bytes()).u8(0).u8(0).bytes(packet);
        let type_name = "ffmpeg_image_transport_msgs/FFMPEGPacket";
        let data = cdr.finish();
        messages.push(Recorded { topic: "/camera/front/video", type_name, log_time_ns, data });
    }
    messages.sort_by_key(|message| message.log_time_ns);
    mcap_bytes(&messages, &drive.layout)
}

fn open(folder: &Path, log: &[u8]) -> pmp::error::Result<Drive> {
    let path = folder.join("video.mcap");
    fs::write(&path, log).unwrap();
    Drive::open(&path, &Profile::default(), 10.0)
}

/// Of every tick its index and the index burnt into its picture, or why there is none.
fn shown(made: Vec<Made>) -> Vec<Result<(usize, usize), (Reason, String)>> {
    let one = |made: Made| match made.frame {
        Ok(frame) => Ok((frame.index as usize, index_of(&jpeg::decode(&frame.image).unwrap()))),
        Err((reason, _, why)) => Err((reason, why)),
    };
    made.into_iter().map(one).collect()
}

fn numbered(packets: Vec<Vec<u8>>) -> Vec<(usize, Vec<u8>)> {
    packets.into_iter().enumerate().collect()
}

#[test]
fn every_frame_has_the_picture_of_its_time_whichever_block_it_is_made_in() {
    let folder = tempfile::tempdir().unwrap();
    let log = log_of(&DriveLog::default(), &numbered(packets(101, 15, None)), "libx264");
    let drive = open(folder.path(), &log).unwrap();
    let ticks = &drive.grid.ticks;
    assert_eq!(ticks.len(), 51);
    let whole = drive.frames(ticks).unwrap();
    let images = |made: &[Made]| -> Vec<Vec<u8>> {
        made.iter().map(|made| made.frame.as_ref().unwrap().image.clone()).collect()
    };
    let images_of_all = images(&whole);
    for block in [1, 7, 20] {
        let parts = ticks.chunks(block).flat_map(|ticks| images(&drive.frames(ticks).unwrap()));
        assert!(parts.collect::<Vec<_>>() == images_of_all, "blocks of {block}");
    }
    for (at, shown) in shown(whole).into_iter().enumerate() {
        assert_eq!(shown, Ok((at, 2 * at)));
    }
}

#[test]
fn foxgloves_video_is_read_in_every_form() {
    let folder = tempfile::tempdir().unwrap();
    let drive = DriveLog { has_control: false, seconds: 1.0, ..DriveLog::default() };
    for form in FORMS {
        let mut messages = told(&drive);
        messages.retain(|message| message.type_name != "CompressedImage");
        for (index, packet) in numbered(packets(21, 10, None)) {
            let log_time_ns = drive.start_ns + ns(index as f64 / 20.0);
            let values = json!({
                "timestamp": time(log_time_ns), "frame_id": "camera", "format": "h264",
                "data": base64(&packet),
            });
            let (topic, type_name) = ("/camera/front/video", "CompressedVideo");
            messages.push(Told { topic, type_name, log_time_ns, values });
        }
        messages.sort_by_key(|message| message.log_time_ns);
        let drive = open(folder.path(), &form.log(&messages)).unwrap();
        let shown = shown(drive.frames(&drive.grid.ticks).unwrap());
        let expected: Vec<_> = (0..11).map(|at| Ok((at, 2 * at))).collect();
        assert_eq!(shown, expected, "{form:?}");
    }
}

#[test]
fn what_cannot_be_decoded_is_left_out_up_to_the_next_key_frame() {
    let folder = tempfile::tempdir().unwrap();
    let all = numbered(packets(101, 15, None));
    let made = |packets: &[(usize, Vec<u8>)]| {
        let drive = open(folder.path(), &log_of(&DriveLog::default(), packets, "h264")).unwrap();
        shown(drive.frames(&drive.grid.ticks).unwrap())
    };
    type Shown = Result<(usize, usize), (Reason, String)>;
    // The last tick is that of picture 100, wherever the grid begins.
    let check = |name: &str, shown: &[Shown], reason: Reason, bad: std::ops::Range<usize>| {
        for (behind, shown) in shown.iter().rev().enumerate() {
            let expected = 100 - 2 * behind;
            match shown {
                Ok((_, index)) => {
                    assert_eq!(*index, expected, "{name}");
                    assert!(!bad.contains(index), "{name}: picture {index} is shown");
                }
                Err((said, why)) => {
                    assert!(bad.contains(&expected), "{name}: picture {expected}: {why}");
                    assert_eq!(*said, reason, "{name}: {why}");
                }
            }
        }
    };
    // The log begins within a group of pictures.
    let late = made(&all[6..]);
    check("late", &late, Reason::ImageBeforeKeyFrame, 0..15);
    assert_eq!(late.len(), 48, "the grid begins with the first packet");
    // A packet is lost.
    let mut lost = all.clone();
    lost.remove(47);
    let lost = made(&lost);
    check("lost", &lost, Reason::ImageDamaged, 47..60);
    // A packet is cut, and still begins as one.
    let mut cut = all.clone();
    let len = cut[66].1.len();
    cut[66].1.truncate(len / 2);
    let cut = made(&cut);
    check("cut", &cut, Reason::ImageDamaged, 66..75);
    // The key frame itself is lost.
    let mut keyless = all.clone();
    keyless.remove(45);
    let keyless = made(&keyless);
    check("keyless", &keyless, Reason::ImageDamaged, 45..60);
}

#[test]
fn a_codec_that_is_not_read_is_an_error_that_says_what_to_do() {
    let folder = tempfile::tempdir().unwrap();
    let log = log_of(&DriveLog::default(), &numbered(packets(41, 20, None)), "hevc_nvenc");
    let error = open(folder.path(), &log).unwrap_err();
    let text = error.to_string();
    assert!(text.contains("/camera/front/video"), "{text}");
    assert!(text.contains("its video is `hevc_nvenc`, and H.264 is the only codec"), "{text}");
    assert!(error.hint().unwrap().contains("-c:v libx264 -bf 0"));
}

/// Parse and decode packets as ingest does.
fn decoded(packets: &[Vec<u8>], mut on: impl FnMut(usize, Vec<u8>)) -> Vec<Access> {
    let mut parser = Parser::default();
    let mut decoder = None;
    let mut heads = Vec::new();
    for (at, packet) in packets.iter().enumerate() {
        let (access, sequence) = parser.read(packet).unwrap().unwrap();
        if let Some(sequence) = sequence {
            let units = parser.parameters();
            decoder = Some(Decoder::new(&Parameters { units, sequence }).unwrap());
        }
        let rgb = decoder.as_mut().unwrap().decode(packet, true).unwrap().unwrap();
        on(at, rgb.data);
        heads.push(access);
    }
    heads
}

#[test]
fn pictures_agree_with_ffmpegs_for_every_profile_without_b_frames() {
    let profiles: [&[&str]; 4] = [
        &["-profile:v", "baseline"],
        &["-profile:v", "main", "-bf", "0", "-x264-params", "slices=3"],
        &["-profile:v", "high", "-bf", "0", "-refs", "4"],
        &["-profile:v", "high", "-bf", "0", "-colorspace", "bt709", "-color_range", "pc"],
    ];
    for options in profiles {
        // 642 x 362 is no multiple of 16: the coded picture is larger and cropped.
        let Some((packets, expected)) = ffmpeg_packets(642, 362, 25, options) else { return };
        assert_eq!((packets.len(), expected.len()), (25, 25));
        let heads = decoded(&packets, |at, rgb| {
            let squares: f64 =
                rgb.iter().zip(&expected[at]).map(|(a, b)| f64::from(a.abs_diff(*b)).powi(2)).sum();
            let db = 10.0 * (255.0_f64.powi(2) * rgb.len() as f64 / squares.max(1e-9)).log10();
            assert!(db > 40.0, "{options:?}: picture {at}: {db} dB");
        });
        let keys: Vec<usize> = (0..25).filter(|at| heads[*at].is_key).collect();
        assert_eq!(keys, [0, 10, 20], "{options:?}");
        assert!(heads.iter().all(|head| !head.is_bidirectional));
    }
}

#[test]
fn b_frames_are_refused_in_words() {
    let Some((packets, _)) = ffmpeg_packets(128, 96, 41, &["-profile:v", "high", "-bf", "2"])
    else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let log = log_of(&DriveLog::default(), &numbered(packets), "libx264");
    let error = open(folder.path(), &log).unwrap_err();
    assert!(error.to_string().contains("its video has B-frames"), "{error}");
    assert!(error.hint().unwrap().contains("-bf 0"));
}

#[test]
fn colours_that_the_stream_names_are_used() {
    for (said, matrix, is_full_range) in [
        (None, None, false),
        (Some(VuiConfig::bt709()), Some(1), false),
        (Some(VuiConfig::bt709_full()), Some(1), true),
    ] {
        let packets = packets(1, 10, said);
        let (_, sequence) = Parser::default().read(&packets[0]).unwrap().unwrap();
        let sequence = sequence.unwrap();
        assert_eq!((sequence.matrix, sequence.is_full_range), (matrix, is_full_range));
        assert_eq!((sequence.coded_width, sequence.coded_height), (VIDEO_WIDTH, VIDEO_HEIGHT));
        // Cb 110, Cr 150 and the white square's luma 235, by the formulas of the two standards.
        let kr = if matrix.is_some() { 0.2126 } else { 0.299 };
        let (luma, chroma) = match is_full_range {
            true => (235.0, 22.0),
            false => (255.0, 22.0 * 255.0 / 224.0),
        };
        let red: f64 = luma + 2.0 * (1.0 - kr) * chroma;
        decoded(&packets, |_, rgb| {
            // Top right corner: the moving slope, 40 + (127 % 150).
            let slope: f64 = match is_full_range {
                true => 167.0,
                false => (167.0 - 16.0) * 255.0 / 219.0,
            };
            let expected = (slope + red - luma).min(255.0);
            let red = f64::from(rgb[3 * (VIDEO_WIDTH - 1)]);
            assert!((red - expected).abs() < 6.0, "{said:?}: {red} for {expected}");
        });
    }
}

/// A picture that is no key frame, after so many reference pictures.
fn delta(index: usize, reference_count: u32) -> Packet {
    Packet {
        stamp_ns: index as i64 * 50_000_000,
        place: Place { segment: 0, start: index as u32, len: 1 },
        access: Access {
            is_key: reference_count == 0,
            is_reference: true,
            is_bidirectional: false,
            reference_count,
            count_period: 16,
        },
        parameters: None,
    }
}

#[test]
fn a_gap_after_which_the_count_has_gone_round_is_a_gap() {
    let mut video = Video::default();
    video.packets = (0..40).map(|at| delta(at, at as u32 % 16)).collect();
    // Keys stand where the count is 0; only the first shall be one.
    video.packets.iter_mut().skip(1).for_each(|packet| packet.access.is_key = false);
    assert!(video.chains().iter().enumerate().all(|(at, chain)| *chain == Ok(0..at + 1)));
    // Sixteen packets are missing and the count goes on as if nothing were.
    video.packets.drain(5..21);
    let chains = video.chains();
    assert_eq!(chains[4], Ok(0..5));
    assert!(chains[5..].iter().all(|chain| *chain == Err(Broken::Lost)));
}

proptest! {
    #[test]
    fn any_bytes_are_a_packet_or_an_error(
        bytes in prop::collection::vec(prop_oneof![Just(0u8), Just(1), Just(0x67), Just(0x68), Just(0x65), any::<u8>()], 0..200),
    ) {
        let mut parser = Parser::default();
        let _read = parser.read(&bytes);
        // Nor does what it learnt from them break a good stream.
        let good = packets(1, 10, None);
        prop_assert!(parser.read(&good[0]).unwrap().unwrap().0.is_key);
    }
}
