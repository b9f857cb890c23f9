//! `pmp-stats check`: a clean dataset has no finding, every fault is found by its code and only by
//! that, and the command's outputs.
//!
//! The clean dataset is made by hand: six drives of 24 s over a winding road, by closed formulas.
#![allow(clippy::unwrap_used)]

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::{Path, PathBuf},
    process::{Command as Process, Output},
    sync::{Arc, OnceLock},
};

use arrow::{array::RecordBatch, datatypes::Schema};
use glam::DVec3;
use half::f16;
use parquet::arrow::{ArrowWriter, arrow_reader::ParquetRecordBatchReaderBuilder};
use pmp::{
    atomic,
    dataset::{
        columns,
        drive::Calibration,
        ego::{EgoState, wrap_angle},
        episodes::write_episodes,
        manifest::{EpisodeRecord, IngestConfig, LogRecord, Manifest},
        picture::{jpeg::encode, rgb::Rgb},
        route::Path as Way,
        shard::{ShardRecord, ShardWriter, properties},
        skew::Skews,
        split::Split,
    },
    drops::Drops,
    frame::{
        Command, Conditions, FUTURE_STEPS, Frame, Future, LidarPixels, RadarPixels, RecordedAction,
        Skew,
    },
    log::{mapping::Mapping, profile::Profile},
    projection::Camera,
    stats::check::{
        catalogue,
        finding::Level,
        glimpse::Sample,
        page,
        verdict::{self, Asked, Verdict},
    },
};
use serde_json::Value;

use crate::check_faults::{FAULTS, Plant};

/// Size of the pictures: small, since there are many.
pub(crate) const WIDTH: usize = 64;
pub(crate) const HEIGHT: usize = 32;

const TICK_S: f64 = 0.1;
const TICKS: usize = 240;
const DRIVES: usize = 6;

/// How a car is driven: acceleration and bend (left positive) at every tick.
#[derive(Clone, PartialEq)]
pub(crate) struct Course {
    pub(crate) start_mps: f64,
    pub(crate) acceleration_mps2: Vec<f64>,
    pub(crate) bend_1pm: Vec<f64>,
    /// What the driver does; with a jolt of the course it stays the same.
    steered_1pm: Vec<f64>,
    seed: f64,
}

impl Course {
    fn new(number: usize) -> Course {
        let mut course = Course {
            start_mps: 0.0,
            acceleration_mps2: Vec::new(),
            bend_1pm: Vec::new(),
            steered_1pm: Vec::new(),
            seed: number as f64,
        };
        course.go_on(TICKS);
        course
    }

    /// From rest, then faster and slower through one bend after the other.
    pub(crate) fn go_on(&mut self, ticks: usize) {
        for _ in 0..ticks {
            let t = self.bend_1pm.len() as f64 * TICK_S;
            let wave = |period_s: f64| (std::f64::consts::TAU * t / period_s + self.seed).sin();
            let acceleration = match t {
                t if t < 0.5 => 0.0,
                t if t < 4.5 => 2.0,
                _ => (std::f64::consts::TAU * (t - 4.5) / 6.0).sin() * -1.5,
            };
            self.acceleration_mps2.push(acceleration);
            self.bend_1pm.push(0.05 * wave(16.0 + self.seed / 2.0) + 0.02 * wave(5.0));
        }
        self.steered_1pm = self.bend_1pm.clone();
    }

    /// Stand for some ticks first.
    pub(crate) fn stand(&mut self, ticks: usize) {
        self.acceleration_mps2.splice(0..0, vec![0.0; ticks]);
        self.bend_1pm.splice(0..0, vec![0.0; ticks]);
        self.steered_1pm = self.bend_1pm.clone();
    }

    fn poses(&self) -> Vec<Pose> {
        let mut pose = Pose {
            position_m: [3000.0 * self.seed, 0.0, 10.0],
            yaw_rad: 0.3,
            speed_mps: self.start_mps,
        };
        let mut poses = Vec::new();
        for (acceleration, bend) in self.acceleration_mps2.iter().zip(&self.bend_1pm) {
            poses.push(pose);
            let speed = (pose.speed_mps + acceleration * TICK_S).max(0.0);
            let way = (pose.speed_mps + speed) / 2.0 * TICK_S;
            let turn = bend * way;
            let (sin, cos) = (pose.yaw_rad + turn / 2.0).sin_cos();
            pose.position_m[0] += way * cos;
            pose.position_m[1] += way * sin;
            pose.yaw_rad = wrap_angle(pose.yaw_rad + turn);
            pose.speed_mps = speed;
        }
        poses
    }
}

