//! The inline runtime: it steps the same pilots and the same world by function calls in one thread, or the pilots in several. It is
//! the reference for determinism, and the engine of large sweeps.

use crate::clock::Clock;
use crate::drone_factory::DroneFactory;
use crate::error::RuntimeError;
use crate::in_pilots::Place;
use crate::mission;
use crate::pacer::Pacer;
use crate::pilot_host::{PilotHost, PilotScratch};
use crate::pilot_registry::PilotRegistry;
use crate::radio_receiver::Arrived;
use crate::run_end::RunEnd;
use skein_bus::LargePages;
use skein_protocol::downlink::DownlinkView;
use skein_protocol::frame::Frame;
use skein_protocol::record::{FaultKind, RecordSink};
use skein_protocol::slot::{LinkStats, Slot};
use skein_protocol::{DroneId, SimTime, prefetch};
use skein_scenario::Scenario;
use skein_world::World;
use skein_world::faults::ProcessCommand;
use std::num::NonZero;
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

/// Drones that a thread takes at a time. Chosen by hand: few enough that a leader that plans does not keep others waiting.
const CHUNK: usize = 8;

/// From this number of drones on, the heap gets large pages, and memory is fetched ahead: what drones know does not fit into the caches. Chosen by hand; with 64 drones
/// it gains nothing.
const LARGE_SWARM: usize = 100;

/// Flies a mission in this thread with the pilots that the scenario names. `interrupted` is called once per tick; it returns the
/// number of a signal that should stop the run. A pilot that does not return keeps it from being called, see
/// [`HangWatch`](crate::HangWatch). A pilot that ends this process, as by [`std::process::exit`], ends it with exit code 3.
///
/// # Errors
/// [`RuntimeError::Pilot`] if a pilot cannot be made, [`RuntimeError::Scenario`] and [`RuntimeError::Shape`] if no world can be made
/// of the scenario.
pub fn run(
    scenario: &Scenario,
    pilots: &PilotRegistry,
    sink: &mut dyn RecordSink,
    interrupted: impl FnMut() -> Option<i32>,
) -> Result<RunEnd, RuntimeError> {
    run_with(Settings::default(), scenario, pilots, sink, interrupted)
}

/// How an inline run is flown. The digest does not depend on it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// In how many threads drones are stepped, at most. Each takes several drones at a time, so small swarms use fewer.
    pub threads: NonZero<usize>,
    /// What paces the ticks. No drone is ever late: a tick that takes longer than its period delays the next one.
    pub clock: Clock,
}

impl Default for Settings {
    /// One thread, as fast as possible.
    fn default() -> Self {
        Self { threads: NonZero::<usize>::MIN, clock: Clock::Lockstep }
    }
}

/// As [`run`], with other settings.
///
/// # Errors
/// As [`run`].
pub fn run_with(
    Settings { threads, clock }: Settings,
    scenario: &Scenario,
    pilots: &PilotRegistry,
    sink: &mut dyn RecordSink,
    mut interrupted: impl FnMut() -> Option<i32>,
) -> Result<RunEnd, RuntimeError> {
    let mut end = RunEnd::default();
    let started = Instant::now();
    let mut swarm = InlineSwarm::new(threads, scenario, pilots)?;
    end.startup_s = started.elapsed().as_secs_f64();
    let opened = Instant::now();
    let mut pacer = match clock {
        Clock::Lockstep => None,
        Clock::Realtime { speed } => Some(Pacer::new(scenario.time.dt_s, speed)),
    };
    while swarm.world.ended().is_none() {
        if let Some(pacer) = &mut pacer {
            pacer.open();
        }
        swarm.tick();
        record(sink, &swarm.world, &mut end.sink_error);
        end.signal = interrupted().or_else(|| pacer.as_ref()?.pause_unless(&mut interrupted));
        if let Some(number) = end.signal {
            swarm.world.abort(&format!("interrupted by signal {number}"));
        }
    }
    if let Some(pacer) = &pacer {
        swarm.world.note_lateness(pacer.lateness_s());
    }
    let wall_s = opened.elapsed().as_secs_f64();
    let stats = swarm.stats();
    swarm.world.finish(&stats, wall_s);
    record(sink, &swarm.world, &mut end.sink_error);
    Ok(end)
}

/// Hands the world's record to the sink. An error stops the recording, never the mission.
fn record(sink: &mut dyn RecordSink, world: &World, error: &mut Option<String>) {
    if error.is_none() {
        *error = sink.take(world.record()).err().map(|error| error.to_string());
    }
}

