//! The car's own frame: where it lies in the frame whose pose a log tells.
//!
//! Odometry may be that of a camera or a lidar. In this order: a frame with a usual name of a car's
//! is the car's; else one that transforms tie to it, without moving against it, is brought there;
//! else the frame's axes are compared with how it moves: a frame that moves along its z axis, seen
//! over the whole log, has the axes of a camera's optical frame. What is left is taken as the car's
//! own, with a note.

use glam::DVec3;

use crate::{
    dataset::world::{BODY_FROM_OPTICAL, UPSIDE_DOWN, WorldAxes},
    log::{candidates::BASE_FRAMES, recording::Stamped, signals::Pose, transforms::TransformTree},
};

/// Steps shorter than this say nothing of a direction.
const STEP_M: f64 = 0.5;

/// Cosine beyond which two directions are the same axis: 37 degrees, which leaves room for pitch,
/// slip and bends, and none for another axis.
const SAME_AXIS: f64 = 0.8;

/// Where the car's frame lies in a frame that moves with it.
#[derive(Clone, Debug, PartialEq)]
pub struct BaseFrame {
    /// The frame that the transforms know, where there is one.
    child: Option<String>,
    pub child_from_base: Pose,
}

impl BaseFrame {
    /// The car's frame by its name alone: as a rule says, or the first usual one that transforms
    /// know.
    pub fn named(rule: Option<&str>, transforms: &TransformTree) -> BaseFrame {
        let usual = BASE_FRAMES.into_iter().find(|frame| transforms.has(frame));
        let child = rule.or(usual).map(str::to_string);
        BaseFrame { child, child_from_base: Pose::IDENTITY }
    }

    /// The car's frame in the frame `child`, whose poses in the log's world are given.
    pub fn of(
        child: Option<&str>,
        rule: Option<&str>,
        transforms: &TransformTree,
        poses: &[Stamped<Pose>],
        notes: &mut Vec<String>,
    ) -> BaseFrame {
        let Some(child) = child.filter(|child| !child.is_empty()) else {
            return BaseFrame::named(rule, transforms);
        };
        let mut found =
            BaseFrame { child: Some(child.to_string()), child_from_base: Pose::IDENTITY };
        if rule.map_or(BASE_FRAMES.contains(&child), |rule| rule == child) {
            return found;
        }
        let tied = rule.into_iter().chain(BASE_FRAMES);
        let tied = tied.filter_map(|base| Some((base, transforms.rigid(child, base)?)));
        if let Some((base, child_from_base)) = tied.into_iter().next() {
            notes.push(format!("pose: of `{child}`, brought to `{base}` by the transforms"));
            found.child_from_base = child_from_base;
            return found;
        }
        if direction_of_motion(poses).is_some_and(|direction| direction.z.abs() > SAME_AXIS) {
            found.child_from_base.rotation = BODY_FROM_OPTICAL.inverse();
            notes.push(format!(
                "pose: of `{child}`, which moves along its z axis and so has the axes of a camera's \
                 optical frame; no transform ties it to the car, so it is taken as the car's place"
            ));
        } else {
            notes.push(format!(
                "pose: of `{child}`, which no transform ties to the car (profile key ego.base): \
                 taken as the car's own frame"
            ));
        }
        found
    }

    /// Turn what lies upside down, be it the world or the car's axes, seen from the mean attitude
    /// of the car over a log: cars stand on their wheels.
    pub fn upright(
        mut self,
        mut axes: WorldAxes,
        poses: &[Stamped<Pose>],
        notes: &mut Vec<String>,
    ) -> (BaseFrame, WorldAxes) {
        let up_of = |axes: &WorldAxes, base: &BaseFrame| {
            let ups = poses.iter().map(|pose| {
                axes.pose(&pose.value).rotation * (base.child_from_base.rotation * DVec3::Z)
            });
            ups.sum::<DVec3>().normalize_or_zero()
        };
        if up_of(&axes, &self).y < -SAME_AXIS {
            axes = axes.optical();
            notes.push("pose: the world's y axis points down; it is turned to have z up".into());
        }
        if up_of(&axes, &self).z < -SAME_AXIS {
            self.child_from_base.rotation *= UPSIDE_DOWN;
            notes.push("pose: the car's z axis points down; it is turned to have z up".into());
        }
        (self, axes)
    }

    /// Where another frame lies in the car's; `None` if no transform says.
    pub fn base_from(&self, frame: &str, transforms: &TransformTree) -> Option<Pose> {
        let child_from_frame = transforms.rigid(self.child.as_deref()?, frame)?;
        Some(self.child_from_base.inverse().then(&child_from_frame))
    }

    /// As [`base_from`](BaseFrame::base_from); a sensor that no transform places is taken to sit
    /// where the pose is told for.
    pub fn base_from_sensor(&self, frame: &str, transforms: &TransformTree) -> Pose {
        self.base_from(frame, transforms).unwrap_or_else(|| self.child_from_base.inverse())
    }
}

/// The mean direction of motion in the moving frame's own axes; `None` if it hardly moves.
fn direction_of_motion(poses: &[Stamped<Pose>]) -> Option<DVec3> {
    let mut sum = DVec3::ZERO;
    let mut last = poses.first()?.value;
    for Stamped { value: pose, .. } in poses {
        let step = pose.position_m - last.position_m;
        if step.length() >= STEP_M {
            sum += last.rotation.inverse() * step.normalize();
            last = *pose;
        }
    }
    (sum != DVec3::ZERO).then(|| sum.normalize())
}