/// Where a car is.
#[derive(Clone, Copy, PartialEq)]
pub(crate) struct Pose {
    pub(crate) position_m: [f64; 3],
    pub(crate) yaw_rad: f64,
    pub(crate) speed_mps: f64,
}

impl Pose {
    fn state(&self) -> EgoState {
        EgoState {
            position_m: DVec3::from(self.position_m),
            yaw_rad: self.yaw_rad,
            velocity_mps: [self.speed_mps, 0.0],
        }
    }
}

/// A log of a dataset.
#[derive(Clone, PartialEq)]
pub(crate) struct Drive {
    pub(crate) split: Split,
    pub(crate) frames: Vec<Frame>,
    /// Frames of a second episode of the log; usually none.
    pub(crate) second: Vec<Frame>,
}

/// A grey picture by its shades.
pub(crate) fn jpeg(width: usize, height: usize, shade: impl Fn(usize, usize) -> u8) -> Vec<u8> {
    let pixels = (0..width * height).map(|at| shade(at % width, at / width));
    let data = pixels.flat_map(|shade| [shade; 3]).collect();
    encode(&Rgb { width, height, data }, 90).unwrap()
}

/// A chequered pattern that moves.
fn pictures() -> &'static [Vec<u8>] {
    static PICTURES: OnceLock<Vec<Vec<u8>>> = OnceLock::new();
    PICTURES.get_or_init(|| {
        let of = |shift: usize| {
            let shade = move |x: usize, y: usize| {
                if ((x + shift) / 4 + y / 4).is_multiple_of(2) { 60 } else { 180 }
            };
            jpeg(WIDTH, HEIGHT, shade)
        };
        (0..8).map(of).collect()
    })
}

fn camera() -> Camera {
    Camera::from_fov(WIDTH, HEIGHT, 1.2)
}

/// Three returns, each in the middle of its pixel.
fn lidar(camera: &Camera) -> LidarPixels {
    let mut lidar = LidarPixels::default();
    for (column, row, depth_m) in [(10, 8, 20.0), (30, 16, 8.0), (50, 20, 5.0)] {
        lidar.pixel.push((row * WIDTH + column) as u32);
        let x = (column as f64 + 0.5 - camera.cx) / camera.fx * depth_m;
        let y = (row as f64 + 0.5 - camera.cy) / camera.fy * depth_m;
        lidar.x.push(f16::from_f64(x));
        lidar.y.push(f16::from_f64(y));
        lidar.z.push(f16::from_f64(depth_m));
    }
    lidar
}

