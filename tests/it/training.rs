//! The loop and the run directory: what is promised of a training that is stopped, resumed,
//! started twice, run on other threads or fed with garbage.

use std::{
    collections::BTreeMap,
    fs,
    path::Path,
    process::{Command, Stdio},
};

use candle_core::{Device::Cpu, Tensor};
use clap::ValueEnum as _;
use pmp::{
    dataset::batch::{Batch, Batches, Inputs, Targets},
    error::{Error, Result},
    model::{
        config::{Precision, TrainConfig},
        device::Place,
        learned::Learned,
        net_config::{Model, NetConfig, Part, PictureConfig, PmpConfig, Preset},
        run,
        train::{Data, Event, State, train, train_run},
    },
    policy::Policy,
};
use rand_chacha::{
    ChaCha8Rng,
    rand_core::{Rng as _, SeedableRng as _},
};

/// Batches from nowhere, in which action and motion follow from route and velocity.
#[derive(Clone)]
pub(crate) struct Synthetic {
    frames: usize,
    salt: u64,
    /// Height and width of the pictures.
    size: [usize; 2],
    /// The step at which the machine is switched off.
    dies_at: Option<u64>,
    /// The step whose labels are broken.
    nan_at: Option<u64>,
}

impl Synthetic {
    pub(crate) fn new(frames: usize) -> Self {
        Self { frames, salt: 0, size: [8, 16], dies_at: None, nan_at: None }
    }

    pub(crate) fn of_size(frames: usize, size: [usize; 2]) -> Self {
        Self { size, ..Self::new(frames) }
    }

    /// The same on a machine that is switched off at a step.
    pub(crate) fn dying(frames: usize, at: u64) -> Self {
        Self { dies_at: Some(at), ..Self::new(frames) }
    }

    pub(crate) fn batch_of(&self, step: u64) -> Batch {
        let mut rng = ChaCha8Rng::seed_from_u64(self.salt ^ step);
        let b = self.frames;
        let mut noise = |count: usize| -> Vec<f32> {
            (0..count).map(|_| rng.next_u32() as f32 / u32::MAX as f32).collect()
        };
        let tensor =
            |values: Vec<f32>, shape: &[usize]| Tensor::from_vec(values, shape, &Cpu).unwrap();
        let [h, w] = self.size;
        let camera = tensor(noise(b * 3 * h * w), &[b, h, w, 3]);
        let ralidar = tensor(noise(b * 4 * h * w), &[b, h, w, 4]);
        let (speed, bend) = (noise(b), noise(b));
        let (mut velocity, mut route, mut action, mut motion) = (vec![], vec![], vec![], vec![]);
        for (&speed, &bend) in speed.iter().zip(&bend) {
            let (speed, bend) = (12.0 * speed, (bend - 0.5) / 20.0); // m/s, 1/m
            velocity.extend([speed, 0.0]);
            route.extend((0..130).flat_map(|i| {
                let x = 0.4 * i as f32;
                [x, bend * x * x / 2.0]
            }));
            action.extend([(-30.0 * bend).tanh(), speed / 12.0, 1.0 - speed / 12.0]);
            motion.extend((1..=30).flat_map(|t| [speed, bend * speed * 0.1 * t as f32]));
        }
        let speeds = speed.iter().map(|s| 12.0 * s).collect();
        if self.nan_at == Some(step) {
            action[0] = f32::NAN;
        }
        Batch {
            inputs: Inputs {
                camera: Some(camera),
                ralidar: Some(ralidar),
                velocity: tensor(velocity, &[b, 2]),
                route: tensor(route, &[b, 260]),
                command: Tensor::zeros(b, candle_core::DType::U32, &Cpu).unwrap(),
                present: tensor(vec![1.0; 2 * b], &[b, 2]),
            },
            targets: Targets {
                action: tensor(action, &[b, 3]),
                action_known: tensor(vec![1.0; 3 * b], &[b, 3]),
                motion: tensor(motion, &[b, 30, 2]),
                motion_valid: tensor(vec![1.0; 30 * b], &[b, 30]),
                speed_mps: tensor(speeds, &[b]),
            },
            frames: (0..b).map(|i| format!("synthetic-{step}/{i}")).collect(),
        }
    }
}

