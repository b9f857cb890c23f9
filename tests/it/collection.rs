//! Collections: what is planned, that it is what is recorded, and what a kill leaves.
#![allow(clippy::unwrap_used)]

use std::{
    collections::BTreeMap,
    fs,
    path::Path,
    process::{Command, Output, Stdio},
    thread,
    time::{Duration, Instant},
};

use pmp::{
    scene::conditions::{Illumination, Weather},
    sim::plan::{Episode, Plan},
    world::density::Density,
};
use proptest::prelude::*;
use tempfile::tempdir;

use crate::ingest::{names, same_trees};

fn plan(seed: u64, sizes: [usize; 4]) -> Plan {
    Plan {
        seed,
        towns: (0..sizes[0]).map(|town| format!("T{town}")).collect(),
        weathers: Weather::ALL[..sizes[1]].to_vec(),
        illuminations: Illumination::ALL[..sizes[2]].to_vec(),
        densities: Density::ALL[..sizes[3]].to_vec(),
    }
}

/// How often each value comes, by a key.
fn counts<K: Ord>(episodes: &[Episode], key: impl Fn(&Episode) -> K) -> Vec<usize> {
    let mut counts = BTreeMap::new();
    for episode in episodes {
        *counts.entry(key(episode)).or_insert(0) += 1;
    }
    counts.into_values().collect()
}

fn spread(counts: &[usize], values: usize) -> usize {
    let least = if counts.len() < values { 0 } else { *counts.iter().min().unwrap() };
    counts.iter().max().unwrap_or(&0) - least
}

proptest! {
    /// Every margin is even up to one, and after all combinations each has come as often.
    #[test]
    fn a_plan_is_even_in_every_margin(
        seed: u64,
        towns in 1..8_usize, weathers in 1..5_usize, lights in 1..5_usize, densities in 1..5_usize,
        count in 1..700_u32,
    ) {
        let sizes = [towns, weathers, lights, densities];
        let plan = plan(seed, sizes);
        let episodes = plan.episodes(count);
        prop_assert!(spread(&counts(&episodes, |e| e.town.clone()), towns) <= 1);
        prop_assert!(spread(&counts(&episodes, |e| e.sky.weather), weathers) <= 1);
        prop_assert!(spread(&counts(&episodes, |e| e.sky.illumination), lights) <= 1);
        prop_assert!(spread(&counts(&episodes, |e| e.traffic), densities) <= 1);
        let all = sizes.iter().product::<usize>();
        let cells = counts(&plan.episodes(2 * all as u32), |e| (e.town.clone(), e.sky, e.traffic));
        prop_assert_eq!(cells, vec![2; all]);
        prop_assert_eq!(&plan.episodes(count + 50)[..count as usize], &episodes[..]);
    }
}

#[test]
fn the_papers_collection_has_every_condition_of_every_town_as_often() {
    let episodes = Plan::training(3).episodes(360);
    let pairs = [
        counts(&episodes, |e| (e.town.clone(), format!("{:?}", e.sky))),
        counts(&episodes, |e| (e.town.clone(), e.traffic.name().to_string())),
        counts(&episodes, |e| (format!("{:?}", e.sky), e.traffic.name().to_string())),
    ];
    assert_eq!(pairs, [vec![8; 45], vec![18; 20], vec![10; 36]]);
    // A tenth of it is nearly as well mixed.
    let few = Plan::training(3).episodes(36);
    let pairs = counts(&few, |e| (format!("{:?}", e.sky), e.traffic.name().to_string()));
    assert_eq!(pairs, vec![1; 36]);
    assert_ne!(Plan::training(4).episodes(36), few);
}

/// Short drives in one town.
fn pmp_sim(out: &Path, more: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_pmp-sim"));
    command.args(["record", "--town", "Town02", "--seed", "9", "--out"]).arg(out).args(more);
    if !more.contains(&"--seconds") {
        command.args(["--seconds", "0.6"]);
    }
    command
}

fn run(out: &Path, more: &[&str]) -> Output {
    pmp_sim(out, more).output().unwrap()
}

