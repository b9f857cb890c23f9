//! `pmp-eval drive`: policies and a suite in, episodes and tables out.

use std::{
    fs,
    path::{Path, PathBuf},
    sync::Mutex,
    thread,
};

use candle_core::Device;
use clap::{Args, ValueEnum};
use indicatif::ProgressBar;
use pmp::{
    atomic,
    cli::{self, Outcome},
    closed_loop::{
        contest::{Contest, Entrant, MakePilot, Progress},
        oracle::OraclePilot,
        pilot::{ExpertPilot, Pilot, PolicyPilot},
        results,
        row::EpisodeRow,
        suite::{Extent, Suite},
        timing::Timing,
    },
    control::{driver::ControlConfig, fusion::Fusion},
    error::{Error, Result},
    eval::{baseline, calibration, table},
    model::{learned::Learned, run},
};

/// Let policies drive the episodes of a suite in the simulator, and count what comes of it
///
/// DIR gets episodes.parquet (one row per policy and episode, from which every table can be made
/// again), table.md, table.csv, table.tex, timing.json, a picture of the last 3 s of every failure of a
/// policy with a camera (failures/), and with --record a log of every episode (logs/). A drive that
/// was stopped goes on where it was when the same command is given again. The same command gives the
/// same episodes.parquet, byte for byte, for any number of jobs.
#[derive(Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Drive {
    /// Run directory, or `expert`, `oracle-plan`, `constant-velocity`, `stand-still`; repeatable
    #[arg(long = "policy", value_name = "P", num_args = 1.., required = true)]
    policies: Vec<String>,
    /// Name of a suite, or a file like schemas/suites/deeptest.toml
    #[arg(long, value_name = "SUITE", default_value = "deeptest")]
    suite: String,
    /// Directory to write to
    #[arg(short, long, value_name = "DIR")]
    out: PathBuf,
    /// Episodes of each town and density, in place of what the suite says
    #[arg(long, value_name = "N", conflicts_with = "quick")]
    episodes: Option<u32>,
    /// As few episodes as the suite has for a quick look: 36 of deeptest's 216
    #[arg(long)]
    quick: bool,
    /// In place of the suite's seed
    #[arg(long, value_name = "S")]
    seed: Option<u64>,
    /// Folder of OpenDRIVE files TOWN.xodr in place of the package's own towns
    #[arg(long, value_name = "DIR")]
    maps: Option<PathBuf>,
    /// Episodes at a time; one per core unless said otherwise
    #[arg(long, value_name = "N")]
    jobs: Option<usize>,
    /// Keep a log (MCAP) of every episode: what was sensed, both actions, the planned distribution
    #[arg(long)]
    record: bool,
    /// How the direct action a1 and the plan's action a2 become one, for policies that have both; with
    /// several, each is a policy of its own in the tables
    #[arg(long, value_name = "FUSION", num_args = 1.., default_value = "eq3")]
    fusion: Vec<FusionKind>,
    /// Share of a2 of `--fusion fixed`
    #[arg(long, value_name = "SHARE", default_value_t = 0.5)]
    lambda: f64,
    /// Constants of eq. (3), in place of those that `pmp-eval calibrate` stored with the run
    #[arg(long, value_name = "C1", requires = "c2")]
    c1: Option<f64>,
    #[arg(long, value_name = "C2", requires = "c1")]
    c2: Option<f64>,
    /// Gains and limits of the controller, a file like schemas/control.toml
    #[arg(long, value_name = "FILE")]
    control: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum FusionKind {
    /// The direct action alone
    A1,
    /// The action that follows the plan, alone
    A2,
    /// Always the same share of both
    Fixed,
    /// The paper's eq. (3): the less certain the plan, the less it counts
    Eq3,
}

const EXAMPLES: &str = "\
Examples:
  pmp-eval drive --policy runs/tiny expert --suite deeptest --quick --out drives/quick
  pmp-eval drive --policy runs/tiny --fusion a1 a2 eq3 --suite deeptest --out drives/tiny
  pmp-eval drive --policy runs/tiny --suite leaderboard.toml --maps maps/ --out drives/carla --record

