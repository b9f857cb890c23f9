//! What would hurt a training, as `pmp-stats check` says it.

use crate::{
    chart::palette::{COLOURS, INK},
    digits::grouped,
    page::tags::{code, paragraph, section},
    stats::check::{
        catalogue,
        finding::{Count, Finding, Level},
        screen::place,
        verdict::Verdict,
    },
};

/// Findings of one check that are listed on the page.
const LISTED: usize = 3;

/// Counts by level, then every check that found something, the worst first.
pub fn findings(verdict: &Verdict) -> String {
    let counts = Level::ALL
        .map(|level| Count(verdict.counts.of(level), level.name()).to_string())
        .join(", ");
    let about = format!(
        "{} checks: {counts}. Pictures and sensor returns of {} frames were looked at; `pmp-stats check --decode` \
         looks at all, and lists what is cut here.",
        catalogue::all().count() - verdict.ignored.len(),
        grouped(verdict.looked_at)
    );
    let groups = verdict.findings.chunk_by(|a, b| a.check.code == b.check.code);
    let body: String = groups
        .map(|found| {
            group(found, verdict.more.get(found[0].check.code).copied().unwrap_or_default())
        })
        .collect();
    section("What would hurt a training", &(paragraph(&about) + &body))
}

fn group(findings: &[Finding], more: u64) -> String {
    let check = findings[0].check;
    let colour = match check.level {
        Level::Error => COLOURS[1],
        Level::Warning => COLOURS[4],
        Level::Note => INK,
    };
    let item = |finding: &Finding| {
        format!("<li>{}{}</li>\n", code(&place(finding)), code(&finding.sentence))
    };
    let listed: String = findings.iter().take(LISTED).map(item).collect();
    let rest = match more + findings.len().saturating_sub(LISTED) as u64 {
        0 => String::new(),
        rest => format!("<li>and {} more</li>\n", grouped(rest)),
    };
    format!(
        "<div class=\"finding\" style=\"border-color:{colour}\"><b>{} <code>{}</code> {}</b>: {}\n<ul>\n\
         {listed}{rest}</ul>\n<p>{}</p></div>\n",
        check.level.name(),
        check.code,
        code(check.name),
        code(check.why),
        code(check.remedy)
    )
}