/// The frames of a car that was where it was.
fn frames(number: usize, course: &Course, poses: &[Pose]) -> Vec<Frame> {
    let (camera, start_ns) =
        (camera(), 1_750_000_000_000_000_000 + number as i64 * 3_600_000_000_000);
    // The road goes on beyond the drive.
    let last = poses.last().unwrap();
    let (sin, cos) = last.yaw_rad.sin_cos();
    let beyond = (1..=60).map(|m| {
        DVec3::from(last.position_m) + DVec3::new(cos * f64::from(m), sin * f64::from(m), 0.0)
    });
    let road: Vec<DVec3> =
        poses.iter().map(|pose| DVec3::from(pose.position_m)).chain(beyond).collect();
    let road = Way::planned(&road);
    let word = |is: bool, one: &str, other: &str| Some(if is { one } else { other }.to_string());
    let frame = |(tick, pose): (usize, &Pose)| {
        let acceleration = course.acceleration_mps2[tick];
        let route = road.ahead_on_route(&pose.state()).unwrap();
        Frame {
            index: tick as u32,
            stamp_ns: start_ns + tick as i64 * 100_000_000,
            image: pictures()[tick % 8].clone(),
            lidar: Some(lidar(&camera)),
            radar: Some(RadarPixels {
                pixel: vec![500, 700, 900],
                speed_mps: Some(vec![f16::from_f64(-pose.speed_mps); 3]),
            }),
            velocity_mps: [pose.speed_mps as f32, 0.0],
            yaw_rad: wrap_angle(pose.yaw_rad),
            position_m: pose.position_m,
            action: RecordedAction {
                steer: Some((-4.0 * course.steered_1pm[tick]) as f32),
                throttle: Some(if acceleration < 0.0 {
                    0.0
                } else {
                    0.1 + 0.2 * acceleration as f32
                }),
                brake: Some((-0.2 * acceleration).max(0.0) as f32),
            },
            command: turn(&route.waypoints_m),
            route,
            future: future(poses, tick),
            skew: Skew {
                image_ns: 0,
                lidar_ns: Some(5_000_000),
                radar_ns: Some(-7_000_000),
                control_ns: Some(2_000_000),
            },
            conditions: Conditions {
                town: word(tick % 2 == 0, "Town01", "Town02"),
                weather: word(tick % 3 == 0, "rainy", "clear"),
                illumination: word(tick % 4 == 0, "night", "daytime"),
                traffic: word(tick % 5 == 0, "dense", "empty"),
            },
            in_junction: None,
            speed_limit_mps: None,
            perturbed: number == 1 && (100..103).contains(&tick),
        }
    };
    poses.iter().enumerate().map(frame).collect()
}

fn turn(waypoints_m: &[f32]) -> Command {
    let heading = |at: usize| {
        let (x, y) =
            (waypoints_m[at + 10] - waypoints_m[at], waypoints_m[at + 11] - waypoints_m[at + 1]);
        f64::from(y).atan2(f64::from(x))
    };
    match wrap_angle(heading(248) - heading(0)) {
        turn if turn > 0.7 => Command::Left,
        turn if turn < -0.7 => Command::Right,
        _ => Command::Follow,
    }
}

fn future(poses: &[Pose], tick: usize) -> Future {
    let mut future = Future::UNKNOWN;
    let now = poses[tick].state();
    for (step, then) in poses[tick + 1..].iter().take(FUTURE_STEPS).enumerate() {
        let [x, y] = now.ego_from_world(DVec3::from(then.position_m));
        future.speed_mps[step] = then.speed_mps as f32;
        future.yaw_rad[step] = wrap_angle(then.yaw_rad - now.yaw_rad) as f32;
        future.xy_m[2 * step..2 * step + 2].copy_from_slice(&[x as f32, y as f32]);
        future.len = step as u8 + 1;
    }
    future
}

/// The clean drives, with a fault of the early stages planted.
fn drives(plant: &Plant) -> Vec<Drive> {
    let mut courses: Vec<Course> = (0..DRIVES).map(Course::new).collect();
    if let Plant::Courses(change) = plant {
        change(&mut courses);
    }
    let mut cars: Vec<Vec<Pose>> = courses.iter().map(Course::poses).collect();
    if let Plant::Poses(change) = plant {
        change(&mut cars);
    }
    let drive = |(number, car): (usize, &Vec<Pose>)| Drive {
        split: if number == DRIVES - 1 { Split::Val } else { Split::Train },
        frames: frames(number, &courses[number], car),
        second: Vec::new(),
    };
    let mut drives: Vec<Drive> = cars.iter().enumerate().map(drive).collect();
    if let Plant::Drives(change) = plant {
        change(&mut drives);
    }
    drives
}

/// Write one episode's shard; a table's fault is planted in the first.
fn write_shard(root: &Path, split: Split, id: &str, frames: &[Frame]) -> ShardRecord {
    let path = format!("frames/split={}/{id}-00000.parquet", split.name());
    fs::create_dir_all(root.join(&path).parent().unwrap()).unwrap();
    let mut shard = ShardWriter::create(&root.join(&path)).unwrap();
    shard.write(id, frames).unwrap();
    shard.finish().unwrap();
    record(root, path, frames.len() as u64)
}

