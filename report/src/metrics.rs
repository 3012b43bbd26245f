//! The swarm metrics of SwarmLab over the living drones: order, safety, union, connectivity (Soria et al. 2020,
//! "SwarmLab: a Matlab Drone Swarm Simulator").

use crate::close::Sweep;
use crate::summary::Metrics;
use crate::tuning::CONNECTIVITY_DRONES_MAX;
use nalgebra::DMatrix;
use skein_protocol::Vec2;

/// Speed below which a drone has no heading, m/s.
const STANDING_MPS: f64 = 1e-9;

/// The metrics at one time; `None` where one is not defined.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Moment {
    /// Mean over drones of the mean cosine between a drone's velocity and its neighbours' velocities. A drone without
    /// neighbours counts as 1.
    pub order: Option<f64>,
    /// 1 − (pairs closer than the safe distance) / pairs.
    pub safety: Option<f64>,
    /// (N − components) / (N − 1).
    pub union: Option<f64>,
    /// λ₂ of the Laplacian of the graph / N.
    pub connectivity: Option<f64>,
}

/// Averages the metrics over a mission. Two drones are neighbours if they are in radio range; if the range has no limit,
/// all drones are neighbours.
pub(crate) struct SwarmMetrics {
    safe_distance_m: f64,
    range_m: Option<f64>,
    /// Sum and count of each metric.
    sums: [(f64, u32); 4],
    sweep: Sweep,
    /// The last neighbour graph and its connectivity.
    last_graph: Option<(Vec<u64>, f64)>,
}

impl SwarmMetrics {
    /// Without samples. `range_m` is the radio range, m.
    pub(crate) fn new(safe_distance_m: f64, range_m: Option<f64>) -> Self {
        Self { safe_distance_m, range_m, sums: [(0.0, 0); 4], sweep: Sweep::default(), last_graph: None }
    }

    /// Takes the positions, m, and velocities, m/s, of the living drones at one time.
    pub(crate) fn take(&mut self, positions: &[Vec2], velocities: &[Vec2]) {
        let moment = self.moment(positions, velocities);
        let values = [moment.order, moment.safety, moment.union, moment.connectivity];
        for ((sum, count), value) in self.sums.iter_mut().zip(values) {
            if let Some(value) = value {
                (*sum, *count) = (*sum + value, *count + 1);
            }
        }
    }

    /// The means so far.
    pub(crate) fn means(&self) -> Metrics {
        let [order, safety, union, connectivity] =
            self.sums.map(|(sum, count)| (count > 0).then(|| sum / f64::from(count)));
        Metrics { order, safety, union, connectivity }
    }

    /// The metrics at one time.
    fn moment(&mut self, positions: &[Vec2], velocities: &[Vec2]) -> Moment {
        let n = positions.len();
        if n < 2 {
            return Moment { order: (n == 1).then_some(1.0), ..Moment::default() };
        }
        let mut unsafe_pairs = 0u32;
        self.sweep.pairs(positions, Some(self.safe_distance_m), |_, _, _| unsafe_pairs += 1);
        let safety = Some(1.0 - f64::from(unsafe_pairs) / (n as f64 * (n as f64 - 1.0) / 2.0));
        let headings: Vec<Vec2> = velocities.iter().map(|&velocity| heading(velocity)).collect();
        let Some(range) = self.range_m else {
            let connectivity = (n <= CONNECTIVITY_DRONES_MAX).then_some(1.0);
            return Moment { order: Some(order_of_all(&headings)), safety, union: Some(1.0), connectivity };
        };
        let mut graph = Graph::new(n);
        self.sweep.pairs(positions, Some(range), |a, b, _| graph.link(a, b, &headings));
        let union = Some((n - graph.components()) as f64 / (n - 1) as f64);
        let connectivity = (n <= CONNECTIVITY_DRONES_MAX).then(|| self.connectivity(&graph.links));
        Moment { order: Some(graph.order(&headings)), safety, union, connectivity }
    }

    /// Computes the eigenvalues only if the graph has changed.
    fn connectivity(&mut self, links: &[u64]) -> f64 {
        match &self.last_graph {
            Some((last, value)) if last == links => *value,
            _ => {
                let value = algebraic_connectivity(links) / links.len() as f64;
                self.last_graph = Some((links.to_vec(), value));
                value
            }
        }
    }
}

/// Unit vector along a velocity; zero for a drone at rest.
fn heading(velocity: Vec2) -> Vec2 {
    velocity.try_normalize(STANDING_MPS).unwrap_or_default()
}

/// Order if all drones are neighbours. With S the sum of all headings, Σⱼ uᵢ·uⱼ = uᵢ·(S − uᵢ), so that no pair has to be
/// visited.
fn order_of_all(headings: &[Vec2]) -> f64 {
    let sum: Vec2 = headings.iter().sum();
    let moving = headings.iter().filter(|heading| **heading != Vec2::zeros()).count();
    let one = |heading: &Vec2| mean_cosine(*heading, sum - heading, moving.saturating_sub(1));
    headings.iter().map(one).sum::<f64>() / headings.len() as f64
}

/// Mean cosine with `moving` neighbours whose headings add up to `sum`; 1 without a moving neighbour.
fn mean_cosine(heading: Vec2, sum: Vec2, moving: usize) -> f64 {
    if heading == Vec2::zeros() || moving == 0 { 1.0 } else { heading.dot(&sum) / moving as f64 }
}

/// The graph of neighbours.
struct Graph {
    /// Union-find forest of the connected components.
    parent: Vec<usize>,
    heading_sum: Vec<Vec2>,
    moving: Vec<usize>,
    /// One bit per neighbour; empty above [`CONNECTIVITY_DRONES_MAX`] drones.
    links: Vec<u64>,
}

