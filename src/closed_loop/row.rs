//! What is kept of an episode: sums, from which every metric can be recomputed.

use serde::{Deserialize, Serialize};

/// One episode of one policy, as a row of `episodes.parquet`. No wall time is in it: the same suite
/// driven twice gives the same bytes.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct EpisodeRow {
    pub policy: String,
    /// Name of the suite.
    pub suite: String,
    /// Group of tasks that the suite puts its town in, as the paper's table I: "training conditions".
    pub condition: String,
    pub town: String,
    /// empty, few, regular, dense.
    pub traffic: String,
    /// clear, drizzle, rainy, storm.
    pub weather: String,
    /// daytime, sunset, night, dark.
    pub illumination: String,
    /// Number within the task (town and traffic), from 0.
    pub episode: u32,
    /// Of the suite: with the town and the number, all that the episode is drawn from.
    pub seed: u64,
    /// Agents that there are.
    pub vehicles: u32,
    pub pedestrians: u32,
    pub route_m: f64,
    /// Metres along the route that the car came.
    pub progress_m: f64,
    pub driven_m: f64,
    pub duration_s: f64,
    pub time_limit_s: f64,
    /// From the centre of the car to the goal at the end.
    pub goal_m: f64,
    /// The goal was reached in time, without a contact.
    pub success: bool,
    /// goal, collision-vehicle, collision-pedestrian, collision-static, timeout, off-route; or crashed:
    /// the policy gave an error, which is no failure to drive and counts apart.
    pub reason: String,
    /// What the policy said when it crashed.
    pub error: Option<String>,
    /// What was touched: car, van, bus, adult, ..., or static.
    pub touched: Option<String>,
    /// Whether the ego vehicle caused the contact.
    pub at_fault: Option<bool>,
    /// Length of the difference of both velocities at the contact.
    pub impact_mps: Option<f64>,
    pub wrong_lane_s: f64,
    pub wrong_lane_m: f64,
    pub wrong_lane_strict_s: f64,
    pub overspeed_s: f64,
    pub overspeed_m: f64,
    pub junction_s: f64,
    pub standing_s: f64,
    /// Least time to a collision with any body, if both keep their velocities; `None` if none would
    /// touch within 3 s in the whole episode.
    pub least_ttc_s: Option<f64>,
    /// Time in which that was below 0.95 s.
    pub short_ttc_s: f64,
    /// Time outside nuPlan's bounds of comfort, of each.
    pub uncomfortable_longitudinal_s: f64,
    pub uncomfortable_lateral_s: f64,
    pub uncomfortable_yaw_rate_s: f64,
    pub uncomfortable_yaw_acceleration_s: f64,
    pub uncomfortable_longitudinal_jerk_s: f64,
    pub uncomfortable_jerk_s: f64,
    /// Outside at least one of them.
    pub uncomfortable_s: f64,
    /// Integral of the absolute jerk along the way, m/s3 times s.
    pub longitudinal_jerk_mps2: f64,
    /// Sum of the changes of steering, whole lock from middle to end = 1.
    pub steering_travel: f64,
    /// Decisions that were fused of two actions; sums over them.
    pub fused: u64,
    pub lambda_sum: f64,
    /// Of eq. (3)'s S.
    pub variance_sum: f64,
    /// Decisions with attention shares; sums over them.
    pub attended: u64,
    pub attention_camera_sum: f64,
    pub attention_ralidar_sum: f64,
    pub attention_route_sum: f64,
    pub attention_velocity_sum: f64,
}
