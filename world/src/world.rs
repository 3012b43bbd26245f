//! One mission, a tick at a time.
//!
//! In each tick: [`World::process_commands`], and what they say done to processes; [`World::downlink`]; then for each living drone [`World::take_slot`] and [`World::take_frames`], or
//! [`World::hold`], or [`World::mark_dead`]; then [`World::advance`] and [`World::record`]. When [`World::ended`] says
//! so: [`World::finish`] and, once more, [`World::record`].

use crate::body::Body;
use crate::decisions::Decisions;
use crate::faults::ProcessCommand;
use crate::faults::engine::Engine;
use crate::finish::Finish;
use crate::geometry::Outline;
use crate::invariants::Distances;
use crate::log::Log;
use crate::params::{WorldError, WorldParams};
use crate::process::{Answer, Process};
use crate::senses::{Reach, SenseWriter, Surroundings};
use crate::stages::Stages;
use crate::totals;
use skein_protocol::digest::Digest;
use skein_protocol::downlink::Downlink;
use skein_protocol::frame::{AirFrame, Frame};
use skein_protocol::nearby::Locality;
use skein_protocol::radio::{ChannelQueue, DropReason};
use skein_protocol::record::{DroneRow, EventKind, FaultKind, Outcome, Percentiles, RecordHeader, RecordView, Totals};
use skein_protocol::shape::ConvexShape;
use skein_protocol::slot::{LinkStats, Slot};
use skein_protocol::{DroneId, SimTime, Tick, Vec2};

/// The first so many drop counters are in every digest. Duplicates and later reasons are in it only where they count, so
/// that a mission without them keeps the digest it had before there were any.
const ALWAYS_FOLDED: usize = DropReason::Queue as usize;

/// The truth of one mission.
#[derive(Clone)]
pub struct World {
    params: WorldParams,
    tick: Tick,
    bodies: Vec<Body>,
    processes: Vec<Process>,
    outlines: Vec<Outline>,
    around: Surroundings,
    teller: SenseWriter,
    distances: Distances,
    stages: Stages,
    decisions: Decisions,
    faults: Engine,
    /// What the tick's faults do to processes.
    commands: Vec<ProcessCommand>,
    /// Whether the current tick is open.
    open: bool,
    finish: Finish,
    log: Log,
    totals: Totals,
    digest: Digest,
    /// What the digest takes in of one tick.
    folded: Vec<u8>,
    /// Frames sent in this tick.
    sent: Vec<AirFrame>,
    /// What they wait in for the channel.
    queue: Option<ChannelQueue>,
    down: Downlink,
    head: RecordHeader,
    rows: Vec<DroneRow>,
    end: Option<(Outcome, String)>,
}

impl World {
    /// A world at the start of its mission. `starts`: each drone's position (m) and velocity (m/s), by id. Obstacles
    /// are numbered in their order here.
    ///
    /// # Errors
    /// [`WorldError`] names the parameter, start or obstacle that cannot be.
    pub fn new(params: WorldParams, starts: &[(Vec2, Vec2)], obstacles: &[ConvexShape]) -> Result<Self, WorldError> {
        params.check()?;
        check_bodies(starts, obstacles)?;
        let outlines: Vec<Outline> = obstacles.iter().map(Outline::new).collect();
        let bodies: Vec<Body> = starts.iter().map(|&(position, velocity)| Body::new(position, velocity)).collect();
        let mut world = Self {
            tick: 0,
            processes: vec![Process::default(); bodies.len()],
            around: Surroundings::default(),
            teller: SenseWriter::new(obstacles),
            distances: Distances::new(&bodies, params.safe_distance_m, params.clearance_m),
            stages: Stages::new(&outlines, 2.0 * params.planning_distance_m),
            decisions: Decisions::new(bodies.len()),
            faults: Engine::new(params.faults.clone(), bodies.len()),
            commands: Vec::new(),
            open: false,
            finish: Finish::default(),
            log: Log::default(),
            totals: Totals::default(),
            digest: Digest::default(),
            folded: Vec::new(),
            sent: Vec::new(),
            queue: params.channel.map(ChannelQueue::new),
            down: Downlink::default(),
            head: RecordHeader::default(),
            rows: Vec::new(),
            end: None,
            params,
            bodies,
            outlines,
        };
        world.survey();
        Ok(world)
    }

    /// The current tick: the one that [`World::downlink`] opens and [`World::advance`] ends.
    #[must_use]
    pub fn tick(&self) -> Tick {
        self.tick
    }

    /// The time at which the current tick opens.
    #[must_use]
    pub fn now(&self) -> SimTime {
        self.time_of(self.tick)
    }

    /// Everybody's senses in the current tick, and the frames sent in the tick before.
    pub fn downlink(&mut self) -> &Downlink {
        self.open();
        let (tick, faults) = (self.tick, &self.faults);
        let told = |(process, id): (&Process, u32)| (process.incarnation, faults.sensor_fault(DroneId(id), tick));
        let drones = self.processes.iter().zip(0..).map(told);
        self.teller.tell(&self.bodies, drones, &self.around, self.params.ranging_m, &mut self.down);
        // In a queue for the channel frames lose their order, by which a drone counts its own.
        let locality = if self.queue.is_none() { self.params.locality } else { Locality::default() };
        self.down.index.build(locality, &self.down.frames);
        self.down.seal(tick, self.now());
        &self.down
    }

