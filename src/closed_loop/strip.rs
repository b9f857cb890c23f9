//! A failure to look at: what was seen in its last 3 s, and what was planned, as SVG.

use std::fmt::Write as _;

use base64::{Engine as _, engine::general_purpose::STANDARD};
use glam::DVec3;

use crate::{
    closed_loop::{film::Film, film::Moment, row::EpisodeRow},
    frame::FUTURE_STEPS,
    policy::Mode,
    projection::Camera,
    sim::rig::Rig,
};

/// Pictures, and how many are beside each other.
const PICTURES: usize = 6;
const ACROSS: usize = 2;

/// Around pictures, px; the title; under each picture its words.
const MARGIN: usize = 10;
const TITLE: usize = 44;
const WORDS: usize = 22;

/// Size of the small chart of planned speed in a picture's corner, px, and its scale.
const CHART: [f64; 2] = [150.0, 70.0];
const CHART_MPS: f64 = 15.0;

const PLANNED: &str = "#f0e442";
const DRIVEN: &str = "#ffffff";

/// The strip of an episode that ended; `None` if nothing was seen.
pub fn strip(film: &Film, row: &EpisodeRow, rig: &Rig) -> Option<String> {
    let moments = film.evenly(PICTURES);
    let last_ns = moments.last()?.stamp_ns;
    let Camera { width, height, .. } = rig.camera.intrinsics;
    let (cell_w, cell_h) = (width + MARGIN, height + WORDS + MARGIN);
    let rows = moments.len().div_ceil(ACROSS);
    let (all_w, all_h) = (ACROSS * cell_w + MARGIN, TITLE + rows * cell_h + MARGIN);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{all_w}\" height=\"{all_h}\" \
         viewBox=\"0 0 {all_w} {all_h}\" font-family=\"sans-serif\" font-size=\"14\">\n\
         <rect width=\"{all_w}\" height=\"{all_h}\" fill=\"#202020\"/>\n\
         <text x=\"{MARGIN}\" y=\"28\" fill=\"#ffffff\" font-size=\"18\">{}</text>\n",
        escaped(&title(row))
    );
    for (at, moment) in moments.into_iter().enumerate() {
        let x = MARGIN + at % ACROSS * cell_w;
        let y = TITLE + at / ACROSS * cell_h;
        let _ = writeln!(
            svg,
            "<g transform=\"translate({x} {y})\">\
             <image width=\"{width}\" height=\"{height}\" href=\"data:image/jpeg;base64,{}\"/>",
            STANDARD.encode(&moment.picture)
        );
        if let Some(mode) = &moment.strongest {
            svg += &way(mode, moment.speed_mps, rig);
            svg += &chart(mode, moment.speed_mps, [width as f64, height as f64]);
        }
        let since_s = (moment.stamp_ns - last_ns) as f64 * 1e-9;
        let _ = writeln!(
            svg,
            "<text x=\"2\" y=\"{}\" fill=\"#dddddd\">{}</text></g>",
            height + 16,
            escaped(&words(moment, since_s))
        );
    }
    svg += "</svg>\n";
    Some(svg)
}

fn title(row: &EpisodeRow) -> String {
    let mut title = format!(
        "{}, {} {} {} {}, episode {}: {} after {:.1} s",
        row.policy,
        row.town,
        row.traffic,
        row.weather,
        row.illumination,
        row.episode,
        row.reason,
        row.duration_s
    );
    if let (Some(touched), Some(impact_mps)) = (&row.touched, row.impact_mps) {
        let whose = if row.at_fault == Some(true) { "own" } else { "other's" };
        let _ = write!(title, " ({touched}, {:.0} km/h, {whose} fault)", impact_mps * 3.6);
    }
    title
}

fn words(moment: &Moment, since_s: f64) -> String {
    let action = moment.action;
    let mut words = format!(
        "{since_s:.1} s   {:.0} km/h   steer {:+.2}   throttle {:.2}   brake {:.2}",
        moment.speed_mps * 3.6,
        action.steer,
        action.throttle,
        action.brake
    );
    if let Some(decision) = moment.decision.filter(|d| d.a1.is_some() && d.a2.is_some()) {
        let _ = write!(words, "   λ {:.2}", decision.lambda);
    }
    words
}

/// The planned way on the ground, with a dot at every second.
fn way(mode: &Mode, speed_mps: f32, rig: &Rig) -> String {
    let camera_from_ego = rig.camera.ego_from_camera.inverse();
    let on_picture = |[x, y]: [f64; 2]| {
        let point_m = camera_from_ego.transform_point3(DVec3::new(x, y, 0.0));
        rig.camera.intrinsics.project(point_m.to_array())
    };
    let places: Vec<Option<[f64; 2]>> =
        mode.positions_m(speed_mps).into_iter().map(on_picture).collect();
    let points: Vec<String> =
        places.iter().flatten().map(|[u, v]| format!("{u:.1},{v:.1}")).collect();
    let mut svg = format!(
        "<polyline points=\"{}\" fill=\"none\" stroke=\"{PLANNED}\" stroke-width=\"3\"/>",
        points.join(" ")
    );
    for [u, v] in [9, 19, 29].into_iter().filter_map(|step: usize| places[step]) {
        let _ = write!(svg, "<circle cx=\"{u:.1}\" cy=\"{v:.1}\" r=\"5\" fill=\"{PLANNED}\"/>");
    }
    svg + "\n"
}

/// Planned speed over 3 s, with a standard deviation on both sides, in the upper right corner.
fn chart(mode: &Mode, speed_mps: f32, [width, _]: [f64; 2]) -> String {
    let [chart_w, chart_h] = CHART;
    let (left, top) = (width - chart_w - 6.0, 6.0);
    let x = |step: usize| left + chart_w * step as f64 / FUTURE_STEPS as f64;
    let y = |mps: f64| top + chart_h * (1.0 - (mps / CHART_MPS).clamp(0.0, 1.0));
    let line = |values: Vec<(usize, f64)>| {
        let points = values.iter().map(|(step, mps)| format!("{:.1},{:.1}", x(*step), y(*mps)));
        points.collect::<Vec<_>>().join(" ")
    };
    let speeds = mode.speed_mps.iter().enumerate().map(|(i, mps)| (i + 1, f64::from(*mps)));
    let mean: Vec<_> = [(0, f64::from(speed_mps))].into_iter().chain(speeds).collect();
    let mut svg = format!(
        "<rect x=\"{left}\" y=\"{top}\" width=\"{chart_w}\" height=\"{chart_h}\" fill=\"#000000\" \
         fill-opacity=\"0.5\"/>"
    );
    if let Some(std) = &mode.std {
        let side = |sign: f64| {
            let of = move |((step, mps), std): (&(usize, f64), &f32)| {
                (*step, mps + sign * f64::from(*std))
            };
            mean[1..].iter().zip(&std.speed_mps).map(of).collect::<Vec<_>>()
        };
        let band = side(1.0).into_iter().chain(side(-1.0).into_iter().rev()).collect();
        let _ = write!(
            svg,
            "<polygon points=\"{}\" fill=\"{PLANNED}\" fill-opacity=\"0.4\"/>",
            line(band)
        );
    }
    let _ = writeln!(
        svg,
        "<polyline points=\"{}\" fill=\"none\" stroke=\"{DRIVEN}\" stroke-width=\"2\"/>\
         <text x=\"{}\" y=\"{}\" fill=\"#ffffff\" font-size=\"10\">0 ... {:.0} km/h in 3 s</text>",
        line(mean),
        left + 3.0,
        top + 11.0,
        CHART_MPS * 3.6
    );
    svg
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}
