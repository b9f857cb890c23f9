//! The verdict as annotations of GitHub's runners.
//!
//! `::error title=TITLE::MESSAGE` on stdout, with the characters that end a line or a property
//! written as `%XX` (GitHub's documentation, "Workflow commands for GitHub Actions").

use std::fmt::{self, Display, Formatter};

use crate::stats::check::{
    finding::{Finding, Level},
    screen::place,
    verdict::Verdict,
};

impl Verdict {
    /// One annotation a finding.
    pub fn github(&self) -> impl Display + '_ {
        Annotations(self)
    }
}

struct Annotations<'v>(&'v Verdict);

impl Display for Annotations<'_> {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        for finding in &self.0.findings {
            let Finding { check, sentence, .. } = finding;
            let command = match check.level {
                Level::Error => "error",
                Level::Warning => "warning",
                Level::Note => "notice",
            };
            let title = property(&format!("{} {}", check.code, check.name));
            let remedy = check.remedy;
            let more = match self.0.more.get(check.code) {
                Some(more) => format!(" ({more} more like this)"),
                None => String::new(),
            };
            let text = message(&format!("{}{sentence}{more}. Remedy: {remedy}", place(finding)));
            writeln!(f, "::{command} title={title}::{text}")?;
        }
        Ok(())
    }
}

fn message(text: &str) -> String {
    text.replace('%', "%25").replace('\r', "%0D").replace('\n', "%0A")
}

fn property(text: &str) -> String {
    message(text).replace(':', "%3A").replace(',', "%2C")
}
