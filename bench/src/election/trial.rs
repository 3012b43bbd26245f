//! One election of the benchmark.

use super::swarm::Swarm;
use super::topology::Topology;
use skein_scenario::Scenario;

/// A swarm is watched for so long after it has one leader, s.
const WATCH_S: f64 = 10.0;

/// What is tried.
#[derive(Clone, Copy, Debug)]
pub(super) struct Trial {
    /// Who hears whom.
    pub(super) topology: Topology,
    /// Size of the swarm.
    pub(super) drones: u32,
    /// Share of the frames that a receiver loses.
    pub(super) loss: f64,
    /// Share of the drones that die in the first seconds.
    pub(super) failing: f64,
    /// Seed of everything random.
    pub(super) seed: u64,
}

/// What happened.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Elected {
    /// Time from the start until there was one leader, s; `None` if there was none in time.
    pub(super) time_s: Option<f64>,
    /// Frames that a drone had sent until then, on average.
    pub(super) frames: f64,
    /// Drones that led before and had given way.
    pub(super) false_leaders: usize,
    /// Terms that began while the swarm was watched afterwards.
    pub(super) later: usize,
}

impl Trial {
    /// Runs until there is one leader, or this time is over. `None` if interrupted.
    pub(super) fn run(self, scenario: &Scenario, limit_s: f64, stopped: &impl Fn() -> bool) -> Option<Elected> {
        let mut swarm = Swarm::new(scenario, self);
        let mut is_united = false;
        while !is_united && swarm.now_s() < limit_s {
            swarm.step();
            is_united = swarm.is_united();
            if stopped() {
                return None;
            }
        }
        let time_s = is_united.then(|| swarm.now_s());
        let (frames, terms) = (swarm.frames() as f64 / f64::from(self.drones), swarm.terms());
        let false_leaders = swarm.false_leaders();
        let end_s = swarm.now_s() + WATCH_S;
        while is_united && swarm.now_s() < end_s {
            swarm.step();
            if stopped() {
                return None;
            }
        }
        Some(Elected { time_s, frames, false_leaders, later: swarm.terms() - terms })
    }
}
