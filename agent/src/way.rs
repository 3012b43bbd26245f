//! A drone's way past the obstacle sets ahead: its routes, the taut string through them, its places in queues.

use skein_leader::cost::{Flight, shortest, trips};
use skein_leader::funnel::{Corridor, RUN_OUT_M, Steering};
use skein_leader::ledger::Ledger;
use skein_leader::planned_set::PlannedSet;
use skein_leader::routes::{Body, Routes};
use skein_protocol::payload::{MAX_PLACES, QueuePlace};
use skein_protocol::{DroneId, PlanStamp, Vec2};

/// A dead drone that drifts by more than this makes the string be drawn anew, m.
const DRIFT_M: f64 = 1.0;

/// One set on the way.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Leg {
    place: QueuePlace,
    gate_x_m: f64,
    exit_x_m: f64,
    /// Still to be left.
    open: bool,
}

/// A way of one's own past a set for which no part has come yet.
#[derive(Clone, Debug)]
pub struct OwnWay {
    /// Short name of the set.
    pub tag: u32,
    /// The ways past it.
    pub routes: Routes,
    /// Which of them.
    pub route: usize,
}

/// The way, redrawn when something about it changes.
#[derive(Clone, Debug)]
pub struct Way {
    me: DroneId,
    course_y_m: f64,
    legs: Vec<Leg>,
    lane: Option<Corridor>,
    drawn: Option<(PlanStamp, bool, usize)>,
    /// Routes taken instead of those assigned, by set: an obstacle abreast or a body in the gap shut the other one off.
    detours: Vec<(u32, usize)>,
    bodies: Vec<Body>,
    cornered: bool,
    /// Taken when an obstacle is dangerously near and no leader said anything.
    pub own: Option<OwnWay>,
}

impl Way {
    /// A free way.
    #[must_use]
    pub fn new(me: DroneId, course_y_m: f64) -> Self {
        Self {
            me,
            course_y_m,
            legs: Vec::new(),
            lane: None,
            drawn: None,
            detours: Vec::new(),
            bodies: Vec::new(),
            cornered: false,
            own: None,
        }
    }

    /// Follows the ledger: takes up new parts, closes legs that are left, evades `bodies`, drones that hang dead in the air.
    pub fn update(&mut self, ledger: &Ledger, position: Vec2, bodies: &[Body]) {
        if self.own.as_ref().is_some_and(|own| {
            position.x >= own.routes.exit_x_m() || ledger.sets().iter().any(|set| set.parts.contains(self.me))
        }) {
            self.own = None;
        }
        let moved = self.bodies.len() != bodies.len()
            || self.bodies.iter().zip(bodies).any(|(old, new)| (old.centre_m - new.centre_m).norm() > DRIFT_M);
        let left = self.legs.iter().filter(|leg| position.x >= leg.exit_x_m).count();
        let key = (ledger.stamp(), self.own.is_some(), left);
        if self.drawn.is_none_or(|drawn| drawn.0 != key.0) {
            self.detours.clear();
        }
        let detoured = self.detour(ledger, position, bodies);
        if self.drawn == Some(key) && !moved && !detoured {
            return;
        }
        self.bodies.clear();
        self.bodies.extend_from_slice(bodies);
        self.draw(ledger, position);
        let left = self.legs.iter().filter(|leg| position.x >= leg.exit_x_m).count();
        self.drawn = Some((ledger.stamp(), self.own.is_some(), left));
    }

    /// The route it flies past a set, and its place in the queue.
    fn place(&self, set: &PlannedSet) -> Option<QueuePlace> {
        let part = set.parts.get(self.me).filter(|part| usize::from(part.route) < set.routes.count())?;
        let place = QueuePlace { remaining_m: 0.0, set: set.tag, route: part.route, rank: part.rank };
        Some(match self.detours.iter().find(|(tag, _)| *tag == set.tag) {
            Some((_, route)) => QueuePlace { route: *route as u16, rank: QueuePlace::NO_RANK, ..place },
            None => place,
        })
    }

    /// A drone that was driven to the wrong side of an obstacle, or whose route a body bars, takes the shortest of the
    /// routes still open to it.
    fn detour(&mut self, ledger: &Ledger, position: Vec2, bodies: &[Body]) -> bool {
        let (mut detoured, course_y_m) = (false, self.course_y_m);
        self.cornered = false;
        for set in ledger.sets().iter().filter(|set| position.x < set.routes.exit_x_m()) {
            let Some(route) = self.place(set).map(|place| usize::from(place.route)) else { continue };
            match way_round(&set.routes, route, course_y_m, position, bodies) {
                Outlook::Free => {}
                Outlook::Behind => self.cornered = true,
                Outlook::Round(open) => {
                    self.detours.retain(|(tag, _)| *tag != set.tag);
                    self.detours.push((set.tag, open));
                    detoured = true;
                }
            }
        }
        if let Some(own) = &mut self.own {
            match way_round(&own.routes, own.route, course_y_m, position, bodies) {
                Outlook::Free => {}
                Outlook::Behind => self.cornered = true,
                Outlook::Round(open) => (own.route, detoured) = (open, true),
            }
        }
        detoured
    }