fn record(root: &Path, path: String, rows: u64) -> ShardRecord {
    let file = root.join(&path);
    let bytes = fs::metadata(&file).unwrap().len();
    ShardRecord { sha256: atomic::sha256_of_file(&file).unwrap(), path, rows, bytes, groups: None }
}

fn rewrite(path: &Path, change: fn(RecordBatch) -> RecordBatch) {
    let reader = ParquetRecordBatchReaderBuilder::try_new(fs::File::open(path).unwrap()).unwrap();
    let batches: Vec<RecordBatch> = reader.build().unwrap().map(|b| change(b.unwrap())).collect();
    let file = fs::File::create(path).unwrap();
    // Batches do not keep the version that is in the schema's metadata.
    let fields = batches[0].schema().fields().clone();
    let schema = Schema::new_with_metadata(fields, columns::schema().metadata().clone());
    let schema = Arc::new(schema);
    let mut writer = ArrowWriter::try_new(file, schema.clone(), Some(properties())).unwrap();
    for batch in batches {
        writer.write(&batch.with_schema(schema.clone()).unwrap()).unwrap();
    }
    writer.close().unwrap();
}

fn log_record(
    number: usize,
    split: Split,
    episodes: Vec<(String, u64)>,
    shards: Vec<ShardRecord>,
) -> LogRecord {
    let frames = episodes.iter().map(|(_, frames)| frames).sum();
    let episode = |(id, frames): (String, u64)| EpisodeRecord {
        id,
        frames,
        frames_with_full_future: 0,
        start_ns: 0,
        duration_s: 0.0,
        distance_m: 0.0,
        drops: Drops::default(),
        mapping: Mapping::default(),
        calibration: Calibration { camera: Some(camera()) },
        topics: Vec::new(),
        shards: 1,
    };
    LogRecord {
        episode: format!("ep-{number}"),
        split,
        source_log: format!("{number}.mcap"),
        source_bytes: 0,
        source_sha256: format!("{number:064}"),
        messages: 0,
        conditions: Conditions::default(),
        mapping: Mapping::default(),
        calibration: Calibration { camera: Some(camera()) },
        frames,
        frames_with_full_future: 0,
        start_ns: 0,
        duration_s: 0.0,
        distance_m: 0.0,
        drops: Drops::default(),
        damage: Vec::new(),
        undecodable: BTreeMap::new(),
        out_of_order: BTreeMap::new(),
        left_out: Vec::new(),
        notes: Vec::new(),
        shards,
        clock_jumps: BTreeMap::new(),
        topics: Vec::new(),
        skews: Skews::default(),
        episodes: episodes.into_iter().map(episode).collect(),
    }
}

/// The clean dataset, written once.
struct Clean {
    folder: tempfile::TempDir,
    drives: Vec<Drive>,
}

fn clean() -> &'static Clean {
    static CLEAN: OnceLock<Clean> = OnceLock::new();
    CLEAN.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        let drives = drives(&NOTHING);
        write(folder.path(), &drives, None, &NOTHING);
        Clean { folder, drives }
    })
}

/// No fault.
const NOTHING: Plant = Plant::Files(|_| ());

/// Write a dataset; drives that are those of the clean one are taken from there.
fn write(root: &Path, drives: &[Drive], clean: Option<&Clean>, plant: &Plant) {
    let mut logs = Vec::new();
    for (number, drive) in drives.iter().enumerate() {
        let (mut episodes, mut shards) = (Vec::new(), Vec::new());
        let names = [format!("ep-{number}"), format!("ep-{number}-2")];
        for (id, frames) in names.into_iter().zip([&drive.frames, &drive.second]) {
            if frames.is_empty() {
                continue;
            }
            let same = clean.filter(|clean| clean.drives[number] == *drive);
            shards.push(match same {
                Some(clean) => {
                    let path = format!("frames/split={}/{id}-00000.parquet", drive.split.name());
                    fs::create_dir_all(root.join(&path).parent().unwrap()).unwrap();
                    fs::copy(clean.folder.path().join(&path), root.join(&path)).unwrap();
                    record(root, path, frames.len() as u64)
                }
                None => write_shard(root, drive.split, &id, frames),
            });
            episodes.push((id, frames.len() as u64));
        }
        if let (Plant::Shard(change), 0) = (plant, number) {
            let path = shards[0].path.clone();
            rewrite(&root.join(&path), *change);
            shards[0] = record(root, path, shards[0].rows);
        }
        logs.push(log_record(number, drive.split, episodes, shards));
    }
    if let Plant::Records(change) = plant {
        change(root, &mut logs);
    }
    write_episodes(&root.join("episodes.parquet"), &logs).unwrap();
    let mut profile = Profile::default();
    (profile.camera.width, profile.camera.height) = (WIDTH, HEIGHT);
    let config = IngestConfig::new(profile, 10.0).unwrap();
    let mut manifest = Manifest::new(config, logs, Vec::new());
    if let Plant::Manifest(change) = plant {
        change(&mut manifest);
    }
    fs::write(Manifest::path(root), serde_json::to_string(&manifest).unwrap()).unwrap();
    if let Plant::Files(change) = plant {
        change(root);
    }
}