fn error(output: &Output) -> String {
    assert_eq!(output.status.code(), Some(1));
    assert!(output.stdout.is_empty(), "talk does not belong on stdout");
    String::from_utf8(output.stderr.clone()).unwrap()
}

#[test]
fn what_is_planned_is_recorded_with_the_same_bytes_on_any_number_of_threads_and_across_a_kill() {
    let folder = tempdir().unwrap();
    let [whole, two, killed] = ["whole", "two", "killed"].map(|name| folder.path().join(name));
    let dry = run(&whole, &["--episodes", "4", "--dry-run"]);
    assert!(dry.status.success() && !whole.exists(), "a dry run writes nothing");
    let table = String::from_utf8(dry.stdout).unwrap();
    let column = |index: usize| -> Vec<&str> {
        table.lines().skip(1).map(|line| line.split('\t').nth(index).unwrap()).collect()
    };
    let mut planned: Vec<String> = column(1).into_iter().map(str::to_string).collect();
    assert_eq!(column(0), ["0", "1", "2", "3"]);
    assert_eq!(planned[3], {
        let [weather, light, traffic] = [3, 4, 5].map(|index| column(index)[3]);
        format!("Town02-{weather}-{light}-{traffic}-0003.mcap")
    });

    let done = run(&whole, &["--episodes", "4", "--jobs", "1"]);
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let said: Vec<String> =
        planned.iter().map(|name| whole.join(name).display().to_string()).collect();
    assert_eq!(String::from_utf8(done.stdout).unwrap().lines().collect::<Vec<_>>(), said);
    planned.push("plan.json".to_string());
    planned.sort();
    let mut found = names(&whole);
    found.sort();
    assert_eq!(found, planned);

    // A shorter collection grows into the longer one.
    assert!(run(&two, &["--episodes", "1"]).status.success());
    assert!(run(&two, &["--episodes", "4", "--jobs", "2"]).status.success());
    same_trees(&whole, &two);

    let mut child = pmp_sim(&killed, &["--episodes", "4", "--jobs", "1"])
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let begun = Instant::now();
    let is_half_way = || {
        let there = if killed.exists() { names(&killed) } else { Vec::new() };
        there.iter().any(|name| name.ends_with(".mcap"))
            && there.iter().any(|name| name.ends_with(".unfinished"))
    };
    while !is_half_way() {
        assert!(child.try_wait().unwrap().is_none(), "it ended before it could be killed");
        assert!(begun.elapsed() < Duration::from_secs(120), "nothing is being recorded");
        thread::sleep(Duration::from_millis(1));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    let is_log = |name: &String| name.ends_with(".mcap");
    let first = names(&killed).into_iter().find(is_log).unwrap();
    let written = |name: &str| fs::metadata(killed.join(name)).unwrap().modified().unwrap();
    let before = written(&first);
    assert!(run(&killed, &["--episodes", "4"]).status.success());
    same_trees(&whole, &killed);
    assert_eq!(written(&first), before, "nothing is recorded twice");

    let other = error(&run(&whole, &["--episodes", "4", "--perturb", "0.1", "--beams", "64"]));
    assert!(other.contains("error: will not overwrite"), "{other}");
    assert!(other.contains("other settings (perturb, beams); choose another --out"), "{other}");
    let foreign = whole.join(&first);
    fs::write(&foreign, "mine").unwrap();
    let refused = error(&run(&whole, &["--episodes", "4"]));
    assert!(refused.contains("hint: it is no log of this collection"), "{refused}");
    assert_eq!(fs::read(&foreign).unwrap(), b"mine");
}

#[test]
fn what_cannot_be_recorded_is_refused_with_what_can() {
    let folder = tempdir().unwrap();
    let none = error(&run(folder.path(), &["--seconds", "0"]));
    assert!(none.contains("hint: give 0.01 to 3600 s"), "{none}");
    let more = error(&run(folder.path(), &["--perturb", "2"]));
    assert!(more.contains("--perturb: 2 is no probability"), "{more}");
    let town = error(&run(folder.path(), &["--town", "Town99"]));
    assert!(town.contains("there is no town `Town99`"), "{town}");
    assert_eq!(run(folder.path(), &["--weather", "snow"]).status.code(), Some(2));
}
