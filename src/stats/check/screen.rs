//! The verdict for people, on a terminal: no colours, so that it reads the same everywhere.

use std::fmt::{self, Display, Formatter};

use crate::{
    digits::grouped,
    stats::check::{
        catalogue::{self, FAMILIES},
        finding::{Count, Finding, Level},
        verdict::Verdict,
    },
};

impl Verdict {
    /// Findings by check, each with its reason and remedy.
    pub fn screen(&self) -> impl Display + '_ {
        Screen(self)
    }
}

struct Screen<'v>(&'v Verdict);

impl Display for Screen<'_> {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        let verdict = self.0;
        let identity = verdict.identity.as_deref().unwrap_or("no manifest");
        let (frames, episodes) =
            (Count(verdict.frames, "frame"), Count(verdict.episodes, "episode"));
        writeln!(f, "{}  {identity}: {frames} in {episodes}", verdict.name)?;
        let sums = if verdict.checksums { ", with checksums" } else { "" };
        let checks = catalogue::all().count() - verdict.ignored.len();
        let seen = grouped(verdict.looked_at);
        writeln!(f, "{checks} checks; pictures and sensor returns of {seen} frames{sums}")?;
        for group in verdict.findings.chunk_by(|a, b| a.check.code == b.check.code) {
            write_group(f, group, verdict.more.get(group[0].check.code).copied())?;
        }
        let of = |level: Level| Count(verdict.counts.of(level), level.name()).to_string();
        writeln!(f, "\n{}", Level::ALL.map(of).join(", "))
    }
}

/// Findings of one check.
fn write_group(f: &mut Formatter, group: &[Finding], more: Option<u64>) -> fmt::Result {
    let Some(Finding { check, .. }) = group.first() else { return Ok(()) };
    writeln!(f, "\n{} {} {}: {}", check.level.name(), check.code, check.name, check.why)?;
    for finding in group {
        writeln!(f, "  {}{}", place(finding), finding.sentence)?;
    }
    if let Some(more) = more {
        writeln!(f, "  ... and {} more", grouped(more))?;
    }
    writeln!(f, "  -> {}", check.remedy)
}

/// Where it was found, up to the colon.
pub fn place(finding: &Finding) -> String {
    match (&finding.place.episode, finding.place.frame) {
        (Some(episode), Some(frame)) if finding.place.places > 1 => {
            format!("{episode} from frame {frame}: ")
        }
        (Some(episode), Some(frame)) => format!("{episode} frame {frame}: "),
        (Some(episode), None) => format!("{episode}: "),
        _ => String::new(),
    }
}

/// All checks, one a line.
pub fn list() -> impl Display {
    List
}

struct List;

impl Display for List {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        let names = catalogue::all().map(|check| check.name.len()).max().unwrap_or_default();
        for family in &FAMILIES {
            writeln!(f, "{}", family.title)?;
            for check in family.checks {
                let (code, name, level) = (check.code, check.name, check.level.name());
                writeln!(f, "  {code}  {name:<names$}  {level:<7}  {}", check.what)?;
            }
        }
        Ok(())
    }
}