/// A dataset with a fault.
fn faulty(plant: &Plant) -> tempfile::TempDir {
    let root = tempfile::tempdir().unwrap();
    write(root.path(), &drives(plant), Some(clean()), plant);
    root
}

/// Everything is looked at where a check needs it, some frames otherwise.
fn judge(root: &Path, code: &str) -> Verdict {
    let looks = code.starts_with(['I', 'P']);
    let sample = if looks { Sample::All } else { Sample::Spread(12) };
    let asked = Asked { ignored: Vec::new(), sample, checksums: code == "S08" };
    verdict::check(root, &asked).unwrap()
}

fn codes(verdict: &Verdict) -> BTreeSet<&'static str> {
    verdict.findings.iter().map(|finding| finding.check.code).collect()
}

#[test]
fn a_clean_dataset_has_no_finding() {
    let asked = Asked { ignored: Vec::new(), sample: Sample::All, checksums: true };
    let verdict = verdict::check(clean().folder.path(), &asked).unwrap();
    let said: Vec<String> = verdict
        .findings
        .iter()
        .map(|finding| format!("{} {}", finding.check.code, finding.sentence))
        .collect();
    assert!(said.is_empty(), "{said:#?}");
    assert_eq!((verdict.frames, verdict.looked_at), (1440, 1440));
    assert!(!verdict.has(Level::Note));
}

