//! When frames are missing inside episodes.

use std::fmt::Write as _;

use crate::{
    chart::palette::{COLOURS, escaped},
    digits::grouped,
    page::tags::{paragraph, section},
    stats::survey::{Drive, Survey},
};

/// Episodes that are drawn, those with most gaps.
const DRAWN: usize = 40;

/// Of the picture, px.
const WIDTH: f64 = 900.0;
const NAMES: f64 = 210.0;
const ROW: f64 = 16.0;
const FOOT: f64 = 22.0;

/// Marks on the axis of time.
const MARKS: usize = 6;

/// Ticks from the first to the last frame that are none.
fn missing(drive: &Drive) -> u64 {
    let spans = drive.ticks.windows(2).map(|pair| u64::from(pair[1].saturating_sub(pair[0])));
    spans.map(|span| span.saturating_sub(1)).sum()
}

/// A line of time for each episode that has gaps.
pub fn gaps(survey: &Survey, rate_hz: f64) -> String {
    let mut torn: Vec<(&Drive, u64)> =
        survey.drives.iter().map(|drive| (drive, missing(drive))).filter(|(_, n)| *n > 0).collect();
    let ticks: u64 = torn.iter().map(|(_, missing)| missing).sum();
    // Stable: those alike stay in the order of the manifest.
    torn.sort_by_key(|(_, missing)| std::cmp::Reverse(*missing));
    let all = survey.drives.len();
    let about = match torn.len() {
        0 => format!(
            "None: in each of {all} episodes every tick from the first frame to the last is one."
        ),
        count => format!(
            "{} ticks are missing inside {count} of {all} episodes{}. Time from the first frame; red is \
             missing. A frame whose future reaches into a gap has it masked from there on.",
            grouped(ticks),
            if count > DRAWN { format!(", of which {DRAWN} are drawn") } else { String::new() }
        ),
    };
    torn.truncate(DRAWN);
    let lines = if torn.is_empty() { String::new() } else { lines(&torn, rate_hz) };
    section("Gaps", &(paragraph(&about) + &lines))
}

fn lines(torn: &[(&Drive, u64)], rate_hz: f64) -> String {
    let span = |drive: &Drive| match drive.ticks.as_slice() {
        [first, .., last] => f64::from(last - first + 1),
        _ => 1.0,
    };
    let longest = torn.iter().map(|(drive, _)| span(drive)).fold(1.0, f64::max);
    let px = |ticks: f64| NAMES + (WIDTH - NAMES - 8.0) * ticks / longest;
    let height = ROW * torn.len() as f64 + FOOT;
    let mut svg = format!(
        "<div class=\"wide\"><svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {height}\" \
         width=\"{WIDTH}\" height=\"{height}\" role=\"img\" aria-label=\"Gaps\" \
         font-family=\"sans-serif\" font-size=\"11\" fill=\"currentColor\">\n"
    );
    for (i, (drive, missing)) in torn.iter().enumerate() {
        let y = ROW * i as f64;
        let first = drive.ticks.first().copied().unwrap_or_default();
        let at = |tick: u32| px(f64::from(tick.saturating_sub(first)));
        let _ = writeln!(
            svg,
            "<g><title>{}: {missing} ticks missing</title><text x=\"{:.0}\" y=\"{:.1}\" \
             text-anchor=\"end\">{}</text><rect x=\"{NAMES}\" y=\"{:.1}\" width=\"{:.1}\" height=\"9\" \
             fill=\"{}\" fill-opacity=\"0.45\"/>",
            escaped(&drive.episode),
            NAMES - 8.0,
            y + 11.0,
            escaped(&shortened(&drive.episode)),
            y + 3.0,
            px(span(drive)) - NAMES,
            COLOURS[0]
        );
        for pair in drive.ticks.windows(2).filter(|pair| pair[1] > pair[0] + 1) {
            let (from, to) = (at(pair[0] + 1), at(pair[1]));
            let _ = writeln!(
                svg,
                "<rect x=\"{from:.1}\" y=\"{:.1}\" width=\"{:.1}\" height=\"13\" fill=\"{}\"/>",
                y + 1.0,
                (to - from).max(1.0),
                COLOURS[1]
            );
        }
        svg += "</g>\n";
    }
    for mark in 0..=MARKS {
        let share = mark as f64 / MARKS as f64;
        let _ = writeln!(
            svg,
            "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{:.0} s</text>",
            px(longest * share).min(WIDTH - 16.0),
            height - 6.0,
            longest * share / rate_hz
        );
    }
    svg + "</svg></div>\n"
}

/// Names that fit.
fn shortened(name: &str) -> String {
    const LONGEST: usize = 30;
    if name.chars().count() <= LONGEST {
        return name.to_string();
    }
    let start: String = name.chars().take(LONGEST - 1).collect();
    format!("{start}…")
}
