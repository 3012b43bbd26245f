//! Follows a drone's routes past the obstacle sets ahead: the shortest path through them, and the places in their queues.

use crate::emergency_route::EmergencyRoute;
use crate::silent_drones::have_moved;
use crate::tuning::LONG_ROUTE;
use skein_leader::cost::{Flight, Trip, shortest, trips};
use skein_leader::funnel::{Corridor, Passage, Steering};
use skein_leader::ledger::Ledger;
use skein_leader::planned_set::PlannedSet;
use skein_leader::routes::{Body, Routes};
use skein_protocol::payload::{MAX_PLACES, QueuePlace};
use skein_protocol::{DroneId, PlanStamp, Vec2};
use std::cell::Cell;

/// One set on the path.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Leg {
    place: QueuePlace,
    gate_x_m: f64,
    exit_x_m: f64,
    /// Whether the drone has still to leave the set.
    open: bool,
    /// Whether the route leads between two obstacles.
    between: bool,
}

/// What the corridor was drawn for. When it changes, the corridor is drawn again.
#[derive(Clone, Copy, Debug, PartialEq)]
struct DrawnFor {
    stamp: PlanStamp,
    emergency: bool,
    legs_left: usize,
    /// How often outlines have grown.
    redrawn: usize,
}

/// A route taken instead of the assigned one, because an obstacle abreast or a body in the gap blocks that one. It is the assigned one
/// itself if the drone has only given up its place in the queue.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Detour {
    set: u32,
    route: usize,
}

/// Whether a drone can continue on its route.
enum RouteState {
    /// It continues, or no other route is better.
    Clear,
    /// It changes to this route.
    Detour(usize),
    /// A body blocks the route, and every other one begins farther back.
    Blocked,
}

/// A path through the corridor.
#[derive(Clone, Copy, Debug)]
struct Pulled {
    /// Where it begins, world frame, m.
    position: Vec2,
    /// Abscissa up to which it is measured, m.
    gate_x_m: f64,
    steering: Steering,
}

/// The routes of one drone and the corridor through them.
#[derive(Clone, Debug)]
pub struct RouteFollower {
    me: DroneId,
    course_y_m: f64,
    /// Of a swarm that is a crowd where it has room.
    squeeze: Option<f64>,
    legs: Vec<Leg>,
    corridor: Option<Corridor>,
    /// The last path through the corridor. It is asked for several times per tick.
    pulled: Cell<Option<Pulled>>,
    drawn_for: Option<DrawnFor>,
    /// Ordinate of the drone before it began to pass the sets ahead, m. A drone of a crowd returns to it.
    own_y_m: f64,
    detours: Vec<Detour>,
    bodies: Vec<Body>,
    blocked: bool,
    emergency: Option<EmergencyRoute>,
}

impl RouteFollower {
    /// A drone with nothing to pass. `course_y_m`: ordinate of the line to which its paths return, m. `squeeze`: of a swarm that is
    /// a crowd where it has room, see [`Routes::lane_m`].
    #[must_use]
    pub fn new(me: DroneId, course_y_m: f64, squeeze: Option<f64>) -> Self {
        Self {
            me,
            course_y_m,
            squeeze,
            legs: Vec::new(),
            corridor: None,
            pulled: Cell::new(None),
            drawn_for: None,
            own_y_m: course_y_m,
            detours: Vec::new(),
            bodies: Vec::new(),
            blocked: false,
            emergency: None,
        }
    }

    /// The set that the drone passes by a route of its own, if any.
    #[must_use]
    pub fn emergency_set(&self) -> Option<u32> {
        self.emergency.as_ref().map(EmergencyRoute::set)
    }

    /// Takes a route of the drone's own, until it is past the set or has an assignment for one of its obstacles.
    pub fn set_emergency(&mut self, route: EmergencyRoute) {
        self.emergency = Some(route);
    }

    /// Forgets the route of the drone's own.
    pub fn drop_emergency(&mut self) {
        self.emergency = None;
    }

    /// Gives up the place in the queue of the first set that the drone has still to leave. It keeps its route, and flies behind all
    /// others until a new plan gives it a place.
    pub fn give_up_place(&mut self) {
        let Some(leg) = self.legs.iter_mut().find(|leg| leg.open) else { return };
        if leg.place.rank != QueuePlace::NO_RANK {
            leg.place.rank = QueuePlace::NO_RANK;
            self.detours.push(Detour { set: leg.place.set, route: usize::from(leg.place.route) });
        }
    }

