//! What a check is, and what it finds.

use std::fmt::{self, Display, Formatter};

use serde::Serialize;

/// How bad a finding is; ascending.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Level {
    /// Worth knowing; may well be meant so.
    Note,
    /// Likely to cost quality.
    Warning,
    /// The data contradict themselves, or cannot be read: a training on them learns what is wrong.
    Error,
}

impl Level {
    /// The worst first, as reports have them.
    pub const ALL: [Level; 3] = [Level::Error, Level::Warning, Level::Note];

    pub fn name(self) -> &'static str {
        match self {
            Level::Note => "note",
            Level::Warning => "warning",
            Level::Error => "error",
        }
    }
}

/// What has to be read for a check; ascending in cost.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Needs {
    /// Manifest, table of episodes, names, sizes and footers of files.
    Records,
    /// All columns but pictures and sensor returns.
    Columns,
    /// Pictures and sensor returns of a sample of frames, or of all with `--decode`.
    Frames,
    /// Every byte of every file: only with `--decode`.
    Bytes,
}

impl Needs {
    pub fn name(self) -> &'static str {
        match self {
            Needs::Records => "records",
            Needs::Columns => "columns",
            Needs::Frames => "sampled frames; all with --decode",
            Needs::Bytes => "all bytes; only with --decode",
        }
    }
}

/// A check.
#[derive(Debug)]
pub struct Check {
    /// Stable: a letter for the family and two digits; never used for anything else again.
    pub code: &'static str,
    /// Stable, too: words in kebab-case.
    pub name: &'static str,
    pub level: Level,
    pub needs: Needs,
    /// When it is found, with the limits.
    pub what: &'static str,
    /// What it does to a training.
    pub why: &'static str,
    /// What to do about it.
    pub remedy: &'static str,
}

/// Where something was found.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Place {
    pub episode: Option<String>,
    /// Number of the first frame.
    pub frame: Option<u32>,
    /// How many frames, files or other places.
    pub places: u64,
    /// Relative to the dataset.
    pub file: Option<String>,
}

impl Place {
    /// The dataset as a whole.
    pub fn dataset() -> Place {
        Place { places: 1, ..Place::default() }
    }

    pub fn file(path: &str) -> Place {
        Place { file: Some(path.to_string()), ..Place::dataset() }
    }

    /// An episode as a whole.
    pub fn episode(id: &str) -> Place {
        Place { episode: Some(id.to_string()), ..Place::dataset() }
    }

    /// Frames of an episode.
    pub fn frames(id: &str, first: u32, places: u64) -> Place {
        Place { frame: Some(first), places, ..Place::episode(id) }
    }
}

/// Something that a check found.
#[derive(Clone, Debug)]
pub struct Finding {
    pub check: &'static Check,
    pub place: Place,
    /// What was measured: the worst, where there are many; in the unit that the sentence names.
    pub value: Option<f64>,
    pub sentence: String,
}

impl Check {
    /// A finding of this check.
    pub fn found(
        &'static self,
        place: Place,
        value: impl Into<Option<f64>>,
        sentence: impl Into<String>,
    ) -> Finding {
        let value = value.into().filter(|value| value.is_finite());
        Finding { check: self, place, value, sentence: sentence.into() }
    }
}

/// Frames of an episode that are not as they should be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hits {
    /// Number of the first frame.
    pub first: u32,
    pub count: u64,
    /// The largest of what was measured.
    pub worst: f64,
}

impl Hits {
    /// Of frames and what was measured there; `None` without any.
    pub fn of(hits: impl IntoIterator<Item = (u32, f64)>) -> Option<Hits> {
        hits.into_iter().fold(None, |so_far: Option<Hits>, (frame, value)| {
            let Hits { first, count, worst } =
                so_far.unwrap_or(Hits { first: frame, count: 0, worst: value });
            Some(Hits { first, count: count + 1, worst: worst.max(value) })
        })
    }

    /// As a place in an episode.
    pub fn of_episode(&self, id: &str) -> Place {
        Place::frames(id, self.first, self.count)
    }
}

/// `3 frames`, `1 frame`.
pub struct Count(pub u64, pub &'static str);

impl Display for Count {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        let s = if self.0 == 1 { "" } else { "s" };
        write!(f, "{} {}{s}", crate::digits::grouped(self.0), self.1)
    }
}

/// A share as percent.
pub fn percent(share: f64) -> String {
    match share {
        share if share > 0.0 && share < 0.001 => "less than 0.1 %".to_string(),
        share => format!("{:.1} %", 100.0 * share),
    }
}
