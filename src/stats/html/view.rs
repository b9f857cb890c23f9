//! One moment: the picture, and on it what lidar and radar saw, as an SVG.

use std::{collections::BTreeMap, fmt::Write as _};

use base64::{Engine as _, engine::general_purpose::STANDARD};

use crate::{
    chart::palette::{diverging, escaped, sequential},
    frame::{Frame, LidarPixels},
    stats::moments::Moment,
};

/// Heights relative to the camera and radial speeds between which colours change, m and m/s.
pub const HEIGHTS_M: [f64; 2] = [-2.0, 2.0];
pub const SPEEDS_MPS: [f64; 2] = [-15.0, 15.0];

/// Lidar returns are drawn as squares of so many pixels, the nearest return in each; colours come in
/// so many steps.
const CELL_PX: usize = 2;
const STEPS: usize = 16;

/// Radius of a radar return, px.
const RADAR_PX: f64 = 5.0;

/// The way ahead from above, in the lower right corner: side in px, and the metres ahead of the car
/// that it shows.
const INSET_PX: f64 = 84.0;
const INSET_M: f64 = 54.0;

/// What of a lidar return is a colour.
pub type Channel = fn([f64; 3]) -> f64;

/// An SVG of the size of the picture around layers.
pub fn framed(moment: &Moment, label: &str, layers: &str) -> String {
    let (width, height) = (moment.width, moment.height);
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" role=\"img\" \
         aria-label=\"{}\">\n{layers}</svg>\n",
        escaped(label)
    )
}

/// The stored JPEG itself.
pub fn picture(moment: &Moment) -> String {
    format!(
        "<image href=\"data:image/jpeg;base64,{}\" width=\"{}\" height=\"{}\"/>\n",
        STANDARD.encode(&moment.frame.image),
        moment.width,
        moment.height
    )
}

/// Black, to draw returns on.
pub fn black(moment: &Moment) -> String {
    format!("<rect width=\"{}\" height=\"{}\" fill=\"#000000\"/>\n", moment.width, moment.height)
}

/// Lidar returns by height: up is minus y in the camera's frame.
pub fn height_m([_, y_m, _]: [f64; 3]) -> f64 {
    -y_m
}

/// Lidar returns, coloured by a channel between two values.
pub fn lidar(moment: &Moment, channel: Channel, [low, high]: [f64; 2]) -> String {
    let Some(lidar) = &moment.frame.lidar else { return String::new() };
    let mut by_colour: BTreeMap<usize, Vec<[usize; 2]>> = BTreeMap::new();
    for ([column, row], point_m) in nearest(lidar, moment.width) {
        let share = ((channel(point_m) - low) / (high - low)).clamp(0.0, 1.0);
        let step = (share * (STEPS - 1) as f64).round() as usize;
        by_colour.entry(step).or_default().push([column * CELL_PX, row * CELL_PX]);
    }
    let mut svg = String::from("<g class=\"lidar\" fill=\"none\" stroke-width=\"2\">\n");
    for (step, places) in by_colour {
        let colour = sequential(step as f64 / (STEPS - 1) as f64);
        let _ = write!(svg, "<path stroke=\"{colour}\" d=\"");
        let mut from = [0_i64; 2];
        for place in places {
            let [x, y] = place.map(|px| px as i64);
            let _ = write!(svg, "m{} {}h{CELL_PX}", x - from[0], y - from[1]);
            from = [x + CELL_PX as i64, y];
        }
        svg += "\"/>\n";
    }
    svg + "</g>\n"
}

/// The nearest return in each cell, by column and row of cells.
fn nearest(lidar: &LidarPixels, width: usize) -> Vec<([usize; 2], [f64; 3])> {
    let mut cells: BTreeMap<[usize; 2], [f64; 3]> = BTreeMap::new();
    for (i, pixel) in lidar.pixel.iter().enumerate() {
        let pixel = *pixel as usize;
        let cell = [pixel / width / CELL_PX, pixel % width / CELL_PX];
        let point_m = [lidar.x[i], lidar.y[i], lidar.z[i]].map(f64::from);
        let kept_m = cells.entry(cell).or_insert(point_m);
        if point_m[2] < kept_m[2] {
            *kept_m = point_m;
        }
    }
    cells.into_iter().map(|([row, column], point_m)| ([column, row], point_m)).collect()
}

/// Radar returns by speed, what comes nearer in red; grey where the radar measures none.
pub fn radar(moment: &Moment) -> String {
    let Some(radar) = &moment.frame.radar else { return String::new() };
    let mut svg = String::from("<g class=\"radar\" stroke=\"#000000\" stroke-opacity=\"0.6\">\n");
    for (i, pixel) in radar.pixel.iter().enumerate() {
        let (x, y) = (*pixel as usize % moment.width, *pixel as usize / moment.width);
        let speed_mps = radar.speed_mps.as_ref().map(|speeds| f64::from(speeds[i]));
        let colour = speed_mps.map_or("#808080".to_string(), |speed_mps| {
            diverging((speed_mps - SPEEDS_MPS[0]) / (SPEEDS_MPS[1] - SPEEDS_MPS[0]))
        });
        let _ = writeln!(svg, "<circle cx=\"{x}\" cy=\"{y}\" r=\"{RADAR_PX}\" fill=\"{colour}\"/>");
    }
    svg + "</g>\n"
}

/// From above, the car at the bottom: the route in white, where the car went within 3 s in orange.
pub fn way(moment: &Moment) -> String {
    let Frame { route, future, .. } = &moment.frame;
    let (left, top) = (moment.width as f64 - INSET_PX - 6.0, moment.height as f64 - INSET_PX - 6.0);
    let px = |xy_m: &[f32]| {
        let [ahead, aside] = [xy_m[0], xy_m[1]].map(|m| f64::from(m) / INSET_M);
        let x = left + INSET_PX * (0.5 - aside);
        let y = top + INSET_PX * (0.96 - 0.94 * ahead);
        format!("{:.1},{:.1}", x.clamp(left, left + INSET_PX), y.clamp(top, top + INSET_PX))
    };
    let line = |points: Vec<String>, colour: &str, width: f64| {
        format!(
            "<polyline points=\"{}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"{width}\"/>",
            points.join(" ")
        )
    };
    let waypoints = route.waypoints_m.chunks_exact(2).take(usize::from(route.len)).step_by(4);
    let went = future.xy_m.chunks_exact(2).take(usize::from(future.len));
    let went: Vec<String> = std::iter::once(px(&[0.0, 0.0])).chain(went.map(px)).collect();
    format!(
        "<g class=\"way\"><rect x=\"{left}\" y=\"{top}\" width=\"{INSET_PX}\" height=\"{INSET_PX}\" \
         fill=\"#000000\" fill-opacity=\"0.6\"/>{}{}</g>\n",
        line(waypoints.map(px).collect(), "#ffffff", 1.5),
        line(went, "#e69f00", 3.0)
    )
}
