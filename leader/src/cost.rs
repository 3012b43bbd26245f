//! Arrival times: how long a drone would take to the gate along a route if it were alone (paper, Alg. 3 and C1).

use crate::routes::Routes;
use crate::string::{Lane, RUN_OUT_M};
use skein_protocol::Vec2;

/// How the swarm flies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Flight {
    /// Nominal speed, m/s.
    pub speed_mps: f64,
    /// The course line to return to, y in m.
    pub course_y_m: f64,
}

/// a_ir: length of the taut string from `position` to the gate of `routes` along `route`, over the nominal speed, s;
/// negative past the gate. `earlier`: the sets the drone has still to leave before, with its route past each.
#[must_use]
pub fn arrival_s(earlier: &[(&Routes, usize)], routes: &Routes, route: usize, position: Vec2, flight: &Flight) -> f64 {
    let passages: Vec<(&Routes, usize)> = earlier.iter().copied().chain([(routes, route)]).collect();
    let exit_x_m = passages.iter().map(|(routes, _)| routes.exit_x_m()).fold(f64::NEG_INFINITY, f64::max);
    let lane = Lane::new(&passages, &[], Vec2::new(exit_x_m + RUN_OUT_M, flight.course_y_m));
    lane.pull(position, routes.gate_x_m()).to_gate_m / flight.speed_mps
}
