//! One mission, one tick at a time. [`World`] composes the machines of this crate and has no rules of its own.

use crate::counters::MissionCounters;
use crate::decision_log::DecisionLog;
use crate::drones::DroneTable;
use crate::event_log::EventLog;
use crate::fault_plan::ProcessCommand;
use crate::faults::engine::FaultEngine;
use crate::geometry::Outline;
use crate::invariants::InvariantMonitor;
use crate::judge::{MissionJudge, MissionState, Verdict};
use crate::params::{PartsRule, WorldError, WorldParams};
use crate::parts::Parts;
use crate::sense_writer::{SenseWriter, Sensed};
use crate::sensor_model::SensorModel;
use crate::stages::Stages;
use crate::stillness::Stillness;
use crate::sweep::{SensorSweep, SweepRange};
use crate::telemetry_log::TelemetryLog;
use crate::tick_digest::TickDigest;
use crate::tick_record::{EndedTick, TickRecord};
use crate::uplink::Uplink;
use skein_protocol::downlink::Downlink;
use skein_protocol::frame::{AirFrame, Frame};
use skein_protocol::nearby::Locality;
use skein_protocol::record::{EventKind, FaultKind, Outcome, Percentiles, RecordView, Totals};
use skein_protocol::shape::ConvexShape;
use skein_protocol::slot::{LinkStats, Slot};
use skein_protocol::telemetry::Telemetry;
use skein_protocol::{DroneId, SimTime, Tick, Vec3};

/// The true state of one mission.
///
/// In each tick, call in this order:
/// 1. [`World::process_commands`], and do to the processes what it says;
/// 2. [`World::downlink`], which every living drone reads;
/// 3. for each living drone [`World::take_slot`] and [`World::take_frames`], or [`World::hold`], or
///    [`World::mark_dead`];
/// 4. [`World::advance`], then [`World::record`].
///
/// When [`World::ended`] gives an outcome, call [`World::finish`] and [`World::record`] once more. Calls about a drone
/// that does not exist have no effect.
#[derive(Clone)]
pub struct World {
    params: WorldParams,
    tick: Tick,
    /// Whether the current tick is open.
    open: bool,
    drones: DroneTable,
    sweep: SensorSweep,
    faults: FaultEngine,
    stages: Stages,
    monitor: InvariantMonitor,
    decisions: DecisionLog,
    judge: MissionJudge,
    parts: Parts,
    stillness: Stillness,
    uplink: Uplink,
    sense_writer: SenseWriter,
    sensors: SensorModel,
    downlink: Downlink,
    counters: MissionCounters,
    digest: TickDigest,
    log: EventLog,
    telemetry: TelemetryLog,
    record: TickRecord,
}

impl World {
    /// A world at the start of its mission. `starts` holds each drone's position (m) and velocity (m/s) in the world
    /// frame, by id. Obstacles are numbered by their order in `obstacles`.
    ///
    /// # Errors
    /// [`WorldError`] names the parameter, start or obstacle that is invalid.
    pub fn new(params: WorldParams, starts: &[(Vec3, Vec3)], obstacles: &[ConvexShape]) -> Result<Self, WorldError> {
        params.check()?;
        check_bodies(starts, obstacles)?;
        let outlines: Vec<Outline> = obstacles.iter().map(Outline::new).collect();
        let drones = DroneTable::new(starts);
        let mut world = Self {
            tick: 0,
            open: false,
            faults: FaultEngine::new(params.faults.clone(), starts.len()),
            stages: Stages::new(params.course, &outlines, 2.0 * params.planning_distance_m),
            monitor: InvariantMonitor::new(drones.bodies(), params.safe_distance_m, params.clearance_m),
            sweep: SensorSweep::new(outlines),
            decisions: DecisionLog::new(starts.len()),
            judge: MissionJudge::among(obstacles),
            parts: Parts::default(),
            // A drone that flies from one slot to another moves.
            stillness: Stillness::new(drones.bodies(), params.spacing_m / 2.0),
            uplink: Uplink::new(params.channel),
            sense_writer: SenseWriter::new(obstacles),
            sensors: SensorModel::new(&params, starts.len()),
            downlink: Downlink::default(),
            counters: MissionCounters::default(),
            digest: TickDigest::default(),
            log: EventLog::default(),
            telemetry: TelemetryLog::new(starts.len()),
            record: TickRecord::default(),
            params,
            drones,
        };
        world.sweep();
        Ok(world)
    }

