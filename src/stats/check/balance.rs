//! Whether there is enough of what is rare: braking, turning, starting.

use crate::{
    frame::Command,
    stats::check::{
        digest::{Digest, sum},
        finding::{Check, Finding, Level, Needs, Place, percent},
    },
};

/// The paper's data brake in about 10 % of the frames; a tenth of that is next to nothing.
const BRAKING: f64 = 0.01;

pub static FEW_BRAKES: Check = Check {
    code: "B01",
    name: "few-brakes",
    level: Level::Warning,
    needs: Needs::Columns,
    what: "less than 1 % of the frames with a known brake press it by 0.1 and more",
    why: "the mean of the label is `no brake`, and L1 learns the median: a policy that never brakes",
    remedy: "record traffic, junctions and jaywalkers; balance the sampling (pmp-train does by default)",
};

const TURNING: f64 = 0.03;

pub static FEW_TURNS: Check = Check {
    code: "B02",
    name: "few-turns",
    level: Level::Warning,
    needs: Needs::Columns,
    what: "less than 3 % of the frames with a known steering steer by 0.1 and more",
    why: "junctions are where policies fail, and the loss hardly sees them",
    remedy: "record routes with more junctions; balance the sampling",
};

/// A start a kilometre is 0.1 % of the frames at the paper's 23 km/h, if it lasts for 2 ticks.
const STARTING: f64 = 0.001;

pub static FEW_STARTS: Check = Check {
    code: "B03",
    name: "few-starts",
    level: Level::Warning,
    needs: Needs::Columns,
    what: "less than 0.1 % of the frames start from rest (below 0.5 m/s with throttle of 0.1 and more)",
    why: "a policy that has seen few starts stays where it stopped (inertia problem, Codevilla 2019)",
    remedy: "record stops and starts; weigh starts up",
};

pub static COMMAND_MISSING: Check = Check {
    code: "B04",
    name: "command-missing",
    level: Level::Warning,
    needs: Needs::Columns,
    what: "no frame says left, or none says right",
    why: "CIL's branch for the command is never trained, and routes with such a turn are new to all others",
    remedy: "record routes that turn to both sides",
};

/// The spread of speeds in the paper's data is about 4 m/s.
const SPREAD_MPS: f64 = 1.0;

pub static ONE_SPEED: Check = Check {
    code: "B05",
    name: "one-speed",
    level: Level::Warning,
    needs: Needs::Columns,
    what: "the speeds of all frames have a standard deviation below 1 m/s",
    why: "the policy learns to keep the speed that it has, whatever it sees",
    remedy: "record stops, junctions and faster roads",
};

/// Codevilla 2019 blames fewer standing frames than this for policies that do not start.
const STANDING: f64 = 0.35;

pub static MOSTLY_STANDING: Check = Check {
    code: "B06",
    name: "mostly-standing",
    level: Level::Warning,
    needs: Needs::Columns,
    what: "the car stands (below 0.1 m/s) in more than 35 % of all frames",
    why: "from rest, `stay` is nearly always right: a policy that stops once stays there",
    remedy: "cut long stops out, or weigh starts up",
};

const ONE_SHARE: f64 = 0.5;
const SEVERAL: usize = 3;

pub static ONE_EPISODE: Check = Check {
    code: "B07",
    name: "one-episode",
    level: Level::Warning,
    needs: Needs::Columns,
    what: "one of three and more episodes has more than half of all frames",
    why: "its street, light and traffic are most of what is learnt",
    remedy: "record more drives, or take a part of the long one",
};

pub static ALL: [&Check; 7] = [
    &FEW_BRAKES,
    &FEW_TURNS,
    &FEW_STARTS,
    &COMMAND_MISSING,
    &ONE_SPEED,
    &MOSTLY_STANDING,
    &ONE_EPISODE,
];

/// Shares over all frames.
pub fn check(digests: &[Digest]) -> Vec<Finding> {
    let frames = sum(digests, |digest| digest.frames);
    if frames == 0 {
        return Vec::new();
    }
    let share = |count: u64, of: u64| (of > 0).then(|| count as f64 / of as f64);
    let [steer, throttle, brake] =
        [0, 1, 2].map(|channel: usize| sum(digests, |digest| digest.acted[channel]));
    let shares = [
        (&FEW_BRAKES, share(sum(digests, |d| d.braking), brake), BRAKING, "brake"),
        (&FEW_TURNS, share(sum(digests, |d| d.turning), steer), TURNING, "turn"),
        (&FEW_STARTS, share(sum(digests, |d| d.starting), throttle), STARTING, "start from rest"),
    ];
    let mut findings = Vec::new();
    for (check, share, least, what) in shares {
        if let Some(share) = share.filter(|share| *share < least) {
            let sentence = format!("{} of the frames {what}", percent(share));
            findings.push(check.found(Place::dataset(), share, sentence));
        }
    }
    let counts = Command::ALL.iter().enumerate();
    let none = counts.filter(|(at, _)| sum(digests, |digest| digest.commands[*at]) == 0);
    let turns = [Command::Left, Command::Right];
    let none: Vec<&str> =
        none.filter(|(_, command)| turns.contains(command)).map(|(_, c)| c.name()).collect();
    if !none.is_empty() {
        let sentence = format!("no frame says {}", none.join(" or "));
        findings.push(COMMAND_MISSING.found(Place::dataset(), None, sentence));
    }
    findings.extend(speeds(digests, frames));
    let standing = sum(digests, |digest| digest.standing) as f64 / frames as f64;
    if standing > STANDING {
        let sentence = format!("the car stands in {} of the frames", percent(standing));
        findings.push(MOSTLY_STANDING.found(Place::dataset(), standing, sentence));
    }
    findings.extend(longest(digests, frames));
    findings
}

fn speeds(digests: &[Digest], frames: u64) -> Option<Finding> {
    let mean = |which: usize| {
        digests.iter().map(|digest| digest.speed_sums[which]).sum::<f64>() / frames as f64
    };
    let spread_mps = (mean(1) - mean(0) * mean(0)).max(0.0).sqrt();
    let sentence = format!("speeds are {:.1} m/s, give or take {spread_mps:.2}", mean(0));
    (spread_mps < SPREAD_MPS).then(|| ONE_SPEED.found(Place::dataset(), spread_mps, sentence))
}

fn longest(digests: &[Digest], frames: u64) -> Option<Finding> {
    let longest = digests.iter().max_by_key(|digest| digest.frames)?;
    let share = longest.frames as f64 / frames as f64;
    let sentence = format!("has {} of all frames", percent(share));
    let is_too_long = share > ONE_SHARE && digests.len() >= SEVERAL;
    is_too_long.then(|| ONE_EPISODE.found(Place::episode(&longest.episode), share, sentence))
}