    /// Whether a body bars the way, and every other one begins farther back.
    #[must_use]
    pub fn is_cornered(&self) -> bool {
        self.cornered
    }

    fn draw(&mut self, ledger: &Ledger, position: Vec2) {
        let mut legs: Vec<(QueuePlace, &Routes)> =
            ledger.sets().iter().filter_map(|set| self.place(set).map(|place| (place, &set.routes))).collect();
        if let Some(own) = &self.own {
            let route = own.route as u16;
            legs.push((QueuePlace { remaining_m: 0.0, set: own.tag, route, rank: QueuePlace::NO_RANK }, &own.routes));
        }
        legs.sort_by(|a, b| a.1.gate_x_m().total_cmp(&b.1.gate_x_m()));
        self.legs = legs
            .iter()
            .map(|&(place, routes)| Leg {
                place,
                gate_x_m: routes.gate_x_m(),
                exit_x_m: routes.exit_x_m(),
                open: position.x < routes.exit_x_m(),
            })
            .collect();
        let open: Vec<(&Routes, usize)> = legs
            .iter()
            .filter(|(_, routes)| position.x < routes.exit_x_m())
            .map(|&(place, routes)| (routes, usize::from(place.route)))
            .collect();
        self.lane = open
            .iter()
            .map(|(routes, _)| routes.exit_x_m())
            .reduce(f64::max)
            .map(|exit_x_m| Corridor::new(&open, &self.bodies, Vec2::new(exit_x_m + RUN_OUT_M, self.course_y_m)));
    }

    /// The next step along the way; `None` if nothing lies ahead.
    #[must_use]
    pub fn pull(&self, position: Vec2) -> Option<Steering> {
        self.lane.as_ref().map(|lane| lane.pull(position, self.first_gate()))
    }

    fn first_gate(&self) -> f64 {
        self.legs.iter().find(|leg| leg.open).map_or(f64::INFINITY, |leg| leg.gate_x_m)
    }

    /// Places in the queues of the sets ahead, and of those behind until the swarm re-forms; negative remaining paths
    /// past a gate. Unused entries have set 0.
    #[must_use]
    pub fn places(&self, position: Vec2) -> [QueuePlace; MAX_PLACES] {
        let mut places = [QueuePlace::default(); MAX_PLACES];
        let first = self.legs.len().saturating_sub(MAX_PLACES);
        for (place, leg) in places.iter_mut().zip(&self.legs[first..]) {
            *place = QueuePlace { remaining_m: self.remaining_m(leg, position), ..leg.place };
        }
        places
    }

    fn remaining_m(&self, leg: &Leg, position: Vec2) -> f64 {
        match &self.lane {
            Some(lane) if position.x < leg.gate_x_m => lane.pull(position, leg.gate_x_m).to_gate_m,
            _ => leg.gate_x_m - position.x,
        }
    }

    /// Whether a set is still to be left.
    #[must_use]
    pub fn is_open(&self) -> bool {
        self.lane.is_some()
    }

    /// Whether the set of this place is still to be left.
    #[must_use]
    pub fn is_open_set(&self, set: u32) -> bool {
        self.legs.iter().any(|leg| leg.open && leg.place.set == set)
    }
}

/// What becomes of a drone on its route.
enum Outlook {
    /// It goes on, or there is nothing better.
    Free,
    /// It takes this route instead.
    Round(usize),
    /// It has to go back first.
    Behind,
}

/// How a drone on `route` goes on: by the shortest of the routes that are open to it and not barred, if its own is none.
fn way_round(routes: &Routes, route: usize, course_y_m: f64, position: Vec2, bodies: &[Body]) -> Outlook {
    let barred = |route: usize| routes.is_barred(route, position, bodies);
    let free = |route: usize| routes.is_open(route, position) && !barred(route);
    if free(route) {
        return Outlook::Free;
    }
    let mut ways = trips(&[], routes, position, &Flight { speed_mps: 1.0, course_y_m });
    (0..ways.len()).filter(|&way| !free(way)).for_each(|way| ways[way].total_s = f64::INFINITY);
    match shortest(&ways) {
        way if free(way) => Outlook::Round(way),
        _ if barred(route) && (0..ways.len()).any(|way| !barred(way)) => Outlook::Behind,
        _ => Outlook::Free,
    }
}