impl Batches for Synthetic {
    fn batch(&mut self, step: u64) -> Result<Batch> {
        if self.dies_at == Some(step) {
            return Err(Error::Dataset { path: "/".into(), what: "dead".into(), hint: None });
        }
        Ok(self.batch_of(step))
    }
}

/// The PMP network, as small as it gets.
pub(crate) fn small_net() -> PmpConfig {
    let NetConfig::Pmp(tiny) = NetConfig::preset(Model::Pmp, Preset::Tiny) else { unreachable!() };
    PmpConfig {
        picture: PictureConfig { height: 8, width: 16, channels: vec![4, 8], ..tiny.picture },
        feature: 16,
        route_hidden: vec![16],
        velocity_hidden: vec![8],
        attention_hidden: vec![8],
        action_hidden: vec![16],
        motion_hidden: vec![16],
        ..tiny
    }
}

pub(crate) fn small() -> TrainConfig {
    TrainConfig {
        steps: 13,
        batch_size: 4,
        warmup: 3,
        log_every: 2,
        eval_every: 5,
        eval_batches: 2,
        save_every: 4,
        net: NetConfig::Pmp(small_net()),
        ..TrainConfig::default()
    }
}

pub(crate) fn data(train: Synthetic) -> Data {
    let validation = Synthetic { salt: 1 << 40, dies_at: None, nan_at: None, ..train.clone() };
    Data {
        train: Box::new(train),
        validation: Box::new(validation),
        validation_batches: 2,
        identity: "synthetic".into(),
    }
}

pub(crate) fn run_with(
    cfg: &TrainConfig,
    out: &Path,
    resume: bool,
    train: Synthetic,
) -> Result<Vec<Event>> {
    let mut events = vec![];
    train_run(cfg, out, resume, &mut data(train), &Cpu, &mut |event| {
        events.push(event.clone());
        Ok(())
    })?;
    Ok(events)
}

pub(crate) fn run(cfg: &TrainConfig, out: &Path, resume: bool) -> Result<Vec<Event>> {
    run_with(cfg, out, resume, Synthetic::new(4))
}

/// Every file of a directory, by path within it.
pub(crate) fn files(dir: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut out = BTreeMap::new();
    for entry in fs::read_dir(dir).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        if path.is_dir() {
            let inner = files(&path);
            out.extend(inner.into_iter().map(|(rest, bytes)| (format!("{name}/{rest}"), bytes)));
        } else {
            out.insert(name, fs::read(path).unwrap());
        }
    }
    out
}

pub(crate) fn assert_same_files(a: &Path, b: &Path) {
    let (a, b) = (files(a), files(b));
    assert_eq!(a.keys().collect::<Vec<_>>(), b.keys().collect::<Vec<_>>());
    for (name, bytes) in &a {
        assert!(bytes == &b[name], "{name} differs");
    }
}

#[test]
fn resumed_run_ends_bit_identical_to_one_never_stopped() {
    let dir = tempfile::tempdir().unwrap();
    let (whole, cut) = (dir.path().join("whole"), dir.path().join("cut"));
    let cfg = small();
    run(&cfg, &whole, false).unwrap();
    let names: Vec<_> = files(&whole).into_keys().collect();
    // The last validation was the best.
    let expected = [
        "checkpoints/step-00000013/optimizer.safetensors",
        "checkpoints/step-00000013/weights.safetensors",
        "config.json",
        "curves.svg",
        "events.out.tfevents.0.pmp",
        "metrics.jsonl",
        "run.json",
    ];
    assert_eq!(names, expected);

    // Before the first checkpoint, on one, and with lines of the curves beyond one.
    for dies_at in [1, 4, 7, 11] {
        let dying = Synthetic { dies_at: Some(dies_at), ..Synthetic::new(4) };
        run_with(&cfg, &cut, true, dying).unwrap_err();
        // The write it died in.
        let curves = fs::OpenOptions::new().append(true).open(cut.join("metrics.jsonl"));
        std::io::Write::write_all(&mut curves.unwrap(), b"{\"step\": 1").unwrap();
    }
    let events = run(&cfg, &cut, true).unwrap();
    // The validation at 10 was the best so far, so its weights were kept.
    assert!(matches!(events[0], Event::Started { step: 10, .. }), "{:?}", events[0]);
    assert_same_files(&whole, &cut);
}

