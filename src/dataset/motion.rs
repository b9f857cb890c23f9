//! The motion of the car, out of whatever the log has: poses brought to the car's frame and to a
//! world with z up, each with its velocity.

use glam::{DVec3, EulerRot};

use crate::{
    dataset::{
        base_frame::BaseFrame,
        dead_reckoning::{integrate, speeds},
        ego::{EgoState, EgoTrack},
        gnss, velocity,
        world::{UPSIDE_DOWN, WorldAxes},
    },
    error::Result,
    log::{
        conventions::{EgoRule, World},
        mapping::{Mapping, PoseSource},
        recording::{Recording, Series, Stamped, Topic, mapping_error},
        signals::Pose,
        transforms::TransformTree,
    },
};

/// How the car moves, and how the log's frames lie to it.
#[derive(Clone, Debug)]
pub struct Motion {
    pub track: EgoTrack,
    pub base: BaseFrame,
    axes: WorldAxes,
    /// The log's name of the world that poses are told in; `None` where it is made here.
    world_frame: Option<String>,
    /// What was assumed or found, for people.
    pub notes: Vec<String>,
}

/// Poses as the log tells them.
struct Told {
    poses: Vec<Stamped<Pose>>,
    world_frame: Option<String>,
    /// What they are the poses of.
    child_frame: Option<String>,
}

impl Motion {
    /// Read the motion from the chosen topics.
    ///
    /// # Errors
    ///
    /// [`Error::Mapping`](crate::error::Error::Mapping) if the log has no pose.
    pub fn new(
        recording: &Recording,
        mapping: &Mapping,
        rule: &EgoRule,
        tolerance_ns: i64,
    ) -> Result<Motion> {
        let Some(source) = &mapping.pose else {
            let hint = "frames need odometry, a pose topic, /tf of the vehicle, a speed and a yaw \
                        rate, or positions from satellites and an IMU; \
                        `pmp-ingest inspect LOG` shows what the log has";
            return Err(mapping_error(&recording.log, "no ego pose".into(), hint));
        };
        let (tree, topics) = (&recording.transforms, &recording.topics);
        let mut notes = Vec::new();
        let (poses, base, axes, world_frame) = match source {
            PoseSource::Topic(topic) => {
                let told = told_by_topic(&topics[topic]);
                brought(told, rule, tree, &mut notes)
            }
            PoseSource::Transform(frame) => {
                let told = told_by_transforms(frame, tree);
                brought(told, rule, tree, &mut notes)
            }
            PoseSource::Integrated { speed, yaw_rate } => {
                let (base, axes) = made_here(rule, &topics[yaw_rate], tree);
                let speeds = speeds(&topics[speed], &base, &axes, tree);
                let rates = gnss::yaw_rates(&topics[yaw_rate], &base, &axes, tree);
                (integrate(&speeds, &rates, 2 * tolerance_ns), base, axes, None)
            }
            PoseSource::Gnss { fix, heading, speed } => {
                let (base, axes) = made_here(rule, &topics[heading], tree);
                let sources = (&topics[fix], &topics[heading], speed.as_ref().map(|s| &topics[s]));
                let poses = by_satellites(sources, (&base, &axes), tree, &mut notes);
                let poses = poses.ok_or_else(|| {
                    let what = format!("no heading for the positions of {fix}");
                    let hint = format!(
                        "{heading} has no attitudes, and the car does not move far enough for a \
                         course over ground"
                    );
                    mapping_error(&recording.log, what, &hint)
                })?;
                (poses, base, axes, None)
            }
        };
        let mut motion = Motion { track: EgoTrack::default(), base, axes, world_frame, notes };
        let velocities = motion.velocities(recording, mapping, &poses, tolerance_ns);
        let state = |(pose, velocity_mps): (&Stamped<Pose>, [f64; 2])| {
            let position_m = pose.value.position_m;
            let yaw_rad = pose.value.rotation.to_euler(EulerRot::ZYX).0;
            let value = EgoState { position_m, yaw_rad, velocity_mps };
            Stamped { stamp_ns: pose.stamp_ns, value }
        };
        let samples = poses.iter().zip(velocities).map(state).collect();
        motion.track = EgoTrack::from_samples(samples, tolerance_ns);
        Ok(motion)
    }

    /// Planar velocity in the car's frame at every pose.
    fn velocities(
        &mut self,
        recording: &Recording,
        mapping: &Mapping,
        poses: &[Stamped<Pose>],
        tolerance_ns: i64,
    ) -> Vec<[f64; 2]> {
        if let Some(PoseSource::Topic(topic)) = &mapping.pose
            && let Series::Odometry(samples) = &recording.topics[topic].series
        {
            let moves = velocity::moves(poses);
            if let Some(own) = velocity::of_odometry(samples, &self.base, &self.axes, moves) {
                return own;
            }
            let note = format!("velocity: {topic} leaves its twist at zero while the car moves");
            self.notes.push(note);
        }
        let Some(topic) = mapping.velocity.as_ref().and_then(|name| recording.topics.get(name))
        else {
            self.notes.push("velocity: from the derivative of the pose".to_string());
            return velocity::derivative(poses);
        };
        self.notes.push(format!("velocity: from {}", topic.name));
        let frames = (&self.base, &self.axes);
        let world_frame = self.world_frame.as_deref();
        velocity::of_topic(topic, poses, world_frame, frames, &recording.transforms, tolerance_ns)
    }

