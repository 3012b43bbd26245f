//! Weighted matroid intersection: drones to slots of routes at least cost, by successive shortest exchanges. It is a
//! minimum-cost matching that does not need the matrix of n drones × n·K slots.
//!
//! Each route has slots 0, 1, 2, …, one drone per slot. A drone can use the first `cap` slots of a route. A set of drones
//! fits a route if, for every level d, at most d of them have a cap of d or less. The level is tight if exactly d do. A
//! drone of cap c that enters a route displaces a drone with a cap up to the first tight level ≥ c, or none if there is no
//! such level. Drones are inserted one after the other, each along a cheapest chain of displacements. Among equal chains
//! a shortest one is taken, which keeps the result valid.

/// Cost of a route for a drone: its arrival, µs.
pub(crate) type Cost = i64;

/// A level above every tight one: the route has a free slot.
const FREE: u32 = u32::MAX;

/// A displaced drone that could enter a route next: the cost of the chain so far, and the drone.
type Entry = (Cost, usize);
const NO_ENTRY: Entry = (Cost::MAX, usize::MAX);

/// Drones placed on routes so far.
struct Exchange<'a> {
    caps: &'a [Vec<u32>],
    costs: &'a [Vec<Cost>],
    /// Whether costs count. Otherwise any complete placement will do.
    weighted: bool,
    route: Vec<Option<usize>>,
    /// Number of drones by route and cap.
    population: Vec<Vec<u32>>,
    /// First tight level not below a cap, by route and cap.
    reach: Vec<Vec<u32>>,
    /// Scratch: the cheapest entry that reaches exactly a level, by route and level.
    entries: Vec<Vec<Entry>>,
}

/// The route of each drone, or `None` if not all of them fit. `caps[drone][route]`: number of slots that the drone can
/// use, at most the number of drones. `costs` count where the cap is not 0. The total cost is least if `weighted`.
pub(crate) fn place(caps: &[Vec<u32>], costs: &[Vec<Cost>], weighted: bool) -> Option<Vec<usize>> {
    let (drones, routes) = (caps.len(), caps.first().map_or(0, Vec::len));
    let mut exchange = Exchange {
        caps,
        costs,
        weighted,
        route: vec![None; drones],
        population: vec![vec![0; drones + 1]; routes],
        reach: vec![vec![FREE; drones + 1]; routes],
        entries: vec![vec![NO_ENTRY; drones + 2]; routes],
    };
    (0..drones).try_for_each(|drone| exchange.insert(drone))?;
    exchange.route.into_iter().collect()
}

/// Chains of displacements that begin with one new drone.
struct Search {
    /// By drone: cost of the cheapest chain that displaces it.
    cost: Vec<Cost>,
    /// By drone: the drone that displaces it.
    by: Vec<usize>,
    /// The best end of a chain: its cost, the last drone's own cost, that drone, and the route with a free slot for it.
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
        let mut displaced = vec![drone];
        while !displaced.is_empty() && (self.weighted || search.end.is_none()) {
            self.enter(&displaced, &mut search);
            displaced = self.displace(&mut search);
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

    /// The route on which a drone arrives first, of those with a free slot for it.
    fn free_route(&self, drone: usize) -> Option<usize> {
        let caps = self.caps[drone].iter().enumerate();
        let free = caps.filter(|&(route, &cap)| cap > 0 && self.reach[route][cap as usize] == FREE);
        free.map(|(route, _)| route).min_by_key(|&route| self.costs[drone][route])
    }

    /// Offers displaced drones to all other routes. They find a free slot, or an entry where they displace another drone.
    fn enter(&mut self, displaced: &[usize], search: &mut Search) {
        for entries in &mut self.entries {
            entries.fill(NO_ENTRY);
        }
        let known = search.end.map_or(Cost::MAX, |end| end.0);
        let mut end = None;
        for &drone in displaced {
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

    /// The drones that the entries displace at less cost than known so far.
    fn displace(&mut self, search: &mut Search) -> Vec<usize> {
        for entries in &mut self.entries {
            for level in (0..entries.len() - 1).rev() {
                entries[level] = entries[level].min(entries[level + 1]);
            }
        }
        let mut displaced = Vec::new();
        for (drone, place) in self.route.iter().enumerate() {
            let Some(route) = *place else { continue };
            let (cost, by) = self.entries[route][self.caps[drone][route] as usize];
            if by != usize::MAX && cost - self.weight(drone, route) < search.cost[drone] {
                search.cost[drone] = cost - self.weight(drone, route);
                search.by[drone] = by;
                displaced.push(drone);
            }
        }
        displaced
    }

    /// The cost of a route for a drone, or 0 if costs do not count.
    fn weight(&self, drone: usize, route: usize) -> Cost {
        if self.weighted { self.costs[drone][route] } else { 0 }
    }

    /// Moves a drone to a route. Returns the route it was on.
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

    /// Determines the tight levels of a route anew.
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
