//! Pedals as events: whether they are pressed, and when the driver began to brake.

/// A pedal pressed further than this is pressed.
pub const PRESSED: f32 = 0.1;

/// How far apart two beginnings to brake may be and still be the same, s.
pub const SAME_S: f64 = 3.0;

/// A pedal at one frame: pressed by the plan, pressed by the driver.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pedal {
    pub planned: bool,
    pub recorded: bool,
}

impl Pedal {
    pub fn of(planned: f32, recorded: f32) -> Self {
        Pedal { planned: planned > PRESSED, recorded: recorded > PRESSED }
    }
}

/// What a policy did about it when the driver began to brake.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Onset {
    /// How much later than the driver it began to brake, s, negative = earlier; `None` if it did not
    /// within [`SAME_S`]. Having braked for longer than that counts as that much earlier.
    pub late_s: Option<f64>,
}

/// For each frame of an unbroken stretch at which the driver begins to brake: when the policy did,
/// the nearest time if there are several.
///
/// `stamps_s` are the times of the frames. Whoever brakes in the first frame began before it.
pub fn brake_onsets(stretch: &[Option<Pedal>], stamps_s: &[f64]) -> Vec<Option<Onset>> {
    let begins = |of: fn(&Pedal) -> bool| -> Vec<bool> {
        let pressed = |i: usize| stretch[i].as_ref().map(of);
        let begins = |i: usize| i > 0 && pressed(i) == Some(true) && pressed(i - 1) == Some(false);
        (0..stretch.len()).map(begins).collect()
    };
    let recorded = begins(|pedal| pedal.recorded);
    let planned: Vec<usize> = begins(|pedal| pedal.planned)
        .into_iter()
        .enumerate()
        .filter_map(|(i, begins)| begins.then_some(i))
        .collect();
    let onset = |i: usize| {
        let late = planned.iter().map(|&j| stamps_s[j] - stamps_s[i]);
        let nearest = late.filter(|s| s.abs() <= SAME_S).min_by(|a, b| a.abs().total_cmp(&b.abs()));
        let already = stretch[i].is_some_and(|pedal| pedal.planned);
        Onset { late_s: nearest.or(already.then_some(-SAME_S)) }
    };
    (0..stretch.len()).map(|i| recorded[i].then(|| onset(i))).collect()
}