#[test]
fn every_fault_is_found_by_its_check_and_only_by_that() {
    let mut wrong = Vec::new();
    for fault in FAULTS {
        let root = faulty(&fault.plant);
        let verdict = judge(root.path(), fault.code);
        let also = fault.also.iter().map(|(code, _)| *code);
        let expected: BTreeSet<&str> = also.chain([fault.code]).collect();
        if codes(&verdict) != expected {
            let said = verdict.findings.iter().map(|f| format!("{} {}", f.check.code, f.sentence));
            wrong.push(format!("{} gives {:#?}", fault.code, said.collect::<Vec<_>>()));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn every_check_has_a_fault_that_was_planted() {
    let planted: BTreeSet<&str> = FAULTS.iter().map(|fault| fault.code).collect();
    let listed: Vec<&str> = catalogue::all().map(|check| check.code).collect();
    assert_eq!(planted.into_iter().collect::<BTreeSet<_>>(), listed.iter().copied().collect());
    assert!(listed.len() >= 40);
}

#[test]
fn codes_and_names_are_unique_and_texts_read_as_parts_of_sentences() {
    let (mut codes, mut names) = (BTreeSet::new(), BTreeSet::new());
    for check in catalogue::all() {
        assert!(codes.insert(check.code) && names.insert(check.name), "{} twice", check.code);
        let digits = &check.code[1..];
        assert!(digits.len() == 2 && digits.bytes().all(|b| b.is_ascii_digit()), "{}", check.code);
        let is_kebab = |c: char| c.is_ascii_lowercase() || c == '-';
        assert!(check.name.chars().all(is_kebab), "{}", check.name);
        for text in [check.what, check.why, check.remedy] {
            assert!(text.len() > 10 && !text.ends_with('.'), "{}: {text}", check.code);
        }
    }
    for family in &catalogue::FAMILIES {
        let codes: Vec<&str> = family.checks.iter().map(|check| check.code).collect();
        let first = &codes[0][..1];
        let expected: Vec<String> = (1..=codes.len()).map(|n| format!("{first}{n:02}")).collect();
        assert_eq!(codes, expected, "{}", family.title);
    }
}

#[test]
fn a_finding_says_where_and_how_much() {
    let plant = FAULTS.iter().find(|fault| fault.code == "T02").unwrap();
    let root = faulty(&plant.plant);
    let verdict = judge(root.path(), "T02");
    let finding = &verdict.findings[0];
    assert_eq!(finding.place.episode.as_deref(), Some("ep-0"));
    assert_eq!((finding.place.frame, finding.place.places), (Some(100), 1));
    assert_eq!(finding.value, Some(5.0));
    assert_eq!(finding.sentence, "1 frame is off the grid, by up to 5.0 ms");
}

#[test]
fn findings_are_limited_and_the_rest_is_counted() {
    let root = faulty(&Plant::Files(|root| {
        for number in 0..13 {
            fs::write(root.join(format!("frames/stray-{number}.parquet")), "").unwrap();
        }
    }));
    let verdict = judge(root.path(), "S12");
    assert_eq!((verdict.findings.len(), verdict.more["S12"]), (verdict::LISTED, 3));
    assert_eq!(verdict.counts.warning, 13);
    assert!(verdict.screen().to_string().contains("  ... and 3 more\n"));
    assert!(verdict.github().to_string().contains("(3 more like this)"));
}

#[test]
fn a_verdict_is_the_same_whatever_the_threads() {
    let root =
        faulty(&Plant::Drives(|drives| drives.iter_mut().for_each(|d| d.frames.truncate(45))));
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| judge(root.path(), "I01").json())
    };
    assert_eq!(with(1), with(4));
}

#[test]
fn the_page_of_the_documentation_is_the_catalogue() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/checks.md");
    let page = fs::read_to_string(path).unwrap_or_default();
    let hint = "write it anew: pmp-stats check --list --markdown > docs/checks.md";
    assert!(page == page::markdown(), "docs/checks.md is not the catalogue; {hint}");
}

fn pmp_stats(arguments: &[&str]) -> Output {
    Process::new(assert_cmd::cargo::cargo_bin!("pmp-stats")).args(arguments).output().unwrap()
}

fn text(bytes: &[u8]) -> &str {
    std::str::from_utf8(bytes).unwrap()
}

/// A dataset with an error, a warning and a note.
fn mixed() -> (tempfile::TempDir, PathBuf) {
    let root = faulty(&Plant::Drives(|drives| {
        drives[0].frames[100].stamp_ns += 5_000_000;
        for frame in drives.iter_mut().flat_map(|drive| &mut drive.frames) {
            frame.perturbed = false;
        }
        drives[0].frames.drain(150..161);
    }));
    let path = root.path().to_path_buf();
    (root, path)
}

#[test]
fn exit_codes_tell_whether_the_set_passes() {
    let (_root, path) = mixed();
    let path = path.to_str().unwrap();
    let clean = clean().folder.path().to_str().unwrap();
    let code = |arguments: &[&str]| {
        let output = pmp_stats(&[&["check", "--sample", "4"], arguments].concat());
        assert_eq!(text(&output.stderr), "");
        output.status.code().unwrap()
    };
    assert_eq!(code(&[clean, "--fail-on", "note"]), 0);
    assert_eq!(code(&[path]), 1);
    assert_eq!(code(&[path, "--ignore", "T02"]), 0);
    assert_eq!(code(&[path, "--ignore", "t02", "--fail-on", "warning"]), 1);
    assert_eq!(code(&[path, "--ignore", "off-grid", "--ignore", "T03", "--fail-on", "warning"]), 0);
    assert_eq!(code(&[path, "--ignore", "T02", "--ignore", "T03", "--fail-on", "note"]), 1);

    let gone = pmp_stats(&["check", "/no/such/dataset"]);
    assert_eq!((gone.status.code(), text(&gone.stdout)), (Some(1), ""));
    assert!(text(&gone.stderr).contains("hint: give the folder"), "{}", text(&gone.stderr));
}

