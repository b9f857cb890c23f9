//! What is counted of an episode while it goes on, every 0.1 s.

use crate::{
    closed_loop::{
        comfort,
        pilot::Act,
        row::EpisodeRow,
        safety::{SHORT_S, time_to_collision_s},
        suite::Episode,
    },
    scene::conditions::Sky,
    sim::drive::Drive,
    world::{
        contact::{Contact, Fault, Other},
        simulation::World,
        traffic::STEP_S,
    },
};

/// Sums over an episode.
#[derive(Debug, Default)]
pub struct Tally {
    least_ttc_s: Option<f64>,
    short_ttc_s: f64,
    /// Speed (m/s) and yaw rate (rad/s) of every 0.1 s.
    motion: Vec<[f64; 2]>,
    steer: Option<f64>,
    steering_travel: f64,
    fused: u64,
    lambda_sum: f64,
    variance_sum: f64,
    attended: u64,
    /// Of camera, ralidar, route, velocity.
    attention_sums: [f64; 4],
}

/// Branches by the names that plans have them by.
const BRANCHES: [&str; 4] = ["camera", "ralidar", "route", "velocity"];

impl Tally {
    /// Count a decision, and the world in which it was made.
    pub fn add(&mut self, world: &World, act: &Act) {
        let ego = world.ego();
        if let Some(ttc_s) = time_to_collision_s(&world.snapshot()) {
            self.least_ttc_s = Some(self.least_ttc_s.map_or(ttc_s, |least| least.min(ttc_s)));
            self.short_ttc_s += if ttc_s < SHORT_S { STEP_S } else { 0.0 };
        }
        self.motion.push([ego.speed_mps, ego.yaw_rate_radps()]);
        let steer = f64::from(act.action.steer);
        self.steering_travel += (steer - self.steer.unwrap_or(steer)).abs();
        self.steer = Some(steer);
        let decision = act.decision.as_ref();
        if let Some((decision, variance)) = decision.and_then(|d| Some((d, d.variance?)))
            && decision.a1.is_some()
        {
            self.fused += 1;
            self.lambda_sum += decision.lambda;
            self.variance_sum += variance;
        }
        if !act.plan.attention.is_empty() {
            self.attended += 1;
        }
        for (name, share) in &act.plan.attention {
            if let Some(at) = BRANCHES.iter().position(|branch| branch == name) {
                self.attention_sums[at] += f64::from(*share);
            }
        }
    }

    /// The row of an episode that is over; `error` of a policy that gave up.
    pub fn row(
        self,
        (policy, suite): (&str, &str),
        episode: &Episode,
        drive: &Drive,
        error: Option<String>,
    ) -> EpisodeRow {
        let (world, sums) = (&drive.world, drive.watch().sums());
        let end = drive.end();
        let contact = world.contact();
        let comfort = comfort::judge(&self.motion);
        let [camera, ralidar, route, velocity] = self.attention_sums;
        EpisodeRow {
            vehicles: world.counts().vehicles as u32,
            pedestrians: world.counts().walkers as u32,
            route_m: world.route.length_m(),
            progress_m: world.progress_m(),
            driven_m: sums.driven_m,
            duration_s: world.time_s(),
            time_limit_s: drive.watch().limit_s(),
            goal_m: world.ego().position_m.distance(world.route.goal_m()),
            success: end.is_some_and(|end| end.name() == "goal"),
            reason: end.map_or("crashed", |end| end.name()).to_string(),
            error,
            touched: contact.map(|contact| touched(contact).to_string()),
            at_fault: contact.map(|contact| contact.fault == Fault::Ego),
            impact_mps: contact.map(|contact| contact.relative_speed_mps),
            wrong_lane_s: sums.wrong_lane_s,
            wrong_lane_m: sums.wrong_lane_m,
            wrong_lane_strict_s: sums.wrong_lane_strict_s,
            overspeed_s: sums.overspeed_s,
            overspeed_m: sums.overspeed_m,
            junction_s: sums.junction_s,
            standing_s: sums.standing_s,
            least_ttc_s: self.least_ttc_s,
            short_ttc_s: self.short_ttc_s,
            uncomfortable_longitudinal_s: comfort.longitudinal_s,
            uncomfortable_lateral_s: comfort.lateral_s,
            uncomfortable_yaw_rate_s: comfort.yaw_rate_s,
            uncomfortable_yaw_acceleration_s: comfort.yaw_acceleration_s,
            uncomfortable_longitudinal_jerk_s: comfort.longitudinal_jerk_s,
            uncomfortable_jerk_s: comfort.jerk_s,
            uncomfortable_s: comfort.any_s,
            longitudinal_jerk_mps2: comfort.longitudinal_jerk_mps2,
            steering_travel: self.steering_travel,
            fused: self.fused,
            lambda_sum: self.lambda_sum,
            variance_sum: self.variance_sum,
            attended: self.attended,
            attention_camera_sum: camera,
            attention_ralidar_sum: ralidar,
            attention_route_sum: route,
            attention_velocity_sum: velocity,
            ..begun(policy, suite, episode)
        }
    }
}

/// The row of an episode of which nothing is known but which it is.
pub fn begun(policy: &str, suite: &str, episode: &Episode) -> EpisodeRow {
    let Sky { illumination, weather } = episode.sky;
    EpisodeRow {
        policy: policy.to_string(),
        suite: suite.to_string(),
        condition: episode.condition.clone(),
        town: episode.town.clone(),
        traffic: episode.traffic.name().to_string(),
        weather: weather.name().to_string(),
        illumination: illumination.name().to_string(),
        episode: episode.number,
        seed: episode.seed,
        ..EpisodeRow::default()
    }
}

/// Whom the ego vehicle touched.
fn touched(contact: &Contact) -> &'static str {
    match contact.other {
        Other::Vehicle(kind) => kind.name(),
        Other::Walker(kind) => kind.name(),
        Other::Static => "static",
    }
}
