//! Under which conditions was driven, and which are missing.

use std::collections::BTreeMap;

use crate::{
    dataset::manifest::Manifest,
    stats::check::{
        digest::{Digest, sum},
        finding::{Check, Finding, Level, Needs, Place, percent},
        track::CONDITIONS,
    },
};

pub static UNKNOWN: Check = Check {
    code: "C01",
    name: "condition-unknown",
    level: Level::Note,
    needs: Needs::Columns,
    what: "town, weather, illumination or traffic is null in every frame",
    why: "nobody can tell whether night and rain were learnt, or how the policy does in them",
    remedy: "say it in the profile ([conditions]), or name logs so that pmp-ingest can read it off",
};

const PARTLY_SHARE: f64 = 0.05;

pub static PARTLY_UNKNOWN: Check = Check {
    code: "C02",
    name: "condition-partly-unknown",
    level: Level::Warning,
    needs: Needs::Columns,
    what: "town, weather, illumination or traffic is null in more than 5 % of the frames, and known in others",
    why: "tables by condition leave these frames out without a word",
    remedy: "give the logs without it a profile with [conditions]",
};

pub static WORD: Check = Check {
    code: "C03",
    name: "condition-word",
    level: Level::Warning,
    needs: Needs::Columns,
    what: "weather, illumination or traffic is a word that is none of its (clear, drizzle, rainy, storm; daytime, sunset, night, dark; empty, few, regular, dense)",
    why: "tables by condition get a column more, and results cannot be compared",
    remedy: "use the words of schemas/frame.v1.json",
};

pub static DISAGREES: Check = Check {
    code: "C04",
    name: "condition-disagrees",
    level: Level::Error,
    needs: Needs::Columns,
    what: "frames name another town, weather, illumination or traffic than the log's record",
    why: "reports by episode and by frame tell different stories of one drive",
    remedy: "ingest the log again",
};

/// The words of the paper's appendix, and those that make a condition: weather, illumination, traffic.
const WORDS: [(usize, [&str; 4]); 3] = [
    (1, ["clear", "drizzle", "rainy", "storm"]),
    (2, ["daytime", "sunset", "night", "dark"]),
    (3, ["empty", "few", "regular", "dense"]),
];

pub static NO_RAIN: Check = Check {
    code: "C05",
    name: "no-rain",
    level: Level::Note,
    needs: Needs::Columns,
    what: "the weather is known and never drizzle, rainy or storm",
    why: "drops, puddles and reflections are new to the policy",
    remedy: "record in rain, or do not claim it",
};

pub static NO_NIGHT: Check = Check {
    code: "C06",
    name: "no-night",
    level: Level::Note,
    needs: Needs::Columns,
    what: "the illumination is known and never night or dark",
    why: "the camera shows another world by headlights; lidar and radar do not, and are never needed in training",
    remedy: "record at night, or do not claim it",
};

pub static NO_TRAFFIC: Check = Check {
    code: "C07",
    name: "no-traffic",
    level: Level::Note,
    needs: Needs::Columns,
    what: "the traffic is known and always empty",
    why: "the route alone solves empty streets: such a policy has never braked for anybody",
    remedy: "record among others: --traffic regular, --traffic dense",
};

pub static ONE_TOWN: Check = Check {
    code: "C08",
    name: "one-town",
    level: Level::Note,
    needs: Needs::Columns,
    what: "the town is known and always the same",
    why: "the policy may know the town rather than how to drive",
    remedy: "record in others, and judge in one that was never trained on",
};

pub static NO_RECOVERY: Check = Check {
    code: "C09",
    name: "no-recovery",
    level: Level::Note,
    needs: Needs::Columns,
    what: "no frame was disturbed on purpose",
    why: "a policy that never saw how to come back to the lane drifts off it (covariate shift): 0 of 18 drives against 18 of 18 with 5 minutes of data",
    remedy: "record with disturbances (pmp-sim does by default), or augment",
};