    /// Follows the ledger: accepts new assignments, closes the legs that the drone has left, and evades `bodies`, silent
    /// drones that hover. `position`: the drone's, world frame, m.
    pub fn update(&mut self, ledger: &Ledger, position: Vec2, bodies: &[Body]) {
        if self.emergency.as_ref().is_some_and(|own| {
            let planned = |set: &PlannedSet| set.parts.contains(self.me) && own.has_any_of(&set.ids);
            position.x >= own.routes().exit_x_m() || ledger.sets().iter().any(planned)
        }) {
            self.emergency = None;
        }
        let moved = have_moved(&self.bodies, bodies);
        let key = self.drawing_key(ledger, position);
        let drawn = self.drawn_for == Some(key);
        let same_plan = drawn || self.drawn_for.is_some_and(|drawn| drawn.stamp == key.stamp);
        if !same_plan {
            self.detours.clear();
            if !self.is_passing() {
                self.own_y_m = position.y;
            }
        }
        let grown = !drawn && same_plan && self.drawn_for.is_some_and(|drawn| drawn.redrawn != key.redrawn);
        let detoured = self.find_detours(ledger, position, bodies, grown);
        if !drawn || moved || detoured {
            self.bodies.clear();
            self.bodies.extend_from_slice(bodies);
            self.draw(ledger, position);
            self.drawn_for = Some(self.drawing_key(ledger, position));
        }
    }

    fn drawing_key(&self, ledger: &Ledger, position: Vec2) -> DrawnFor {
        let legs_left = self.legs.iter().filter(|leg| position.x >= leg.exit_x_m).count();
        DrawnFor { stamp: ledger.stamp(), emergency: self.emergency.is_some(), legs_left, redrawn: ledger.redrawn() }
    }

    /// The route that the drone flies past a set, and its place in the queue.
    fn place(&self, set: &PlannedSet) -> Option<QueuePlace> {
        let part = set.parts.get(self.me)?;
        let place = QueuePlace { remaining_m: 0.0, set: set.tag, route: part.route, rank: part.rank };
        let place = match self.detours.iter().find(|detour| detour.set == set.tag) {
            Some(detour) => QueuePlace { route: detour.route as u16, rank: QueuePlace::NO_RANK, ..place },
            None => place,
        };
        Some(place).filter(|place| usize::from(place.route) < set.routes.count())
    }

    /// Finds another route wherever the drone was driven to the wrong side of an obstacle, or a body blocks its route, or the route is
    /// gone or has become much longer than another one because outlines have `grown`. Returns whether a route has changed.
    fn find_detours(&mut self, ledger: &Ledger, position: Vec2, bodies: &[Body], grown: bool) -> bool {
        let (mut detoured, course_y_m) = (false, self.course_y_m);
        self.blocked = false;
        for set in ledger.sets().iter().filter(|set| position.x < set.routes.exit_x_m()) {
            if set.parts.get(self.me).is_none() {
                continue;
            }
            let state = match self.place(set) {
                Some(place) => {
                    let route = usize::from(place.route);
                    match route_state(&set.routes, route, course_y_m, position, bodies) {
                        RouteState::Clear if grown => shorter_route(&set.routes, route, course_y_m, position, bodies)
                            .map_or(RouteState::Clear, RouteState::Detour),
                        state => state,
                    }
                }
                None => RouteState::Detour(open_route(&set.routes, course_y_m, position, bodies)),
            };
            match state {
                RouteState::Clear => {}
                RouteState::Blocked => self.blocked = true,
                RouteState::Detour(open) => {
                    self.detours.retain(|detour| detour.set != set.tag);
                    self.detours.push(Detour { set: set.tag, route: open });
                    detoured = true;
                }
            }
        }
        if let Some(own) = &mut self.emergency {
            match route_state(own.routes(), own.route(), course_y_m, position, bodies) {
                RouteState::Clear => {}
                RouteState::Blocked => self.blocked = true,
                RouteState::Detour(open) => {
                    own.change_to(open);
                    detoured = true;
                }
            }
        }
        detoured
    }

