//! Drones to slots at least cost, by successive shortest exchanges.
//!
//! Each route has slots 0, 1, 2, …, one drone a slot; a drone can use the first `cap` slots of a route. A set of drones
//! fits a route if for every level d at most d of them have a cap of d or less; the level is tight if d of them do. A
//! drone of cap c that enters a route therefore displaces one of those with a cap up to the first tight level ≥ c, or
//! none if there is no such level. Drones are inserted one after the other, each along a cheapest chain of
//! displacements; among equals a shortest chain, which keeps the result valid (weighted matroid intersection). That is
//! a min-cost matching without the n × (n·K) matrix.

/// Cost of a route for a drone; arrivals are in microseconds.
pub(crate) type Cost = i64;

/// A level beyond every tight one: there is a free slot.
const FREE: u32 = u32::MAX;

/// A drone in hand that could enter a route next: cost so far and who.
type Entry = (Cost, usize);
const NO_ENTRY: Entry = (Cost::MAX, usize::MAX);

/// Drones placed on routes so far.
struct Exchange<'a> {
    caps: &'a [Vec<u32>],
    costs: &'a [Vec<Cost>],
    /// Whether costs count, or only whether everybody finds a place.
    weighted: bool,
    route: Vec<Option<usize>>,
    /// By route and cap, number of drones.
    population: Vec<Vec<u32>>,
    /// By route and cap, first tight level not below it.
    reach: Vec<Vec<u32>>,
    /// Scratch: by route and level, the cheapest entry that reaches just so far.
    entries: Vec<Vec<Entry>>,
}

/// The route of each drone, or `None` if they do not all fit. `caps[drone][route]` is the number of slots it can use,
/// at most the number of drones. `costs` are looked at where the cap is not 0; the total is least if `weighted`.
pub(crate) fn place(caps: &[Vec<u32>], costs: &[Vec<Cost>], weighted: bool) -> Option<Vec<usize>> {
    let (drones, routes) = (caps.len(), caps.first().map_or(0, Vec::len));
    let mut matroid_intersection = Exchange {
        caps,
        costs,
        weighted,
        route: vec![None; drones],
        population: vec![vec![0; drones + 1]; routes],
        reach: vec![vec![FREE; drones + 1]; routes],
        entries: vec![vec![NO_ENTRY; drones + 2]; routes],
    };
    (0..drones).try_for_each(|drone| matroid_intersection.insert(drone))?;
    matroid_intersection.route.into_iter().collect()
}

/// Chains of displacements from one new drone.
struct Search {
    /// By drone: cost of a chain after which it is without a place.
    cost: Vec<Cost>,
    /// By drone: who displaces it.
    by: Vec<usize>,
    /// Cost, the last drone's own cost, that drone, and the route on which it finds a free slot.
    end: Option<(Cost, Cost, usize, usize)>,
}

impl Exchange<'_> {
    /// Finds a place for one more drone; `None` if there is none.
    fn insert(&mut self, drone: usize) -> Option<()> {
        if !self.weighted
            && let Some(route) = self.free_route(drone)
        {
            self.shift(drone, route);
            return Some(());
        }
        let mut search =
            Search { cost: vec![Cost::MAX; self.caps.len()], by: vec![usize::MAX; self.caps.len()], end: None };
        search.cost[drone] = 0;
        let mut in_hand = vec![drone];
        while !in_hand.is_empty() && (self.weighted || search.end.is_none()) {
            self.enter(&in_hand, &mut search);
            in_hand = self.displace(&mut search);
        }
        let (_, _, mut last, mut route) = search.end?;
        loop {
            let before = self.shift(last, route);
            match before {
                Some(place) if last != drone => (last, route) = (search.by[last], place),
                _ => return Some(()),
            }
        }
    }

    /// Of the routes with a free slot for a drone, the one on which it arrives first.
    fn free_route(&self, drone: usize) -> Option<usize> {
        let caps = self.caps[drone].iter().enumerate();
        let free = caps.filter(|&(route, &cap)| cap > 0 && self.reach[route][cap as usize] == FREE);
        free.map(|(route, _)| route).min_by_key(|&route| self.costs[drone][route])
    }

    /// Offers the drones in hand to all other routes: they find a free slot, or enter where they displace another.
    fn enter(&mut self, in_hand: &[usize], search: &mut Search) {
        self.entries.iter_mut().for_each(|entries| entries.fill(NO_ENTRY));
        let known = search.end.map_or(Cost::MAX, |end| end.0);
        let mut end = None;
        for &drone in in_hand {
            for (route, &cap) in self.caps[drone].iter().enumerate() {
                if cap == 0 || self.route[drone] == Some(route) {
                    continue;
                }
                let cost = search.cost[drone] + self.weight(drone, route);
                let reach = self.reach[route][cap as usize];
                if reach == FREE {
                    let found = (cost, self.costs[drone][route], drone, route);
                    end = Some(end.map_or(found, |end| found.min(end)));
                } else {
                    let entry = &mut self.entries[route][reach as usize];
                    *entry = (*entry).min((cost, drone));
                }
            }
        }
        search.end = end.filter(|end| end.0 < known).or(search.end);
    }

    /// Takes the drones in hand that the entries displace at less cost than known so far.
    fn displace(&mut self, search: &mut Search) -> Vec<usize> {
        for entries in &mut self.entries {
            for level in (0..entries.len() - 1).rev() {
                entries[level] = entries[level].min(entries[level + 1]);
            }
        }
        let mut in_hand = Vec::new();
        for (drone, place) in self.route.iter().enumerate() {
            let Some(route) = *place else { continue };
            let (cost, by) = self.entries[route][self.caps[drone][route] as usize];
            if by != usize::MAX && cost - self.weight(drone, route) < search.cost[drone] {
                search.cost[drone] = cost - self.weight(drone, route);
                search.by[drone] = by;
                in_hand.push(drone);
            }
        }
        in_hand
    }

    fn weight(&self, drone: usize, route: usize) -> Cost {
        if self.weighted { self.costs[drone][route] } else { 0 }
    }

    /// Moves a drone to a route; answers where it was.
    fn shift(&mut self, drone: usize, route: usize) -> Option<usize> {
        let before = self.route[drone].replace(route);
        self.population[route][self.caps[drone][route] as usize] += 1;
        if let Some(before) = before {
            self.population[before][self.caps[drone][before] as usize] -= 1;
            self.mark_tight(before);
        }
        self.mark_tight(route);
        before
    }

    fn mark_tight(&mut self, route: usize) {
        let population = &self.population[route];
        let mut below: u32 = population.iter().sum();
        let mut tight = FREE;
        for level in (0..population.len()).rev() {
            if below == level as u32 {
                tight = below;
            }
            self.reach[route][level] = tight;
            below -= population[level];
        }
    }
}