Exit codes: 0 done; 1 failed; 2 misused; 3 done, but a policy crashed in some episodes";

pub(crate) fn run(args: &Drive) -> Result<Outcome> {
    let extent = match (args.quick, args.episodes) {
        (true, _) => Extent::Quick,
        (false, Some(count)) => Extent::Of(count),
        (false, None) => Extent::Full,
    };
    let suite = Suite::open(&args.suite, args.seed, extent)?;
    let control = control(args)?;
    let entrants = args.policies.iter().map(|name| entrants(name, control, args));
    let entrants = entrants.collect::<Result<Vec<_>>>()?.into_iter().flatten().collect();
    let jobs = args.jobs.or_else(|| thread::available_parallelism().ok().map(usize::from));
    let contest = Contest {
        suite,
        entrants,
        maps: args.maps.clone(),
        record: args.record,
        jobs: jobs.unwrap_or(1),
        out: args.out.clone(),
    };
    let total = contest.entrants.len() * contest.suite.episodes.len();
    let bar = cli::progress(total as u64, "episodes", "driving");
    let so_far = Mutex::new((0, 0));
    let (rows, timings) = contest.drive(&|progress| told(&bar, &so_far, &progress))?;
    bar.finish_and_clear();
    results::write(&args.out.join(results::FILE), &rows)?;
    atomic::write_json(&args.out.join("timing.json"), &timings)?;
    table::store::write(&args.out, &rows)?;
    timings.iter().for_each(tell_timing);
    let path = args.out.join("table.md");
    cli::print(&fs::read_to_string(&path).map_err(Error::io("read", &path))?)?;
    let crashed = rows.iter().any(|row| row.reason == "crashed");
    Ok(if crashed { Outcome::DoneWithLoss } else { Outcome::Done })
}

/// Move the bar on by an episode, with the share of successes so far.
fn told(bar: &ProgressBar, so_far: &Mutex<(u32, u32)>, progress: &Progress) {
    let (Progress::Kept(row) | Progress::Driven(row)) = progress;
    let mut so_far = so_far.lock().unwrap_or_else(|error| error.into_inner());
    so_far.0 += u32::from(row.success);
    so_far.1 += 1;
    let (k, n) = *so_far;
    bar.inc(1);
    bar.set_message(format!("{k}/{n} reached the goal; last: {}", last(row)));
}

fn last(row: &EpisodeRow) -> String {
    format!("{} {} {} {}: {}", row.policy, row.town, row.traffic, row.episode, row.reason)
}

fn tell_timing(timing: &Timing) {
    let all_s = timing.world_s + timing.senses_s + timing.policy_s + timing.recording_s;
    let share = |part_s: f64| 100.0 * part_s / all_s.max(1e-9);
    eprintln!(
        "{}: {} episodes, {:.0} steps/s a thread; world {:.0} %, senses {:.0} %, policy {:.0} %, \
         recording {:.0} %; a decision takes {:.1} ms, 95 of 100 less than {:.1} ms",
        timing.policy,
        timing.episodes,
        timing.steps_per_s(),
        share(timing.world_s),
        share(timing.senses_s),
        share(timing.policy_s),
        share(timing.recording_s),
        timing.latency_p50_ms,
        timing.latency_p95_ms
    );
}

/// The controller's configuration.
fn control(args: &Drive) -> Result<ControlConfig> {
    let Some(path) = &args.control else { return Ok(ControlConfig::default()) };
    let text = fs::read_to_string(path).map_err(Error::io("read", path))?;
    toml::from_str(&text).map_err(|error| Error::Config {
        key: format!("--control {}", path.display()),
        what: error.to_string(),
        hint: Some("schemas/control.toml has every key".into()),
    })
}

