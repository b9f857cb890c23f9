//! The page of a dataset: what it counts, what it shows, and how it looks in a browser.
#![allow(clippy::unwrap_used)]

use std::{
    fs,
    path::Path,
    process::{Command, Stdio},
};

use half::f16;
use pmp::{
    dataset::{
        picture::{jpeg, rgb::Rgb},
        split::Split,
    },
    frame::{Conditions, Frame, IMAGE_HEIGHT, IMAGE_WIDTH, LidarPixels, RadarPixels, Skew},
    stats::{html::page, moments::moments, query::summarise, survey::Survey},
};

use crate::{
    evaluation::accelerating,
    stats::{Drive, drive, pmp_stats, write},
};

/// A frame with a grey picture and so many radar returns.
fn seen(index: u32, speed_mps: f64, radar_returns: u32) -> Frame {
    let mut frame = accelerating(index, speed_mps, 0.0);
    let data = vec![96; 3 * IMAGE_WIDTH * IMAGE_HEIGHT];
    frame.image =
        jpeg::encode(&Rgb { width: IMAGE_WIDTH, height: IMAGE_HEIGHT, data }, 80).unwrap();
    frame.position_m = [f64::from(index) * speed_mps * 0.1, 5.0, 0.0];
    let columns = 0..radar_returns;
    frame.radar = Some(RadarPixels {
        pixel: columns.clone().map(|i| 100 * IMAGE_WIDTH as u32 + i).collect(),
        speed_mps: Some(columns.map(|_| f16::from_f32(-3.0)).collect()),
    });
    frame.lidar = Some(LidarPixels {
        pixel: vec![0, 1, 90_000],
        x: [1.0, 1.0, 2.0].map(f16::from_f32).to_vec(),
        y: [-1.0, -1.0, 1.5].map(f16::from_f32).to_vec(),
        z: [9.0, 8.0, 4.0].map(f16::from_f32).to_vec(),
    });
    let skew_ns = Some(-50_000_000);
    frame.skew =
        Skew { image_ns: 0, lidar_ns: skew_ns, radar_ns: Some(20_000_000), control_ns: None };
    frame
}

fn conditions(words: [&str; 4]) -> Conditions {
    let [town, weather, illumination, traffic] = words.map(|word| Some(word.to_string()));
    Conditions { town, weather, illumination, traffic }
}

/// Two drives by day, of which the dense one is the second, and one at night with a gap of 3 ticks.
fn drives() -> Vec<Drive> {
    let rows = |ticks: &[u32], returns: &dyn Fn(u32) -> u32| -> Vec<Frame> {
        ticks.iter().map(|tick| seen(*tick, 8.0, returns(*tick))).collect()
    };
    let mut day = drive(Split::Train, rows(&[0, 1, 2], &|_| 9));
    day.conditions = conditions(["Town01", "clear", "daytime", "few"]);
    let mut dense = drive(Split::Train, rows(&[0, 1, 2, 3], &|tick| if tick == 2 { 7 } else { 1 }));
    dense.conditions = conditions(["Town02", "clear", "daytime", "dense"]);
    let mut night = drive(Split::Val, rows(&[0, 1, 5, 6], &|_| 2));
    night.conditions = conditions(["Town02", "rainy", "night", "empty"]);
    vec![day, dense, night]
}