    /// Takes a drone's answer to the current tick. Unknown and dead drones are ignored, here and below.
    pub fn take_slot(&mut self, id: DroneId, slot: &Slot) {
        if let Some(process) = self.living(id) {
            process.slot = *slot;
            process.answered();
        }
    }

    /// Takes the frames that a drone sent in the current tick, in the order in which it sent them.
    pub fn take_frames(&mut self, id: DroneId, frames: &[Frame]) {
        let Some(body) = self.bodies.get(id.index()).filter(|body| body.alive) else { return };
        let (tick, position_m, process) = (self.tick, body.position.into(), &mut self.processes[id.index()]);
        let cuts = self.faults.standing(id).cuts;
        let stamp = |&frame| AirFrame {
            tick,
            source: id,
            sequence: process.next_sequence(),
            position_m,
            queue_ns: 0,
            link_faults: cuts,
            frame,
        };
        self.sent.extend(frames.iter().map(stamp));
        self.totals.sent += frames.len() as u64;
    }

    /// A drone did not answer in time (wall clock only): its last command holds for a while, then it brakes; the miss is
    /// counted.
    pub fn hold(&mut self, id: DroneId) {
        if let Some(process) = self.living(id).filter(|process| process.answer != Answer::Late) {
            process.hold(Answer::Late);
            self.totals.deadline_misses += 1;
        }
    }

    /// A drone's process is gone in the current tick: its body follows the failsafe from this tick on. `detail` says
    /// for people what is known: the signal, the exit code.
    pub fn mark_dead(&mut self, id: DroneId, kind: FaultKind, scheduled: bool, detail: &str) {
        let now = self.now();
        let Some(body) = self.bodies.get_mut(id.index()).filter(|body| body.alive) else { return };
        body.alive = false;
        self.processes[id.index()].frozen = false;
        self.decisions.forget(id);
        self.log.push(now, EventKind::Fault { kind, target: id, scheduled, detail: detail.to_owned() });
    }

    /// The incarnation of a drone's process, from 1, as its senses tell it. A new one may begin with an older plan.
    pub fn set_incarnation(&mut self, id: DroneId, incarnation: u32) {
        if let Some(process) = self.processes.get_mut(id.index()).filter(|process| process.incarnation != incarnation) {
            process.incarnation = incarnation;
            process.obedience.restart();
            self.decisions.forget(id);
        }
    }

    /// The incarnation of a drone's process; `None` if there is no such drone.
    #[must_use]
    pub fn incarnation(&self, id: DroneId) -> Option<u32> {
        self.processes.get(id.index()).map(|process| process.incarnation)
    }

    /// Ends the tick: commands, bodies, energy, invariants, stages, end condition, digest, record. A living drone
    /// that has not answered is held. The calls before may come in any order of drones: it makes no difference.
    pub fn advance(&mut self) {
        self.sent.sort_unstable_by_key(|sent| (sent.source, sent.sequence));
        let (opening, end) = (self.now(), self.time_of(self.tick + 1));
        if let Some(queue) = &mut self.queue {
            queue.schedule(opening, &mut self.sent);
        }
        self.follow_processes(opening);
        self.move_bodies();
        self.survey();
        self.distances.check(&self.bodies, &self.around, end, &mut self.log);
        self.stages.pass(&self.bodies, end, &mut self.log);
        self.judge(end);
        self.fold();
        self.close_tick(end);
    }

