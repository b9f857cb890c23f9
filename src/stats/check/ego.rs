//! The car's own motion: pose, velocity and yaw against each other and against what cars can do.

use std::f64::consts::PI;

use crate::stats::check::{
    digest::STANDING_MPS,
    finding::{Check, Count, Finding, Hits, Level, Needs, Place, percent},
    motion::{Motion, TELLING_MPS, median},
    track::Track,
};

pub static EGO_NOT_FINITE: Check = Check {
    code: "E01",
    name: "ego-not-finite",
    level: Level::Error,
    needs: Needs::Columns,
    what: "velocity, yaw or position is not finite",
    why: "one NaN in a batch makes every weight NaN",
    remedy: "find the message in the log (the stamp says which) and leave it out, or filter the pose source",
};

/// Speed by the column and by the poses may differ by so much, of the speed and in m/s: wheel
/// speeds are off by tyre wear (3 %) and slip, positions by noise.
const SPEED_RATIO: f64 = 0.1;
const SPEED_OFF_MPS: f64 = 0.5;

/// Least steps that a median over an episode is taken of.
const ENOUGH_STEPS: usize = 20;

pub static SPEED_AGAINST_POSE: Check = Check {
    code: "E02",
    name: "speed-against-pose",
    level: Level::Error,
    needs: Needs::Columns,
    what: "half of an episode's moving frames have a speed more than 10 % and 0.5 m/s from what the poses say",
    why: "speed is an input and the label: in other units than the positions both teach a wrong scale",
    remedy: "look at the unit of the velocity topic (km/h, mph) and at the stamps of the poses",
};

/// 20 degrees: a car's slip angle stays below 10 in any sane driving, its rear axle has none.
const SIDEWAYS_RAD: f64 = 0.35;

pub static VELOCITY_FRAME: Check = Check {
    code: "E03",
    name: "velocity-frame",
    level: Level::Error,
    needs: Needs::Columns,
    what: "in half of an episode's moving frames the velocity points more than 20 degrees off the car's axis, or the other way than the poses go",
    why: "velocity must be in the ego frame, x forward: in the world frame the input depends on the street's heading",
    remedy: "turn the velocity by the yaw, or name the right frame in the profile",
};

pub static YAW_AGAINST_MOTION: Check = Check {
    code: "E04",
    name: "yaw-against-motion",
    level: Level::Error,
    needs: Needs::Columns,
    what: "in half of an episode's moving frames the car moves more than 20 degrees off its yaw",
    why: "routes and futures are turned into the ego frame by the yaw: off by an angle they all point off the road",
    remedy: "look at the yaw's convention (degrees, north = 0, clockwise) and the base frame in the profile",
};

/// A step may be longer than the speed says by this, m, and by half of it.
const JUMP_M: f64 = 1.0;
const JUMP_SHARE: f64 = 0.5;

pub static POSITION_JUMP: Check = Check {
    code: "E05",
    name: "position-jump",
    level: Level::Error,
    needs: Needs::Columns,
    what: "a position is more than 1 m, and half the way driven, further from the last than the speed allows",
    why: "every future and route across a jump of the localisation is wrong: 3 s of labels before it",
    remedy: "use odometry rather than GNSS or SLAM with loop closures, or cut the drive at the jump",
};

/// 3.5 rad/s: nearly four times what comfortable driving has (0.95 rad/s, nuPlan's bound).
const YAW_JUMP_RADPS: f64 = 3.5;

pub static YAW_JUMP: Check = Check {
    code: "E06",
    name: "yaw-jump",
    level: Level::Error,
    needs: Needs::Columns,
    what: "the yaw changes by more than 3.5 rad/s within a tick",
    why: "every future and route of the frame is turned by the error",
    remedy: "take the heading from odometry or IMU instead of differences of noisy positions",
};

/// 12 m/s2: tyres on dry asphalt reach about 1.1 g; comfortable driving ends at -4.05 (nuPlan).
const TYRES_MPS2: f64 = 12.0;

