//! A hunt: searches for missions that break an invariant or do not reach their goal, and makes what it finds small.
//!
//! A hunt has three parts. First it flies the runs of its source, such as the seeds of the wide scenes. Then it changes the runs
//! that came nearest to a failure a little, flies those, and goes on from the worst of them. Last it shrinks each kind of
//! failure that it found. The same source, seed and number of flights give the same findings, whatever the number of workers.

mod failure;
mod mutation;
mod shrink;
mod source;

pub use failure::{Failure, FailureKind};
pub use source::source;

use crate::error::SweepError;
use crate::flight::{Interrupted, fly_inline};
use crate::grid::Grid;
use crate::worker_pool::WorkerPool;
use failure::Danger;
use skein_runtime::PilotRegistry;
use skein_scenario::Scenario;
use std::collections::BTreeMap;

/// Share of the flights that goes to the runs of the source; the rest goes to neighbours of the worst.
const SEED_SHARE: f64 = 0.6;
/// Number of missions, for each danger, whose neighbours are flown.
const PARENTS: usize = 4;
/// Flights of a generation of neighbours.
const GENERATION: usize = 32;

/// A hunt over the runs of a grid.
pub struct Hunt<'a> {
    grid: &'a Grid<'a>,
    pilots: &'a PilotRegistry,
    flights: usize,
    shrink_flights: usize,
    workers: usize,
    seed: u64,
    interrupted: &'a Interrupted<'a>,
}

/// A failure that a hunt found, made small.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// What fails.
    pub failure: Failure,
    /// The small mission, as TOML.
    pub toml: String,
    /// The command that repeats the mission in which the failure was found first; `None` if that was a neighbour of a run.
    pub command: Option<String>,
}

/// What a hunt found.
#[derive(Clone, Debug, PartialEq)]
pub struct HuntReport {
    /// Number of flights, those of the shrinking included.
    pub flights: usize,
    /// One finding for each kind of failure, at most.
    pub findings: Vec<Finding>,
    /// Least separation of all missions that kept their invariants, in safe distances.
    pub least_separation: Option<f64>,
    /// Least clearance of all missions that kept their invariants, in clearances to keep.
    pub least_clearance: Option<f64>,
}

/// A mission that was flown.
#[derive(Clone, Debug)]
struct Flown {
    scenario: Scenario,
    danger: Danger,
    failure: Option<Failure>,
    /// Number of its run in the grid; `None` for a neighbour.
    run: Option<usize>,
}

/// A mission to fly, and the number of its run in the grid; `None` for a neighbour.
type Mission = (Scenario, Option<usize>);

impl<'a> Hunt<'a> {
    /// A hunt of these pilots over the runs of a grid, with 1000 flights in one worker. It is never interrupted.
    #[must_use]
    pub fn new(grid: &'a Grid<'a>, pilots: &'a PilotRegistry) -> Self {
        Self { grid, pilots, flights: 1000, shrink_flights: 300, workers: 1, seed: 1, interrupted: &|| None }
    }

    /// Sets the number of flights, without those of the shrinking.
    #[must_use]
    pub fn flights(self, flights: usize) -> Self {
        Self { flights, ..self }
    }

    /// Sets the number of flights that shrink one finding.
    #[must_use]
    pub fn shrink_flights(self, shrink_flights: usize) -> Self {
        Self { shrink_flights, ..self }
    }

    /// Sets the number of flights side by side.
    #[must_use]
    pub fn workers(self, workers: usize) -> Self {
        Self { workers: workers.max(1), ..self }
    }

    /// Sets the seed of the changes that make neighbours.
    #[must_use]
    pub fn seed(self, seed: u64) -> Self {
        Self { seed, ..self }
    }

    /// Sets what asks for an interruption. An interrupted hunt reports what it has found so far.
    #[must_use]
    pub fn interrupted(self, interrupted: &'a Interrupted<'a>) -> Self {
        Self { interrupted, ..self }
    }

    /// Hunts. `progress` gets the number of flights done, and the number of failures found.
    ///
    /// # Errors
    /// [`SweepError::Scenario`] if a combination of the grid is not a valid scenario.
    pub fn run(&self, mut progress: impl FnMut(usize, usize)) -> Result<HuntReport, SweepError> {
        self.grid.check(self.pilots, true)?;
        let mut flown = self.fly_runs(&mut progress);
        self.fly_neighbours(&mut flown, &mut progress);
        let mut report = HuntReport {
            flights: flown.len(),
            findings: Vec::new(),
            least_separation: least(&flown, |danger| danger.separation),
            least_clearance: least(&flown, |danger| danger.clearance),
        };
        for (failure, one) in worst_of_each_kind(&flown) {
            let shrunk = shrink::shrink(&one.scenario, failure, self.shrink_flights, (self.pilots, self.interrupted));
            report.flights += shrunk.flights;
            let command = one.run.map(|run| self.grid.command(run));
            report.findings.push(Finding { failure: shrunk.failure, toml: shrunk.toml, command });
        }
        Ok(report)
    }

