//! Pieces of HTML that several sections are made of.

use crate::chart::palette::escaped;

/// What a missing value looks like.
pub const MISSING: &str = "–";

/// A section with its heading; nothing of an empty one.
pub fn section(title: &str, body: &str) -> String {
    match body.is_empty() {
        true => String::new(),
        false => format!("<section>\n<h2>{}</h2>\n{body}</section>\n", escaped(title)),
    }
}

pub fn paragraph(text: &str) -> String {
    format!("<p>{}</p>\n", code(text))
}

/// Charts in rows, as many as fit side by side.
pub fn row(charts: &[String]) -> String {
    match charts.is_empty() {
        true => String::new(),
        false => format!("<div class=\"charts\">\n{}</div>\n", charts.concat()),
    }
}

/// A table of cells that are HTML already; the first column holds names.
pub fn table(head: &[String], rows: &[Vec<String>]) -> String {
    let cells = |tag: &str, cells: &[String]| -> String {
        cells.iter().map(|cell| format!("<{tag}>{cell}</{tag}>")).collect()
    };
    let body: String = rows.iter().map(|row| format!("<tr>{}</tr>\n", cells("td", row))).collect();
    format!(
        "<div class=\"wide\"><table>\n<thead><tr>{}</tr></thead>\n<tbody>\n{body}</tbody>\n\
         </table></div>\n",
        cells("th", head)
    )
}

/// Text with what stands between backticks as code.
pub fn code(text: &str) -> String {
    let parts = text.split('`').enumerate();
    parts
        .map(|(i, part)| match i % 2 {
            0 => escaped(part),
            _ => format!("<code>{}</code>", escaped(part)),
        })
        .collect()
}

/// A name behind a mark of its colour.
pub fn named(name: &str, colour: &str) -> String {
    format!("<span class=\"mark\" style=\"color:{colour}\">■</span> <code>{}</code>", escaped(name))
}

/// Unit in brackets; nothing of a number without one.
pub fn unit(unit: &str) -> String {
    if unit == "1" { String::new() } else { format!(" ({unit})") }
}
