//! What kind of moment a frame is: what a training needs many of and a drive has few of.

use crate::frame::Command;

/// Steering, by size: straight on is most of a drive, and hard turns are hardly any of it.
const STEERING_EDGES: [f32; 4] = [0.02, 0.1, 0.3, 0.6];

/// Slower than this a car stands, m/s.
const STANDING_MPS: f32 = 0.5;

/// Less than this of a pedal is not driving.
const PEDAL: f32 = 0.1;

/// The traits of a frame, packed into a byte.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Traits(u8);

/// A trait: its name, and how many kinds of it there are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Trait {
    /// How hard it steers.
    Steering,
    /// Whether it brakes.
    Brake,
    /// What the navigator says.
    Command,
    /// Whether it starts from rest.
    Start,
}

impl Trait {
    pub const ALL: [Trait; 4] = [Trait::Steering, Trait::Brake, Trait::Command, Trait::Start];

    /// Names of its kinds.
    pub fn kinds(self) -> &'static [&'static str] {
        match self {
            Trait::Steering => {
                &["below 0.02", "0.02 to 0.1", "0.1 to 0.3", "0.3 to 0.6", "0.6 and more"]
            }
            Trait::Brake => &["no", "yes"],
            Trait::Command => &["follow", "left", "right", "straight"],
            Trait::Start => &["no", "yes"],
        }
    }

    pub fn name(self) -> &'static str {
        match self {
            Trait::Steering => "steering",
            Trait::Brake => "brake",
            Trait::Command => "command",
            Trait::Start => "start from rest",
        }
    }

    /// The bits of the byte: shift and mask.
    fn bits(self) -> (u8, u8) {
        match self {
            Trait::Steering => (0, 0b111),
            Trait::Brake => (3, 0b1),
            Trait::Command => (4, 0b11),
            Trait::Start => (6, 0b1),
        }
    }
}

impl Traits {
    /// Different values that there can be.
    pub const COUNT: usize = 128;

    /// Of a frame, whose unknown pedals and steering count as none.
    pub fn new(action: [Option<f32>; 3], command: Command, velocity_mps: [f32; 2]) -> Self {
        let [steer, throttle, brake] = action.map(|x| x.unwrap_or(0.0));
        let steering = STEERING_EDGES.partition_point(|edge| *edge <= steer.abs()) as u8;
        let stands = velocity_mps[0].hypot(velocity_mps[1]) < STANDING_MPS;
        let starts = stands && throttle >= PEDAL && throttle > brake;
        let command = Command::ALL.iter().take_while(|c| **c != command).count() as u8;
        let kinds = [
            (Trait::Steering, steering),
            (Trait::Brake, u8::from(brake >= PEDAL)),
            (Trait::Command, command),
            (Trait::Start, u8::from(starts)),
        ];
        Traits(kinds.into_iter().map(|(which, kind)| kind << which.bits().0).sum())
    }

    /// Which kind of a trait: an index of [`Trait::kinds`].
    pub fn kind(self, which: Trait) -> usize {
        let (shift, mask) = which.bits();
        usize::from(self.0 >> shift & mask)
    }

    /// As a number below [`Traits::COUNT`].
    pub fn index(self) -> usize {
        usize::from(self.0)
    }

    /// All that there can be, by index.
    pub fn all() -> impl Iterator<Item = Traits> {
        (0..Self::COUNT as u8).map(Traits)
    }
}