    /// The number of the current tick, from 0: the tick that [`World::downlink`] opens and [`World::advance`] ends.
    #[must_use]
    pub fn tick(&self) -> Tick {
        self.tick
    }

    /// The time at which the current tick opens.
    #[must_use]
    pub fn now(&self) -> SimTime {
        self.time_of(self.tick)
    }

    /// What the faults of the current tick do to the drones' processes. Do it in this order, before the tick's downlink
    /// goes out. The world counts it as done.
    pub fn process_commands(&mut self) -> &[ProcessCommand] {
        self.open();
        self.faults.commands()
    }

    /// The senses of all drones in the current tick, and the frames that were sent in the tick before.
    pub fn downlink(&mut self) -> &Downlink {
        self.open();
        let (tick, now, faults) = (self.tick, self.now(), self.faults.schedule());
        let processes = self.drones.processes().iter().zip(0..);
        let drones =
            processes.map(|(process, id)| (process.incarnation(), faults.sensor_fault(DroneId(id), (tick, now))));
        let sensed = Sensed {
            bodies: self.drones.bodies(),
            sweep: &self.sweep,
            ranging_m: self.params.ranging_m,
            model: &self.sensors,
            now,
        };
        self.sense_writer.write(&sensed, drones, &mut self.downlink);
        // A drone counts its own frames by their order. Without that order there is no index by place.
        let locality = if self.uplink.keeps_order() { self.params.locality } else { Locality::default() };
        self.downlink.index.build(locality, &self.downlink.frames);
        self.downlink.seal(tick, now);
        &self.downlink
    }

    /// What [`World::downlink`] built last.
    #[must_use]
    pub fn sensed(&self) -> &Downlink {
        &self.downlink
    }

    /// Takes a drone's answer to the current tick. Answers of dead and frozen drones are ignored.
    pub fn take_slot(&mut self, id: DroneId, slot: &Slot) {
        self.drones.take_slot(id, slot);
    }

    /// Takes the frames that a drone sent in the current tick, in the order in which it sent them. Telemetry is recorded; all
    /// other frames go on the air. Frames of dead drones are ignored.
    pub fn take_frames(&mut self, id: DroneId, frames: &[Frame]) {
        if !self.drones.is_alive(id) {
            return;
        }
        let link_faults = self.faults.schedule().standing(id).link_faults;
        let mut sent = 0;
        for &frame in frames {
            if Telemetry::is_kind(frame.kind) {
                self.counters.count_refused(u64::from(!self.telemetry.take(id, &frame)));
                continue;
            }
            sent += 1;
            let Some((sequence, position)) = self.drones.next_frame(id) else { return };
            let position_m = position.into();
            self.uplink.push(AirFrame {
                tick: self.tick,
                source: id,
                sequence,
                position_m,
                queue_ns: 0,
                link_faults,
                frame,
            });
        }
        self.counters.count_sent(sent);
    }

    /// A drone did not answer in time, which happens by the wall clock only. It brakes until its next command: its last one may
    /// no longer be safe. The missed deadline is counted once per tick.
    pub fn hold(&mut self, id: DroneId) {
        self.counters.count_missed(u64::from(self.drones.miss(id)));
    }

    /// A drone's process is gone: its body follows the failsafe from the current tick on. `detail` describes what is
    /// known for people, such as the signal or the exit code.
    pub fn mark_dead(&mut self, id: DroneId, kind: FaultKind, scheduled: bool, detail: &str) {
        if self.drones.kill(id) {
            self.decisions.forget(id);
            self.log.push(self.now(), EventKind::Fault { kind, target: id, scheduled, detail: detail.to_owned() });
        }
    }

    /// Logs that a drone's pilot has failed in a way that the drone itself could not report, such as an exit.
    pub fn note_failure(&mut self, id: DroneId, reason: &str) {
        let pilot = self.params.pilot_of(id).to_owned();
        self.log.push(self.now(), EventKind::Failure { drone: id, pilot, reason: reason.to_owned() });
    }

    /// Sets the incarnation of a drone's process, from 1, as its senses give it. A new incarnation may obey an older
    /// plan than the one before it.
    pub fn set_incarnation(&mut self, id: DroneId, incarnation: u32) {
        if self.drones.set_incarnation(id, incarnation) {
            self.monitor.restart(id);
            self.decisions.forget(id);
        }
    }

    /// The incarnation of a drone's process; `None` if there is no such drone.
    #[must_use]
    pub fn incarnation(&self, id: DroneId) -> Option<u32> {
        self.drones.process(id).map(crate::process::Process::incarnation)
    }

