//! What is made while a log is scanned: what would be made after it, whatever the guess was.
#![allow(clippy::unwrap_used)]

use std::{fs, path::Path, sync::Arc};

use pmp::{
    dataset::{ahead::Ahead, align::Tick, drive::Drive, senses::Signal, stock::Stock},
    log::{profile::Profile, reader::Place, recording::Recording, scan::Scanned},
};

use crate::fixtures::{DriveLog, Recorded, mcap_bytes, ns};

const RATE_HZ: f64 = 10.0;

fn profile() -> Profile {
    let mut profile = Profile::default();
    (profile.camera.width, profile.camera.height) = (30, 12);
    profile
}

/// Messages of each signal that ticks take, and how many of those were in stock.
#[derive(Debug, Default, PartialEq)]
struct Served {
    wanted: usize,
    in_stock: usize,
}

/// Make all frames of a log by two passes and by one with a stock, `at_once` messages at a time:
/// they have to be the same. Returns what the stock was good for, camera, lidar and radar.
fn served(log: &Path, at_once: usize) -> (Stock, [Served; 3]) {
    let profile = profile();
    let folder = tempfile::tempdir().unwrap();
    let plain = Recording::scan(log, &profile.clock).unwrap();
    let mut ahead = Ahead::new(&profile, RATE_HZ, folder.path(), at_once).unwrap();
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0, "the file has a name");
    let mut on_chunk = |scanned: &Scanned, chunk, data: &[u8]| ahead.chunk(scanned, chunk, data);
    let followed = Recording::scan_followed(log, &profile.clock, &|_| (), &mut on_chunk).unwrap();
    let stock = Arc::new(ahead.finish().unwrap());
    let mut served: [Served; 3] = Default::default();
    assert_eq!(plain.len(), followed.len());
    for (plain, followed) in plain.into_iter().zip(followed) {
        let plain = Drive::new(plain, &profile, RATE_HZ).unwrap();
        let mut drive = Drive::new(followed, &profile, RATE_HZ).unwrap();
        for tick in &drive.grid.ticks {
            for (signal, served) in Signal::ALL.into_iter().zip(&mut served) {
                let Some((place, stamp_ns)) = taken(tick, signal) else { continue };
                let pose = drive.senses.pose(&drive.recording, signal, stamp_ns);
                let found = stock.get(&place, signal, &drive.senses, &pose).unwrap();
                served.wanted += 1;
                served.in_stock += usize::from(found.is_some());
            }
        }
        drive.stock = stock.clone();
        assert_eq!(plain.grid, drive.grid);
        let made = |drive: &Drive| {
            let made = drive.frames(&drive.grid.ticks).unwrap();
            made.into_iter().map(|made| (made.frame, made.damaged)).collect::<Vec<_>>()
        };
        assert!(made(&plain) == made(&drive));
    }
    (Arc::try_unwrap(stock).unwrap(), served)
}

fn taken(tick: &Tick, signal: Signal) -> Option<(Place, i64)> {
    let sample = match signal {
        Signal::Camera => Some(&tick.image),
        Signal::Lidar => tick.lidar.as_ref(),
        Signal::Radar => tick.radar.as_ref(),
    };
    sample.map(|sample| (sample.value, sample.stamp_ns))
}

fn write(folder: &Path, messages: &[Recorded]) -> std::path::PathBuf {
    let path = folder.join("log.mcap");
    fs::write(&path, mcap_bytes(messages, &DriveLog::default().layout)).unwrap();
    path
}

#[test]
fn frames_made_while_a_log_is_scanned_are_those_made_after_it() {
    let folder = tempfile::tempdir().unwrap();
    let drive = DriveLog { seconds: 6.0, bad_pictures: vec![20, 41], ..DriveLog::default() };
    let log = write(folder.path(), &drive.messages());
    for at_once in [1, 8] {
        let (stock, served) = served(&log, at_once);
        // What lies in the first chunk or two is read twice, and so is the last message.
        for (served, least) in served.iter().zip([50, 50, 50]) {
            assert!(served.wanted == 61 && served.in_stock >= least, "{served:?}");
        }
        // A damaged picture is not in stock: why it is, is said when it is asked for.
        assert_eq!(stock.len(), served.iter().map(|served| served.in_stock).sum::<usize>());
    }
}

#[test]
fn a_wrong_guess_costs_no_frame() {
    let folder = tempfile::tempdir().unwrap();
    let start_ns = DriveLog::default().start_ns;
    let plain = DriveLog { seconds: 6.0, ..DriveLog::default() }.messages();
    let half_ns = start_ns + ns(3.0);

    // The radar's place is told anew, half way.
    let mut moved = plain.clone();
    let mount = moved.iter().position(|message| message.topic == "/tf_static").unwrap();
    let mut later = moved[mount].clone();
    later.log_time_ns = half_ns;
    let place = later.data.windows(8).rposition(|bytes| bytes == 1.5_f64.to_le_bytes()).unwrap();
    later.data[place..place + 8].copy_from_slice(&1.25_f64.to_le_bytes());
    let at = moved.iter().position(|message| message.log_time_ns > half_ns).unwrap();
    moved.insert(at, later);
    served(&write(folder.path(), &moved), 1);

    // Without calibration nothing is projected, and pictures are not those of the calibrated camera:
    // what was made until it came is in stock in vain.
    let mut late = plain.clone();
    late.retain(|m| m.topic != "/camera/front/camera_info" || m.log_time_ns > half_ns);
    let (stock, [camera, lidar, radar]) = served(&write(folder.path(), &late), 1);
    let of_use = camera.in_stock + lidar.in_stock + radar.in_stock;
    assert!(stock.len() > of_use && lidar.in_stock < 40, "{} {camera:?} {lidar:?}", stock.len());

    // The grid begins later than it seems, in between what it seemed to need.
    let mut late = plain.clone();
    late.retain(|m| m.topic != "/control" || m.log_time_ns > half_ns + ns(0.04));
    served(&write(folder.path(), &late), 4);

    // The log is played twice; what comes second has the stamps of what came first.
    let mut twice = plain.clone();
    twice.extend(plain.iter().cloned().map(|mut message| {
        message.log_time_ns += ns(10.0);
        message
    }));
    served(&write(folder.path(), &twice), 1);

    for drive in [
        DriveLog { is_out_of_order: true, ..DriveLog::default() },
        DriveLog { has_header_stamps: false, ..DriveLog::default() },
        DriveLog {
            camera_gap_s: Some((1.0, 2.0)),
            ego_gap_s: Some((3.0, 3.5)),
            ..DriveLog::default()
        },
    ] {
        served(&write(folder.path(), &drive.messages()), 1);
    }
}
