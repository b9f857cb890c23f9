//! The page around the sections.

use crate::{
    chart::palette::escaped,
    eval::offline::{
        html::{
            attention::attention,
            definitions::definitions,
            headline::headline,
            horizons::horizons,
            mixtures::mixtures,
            slices::slices,
            tags::{code, named},
            variance::variance,
        },
        plot::drivers,
        report::Report,
    },
};

/// Light or dark as the reader has it, black on white on paper. Charts take their ink from the page.
const STYLE: &str = "\
:root { color-scheme: light dark; --paper: #fff; --ink: #1a1a1a; --faint: #ddd; --shade: #f4f4f2; }
@media (prefers-color-scheme: dark) {
  :root { --paper: #16181b; --ink: #e6e6e3; --faint: #3a3d42; --shade: #202327; }
}
body { background: var(--paper); color: var(--ink); font: 15px/1.5 system-ui, sans-serif;
  margin: 2rem auto; max-width: 72rem; padding: 0 1rem; }
h1 { font-size: 1.5rem; } h2 { font-size: 1.2rem; margin-top: 2.5rem; border-bottom: 1px solid var(--faint); }
h3 { font-size: 1rem; margin-bottom: .3rem; }
code { font-size: .92em; } small { opacity: .75; white-space: nowrap; }
.caveats { border-left: 4px solid #d55e00; background: var(--shade); padding: .5rem 1rem; }
.verdicts li { margin: .3rem 0; } .basis { opacity: .8; font-size: .9em; }
.legend { position: sticky; top: 0; background: var(--paper); padding: .4rem 0; }
.legend span { white-space: nowrap; margin-right: 1rem; } .legend .mark { margin: 0; }
.charts { display: flex; flex-wrap: wrap; gap: .5rem; }
.charts svg { max-width: 100%; height: auto; } .paper { fill: none; } .grid { stroke: var(--faint); }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; font-size: .9em; margin: .5rem 0; }
th, td { padding: .2rem .7rem; border-bottom: 1px solid var(--faint); text-align: right; vertical-align: top; }
th:first-child, td:first-child { text-align: left; }
.bar { display: inline-block; height: .6em; }
dt { font-weight: 600; margin-top: .5rem; } dd { margin-left: 1.5rem; }
@media print {
  :root { --paper: #fff; --ink: #000; --faint: #ccc; --shade: #fff; }
  body { font-size: 10px; margin: 0; max-width: none; } .legend { position: static; }
  .wide { overflow: visible; } svg, tr, h2, h3 { break-inside: avoid; } h2, h3 { break-after: avoid; }
}
";

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
    format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>{title}</title>\n<style>\n{STYLE}</style>\n</head>\n<body>\n\
         <h1>{title}</h1>\n{caveats}<div class=\"legend\">{legend}</div>\n{}</body>\n</html>\n",
        sections.concat(),
        title = escaped(&title),
    )
}
