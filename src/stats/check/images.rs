//! Pictures of the frames that are looked at.

use std::collections::BTreeMap;

use crate::{
    dataset::picture::{jpeg, jpeg_header::Header, rgb::Rgb},
    stats::check::{
        finding::{Check, Count, Finding, Hits, Level, Needs, percent},
        glimpse::Sight,
    },
};

pub static UNDECODABLE: Check = Check {
    code: "I01",
    name: "image-undecodable",
    level: Level::Error,
    needs: Needs::Frames,
    what: "a picture cannot be decoded",
    why: "a training stops at the frame, perhaps after hours",
    remedy: "ingest the log again; if the file's checksum holds, the log has the damage: leave the frame out",
};

pub static SIZE: Check = Check {
    code: "I02",
    name: "image-size",
    level: Level::Error,
    needs: Needs::Frames,
    what: "a picture has another size than the dataset's camera rule says",
    why: "lidar and radar pixels are counted in the rule's width: on another size they fall elsewhere",
    remedy: "ingest the log again; do not scale stored pictures by themselves",
};

/// Of 255: brighter than a sensor's black, darker than anything that headlights show.
const BLACK: f64 = 12.0;

pub static BLACK_PICTURE: Check = Check {
    code: "I03",
    name: "image-black",
    level: Level::Warning,
    needs: Needs::Frames,
    what: "99 of 100 pixels of a picture are darker than 12 of 255",
    why: "there is nothing to see: the policy learns to drive by the route alone",
    remedy: "leave the stretch out; look at the exposure, a cover, or a camera that started late",
};

/// Of 255: only the sky, looked into.
const WHITE: f64 = 243.0;

pub static WHITE_PICTURE: Check = Check {
    code: "I04",
    name: "image-white",
    level: Level::Warning,
    needs: Needs::Frames,
    what: "99 of 100 pixels of a picture are brighter than 243 of 255",
    why: "there is nothing to see: the policy learns to drive by the route alone",
    remedy: "leave the stretch out; look at the exposure",
};

/// Faster than this two pictures a tenth of a second apart differ by their noise alone, m/s.
const MOVING_MPS: f32 = 1.0;

pub static FROZEN_PICTURE: Check = Check {
    code: "I05",
    name: "image-frozen",
    level: Level::Error,
    needs: Needs::Frames,
    what: "a picture is that of the next frame, to the byte, while the car moves faster than 1 m/s",
    why: "the camera hung: what is seen and what is done are of different moments",
    remedy: "leave the stretch out; look whether the camera's driver repeats its last picture",
};

/// Variance of the Laplacian over that of the picture. 46 simulated pictures by day and night, dry and
/// wet, have 0.14 to 1.05; the same under a Gaussian blur of 4 pixels at most 0.0012.
const BLURRED: f64 = 0.004;

pub static BLURRED_PICTURE: Check = Check {
    code: "I06",
    name: "image-blurred",
    level: Level::Warning,
    needs: Needs::Frames,
    what: "more than half of an episode's pictures that were looked at have no edges (variance of the Laplacian below 0.4 % of the picture's variance)",
    why: "lanes, cars and people of a few pixels are gone",
    remedy: "look at focus, drops on the lens, and upscaling of a smaller picture",
};

/// Shades of 255: less than noise and vignette leave.
const FLAT: f64 = 3.0;

pub static FLAT_PICTURE: Check = Check {
    code: "I07",
    name: "image-flat",
    level: Level::Warning,
    needs: Needs::Frames,
    what: "a picture that is neither black nor white has one shade all over (standard deviation below 3 of 255)",
    why: "something covers the lens, or the decoder gave grey",
    remedy: "leave the stretch out; a grey picture is often a video that began without a key frame",
};

pub static ALL: [&Check; 7] = [
    &UNDECODABLE,
    &SIZE,
    &BLACK_PICTURE,
    &WHITE_PICTURE,
    &FROZEN_PICTURE,
    &BLURRED_PICTURE,
    &FLAT_PICTURE,
];

/// What was seen of one picture.
pub struct Look {
    episode: usize,
    frame: u32,
    picture: Result<Shades, String>,
    size: (usize, usize),
    hangs: bool,
}

/// The luma of a picture, of 255.
struct Shades {
    width: usize,
    height: usize,
    /// 1 of 100 is darker, 1 of 100 is brighter.
    dark: f64,
    bright: f64,
    deviation: f64,
    /// Variance of the Laplacian over the variance.
    sharpness: f64,
}

/// Decode and measure the picture of a frame.
pub fn look(sight: &Sight) -> Look {
    let header = Header::read(&sight.image);
    let picture = header.and_then(|_| jpeg::decode(&sight.image)).map(|rgb| Shades::of(&rgb));
    Look {
        episode: sight.episode,
        frame: sight.frame,
        picture,
        size: sight.size,
        hangs: sight.is_same_as_next == Some(true) && sight.forward_mps.abs() > MOVING_MPS,
    }
}