pub static ALL: [&Check; 9] = [
    &UNKNOWN,
    &PARTLY_UNKNOWN,
    &WORD,
    &DISAGREES,
    &NO_RAIN,
    &NO_NIGHT,
    &NO_TRAFFIC,
    &ONE_TOWN,
    &NO_RECOVERY,
];

/// Conditions over all frames.
pub fn check(manifest: &Manifest, digests: &[Digest]) -> Vec<Finding> {
    let frames = sum(digests, |digest| digest.frames);
    if frames == 0 {
        return Vec::new();
    }
    let columns = [0, 1, 2, 3].map(|column: usize| counts(digests, column));
    let mut findings = Vec::new();
    for (name, counts) in CONDITIONS.iter().zip(&columns) {
        let unknown = counts.get(&None).copied().unwrap_or_default() as f64 / frames as f64;
        let sentence = format!("{name} is null in {} of all frames", percent(unknown));
        if unknown == 1.0 {
            findings.push(UNKNOWN.found(Place::dataset(), unknown, sentence));
        } else if unknown > PARTLY_SHARE {
            findings.push(PARTLY_UNKNOWN.found(Place::dataset(), unknown, sentence));
        }
    }
    for (column, known) in WORDS {
        for word in columns[column].keys().filter_map(|word| word.as_ref()) {
            if !known.contains(&word.as_str()) {
                let sentence = format!("`{word}` is no {}", CONDITIONS[column]);
                findings.push(WORD.found(Place::dataset(), None, sentence));
            }
        }
    }
    findings.extend(digests.iter().filter_map(|digest| disagreement(manifest, digest)));
    findings.extend(missing(&columns));
    if sum(digests, |digest| digest.perturbed) == 0 {
        let sentence = "no frame was disturbed on purpose";
        findings.push(NO_RECOVERY.found(Place::dataset(), None, sentence));
    }
    findings
}

type Counts<'d> = BTreeMap<&'d Option<String>, u64>;

fn counts(digests: &[Digest], column: usize) -> Counts<'_> {
    let mut counts = Counts::new();
    for (word, frames) in digests.iter().flat_map(|digest| &digest.conditions[column]) {
        *counts.entry(word).or_default() += frames;
    }
    counts
}

fn disagreement(manifest: &Manifest, digest: &Digest) -> Option<Finding> {
    let record = &manifest.logs[digest.log].conditions;
    let recorded = [&record.town, &record.weather, &record.illumination, &record.traffic];
    let mut columns = CONDITIONS.iter().zip(recorded).zip(&digest.conditions);
    columns.find_map(|((name, recorded), words)| {
        let (other, _) = words.iter().find(|(word, _)| *word != recorded)?;
        let text = |word: &Option<String>| word.clone().unwrap_or_else(|| "unknown".to_string());
        // A record that does not know contradicts nobody: the weather may change on the way.
        recorded.as_ref()?;
        let sentence =
            format!("{name} is {} in some frames, {} by the record", text(other), text(recorded));
        Some(DISAGREES.found(Place::episode(&digest.episode), None, sentence))
    })
}

fn missing(columns: &[Counts; 4]) -> Vec<Finding> {
    let known = |column: usize| columns[column].keys().filter_map(|word| word.as_deref());
    let lacks = |column: usize, words: &[&str]| {
        known(column).next().is_some() && !known(column).any(|word| words.contains(&word))
    };
    let mut findings = Vec::new();
    let mut add = |check: &'static Check, is: bool, sentence: &str| {
        if is {
            findings.push(check.found(Place::dataset(), None, sentence));
        }
    };
    add(&NO_RAIN, lacks(1, &WORDS[0].1[1..]), "it never rains");
    add(&NO_NIGHT, lacks(2, &WORDS[1].1[2..]), "it is never night");
    add(&NO_TRAFFIC, lacks(3, &WORDS[2].1[1..]), "the streets are always empty");
    add(&ONE_TOWN, known(0).count() == 1, "all drives are in one town");
    findings
}
