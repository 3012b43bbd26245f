//! What a leader finds out about an obstacle set before it plans for it.

use crate::cost::{Trip, shortest, trip, trips};
use crate::ledger::Ledger;
use crate::member::Member;
use crate::plan_exchange;
use crate::planned_set::PlannedSet;
use crate::routes::Routes;
use crate::set_place::SetPlace;
use crate::situation::Situation;
use skein_protocol::payload::Arrivals;
use skein_protocol::{DroneId, ObstacleId};
use std::collections::BTreeMap;

/// The routes past an obstacle set, each member's trip along each of them, and the assignments that members already
/// have. All lists are in the order of the members.
pub(crate) struct Survey<'a> {
    routes: Routes,
    /// One trip per member and route.
    trips: Vec<Vec<Trip>>,
    kept: Vec<Option<&'a SetPlace>>,
    /// The number that each route of the assignments which members already have bears now.
    numbers: Vec<usize>,
}

impl<'a> Survey<'a> {
    /// Surveys a set. `None` if one of its obstacles is not known.
    pub(crate) fn new(s: &Situation<'a>, set: &[ObstacleId]) -> Option<Self> {
        let before = s.ledger.sets().iter().find(|p| p.ids == *set);
        Self::of(s, set, |drone| before.and_then(|p| p.parts.get(drone)))
    }

    /// The same survey, with the assignments that members had at an earlier time.
    pub(crate) fn with_kept(
        s: &Situation<'a>,
        set: &[ObstacleId],
        kept: &'a BTreeMap<DroneId, SetPlace>,
    ) -> Option<Self> {
        Self::of(s, set, |drone| kept.get(&drone))
    }

    /// Surveys a set past which some members have these assignments already. A member stays on its route even if it could not take that
    /// route any more from where it is now.
    fn of(s: &Situation<'a>, set: &[ObstacleId], kept: impl Fn(DroneId) -> Option<&'a SetPlace>) -> Option<Self> {
        let routes = Routes::new(&s.obstacles.shapes(set)?, &s.params.routes);
        let kept: Vec<Option<&SetPlace>> = s.members.iter().map(|m| kept(m.id)).collect();
        let before = s.ledger.sets().iter().find(|p| p.ids == *set);
        let numbers: Vec<usize> = match before {
            Some(p) => (0..p.routes.count()).map(|number| routes.like(&p.routes, number)).collect(),
            None => (0..routes.count()).collect(),
        };
        let member_trips = |(m, kept): (&Member, &Option<&SetPlace>)| {
            let earlier = earlier_legs(s.ledger, m, &routes);
            let mut trips = trips(&earlier, &routes, m.position, &s.params.flight(m.position));
            if let Some(&route) = kept.and_then(|part| numbers.get(usize::from(part.route)))
                && let Some(flown) = trips.get_mut(route)
                && flown.arrival_s.is_infinite()
            {
                *flown = trip_along(s, m, &routes, route);
            }
            trips
        };
        let trips: Vec<Vec<Trip>> = s.members.iter().zip(&kept).map(member_trips).collect();
        Some(Self { routes, trips, kept, numbers })
    }

    /// The routes past the set.
    pub(crate) fn routes(&self) -> &Routes {
        &self.routes
    }

    /// The assignments that members already have for the set.
    pub(crate) fn kept(&self) -> &[Option<&'a SetPlace>] {
        &self.kept
    }

    /// The places in queues that members already have.
    pub(crate) fn kept_ranks(&self) -> Vec<Option<u16>> {
        self.kept.iter().map(|part| part.map(|part| part.rank)).collect()
    }

    /// Time of each member to the gate along each route, s from now.
    pub(crate) fn arrivals_s(&self) -> Vec<Vec<f64>> {
        self.trips.iter().map(|trips| trips.iter().map(|trip| trip.arrival_s).collect()).collect()
    }

    /// Time of one member to the gate along one route, s from now. Finite, also if the member could not take the route any more: it was
    /// chosen a moment ago.
    pub(crate) fn arrival_s(&self, s: &Situation<'_>, member: usize, route: usize) -> f64 {
        let arrival_s = self.trips[member][route].arrival_s;
        if arrival_s.is_finite() { arrival_s } else { trip_along(s, &s.members[member], &self.routes, route).arrival_s }
    }

    /// The route of a member that has no choice: it already flies one, or is past the gate, or joins a queue that is
    /// already flying.
    pub(crate) fn settled(&self, members: &[Member], i: usize) -> Option<usize> {
        match self.kept[i] {
            Some(part) if usize::from(part.route) < self.numbers.len() => Some(self.numbers[usize::from(part.route)]),
            _ if members[i].position.x >= self.routes.gate_x_m() => Some(shortest(&self.trips[i])),
            _ if self.kept.iter().any(Option::is_some) => Some(shortest(&self.trips[i])),
            _ => None,
        }
    }

    /// The shortest route of a member.
    pub(crate) fn shortest(&self, member: usize) -> usize {
        shortest(&self.trips[member])
    }

    /// What other leaders are told about the members: one row per member.
    pub(crate) fn rows(&self, s: &Situation<'_>, tag: u32) -> Vec<Arrivals> {
        let row = |i: usize| {
            let arrivals_s = self.open_arrivals_s(s.members, i);
            plan_exchange::row(s.now, s.ballot, s.scope, s.members[i].id, tag, &arrivals_s)
        };
        (0..s.members.len()).map(row).collect()
    }

    /// Arrivals of a member, s from now. Infinite on all routes but the settled one, if there is one.
    fn open_arrivals_s(&self, members: &[Member], i: usize) -> Vec<f64> {
        let settled = self.settled(members, i);
        let open = |route: usize| settled.is_none_or(|settled| settled == route);
        let trips = self.trips[i].iter().enumerate();
        trips.map(|(route, trip)| if open(route) { trip.arrival_s } else { f64::INFINITY }).collect()
    }
}

/// A member's trip along one route, whether obstacles abreast of it close that route or not.
fn trip_along(s: &Situation<'_>, member: &Member, routes: &Routes, route: usize) -> Trip {
    trip(&earlier_legs(s.ledger, member, routes), routes, route, member.position, &s.params.flight(member.position))
}

/// The sets before `routes` that a member still has to leave, with its route past each.
fn earlier_legs<'a>(ledger: &'a Ledger, member: &Member, routes: &Routes) -> Vec<(&'a Routes, usize)> {
    let leg = |p: &'a PlannedSet| {
        let route = usize::from(p.parts.get(member.id)?.route);
        let ahead = p.routes.gate_x_m() < routes.gate_x_m() && member.position.x < p.routes.exit_x_m();
        (ahead && route < p.routes.count()).then_some((&p.routes, route))
    };
    ledger.sets().iter().filter_map(leg).collect()
}
