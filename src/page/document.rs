//! The page around the sections: one file that needs no script and no network.

use crate::chart::palette::escaped;

/// Light or dark as the reader has it, black on white on paper. Charts take their ink from the page.
const STYLE: &str = "\
:root { color-scheme: light dark; --paper: #fff; --ink: #1a1a1a; --faint: #ddd; --soft: #5c5c5c; --shade: #f4f4f2; }
@media (prefers-color-scheme: dark) {
  :root { --paper: #16181b; --ink: #e6e6e3; --faint: #3a3d42; --soft: #a3a5a8; --shade: #202327; }
}
body { background: var(--paper); color: var(--ink); font: 15px/1.5 system-ui, sans-serif;
  margin: 2rem auto; max-width: 72rem; padding: 0 1rem; }
h1 { font-size: 1.5rem; } h2 { font-size: 1.2rem; margin-top: 2.5rem; border-bottom: 1px solid var(--faint); }
h3 { font-size: 1rem; margin-bottom: .3rem; }
code { font-size: .92em; } td code, th code { white-space: nowrap; } small { color: var(--soft); white-space: nowrap; }
.caveats { border-left: 4px solid #d55e00; background: var(--shade); padding: .5rem 1rem; }
.verdicts li { margin: .3rem 0; } .basis { color: var(--soft); font-size: .9em; }
.legend { position: sticky; top: 0; background: var(--paper); padding: .4rem 0; }
.legend span { white-space: nowrap; margin-right: 1rem; } .legend .mark { margin: 0; }
.charts { display: flex; flex-wrap: wrap; gap: .5rem; align-items: flex-start; }
.charts svg { max-width: 100%; height: auto; } .paper { fill: none; } .grid { stroke: var(--faint); }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; font-size: .9em; margin: .5rem 0; }
th, td { padding: .2rem .7rem; border-bottom: 1px solid var(--faint); text-align: right; vertical-align: top; }
th:first-child, td:first-child { text-align: left; }
.bar { display: inline-block; height: .6em; }
dt { font-weight: 600; margin-top: .5rem; } dd { margin-left: 1.5rem; }
@media print {
  :root { --paper: #fff; --ink: #000; --faint: #ccc; --soft: #444; --shade: #fff; }
  body { font-size: 10px; margin: 0; max-width: none; } .legend { position: static; }
  .charts { display: block; } .charts svg { width: 32%; } .wide { overflow: visible; } svg, tr, h2, h3 { break-inside: avoid; } h2, h3 { break-after: avoid; }
}
";

/// A page with a heading; `style` comes after the style of all pages, `body` is HTML.
pub fn document(title: &str, style: &str, body: &str) -> String {
    format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>{title}</title>\n<style>\n{STYLE}{style}</style>\n</head>\n<body>\n\
         <h1>{title}</h1>\n{body}</body>\n</html>\n",
        title = escaped(title),
    )
}
