//! What each signal can be read from: by type, and in which order by name.

use crate::log::{
    recording::{Recording, Series, Topic},
    signals::{Kind, Pose},
    topics::{Names, Topics},
};

/// Frames that are the car's own, by the names that cars, simulators and converters give them.
pub const BASE_FRAMES: [&str; 8] = [
    "base_link",
    "ego_vehicle",
    "hero",
    "base_footprint",
    "vehicle",
    "ego",
    "base_link_frd",
    "base_link_ned",
];

/// Cloud fields that hold a radial speed.
pub const RADIAL_SPEED_FIELDS: [&str; 8] = [
    "velocity",
    "doppler",
    "doppler_velocity",
    "radial_velocity",
    "radial_speed",
    "range_rate",
    "vr",
    "v",
];

/// Cloud fields that hold a velocity relative to the sensor, of which the radial part counts.
pub const RELATIVE_VELOCITY_FIELDS: [&str; 2] = ["vx", "vy"];

/// A signal and the topics that can be it.
pub struct Candidate {
    /// As the command line names it.
    pub signal: &'static str,
    pub named: fn(&Topics) -> Option<&Names>,
    pub fits: fn(&Topic, &Recording) -> bool,
    /// The lowest is taken.
    pub rank: fn(&Topic) -> u32,
    /// Whether a choice among topics of equal rank is the user's.
    pub is_question: fn(&[&Topic]) -> bool,
}

pub const CAMERA: Candidate = Candidate {
    signal: "camera",
    named: |topics| topics.camera.as_ref(),
    fits: |topic, _| is_photograph(topic),
    // Of two forms of one camera's pictures, compressed ones cost less to read than raw ones; a
    // video comes last, since one lost packet takes others with it.
    rank: |topic| {
        let form = match topic.kind {
            Kind::CompressedVideo => 2,
            Kind::Image => 1,
            _ => 0,
        };
        3 * camera_rank(topic) + form
    },
    is_question: are_of_different_frames,
};

pub const CAMERA_INFO: Candidate = Candidate {
    signal: "camera_info",
    named: |topics| topics.camera_info.as_ref(),
    fits: |topic, _| topic.kind == Kind::CameraInfo,
    rank: |_| 0,
    is_question: |_| false,
};

pub const LIDAR: Candidate = Candidate {
    signal: "lidar",
    named: |topics| topics.lidar.as_ref(),
    fits: |topic, _| is_lidar(topic),
    rank: lidar_rank,
    is_question: are_of_different_frames,
};

pub const RADAR: Candidate = Candidate {
    signal: "radar",
    named: |topics| topics.radar.as_ref(),
    fits: |topic, _| is_radar(topic),
    rank: camera_rank,
    is_question: are_of_different_frames,
};

pub const ODOMETRY: Candidate = Candidate {
    signal: "odometry",
    named: |topics| topics.odometry.as_ref(),
    fits: |topic, _| topic.kind == Kind::Odometry,
    rank: |_| 0,
    is_question: |topics| topics.len() > 1,
};

pub const POSE: Candidate = Candidate {
    signal: "pose",
    named: |topics| topics.pose.as_ref(),
    fits: |topic, recording| {
        topic.kind == Kind::Pose && !is_own_frame_pose(topic, recording) && !is_goal(topic)
    },
    rank: |_| 0,
    is_question: |topics| topics.len() > 1,
};

pub const VELOCITY: Candidate = Candidate {
    signal: "velocity",
    named: |topics| topics.velocity.as_ref(),
    fits: |topic, _| matches!(topic.kind, Kind::Twist | Kind::CarlaStatus) && !is_command(topic),
    rank: |_| 0,
    is_question: |_| false,
};

/// An IMU, or a twist that turns at all.
pub const YAW_RATE: Candidate = Candidate {
    signal: "imu",
    named: |topics| topics.imu.as_ref(),
    fits: |topic, _| match &topic.series {
        Series::Imu(_) => true,
        Series::Twist(samples) => !is_command(topic) && samples.iter().any(|s| s.value.1.z != 0.0),
        _ => false,
    },
    rank: |topic| u32::from(topic.kind != Kind::Imu),
    is_question: |_| false,
};

pub const GNSS: Candidate = Candidate {
    signal: "gnss",
    named: |topics| topics.gnss.as_ref(),
    fits: |topic, _| topic.kind == Kind::Fix,
    rank: |_| 0,
    is_question: |_| false,
};

pub const CONTROL: Candidate = Candidate {
    signal: "control",
    named: |topics| topics.control.as_ref(),
    fits: |topic, _| {
        let steers = [Kind::CarlaControl, Kind::CarlaStatus, Kind::Ackermann, Kind::Steering];
        steers.contains(&topic.kind)
    },
    rank: |topic| match topic.kind {
        Kind::CarlaControl => 0,
        Kind::CarlaStatus => 1,
        Kind::Steering => 2,
        _ => 3,
    },
    is_question: |_| false,
};

pub const PEDALS: Candidate = Candidate {
    signal: "pedals",
    named: |topics| topics.pedals.as_ref(),
    fits: |topic, _| topic.kind == Kind::Actuation,
    rank: |_| 0,
    is_question: |_| false,
};