impl Graph {
    fn new(n: usize) -> Self {
        let links = if n <= CONNECTIVITY_DRONES_MAX { vec![0; n] } else { Vec::new() };
        Self { parent: (0..n).collect(), heading_sum: vec![Vec2::zeros(); n], moving: vec![0; n], links }
    }

    fn link(&mut self, a: usize, b: usize, headings: &[Vec2]) {
        for (one, other) in [(a, b), (b, a)] {
            self.heading_sum[one] += headings[other];
            self.moving[one] += usize::from(headings[other] != Vec2::zeros());
            if let Some(bits) = self.links.get_mut(one) {
                *bits |= 1 << other;
            }
        }
        let (a, b) = (self.root(a), self.root(b));
        self.parent[a.max(b)] = a.min(b);
    }

    fn root(&mut self, mut drone: usize) -> usize {
        while self.parent[drone] != drone {
            self.parent[drone] = self.parent[self.parent[drone]];
            drone = self.parent[drone];
        }
        drone
    }

    fn components(&self) -> usize {
        self.parent.iter().enumerate().filter(|&(drone, &parent)| drone == parent).count()
    }

    fn order(&self, headings: &[Vec2]) -> f64 {
        let one = |i: usize| mean_cosine(headings[i], self.heading_sum[i], self.moving[i]);
        (0..headings.len()).map(one).sum::<f64>() / headings.len() as f64
    }
}

/// λ₂, the second-smallest eigenvalue of the Laplacian of a graph with at most 64 nodes, given as neighbour bits.
fn algebraic_connectivity(links: &[u64]) -> f64 {
    let laplacian = DMatrix::from_fn(links.len(), links.len(), |i, j| {
        if i == j { f64::from(links[i].count_ones()) } else { -((links[i] >> j & 1) as f64) }
    });
    let mut values: Vec<f64> = laplacian.symmetric_eigenvalues().iter().copied().collect();
    values.sort_by(f64::total_cmp);
    values.get(1).copied().unwrap_or(0.0).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    const EAST: Vec2 = Vec2::new(10.0, 0.0);

    fn row(xs: &[f64]) -> Vec<Vec2> {
        xs.iter().map(|&x| Vec2::new(x, 0.0)).collect()
    }

    fn close(value: Option<f64>, wanted: f64) -> bool {
        value.is_some_and(|value| (value - wanted).abs() < 1e-9)
    }

    #[test]
    fn metrics_of_a_path_of_three_and_a_lone_drone() {
        let mut metrics = SwarmMetrics::new(25.0, Some(40.0));
        let velocities = [EAST, -EAST, Vec2::new(0.0, 3.0), EAST];
        let moment = metrics.moment(&row(&[0.0, 30.0, 50.0, 200.0]), &velocities);
        // Cosines: the first drone has −1, the second −1 and 0, the third 0, the last has no neighbour.
        assert!(close(moment.order, (-1.0 - 0.5 + 0.0 + 1.0) / 4.0), "{moment:?}");
        assert!(close(moment.safety, 1.0 - 1.0 / 6.0), "{moment:?}");
        assert!(close(moment.union, 2.0 / 3.0), "{moment:?}");
        assert!(close(moment.connectivity, 0.0), "{moment:?}");
    }

    #[test]
    fn connectivity_of_a_path_a_star_and_a_complete_graph() {
        let mut metrics = SwarmMetrics::new(1.0, Some(11.0));
        // λ₂ of a path of n nodes: 2 (1 − cos(π/n)).
        let path = metrics.moment(&row(&[0.0, 10.0, 20.0, 30.0]), &[EAST; 4]);
        assert!(close(path.connectivity, (2.0 - 2.0f64.sqrt()) / 4.0), "{path:?}");
        let star = [Vec2::zeros(), Vec2::new(10.0, 0.0), Vec2::new(-10.0, 0.0), Vec2::new(0.0, 10.0)];
        assert!(close(metrics.moment(&star, &[EAST; 4]).connectivity, 0.25));
        let all = metrics.moment(&row(&[0.0, 3.0, 6.0]), &[EAST; 3]);
        assert!(close(all.connectivity, 1.0) && close(all.union, 1.0) && close(all.order, 1.0), "{all:?}");
    }

    #[test]
    fn without_a_range_limit_all_drones_are_neighbours() {
        let positions = row(&[0.0, 500.0, 1000.0, 1020.0]);
        let velocities = [EAST, Vec2::new(3.0, 4.0), -EAST, Vec2::zeros()];
        let free = SwarmMetrics::new(25.0, None).moment(&positions, &velocities);
        let far = SwarmMetrics::new(25.0, Some(1e6)).moment(&positions, &velocities);
        for (a, b) in [(free.order, far.order), (free.union, far.union), (free.connectivity, far.connectivity)] {
            assert!(close(a, b.unwrap()), "{free:?} is not {far:?}");
        }
        assert!(close(free.order, (-0.2 + 0.0 - 0.8 + 1.0) / 4.0), "{free:?}");
    }

    #[test]
    fn metrics_that_are_not_defined_are_none() {
        let mut metrics = SwarmMetrics::new(25.0, None);
        assert_eq!(metrics.moment(&[], &[]), Moment::default());
        assert_eq!(metrics.moment(&row(&[0.0]), &[EAST]), Moment { order: Some(1.0), ..Moment::default() });
        let many: Vec<Vec2> = (0..65).map(|i| Vec2::new(f64::from(i) * 30.0, 0.0)).collect();
        metrics.take(&many, &[EAST; 65]);
        let means = metrics.means();
        assert!(means.connectivity.is_none() && means.union == Some(1.0));
    }
}