pub static ACCELERATION: Check = Check {
    code: "E07",
    name: "impossible-acceleration",
    level: Level::Error,
    needs: Needs::Columns,
    what: "the speed changes by more than 12 m/s2 from one frame to the next, more than tyres can do",
    why: "spikes of the speed are labels that no action explains; with an L1 loss they stay forever",
    remedy: "filter the velocity source, or find the collision or reset in the log and cut there",
};

pub static LATERAL: Check = Check {
    code: "E08",
    name: "impossible-turn",
    level: Level::Error,
    needs: Needs::Columns,
    what: "speed times yaw rate is more than 12 m/s2, more than tyres can hold",
    why: "yaw or speed is wrong there, and with them the label of the motion",
    remedy: "look at the yaw source: noise, wrong unit, or wrong rate",
};

/// A red light is over by then, s.
const STANDSTILL_S: f64 = 60.0;

pub static STANDSTILL: Check = Check {
    code: "E09",
    name: "long-standstill",
    level: Level::Warning,
    needs: Needs::Columns,
    what: "the car stands for more than 60 s in a row",
    why: "the same frame hundreds of times, with the label `stay`: a policy learns never to start (inertia problem)",
    remedy: "cut the stretch out, or balance the sampling",
};

/// A third is steeper than any street (Baldwin Street, Dunedin: 35 %); plus noise of heights, m.
const STEEPEST: f64 = 0.35;
const HEIGHT_NOISE_M: f64 = 0.2;

pub static HEIGHT_STEP: Check = Check {
    code: "E10",
    name: "height-step",
    level: Level::Warning,
    needs: Needs::Columns,
    what: "the height changes by more than 0.2 m and 35 % of the way within a tick",
    why: "the pose jumps upwards, and with it everything that is projected or put on a map",
    remedy: "take heights from one source; GNSS heights are the usual culprit",
};

pub static YAW_RANGE: Check = Check {
    code: "E11",
    name: "yaw-range",
    level: Level::Error,
    needs: Needs::Columns,
    what: "a yaw lies outside -pi ... pi",
    why: "degrees, or an unwrapped angle: differences of yaw are wrong by turns",
    remedy: "write radians, wrapped",
};

/// So many steps without any motion of the pose.
const FROZEN_STEPS: u32 = 5;

pub static POSE_FROZEN: Check = Check {
    code: "E12",
    name: "pose-frozen",
    level: Level::Error,
    needs: Needs::Columns,
    what: "the position stays the same, to the bit, for 5 ticks and more while the velocity says that the car moves",
    why: "the localisation hung: futures say `stop` where the car drove on",
    remedy: "lower the tolerance of the pose so that the stretch becomes a gap",
};

/// More reversing than parking needs.
const REVERSING_SHARE: f64 = 0.2;

pub static BACKWARDS: Check = Check {
    code: "E13",
    name: "drives-backwards",
    level: Level::Warning,
    needs: Needs::Columns,
    what: "more than 20 % of an episode's moving frames reverse",
    why: "more likely the x axis points backwards than the car: then camera, route and labels disagree",
    remedy: "turn the base frame in the profile, or drop the episode if it is about parking",
};

/// Faster than the drift of a standing localisation, m/s.
const MOVES_MPS: f64 = 0.5;

pub static NEVER_MOVES: Check = Check {
    code: "E14",
    name: "never-moves",
    level: Level::Warning,
    needs: Needs::Columns,
    what: "an episode never reaches 0.5 m/s",
    why: "it teaches to stay where one is",
    remedy: "drop the episode; look whether the velocity topic was silent",
};

pub static ALL: [&Check; 14] = [
    &EGO_NOT_FINITE,
    &SPEED_AGAINST_POSE,
    &VELOCITY_FRAME,
    &YAW_AGAINST_MOTION,
    &POSITION_JUMP,
    &YAW_JUMP,
    &ACCELERATION,
    &LATERAL,
    &STANDSTILL,
    &HEIGHT_STEP,
    &YAW_RANGE,
    &POSE_FROZEN,
    &BACKWARDS,
    &NEVER_MOVES,
];

