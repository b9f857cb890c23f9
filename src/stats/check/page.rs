//! The page of documentation, `docs/checks.md`; a test holds the committed one to this.

use std::fmt::Write as _;

use crate::stats::check::{
    catalogue::{self, FAMILIES},
    glimpse::DEFAULT_SAMPLE,
};

/// All checks as Markdown.
pub fn markdown() -> String {
    let mut page = String::new();
    let count = catalogue::all().count();
    let head = format!(
        "# Checks of a dataset\n\n\
         `pmp-stats check DATASET` looks for {count} things that would hurt a training. Codes and names are stable; \
         a code is never used for anything else again. `--ignore CODE` leaves one out, `--json` and `--github` print \
         the verdict for programs, and the exit code is 1 where there is an error (`--fail-on` sets the level).\n\n\
         Checks that need frames look at the pictures and sensor returns of {DEFAULT_SAMPLE} frames spread evenly \
         over the dataset, or as many as `--sample` says; with `--decode` they look at all, and checksums are computed.\n\n\
         This page is written by the program (`pmp-stats check --list --markdown`).\n"
    );
    page.push_str(&head);
    for family in &FAMILIES {
        let _ = writeln!(page, "\n## {}", family.title);
        for check in family.checks {
            let (code, name, level) = (check.code, check.name, check.level.name());
            let _ = writeln!(page, "\n### {code} {name} ({level})\n");
            let _ = writeln!(page, "- **Found when** {}.", check.what);
            let _ = writeln!(page, "- **Why it hurts:** {}.", check.why);
            let _ = writeln!(page, "- **Remedy:** {}.", check.remedy);
            let _ = writeln!(page, "- **Reads:** {}.", check.needs.name());
        }
    }
    page
}
