//! Parameters that the unit tests of several files share.

use skein_leader::params::{Between, Destination, PlannerParams, Strategy};
use skein_leader::routes::RouteParams;
use skein_leader::slots::Reformation;
use skein_protocol::Vec2;
use skein_protocol::formation::Shape;
use skein_protocol::scale::Scale;

/// The planning of a small swarm whose goal is 100 m ahead.
pub(crate) fn planner() -> PlannerParams {
    PlannerParams {
        drones: 8,
        strategy: Strategy::PaperRule,
        speed_mps: 10.0,
        headway_s: 4.0,
        by_words: false,
        speed_on_sight_mps: f64::INFINITY,
        routes: RouteParams { clearance_m: 15.0, half_gap_m: 15.0, planning_distance_m: 40.0, scale: Scale::FULL },
        shape: Shape::Line,
        spacing_m: 40.0,
        reformation: Reformation::Identity,
        arrival_error_m: 1.0,
        safe_distance_m: 30.0,
        course_y_m: 0.0,
        destination: Destination::Goal { front_m: Vec2::new(100.0, 0.0) },
        between: Between::CloseUp,
        radio_range_m: f64::INFINITY,
        debounce_s: 0.1,
    }
}
