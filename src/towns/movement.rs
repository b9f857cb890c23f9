//! Which lane of a junction's arm leads into which lane of another.

use std::ops::Range;

/// Turns up to this count as going straight on, rad.
const STRAIGHT_RAD: f64 = 1.05;

/// Who bends so far to the right has come from the right, and joins the outermost lane, rad.
const JOINING_RAD: f64 = 0.14;

/// An arm that may be left by.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exit {
    /// Change of heading on the way into it, positive to the left.
    pub turn_rad: f64,
    pub lanes: usize,
}

/// Who keeps bending so far to the left goes round a roundabout, rad.
const ROUND_RAD: f64 = 0.3;

/// A way through a junction; lanes are counted from the left of the direction of travel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Movement {
    pub exit: usize,
    pub from_lane: usize,
    pub to_lane: usize,
}

/// All ways for `lanes` lanes that come in. `exits` are sorted from left to right.
///
/// Straight on keeps its lanes; lanes that find none there turn, to the right if that can be done.
/// Where nothing leads straight on, the lanes share the turns.
pub fn movements(lanes: usize, exits: &[Exit]) -> Vec<Movement> {
    let straightest = (0..exits.len())
        .min_by(|&a, &b| exits[a].turn_rad.abs().total_cmp(&exits[b].turn_rad.abs()))
        .filter(|&main| exits[main].turn_rad.abs() <= STRAIGHT_RAD);
    let mut found = Vec::new();
    let mut add = |exit: usize, from_lanes: Range<usize>, on_right: bool| {
        let width = exits[exit].lanes;
        for from_lane in from_lanes.clone() {
            let to_lane = match on_right {
                true => width.saturating_sub(from_lanes.end - from_lane),
                false => (from_lane - from_lanes.start).min(width - 1),
            };
            found.push(Movement { exit, from_lane, to_lane });
        }
    };
    let Some(main) = straightest else {
        let lefts = exits.iter().filter(|exit| exit.turn_rad > 0.0).count();
        let shared = match lefts {
            0 => 0,
            all if all == exits.len() => lanes,
            _ => lanes.div_ceil(2),
        };
        let first_right = if lefts < exits.len() { shared.min(lanes - 1) } else { lanes };
        add_turns(0..lefts, 0..shared, false, &mut add);
        add_turns(lefts..exits.len(), first_right..lanes, true, &mut add);
        return found;
    };
    let (has_left, has_right) = (main > 0, main + 1 < exits.len());
    // Out of a roundabout all lanes lead, as far as the exit has lanes, and the outer ones lead
    // nowhere else: ways out and round do not cross.
    let goes_round = exits[main].turn_rad > ROUND_RAD && !has_left && exits.len() == 2;
    let leaving = if goes_round { exits[main + 1].lanes.min(lanes) } else { 0 };
    if leaving > 1 {
        add(main, 0..lanes + 1 - leaving, false);
        add(main + 1, lanes - leaving..lanes, true);
        return found;
    }
    let spare = lanes.saturating_sub(exits[main].lanes);
    let straight = match (has_left, has_right) {
        (_, true) => 0..lanes - spare,
        (true, false) => spare..lanes,
        (false, false) => 0..lanes,
    };
    let left = if has_right { 0..1 } else { 0..spare.max(1) };
    let right = if has_right { lanes - spare.max(1)..lanes } else { 0..0 };
    add_turns(0..main, left, false, &mut add);
    add(main, straight, exits[main].turn_rad < -JOINING_RAD);
    add_turns(main + 1..exits.len(), right, true, &mut add);
    found
}

/// Turns to one side: all lanes serve the sharpest, and the one nearest to straight on serves the
/// others too, so that no ways cross.
fn add_turns(
    exits: Range<usize>,
    lanes: Range<usize>,
    on_right: bool,
    add: &mut impl FnMut(usize, Range<usize>, bool),
) {
    let sharpest = if on_right { exits.end.saturating_sub(1) } else { exits.start };
    let gentle = if on_right {
        lanes.start..lanes.start + 1
    } else {
        lanes.end.saturating_sub(1)..lanes.end
    };
    for exit in exits {
        add(exit, if exit == sharpest { lanes.clone() } else { gentle.clone() }, on_right);
    }
}