/// Who a policy of the command line is: one entrant, or one for each way of fusing its actions.
fn entrants(name: &str, control: ControlConfig, args: &Drive) -> Result<Vec<Entrant>> {
    let identity = serde_json::json!({ "control": control });
    let plain = |make: MakePilot| {
        Ok(vec![Entrant { name: name.to_string(), identity: identity.clone(), make }])
    };
    match name {
        "expert" => return plain(Box::new(|| Ok(Box::new(ExpertPilot::default())))),
        "oracle-plan" => {
            return plain(Box::new(move || Ok(Box::new(OraclePilot::new(control)))));
        }
        "recorded" => {
            return Err(Error::Config {
                key: "--policy".into(),
                what: "what was recorded cannot drive: it knows no other way than its own".into(),
                hint: Some("`expert` drives as the recordings were driven".into()),
            });
        }
        _ => {}
    }
    if baseline::baseline(name).is_some() {
        let name = name.to_string();
        return plain(Box::new(move || {
            let policy = baseline::baseline(&name).ok_or_else(|| unknown(&name))?;
            Ok(Box::new(PolicyPilot::new(policy, control, Fusion::A1)) as Box<dyn Pilot>)
        }));
    }
    let dir = PathBuf::from(name);
    if !dir.is_dir() {
        return Err(unknown(name));
    }
    let learned = Learned::open(&dir, &Device::Cpu)?;
    let own_name = pmp::policy::Policy::name(&learned).to_string();
    let kinds = if learned.plans_motion() { args.fusion.as_slice() } else { &[FusionKind::A1] };
    let entrant = |kind: &FusionKind| {
        let fusion = fusion(*kind, args, name)?;
        let dir = dir.clone();
        let make: MakePilot = Box::new(move || {
            let policy = Box::new(Learned::open(&dir, &Device::Cpu)?);
            Ok(Box::new(PolicyPilot::new(policy, control, fusion)))
        });
        let suffix = kind.to_possible_value().filter(|_| kinds.len() > 1);
        let suffix = suffix.map(|kind| format!("+{}", kind.get_name())).unwrap_or_default();
        let identity = serde_json::json!({
            "control": control,
            "weights": learned.sha256(),
            "fusion": fusion,
        });
        Ok(Entrant { name: format!("{own_name}{suffix}"), identity, make })
    };
    kinds.iter().map(entrant).collect()
}

fn unknown(name: &str) -> Error {
    Error::Run {
        path: name.into(),
        what: "neither a run directory nor a policy of the package".to_string(),
        hint: Some("those are expert, oracle-plan, constant-velocity, stand-still".into()),
    }
}

fn fusion(kind: FusionKind, args: &Drive, name: &str) -> Result<Fusion> {
    Ok(match (kind, args.c1, args.c2) {
        (FusionKind::A1, ..) => Fusion::A1,
        (FusionKind::A2, ..) => Fusion::A2,
        (FusionKind::Fixed, ..) => Fusion::Fixed { lambda: args.lambda },
        (FusionKind::Eq3, Some(c1), Some(c2)) => Fusion::Variance { c1, c2 },
        (FusionKind::Eq3, ..) => {
            let calibration = calibration::read(Path::new(name))?.ok_or_else(|| Error::Run {
                path: name.into(),
                what: "eq. (3) has no constants for this run".into(),
                hint: Some(format!(
                    "`pmp-eval calibrate --policy {name} --data DATASET` stores them with the run; or \
                     give --c1 and --c2, or --fusion a1"
                )),
            })?;
            let now = run::manifest(Path::new(name))?.map(|manifest| manifest.checkpoint);
            if now.as_ref().is_some_and(|now| *now != calibration.checkpoint) {
                return Err(Error::Run {
                    path: name.into(),
                    what: format!(
                        "its constants of eq. (3) are those of {}, and it has learned on since",
                        calibration.checkpoint
                    ),
                    hint: Some("`pmp-eval calibrate --force` makes them anew".into()),
                });
            }
            for warning in &calibration.warnings {
                eprintln!("warning: {name}: {warning}");
            }
            calibration.fusion
        }
    })
}