/// The motion of an episode.
pub fn check(track: &Track, motion: &Motion) -> Vec<Finding> {
    let ego = Ego { track, motion };
    let findings = [
        ego.not_finite(),
        ego.speed_against_pose(),
        ego.velocity_frame(),
        ego.yaw_against_motion(),
        ego.position_jumps(),
        ego.yaw_jumps(),
        ego.accelerations(),
        ego.turns(),
        ego.standstills(),
        ego.height_steps(),
        ego.yaw_range(),
        ego.frozen(),
        ego.backwards(),
        ego.never_moves(),
    ];
    findings.into_iter().flatten().collect()
}

struct Ego<'t> {
    track: &'t Track,
    motion: &'t Motion,
}

impl Ego<'_> {
    /// A finding of the steps where something beyond its limit was measured.
    fn steps_beyond(
        &self,
        check: &'static Check,
        measured: impl Fn(usize) -> Option<f64>,
        sentence: impl Fn(&Hits) -> String,
    ) -> Option<Finding> {
        let steps = self.motion.steps();
        let hits = Hits::of(steps.filter_map(|row| Some((self.track.frame[row], measured(row)?))))?;
        Some(check.found(hits.of_episode(&self.track.episode), hits.worst, sentence(&hits)))
    }

    fn moved(&self, row: usize) -> f64 {
        let [x, y] = self.motion.moved_mps[row];
        x.hypot(y)
    }

    /// Steps in which the car moves by its poses and by its velocity.
    fn telling_steps(&self) -> impl Iterator<Item = usize> {
        let speed = &self.motion.speed_mps;
        self.motion.steps().filter(|row| {
            self.moved(*row) > TELLING_MPS
                && speed[*row].abs() > TELLING_MPS
                && self.moved(*row) < JUMP_M / self.motion.tick_s + 2.0 * speed[*row].abs()
        })
    }

    fn not_finite(&self) -> Option<Finding> {
        let track = self.track;
        let is_bad = |row: &usize| {
            !track.yaw_rad[*row].is_finite()
                || track.position_of(*row).iter().any(|x| !x.is_finite())
                || track.velocity_of(*row).iter().any(|v| !v.is_finite())
        };
        let hits = Hits::of((0..track.len()).filter(is_bad).map(|row| (track.frame[row], 0.0)))?;
        let frames = Count(hits.count, "frame");
        let sentence = format!("{frames} with a velocity, yaw or position that is not finite");
        Some(EGO_NOT_FINITE.found(hits.of_episode(&track.episode), None, sentence))
    }

    fn speed_against_pose(&self) -> Option<Finding> {
        let moving = || {
            let fast =
                |row: &usize| self.moved(*row).max(self.motion.speed_mps[*row].abs()) > TELLING_MPS;
            self.motion.steps().filter(fast)
        };
        let speed = |row: usize| {
            let next = self.motion.speed_mps.get(row + 1).unwrap_or(&0.0);
            (self.motion.speed_mps[row].abs() + next.abs()) / 2.0
        };
        if moving().count() < ENOUGH_STEPS {
            return None;
        }
        let ratio = median(moving().map(|row| speed(row) / self.moved(row).max(1e-3)).collect())?;
        let off_mps = median(moving().map(|row| (speed(row) - self.moved(row)).abs()).collect())?;
        let is_off = (ratio - 1.0).abs() > SPEED_RATIO && off_mps > SPEED_OFF_MPS;
        let known =
            [(3.6, "as km/h to m/s"), (2.237, "as mph to m/s"), (1.0 / 3.6, "as m/s to km/h")];
        let unit = known.iter().find(|(factor, _)| (ratio / factor - 1.0).abs() < 0.05);
        let unit = unit.map(|(_, unit)| format!(", {unit}")).unwrap_or_default();
        let sentence = format!("speed is {ratio:.2} times that of the poses{unit}");
        let place = Place::episode(&self.track.episode);
        is_off.then(|| SPEED_AGAINST_POSE.found(place, ratio, sentence))
    }

    fn velocity_frame(&self) -> Option<Finding> {
        let rows: Vec<usize> = self.telling_steps().collect();
        if rows.len() < ENOUGH_STEPS {
            return None;
        }
        let off = |row: &usize| {
            let [vx, vy] = self.track.velocity_of(*row).map(f64::from);
            let against = vx * self.motion.moved_mps[*row][0] < 0.0
                && vx.abs() > vy.abs()
                && self.motion.moved_mps[*row][0].abs() > self.motion.moved_mps[*row][1].abs();
            if against { PI } else { vy.abs().atan2(vx.abs()) }
        };
        let angle = median(rows.iter().map(off).collect())?;
        let sentence = match angle > PI / 2.0 {
            true => "the velocity points the other way than the poses go".to_string(),
            false => {
                format!("the velocity is {:.0} degrees off the car's axis", angle.to_degrees())
            }
        };
        let place = Place::episode(&self.track.episode);
        (angle > SIDEWAYS_RAD).then(|| VELOCITY_FRAME.found(place, angle.to_degrees(), sentence))
    }

    fn yaw_against_motion(&self) -> Option<Finding> {
        let rows: Vec<usize> = self.telling_steps().collect();
        if rows.len() < ENOUGH_STEPS {
            return None;
        }
        let off = |row: &usize| {
            let [x, y] = self.motion.moved_mps[*row];
            y.abs().atan2(x.abs())
        };
        let angle = median(rows.iter().map(off).collect())?.to_degrees();
        let sentence = format!("the car moves {angle:.0} degrees off its yaw");
        let place = Place::episode(&self.track.episode);
        (angle > SIDEWAYS_RAD.to_degrees())
            .then(|| YAW_AGAINST_MOTION.found(place, angle, sentence))
    }

    fn position_jumps(&self) -> Option<Finding> {
        let beyond = |row: usize| {
            let speed = &self.motion.speed_mps;
            let expected = speed[row].abs().max(speed[row + 1].abs()) * self.motion.tick_s;
            let excess = self.moved(row) * self.motion.tick_s - expected;
            (excess > JUMP_M + JUMP_SHARE * expected).then_some(excess)
        };
        self.steps_beyond(&POSITION_JUMP, beyond, |hits| {
            let jumps = Count(hits.count, "jump");
            format!("{jumps} of the position, up to {:.1} m beyond the speed", hits.worst)
        })
    }

    fn yaw_jump(&self, row: usize) -> Option<f64> {
        let rate = self.motion.yaw_rate_radps[row].abs();
        (rate > YAW_JUMP_RADPS).then_some(rate)
    }

    fn yaw_jumps(&self) -> Option<Finding> {
        self.steps_beyond(
            &YAW_JUMP,
            |row| self.yaw_jump(row),
            |hits| {
                format!("{} of the yaw, up to {:.1} rad/s", Count(hits.count, "jump"), hits.worst)
            },
        )
    }

    fn accelerations(&self) -> Option<Finding> {
        let beyond = |row: usize| {
            let size = self.motion.acceleration_mps2[row].abs();
            (size > TYRES_MPS2).then_some(size)
        };
        self.steps_beyond(&ACCELERATION, beyond, |hits| {
            let steps = Count(hits.count, "step");
            format!("{steps} with an impossible acceleration, up to {:.0} m/s2", hits.worst)
        })
    }

    fn turns(&self) -> Option<Finding> {
        let beyond = |row: usize| {
            // The slower of both: a jump of the position, or a wrong unit, is another finding.
            let speed = self.motion.speed_mps[row].abs().min(self.moved(row));
            let size = speed * self.motion.yaw_rate_radps[row].abs();
            (size > TYRES_MPS2 && self.yaw_jump(row).is_none()).then_some(size)
        };
        self.steps_beyond(&LATERAL, beyond, |hits| {
            let steps = Count(hits.count, "step");
            format!("{steps} with an impossible turn, up to {:.0} m/s2 sideways", hits.worst)
        })
    }

    /// Stretches of rows without a missing tick that are so: first row and number of rows.
    fn stretches(&self, is_so: impl Fn(usize) -> bool) -> Vec<(usize, usize)> {
        let mut found: Vec<(usize, usize)> = Vec::new();
        for row in (0..self.track.len()).filter(|row| is_so(*row)) {
            match found.last_mut() {
                Some((first, rows)) if *first + *rows == row && self.motion.is_step[row - 1] => {
                    *rows += 1
                }
                _ => found.push((row, 1)),
            }
        }
        found
    }

    fn standstills(&self) -> Option<Finding> {
        let stretches = self.stretches(|row| self.motion.speed_mps[row].abs() < STANDING_MPS);
        let seconds = stretches
            .into_iter()
            .map(|(first, rows)| (self.track.frame[first], rows as f64 * self.motion.tick_s));
        let hits = Hits::of(seconds.filter(|(_, seconds)| *seconds > STANDSTILL_S))?;
        let place = hits.of_episode(&self.track.episode);
        let sentence = format!("stands for {:.0} s in a row", hits.worst);
        Some(STANDSTILL.found(place, hits.worst, sentence))
    }

    fn height_steps(&self) -> Option<Finding> {
        let beyond = |row: usize| {
            let rise = (self.track.position_of(row + 1)[2] - self.track.position_of(row)[2]).abs();
            let allowed = HEIGHT_NOISE_M + STEEPEST * self.moved(row) * self.motion.tick_s;
            (rise > allowed).then_some(rise)
        };
        self.steps_beyond(&HEIGHT_STEP, beyond, |hits| {
            format!("{} of the height, up to {:.1} m", Count(hits.count, "step"), hits.worst)
        })
    }

    fn yaw_range(&self) -> Option<Finding> {
        let yaws = self.track.frame.iter().copied().zip(self.track.yaw_rad.iter().map(|y| y.abs()));
        let hits = Hits::of(yaws.filter(|(_, size)| *size > PI + 1e-6 && size.is_finite()))?;
        let frames = Count(hits.count, "frame");
        let sentence = format!("{frames} with a yaw outside -pi ... pi, up to {:.1}", hits.worst);
        Some(YAW_RANGE.found(hits.of_episode(&self.track.episode), hits.worst, sentence))
    }

    fn frozen(&self) -> Option<Finding> {
        let stays = |row: usize| {
            self.motion.is_step[row]
                && self.motion.speed_mps[row].abs() > TELLING_MPS
                && self.track.position_of(row) == self.track.position_of(row + 1)
        };
        let stretches = self.stretches(stays).into_iter();
        let long = stretches.filter(|(_, rows)| *rows >= FROZEN_STEPS as usize);
        let hits = Hits::of(
            long.map(|(first, rows)| (self.track.frame[first], rows as f64 * self.motion.tick_s)),
        )?;
        let sentence =
            format!("the position hangs for up to {:.1} s while the car moves", hits.worst);
        Some(POSE_FROZEN.found(hits.of_episode(&self.track.episode), hits.worst, sentence))
    }

    fn backwards(&self) -> Option<Finding> {
        let speeds = || self.motion.speed_mps.iter().filter(|speed| speed.abs() > MOVES_MPS);
        let share = speeds().filter(|speed| **speed < 0.0).count() as f64 / speeds().count() as f64;
        let sentence = format!("{} of the moving frames reverse", percent(share));
        let place = Place::episode(&self.track.episode);
        (share > REVERSING_SHARE).then(|| BACKWARDS.found(place, share, sentence))
    }

    fn never_moves(&self) -> Option<Finding> {
        let fastest = self.motion.speed_mps.iter().fold(0.0_f64, |a, b| a.max(b.abs()));
        let sentence = format!("never faster than {fastest:.2} m/s");
        let place = Place::episode(&self.track.episode);
        (fastest < MOVES_MPS && !self.track.is_empty())
            .then(|| NEVER_MOVES.found(place, fastest, sentence))
    }
}