    /// Whether a body blocks the drone's route, and every other route begins farther back.
    #[must_use]
    pub fn is_blocked(&self) -> bool {
        self.blocked
    }

    fn draw(&mut self, ledger: &Ledger, position: Vec2) {
        let mut passages: Vec<(QueuePlace, &Routes)> =
            ledger.sets().iter().filter_map(|set| self.place(set).map(|place| (place, &set.routes))).collect();
        if let Some(own) = &self.emergency {
            let (set, route) = (own.set(), own.route() as u16);
            passages.push((QueuePlace { remaining_m: 0.0, set, route, rank: QueuePlace::NO_RANK }, own.routes()));
        }
        passages.sort_by(|a, b| a.1.gate_x_m().total_cmp(&b.1.gate_x_m()));
        self.legs = passages
            .iter()
            .map(|&(place, routes)| Leg {
                place,
                gate_x_m: routes.gate_x_m(),
                exit_x_m: routes.exit_x_m(),
                open: position.x < routes.exit_x_m(),
                between: routes.is_between(usize::from(place.route)),
            })
            .collect();
        let lane_m =
            |routes: &Routes, route| self.squeeze.map_or(0.0, |squeeze| routes.lane_m(route, self.own_y_m, squeeze));
        let open: Vec<Passage<'_>> = passages
            .iter()
            .filter(|(_, routes)| position.x < routes.exit_x_m())
            .map(|&(place, routes)| (routes, usize::from(place.route)))
            .map(|(routes, route)| Passage { routes, route, lane_m: lane_m(routes, route) })
            .collect();
        let last_exit_x_m = open.iter().map(|passage| passage.routes.exit_x_m()).reduce(f64::max);
        let run_out_m = open.first().map_or(0.0, |passage| passage.routes.run_out_m());
        let end_y_m = self.squeeze.map_or(self.course_y_m, |_| self.own_y_m);
        let end = last_exit_x_m.map(|exit_x_m| Vec2::new(exit_x_m + run_out_m, end_y_m));
        self.pulled.set(None);
        self.corridor = end.map(|end| Corridor::in_lanes(&open, &self.bodies, end));
    }

    /// Direction and remaining length of the path from `position` (world frame, m); `None` if nothing lies ahead.
    #[must_use]
    pub fn steering(&self, position: Vec2) -> Option<Steering> {
        self.corridor.as_ref().map(|corridor| self.pull(corridor, position, self.first_gate_x_m()))
    }

    /// As [`Corridor::pull`], for this drone's corridor.
    fn pull(&self, corridor: &Corridor, position: Vec2, gate_x_m: f64) -> Steering {
        let known = self.pulled.get().filter(|known| (known.position, known.gate_x_m) == (position, gate_x_m));
        let steering = known.map_or_else(|| corridor.pull(position, gate_x_m), |known| known.steering);
        self.pulled.set(Some(Pulled { position, gate_x_m, steering }));
        steering
    }

    /// Where the route ends, world frame, m; `None` if nothing lies ahead.
    #[must_use]
    pub fn end(&self) -> Option<Vec2> {
        self.corridor.as_ref().map(Corridor::target)
    }

    /// Where the first leg of the route ends (world frame, m), if that leg alone is not free; otherwise `None`.
    #[must_use]
    pub fn turn_if_blocked(&self, position: Vec2, is_free: impl Fn(Vec2, Vec2) -> bool) -> Option<Vec2> {
        let (mut turn, mut free) = (None, true);
        self.corridor.as_ref()?.visit_legs(position, |from, to| match turn {
            None => turn = Some((to, is_free(from, to))),
            Some(_) => free = free && is_free(from, to),
        });
        turn.filter(|(_, first_free)| !first_free && free).map(|(to, _)| to)
    }

    /// Where the route ends (world frame, m), if a leg of it is not free; `None` if all are, or nothing lies ahead.
    #[must_use]
    pub fn end_if_blocked(&self, position: Vec2, is_free: impl Fn(Vec2, Vec2) -> bool) -> Option<Vec2> {
        let corridor = self.corridor.as_ref()?;
        let mut free = true;
        corridor.visit_legs(position, |from, to| free = free && is_free(from, to));
        (!free).then(|| corridor.target())
    }