impl Shades {
    fn of(rgb: &Rgb) -> Shades {
        let Rgb { width, height, ref data } = *rgb;
        // ITU-R BT.601.
        let luma: Vec<f32> = data
            .chunks_exact(3)
            .map(|p| 0.299 * f32::from(p[0]) + 0.587 * f32::from(p[1]) + 0.114 * f32::from(p[2]))
            .collect();
        let mut shades = [0_u32; 256];
        luma.iter().for_each(|shade| shades[*shade as usize] += 1);
        let quantile = |share: f64| {
            let mut left = (share * luma.len() as f64) as u32;
            let at = shades.iter().position(|count| {
                let is_here = left < *count;
                left = left.saturating_sub(*count);
                is_here
            });
            at.unwrap_or(255) as f64
        };
        let variance = variance(luma.iter().copied());
        let inner = (1..height.saturating_sub(1)).flat_map(|y| {
            let luma = &luma;
            (1..width.saturating_sub(1)).map(move |x| {
                let at = y * width + x;
                luma[at - 1] + luma[at + 1] + luma[at - width] + luma[at + width] - 4.0 * luma[at]
            })
        });
        Shades {
            width,
            height,
            dark: quantile(0.01),
            bright: quantile(0.99),
            deviation: variance.sqrt(),
            sharpness: self::variance(inner) / variance.max(1e-9),
        }
    }

    fn is_black(&self) -> bool {
        self.bright < BLACK
    }

    fn is_white(&self) -> bool {
        self.dark > WHITE
    }

    fn is_flat(&self) -> bool {
        self.deviation < FLAT && !self.is_black() && !self.is_white()
    }

    /// Whether there is anything that could be sharp.
    fn shows(&self) -> bool {
        !self.is_black() && !self.is_white() && !self.is_flat()
    }
}

fn variance(values: impl Iterator<Item = f32>) -> f64 {
    let (mut n, mut sum, mut squares) = (0.0, 0.0, 0.0);
    for value in values.map(f64::from) {
        n += 1.0;
        sum += value;
        squares += value * value;
    }
    if n > 0.0 { (squares / n - (sum / n) * (sum / n)).max(0.0) } else { 0.0 }
}

/// What the looks say; `episodes` are the ids of the manifest's.
pub fn judge(looks: &[Look], episodes: &[&str]) -> Vec<Finding> {
    let mut by_episode: BTreeMap<usize, Vec<&Look>> = BTreeMap::new();
    looks.iter().for_each(|look| by_episode.entry(look.episode).or_default().push(look));
    let mut findings = Vec::new();
    for (episode, looks) in by_episode {
        let id = episodes[episode];
        let seen = looks.len() as u64;
        let mut add =
            |check: &'static Check, hits: Option<Hits>, sentence: &dyn Fn(&Hits) -> String| {
                if let Some(hits) = hits {
                    findings.push(check.found(hits.of_episode(id), hits.worst, sentence(&hits)));
                }
            };
        let of = |count: u64| format!("{count} of {}", Count(seen, "picture"));
        let broken =
            looks.iter().filter_map(|look| Some((look.frame, look.picture.as_ref().err()?)));
        let broken: Vec<_> = broken.collect();
        let example = broken.first().map_or("", |(_, why)| why.as_str());
        let hits = Hits::of(broken.iter().map(|(frame, _)| (*frame, 1.0)));
        add(&UNDECODABLE, hits, &|hits| format!("{} cannot be decoded: {example}", of(hits.count)));

        let shades: Vec<(&Look, &Shades)> =
            looks.iter().filter_map(|look| Some((*look, look.picture.as_ref().ok()?))).collect();
        let those = |is: &dyn Fn(&Look, &Shades) -> Option<f64>| {
            let hits = shades.iter().filter_map(|(look, s)| Some((look.frame, is(look, s)?)));
            Hits::of(hits)
        };
        let wrong =
            |look: &Look, s: &Shades| ((s.width, s.height) != look.size).then_some(s.width as f64);
        let example = shades.iter().find(|(look, s)| wrong(look, s).is_some());
        let example = example.map_or_else(String::new, |(look, s)| {
            format!("{} x {}, not {} x {}", s.width, s.height, look.size.0, look.size.1)
        });
        add(&SIZE, those(&wrong), &|hits| format!("{}: {example}", of(hits.count)));
        let black = those(&|_, s| s.is_black().then_some(s.bright));
        add(&BLACK_PICTURE, black, &|hits| format!("{} are black", of(hits.count)));
        let white = those(&|_, s| s.is_white().then_some(s.dark));
        add(&WHITE_PICTURE, white, &|hits| format!("{} are white", of(hits.count)));
        let flat = those(&|_, s| s.is_flat().then_some(s.deviation));
        add(&FLAT_PICTURE, flat, &|hits| format!("{} have one shade all over", of(hits.count)));
        let hang = Hits::of(looks.iter().filter(|look| look.hangs).map(|look| (look.frame, 1.0)));
        add(&FROZEN_PICTURE, hang, &|hits| {
            format!("{} are those of the next frame", of(hits.count))
        });
        let showing = shades.iter().filter(|(_, s)| s.shows()).count() as f64;
        let blurred = those(&|_, s| (s.shows() && s.sharpness < BLURRED).then_some(s.sharpness));
        let blurred = blurred.filter(|hits| hits.count as f64 > showing / 2.0);
        add(&BLURRED_PICTURE, blurred, &|hits| {
            let most = percent(hits.worst);
            format!("{} have no edges: at most {most} of the variance", of(hits.count))
        });
    }
    findings
}
