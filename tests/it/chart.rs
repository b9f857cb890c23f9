//! Charts: that they are SVG, that marks are where numbers are, and that a report's page needs nothing
//! beside itself.
#![allow(clippy::unwrap_used)]

use pmp::{
    chart::{
        bars::{Bars, bars},
        density::density,
        histogram::histogram,
        lines::{Line, Point, lines},
        plot::{Plot, SMALL},
        reliability::{reliability, shares_below},
        scale::{Axis, number},
    },
    eval::offline::html::page::page,
};
use proptest::prelude::*;
use roxmltree::Document;

use crate::evaluation_report::{errors, report_of, whole};

/// Attributes of all marks with that tag and a colour of their own.
fn marks(svg: &str, tag: &str, colour: &str, attributes: &[&str]) -> Vec<Vec<f64>> {
    let document = Document::parse(svg).unwrap();
    let marks = document.descendants().filter(|node| {
        node.has_tag_name(("http://www.w3.org/2000/svg", tag))
            && node.attribute("fill") == Some(colour)
    });
    marks
        .map(|mark| {
            attributes.iter().map(|a| mark.attribute(*a).unwrap().parse().unwrap()).collect()
        })
        .collect()
}

fn texts(svg: &str) -> Vec<String> {
    let document = Document::parse(svg).unwrap();
    let texts = document.descendants().filter(|node| node.tag_name().name() == "text");
    texts.filter_map(|node| node.text().map(str::to_string)).collect()
}

#[test]
fn heights_of_bars_are_as_their_values() {
    let series = [
        Bars { colour: "#111111", values: vec![Some(1.0), None, Some(4.0)] },
        Bars { colour: "#222222", values: vec![Some(2.0), Some(99.0), Some(3.0)] },
    ];
    let svg = bars("a", SMALL, &["x", "y", "z"], Axis::from_zero("m", 4.0, 4), &series);
    let first = marks(&svg, "rect", "#111111", &["height", "x"]);
    let second = marks(&svg, "rect", "#222222", &["height", "x"]);
    let unit = first[0][0];
    assert_eq!((first.len(), second.len()), (2, 3), "nothing is drawn of nothing");
    assert!((first[1][0] - 4.0 * unit).abs() < 0.3);
    assert!((second[0][0] - 2.0 * unit).abs() < 0.3 && (second[2][0] - 3.0 * unit).abs() < 0.3);
    assert!((second[1][0] - 4.0 * unit).abs() < 0.3, "cut off at the end of the axis");
    assert!(first[0][1] < second[0][1] && second[0][1] < second[1][1], "side by side");
}

#[test]
fn line_ends_where_it_leaves_the_axis() {
    let point = |x: f64, y: f64| Point { x, y, interval: Some([y - 0.1, y + 0.1]) };
    let line = Line {
        colour: "#111111",
        points: vec![point(1.0, 1.0), point(2.0, 2.0), point(3.0, 9.0), point(4.0, 1.0)],
    };
    let (x, y) = (Axis::around("", 0.0, 4.0, 4), Axis::from_zero("", 4.0, 4));
    let svg = lines("a < b", SMALL, x, y, &[line]);
    let dots = marks(&svg, "circle", "#111111", &["cx", "cy"]);
    assert_eq!(dots.len(), 2);
    assert!(dots[0][0] < dots[1][0] && dots[0][1] > dots[1][1], "up is down in SVG: {dots:?}");
    assert!(texts(&svg).contains(&"a < b".to_string()));
}

#[test]
fn histogram_shows_shares_and_what_they_would_be_if_all_were_alike() {
    let svg = histogram("h", SMALL, "u", &[30, 10, 0, 20], "#111111");
    let bars = marks(&svg, "rect", "#111111", &["height"]);
    assert!((bars[0][0] - 3.0 * bars[1][0]).abs() < 0.3 && bars[2][0] == 0.0, "{bars:?}");
    assert!(svg.contains("stroke-dasharray"));
    assert!(!histogram("h", SMALL, "u", &[0, 0], "#111111").contains("NaN"));
}

#[test]
fn reliability_of_even_counts_is_the_diagonal() {
    let shares = shares_below(&[5; 20]);
    assert!(shares.iter().all(|[x, y]| (x - y).abs() < 1e-12));
    assert_eq!((shares.len(), shares[0], shares[20]), (21, [0.0, 0.0], [1.0, 1.0]));
    assert_eq!(shares_below(&[0, 4])[1], [0.5, 0.0]);
    Document::parse(&reliability("r", SMALL, &[("#111111", &[1, 2, 3])])).unwrap();
}

