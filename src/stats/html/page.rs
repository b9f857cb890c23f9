//! The page around the sections.

use std::path::Path;

use crate::{
    chart::palette::escaped,
    dataset::manifest::Manifest,
    error::Result,
    page::document::document,
    stats::{
        check::verdict::{self, Asked, Verdict},
        html::{
            amounts::amounts,
            channels::channels,
            coverage::coverage,
            findings::findings,
            gaps::gaps,
            left_out::left_out,
            mosaic::{self, mosaic},
            values::{skews, values},
            ways::ways,
        },
        moments::{Moment, moments},
        summary::Summary,
        survey::Survey,
    },
};

const STYLE: &str = "\
.mosaic { display: grid; grid-template-columns: repeat(auto-fill, minmax(min(100%, 21rem), 1fr)); gap: .8rem; }
figure { margin: 0; } figure svg { width: 100%; height: auto; display: block; }
figcaption { font-size: .8em; color: var(--soft); }
input[type=checkbox] { margin: 0 .3rem 0 0; vertical-align: middle; } label { margin-right: 1.2rem; }
.scale { white-space: nowrap; margin-right: 1.5rem; font-size: .85em; }
.scale span { display: inline-block; width: 7rem; height: .7em; }
.coverage td { text-align: center; min-width: 2.2rem; } .coverage th { font-weight: 600; text-align: center; }
.coverage tbody th, .coverage tfoot th, .coverage td.name { text-align: left; } .coverage .none { color: var(--soft); }
.coverage tr.first td, .coverage tr.first th { border-top: 2px solid var(--faint); }
.finding { border-left: 4px solid; padding: .1rem .8rem; margin: .6rem 0; background: var(--shade); }
.finding ul, .finding p { margin: .3rem 0; }
.lead { color: var(--soft); } td + td { white-space: nowrap; }
@media (max-width: 34rem) { th, td { padding: .2rem .35rem; } }
";

/// The page of a dataset as HTML, from the dataset alone.
///
/// # Errors
///
/// If a shard is missing or damaged.
pub fn page_of(dataset: &Path, summary: &Summary) -> Result<String> {
    let manifest = Manifest::read(dataset)?;
    let verdict = verdict::check(dataset, &Asked::default())?;
    let survey = Survey::of(dataset, &manifest)?;
    Ok(page(summary, &verdict, &survey, &moments(dataset, &manifest)?))
}

/// The same from its parts.
pub fn page(summary: &Summary, verdict: &Verdict, survey: &Survey, moments: &[Moment]) -> String {
    let dataset = &summary.dataset;
    let lead = format!(
        "<p class=\"lead\"><code>{}</code> at {} Hz, {}</p>\n",
        escaped(&dataset.identity),
        dataset.rate_hz,
        escaped(&dataset.written_by)
    );
    let sections = [
        amounts(summary),
        left_out(summary),
        findings(verdict),
        coverage(summary),
        mosaic(moments),
        values(survey),
        ways(survey),
        skews(survey),
        gaps(survey, dataset.rate_hz),
        channels(moments),
    ];
    let style = STYLE.to_string() + &mosaic::style();
    document(&format!("Dataset {}", dataset.name), &style, &(lead + &sections.concat()))
}
