//! Exact grouping (paper, Algorithm 3): which drone takes which route, so that the last one passes as early as possible
//! (C1).
//!
//! On each route, drones pass in order of arrival, a headway apart. With slots counted from the last, drone i can take
//! slot m of route r if a_ir + m·h_r ≤ T. A search finds the least T for which all drones have a slot. Among the groupings
//! that reach it, the one of least total arrival is taken. This is exact and takes polynomial time. Times are counted in
//! whole microseconds, so that ties are exact.

//!
//! # Example
//!
//! Three drones, two routes. All would arrive first on route 0, but they would have to queue there.
//!
//! ```
//! use skein_leader::split::ArrivalTable;
//!
//! let arrivals = [vec![10.0, 11.0], vec![10.0, 11.0], vec![10.0, 14.0]];
//! let table = ArrivalTable::new(&arrivals, &[2.0, 2.0])?;
//! let best = table.split();
//! assert_eq!(best.makespan_s, 12.0);
//! assert_eq!(table.shortest().makespan_s, 14.0);
//! # Ok::<(), skein_leader::split::SplitError>(())
//! ```

use crate::matroid_intersection::{Cost, place};
use thiserror::Error;

const MICROS: f64 = 1e6;
/// Arrivals later than this count as never, s. It keeps all sums in range.
pub(crate) const NEVER_S: f64 = 1e6;

/// What is wrong with a table of arrivals.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum SplitError {
    /// A row has another length than there are headways.
    #[error("drone {drone} has {found} arrival times, expected one for each of the {expected} routes")]
    Columns {
        /// The row.
        drone: usize,
        /// Its length.
        found: usize,
        /// Number of headways.
        expected: usize,
    },
    /// A headway is negative or not finite.
    #[error("the headway of route {route} is {headway_s} s, expected a finite time that is not negative")]
    Headway {
        /// The column.
        route: usize,
        /// The headway given, s.
        headway_s: f64,
    },
    /// An arrival is not a number.
    #[error("the arrival of drone {drone} on route {route} is not a number")]
    Arrival {
        /// The row.
        drone: usize,
        /// The column.
        route: usize,
    },
    /// A drone cannot take any route.
    #[error("drone {drone} has no usable route, expected a finite arrival on at least one")]
    NoRoute {
        /// The row.
        drone: usize,
    },
    /// The wanted numbers of drones for each route do not fit.
    #[error("no grouping of {drones} drones has the wanted number of drones on each route")]
    Counts {
        /// Number of rows.
        drones: usize,
    },
    /// An assignment does not name a usable route for each drone.
    #[error("the assignment does not name a usable route for each of the {drones} drones")]
    Assignment {
        /// Number of rows.
        drones: usize,
    },
}

/// When each drone would pass on each route if it were alone, and the headway of each route.
#[derive(Clone, Debug, PartialEq)]
pub struct ArrivalTable {
    /// By drone and route, µs. `None` where the drone cannot take the route.
    arrivals: Vec<Vec<Option<Cost>>>,
    headways: Vec<Cost>,
}

/// A grouping. Drones are the rows of the table, routes its columns.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RouteAssignment {
    /// Route of each drone.
    pub routes: Vec<usize>,
    /// Drones on each route in the order in which they pass: by arrival, then by row.
    pub queues: Vec<Vec<usize>>,
    /// When each drone passes: t₁ = a₁, t_k = max(a_k, t_{k−1} + h), s.
    pub pass_s: Vec<f64>,
    /// T: when the last drone passes (paper, C1), s; 0 without drones.
    pub makespan_s: f64,
    /// Sum of the drones' own arrivals, s.
    pub total_s: f64,
}