    fn first_gate_x_m(&self) -> f64 {
        self.legs.iter().find(|leg| leg.open).map_or(f64::INFINITY, |leg| leg.gate_x_m)
    }

    /// The places in the queues of the sets ahead, and of those behind until the swarm re-forms. Past a gate the remaining
    /// path is negative. Unused entries have set 0.
    #[must_use]
    pub fn places(&self, position: Vec2) -> [QueuePlace; MAX_PLACES] {
        let mut places = [QueuePlace::default(); MAX_PLACES];
        let first = self.legs.len().saturating_sub(MAX_PLACES);
        for (place, leg) in places.iter_mut().zip(&self.legs[first..]) {
            *place = QueuePlace { remaining_m: self.remaining_m(leg, position), ..leg.place };
        }
        places
    }

    /// Whether the route of a place leads between two obstacles.
    #[must_use]
    pub fn leads_between(&self, place: QueuePlace) -> bool {
        self.legs.iter().any(|leg| leg.place.set == place.set && leg.between)
    }

    /// Of these places, those in a queue; the other entries get set 0. Drones that pass side by side, as a crowd, have no queue.
    #[must_use]
    pub fn queues(&self, places: &[QueuePlace; MAX_PLACES]) -> [QueuePlace; MAX_PLACES] {
        let is_in_crowd = |place: QueuePlace| self.squeeze.is_some() && !self.leads_between(place);
        places.map(|place| if is_in_crowd(place) { QueuePlace::default() } else { place })
    }

    /// Of these places, those whose sets the drone has still to leave; the other entries get set 0.
    #[must_use]
    pub fn open_places(&self, mut places: [QueuePlace; MAX_PLACES]) -> [QueuePlace; MAX_PLACES] {
        for place in &mut places {
            if !self.legs.iter().any(|leg| leg.open && leg.place.set == place.set) {
                *place = QueuePlace::default();
            }
        }
        places
    }

    fn remaining_m(&self, leg: &Leg, position: Vec2) -> f64 {
        match &self.corridor {
            Some(corridor) if position.x < leg.gate_x_m => self.pull(corridor, position, leg.gate_x_m).to_gate_m,
            _ => leg.gate_x_m - position.x,
        }
    }

    /// Whether the drone has still to leave a set.
    #[must_use]
    pub fn is_passing(&self) -> bool {
        self.corridor.is_some()
    }
}

/// Whether a drone on `route` can continue. If not, it takes the shortest of the routes that are open to it and that no
/// body blocks.
fn route_state(routes: &Routes, route: usize, course_y_m: f64, position: Vec2, bodies: &[Body]) -> RouteState {
    let barred = |route: usize| routes.is_barred(route, position, bodies);
    let free = |route: usize| routes.is_open(route, position) && !barred(route);
    if free(route) {
        return RouteState::Clear;
    }
    match open_route(routes, course_y_m, position, bodies) {
        other if free(other) => RouteState::Detour(other),
        _ if barred(route) && (0..routes.count()).any(|other| !barred(other)) => RouteState::Blocked,
        _ => RouteState::Clear,
    }
}

/// The shortest of the routes that are open to a drone and that no body blocks, or the rightmost one if there is none.
fn open_route(routes: &Routes, course_y_m: f64, position: Vec2, bodies: &[Body]) -> usize {
    shortest(&open_trips(routes, course_y_m, position, bodies))
}

/// The shortest of the same routes, if `route` is much longer.
fn shorter_route(routes: &Routes, route: usize, course_y_m: f64, position: Vec2, bodies: &[Body]) -> Option<usize> {
    let trips = open_trips(routes, course_y_m, position, bodies);
    let best = shortest(&trips);
    (trips[route].total_s > LONG_ROUTE * trips[best].total_s).then_some(best)
}

/// The trips along all routes. Those along routes that are not open to a drone, or that a body blocks, take for ever.
fn open_trips(routes: &Routes, course_y_m: f64, position: Vec2, bodies: &[Body]) -> Vec<Trip> {
    let mut trips = trips(&[], routes, position, &Flight { speed_mps: 1.0, course_y_m });
    for (route, trip) in trips.iter_mut().enumerate() {
        if !routes.is_open(route, position) || routes.is_barred(route, position, bodies) {
            trip.total_s = f64::INFINITY;
        }
    }
    trips
}
