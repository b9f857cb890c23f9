//! Whether what came is where the planned mixtures said.

use crate::{
    chart::{
        histogram::histogram,
        plot::{SMALL, Size},
        reliability::reliability,
    },
    eval::offline::{
        html::horizons::curve,
        plot::drivers,
        report::{Pit, Report},
    },
    page::tags::{named, paragraph, row, section},
};

/// Of a reliability diagram, which is square.
const SQUARE: Size = Size { width: 320.0, height: 330.0, aside: 0.0 };

/// The seconds that steps are grouped by.
const GROUPS: [&str; 3] = ["1st", "2nd", "3rd"];

/// Reliability, histograms of the probability integral transform, coverage, widths and scores.
pub fn mixtures(report: &Report) -> String {
    let with: Vec<_> = drivers(report)
        .into_iter()
        .filter_map(|(policy, colour)| Some((policy, colour, policy.pit.as_ref()?)))
        .collect();
    if with.is_empty() {
        return String::new();
    }
    let mut body = paragraph(
        "A mixture that is right has as many recorded values below each of its quantiles as the \
         quantile says: its line is the diagonal, its histogram flat. Below the diagonal on the \
         left and above it on the right: it claims too wide a range. A histogram that is high at both \
         ends: too narrow a range.",
    );
    let diagrams: Vec<String> = dimensions()
        .map(|(name, of)| {
            let all: Vec<(&str, Vec<u64>)> =
                with.iter().map(|(_, colour, pit)| (*colour, summed(of(pit)))).collect();
            let claims: Vec<(&str, &[u64])> =
                all.iter().map(|(colour, counts)| (*colour, &counts[..])).collect();
            reliability(&format!("Reliability of {name}, all steps"), SQUARE, &claims)
        })
        .to_vec();
    body += &row(&diagrams);
    for (policy, colour, pit) in &with {
        body += &format!("<h3>{}</h3>\n", named(&policy.name, colour));
        let charts: Vec<String> = dimensions()
            .into_iter()
            .flat_map(|(name, of)| {
                of(pit).iter().zip(GROUPS).map(move |(counts, group)| {
                    let title = format!("Where {name} lay, {group} second");
                    histogram(&title, SMALL, "quantile of the plan (PIT)", counts, colour)
                })
            })
            .collect();
        body += &row(&charts);
    }
    body += "<h3>Coverage and sharpness</h3>\n";
    body += &paragraph(
        "Coverage is the share of recorded values inside a central interval, and should be its name; \
         of two that are right, the narrower one is better.",
    );
    for dimension in ["speed", "yaw"] {
        let coverage =
            |share: &str| curve(report, &format!("coverage_{dimension}_{share}"), Some(1.0));
        let width = |share: &str| curve(report, &format!("width_{dimension}_{share}"), None);
        body += &row(&["50", "80", "95"].into_iter().filter_map(coverage).collect::<Vec<_>>());
        body += &row(&["50", "80", "95"].into_iter().filter_map(width).collect::<Vec<_>>());
    }
    body += "<h3>Score</h3>\n";
    let scores = ["crps_speed", "crps_yaw"].into_iter();
    body += &row(&scores.filter_map(|key| curve(report, key, None)).collect::<Vec<_>>());
    section("Do the mixtures hold?", &body)
}

/// What a mixture is of.
type Dimension = (&'static str, fn(&Pit) -> &Vec<Vec<u64>>);

fn dimensions() -> [Dimension; 2] {
    [("speed", |pit| &pit.speed), ("yaw", |pit| &pit.yaw)]
}

/// Counts of all groups together.
fn summed(groups: &[Vec<u64>]) -> Vec<u64> {
    let parts = groups.first().map_or(0, Vec::len);
    (0..parts).map(|i| groups.iter().map(|group| group[i]).sum()).collect()
}