#[test]
fn an_unknown_code_is_misuse_with_the_nearest_one() {
    for (wrong, nearest) in [("T022", "T02 (off-grid)"), ("position-jmp", "E05 (position-jump)")] {
        let output = pmp_stats(&["check", "data", "--ignore", wrong]);
        assert_eq!((output.status.code(), text(&output.stdout)), (Some(2), ""));
        let stderr = text(&output.stderr);
        assert!(stderr.contains(&format!("did you mean {nearest}?")), "{stderr}");
    }
    assert_eq!(pmp_stats(&["check"]).status.code(), Some(2));
    assert_eq!(pmp_stats(&["check", "data", "--json", "--github"]).status.code(), Some(2));
    assert_eq!(pmp_stats(&[]).status.code(), Some(2));
}

/// Paths of all fields; elements of a list share theirs, and keys that are data are a `*`.
fn fields(value: &Value, path: &str, found: &mut BTreeSet<String>) {
    match value {
        Value::Object(object) => {
            for (key, value) in object {
                let key = if path == "more" { "*" } else { key };
                let dot = if path.is_empty() { "" } else { "." };
                fields(value, &format!("{path}{dot}{key}"), found);
            }
        }
        Value::Array(list) if list.iter().any(Value::is_object) => {
            list.iter().for_each(|value| fields(value, &format!("{path}[]"), found));
        }
        Value::Array(_) => drop(found.insert(format!("{path}[]"))),
        _ => drop(found.insert(path.to_string())),
    }
}

#[test]
fn json_has_the_fields_of_the_schema() {
    let (root, path) = mixed();
    for number in 0..12 {
        fs::write(root.path().join(format!("frames/stray-{number}.parquet")), "").unwrap();
    }
    let path = path.to_str().unwrap();
    let output = pmp_stats(&["check", path, "--json", "--ignore", "S04", "--sample", "0"]);
    assert_eq!((output.status.code(), text(&output.stderr)), (Some(1), ""));
    let json: Value = serde_json::from_slice(&output.stdout).unwrap();
    let list: Value =
        serde_json::from_slice(&pmp_stats(&["check", "--list", "--json"]).stdout).unwrap();
    assert_eq!(json["counts"], serde_json::json!({"error": 1, "warning": 13, "note": 1}));
    assert_eq!(json["findings"][0]["code"], "T02");

    let schema = Path::new(env!("CARGO_MANIFEST_DIR")).join("schemas/check.v1.json");
    let schema: Value = serde_json::from_str(&fs::read_to_string(schema).unwrap()).unwrap();
    for (value, named) in [(json, "fields"), (list, "list")] {
        let mut found = BTreeSet::new();
        fields(&value, "", &mut found);
        let listed = schema[named].as_array().unwrap().iter().map(|field| {
            assert!(field["meaning"].is_string() && field["type"].is_string(), "{field}");
            field["path"].as_str().unwrap().to_string()
        });
        assert_eq!(found, listed.collect(), "{named}");
    }
}

#[test]
fn screen_and_annotations_name_the_place_and_the_remedy() {
    let (_root, path) = mixed();
    let path = path.to_str().unwrap();
    let screen = pmp_stats(&["check", path, "--sample", "0"]);
    let screen = text(&screen.stdout);
    assert!(screen.contains("\nerror T02 off-grid: "), "{screen}");
    assert!(screen.contains("\n  ep-0 frame 100: 1 frame is off the grid"), "{screen}");
    assert!(screen.contains("\n  -> resample to the grid"), "{screen}");
    assert!(screen.ends_with("\n1 error, 1 warning, 1 note\n"), "{screen}");
    let github = pmp_stats(&["check", path, "--sample", "0", "--github"]);
    let lines: Vec<&str> = text(&github.stdout).lines().collect();
    assert_eq!(lines.len(), 3);
    assert!(lines[0].starts_with("::error title=T02 off-grid::ep-0 frame 100: "), "{}", lines[0]);
    assert!(lines[1].starts_with("::warning title=T03 gap::ep-0 frame 149: "), "{}", lines[1]);
    assert!(lines[2].starts_with("::notice title=C09 no-recovery::no frame"), "{}", lines[2]);
}