#[test]
fn curves_have_a_line_per_logged_step_and_validation_and_no_clock() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("run");
    run(&small(), &out, false).unwrap();
    let text = fs::read_to_string(out.join("metrics.jsonl")).unwrap();
    let lines: Vec<serde_json::Value> =
        text.lines().map(|l| serde_json::from_str(l).unwrap()).collect();
    let at: Vec<_> =
        lines.iter().map(|l| (l["step"].as_u64().unwrap(), l["split"].as_str().unwrap())).collect();
    let (t, v) = ("train", "val");
    let expected =
        [(2, t), (4, t), (5, v), (6, t), (8, t), (10, t), (10, v), (12, t), (13, t), (13, v)];
    assert_eq!(at, expected);
    let keys: Vec<_> = lines[0].as_object().unwrap().keys().map(String::as_str).collect();
    let mut expected = [
        "step",
        "split",
        "total",
        "action",
        "steer",
        "throttle",
        "brake",
        "motion",
        "entropy",
        "speed",
        "lr",
        "grad_norm",
    ];
    expected.sort_unstable();
    let mut keys = keys;
    keys.sort_unstable();
    assert_eq!(keys, expected);
    let l = &lines[0];
    let n = |key: &str| l[key].as_f64().unwrap();
    assert!((n("total") - n("action") - 0.1 * n("motion")).abs() < 1e-12);
    assert!((n("action") - (n("steer") + n("throttle") + n("brake")) / 3.0).abs() < 1e-12);
}

#[test]
fn leftovers_of_a_torn_checkpoint_are_ignored_and_cleared() {
    let dir = tempfile::tempdir().unwrap();
    let (whole, torn) = (dir.path().join("whole"), dir.path().join("torn"));
    run(&small(), &whole, false).unwrap();
    let dying = Synthetic { dies_at: Some(9), ..Synthetic::new(4) };
    run_with(&small(), &torn, false, dying).unwrap_err();
    // Died while writing, and after the directory was named but before run.json was replaced.
    for leftover in ["step-00000012.unfinished", "step-00000012"] {
        let at = torn.join("checkpoints").join(leftover);
        fs::create_dir(&at).unwrap();
        fs::write(at.join("weights.safetensors"), b"half").unwrap();
    }
    fs::write(torn.join("run.json.unfinished"), b"{").unwrap();
    let events = run(&small(), &torn, true).unwrap();
    assert!(matches!(events[0], Event::Started { step: 8, .. }));
    assert_same_files(&whole, &torn);
}

#[test]
fn steps_may_be_raised_and_nothing_else_may_change() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("run");
    run(&small(), &out, false).unwrap();

    let error = |cfg: TrainConfig| run(&cfg, &out, true).unwrap_err().to_string();
    let net = NetConfig::Pmp(PmpConfig { motion_hidden: vec![17], ..small_net() });
    let other = TrainConfig { net, ..small() };
    assert_eq!(error(other), "net.motion_hidden: the run was started with [16], not [17]");
    assert_eq!(
        error(TrainConfig { lr: 2e-3, ..small() }),
        "lr: the run was started with 0.001, not 0.002"
    );
    assert_eq!(
        error(TrainConfig { steps: 12, ..small() }),
        "steps: the run was started with 13, not 12"
    );
    let before = files(&out);
    run(&small(), &out, true).unwrap();
    assert_eq!(before, files(&out), "a finished run is left alone");

    let more = TrainConfig { steps: 15, ..small() };
    let events = run(&more, &out, true).unwrap();
    assert!(matches!(events[0], Event::Started { step: 13, .. }));
    assert_eq!(run::manifest(&out).unwrap().unwrap().step, 15);
    assert_eq!(run::saved_config(&out).unwrap().unwrap(), more);
}