    /// Ends the tick: commands, bodies, energy, invariants, obstacle sets, end condition, digest, record. A living drone
    /// that has not answered is held. The order in which drones answered makes no difference.
    pub fn advance(&mut self) {
        let (opening, end) = (self.now(), self.time_of(self.tick + 1));
        self.uplink.close(opening);
        self.follow_answers(opening);
        self.move_bodies(opening);
        self.sweep();
        self.monitor.check_distances(self.drones.bodies(), &self.sweep, end, &mut self.log);
        self.stages.pass(self.drones.bodies(), end, &mut self.log);
        self.judge(end);
        self.digest.fold(self.tick, &self.drones, self.uplink.frames());
        self.close_tick(end);
    }

    /// The record of the tick that ended last; after [`World::finish`], the record of the mission's end.
    #[must_use]
    pub fn record(&self) -> RecordView<'_> {
        self.record.view(&self.downlink.frames, self.telemetry.ended(), self.log.ended())
    }

    /// How the mission ended; `None` while it goes on.
    #[must_use]
    pub fn ended(&self) -> Option<Outcome> {
        self.judge.outcome()
    }

    /// Ends the mission from outside for this reason, unless it has ended.
    pub fn abort(&mut self, reason: &str) {
        self.judge.abort(reason);
    }

    /// Makes the last record: the end event with the mission's totals, without rows and frames, under the tick, time and
    /// digest of the tick that ended last. `stats` are the merged link counters of all drones. `wall_s` is the wall time
    /// from the opening of the first tick to the end of the last one, s. A mission that has not ended is aborted.
    pub fn finish(&mut self, stats: &LinkStats, wall_s: f64) {
        let Verdict { outcome, reason, stuck, unfinished, standstill_s } = self.judge.abort("the mission was stopped");
        let parts = matches!(self.params.parts, PartsRule::Each { .. }).then(|| self.parts.count() as u32);
        let totals = Box::new(Totals { parts, ..self.counters.close(stats, self.params.dt_s(), wall_s) });
        self.log.push(self.now(), EventKind::End { outcome, reason, stuck, unfinished, standstill_s, totals });
        self.log.end_tick();
        self.record.close_mission(self.digest(), self.log.ended().len());
    }

    /// Notes how late ticks opened by the wall clock, s. [`World::finish`] reports it.
    pub fn note_lateness(&mut self, lateness_s: Percentiles) {
        self.counters.set_lateness(lateness_s);
    }

    /// The digest so far, over every drone's state and what it received in every tick.
    #[must_use]
    pub fn digest(&self) -> u64 {
        self.digest.value()
    }

    /// Whether a drone's process lives; false if there is no such drone.
    #[must_use]
    pub fn is_alive(&self, id: DroneId) -> bool {
        self.drones.is_alive(id)
    }

    /// Whether a drone's process is stopped; false if there is no such drone.
    #[must_use]
    pub fn is_frozen(&self, id: DroneId) -> bool {
        self.drones.process(id).is_some_and(crate::process::Process::is_frozen)
    }

    /// Least distance of two bodies so far, m; infinite if there were never two.
    #[must_use]
    pub fn min_separation_m(&self) -> f64 {
        self.monitor.min_separation_m()
    }

    /// Least distance of a body to an obstacle at the end of a tick so far, m; infinite without obstacles.
    #[must_use]
    pub fn min_clearance_m(&self) -> f64 {
        self.monitor.min_clearance_m()
    }

    /// Violations of invariants so far.
    #[must_use]
    pub fn violations(&self) -> u64 {
        self.monitor.violations()
    }

    fn time_of(&self, tick: Tick) -> SimTime {
        SimTime((tick as i64).saturating_mul(self.params.dt_ns))
    }

    /// Opens the tick once: faults end, obstacle sets are detected, faults begin.
    fn open(&mut self) {
        if std::mem::replace(&mut self.open, true) {
            return;
        }
        let now = self.now();
        self.faults.end_due(now, &mut self.drones, &mut self.log);
        self.drop_unsensed_contacts();
        self.stages.detect(self.sweep.contacts(), self.drones.bodies(), now, &mut self.log);
        if self.faults.begin_due(now, &mut self.drones, &self.stages, &mut self.log) {
            self.drop_unsensed_contacts();
        }
        self.sensors.begin(self.tick, self.drones.bodies());
        self.follow_commands();
    }

    /// Dead drones and drones with a broken obstacle sensor sense no obstacles.
    fn drop_unsensed_contacts(&mut self) {
        let (drones, faults) = (&self.drones, self.faults.schedule());
        self.sweep.retain_contacts_of(|drone| {
            let id = DroneId(drone);
            drones.is_alive(id) && !faults.standing(id).no_obstacles
        });
    }

    /// Forgets what killed and restarted processes have said.
    fn follow_commands(&mut self) {
        for &command in self.faults.commands() {
            match command {
                ProcessCommand::Kill(id) => self.decisions.forget(id),
                ProcessCommand::Restart(id, _) => {
                    self.monitor.restart(id);
                    self.decisions.forget(id);
                }
                ProcessCommand::Freeze(_) | ProcessCommand::Resume(_) => {}
            }
        }
    }

    /// Counts and checks what drones reported in the tick, and logs what leaders decided.
    fn follow_answers(&mut self, opening: SimTime) {
        self.counters.count_missed(self.drones.hold_unanswered());
        for (drone, slot) in self.drones.answers() {
            let id = DroneId(drone as u32);
            self.counters.count_slot(slot);
            if slot.has_failed() {
                let reason = self.telemetry.failure(id).unwrap_or("it did not say why").to_owned();
                let pilot = self.params.pilot_of(id).to_owned();
                self.log.push(opening, EventKind::Failure { drone: id, pilot, reason: reason.clone() });
                self.faults.fail(id, reason);
                continue;
            }
            self.monitor.check_obedience(id, slot, opening, &mut self.log);
            self.decisions.follow_slot(id, slot, opening, &mut self.log);
        }
        for frame in self.uplink.frames() {
            self.decisions.follow_frame(frame, opening, &mut self.log);
        }
    }

    fn move_bodies(&mut self, opening: SimTime) {
        let faults = self.faults.schedule();
        let rejected = self.drones.fly(&self.params, opening, |id| faults.wind_mps2(id, opening).push(0.0));
        self.counters.count_rejected(rejected);
    }

    /// Looks around every body, as far as senses and invariants need it.
    fn sweep(&mut self) {
        let params = &self.params;
        let bodies_m = params.safe_distance_m.max(params.ranging_m.unwrap_or(0.0));
        let range = SweepRange {
            // Pairs farther apart than the least distance so far change nothing. That distance is finite with two bodies.
            bodies_m: bodies_m.max(self.monitor.min_separation_m()),
            detection_m: params.detection_range_m,
            clearance_m: params.clearance_m.max(self.monitor.min_clearance_m()),
        };
        self.sweep.sweep(self.drones.bodies(), range);
    }

    fn judge(&mut self, end: SimTime) {
        if let PartsRule::Each { reach_m } = self.params.parts {
            let faults = self.faults.schedule();
            self.parts.look(end, self.drones.bodies(), |id| faults.standing(id).link_faults, reach_m);
        }
        self.stillness.look(end, self.drones.bodies());
        let state = MissionState {
            bodies: self.drones.bodies(),
            processes: self.drones.processes(),
            stillness: &self.stillness,
            all_done: self.drones.all_done(),
            parts: &self.parts,
            stages: &self.stages,
            end,
            awaits_restarts: self.faults.schedule().awaits_restarts(),
            violations: self.monitor.violations(),
        };
        self.judge.judge(&self.params, state);
    }

    /// Records the tick and opens the next one.
    fn close_tick(&mut self, end: SimTime) {
        self.uplink.hand_over(&mut self.downlink.frames);
        self.log.end_tick();
        self.telemetry.end_tick();
        let ended = EndedTick {
            tick: self.tick,
            end,
            digest: self.digest(),
            events_len: self.log.ended().len(),
            frames: self.downlink.frames.len(),
            telemetry: self.telemetry.ended().len(),
        };
        self.record.close_tick(ended, &self.drones, self.faults.schedule());
        self.drones.open_tick();
        self.tick += 1;
        self.open = false;
    }
}

fn check_bodies(starts: &[(Vec3, Vec3)], obstacles: &[ConvexShape]) -> Result<(), WorldError> {
    let finite = |v: &Vec3| v.iter().all(|part| part.is_finite());
    if let Some(drone) = starts.iter().position(|(position, velocity)| !finite(position) || !finite(velocity)) {
        return Err(WorldError::Start(drone));
    }
    for (index, shape) in obstacles.iter().enumerate() {
        shape.check().map_err(|error| WorldError::Obstacle { index, error })?;
    }
    Ok(())
}

#[cfg(test)]
mod fault_tests;
#[cfg(test)]
mod pilot_tests;
#[cfg(test)]
mod tests;
