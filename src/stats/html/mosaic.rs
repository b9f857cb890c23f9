//! Moments under every sky, with lidar height and radar speed over the camera: the paper's figures
//! 1 and 3.

use crate::{
    chart::palette::{diverging, escaped, sequential},
    digits::fixed,
    page::tags::{paragraph, section},
    stats::{
        html::view::{self, HEIGHTS_M, SPEEDS_MPS},
        moments::Moment,
    },
};

/// Layers of a picture that a reader can switch, without a script: class and words.
const LAYERS: [(&str, &str); 3] = [
    ("lidar", "lidar, by height"),
    ("radar", "radar, by speed"),
    ("way", "route and 3 s of driving (orange)"),
];

/// Style of the switches: a layer is hidden where its box is not ticked.
pub fn style() -> String {
    let hidden = LAYERS.map(|(class, _)| {
        format!("#show-{class}:not(:checked) ~ .mosaic .{class} {{ display: none; }}\n")
    });
    hidden.concat()
}

/// All moments, with boxes to switch layers.
pub fn mosaic(moments: &[Moment]) -> String {
    if moments.is_empty() {
        return String::new();
    }
    let switches: String = LAYERS
        .iter()
        .map(|(class, words)| {
            format!(
                "<input type=\"checkbox\" id=\"show-{class}\" checked><label for=\"show-{class}\">{words}</label>\n"
            )
        })
        .collect();
    let figures: String = moments.iter().map(figure).collect();
    let about = paragraph(
        "From each sky one frame in the densest traffic, where most radar returns are. Radar speeds are \
         relative to the car: what stands comes nearer as fast as the car drives.",
    );
    let body = format!("{about}{switches}{}<div class=\"mosaic\">\n{figures}</div>\n", scales());
    section("What the car senses", &body)
}

fn figure(moment: &Moment) -> String {
    let layers = view::picture(moment)
        + &view::lidar(moment, view::height_m, HEIGHTS_M)
        + &view::radar(moment)
        + &view::way(moment);
    let words = words(moment);
    format!(
        "<figure>{}<figcaption>{}</figcaption></figure>\n",
        view::framed(moment, &words, &layers),
        escaped(&words)
    )
}

/// Where, what sky, which frame, and what the car does.
pub fn words(moment: &Moment) -> String {
    let conditions = &moment.conditions;
    let known =
        [&conditions.town, &conditions.illumination, &conditions.weather, &conditions.traffic];
    let mut words: Vec<String> = known.into_iter().flatten().cloned().collect();
    let frame = &moment.frame;
    let [vx, vy] = frame.velocity_mps;
    words.push(format!("{} frame {}", moment.episode, frame.index));
    words.push(format!("{:.0} km/h", vx.hypot(vy) * 3.6));
    words.push(format!("command {}", frame.command.name()));
    let action = frame.action;
    let pedals = [("steer", action.steer), ("throttle", action.throttle), ("brake", action.brake)];
    words.extend(
        pedals
            .iter()
            .filter_map(|(name, x)| x.map(|x| format!("{name} {}", fixed(f64::from(x), 2)))),
    );
    words.join(", ")
}

/// Bars of colours with what their ends mean.
fn scales() -> String {
    let bar = |colour: fn(f64) -> String, [low, high]: [f64; 2], words: &str| {
        let colours: Vec<String> = (0..=8).map(|i| colour(f64::from(i) / 8.0)).collect();
        format!(
            "<span class=\"scale\">{low} <span style=\"background:linear-gradient(to right, {})\"></span> {high} {words}</span>",
            colours.join(", ")
        )
    };
    format!(
        "<p>{} {}</p>\n",
        bar(sequential, HEIGHTS_M, "m above the camera"),
        bar(diverging, SPEEDS_MPS, "m/s relative to the car")
    )
}
