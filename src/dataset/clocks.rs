//! The streams of a drive held against each other in time: what was assumed about their clocks,
//! and a refusal where they do not belong together.
//!
//! Stamps of two clocks that do not overlap are not aligned by guessing: the error names both
//! ranges, and the profile's `[clock]` or a flag says what is right.

use crate::{
    dataset::ego::EgoTrack,
    error::Result,
    log::{
        clock::{Clock, range_text},
        mapping::{Mapping, PoseSource},
        profile::{Profile, Required},
        recording::{Recording, Topic, mapping_error},
        signals::Kind,
    },
};

/// Delays between stamp and log time that differ by more than this are told.
const TOLD_DELAY_NS: i64 = 1_000_000_000;

/// Beyond this a stamp and its log time are of different clocks altogether.
const SAME_CLOCK_NS: i64 = 86_400_000_000_000;

/// A stream by what it is used as.
struct Stream {
    signal: &'static str,
    topic: String,
    span_ns: (i64, i64),
    samples: usize,
}

impl Stream {
    fn of(recording: &Recording, signal: &'static str, topic: Option<&str>) -> Option<Stream> {
        let topic = recording.topics.get(topic?)?;
        let (span_ns, samples) = (topic.series.span_ns()?, topic.series.len());
        Some(Stream { signal, topic: topic.name.clone(), span_ns, samples })
    }

    fn overlaps(&self, (first_ns, last_ns): (i64, i64)) -> bool {
        self.span_ns.0 <= last_ns && self.span_ns.1 >= first_ns
    }
}

/// Refuse streams whose stamps do not overlap; returns, each in a sentence, those that are too
/// short to tell and lie outside the drive.
///
/// # Errors
///
/// [`Error::Mapping`](crate::error::Error::Mapping) with both ranges; also if a signal that the
/// profile requires is not in the log.
pub fn check_overlap(
    recording: &Recording,
    mapping: &Mapping,
    required: &Required,
    track: &EgoTrack,
) -> Result<Vec<String>> {
    let stream = |signal, topic: &Option<String>| Stream::of(recording, signal, topic.as_deref());
    let others = [
        (stream("lidar", &mapping.lidar), "lidar", required.lidar),
        (stream("radar", &mapping.radar), "radar", required.radar),
        (stream("control", &mapping.control), "control", required.control),
    ];
    if let Some((_, signal, _)) =
        others.iter().find(|(found, _, needed)| *needed && found.is_none())
    {
        let hint = "set it to false in the profile's [required], and its columns will be null";
        let what = format!("no {signal}, which the profile requires,");
        return Err(mapping_error(&recording.log, what, hint));
    }
    if let Some(PoseSource::Integrated { speed, yaw_rate }) = &mapping.pose {
        let speed = Stream::of(recording, "speed", Some(speed));
        let yaw_rate = Stream::of(recording, "yaw rate", Some(yaw_rate));
        if let Some((speed, yaw_rate)) = speed.zip(yaw_rate)
            && !speed.overlaps(yaw_rate.span_ns)
        {
            return Err(apart(recording, &speed, &yaw_rate));
        }
    }
    let Some(camera) = stream("camera", &mapping.camera) else { return Ok(Vec::new()) };
    let Some(ego_span_ns) = track.span_ns() else { return Ok(Vec::new()) };
    let topic = match &mapping.pose {
        Some(PoseSource::Topic(topic)) => topic.clone(),
        Some(PoseSource::Transform(frame)) => format!("/tf of `{frame}`"),
        Some(PoseSource::Integrated { speed, .. }) => speed.clone(),
        Some(PoseSource::Gnss { fix, .. }) => fix.clone(),
        None => String::new(),
    };
    let samples = track.samples().len();
    let ego = Stream { signal: "ego pose", topic, span_ns: ego_span_ns, samples };
    if !camera.overlaps(ego.span_ns) {
        return Err(apart(recording, &camera, &ego));
    }
    let mut outside = Vec::new();
    for other in others.into_iter().filter_map(|(stream, ..)| stream) {
        match [&camera, &ego].into_iter().find(|stream| !other.overlaps(stream.span_ns)) {
            Some(_) if other.samples == 1 => outside.push(format!(
                "{} {}: its only sample lies outside the drive",
                other.signal, other.topic
            )),
            Some(stream) => return Err(apart(recording, stream, &other)),
            None => {}
        }
    }
    Ok(outside)
}

fn apart(recording: &Recording, a: &Stream, b: &Stream) -> crate::error::Error {
    let what = format!(
        "the stamps of the {} {} ({}) and the {} {} ({}) do not overlap",
        a.signal,
        a.topic,
        range_text(a.span_ns),
        b.signal,
        b.topic,
        range_text(b.span_ns)
    );
    let hint = format!(
        "if their clocks differ, move one by `--offset {topic}=SECONDSs`, or stamp it by another \
         instant with `--clock {topic}=log` (header, log or publish); to go without it, name it in \
         `ignore` of a profile's [topics]",
        topic = if b.topic.starts_with("/tf of") { "/tf" } else { &b.topic }
    );
    mapping_error(&recording.log, what, &hint)
}

/// What was assumed about the clocks of the topics in use, each in a sentence.
pub fn notes(recording: &Recording, mapping: &Mapping, profile: &Profile) -> Vec<String> {
    let rule = &profile.clock;
    let mut notes = Vec::new();
    for name in rule.named().filter(|name| !recording.log.has_topic(name)) {
        notes.push(format!("clock: {name} is named and not in this log"));
    }
    let in_use = |topic: &&Topic| {
        topic.messages > 0
            && (mapping.uses(&topic.name).is_some() || topic.kind == Kind::Transforms)
    };
    for topic in recording.topics.values().filter(in_use) {
        let name = &topic.name;
        let is_static = topic.kind == Kind::Transforms && name.ends_with("static");
        if topic.uses_log_time && !is_static {
            notes.push(format!(
                "clock: {name} has no header stamps, so log times stand in for them"
            ));
        }
        if topic.clock != Clock::Header {
            notes.push(format!("clock: {name} is stamped by its {} times", topic.clock.name()));
        }
        if let Some(offset_s) = rule.offset_s.get(name) {
            notes.push(format!("clock: {offset_s} s are added to the stamps of {name}"));
        }
    }
    notes.extend(unequal_delays(recording, mapping));
    notes
}

/// Topics that are stamped much earlier or later before their log times than the camera is.
fn unequal_delays(recording: &Recording, mapping: &Mapping) -> Vec<String> {
    let delay_ns = |topic: &Topic| topic.delay_ns().filter(|ns| ns.abs() < SAME_CLOCK_NS);
    let camera = mapping.camera.as_ref().and_then(|name| recording.topics.get(name));
    let Some((camera, camera_ns)) = camera.and_then(|topic| Some((topic, delay_ns(topic)?))) else {
        return Vec::new();
    };
    let tell = |topic: &Topic| {
        let apart_ns = delay_ns(topic)? - camera_ns;
        (apart_ns.abs() > TOLD_DELAY_NS).then(|| {
            format!(
                "clock: between stamp and log time lie {:.2} s for {} and {:.2} s for {}; if it is \
                 the clock that differs, `--offset {}={:.2}s` brings them together",
                (apart_ns + camera_ns) as f64 * 1e-9,
                topic.name,
                camera_ns as f64 * 1e-9,
                camera.name,
                topic.name,
                apart_ns as f64 * 1e-9
            )
        })
    };
    let in_use = |topic: &&Topic| mapping.uses(&topic.name).is_some();
    recording.topics.values().filter(in_use).filter_map(tell).collect()
}
