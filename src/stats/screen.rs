//! A summary as one screen of text: numbers right-aligned, at most 100 columns, `–` for nothing.

use std::fmt::{self, Display, Formatter};

use crate::{
    digits::{fixed, grouped},
    stats::summary::{Group, Groups, LeftOut, Loss, Part, Quantiles, Summary},
};

/// Shown where there is no number.
const NOTHING: &str = "–";

/// Width of a screen, in characters.
const WIDTH: usize = 100;

/// Width of the names on the left.
const NAMES: usize = 14;

/// Words of one kind, and losses of one kind, that are listed; JSON has them all.
const LISTED: usize = 12;

impl Summary {
    /// For people, on a terminal.
    pub fn screen(&self) -> impl Display + '_ {
        Screen(self)
    }
}

struct Screen<'s>(&'s Summary);

impl Display for Screen<'_> {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        let Summary { dataset, .. } = self.0;
        let rate = dataset.rate_hz;
        writeln!(f, "{}  {} at {rate} Hz, {}", dataset.name, dataset.identity, dataset.written_by)?;
        self.amounts(f)?;
        self.holdout(f)?;
        self.shares(f)?;
        self.signals(f)?;
        self.skews(f)?;
        write_groups(f, &self.0.groups)?;
        write_left_out(f, &self.0.left_out)
    }
}

impl Screen<'_> {
    fn holdout(&self, f: &mut Formatter) -> fmt::Result {
        let holdout = &self.0.holdout;
        let (train, val) = (grouped(holdout.train_frames), grouped(holdout.val_frames));
        let weak = if holdout.is_time_block { " (weak evidence)" } else { "" };
        writeln!(f, "{train} frames train, {val} judge{weak}: {}", holdout.how)
    }

    fn amounts(&self, f: &mut Formatter) -> fmt::Result {
        let head = ["episodes", "frames", "hours", "km", "mean m/s", "3 s of future"];
        header(f, "", &head)?;
        for (name, part) in self.0.splits.iter() {
            let number = |pick: fn(&Part) -> String| part.map(pick);
            let cells = [
                number(|part| grouped(part.episodes)),
                number(|part| grouped(part.frames)),
                number(|part| format!("{:.2}", part.hours)),
                number(|part| format!("{:.2}", part.distance_km)),
                part.and_then(|part| part.mean_speed_mps).map(|speed| format!("{speed:.2}")),
                number(|part| grouped(part.frames_with_full_future)),
            ];
            row(f, name, cells)?;
        }
        Ok(())
    }

    fn shares(&self, f: &mut Formatter) -> fmt::Result {
        let head = ["lidar", "radar", "steer", "throttle", "brake", "3 s of future"];
        header(f, "frames with", &head)?;
        for (name, part) in self.0.splits.iter() {
            let shares = part.and_then(|part| part.shares);
            let shares =
                shares.map(|s| [s.lidar, s.radar, s.steer, s.throttle, s.brake, s.full_future]);
            let cells = shares.map_or([None; 6], |shares| shares.map(Some));
            row(f, name, cells.map(|cell| cell.and_then(percent)))?;
        }
        Ok(())
    }

    fn signals(&self, f: &mut Formatter) -> fmt::Result {
        let head = ["mean", "min", "5 %", "25 %", "50 %", "75 %", "95 %", "max"];
        header(f, "values", &head)?;
        let signals = &self.0.signals;
        for (name, values, decimals) in [
            ("speed, m/s", &signals.speed_mps, 2),
            ("steer", &signals.steer, 3),
            ("throttle", &signals.throttle, 3),
            ("brake", &signals.brake, 3),
        ] {
            let values = values.map(|values| (values.mean, values.quantiles));
            row(f, name, distribution(values, decimals))?;
        }
        Ok(())
    }

    fn skews(&self, f: &mut Formatter) -> fmt::Result {
        let head = ["mean", "|min|", "|5 %|", "|25 %|", "|50 %|", "|75 %|", "|95 %|", "|max|"];
        header(f, "skew, ms", &head)?;
        let skews = &self.0.skews;
        for (name, skew) in [
            ("image", &skews.image),
            ("lidar", &skews.lidar),
            ("radar", &skews.radar),
            ("control", &skews.control),
        ] {
            let skew = skew.map(|skew| (skew.signed_mean_ms, skew.absolute_ms));
            row(f, name, distribution(skew, 1))?;
        }
        Ok(())
    }
}

fn distribution(values: Option<(f64, Quantiles)>, decimals: usize) -> [Option<String>; 8] {
    let Some((mean, quantiles)) = values else { return [const { None }; 8] };
    let [a, b, c, d, e, f, g] = quantiles.values();
    [mean, a, b, c, d, e, f, g].map(|value| Some(fixed(value, decimals)))
}