    fn fly_runs(&self, progress: &mut impl FnMut(usize, usize)) -> Vec<Flown> {
        let share = (self.flights as f64 * SEED_SHARE).ceil() as usize;
        let runs = self.grid.len().min(share);
        // The runs are spread evenly over the grid, so that each combination has its part.
        let chosen: Vec<usize> = (0..runs).map(|i| i * self.grid.len() / runs.max(1)).collect();
        let mission = |number: usize| {
            let run = chosen[number];
            Some((self.grid.scenario(run).ok()?, Some(run)))
        };
        self.fly((runs, &mission), 0, 0, progress)
    }

    /// Flies neighbours of the missions that came nearest to a failure, generation by generation.
    fn fly_neighbours(&self, flown: &mut Vec<Flown>, progress: &mut impl FnMut(usize, usize)) {
        while flown.len() < self.flights && (self.interrupted)().is_none() {
            let parents: Vec<&Scenario> = parents(flown);
            if parents.is_empty() {
                return;
            }
            let count = GENERATION.min(self.flights - flown.len());
            let neighbour = |i: usize| {
                let parent = parents[i % parents.len()];
                mutation::neighbour(parent, self.seed, (flown.len() + i) as u64)
            };
            let scenarios: Vec<Scenario> = (0..count).filter_map(neighbour).collect();
            let mission = |number: usize| Some((scenarios[number].clone(), None));
            let failures = flown.iter().filter(|one| one.failure.is_some()).count();
            let generation = self.fly((scenarios.len(), &mission), flown.len(), failures, progress);
            if generation.is_empty() {
                return;
            }
            flown.extend(generation);
        }
    }

    /// Flies missions side by side and returns them in the order of their numbers. A mission is made when it is flown, so that a hunt
    /// in many runs begins at once; one that is not valid is left out. `done` and `failures`: counts so far, for `progress`.
    fn fly(
        &self,
        (count, mission): (usize, &(dyn Fn(usize) -> Option<Mission> + Sync)),
        done: usize,
        failures: usize,
        progress: &mut impl FnMut(usize, usize),
    ) -> Vec<Flown> {
        let jobs: Vec<usize> = (0..count).collect();
        let (mut flown, mut failed) = (BTreeMap::new(), failures);
        let pool = WorkerPool { jobs: &jobs, workers: self.workers };
        let is_interrupted = || (self.interrupted)().is_some();
        // `None` ends a worker.
        let fly = |job: usize| {
            let mission = if is_interrupted() { return None } else { mission(job) };
            let flight = |(scenario, run): Mission| {
                let summary = fly_inline(&scenario, self.pilots, self.interrupted).ok()?;
                Some((scenario, run, summary))
            };
            let flight = mission.and_then(flight);
            (!is_interrupted()).then_some((job, flight))
        };
        let end = pool.run(fly, |result| {
            if let Some((job, Some((scenario, run, summary)))) = result {
                let failure = Failure::of(&summary, &scenario);
                failed += usize::from(failure.is_some());
                let danger = Danger::of(&summary, &scenario);
                flown.insert(job, Flown { scenario, danger, failure, run });
            }
            progress(done + flown.len(), failed);
            Ok::<(), std::convert::Infallible>(())
        });
        let Ok(()) = end;
        flown.into_values().collect()
    }
}

/// The missions that did not fail and came nearest to it: by separation, by clearance and by time.
fn parents(flown: &[Flown]) -> Vec<&Scenario> {
    let mut parents: Vec<&Scenario> = Vec::new();
    let dangers: [fn(&Danger) -> f64; 3] = [|d| d.separation, |d| d.clearance, |d| -d.slowness];
    for danger in dangers {
        let mut order: Vec<&Flown> = flown.iter().filter(|one| one.failure.is_none()).collect();
        order.sort_by(|a, b| danger(&a.danger).total_cmp(&danger(&b.danger)));
        parents.extend(order.iter().take(PARENTS).map(|one| &one.scenario));
    }
    parents
}

/// For each kind of failure, the mission in which it was worst.
fn worst_of_each_kind(flown: &[Flown]) -> Vec<(Failure, &Flown)> {
    let mut worst: BTreeMap<FailureKind, (Failure, &Flown)> = BTreeMap::new();
    for (failure, one) in flown.iter().filter_map(|one| Some((one.failure?, one))) {
        let known = worst.entry(failure.kind).or_insert((failure, one));
        if failure.value < known.0.value {
            *known = (failure, one);
        }
    }
    worst.into_values().collect()
}

/// The least of a danger over all missions that did not fail; `None` if no mission has it.
fn least(flown: &[Flown], danger: impl Fn(&Danger) -> f64) -> Option<f64> {
    let least =
        flown.iter().filter(|one| one.failure.is_none()).map(|one| danger(&one.danger)).fold(f64::INFINITY, f64::min);
    least.is_finite().then_some(least)
}

#[cfg(test)]
mod tests;
