//! How often labels, inputs and skews have which value.

use crate::{
    chart::{
        histogram::{distribution, log_distribution},
        palette::COLOURS,
        plot::SMALL,
    },
    digits::grouped,
    page::tags::{paragraph, row, section},
    stats::survey::{Distribution, Survey},
};

/// Values of which one is far more frequent than all others.
const PEAKED: [&str; 4] = ["steer", "throttle", "brake", "turn_3s"];

/// Speed, controls and future motion.
pub fn values(survey: &Survey) -> String {
    let charts: Vec<String> =
        survey.distributions.iter().filter(|d| !is_skew(d)).map(|d| chart(d, COLOURS[0])).collect();
    let about = paragraph(
        "Shares of frames. Steering, pedals and turning have logarithmic heights: nearly all frames are \
         in one part, and a training sees the others rarely (`sampling.balance` shows them more often).",
    );
    match charts.is_empty() {
        true => String::new(),
        false => section("Speed, controls and what comes", &(about + &row(&charts))),
    }
}

/// Time from a tick to the samples of its frame.
pub fn skews(survey: &Survey) -> String {
    let charts: Vec<String> =
        survey.distributions.iter().filter(|d| is_skew(d)).map(|d| chart(d, COLOURS[2])).collect();
    let about = paragraph(
        "Time of the sample minus time of the tick, shares of the frames that have the sample; positive: \
         the sample came after the tick. A skew of 50 ms at 14 m/s is 0.7 m of road.",
    );
    match charts.is_empty() {
        true => String::new(),
        false => section("How far samples are from their ticks", &(about + &row(&charts))),
    }
}

fn is_skew(distribution: &Distribution) -> bool {
    distribution.key.ends_with("skew")
}

fn chart(of: &Distribution, colour: &str) -> String {
    let title = of.key.replace('_', " ");
    let title = match of.missing {
        0 => title,
        missing => format!("{title} ({} frames have none)", grouped(missing)),
    };
    let draw = if PEAKED.contains(&of.key) { log_distribution } else { distribution };
    draw(&title, SMALL, of.axis.clone(), &of.counts, colour)
}
