//! A dataset in the hands of the readers of tables that people use: the same numbers in each.
#![allow(clippy::unwrap_used)]

use std::collections::BTreeMap;

use pmp::{
    dataset::{manifest::Manifest, split::Split},
    frame::Frame,
};
use serde_json::Value as Json;

use crate::{
    fixtures::DriveLog,
    ingest::{frames, into, text},
    lerobot::peer,
};

/// The numbers of a column, frame by frame.
type Pick = fn(&Frame) -> Vec<f64>;

fn floats(values: &[f32]) -> Vec<f64> {
    values.iter().map(|value| f64::from(*value)).collect()
}

const COLUMNS: [(&str, Pick); 16] = [
    ("lidar_pixel", |f| f.lidar.iter().flat_map(|l| &l.pixel).map(|p| f64::from(*p)).collect()),
    ("lidar_x", |f| f.lidar.iter().flat_map(|l| &l.x).map(|v| v.to_f64()).collect()),
    ("lidar_z", |f| f.lidar.iter().flat_map(|l| &l.z).map(|v| v.to_f64()).collect()),
    ("radar_pixel", |f| f.radar.iter().flat_map(|r| &r.pixel).map(|p| f64::from(*p)).collect()),
    ("radar_speed", |f| {
        f.radar.iter().flat_map(|r| r.speed_mps.iter().flatten()).map(|v| v.to_f64()).collect()
    }),
    ("velocity", |f| floats(&f.velocity_mps)),
    ("position", |f| f.position_m.to_vec()),
    ("route", |f| floats(&f.route.waypoints_m)),
    ("future_speed", |f| floats(&f.future.speed_mps)),
    ("future_xy", |f| floats(&f.future.xy_m)),
    ("yaw", |f| vec![f.yaw_rad]),
    ("steer", |f| f.action.steer.iter().map(|v| f64::from(*v)).collect()),
    ("future_len", |f| vec![f64::from(f.future.len)]),
    ("image_skew", |f| vec![f64::from(f.skew.image_ns)]),
    ("lidar_skew", |f| f.skew.lidar_ns.iter().map(|ns| f64::from(*ns)).collect()),
    ("speed_limit", |f| f.speed_limit_mps.iter().map(|v| f64::from(*v)).collect()),
];

#[track_caller]
fn near(what: &str, ours: f64, theirs: &Json) {
    let theirs = theirs.as_f64().unwrap();
    let tolerance = 1e-9 * ours.abs().max(1.0);
    assert!((ours - theirs).abs() <= tolerance, "{what}: {ours}, and the reader says {theirs}");
}

#[test]
fn every_reader_finds_our_numbers_with_one_glob() {
    let folder = tempfile::tempdir().unwrap();
    let mut logs = Vec::new();
    for i in 0..6 {
        let mut log =
            DriveLog { seconds: 1.0, speed_mps: 4.0 + f64::from(i), ..DriveLog::default() };
        // Columns with nulls: of whole drives, and of single frames.
        log.has_lidar = i % 2 == 0;
        log.has_control = i != 3;
        if i == 0 {
            let town = ("town".to_string(), "Town02".to_string());
            log.layout.conditions = BTreeMap::from([town]);
        }
        logs.push(log.write(folder.path(), &format!("{i}.mcap")));
    }
    let dataset = folder.path().join("data");
    let said = into(&dataset, &logs.iter().map(|log| log.as_path()).collect::<Vec<_>>());
    assert_eq!(said.code, 0, "{}", said.err);
    let sides: BTreeMap<String, Split> =
        Manifest::read(&dataset).unwrap().logs.into_iter().map(|l| (l.episode, l.split)).collect();
    let mut by_side: BTreeMap<&str, Vec<(String, Frame)>> = BTreeMap::new();
    for (episode, frame) in frames(&dataset) {
        by_side.entry(sides[&episode].name()).or_default().push((episode, frame));
    }
    assert_eq!(by_side.len(), 2, "both sides have frames");

    for reader in ["duckdb", "pyarrow", "pandas", "polars", "datasets"] {
        let packages = match reader {
            "duckdb" => "numpy, duckdb, pyarrow",
            other => &format!("numpy, {other}"),
        };
        let Some(found) = peer("tables.py", packages, &[reader, text(&dataset)]) else { continue };
        assert_eq!(found.as_object().unwrap().len(), 2, "{reader}: train and val");
        for (side, frames) in &by_side {
            let found = &found[side];
            let frames: Vec<&Frame> = frames.iter().map(|(_, frame)| frame).collect();
            assert_eq!(found["frames"], frames.len(), "{reader}");
            let image_bytes: usize = frames.iter().map(|frame| frame.image.len()).sum();
            assert_eq!(found["image_bytes"], image_bytes, "{reader}");
            for (place, frame) in frames.iter().enumerate() {
                assert_eq!(found["stamps"][place], frame.stamp_ns, "{reader}");
                assert_eq!(found["commands"][place], frame.command.name(), "{reader}");
                let town = frame.conditions.town.as_deref().map_or(Json::Null, Json::from);
                assert_eq!(found["towns"][place], town, "{reader}");
            }
            for (column, pick) in COLUMNS {
                let what = format!("{reader}, {column}");
                let values: Vec<f64> = frames.iter().flat_map(|frame| pick(frame)).collect();
                assert_eq!(found["lengths"][column], values.len(), "{what}");
                near(&what, values.iter().sum(), &found["sums"][column]);
                let moment = values.iter().enumerate().map(|(at, value)| at as f64 * value);
                near(&what, moment.sum(), &found["moments"][column]);
            }
        }
    }
}