/// The world and all drones of a mission.
struct InlineSwarm<'s> {
    factory: DroneFactory<'s>,
    world: World,
    drones: Vec<InlineDrone>,
    /// One per thread.
    workers: Vec<Worker>,
    /// Those of a large swarm.
    pages: Option<LargePages>,
}

/// What a thread has for the drones that it steps.
#[derive(Default)]
struct Worker {
    arrived: Arrived,
    /// One for each drone that it takes at a time.
    scratch: [PilotScratch; CHUNK],
    /// What their radio receivers have counted. It is here and not with each drone, so that it stays in the cache.
    stats: LinkStats,
    /// Says which pilot the thread is in.
    place: Place,
}

impl<'s> InlineSwarm<'s> {
    fn new(threads: NonZero<usize>, scenario: &'s Scenario, pilots: &'s PilotRegistry) -> Result<Self, RuntimeError> {
        pilots.check(scenario, true)?;
        let factory = DroneFactory::new(scenario, pilots);
        let world = mission::world(scenario)?;
        let new_drone = |id| factory.pilot_host(DroneId(id), 1, SimTime::ZERO).map(InlineDrone::new);
        let drones = (0..scenario.formation.drones).map(new_drone).collect::<Result<Vec<_>, _>>()?;
        let useful = drones.len().div_ceil(CHUNK).max(1);
        let workers = (0..threads.get().min(useful)).map(|_| Worker::default()).collect();
        let pages = (drones.len() >= LARGE_SWARM).then(LargePages::default);
        Ok(Self { factory, world, drones, workers, pages })
    }

    fn tick(&mut self) {
        if let Some(pages) = &mut self.pages {
            pages.tick();
        }
        let start = self.world.now();
        for &command in self.world.process_commands() {
            carry_out(command, &mut self.drones, &self.factory, start);
        }
        let down = self.world.downlink().view();
        step_all(&mut self.drones, &down, &mut self.workers);
        for (drone, id) in self.drones.iter().zip(0..).filter(|(drone, _)| drone.flies()) {
            self.world.take_slot(DroneId(id), &drone.slot);
            self.world.take_frames(DroneId(id), &drone.frames);
        }
        for (drone, id) in self.drones.iter_mut().zip(0..) {
            if let Some(why) = drone.unborn.take() {
                self.world.mark_dead(DroneId(id), FaultKind::Kill, false, &why);
            }
        }
        self.world.advance();
    }

    /// What all radio receivers have counted.
    fn stats(&self) -> LinkStats {
        let mut sum = LinkStats::default();
        for worker in &self.workers {
            sum.merge(&worker.stats);
        }
        sum
    }
}

/// Steps all drones, in as many threads as there are workers, or in those that the machine allows. No drone sees what another one does in
/// the same tick.
fn step_all(drones: &mut [InlineDrone], down: &DownlinkView<'_>, workers: &mut [Worker]) {
    let Some((own, others)) = workers.split_first_mut() else { return };
    let large = drones.len() >= LARGE_SWARM;
    let chunks = drones.chunks_mut(CHUNK);
    if others.is_empty() {
        return chunks.for_each(|chunk| step_chunk(chunk, down, own, large));
    }
    let chunks = Mutex::new(chunks);
    let next = || chunks.lock().unwrap_or_else(PoisonError::into_inner).next();
    let work = |worker: &mut Worker| {
        while let Some(chunk) = next() {
            step_chunk(chunk, down, worker, large);
        }
    };
    std::thread::scope(|scope| {
        // The threads that there are take all chunks.
        let begun = |worker| std::thread::Builder::new().spawn_scoped(scope, || work(worker)).is_ok();
        let _all = others.iter_mut().all(begun);
        work(own);
    });
}

/// Steps some drones, at most [`CHUNK`]. All begin their step before the first one ends it: so the processor has the code of one half
/// of a step in its cache, and not too much of both.
fn step_chunk(chunk: &mut [InlineDrone], down: &DownlinkView<'_>, worker: &mut Worker, large: bool) {
    let mut begun = [const { None }; CHUNK];
    let mut rest = chunk;
    for (begun, scratch) in begun.iter_mut().zip(&mut worker.scratch) {
        let Some((drone, next)) = rest.split_first_mut() else { break };
        // While one drone is stepped, the memory of the next ones is fetched.
        if large {
            next.first().iter().for_each(|next| next.prefetch());
            next.get(1).into_iter().for_each(prefetch);
        }
        rest = next;
        let Some(pilot_host) = drone.pilot_host.as_mut().filter(|_| !drone.frozen) else { continue };
        drone.frames.clear();
        let _in_pilot = worker.place.enter(pilot_host.drone().0);
        let step = pilot_host.begin_step(down, &mut worker.arrived, scratch, &mut drone.slot, &mut worker.stats);
        *begun = step.map(|step| (step, &mut drone.frames));
    }
    for (begun, scratch) in begun.iter_mut().zip(&mut worker.scratch) {
        let Some((step, frames)) = begun else { continue };
        let _in_pilot = worker.place.enter(step.drone().0);
        step.end(down, scratch, &mut worker.stats);
        // Few ticks have many frames, and their memory is given back.
        frames.shrink_to(FEW_FRAMES);
        frames.extend(scratch.said().frames());
    }
}

