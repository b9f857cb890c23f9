//! Which conditions were driven under: town and traffic down, weather and illumination across.

use std::collections::{BTreeMap, BTreeSet};

use crate::{
    chart::palette::{COLOURS, escaped},
    page::tags::{paragraph, section},
    stats::summary::{Combination, Summary},
};

/// Words of conditions, mildest first; others come after them by name.
const ILLUMINATIONS: [&str; 4] = ["daytime", "sunset", "night", "dark"];
const WEATHERS: [&str; 4] = ["clear", "drizzle", "rainy", "storm"];
const LEVELS: [&str; 4] = ["empty", "few", "regular", "dense"];

/// What the paper trains under (§III.B): their lack is worth seeing.
const PAPER_ILLUMINATIONS: usize = 3;
const PAPER_WEATHERS: usize = 3;

/// Least and most that a cell is coloured.
const SHADES: [f64; 2] = [0.08, 0.7];

/// Place of a word among those that are known, then the word; what is not known comes last.
type Place = (usize, String);

fn place(word: Option<&String>, order: &[&str]) -> Place {
    match word {
        Some(word) => {
            let known = order.iter().position(|name| name == word);
            (known.unwrap_or(order.len()), word.clone())
        }
        None => (usize::MAX, "unknown".to_string()),
    }
}

/// Minutes of each combination; empty cells are combinations that are not in the dataset.
pub fn coverage(summary: &Summary) -> String {
    let minutes = |frames: u64| frames as f64 / summary.dataset.rate_hz / 60.0;
    let column = |cell: &Combination| {
        [place(cell.illumination.as_ref(), &ILLUMINATIONS), place(cell.weather.as_ref(), &WEATHERS)]
    };
    let row = |cell: &Combination| {
        [place(cell.town.as_ref(), &[]), place(cell.traffic.as_ref(), &LEVELS)]
    };
    let mut cells: BTreeMap<([Place; 2], [Place; 2]), f64> = BTreeMap::new();
    let mut columns: BTreeSet<[Place; 2]> = BTreeSet::new();
    let mut towns: BTreeSet<Place> = BTreeSet::new();
    let mut levels: BTreeSet<Place> = BTreeSet::new();
    for cell in summary.coverage.iter().filter(|cell| cell.frames > 0) {
        columns.insert(column(cell));
        let [town, level] = row(cell);
        *cells.entry(([town.clone(), level.clone()], column(cell))).or_default() +=
            minutes(cell.frames);
        towns.insert(town);
        levels.insert(level);
    }
    if cells.is_empty() {
        return String::new();
    }
    let are_known = |which: usize| columns.iter().any(|column| column[which].0 != usize::MAX);
    if are_known(0) && are_known(1) {
        let known = |names: &[&str], i: usize| (i, names[i].to_string());
        columns.extend((0..PAPER_ILLUMINATIONS).flat_map(|i| {
            (0..PAPER_WEATHERS).map(move |j| [known(&ILLUMINATIONS, i), known(&WEATHERS, j)])
        }));
    }
    if levels.iter().any(|level| level.0 != usize::MAX) {
        levels.extend(LEVELS.iter().enumerate().map(|(i, name)| (i, name.to_string())));
    }
    let most = cells.values().copied().fold(0.0, f64::max);
    let shade = |minutes: f64, most: f64| {
        let percent = 100.0 * (SHADES[0] + (SHADES[1] - SHADES[0]) * minutes / most);
        format!("background:color-mix(in srgb, {} {percent:.0}%, transparent)", COLOURS[0])
    };
    let cell = |minutes: Option<&f64>| match minutes {
        Some(minutes) => format!("<td style=\"{}\">{}</td>", shade(*minutes, most), said(*minutes)),
        None => "<td class=\"none\">·</td>".to_string(),
    };
    let sum = |picked: &dyn Fn(&[Place; 2], &[Place; 2]) -> bool| -> f64 {
        // From zero: the sum of no floats is -0.
        cells
            .iter()
            .filter(|((row, column), _)| picked(row, column))
            .fold(0.0, |sum, (_, m)| sum + m)
    };
    let mut body = String::from("<div class=\"wide\"><table class=\"coverage\">\n<thead>");
    let mut heads = [String::new(), String::new()];
    for group in columns.iter().collect::<Vec<_>>().chunk_by(|a, b| a[0] == b[0]) {
        heads[0] += &format!("<th colspan=\"{}\">{}</th>", group.len(), escaped(&group[0][0].1));
        heads[1].extend(group.iter().map(|column| format!("<th>{}</th>", escaped(&column[1].1))));
    }
    body += &format!(
        "<tr><th></th><th></th>{}<th></th></tr><tr><th>town</th><th>traffic</th>{}<th>sum</th></tr></thead>\n<tbody>\n",
        heads[0], heads[1]
    );
    for town in &towns {
        for (i, level) in levels.iter().enumerate() {
            let name = match i {
                0 => format!("<th rowspan=\"{}\">{}</th>", levels.len(), escaped(&town.1)),
                _ => String::new(),
            };
            let key = [town.clone(), level.clone()];
            let across: String = columns
                .iter()
                .map(|column| cell(cells.get(&(key.clone(), column.clone()))))
                .collect();
            let total = said(sum(&|row, _| *row == key));
            let class = if i == 0 { " class=\"first\"" } else { "" };
            body += &format!(
                "<tr{class}>{name}<td class=\"name\">{}</td>{across}<td>{total}</td></tr>\n",
                escaped(&level.1)
            );
        }
    }
    let totals: String = columns
        .iter()
        .map(|column| format!("<td>{}</td>", said(sum(&|_, other| other == column))))
        .collect();
    body += &format!(
        "</tbody>\n<tfoot><tr><th>sum</th><td></td>{totals}<td>{}</td></tr></tfoot></table></div>\n",
        said(sum(&|_, _| true))
    );
    let combinations = towns.len() * levels.len() * columns.len();
    let about = format!(
        "Minutes of driving under each combination: {} of {combinations} occur. A dot is a combination that is not there.",
        cells.len()
    );
    section("What was driven under", &(paragraph(&about) + &body))
}

/// Minutes, with a decimal where there are few.
fn said(minutes: f64) -> String {
    if minutes < 9.95 { format!("{minutes:.1}") } else { format!("{minutes:.0}") }
}
