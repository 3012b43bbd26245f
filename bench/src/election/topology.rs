//! Where the drones of the election benchmark are, and who hears whom.

use clap::ValueEnum;
use serde::Serialize;
use skein_protocol::Vec2;
use skein_protocol::digest::Digest;
use std::collections::VecDeque;
use std::f64::consts::TAU;

/// Distance between neighbours, m.
const SPACING_M: f64 = 40.0;
/// Range of the radio, m: more than one spacing, and less than the diagonal of a square of neighbours.
const RANGE_M: f64 = 50.0;
/// Mean number of neighbours in a random graph.
const MEAN_NEIGHBOURS: f64 = 10.0;

/// Who hears whom.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Topology {
    /// Everybody hears everybody
    OneHop,
    /// A line: each drone hears the one before and the one behind it
    Line,
    /// A ring: each drone hears two others
    Ring,
    /// A square grid: each drone hears up to four others
    Grid,
    /// Places at random in a square, connected: each drone hears ten others on average
    Geometric,
}

impl Topology {
    /// The name in tables.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::OneHop => "one-hop",
            Self::Line => "line",
            Self::Ring => "ring",
            Self::Grid => "grid",
            Self::Geometric => "geometric",
        }
    }

    /// The places of so many drones, m. The same seed gives the same ones.
    pub(super) fn places(self, drones: usize, seed: u64) -> Vec<Vec2> {
        let columns = (drones as f64).sqrt().ceil() as usize;
        let at = |i: usize| match self {
            Self::Line => Vec2::new(-SPACING_M * i as f64, 0.0),
            Self::Ring => {
                let (turn, radius_m) = (TAU * i as f64 / drones as f64, SPACING_M * drones as f64 / TAU);
                Vec2::new(radius_m * turn.cos(), radius_m * turn.sin())
            }
            _ => Vec2::new(-SPACING_M * (i / columns) as f64, SPACING_M * (i % columns) as f64),
        };
        match self {
            Self::Geometric => connected(drones, seed),
            _ => (0..drones).map(at).collect(),
        }
    }

    /// For each drone those that hear it.
    pub(super) fn links(self, places: &[Vec2]) -> Vec<Vec<usize>> {
        let range_m = if self == Self::OneHop { f64::INFINITY } else { RANGE_M };
        links(places, range_m)
    }
}

/// Places at random, drawn until all drones are connected.
fn connected(drones: usize, seed: u64) -> Vec<Vec2> {
    let side_m = RANGE_M * (drones as f64 * TAU / 2.0 / MEAN_NEIGHBOURS).sqrt();
    let drawn = |attempt: u64| {
        let coordinate = |i: usize, axis: u64| side_m * uniform(&[seed, attempt, i as u64, axis]);
        (0..drones).map(|i| Vec2::new(coordinate(i, 0), coordinate(i, 1))).collect::<Vec<Vec2>>()
    };
    let is_connected = |places: &Vec<Vec2>| parts(&links(places, RANGE_M), &vec![true; drones]).len() <= 1;
    (0..).map(drawn).find(is_connected).unwrap_or_default()
}

fn links(places: &[Vec2], range_m: f64) -> Vec<Vec<usize>> {
    let near = |i: usize| {
        let hears = move |&to: &usize| to != i && (places[to] - places[i]).norm() <= range_m;
        (0..places.len()).filter(hears).collect()
    };
    (0..places.len()).map(near).collect()
}

/// The connected parts of the living drones.
pub(super) fn parts(links: &[Vec<usize>], alive: &[bool]) -> Vec<Vec<usize>> {
    let mut seen: Vec<bool> = alive.iter().map(|alive| !alive).collect();
    let mut parts = Vec::new();
    for first in 0..links.len() {
        if std::mem::replace(&mut seen[first], true) {
            continue;
        }
        let mut part = vec![first];
        let mut next = 0;
        while next < part.len() {
            for &to in &links[part[next]] {
                if !std::mem::replace(&mut seen[to], true) {
                    part.push(to);
                }
            }
            next += 1;
        }
        parts.push(part);
    }
    parts
}

/// Hops between the two living drones of one part that are farthest from each other.
pub(super) fn longest_way(links: &[Vec<usize>], alive: &[bool]) -> usize {
    let from = |first: usize| {
        let mut hops = vec![None; links.len()];
        hops[first] = Some(0_usize);
        let mut queue = VecDeque::from([first]);
        let mut farthest = 0;
        while let Some(drone) = queue.pop_front() {
            farthest = hops[drone].unwrap_or(0);
            for &to in links[drone].iter().filter(|&&to| alive[to]) {
                if hops[to].is_none() {
                    hops[to] = Some(farthest + 1);
                    queue.push_back(to);
                }
            }
        }
        farthest
    };
    (0..links.len()).filter(|&drone| alive[drone]).map(from).max().unwrap_or(0)
}

/// A number from 0 to 1 that these words determine.
pub(super) fn uniform(words: &[u64]) -> f64 {
    let mut digest = Digest::default();
    for &word in words {
        digest.word(word);
    }
    (digest.value() >> 11) as f64 / (1u64 << 53) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_topology_is_connected_and_has_its_neighbours() {
        let degrees = |topology: Topology, drones: usize| {
            let links = topology.links(&topology.places(drones, 7));
            assert_eq!(parts(&links, &vec![true; drones]).len(), 1, "{topology:?}");
            let mut degrees: Vec<usize> = links.iter().map(Vec::len).collect();
            degrees.sort_unstable();
            (degrees[0], degrees[drones - 1])
        };
        for drones in [10, 30, 100] {
            assert_eq!(degrees(Topology::OneHop, drones), (drones - 1, drones - 1));
            assert_eq!(degrees(Topology::Line, drones), (1, 2));
            assert_eq!(degrees(Topology::Ring, drones), (2, 2));
            assert!(degrees(Topology::Grid, drones).1 <= 4);
            assert!(degrees(Topology::Geometric, drones).1 >= 4);
        }
        assert_ne!(Topology::Geometric.places(10, 1), Topology::Geometric.places(10, 2));
    }

    #[test]
    fn a_dead_drone_cuts_a_line() {
        let links = Topology::Line.links(&Topology::Line.places(5, 1));
        assert_eq!(parts(&links, &[true, true, false, true, true]), [vec![0, 1], vec![3, 4]]);
        assert_eq!((longest_way(&links, &[true; 5]), longest_way(&links, &[true, true, true, false, true])), (4, 2));
    }
}