/// Does to a pilot what the supervisor does to a process.
fn carry_out(command: ProcessCommand, drones: &mut [InlineDrone], factory: &DroneFactory<'_>, start: SimTime) {
    match command {
        ProcessCommand::Kill(id) => {
            let drone = &mut drones[id.index()];
            (drone.pilot_host, drone.frozen) = (None, false);
        }
        ProcessCommand::Freeze(id) => drones[id.index()].frozen = true,
        ProcessCommand::Resume(id) => drones[id.index()].frozen = false,
        ProcessCommand::Restart(id, incarnation) => {
            let drone = &mut drones[id.index()];
            match factory.pilot_host(id, incarnation, start) {
                Ok(pilot_host) => drone.pilot_host = Some(pilot_host),
                Err(error) => drone.unborn = Some(error.to_string()),
            }
        }
    }
}

/// Number of frames for which a drone keeps memory. By hand: most ticks have one or none.
const FEW_FRAMES: usize = 4;

/// One drone and its answer to the current tick.
struct InlineDrone {
    /// `None` once it was killed.
    pilot_host: Option<PilotHost>,
    frozen: bool,
    /// Why it has no pilot although it was restarted.
    unborn: Option<String>,
    slot: Slot,
    frames: Vec<Frame>,
}

impl InlineDrone {
    fn new(pilot_host: PilotHost) -> Self {
        Self { pilot_host: Some(pilot_host), frozen: false, unborn: None, slot: Slot::default(), frames: Vec::new() }
    }

    /// Fetches the memory of its pilot into the cache.
    fn prefetch(&self) {
        self.pilot_host.iter().for_each(PilotHost::prefetch);
    }

    /// Whether its pilot is neither killed nor frozen.
    fn flies(&self) -> bool {
        self.pilot_host.is_some() && !self.frozen
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use skein_agent::CoursePilot;
    use skein_pilot::{Command, Inbox, Out, Pilot, Senses};
    use skein_scenario::ScenarioSource;

    /// The paper's pilot in one that steps it as a whole, as a pilot of a user may do.
    struct AtOnce(CoursePilot);

    impl Pilot for AtOnce {
        fn step(&mut self, senses: &Senses<'_>, inbox: &Inbox<'_>, out: &mut Out) -> Command {
            self.0.step(senses, inbox, out)
        }
    }

    fn digest(scenario: &Scenario, pilots: &PilotRegistry, threads: usize) -> u64 {
        let mut swarm = InlineSwarm::new(NonZero::new(threads).unwrap(), scenario, pilots).unwrap();
        while swarm.world.ended().is_none() {
            swarm.tick();
        }
        swarm.world.digest()
    }

    #[test]
    fn a_pilot_that_is_stepped_at_once_flies_as_one_that_begins_first() {
        let scene = "
            [formation]
            shape = \"v\"
            drones = 11
            [mission]
            end = \"time\"
            duration_s = 30
            [[obstacle]]
            shape = \"circle\"
            centre_m = [250, 5]
            radius_m = 40
            [[obstacle]]
            shape = \"circle\"
            centre_m = [200, -90]
            radius_m = 20
            top_m = 20
            [[fault]]
            at_s = 6
            kind = \"restart\"
            for_s = 3
            drone = 4
            [[fault]]
            at_s = 5
            kind = \"freeze\"
            for_s = 2
            drone = 9
        ";
        let scenario = Scenario::parse(scene, ScenarioSource { name: "halves", stem: "halves" }, &[]).unwrap();
        let halves = PilotRegistry::built_in().unwrap();
        let mut whole = PilotRegistry::built_in().unwrap();
        let known = scenario.clone();
        whole.register("paper", move |birth| {
            let (id, start) = (DroneId(birth.drone), SimTime::from_secs(birth.start_s));
            let params = mission::pilot_params(&known, id, birth.incarnation, start);
            Ok(Box::new(AtOnce(CoursePilot::new(known.course(), params))))
        });
        let expected = digest(&scenario, &whole, 1);
        assert_eq!([1, 2].map(|threads| digest(&scenario, &halves, threads)), [expected; 2]);
    }
}