#[test]
fn run_may_be_continued_on_another_device_and_half_precision_is_not_for_the_cpu() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("run");
    run(&small(), &out, false).unwrap();
    let elsewhere = TrainConfig { device: Place::Cuda(1), steps: 14, ..small() };
    run(&elsewhere, &out, true).unwrap();
    let saved = run::saved_config(&out).unwrap().unwrap();
    assert_eq!(saved, elsewhere);

    let half = TrainConfig { precision: Precision::Bf16, ..small() };
    let other = dir.path().join("half");
    let error = run(&half, &other, false).unwrap_err();
    assert_eq!(error.to_string(), "precision: bf16 is for GPUs, and this is the CPU");
    assert!(!other.exists());
}

#[test]
fn runs_of_before_there_were_devices_can_be_continued() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("run");
    run(&small(), &out, false).unwrap();
    let file = out.join("config.json");
    let text = fs::read_to_string(&file).unwrap();
    let without = |line: &&str| !line.contains("\"device\"") && !line.contains("\"precision\"");
    let lines: Vec<&str> = text.lines().filter(without).collect();
    assert_eq!(lines.len(), text.lines().count() - 2);
    fs::write(&file, lines.join("\n")).unwrap();
    run(&TrainConfig { steps: 14, ..small() }, &out, true).unwrap();
}

#[test]
fn run_directory_is_never_overwritten_nor_continued_on_other_data() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("run");
    run(&small(), &out, false).unwrap();
    let error = run(&small(), &out, false).unwrap_err();
    assert!(error.to_string().starts_with("the run directory is not empty: "), "{error}");
    assert!(error.hint().unwrap().contains("--resume"));

    let mut data = data(Synthetic::new(4));
    data.identity = "another".into();
    let error = train_run(&small(), &out, true, &mut data, &Cpu, &mut |_| Ok(())).unwrap_err();
    let expected = "the run was trained on synthetic, not on another";
    assert!(error.to_string().starts_with(expected), "{error}");

    let foreign = dir.path().join("foreign");
    fs::create_dir(&foreign).unwrap();
    fs::write(foreign.join("thesis.tex"), "").unwrap();
    let error = run(&small(), &foreign, true).unwrap_err();
    assert!(error.to_string().starts_with("not a training run"), "{error}");
    assert_eq!(files(&foreign).len(), 1);
}

#[test]
fn damaged_weights_are_refused_by_their_checksum() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("run");
    run(&small(), &out, false).unwrap();
    let weights = out.join("checkpoints/step-00000013/weights.safetensors");
    let mut bytes = fs::read(&weights).unwrap();
    *bytes.last_mut().unwrap() ^= 1;
    fs::write(&weights, bytes).unwrap();
    let error = Learned::open(&out, &Cpu).unwrap_err();
    assert!(error.to_string().starts_with("damaged"), "{error}");

    let empty = Learned::open(dir.path(), &Cpu).unwrap_err();
    assert!(empty.to_string().starts_with("no trained run"), "{empty}");
}

#[test]
fn loss_that_is_not_finite_stops_with_step_and_term_and_keeps_the_last_checkpoint() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("run");
    let broken = Synthetic { nan_at: Some(6), ..Synthetic::new(4) };
    let error = run_with(&small(), &out, false, broken).unwrap_err();
    assert_eq!(
        error.to_string(),
        "training diverged at step 7: action loss is not finite; \
         frames synthetic-6/0, synthetic-6/1, synthetic-6/2, synthetic-6/3"
    );
    // That of step 4, and that of the validation at step 5, the best so far.
    assert_eq!(run::manifest(&out).unwrap().unwrap().step, 5);
}

/// Always the same batch.
struct One(Batch);

