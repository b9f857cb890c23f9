//! A moment as a network gets it: the camera, and each channel of the ralidar image (the paper's
//! figure 4).

use crate::{
    page::tags::{paragraph, section},
    stats::{
        html::{
            mosaic::words,
            view::{self, HEIGHTS_M, SPEEDS_MPS},
        },
        moments::Moment,
    },
};

/// Ends of the colours of x and z, m.
const ASIDE_M: [f64; 2] = [-12.0, 12.0];
const AHEAD_M: [f64; 2] = [0.0, 50.0];

/// The moment with most returns.
pub fn channels(moments: &[Moment]) -> String {
    let returns = |moment: &&Moment| {
        let lidar = moment.frame.lidar.as_ref().map_or(0, |lidar| lidar.pixel.len());
        let radar = moment.frame.radar.as_ref().map_or(0, |radar| radar.pixel.len());
        (lidar > 0 && radar > 0, radar, lidar)
    };
    let with_any = moments.iter().filter(|m| m.frame.lidar.is_some() || m.frame.radar.is_some());
    let Some(moment) = with_any.max_by_key(returns) else { return String::new() };
    let dark = view::black(moment);
    let lidar = |channel, ends| dark.clone() + &view::lidar(moment, channel, ends);
    let between =
        |words: &str, unit: &str, [low, high]: [f64; 2]| format!("{words}, {low} to {high} {unit}");
    let panels = [
        ("camera".to_string(), view::picture(moment)),
        (between("x (right)", "m", ASIDE_M), lidar(|[x, _, _]| x, ASIDE_M)),
        (between("height (minus y)", "m", HEIGHTS_M), lidar(view::height_m, HEIGHTS_M)),
        (between("z (ahead)", "m", AHEAD_M), lidar(|[_, _, z]| z, AHEAD_M)),
        (between("relative speed", "m/s", SPEEDS_MPS), dark.clone() + &view::radar(moment)),
    ];
    let figures: String = panels
        .iter()
        .map(|(name, layers)| {
            let svg = view::framed(moment, name, layers);
            format!("<figure>{svg}<figcaption>{name}</figcaption></figure>\n")
        })
        .collect();
    let about = paragraph(&format!(
        "{}. The nearest return of each pixel, in the camera's frame.",
        words(moment)
    ));
    section("What a network gets", &format!("{about}<div class=\"mosaic\">\n{figures}</div>\n"))
}
