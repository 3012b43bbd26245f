//! Arrival times: how long a drone would take to the gate along a route if it were alone (paper, Alg. 3 and C1).

use crate::funnel::{Corridor, RUN_OUT_M};
use crate::routes::Routes;
use skein_protocol::Vec2;

/// How the swarm flies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Flight {
    /// Nominal speed, m/s.
    pub speed_mps: f64,
    /// The course line to return to, y in m.
    pub course_y_m: f64,
}

/// One drone's way along one route.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trip {
    /// a_ir: length of the taut string to the gate over the nominal speed, s; negative past the gate.
    pub arrival_s: f64,
    /// The same to its end on the course line, s.
    pub total_s: f64,
}

/// The way of a drone at `position` past `routes` along `route`. `earlier`: the sets it has still to leave before, with
/// its route past each.
#[must_use]
pub fn trip(earlier: &[(&Routes, usize)], routes: &Routes, route: usize, position: Vec2, flight: &Flight) -> Trip {
    let passages: Vec<(&Routes, usize)> = earlier.iter().copied().chain([(routes, route)]).collect();
    let exit_x_m = passages.iter().map(|(routes, _)| routes.exit_x_m()).fold(f64::NEG_INFINITY, f64::max);
    let lane = Corridor::new(&passages, &[], Vec2::new(exit_x_m + RUN_OUT_M, flight.course_y_m));
    let pull = lane.pull(position, routes.gate_x_m());
    Trip { arrival_s: pull.to_gate_m / flight.speed_mps, total_s: pull.total_m / flight.speed_mps }
}

/// The ways past `routes`, one a route; never on a route that obstacles abreast shut off, unless all are.
#[must_use]
pub fn trips(earlier: &[(&Routes, usize)], routes: &Routes, position: Vec2, flight: &Flight) -> Vec<Trip> {
    const NEVER: Trip = Trip { arrival_s: f64::INFINITY, total_s: f64::INFINITY };
    let open: Vec<bool> = (0..routes.count()).map(|route| routes.is_open(route, position)).collect();
    let shut = !open.contains(&true);
    let way = |route: usize| match shut || open[route] {
        true => trip(earlier, routes, route, position, flight),
        false => NEVER,
    };
    (0..routes.count()).map(way).collect()
}

/// The shortest way all in all; ties: to the right.
#[must_use]
pub fn shortest(trips: &[Trip]) -> usize {
    let least = |a: &usize, b: &usize| trips[*a].total_s.total_cmp(&trips[*b].total_s).then(a.cmp(b));
    (0..trips.len()).min_by(least).unwrap_or(0)
}
