//! How much there is, beside the paper's dataset.

use crate::{
    digits::grouped,
    page::tags::{MISSING, paragraph, section, table},
    stats::summary::{Part, Summary},
};

/// The paper's dataset (§III.B, §IV.A): what it says, and what follows from it.
struct Paper;

impl Paper {
    const EPISODES: f64 = 360.0;
    const FRAMES: f64 = 389_000.0;
    const HOURS: f64 = 10.8;
    const KM: f64 = 247.0;
    const TRAINING_FRAMES: f64 = 340_000.0;
    const MEAN_SPEED_MPS: f64 = Self::KM * 1000.0 / (Self::HOURS * 3600.0);
}

/// A row of the table: its name, what is counted, what the paper has, decimals.
type Row = (&'static str, fn(&Part) -> Option<f64>, f64, usize);

const ROWS: [Row; 7] = [
    ("episodes", |part| Some(part.episodes as f64), Paper::EPISODES, 0),
    ("frames", |part| Some(part.frames as f64), Paper::FRAMES, 0),
    ("hours", |part| Some(part.hours), Paper::HOURS, 2),
    ("distance (km)", |part| Some(part.distance_km), Paper::KM, 1),
    ("mean speed (m/s)", |part| part.mean_speed_mps, Paper::MEAN_SPEED_MPS, 2),
    (
        "seconds an episode",
        |part| (part.episodes > 0).then(|| part.hours * 3600.0 / part.episodes as f64),
        Paper::HOURS * 3600.0 / Paper::EPISODES,
        0,
    ),
    (
        "metres an episode",
        |part| (part.episodes > 0).then(|| part.distance_km * 1000.0 / part.episodes as f64),
        Paper::KM * 1000.0 / Paper::EPISODES,
        0,
    ),
];

/// Amounts by split, and what share of the paper's dataset all of it is.
pub fn amounts(summary: &Summary) -> String {
    let head = ["", "train", "val", "all", "paper", "all to paper"].map(str::to_string);
    let number = |value: Option<f64>, decimals: usize| {
        value.map_or(MISSING.into(), |value| said(value, decimals))
    };
    let mut rows: Vec<Vec<String>> = ROWS
        .into_iter()
        .map(|(name, of, paper, decimals)| {
            let [train, val, all] =
                [&summary.splits.train, &summary.splits.val, &summary.splits.all]
                    .map(|part| part.as_ref().and_then(of));
            let ratio = all.map_or(MISSING.into(), |all| ratio(all / paper));
            let mut row = vec![name.to_string()];
            row.extend([train, val, all, Some(paper)].map(|value| number(value, decimals)));
            row.push(ratio);
            row
        })
        .collect();
    let trained = summary.holdout.train_frames as f64;
    rows.insert(
        2,
        vec![
            "frames that train".to_string(),
            said(trained, 0),
            MISSING.to_string(),
            MISSING.to_string(),
            said(Paper::TRAINING_FRAMES, 0),
            ratio(trained / Paper::TRAINING_FRAMES),
        ],
    );
    let weak = if summary.holdout.is_time_block { " That is weak evidence." } else { "" };
    let holdout = format!("Set apart to judge: {}.{weak}", summary.holdout.how);
    section("How much there is", &(table(&head, &rows) + &paragraph(&holdout)))
}

fn said(value: f64, decimals: usize) -> String {
    match decimals {
        0 => grouped(value.round() as u64),
        _ => format!("{value:.decimals$}"),
    }
}

fn ratio(ratio: f64) -> String {
    if ratio >= 0.1 { format!("{:.0} %", 100.0 * ratio) } else { format!("{:.1} %", 100.0 * ratio) }
}