#[test]
fn cells_of_a_grid_lie_where_their_rows_and_columns_are() {
    let counts = vec![vec![1, 0], vec![0, 4]];
    let (x, y) = (Axis::log10("s", -3.0, -1.0), Axis::log10("m", -1.0, 1.0));
    let svg = density("d", SMALL, x, y, &counts, &[[-2.0, 0.0], [-1.5, 0.5]], "#111111");
    let cells = marks(&svg, "rect", "#111111", &["x", "y", "fill-opacity"]);
    assert_eq!(cells.len(), 2, "empty cells are not drawn");
    assert!(cells[0][0] < cells[1][0] && cells[0][1] > cells[1][1] && cells[0][2] < cells[1][2]);
    for said in ["0.001", "0.01", "0.1", "1", "10"] {
        assert!(texts(&svg).contains(&said.to_string()), "{said} {:?}", texts(&svg));
    }
}

#[test]
fn marks_of_axes_are_round_and_have_the_places_they_need() {
    let said = |axis: Axis| axis.ticks.into_iter().map(|(_, said)| said).collect::<Vec<_>>();
    assert_eq!(said(Axis::from_zero("", 3.9, 4)), ["0", "1", "2", "3", "4"]);
    assert_eq!(said(Axis::from_zero("", 0.9, 4)), ["0.00", "0.25", "0.50", "0.75", "1.00"]);
    assert_eq!(said(Axis::from_zero("", 0.0, 4)), ["0.00", "0.25", "0.50", "0.75", "1.00"]);
    assert_eq!(said(Axis::around("", -0.3, 0.3, 3)), ["-0.4", "-0.2", "0.0", "0.2", "0.4"]);
    assert_eq!(number(-0.0001, 0.1), "0.0", "no minus before nothing");
}

#[test]
fn page_of_a_report_is_whole_and_needs_nothing_beside_it() {
    let report = report_of(&whole(), true);
    let html = page(&report);
    for fetched in ["<script", "<link", "<img", "src=", "@import", "url("] {
        assert!(!html.contains(fetched), "{fetched}");
    }
    assert_eq!(
        html.matches("http").count(),
        html.matches("<svg xmlns=\"http://www.w3.org/2000/svg\"").count()
    );
    assert!(!html.contains("NaN") && !html.contains("inf"), "every number is one");
    let order: Vec<usize> = [
        "Weak evidence",
        "What can be said",
        "Errors by horizon",
        "Do the mixtures hold?",
        "Does the variance find the errors?",
        "By command, speed and surroundings",
        "What is looked at",
        "Every number",
        "What the numbers are",
    ]
    .iter()
    .map(|title| html.find(title).unwrap_or_else(|| panic!("no {title}")))
    .collect();
    assert!(order.is_sorted(), "{order:?}");
    let svgs: Vec<&str> = html.split("<svg").skip(1).collect();
    assert!(svgs.len() > 20, "{}", svgs.len());
    for svg in svgs {
        let svg = format!("<svg{}", &svg[..svg.find("</svg>").unwrap() + 6]);
        Document::parse(&svg).unwrap();
    }
    for tag in ["section", "table", "tr", "td", "th", "div", "span", "h3", "ul", "li", "dl", "p"] {
        let opened =
            html.matches(&format!("<{tag}>")).count() + html.matches(&format!("<{tag} ")).count();
        assert_eq!(opened, html.matches(&format!("</{tag}>")).count(), "{tag}");
    }
    for paired in report.policies.iter().flat_map(|policy| &policy.paired) {
        assert!(html.contains(
            &paired.sentence.replace("`", "~").split('~').next_back().unwrap().replace('<', "&lt;")
        ));
    }
}

#[test]
fn page_escapes_names_and_leaves_out_what_no_policy_has() {
    let mut report = report_of(&errors(1.0, 6, 40), false);
    report.policies[0].name = "<b>&".to_string();
    let html = page(&report);
    assert!(html.contains("&lt;b&gt;&amp;") && !html.contains("<b>&"));
    assert!(!html.contains("What is looked at"), "no policy has attention");
    assert!(html.contains("Do the mixtures hold?"));
}

proptest! {
    #[test]
    fn axis_holds_what_it_is_for(low in -1e6f64..1e6, span in 1e-6f64..1e6, lines in 1u32..9) {
        let axis = Axis::around("", low, low + span, lines);
        prop_assert!(axis.holds(low) && axis.holds(low + span), "{axis:?}");
        prop_assert!(axis.ticks.len() <= lines as usize + 3, "{axis:?}");
        let axis = Axis::from_zero("", span, lines);
        prop_assert!(axis.holds(0.0) && axis.high >= span * (1.0 - 1e-9), "{axis:?}");
    }

    #[test]
    fn any_text_makes_a_picture(title in "\\PC{0,12}", label in "\\PC{0,12}") {
        let mut plot = Plot::new(&title, SMALL, Axis::shares(&label), Axis::things([label.as_str()]));
        plot.note(0, &label, "#111111");
        let svg = plot.finish();
        prop_assert!(Document::parse(&svg).is_ok(), "{svg}");
    }
}