impl ArrivalTable {
    /// Checks arrivals `[drone][route]` (s; infinite: not usable; negative: already passed) and the headway of each route
    /// (s).
    ///
    /// # Errors
    /// [`SplitError`] for a row of the wrong length or without a usable route, and for bad numbers.
    pub fn new(arrivals: &[Vec<f64>], headway_s: &[f64]) -> Result<Self, SplitError> {
        for (route, &headway_s) in headway_s.iter().enumerate() {
            if !(0.0..NEVER_S).contains(&headway_s) {
                return Err(SplitError::Headway { route, headway_s });
            }
        }
        for (drone, row) in arrivals.iter().enumerate() {
            if row.len() != headway_s.len() {
                return Err(SplitError::Columns { drone, found: row.len(), expected: headway_s.len() });
            }
            if let Some(route) = row.iter().position(|a| a.is_nan()) {
                return Err(SplitError::Arrival { drone, route });
            }
            if !row.iter().any(|a| a.abs() < NEVER_S) {
                return Err(SplitError::NoRoute { drone });
            }
        }
        let arrival = |&s: &f64| (s.abs() < NEVER_S).then(|| micros(s));
        Ok(Self {
            arrivals: arrivals.iter().map(|row| row.iter().map(arrival).collect()).collect(),
            headways: headway_s.iter().map(|&h| micros(h)).collect(),
        })
    }

    /// The grouping of least makespan; among those, one of least total arrival.
    #[must_use]
    pub fn split(&self) -> RouteAssignment {
        let unlimited = vec![self.arrivals.len(); self.headways.len()];
        self.least(&unlimited).expect("every drone has a usable route, and every route a slot for every drone")
    }

    /// The best grouping with `counts[route]` drones on each route, with the same tie-break.
    ///
    /// # Errors
    /// [`SplitError::Counts`] if there is no such grouping.
    pub fn fixed(&self, counts: &[usize]) -> Result<RouteAssignment, SplitError> {
        let drones = self.arrivals.len();
        let sum = counts.iter().try_fold(0usize, |sum, &count| sum.checked_add(count));
        if counts.len() != self.headways.len() || sum != Some(drones) {
            return Err(SplitError::Counts { drones });
        }
        self.least(counts)
    }

    /// Each drone on the route on which it arrives first, whatever the others do. The rightmost one wins a tie.
    #[must_use]
    pub fn shortest(&self) -> RouteAssignment {
        let nearest = |row: &Vec<Option<Cost>>| {
            let usable = row.iter().enumerate().filter_map(|(route, &arrival)| Some((arrival?, route)));
            usable.min().map_or(0, |best| best.1)
        };
        self.queued(self.arrivals.iter().map(nearest).collect())
    }

    /// Queues and pass times of an assignment, `routes[drone]`.
    ///
    /// # Errors
    /// [`SplitError::Assignment`] if it does not name a usable route for each drone.
    pub fn assigned(&self, routes: &[usize]) -> Result<RouteAssignment, SplitError> {
        let usable = |(row, &route): (&Vec<Option<Cost>>, &usize)| row.get(route).is_some_and(Option::is_some);
        if routes.len() != self.arrivals.len() || !self.arrivals.iter().zip(routes).all(usable) {
            return Err(SplitError::Assignment { drones: self.arrivals.len() });
        }
        Ok(self.queued(routes.to_vec()))
    }

    /// The least makespan, s: [`ArrivalTable::split`] without its tie-break, in a fraction of the time.
    #[must_use]
    pub fn least_makespan_s(&self) -> f64 {
        let unlimited = vec![self.arrivals.len(); self.headways.len()];
        self.search(&unlimited, &self.costs()).map_or(0.0, seconds)
    }

    /// The grouping of least makespan with at most `limits[route]` drones on each route; among those, one of least total.
    fn least(&self, limits: &[usize]) -> Result<RouteAssignment, SplitError> {
        let costs = self.costs();
        let makespan = self.search(limits, &costs)?;
        let routes = place(&self.caps(makespan, limits), &costs, true);
        Ok(self.queued(routes.ok_or(SplitError::Counts { drones: self.arrivals.len() })?))
    }

    fn costs(&self) -> Vec<Vec<Cost>> {
        self.arrivals.iter().map(|row| row.iter().map(|a| a.unwrap_or(Cost::MAX)).collect()).collect()
    }