#[test]
fn distributions_count_every_frame_once() {
    let root = tempfile::tempdir().unwrap();
    let mut frames: Vec<Frame> = (0..5).map(|i| accelerating(i, f64::from(i), 0.0)).collect();
    frames[0].action.steer = Some(-1.0);
    frames[1].action.steer = Some(1.0);
    frames[2].action.steer = None;
    frames[4].future.len = 12;
    let manifest = write(root.path(), &[drive(Split::Train, frames)], |_| ());
    let survey = Survey::of(root.path(), &manifest).unwrap();
    let of = |key: &str| survey.distributions.iter().find(|d| d.key == key).unwrap();
    // 0.25 twice, both ends once, and one frame without.
    let steer = of("steer");
    assert_eq!((steer.counts.iter().sum::<u64>(), steer.missing), (4, 1));
    assert_eq!((steer.counts[0], steer.counts[39], steer.counts[25]), (1, 1, 2));
    // 0 ... 4 m/s on an axis that ends at 4.
    let speed = of("speed");
    assert_eq!((speed.axis.low, speed.axis.high), (0.0, 4.0));
    let filled: Vec<usize> = (0..40).filter(|i| speed.counts[*i] > 0).collect();
    assert_eq!(filled, [0, 10, 20, 30, 39]);
    // 3 s at 0, 1, 2, 3 m/s; the last frame does not know so much.
    let way = of("way_3s");
    assert_eq!((way.counts.iter().sum::<u64>(), way.missing, way.axis.high), (4, 1, 10.0));
    assert_eq!((way.counts[0], way.counts[12], way.counts[24], way.counts[36]), (1, 1, 1, 1));
    // No frame has a pedal's brake.
    assert!(survey.distributions.iter().all(|d| d.key != "brake" && d.key != "lidar_skew"));
}

#[test]
fn drives_keep_their_ticks_and_places() {
    let root = tempfile::tempdir().unwrap();
    let manifest = write(root.path(), &drives(), |_| ());
    let survey = Survey::of(root.path(), &manifest).unwrap();
    let ticks: Vec<&[u32]> = survey.drives.iter().map(|drive| &drive.ticks[..]).collect();
    assert_eq!(ticks, [&[0, 1, 2][..], &[0, 1, 2, 3], &[0, 1, 5, 6]]);
    let [x_m, y_m] = survey.drives[2].places_m[2];
    assert!((x_m - 4.0).abs() < 1e-9 && y_m == 5.0, "{x_m} {y_m}");
}

#[test]
fn each_sky_is_shown_in_its_densest_traffic_where_most_returns_are() {
    let root = tempfile::tempdir().unwrap();
    let manifest = write(root.path(), &drives(), |_| ());
    let moments = moments(root.path(), &manifest).unwrap();
    let shown: Vec<(&str, u32)> =
        moments.iter().map(|moment| (moment.episode.as_str(), moment.frame.index)).collect();
    // By sky, then what is left, since there are so few.
    assert_eq!(shown, [("ep-1", 2), ("ep-2", 0), ("ep-0", 0)]);
}

#[test]
fn page_stands_alone_and_says_what_there_is() {
    let root = tempfile::tempdir().unwrap();
    write(root.path(), &drives(), |_| ());
    let page = page::page_of(root.path(), &summarise(root.path()).unwrap()).unwrap();
    assert!(!page.contains("<script") && !page.contains("NaN") && !page.contains("inf"));
    let outside = page.replace("http://www.w3.org/2000/svg", "");
    assert!(!outside.contains("http"), "nothing is fetched");
    assert_eq!(page.matches("data:image/jpeg;base64,").count(), 3 + 1);
    for words in [
        "3 ticks are missing inside 1 of 3 episodes",
        "3 of 72 occur",
        "Town02, daytime, clear, dense, ep-1 frame 2",
        "Town02, 2 drives",
        "What was left out",
    ] {
        assert!(page.contains(words), "{words}");
    }
    // The two lidar returns side by side are drawn once, as the nearer.
    let first = page.split("<g class=\"lidar\"").nth(1).unwrap();
    let first = &first[..first.find("</g>").unwrap()];
    assert_eq!(first.matches("h2").count(), 2);
}

#[test]
fn a_dataset_without_frames_or_conditions_has_a_page_too() {
    let root = tempfile::tempdir().unwrap();
    write(root.path(), &[], |_| ());
    let page = page::page_of(root.path(), &summarise(root.path()).unwrap()).unwrap();
    assert!(page.contains("How much there is") && !page.contains("What was driven under"));
    let root = tempfile::tempdir().unwrap();
    write(root.path(), &[drive(Split::Train, vec![seen(0, 3.0, 1), seen(1, 3.0, 1)])], |_| ());
    let page = page::page_of(root.path(), &summarise(root.path()).unwrap()).unwrap();
    assert!(page.contains(">unknown<") && page.contains(">0.mcap<"), "one map for each drive");
}