impl Batches for One {
    fn batch(&mut self, _step: u64) -> Result<Batch> {
        Ok(self.0.clone())
    }
}

#[test]
fn one_batch_is_learned_by_heart() {
    let cfg = TrainConfig { steps: 500, lr: 3e-3, warmup: 10, ..small() };
    let mut state = State::new(&cfg, &Cpu).unwrap();
    let one = Synthetic::new(4).batch_of(0);
    let mut data = data(Synthetic::new(4));
    data.train = Box::new(One(one));
    let mut terms = vec![];
    train(&cfg, &mut state, &mut data, &mut |_, event| {
        if let Event::Trained { line, .. } = event {
            terms.push(line.terms);
        }
        Ok(())
    })
    .unwrap();
    let (first, last) = (terms[0], terms[499]);
    let (action, motion) = (last.action.unwrap(), last.motion.unwrap());
    assert!(action < 0.1 * first.action.unwrap(), "{first:?} {last:?}");
    assert!(motion < -1.0 && first.motion.unwrap() > 0.5, "{first:?} {last:?}");
}

#[test]
fn loss_falls_on_frames_never_trained_on() {
    let disable = vec![Part::Camera, Part::Ralidar];
    let net = NetConfig::Pmp(PmpConfig { disable, ..small_net() });
    let cfg = TrainConfig { steps: 300, lr: 3e-3, eval_every: 150, net, ..small() };
    let mut state = State::new(&cfg, &Cpu).unwrap();
    // Saying the mean of all frames costs 0.28.
    let mut lines = vec![];
    train(&cfg, &mut state, &mut data(Synthetic::new(16)), &mut |_, event| {
        if let Event::Validated { line, .. } = event {
            lines.push(line.terms.action.unwrap());
        }
        Ok(())
    })
    .unwrap();
    assert!(lines[1] < lines[0] && lines[1] < 0.12, "{lines:?}");
}

#[test]
fn weights_do_not_depend_on_the_number_of_rayon_threads() {
    let dir = tempfile::tempdir().unwrap();
    let outs = [1, 2, 5].map(|threads| {
        let out = dir.path().join(threads.to_string());
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| run(&small(), &out, false)).unwrap();
        out
    });
    assert_same_files(&outs[0], &outs[1]);
    assert_same_files(&outs[0], &outs[2]);
}

/// One of the ignored tests of this file in a process of its own.
fn child(test: &str) -> Command {
    let mut command = Command::new(std::env::current_exe().unwrap());
    command.args([&format!("training::{test}"), "--exact", "--ignored", "--nocapture"]);
    command
}

#[test]
#[ignore = "a process of the test below"]
fn checksum_of_a_short_training_at_full_size() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("run");
    let cfg = TrainConfig { steps: 2, ..TrainConfig::default() };
    let frames = Synthetic { size: [32, 80], ..Synthetic::new(cfg.batch_size) };
    run_with(&cfg, &out, false, frames).unwrap();
    let manifest = run::manifest(&out).unwrap().unwrap();
    println!("checksum {}", manifest.checkpoints[&manifest.checkpoint]["weights.safetensors"]);
}

/// Memory of this process, kB.
fn resident_kb() -> u64 {
    let status = fs::read_to_string("/proc/self/status").unwrap();
    let line = status.lines().find(|line| line.starts_with("VmRSS")).unwrap();
    line.split_whitespace().nth(1).unwrap().parse().unwrap()
}

#[test]
#[ignore = "a process of the test below"]
fn memory_of_two_thousand_steps() {
    let cfg = TrainConfig { steps: 2000, eval_every: 100, ..small() };
    let mut state = State::new(&cfg, &Cpu).unwrap();
    train(&cfg, &mut state, &mut data(Synthetic::new(4)), &mut |_, event| {
        if let Event::Trained { line, .. } = event
            && matches!(line.step, 300 | 2000)
        {
            println!("resident {}", resident_kb());
        }
        Ok(())
    })
    .unwrap();
}