    /// The least makespan with at most `limits[route]` drones on each route.
    fn search(&self, limits: &[usize], costs: &[Vec<Cost>]) -> Result<Cost, SplitError> {
        let fit = |makespan: Cost| place(&self.caps(makespan, limits), costs, false);
        let drones = self.arrivals.len() as Cost;
        let finite = || self.arrivals.iter().flat_map(|row| row.iter().flatten());
        let slowest = finite().max().copied().unwrap_or(0) + drones * self.headways.iter().max().unwrap_or(&0);
        let routes = fit(slowest).ok_or(SplitError::Counts { drones: drones as usize })?;
        let mut reached = self.makespan(&routes);
        let mut missed = finite().min().copied().unwrap_or(0) - 1;
        while missed < reached - 1 {
            let middle = missed + (reached - missed) / 2;
            match fit(middle) {
                Some(routes) => reached = self.makespan(&routes),
                None => missed = middle,
            }
        }
        Ok(reached)
    }

    /// Number of slots of each route that each drone can use if the last one passes at `makespan`.
    fn caps(&self, makespan: Cost, limits: &[usize]) -> Vec<Vec<u32>> {
        let cap = |(route, arrival): (usize, &Option<Cost>)| match *arrival {
            Some(arrival) if arrival <= makespan => {
                let slots = (makespan - arrival).checked_div(self.headways[route]).map_or(Cost::MAX, |m| m + 1);
                slots.min(limits[route] as Cost) as u32
            }
            _ => 0,
        };
        self.arrivals.iter().map(|row| row.iter().enumerate().map(cap).collect()).collect()
    }

    /// The drones on one route in the order in which they pass, with their arrivals.
    fn queue(&self, routes: &[usize], route: usize) -> Vec<(Cost, usize)> {
        let on_route = (0..routes.len()).filter(|&drone| routes[drone] == route);
        let mut queue: Vec<_> = on_route.filter_map(|drone| Some((self.arrivals[drone][route]?, drone))).collect();
        queue.sort_unstable();
        queue
    }

    /// The turn of a drone in the paper's queue: a headway after the drone before it.
    fn by_headway(&self, route: usize) -> impl Fn(Cost, Cost) -> Cost {
        let headway = self.headways[route];
        move |before, _| before + headway
    }

    fn makespan(&self, routes: &[usize]) -> Cost {
        let last = |route| passes(&self.queue(routes, route), self.by_headway(route)).last();
        (0..self.headways.len()).filter_map(last).max().unwrap_or(0)
    }

    fn queued(&self, routes: Vec<usize>) -> RouteAssignment {
        let mut pass_s = vec![0.0; routes.len()];
        let mut total = 0;
        let mut queues = Vec::with_capacity(self.headways.len());
        for route in 0..self.headways.len() {
            let queue = self.queue(&routes, route);
            for (pass, &(arrival, drone)) in passes(&queue, self.by_headway(route)).zip(&queue) {
                pass_s[drone] = seconds(pass);
                total += arrival;
            }
            queues.push(queue.into_iter().map(|(_, drone)| drone).collect());
        }
        RouteAssignment { makespan_s: seconds(self.makespan(&routes)), routes, queues, pass_s, total_s: seconds(total) }
    }
}

/// When each drone of a queue passes: once it arrives and it is its `turn`, which follows from when the drone before it passes and from its own
/// arrival.
fn passes(queue: &[(Cost, usize)], turn: impl Fn(Cost, Cost) -> Cost) -> impl Iterator<Item = Cost> {
    queue.iter().scan(Cost::MIN / 2, move |last, &(arrival, _)| {
        *last = arrival.max(turn(*last, arrival));
        Some(*last)
    })
}

fn seconds(micros: Cost) -> f64 {
    micros as f64 / MICROS
}

fn micros(s: f64) -> Cost {
    (s * MICROS).round() as Cost
}