#[test]
fn page_is_written_once_and_never_over_another() {
    let root = tempfile::tempdir().unwrap();
    let data = root.path().join("data");
    fs::create_dir(&data).unwrap();
    write(&data, &drives(), |_| ());
    let (data, html) = (data.to_str().unwrap(), root.path().join("page.html"));
    let html = html.to_str().unwrap();
    let first = pmp_stats(&[data, "--html", html]);
    assert_eq!(first.status.code(), Some(0), "{}", String::from_utf8_lossy(&first.stderr));
    assert!(String::from_utf8_lossy(&first.stdout).contains("frames by"), "the screen as well");
    let page = fs::read(html).unwrap();
    let second = pmp_stats(&[data, "--html", html]);
    assert_eq!(second.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&second.stderr).contains("--force"));
    assert_eq!(pmp_stats(&[data, "--html", html, "--force"]).status.code(), Some(0));
    assert_eq!(fs::read(html).unwrap(), page, "the same dataset, the same bytes");
}

/// Browsers that draw without a window, by name.
const BROWSERS: [&str; 4] = ["chromium", "chromium-browser", "google-chrome", "chrome"];

/// A script that only this test adds to the page: what the browser made of it, as the page's title.
const MEASURE: &str = "<script>addEventListener('load', () => {
  const images = [...document.querySelectorAll('image')];
  const whole = Promise.all(images.map(image => { const i = new Image(); i.src = image.href.baseVal; return i.decode().then(() => i.naturalWidth); }));
  const flat = [...document.querySelectorAll('svg')].filter(svg => svg.getBoundingClientRect().width < 40).length;
  whole.then(widths => document.title = ['measured', document.documentElement.scrollWidth, innerWidth, widths.join('+'), flat].join(' '),
             error => document.title = 'measured ' + error);
});</script>";

/// The page as the browser left it.
fn dom(browser: &str, page: &Path, profile: &Path, width_px: u32) -> Option<String> {
    let output = Command::new(browser)
        .args(["--headless", "--no-sandbox", "--disable-gpu", "--virtual-time-budget=5000"])
        .arg(format!("--user-data-dir={}", profile.display()))
        .arg(format!("--window-size={width_px},900"))
        .args(["--dump-dom".into(), format!("file://{}", page.display())])
        .stderr(Stdio::null())
        .output()
        .ok()?;
    output.status.success().then(|| String::from_utf8_lossy(&output.stdout).into_owned())
}

#[test]
fn a_browser_shows_it_on_a_desk_and_on_a_phone() {
    let has = |name: &&&str| {
        Command::new(name).arg("--version").output().is_ok_and(|o| o.status.success())
    };
    let Some(browser) = BROWSERS.iter().find(has) else {
        println!("skipped: none of {BROWSERS:?} is installed");
        return;
    };
    let root = tempfile::tempdir().unwrap();
    let data = root.path().join("data");
    fs::create_dir(&data).unwrap();
    write(&data, &drives(), |_| ());
    let page = page::page_of(&data, &summarise(&data).unwrap()).unwrap();
    let path = root.path().join("page.html");
    fs::write(&path, page.replace("</body>", &format!("{MEASURE}</body>"))).unwrap();
    // A headless browser makes no window narrower than 500 px.
    for width_px in [1200, 500] {
        let dom = dom(browser, &path, &root.path().join("profile"), width_px)
            .expect("a browser that starts");
        let title = dom.split("<title>").nth(1).unwrap().split('<').next().unwrap();
        let words: Vec<&str> = title.split(' ').collect();
        assert_eq!(words[0], "measured", "{title}");
        let [content_px, window_px] = [words[1], words[2]].map(|px| px.parse::<u32>().unwrap());
        assert!(content_px <= window_px, "{title}: the page is wider than the window");
        assert_eq!(words[3], "600+600+600+600", "every picture is decoded");
        assert_eq!(words[4], "0", "{title}: a drawing without a size");
    }
}