    /// The record of the tick that ended last; after [`World::finish`], that of the mission's end.
    #[must_use]
    pub fn record(&self) -> RecordView<'_> {
        let frames = if self.head.frames == 0 { &[] } else { &self.down.frames[..] };
        RecordView { head: &self.head, rows: &self.rows, frames, events: self.log.told() }
    }

    /// How the mission ended, once it has.
    #[must_use]
    pub fn ended(&self) -> Option<Outcome> {
        self.end.as_ref().map(|(outcome, _)| *outcome)
    }

    /// Ends the mission from outside, for this reason, unless it has ended.
    pub fn abort(&mut self, reason: &str) {
        self.end.get_or_insert_with(|| (Outcome::Aborted, reason.to_owned()));
    }

    /// Makes the last record: the end event with the mission's totals, without rows and frames, under the tick, time
    /// and digest of the last tick that ended. `stats` are all drones' link counters, merged; `wall_s` the wall time
    /// from the first tick opened to the last tick done, s. A mission that has not ended is aborted.
    pub fn finish(&mut self, stats: &LinkStats, wall_s: f64) {
        self.abort("the mission was stopped");
        let Some((outcome, reason)) = self.end.clone() else { return };
        let totals = Box::new(totals::close(&self.totals, stats, self.params.dt_s(), wall_s));
        self.log.push(self.now(), EventKind::End { outcome, reason, totals });
        self.log.turn();
        self.rows.clear();
        let events_len = self.log.told().len() as u32;
        self.head = RecordHeader { rows: 0, frames: 0, events_len, digest: self.digest(), ..self.head };
    }

    /// How late ticks opened by the wall clock: for [`World::finish`].
    pub fn note_lateness(&mut self, lateness_s: Percentiles) {
        self.totals.lateness_s = lateness_s;
    }

    /// The digest so far, over every drone's state and what it heard in every tick.
    #[must_use]
    pub fn digest(&self) -> u64 {
        self.digest.value()
    }

    /// Whether a drone's process lives; not if there is no such drone.
    #[must_use]
    pub fn is_alive(&self, id: DroneId) -> bool {
        self.bodies.get(id.index()).is_some_and(|body| body.alive)
    }

    /// Least distance of two bodies so far, m; infinite if there were never two.
    #[must_use]
    pub fn min_separation_m(&self) -> f64 {
        self.distances.min_separation_m()
    }

    /// Least distance of a body to an obstacle at the end of a tick so far, m; infinite without obstacles.
    #[must_use]
    pub fn min_clearance_m(&self) -> f64 {
        self.distances.min_clearance_m
    }

    /// Violations of invariants so far.
    #[must_use]
    pub fn violations(&self) -> u64 {
        self.distances.violations
    }

    fn time_of(&self, tick: Tick) -> SimTime {
        SimTime((tick as i64).saturating_mul(self.params.dt_ns))
    }

    fn living(&mut self, id: DroneId) -> Option<&mut Process> {
        self.is_alive(id).then(|| &mut self.processes[id.index()]).filter(|process| !process.frozen)
    }

    fn survey(&mut self) {
        let params = &self.params;
        let bodies_m = params.safe_distance_m.max(params.ranging_m.unwrap_or(0.0));
        let reach = Reach {
            // Farther than the least distance so far nothing matters, and that one is finite with two bodies.
            bodies_m: bodies_m.max(self.distances.min_separation_m()),
            detection_m: params.detection_range_m,
            clearance_m: params.clearance_m.max(self.distances.min_clearance_m),
        };
        self.around.survey(&self.bodies, &self.outlines, reach);
    }

    fn follow_processes(&mut self, opening: SimTime) {
        for index in 0..self.processes.len() {
            let id = DroneId(index as u32);
            if !self.bodies[index].alive {
                continue;
            }
            if self.processes[index].frozen {
                self.processes[index].hold(Answer::Frozen);
                continue;
            }
            if self.processes[index].answer == Answer::Awaited {
                self.hold(id);
            }
            let process = &mut self.processes[index];
            totals::tally(&mut self.totals, &process.slot);
            self.distances.violations += process.obedience.check(id, &process.slot, opening, &mut self.log);
            self.decisions.follow_slot(id, &process.slot, opening, &mut self.log);
        }
        self.sent.iter().for_each(|sent| self.decisions.follow_frame(sent, opening, &mut self.log));
    }

    fn judge(&mut self, end: SimTime) {
        if self.end.is_some() {
            return;
        }
        let (outcome, reason) = if self.finish.met(&self.params, &self.bodies, &self.stages) {
            (Outcome::Reached, "the end condition is met".to_owned())
        } else if !self.bodies.iter().any(|body| body.alive) && !self.faults.awaits_restarts() {
            (Outcome::Timeout, "no drone is left alive".to_owned())
        } else if end >= SimTime::from_secs(self.params.timeout_s) {
            (Outcome::Timeout, format!("the time of {} s is over", self.params.timeout_s))
        } else {
            return;
        };
        self.end = Some(match self.violations() {
            0 => (outcome, reason),
            count => (Outcome::Unsafe, format!("{reason}, but invariants were broken {count} times")),
        });
    }

    fn close_tick(&mut self, end: SimTime) {
        self.rows.clear();
        for ((body, process), id) in self.bodies.iter().zip(&self.processes).zip(0..) {
            self.rows.push(process.row(body, self.faults.standing(DroneId(id)).cuts));
        }
        self.processes.iter_mut().for_each(|process| process.answer = Answer::Awaited);
        std::mem::swap(&mut self.down.frames, &mut self.sent);
        self.sent.clear();
        self.log.turn();
        self.head = RecordHeader {
            tick: self.tick,
            now: end,
            rows: self.rows.len() as u32,
            frames: self.down.frames.len() as u32,
            events_len: self.log.told().len() as u32,
            lost: 0,
            digest: self.digest(),
        };
        self.tick += 1;
        self.open = false;
    }
}

fn check_bodies(starts: &[(Vec2, Vec2)], obstacles: &[ConvexShape]) -> Result<(), WorldError> {
    let finite = |v: &Vec2| v.iter().all(|part| part.is_finite());
    if let Some(drone) = starts.iter().position(|(position, velocity)| !finite(position) || !finite(velocity)) {
        return Err(WorldError::Start(drone));
    }
    let mut shapes = obstacles.iter().enumerate();
    shapes.try_for_each(|(index, shape)| shape.check().map_err(|error| WorldError::Obstacle { index, error }))
}

mod fold;
mod motion;
mod orders;
#[cfg(test)]
mod tests;
