//! The parts of a swarm: which living drones the radio connects, over any number of hops, by the true state.

use crate::body::Body;
use crate::grid::Grid;
use crate::tuning::PARTED_S;
use skein_protocol::link_faults::LinkFaults;
use skein_protocol::{DroneId, SimTime};

/// The parts, and since when they are the same.
#[derive(Clone, Debug, Default)]
pub(crate) struct Parts {
    /// The lowest number of the drones in each drone's part; `None` if the drone is dead.
    lowest: Vec<Option<usize>>,
    since: SimTime,
    grid: Grid,
}

impl Parts {
    /// Looks which drones can hear each other `now`: both live, no fault of their radios separates them, and they are at most
    /// `reach_m` apart, seen from above.
    pub(crate) fn look(&mut self, now: SimTime, bodies: &[Body], radio: impl Fn(DroneId) -> LinkFaults, reach_m: f64) {
        let radios: Vec<LinkFaults> = (0..bodies.len() as u32).map(|id| radio(DroneId(id))).collect();
        let place = |drone: usize| bodies[drone].position().xy();
        let linked = |a: usize, b: usize| {
            bodies[b].is_alive()
                && (place(a) - place(b)).norm_squared() <= reach_m * reach_m
                && radios[a].drop_reason(radios[b]).is_none()
                && radios[b].drop_reason(radios[a]).is_none()
        };
        // One cell holds everybody if the reach is unlimited.
        let cell_m = reach_m.min(1e9);
        let living = || (0..bodies.len()).filter(|&drone| bodies[drone].is_alive());
        self.grid.fill(cell_m, living().map(|drone| (drone as u32, place(drone))));
        let mut lowest = vec![None; bodies.len()];
        for first in living() {
            if lowest[first].is_some() {
                continue;
            }
            lowest[first] = Some(first);
            let mut found = vec![first];
            while let Some(drone) = found.pop() {
                self.grid.each_near(place(drone), |other| {
                    let other = other as usize;
                    if lowest[other].is_none() && linked(drone, other) {
                        lowest[other] = Some(first);
                        found.push(other);
                    }
                });
            }
        }
        if lowest != self.lowest {
            (self.lowest, self.since) = (lowest, now);
        }
    }

    /// The drones of each part, if the parts have been the same for [`PARTED_S`]; else none.
    pub(crate) fn settled(&self, now: SimTime) -> Vec<Vec<usize>> {
        if now.since(self.since) < PARTED_S {
            return Vec::new();
        }
        let mut parts: Vec<Vec<usize>> = vec![Vec::new(); self.lowest.len()];
        for (drone, lowest) in self.lowest.iter().enumerate() {
            if let Some(lowest) = lowest {
                parts[*lowest].push(drone);
            }
        }
        parts.retain(|part| !part.is_empty());
        parts
    }

    /// Number of parts.
    pub(crate) fn count(&self) -> usize {
        self.lowest.iter().enumerate().filter(|(drone, lowest)| **lowest == Some(*drone)).count()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::bodies;
    use skein_protocol::link_faults::PartitionMask;

    fn at(seconds: f64) -> SimTime {
        SimTime::from_secs(seconds)
    }

    fn side(side: usize) -> LinkFaults {
        let mut partitions = PartitionMask::default();
        partitions.join(0, side);
        LinkFaults { partitions, ..LinkFaults::default() }
    }

    #[test]
    fn a_chain_is_one_part_and_a_gap_that_lasts_makes_two() {
        let mut parts = Parts::default();
        let mut look = |now_s, xs: &[f64]| {
            let places: Vec<[f64; 2]> = xs.iter().map(|&x| [x, 0.0]).collect();
            parts.look(at(now_s), &bodies(&places), |_| LinkFaults::default(), 50.0);
            parts.settled(at(now_s))
        };
        assert!(look(0.0, &[0.0, 100.0, 50.0]).is_empty(), "too early");
        assert_eq!(look(PARTED_S, &[0.0, 100.0, 50.0]), [vec![0, 1, 2]]);
        assert!(look(20.0, &[0.0, 101.0, 50.0]).is_empty(), "the gap is new");
        assert_eq!(look(20.0 + PARTED_S, &[0.0, 101.0, 50.0]), [vec![0, 2], vec![1]]);
    }

    #[test]
    fn faults_of_radios_and_deaths_cut_a_swarm_whatever_its_reach() {
        let mut all = bodies(&[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [3.0, 0.0]]);
        let settled = |all: &[Body], now_s: f64, radio: &dyn Fn(DroneId) -> LinkFaults| {
            let mut parts = Parts::default();
            parts.look(at(now_s), all, radio, f64::INFINITY);
            (parts.count(), parts.settled(at(now_s + PARTED_S)))
        };
        let halves = |id: DroneId| side(usize::from(id.0 >= 2));
        assert_eq!(settled(&all, 0.0, &halves), (2, vec![vec![0, 1], vec![2, 3]]));
        let mute = |id: DroneId| LinkFaults { mute: u16::from(id.0 == 1), ..LinkFaults::default() };
        assert_eq!(settled(&all, 0.0, &mute), (2, vec![vec![0, 2, 3], vec![1]]));
        all[2].kill();
        assert_eq!(settled(&all, 0.0, &|_| LinkFaults::default()), (1, vec![vec![0, 1, 3]]));
    }
}