#[test]
fn memory_stays_flat_over_two_thousand_steps() {
    let out = child("memory_of_two_thousand_steps").output().unwrap();
    let text = String::from_utf8(out.stdout).unwrap();
    let kb: Vec<u64> =
        text.lines().filter_map(|l| l.split_once("resident ")?.1.parse().ok()).collect();
    let [early, late] = kb[..] else { panic!("{text}") };
    assert!(late < early + 2000, "{early} kB after 300 steps, {late} kB after 2000");
}

#[test]
fn weights_do_not_depend_on_the_thread_variables_of_the_process() {
    let checksum = |rayon: &str, candle: &str| {
        let mut child = child("checksum_of_a_short_training_at_full_size");
        child.envs([("RAYON_NUM_THREADS", rayon), ("CANDLE_NUM_THREADS", candle)]);
        let text = String::from_utf8(child.output().unwrap().stdout).unwrap();
        let line = text.lines().find_map(|l| Some(l.split_once("checksum ")?.1.to_string()));
        line.unwrap_or_else(|| panic!("{text}"))
    };
    let one = checksum("1", "1");
    assert_eq!(one, checksum("2", "2"));
    assert_eq!(one, checksum("3", "1"));
}

/// Every step is a checkpoint, so that most of the time goes into writing them.
fn restless() -> TrainConfig {
    TrainConfig { steps: 40, save_every: 1, log_every: 1, ..small() }
}

#[test]
#[ignore = "a process of the test below"]
fn training_in_the_working_directory() {
    run(&restless(), Path::new("run"), true).unwrap();
}

#[test]
fn killed_process_resumes_to_the_same_files_wherever_it_was_killed() {
    let dir = tempfile::tempdir().unwrap();
    let (whole, killed) = (dir.path().join("whole"), dir.path().join("run"));
    run(&restless(), &whole, false).unwrap();
    let step = || run::manifest(&killed).unwrap().map_or(0, |m| m.step);
    for goal in [1, 6, 11, 16, 21, 26, 31] {
        // Every other one dies while it writes the checkpoint, the others right after.
        let writing = killed.join(format!("checkpoints/step-{goal:08}.unfinished"));
        let mut child = child("training_in_the_working_directory");
        let mut child = child.current_dir(&dir).stdout(Stdio::null()).spawn().unwrap();
        while step() < goal && !(goal % 2 == 0 && writing.exists()) {
            assert!(child.try_wait().unwrap().is_none(), "it ended by itself");
            std::thread::yield_now();
        }
        child.kill().unwrap();
        child.wait().unwrap();
        assert!((goal - 1..40).contains(&step()), "it was to die on its way: {}", step());
    }
    run(&restless(), &killed, true).unwrap();
    assert_same_files(&whole, &killed);
}

#[test]
fn trained_run_drives_with_what_its_network_says() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("first");
    run(&small(), &out, false).unwrap();
    let mut policy = Learned::open(&out, &Cpu).unwrap();
    assert_eq!(policy.name(), "first");
    assert!(!policy.sees_the_future());
    let frame = crate::samples::frame();
    let said = policy.output(&frame).unwrap();
    let plan = policy.plan(&frame).unwrap();
    let action = said.action.to_vec2::<f32>().unwrap();
    let got = plan.action.unwrap();
    assert_eq!([got.steer, got.throttle, got.brake], action[0][..]);
    assert_eq!(plan.motion.len(), 3);
    assert!((plan.motion.iter().map(|m| m.weight).sum::<f32>() - 1.0).abs() < 1e-6);
    let at = |t: &Tensor, k: usize, step: usize, d: usize| {
        t.get(0).unwrap().to_vec3::<f32>().unwrap()[k][step][d]
    };
    let (mode, motion) = (&plan.motion[2], said.motion.unwrap());
    assert_eq!(mode.speed_mps[4], 10.0 * at(&motion.mean, 2, 4, 0));
    assert_eq!(mode.yaw_rad[29], at(&motion.mean, 2, 29, 1));
    let std = mode.std.as_ref().unwrap();
    let near = |a: f32, b: f32| (a - b).abs() < 1e-5 * b;
    assert!(near(std.speed_mps[4], 10.0 * at(&motion.log_std, 2, 4, 0).exp()));
    assert!(near(std.yaw_rad[29], at(&motion.log_std, 2, 29, 1).exp()));
    let shares = said.attention.unwrap().flatten_all().unwrap().to_vec1::<f32>().unwrap();
    let (names, planned): (Vec<_>, Vec<_>) = plan.attention.iter().copied().unzip();
    assert_eq!((names, planned), (policy.branches(), shares));
    assert!((plan.attention.iter().map(|(_, share)| share).sum::<f32>() - 1.0).abs() < 1e-6);
    assert_eq!(plan, policy.plan(&frame).unwrap(), "it remembers nothing");
}

