//! The world that poses are given in, turned into ours at the door: right-handed, z up.

use glam::{DQuat, DVec3};

use crate::log::{conventions::World, signals::Pose};

/// The rotation from axes x right, y down, z forward to axes x forward, y left, z up.
pub const BODY_FROM_OPTICAL: DQuat = DQuat::from_xyzw(-0.5, 0.5, -0.5, 0.5);

/// Half a turn about the x axis: from axes with z down to axes with z up.
pub const UPSIDE_DOWN: DQuat = DQuat::from_xyzw(1.0, 0.0, 0.0, 0.0);

/// From north, east, down to east, north, up: half a turn about the diagonal between x and y.
const ENU_FROM_NED: DQuat =
    DQuat::from_xyzw(std::f64::consts::FRAC_1_SQRT_2, std::f64::consts::FRAC_1_SQRT_2, 0.0, 0.0);

/// How a log's world becomes ours.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WorldAxes {
    convention: World,
    /// What is left to be turned after that.
    ours_from_world: DQuat,
}

impl WorldAxes {
    /// The axes of a world frame: as a rule says, north-east-down where the frame's name has that
    /// word, else as ROS has them.
    pub fn new(rule: Option<World>, frame: Option<&str>) -> WorldAxes {
        let convention = rule.unwrap_or_else(|| match frame {
            Some(frame) if is_ned(frame) => World::Ned,
            _ => World::Enu,
        });
        WorldAxes { convention, ours_from_world: DQuat::IDENTITY }
    }

    pub fn convention(&self) -> World {
        self.convention
    }

    /// The same with the axes of a camera's optical frame, y down and z forward.
    pub fn optical(self) -> WorldAxes {
        WorldAxes { ours_from_world: BODY_FROM_OPTICAL, ..self }
    }

    /// A point or a vector of the log's world, in ours.
    pub fn vector(&self, vector: DVec3) -> DVec3 {
        self.ours_from_world
            * match self.convention {
                World::Enu => vector,
                World::Ned => ENU_FROM_NED * vector,
                World::LeftHanded => mirrored(vector),
            }
    }

    /// The pose of a body in the log's world, in ours. Of a left-handed world the body's axes are
    /// left-handed too, and both are mirrored.
    pub fn pose(&self, pose: &Pose) -> Pose {
        let rotation = match self.convention {
            World::Enu => pose.rotation,
            World::Ned => ENU_FROM_NED * pose.rotation,
            World::LeftHanded => {
                let DQuat { x, y, z, w } = pose.rotation;
                DQuat::from_xyzw(-x, y, -z, w)
            }
        };
        Pose {
            position_m: self.vector(pose.position_m),
            rotation: (self.ours_from_world * rotation).normalize(),
        }
    }

    /// A vector of a body in the log's axes, in ours.
    pub fn body_vector(&self, vector: DVec3) -> DVec3 {
        match self.convention {
            World::LeftHanded => mirrored(vector),
            World::Enu | World::Ned => vector,
        }
    }

    /// A rate of turn of a body in the log's axes, in ours: turns change their sense in a mirror.
    pub fn body_turn(&self, turn: DVec3) -> DVec3 {
        match self.convention {
            World::LeftHanded => -mirrored(turn),
            World::Enu | World::Ned => turn,
        }
    }
}

/// What was to the right, to the left.
fn mirrored(vector: DVec3) -> DVec3 {
    DVec3::new(vector.x, -vector.y, vector.z)
}

/// Whether a frame's name has the word `ned` (and not only its letters, as `planned` has).
fn is_ned(frame: &str) -> bool {
    let mut words = frame.split(|c: char| !c.is_ascii_alphanumeric());
    words.any(|word| word.eq_ignore_ascii_case("ned"))
}
