//! Small OpenDRIVE maps, written out.

use std::path::PathBuf;

use pmp::{error::Result, map::road_map::RoadMap};
use tempfile::{TempDir, tempdir};

/// A map file that lasts as long as this does.
pub(crate) struct MapFile {
    _folder: TempDir,
    pub(crate) path: PathBuf,
}

impl MapFile {
    pub(crate) fn new(text: &str) -> Self {
        let folder = tempdir().unwrap();
        let path = folder.path().join("map.xodr");
        std::fs::write(&path, text).unwrap();
        MapFile { _folder: folder, path }
    }

    pub(crate) fn read(&self) -> Result<RoadMap> {
        RoadMap::read(&self.path)
    }
}

/// A whole file around roads and junctions.
pub(crate) fn opendrive(body: &str) -> String {
    format!(
        "<?xml version=\"1.0\"?>\n<OpenDRIVE>\n<header revMajor=\"1\" revMinor=\"4\"/>\n{body}\n</OpenDRIVE>\n"
    )
}

/// A straight road along x.
pub(crate) struct StraightRoad<'a> {
    pub(crate) id: &'a str,
    pub(crate) x_m: f64,
    pub(crate) length_m: f64,
    /// More attributes of the road.
    pub(crate) attributes: &'a str,
    pub(crate) link: &'a str,
    /// Lane offsets and sections.
    pub(crate) lanes: &'a str,
}

impl StraightRoad<'_> {
    pub(crate) fn xml(&self) -> String {
        let StraightRoad { id, x_m, length_m, attributes, link, lanes } = self;
        let junction = if attributes.contains("junction=") { "" } else { "junction=\"-1\"" };
        format!(
            "<road id=\"{id}\" length=\"{length_m}\" {junction} {attributes}>\n<link>{link}</link>\n\
             <planView><geometry s=\"0\" x=\"{x_m}\" y=\"0\" hdg=\"0\" length=\"{length_m}\"><line/></geometry></planView>\n\
             <lanes>{lanes}</lanes>\n</road>\n"
        )
    }
}

/// A section with driving lanes of 3.5 m; each is an id and the ids before and after it.
pub(crate) fn section(s_m: f64, lanes: &[(i32, Option<i32>, Option<i32>)]) -> String {
    let lane = |(id, before, after): &(i32, Option<i32>, Option<i32>)| {
        let link = |name: &str, id: &Option<i32>| {
            id.map_or(String::new(), |id| format!("<{name} id=\"{id}\"/>"))
        };
        let (before, after) = (link("predecessor", before), link("successor", after));
        format!(
            "<lane id=\"{id}\" type=\"driving\"><link>{before}{after}</link>\
             <width sOffset=\"0\" a=\"3.5\" b=\"0\" c=\"0\" d=\"0\"/>\
             <roadMark sOffset=\"0\" type=\"broken\" laneChange=\"both\"/></lane>"
        )
    };
    let side = |name: &str, wanted: i32| {
        let lanes: String = lanes.iter().filter(|l| l.0.signum() == wanted).map(lane).collect();
        if lanes.is_empty() { lanes } else { format!("<{name}>{lanes}</{name}>") }
    };
    let centre = "<center><lane id=\"0\" type=\"none\"/></center>";
    format!(
        "<laneSection s=\"{s_m}\">{}{centre}{}</laneSection>\n",
        side("left", 1),
        side("right", -1)
    )
}
