//! The page around the sections.

use crate::{
    eval::offline::{
        html::{
            attention::attention, definitions::definitions, headline::headline, horizons::horizons,
            mixtures::mixtures, slices::slices, variance::variance,
        },
        plot::drivers,
        report::Report,
    },
    page::{
        document::document,
        tags::{code, named},
    },
};

/// The whole report as HTML.
pub fn page(report: &Report) -> String {
    let title = format!("Offline evaluation on {}", report.dataset.name);
    let caveats: String =
        report.caveats.iter().map(|caveat| format!("<p>{}</p>\n", code(caveat))).collect();
    let caveats = match caveats.is_empty() {
        true => caveats,
        false => format!("<div class=\"caveats\">\n{caveats}</div>\n"),
    };
    let legend: String = drivers(report)
        .iter()
        .map(|(policy, colour)| format!("<span>{}</span>", named(&policy.name, colour)))
        .collect();
    let sections = [
        headline(report),
        horizons(report),
        mixtures(report),
        variance(report),
        slices(report),
        attention(report),
        definitions(report),
    ];
    let body = format!("{caveats}<div class=\"legend\">{legend}</div>\n{}", sections.concat(),);
    document(&title, "", &body)
}