#[test]
fn empty_file_is_the_default_run_and_a_file_changes_only_what_it_names() {
    assert_eq!(TrainConfig::from_toml("", None, None).unwrap(), TrainConfig::default());
    let text = "model = \"blind\"\npreset = \"small\"\nsteps = 7\n[net.picture]\nheight = 40\n";
    let cfg = TrainConfig::from_toml(text, None, None).unwrap();
    let mut expected = TrainConfig::preset(Model::Blind, Preset::Small);
    expected.steps = 7;
    let NetConfig::Pmp(net) = &mut expected.net else { unreachable!() };
    net.picture.height = 40;
    assert_eq!(cfg, expected);
    let cfg = TrainConfig::from_toml(text, Some(Model::Pmp), Some(Preset::Tiny)).unwrap();
    assert_eq!((cfg.model, cfg.preset), (Model::Pmp, Preset::Tiny), "the command line wins");
}

#[test]
fn every_preset_of_every_model_is_a_configuration_that_comes_back_from_its_file() {
    for model in Model::value_variants() {
        for preset in Preset::value_variants() {
            let config = TrainConfig::preset(*model, *preset);
            config.validate().unwrap();
            let text = toml::to_string(&config).unwrap();
            assert_eq!(TrainConfig::from_toml(&text, None, None).unwrap(), config);
            let text = serde_json::to_string(&config).unwrap();
            assert_eq!(serde_json::from_str::<TrainConfig>(&text).unwrap(), config);
        }
    }
}

#[test]
fn unknown_key_and_value_out_of_range_are_named_in_the_error() {
    let error = |text: &str| TrainConfig::from_toml(text, None, None).unwrap_err();
    let unknown = error("stepz = 7");
    assert_eq!(unknown.to_string(), "stepz: there is no such key");
    assert!(unknown.hint().unwrap().starts_with("`steps` is the nearest"), "{unknown:?}");
    let unknown = error("[net.picture]\nhieght = 7");
    assert_eq!(unknown.to_string(), "net.picture.hieght: there is no such key");
    assert!(unknown.hint().unwrap().starts_with("`net.picture.height` is the nearest"));
    assert!(error("preset = \"huge\"").to_string().contains("unknown variant `huge`"));
    assert_eq!(error("batch_size = 0").to_string(), "batch_size: must be at least 1");
    assert_eq!(error("lr = nan").to_string(), "lr: must be above 0");
    assert_eq!(
        error("model = \"cil\"\npreset = \"paper\"\n[net.picture]\nheight = 40").to_string(),
        "net.picture.height: must be in 77 ... 4096"
    );
    assert_eq!(
        error("[net]\ndisable = [\"camera\", \"ralidar\", \"route\", \"velocity\"]").to_string(),
        "net.disable: leaves the network without any input"
    );
}

#[test]
fn learning_rate_warms_up_and_falls_along_a_cosine() {
    let cfg = TrainConfig { steps: 1050, lr_end: 1e-4, ..TrainConfig::default() };
    let near = |step, lr: f64| assert!((cfg.lr_at(step) - lr).abs() < 1e-12, "{step}");
    near(0, 1e-3 / 50.0);
    near(49, 1e-3);
    near(50, 1e-3);
    near(550, 5.5e-4);
    near(1050, 1e-4);
}