    /// Points of a frame at an instant, in the world of the track.
    ///
    /// # Errors
    ///
    /// A sentence: why they cannot be brought there.
    pub fn world_points(
        &self,
        points_m: &[DVec3],
        frame: &str,
        stamp_ns: i64,
        tree: &TransformTree,
    ) -> Result<Vec<DVec3>, String> {
        let in_world = |point: DVec3| self.axes.vector(point);
        if frame.is_empty() || self.world_frame.as_deref() == Some(frame) {
            return Ok(points_m.iter().copied().map(in_world).collect());
        }
        if let Some(base_from_frame) = self.base.base_from(frame, tree) {
            let now = self.track.at(stamp_ns).ok_or("the car's pose is not known at its time")?;
            let body =
                |point: &DVec3| self.axes.body_vector(base_from_frame.transform_point(*point));
            return Ok(points_m.iter().map(|point| now.world_from_ego(body(point))).collect());
        }
        let Some(world_frame) = &self.world_frame else {
            return Err(format!("nothing ties its frame `{frame}` to the world of the pose"));
        };
        // Routes are sent before the first transform, and hold after the last.
        let instants =
            self.track.span_ns().map_or([stamp_ns; 3], |(first, last)| [stamp_ns, first, last]);
        let lookup = |stamp_ns: i64| tree.lookup(world_frame, frame, stamp_ns);
        let found = instants.into_iter().find_map(|stamp_ns| lookup(stamp_ns).ok());
        let world_from_frame = found.ok_or_else(|| lookup(stamp_ns).err().unwrap_or_default())?;
        let place = |point: &DVec3| in_world(world_from_frame.transform_point(*point));
        Ok(points_m.iter().map(place).collect())
    }
}

fn told_by_topic(topic: &Topic) -> Told {
    let poses = match &topic.series {
        Series::Odometry(samples) => samples
            .iter()
            .map(|sample| Stamped { stamp_ns: sample.stamp_ns, value: sample.value.pose })
            .collect(),
        Series::Pose(samples) => samples.clone(),
        _ => Vec::new(),
    };
    let child_frame = topic.child_frame_id.clone();
    Told { poses, world_frame: Some(topic.frame_id.clone()), child_frame }
}

fn told_by_transforms(frame: &str, tree: &TransformTree) -> Told {
    let child_frame = Some(frame.to_string());
    let Some((world, poses)) = tree.motion(frame) else {
        return Told { poses: Vec::new(), world_frame: None, child_frame };
    };
    let poses = poses.into_iter().map(|(stamp_ns, value)| Stamped { stamp_ns, value }).collect();
    Told { poses, world_frame: Some(world.to_string()), child_frame }
}

/// Poses of the car in a world with z up, from poses as the log tells them.
fn brought(
    told: Told,
    rule: &EgoRule,
    tree: &TransformTree,
    notes: &mut Vec<String>,
) -> (Vec<Stamped<Pose>>, BaseFrame, WorldAxes, Option<String>) {
    let Told { mut poses, world_frame, child_frame } = told;
    let axes = WorldAxes::new(rule.world, world_frame.as_deref());
    match axes.convention() {
        World::Enu => {}
        World::Ned => notes.push("pose: told as north, east, down; turned to have z up".into()),
        World::LeftHanded => {
            notes.push("pose: told in a left-handed world; y is mirrored to point left".into());
        }
    }
    let base_rule = rule.base.as_deref();
    let base = BaseFrame::of(child_frame.as_deref(), base_rule, tree, &poses, notes);
    let (base, axes) = base.upright(axes, &poses, notes);
    for pose in &mut poses {
        pose.value = axes.pose(&pose.value.then(&base.child_from_base));
    }
    (poses, base, axes, world_frame)
}

/// Poses from the topics of positions, of headings and, if there is one, of speeds; `None` if
/// nothing tells a heading.
fn by_satellites(
    (fix, heading, speed): (&Topic, &Topic, Option<&Topic>),
    (base, axes): (&BaseFrame, &WorldAxes),
    tree: &TransformTree,
    notes: &mut Vec<String>,
) -> Option<Vec<Stamped<Pose>>> {
    let fixes = match &fix.series {
        Series::Fix(fixes) => fixes.as_slice(),
        _ => &[],
    };
    let positions = gnss::positions(fixes, &fix.name, notes);
    let antenna = base.base_from(&fix.frame_id, tree);
    let antenna_m = antenna.map_or(DVec3::ZERO, |antenna| antenna.position_m);
    let headings = gnss::headings(heading, &positions, antenna_m.x, (base, axes), tree, notes)?;
    let speeds = speed.map_or_else(Vec::new, |topic| speeds(topic, base, axes, tree));
    Some(gnss::poses(&positions, &headings, antenna_m, &speeds))
}

/// The car's frame and the axes of its sensors, where the world is made here: sensors of a world
/// with z down have their own z down, where no transform says otherwise.
fn made_here(rule: &EgoRule, turning: &Topic, tree: &TransformTree) -> (BaseFrame, WorldAxes) {
    let axes = WorldAxes::new(rule.world, Some(&turning.frame_id));
    let mut base = BaseFrame::named(rule.base.as_deref(), tree);
    let is_placed = base.base_from(&turning.frame_id, tree).is_some();
    if axes.convention() == World::Ned && !is_placed {
        base.child_from_base.rotation = UPSIDE_DOWN;
    }
    (base, axes)
}