pub const ROUTE: Candidate = Candidate {
    signal: "route",
    named: |topics| topics.route.as_ref(),
    fits: |topic, _| topic.kind == Kind::Path,
    rank: |_| 0,
    is_question: |_| false,
};

pub const WEATHER: Candidate = Candidate {
    signal: "weather",
    named: |_| None,
    fits: |topic, _| topic.kind == Kind::Weather,
    rank: |_| 0,
    is_question: |_| false,
};

pub const TOWN: Candidate = Candidate {
    signal: "town",
    named: |_| None,
    fits: |topic, _| topic.kind == Kind::WorldInfo,
    rank: |_| 0,
    is_question: |_| false,
};

pub const SITUATION: Candidate = Candidate {
    signal: "situation",
    named: |_| None,
    fits: |topic, _| topic.kind == Kind::Situation,
    rank: |_| 0,
    is_question: |_| false,
};

/// A pose that is told in the frame that it is the pose of, sent so that a viewer draws a car: it
/// is in a frame of the car's name, or it stays the identity while `/tf` moves.
pub fn is_own_frame_pose(topic: &Topic, recording: &Recording) -> bool {
    let Series::Pose(samples) = &topic.series else { return false };
    let stays = || samples.iter().all(|sample| sample.value == Pose::IDENTITY);
    let tf_moves = || recording.transforms.moving().next().is_some();
    BASE_FRAMES.contains(&topic.frame_id.as_str()) || (stays() && tf_moves())
}

/// Two cameras, not two pictures of one.
fn are_of_different_frames(topics: &[&Topic]) -> bool {
    let unknown = topics.iter().any(|topic| topic.frame_id.is_empty());
    topics.len() > 1 && (unknown || topics.iter().any(|t| t.frame_id != topics[0].frame_id))
}

fn name_of(topic: &Topic) -> String {
    topic.name.to_ascii_lowercase()
}

fn is_photograph(topic: &Topic) -> bool {
    let name = name_of(topic);
    // Pictures that are no photographs: they have the type of a camera and not its content.
    let other = ["depth", "semantic", "segmentation", "instance", "optical_flow", "dvs"];
    matches!(topic.kind, Kind::CompressedImage | Kind::CompressedVideo | Kind::Image)
        && !other.iter().any(|word| name.contains(word))
}

/// Whether a cloud has one of these fields, upper or lower case.
fn has_field(topic: &Topic, names: &[&str]) -> bool {
    let is_one = |field: &String| names.iter().any(|name| field.eq_ignore_ascii_case(name));
    topic.cloud_fields.iter().any(is_one)
}

/// Whether a radar's clouds have no speed; scans and tracks always have one.
pub fn measures_no_speed(radar: &Topic) -> bool {
    let has_velocity = RELATIVE_VELOCITY_FIELDS.iter().all(|field| has_field(radar, &[field]));
    radar.kind == Kind::PointCloud && !has_field(radar, &RADIAL_SPEED_FIELDS) && !has_velocity
}

fn is_radar(topic: &Topic) -> bool {
    let name = name_of(topic);
    match topic.kind {
        Kind::RadarScan | Kind::RadarTracks => true,
        Kind::PointCloud => {
            let has_speed = has_field(topic, &RADIAL_SPEED_FIELDS);
            name.contains("radar") || (has_speed && !name.contains("lidar"))
        }
        _ => false,
    }
}

fn is_lidar(topic: &Topic) -> bool {
    // Points without a place (events of a camera) or without a distance of their own (labels).
    let is_other = !has_field(topic, &["z"]) || name_of(topic).contains("semantic");
    topic.kind == Kind::PointCloud && !is_radar(topic) && !is_other
}

fn is_goal(topic: &Topic) -> bool {
    // Goals and first guesses are poses that somebody wants or thinks of, not ones that the car had.
    ["goal", "initialpose", "initial_pose"].iter().any(|word| name_of(topic).contains(word))
}

/// A twist that says what was asked for, not what happened.
fn is_command(topic: &Topic) -> bool {
    let name = name_of(topic);
    topic.kind == Kind::Twist && ["cmd", "command", "target"].iter().any(|w| name.contains(w))
}

/// Whether a word of the name begins like one of these.
fn says(topic: &Topic, words: &[&str]) -> bool {
    let name = name_of(topic);
    let mut parts = name.split(|c: char| !c.is_ascii_alphanumeric());
    parts.any(|part| words.iter().any(|word| part.starts_with(word)))
}

/// What looks ahead before what does not say where it looks, that before the sides and the back.
fn camera_rank(topic: &Topic) -> u32 {
    let aside = says(topic, &["left", "right", "rear", "back", "side"]);
    match (says(topic, &["front"]), aside) {
        (true, false) => 0,
        (false, false) => 1,
        (true, true) => 2,
        (false, true) => 3,
    }
}

/// What sees all around before what sees a part.
fn lidar_rank(topic: &Topic) -> u32 {
    let name = name_of(topic);
    let all_around = name.split(|c: char| !c.is_ascii_alphanumeric()).any(|part| part == "top")
        || says(topic, &["roof", "concatenated", "merged", "combined", "fused"]);
    if all_around { 0 } else { 1 + camera_rank(topic) }
}
