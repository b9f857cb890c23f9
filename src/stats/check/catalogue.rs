//! All checks: the table that `--list`, `--ignore`, the page of documentation, the JSON and the
//! tests go by.

use crate::stats::check::{
    actions, balance, conditions, ego, finding::Check, images, labels, ralidar, route, split,
    structure, time,
};

/// Checks that are about the same.
pub struct Family {
    pub title: &'static str,
    /// By code.
    pub checks: &'static [&'static Check],
}

/// All of them, in the order of the way of the data.
pub static FAMILIES: [Family; 11] = [
    Family { title: "Structure", checks: &structure::ALL },
    Family { title: "Time", checks: &time::ALL },
    Family { title: "Ego motion", checks: &ego::ALL },
    Family { title: "Labels of the motion", checks: &labels::ALL },
    Family { title: "Actions", checks: &actions::ALL },
    Family { title: "Route and command", checks: &route::ALL },
    Family { title: "Images", checks: &images::ALL },
    Family { title: "Lidar and radar", checks: &ralidar::ALL },
    Family { title: "Division into training and validation", checks: &split::ALL },
    Family { title: "Balance", checks: &balance::ALL },
    Family { title: "Conditions", checks: &conditions::ALL },
];

/// Every check.
pub fn all() -> impl Iterator<Item = &'static Check> {
    FAMILIES.iter().flat_map(|family| family.checks.iter().copied())
}

/// The check of a code or name, in any case.
///
/// # Errors
///
/// A sentence with the nearest one.
pub fn find(code_or_name: &str) -> Result<&'static Check, String> {
    let is_it = |check: &&Check| {
        check.code.eq_ignore_ascii_case(code_or_name)
            || check.name.eq_ignore_ascii_case(code_or_name)
    };
    all().find(is_it).ok_or_else(|| {
        let wanted = code_or_name.to_ascii_lowercase();
        let both = all().flat_map(|check| [(check.code, check), (check.name, check)]);
        let likeness = |text: &str| strsim::jaro_winkler(&text.to_ascii_lowercase(), &wanted);
        let nearest = both.max_by(|a, b| likeness(a.0).total_cmp(&likeness(b.0)));
        let nearest = nearest.map_or_else(String::new, |(_, check)| {
            format!("; did you mean {} ({})?", check.code, check.name)
        });
        format!("no check has this code or name{nearest} See --list")
    })
}