fn write_groups(f: &mut Formatter, groups: &Groups) -> fmt::Result {
    writeln!(f, "\nframes by")?;
    for (name, groups) in [
        ("command", &groups.command),
        ("route", &groups.route_source),
        ("town", &groups.town),
        ("weather", &groups.weather),
        ("illumination", &groups.illumination),
        ("traffic", &groups.traffic),
    ] {
        write_group(f, name, groups)?;
    }
    Ok(())
}

/// Words with their frames and shares, as many in a line as fit.
fn write_group(f: &mut Formatter, name: &str, groups: &[Group]) -> fmt::Result {
    let total: u64 = groups.iter().map(|group| group.frames).sum();
    if total == 0 {
        return writeln!(f, "{name:<NAMES$}{NOTHING}");
    }
    let word = |group: &Group| group.name.clone().unwrap_or_else(|| "unknown".to_string());
    let longest = groups.iter().map(|group| word(group).chars().count()).max().unwrap_or(0);
    let width = longest.max(8);
    let cells: Vec<String> = groups
        .iter()
        .take(LISTED)
        .map(|group| {
            let share = percent(group.frames as f64 / total as f64);
            let share = share.unwrap_or_else(|| NOTHING.to_string());
            let frames = if group.frames == 0 { NOTHING.into() } else { grouped(group.frames) };
            format!("{:<width$}{frames:>10}{share:>8}", word(group))
        })
        .collect();
    let in_a_line = ((WIDTH - NAMES + 3) / (width + 21)).max(1);
    for (i, line) in cells.chunks(in_a_line).enumerate() {
        writeln!(f, "{:<NAMES$}{}", if i == 0 { name } else { "" }, line.join("   "))?;
    }
    match groups.len() - cells.len() {
        0 => Ok(()),
        more => writeln!(f, "{:<NAMES$}... and {more} more, see --json", ""),
    }
}

fn write_left_out(f: &mut Formatter, left_out: &LeftOut) -> fmt::Result {
    let ticks = left_out.ticks.iter().map(|(reason, count)| (*count, reason.as_str()));
    let s = if left_out.damaged_logs == 1 { "" } else { "s" };
    let damage = format!("damaged parts of files, in {} log{s}", grouped(left_out.damaged_logs));
    let others = [
        (left_out.damaged_parts, damage.as_str()),
        (left_out.undecodable_messages, "messages that could not be decoded"),
        (left_out.sensors.len() as u64, "sensors of logs"),
        (left_out.failed_logs.len() as u64, "logs that gave nothing"),
    ];
    let lines: Vec<(u64, String)> = ticks
        .map(|(count, reason)| (count, format!("ticks: {reason}")))
        .chain(others.map(|(count, what)| (count, what.to_string())))
        .filter(|(count, _)| *count > 0)
        .collect();
    if lines.is_empty() {
        return writeln!(f, "\n{:<NAMES$}{NOTHING}", "left out");
    }
    writeln!(f, "\nleft out")?;
    for (count, what) in lines {
        writeln!(f, "{:>NAMES$}  {what}", grouped(count))?;
    }
    write_losses(f, &left_out.sensors)?;
    write_losses(f, &left_out.failed_logs)
}

fn write_losses(f: &mut Formatter, losses: &[Loss]) -> fmt::Result {
    for loss in losses.iter().take(LISTED) {
        writeln!(f, "  {}: {}", loss.source_log, loss.what)?;
    }
    match losses.len().saturating_sub(LISTED) {
        0 => Ok(()),
        more => writeln!(f, "  ... and {more} more, see --json"),
    }
}

fn header<const N: usize>(f: &mut Formatter, name: &str, head: &[&str; N]) -> fmt::Result {
    writeln!(f)?;
    row(f, name, head.map(|title| Some(title.to_string())))
}

/// One line of a table whose columns share what the names leave of the screen.
fn row<const N: usize>(f: &mut Formatter, name: &str, cells: [Option<String>; N]) -> fmt::Result {
    let width = (WIDTH - NAMES) / N;
    write!(f, "{name:<NAMES$}")?;
    for cell in cells {
        write!(f, "{:>width$}", cell.as_deref().unwrap_or(NOTHING))?;
    }
    writeln!(f)
}

/// `None` for a share of nothing; never rounded to all or to nothing.
fn percent(share: f64) -> Option<String> {
    match share {
        0.0 => None,
        share if share < 0.001 => Some("<0.1 %".to_string()),
        share if share < 1.0 && share > 0.999 => Some(">99.9 %".to_string()),
        share => Some(format!("{:.1} %", 100.0 * share)),
    }
}
