//! Arrival times: how long a drone would take to the gate along a route if it were alone (paper, Alg. 3 and C1).

use crate::funnel::Corridor;
use crate::routes::Routes;
use skein_protocol::Vec2;

/// The nominal flight of the swarm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Flight {
    /// Nominal speed, m/s.
    pub speed_mps: f64,
    /// The course line to return to, y in m.
    pub course_y_m: f64,
}

/// One drone's path along one route, were it alone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trip {
    /// a_ir: time to the gate at nominal speed along the shortest path, s; negative past the gate.
    pub arrival_s: f64,
    /// Time to the end of the path on the course line, s.
    pub total_s: f64,
}

/// The trip of a drone at `position` (world frame, m) past `routes` along `route`. `earlier`: the sets that it has to leave
/// before, with its route past each.
#[must_use]
pub fn trip(earlier: &[(&Routes, usize)], routes: &Routes, route: usize, position: Vec2, flight: &Flight) -> Trip {
    let passages: Vec<(&Routes, usize)> = earlier.iter().copied().chain([(routes, route)]).collect();
    let exit_x_m = passages.iter().map(|(routes, _)| routes.exit_x_m()).fold(f64::NEG_INFINITY, f64::max);
    let corridor = Corridor::new(&passages, &[], Vec2::new(exit_x_m + routes.run_out_m(), flight.course_y_m));
    let steering = corridor.pull(position, routes.gate_x_m());
    Trip { arrival_s: steering.to_gate_m / flight.speed_mps, total_s: steering.total_m / flight.speed_mps }
}

/// The trips past `routes`, one per route. Infinite on a route that obstacles abreast of the drone close, unless all routes
/// are closed.
#[must_use]
pub fn trips(earlier: &[(&Routes, usize)], routes: &Routes, position: Vec2, flight: &Flight) -> Vec<Trip> {
    const NEVER: Trip = Trip { arrival_s: f64::INFINITY, total_s: f64::INFINITY };
    let open: Vec<bool> = (0..routes.count()).map(|route| routes.is_open(route, position)).collect();
    let shut = !open.contains(&true);
    let trip_of =
        |route: usize| if shut || open[route] { trip(earlier, routes, route, position, flight) } else { NEVER };
    (0..routes.count()).map(trip_of).collect()
}

/// The route with the shortest trip. The rightmost one wins a tie.
#[must_use]
pub fn shortest(trips: &[Trip]) -> usize {
    let least = |a: &usize, b: &usize| trips[*a].total_s.total_cmp(&trips[*b].total_s).then(a.cmp(b));
    (0..trips.len()).min_by(least).unwrap_or(0)
}
