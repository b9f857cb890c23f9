//! Memory that a long log takes: that of a short one.
#![allow(clippy::unwrap_used, clippy::print_stdout)]

use std::{
    fs,
    path::Path,
    process::{Command, Stdio},
    thread,
    time::Duration,
};

use crate::fixtures::DriveLog;

/// The largest resident set of an ingest of a log, megabytes, with the rows that it wrote.
fn peak_megabytes(folder: &Path, seconds: f64) -> (f64, u64) {
    let log = DriveLog { seconds, picture_padding: 60_000, ..DriveLog::default() };
    let log = log.write(folder, &format!("{seconds}.mcap"));
    let profile = folder.join("small.toml");
    fs::write(&profile, "[camera]\nwidth = 64\nheight = 32\n").unwrap();
    let dataset = folder.join(format!("{seconds}"));
    let mut process = Command::new(env!("CARGO_BIN_EXE_pmp-ingest"))
        .args(["--jobs", "2", "--profile"])
        .args([&profile, Path::new("--out"), &dataset, &log])
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let status = format!("/proc/{}/status", process.id());
    let mut peak_kb = 0.0_f64;
    while process.try_wait().unwrap().is_none() {
        // Gone between the two lines is as good as gone before.
        let text = fs::read_to_string(&status).unwrap_or_default();
        let line = text.lines().find_map(|line| line.strip_prefix("VmHWM:"));
        let kb = line.and_then(|line| line.trim().trim_end_matches(" kB").parse().ok());
        peak_kb = peak_kb.max(kb.unwrap_or(0.0));
        thread::sleep(Duration::from_millis(5));
    }
    assert!(process.wait().unwrap().success());
    let manifest = pmp::dataset::manifest::Manifest::read(&dataset).unwrap();
    (peak_kb / 1e3, manifest.frames)
}

#[test]
fn ten_minutes_take_the_memory_of_one() {
    if !Path::new("/proc/self/status").exists() {
        println!("skipped: this system has no /proc to read the memory of a process from");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let (one, frames) = peak_megabytes(folder.path(), 60.0);
    assert_eq!(frames, 601);
    let (ten, frames) = peak_megabytes(folder.path(), 600.0);
    assert_eq!(frames, 6001);
    println!("largest resident set: {one:.0} MB for 1 minute, {ten:.0} MB for 10");
    // Nine minutes more are 320 MB of pictures, and 6 MB of poses, speeds and places.
    assert!(one > 10.0 && ten < one + 20.0, "{one} MB for 1 minute, {ten} MB for 10");
}
