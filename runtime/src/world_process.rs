//! The world process: in each tick it sends the downlink, waits for the drones, advances the world and sends the record.

use crate::child_args::ChildArgs;
use crate::clock::Clock;
use crate::error::RuntimeError;
use crate::mission;
use crate::pacer::Pacer;
use crate::record_wait::{NextOffer, RecordLimits, RecordWait};
use crate::tuning::{DISMISSAL_POLL, REQUEST_LIMIT, RESTART_LIMIT};
use crate::uplinks::Uplinks;
use skein_bus::{
    Control, Domain, DownlinkPublisher, Patience, ProcessRequest, RecordPolicy, RecordPublisher, RequestKind, Services,
    TickOutcome, WatchPublisher, WorldState, clean_dead_nodes, pin_to_core, raise_file_limit,
};
use skein_protocol::DroneId;
use skein_protocol::record::{FaultKind, RecordHeader, RecordView};
use skein_protocol::slot::LinkStats;
use skein_scenario::Scenario;
use skein_world::World;
use skein_world::faults::ProcessCommand;
use std::os::unix::process::ExitStatusExt;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// The signal that ends a process at once.
const SIGKILL: i32 = 9;

/// Stop request of a launcher that has read the whole record.
pub(crate) const DISMISSED: u32 = u32::MAX;

/// Runs the world of a swarm until its mission ends. In lockstep, a drone that does not answer for `patience` is given up.
///
/// # Errors
/// [`RuntimeError`]; the launcher notices that the process has ended.
pub fn run(args: &ChildArgs, clock: Clock, patience: Duration) -> Result<(), RuntimeError> {
    args.bind_to_parent()?;
    raise_file_limit()?;
    let scenario = args.scenario()?;
    let control = Arc::new(Control::attach(args.control)?);
    // The barrier expects the world on core 0.
    pin_to_core(0, args.pin)?;
    let domain = Domain::join(&args.domain)?;
    let services = Services::open(&domain, mission::drones(&scenario), "world")?;
    let pace = Pace { clock, patience, record: RecordLimits::default() };
    let mut server = WorldServer::new(&scenario, pace, &services, Arc::clone(&control), domain, args.clone())?;
    control.set_world_state(WorldState::Ready);
    if control.wait_go(|| true) {
        control.set_world_state(WorldState::Flying);
        server.connect()?;
        // The connections are new, and the launcher has reserved everything else.
        services.reserve()?;
        server.fly(clock, scenario.time.dt_s)?;
    }
    control.set_world_state(WorldState::Finished);
    // The last samples are lost when their publisher ends: wait until the launcher has read them. If the launcher dies, the
    // kernel kills this process.
    while control.stop_requested() != Some(DISMISSED) {
        std::thread::sleep(DISMISSAL_POLL);
    }
    Ok(())
}

/// The world and its ports.
struct WorldServer {
    downlink: DownlinkPublisher,
    uplinks: Uplinks,
    record: RecordPublisher,
    watch: WatchPublisher,
    control: Arc<Control>,
    domain: Domain,
    args: ChildArgs,
    world: World,
    /// How each drone answered the tick.
    outcomes: Vec<TickOutcome>,
    /// Records dropped since the last one that was delivered.
    lost_records: u32,
    /// The events of the dropped records.
    unsent_events: Vec<u8>,
    /// By the wall clock, a drone may have found its buffer full. Frames that it has announced then never arrive.
    wall_clock: bool,
    /// How long a drone may take to answer in lockstep.
    patience: Duration,
    /// How long the recorder may take.
    record_limits: RecordLimits,
    /// The host of each drone that flies on another machine.
    hosts: Vec<Option<String>>,
}

/// How ticks are paced, and how long they may take.
struct Pace {
    clock: Clock,
    patience: Duration,
    record: RecordLimits,
}

impl WorldServer {
    fn new(
        scenario: &Scenario,
        Pace { clock, patience, record: record_limits }: Pace,
        services: &Services,
        control: Arc<Control>,
        domain: Domain,
        args: ChildArgs,
    ) -> Result<Self, RuntimeError> {
        let drones = mission::drones(scenario);
        let policy = match clock {
            // The launcher reads the records. If it dies, the kernel kills this process.
            Clock::Lockstep => RecordPolicy::Wait(Box::new(move |waited| waited < record_limits.patience)),
            Clock::Realtime { .. } => RecordPolicy::Drop,
        };
        Ok(Self {
            downlink: services.downlink_publisher()?,
            uplinks: Uplinks::new(services, drones)?,
            record: services.record_publisher(policy)?,
            watch: services.watch_publisher()?,
            control,
            domain,
            args,
            world: mission::world(scenario)?,
            outcomes: vec![TickOutcome::Pending; drones],
            lost_records: 0,
            unsent_events: Vec::new(),
            patience,
            record_limits,
            hosts: scenario.hosts_of_drones(),
            wall_clock: clock != Clock::Lockstep,
        })
    }

    /// Connects all ports now rather than during the first tick.
    fn connect(&self) -> Result<(), RuntimeError> {
        self.downlink.connect()?;
        self.uplinks.connect()?;
        Ok(self.record.connect()?)
    }

    fn fly(&mut self, clock: Clock, dt_s: f64) -> Result<(), RuntimeError> {
        let opened = Instant::now();
        let mut pacer = match clock {
            Clock::Lockstep => None,
            Clock::Realtime { speed } => Some(Pacer::new(dt_s, speed)),
        };
        while self.world.ended().is_none() {
            self.tick(pacer.as_mut())?;
            if let Some(signal) = self.control.stop_requested() {
                self.world.abort(&format!("interrupted by signal {signal}"));
            } else if let Some(pacer) = &pacer {
                pacer.pause();
            }
        }
        let wall_s = opened.elapsed().as_secs_f64();
        if let Some(pacer) = &pacer {
            self.world.note_lateness(pacer.lateness_s());
        }
        let mut stats = LinkStats::default();
        for drone in 0..self.outcomes.len() {
            stats.merge(&self.control.stats(drone));
        }
        self.world.finish(&stats, wall_s);
        self.send_last_record()?;
        self.control.close();
        Ok(())
    }

    fn tick(&mut self, mut pacer: Option<&mut Pacer>) -> Result<(), RuntimeError> {
        let tick = self.world.tick();
        for command in self.world.process_commands().to_vec() {
            let begun = Instant::now();
            self.carry_out(command)?;
            if let Some(pacer) = &mut pacer {
                // The other drones must not be late because a process is started.
                pacer.stand_still(begun.elapsed());
            }
        }
        let down = self.world.downlink();
        self.downlink.send(tick, down.byte_len(), |bytes| down.write_to(bytes))?;
        self.control.open_tick(tick)?;
        let patience = pacer.map_or(Patience::For(self.patience), |pacer| Patience::Until(pacer.open()));
        self.control.wait_done(tick, patience, &mut self.outcomes)?;
        self.take_outcomes()?;
        self.take_frames()?;
        self.world.advance();
        self.send_tick_record()
    }

    /// Requests from the supervisor what a fault does to a process, and waits until it is done.
    fn carry_out(&mut self, command: ProcessCommand) -> Result<(), RuntimeError> {
        let (kind, id) = match command {
            ProcessCommand::Kill(id) => (RequestKind::Kill, id),
            ProcessCommand::Freeze(id) => (RequestKind::Freeze, id),
            ProcessCommand::Resume(id) => (RequestKind::Resume, id),
            ProcessCommand::Restart(id, _) => (RequestKind::Restart, id),
        };
        let limit = if kind == RequestKind::Restart { RESTART_LIMIT } else { REQUEST_LIMIT };
        let reply = self.control.request(ProcessRequest { kind, drone: id, tick: self.world.tick() }, limit)?;
        let drone = id.index();
        match command {
            // The reply does not matter: a process that had ended before is dead as well.
            ProcessCommand::Kill(_) => self.outcomes[drone] = TickOutcome::Dead,
            ProcessCommand::Freeze(_) => self.outcomes[drone] = TickOutcome::Absent,
            // If the process has ended meanwhile, this tick finds it dead.
            ProcessCommand::Resume(_) => self.outcomes[drone] = TickOutcome::Pending,
            ProcessCommand::Restart(_, incarnation) => {
                if reply != incarnation {
                    // The new process has ended, or was never ready: the drone is dead again.
                    self.outcomes[drone] = TickOutcome::Dead;
                    return Ok(());
                }
                self.outcomes[drone] = TickOutcome::Pending;
                self.uplinks.restart(drone);
                self.connect()?;
            }
        }
        Ok(())
    }

    /// Takes the slots of drones that answered, and marks the others in the world: late, dead or hung.
    fn take_outcomes(&mut self) -> Result<(), RuntimeError> {
        for drone in 0..self.outcomes.len() {
            let id = DroneId(drone as u32);
            match self.outcomes[drone] {
                TickOutcome::Done => {
                    let slot = self.control.slot(drone);
                    self.uplinks.announce(drone, slot.frames_total);
                    self.world.take_slot(id, &slot);
                }
                TickOutcome::Late => self.world.hold(id),
                TickOutcome::Dead => self.mark_dead(drone),
                TickOutcome::Hung => {
                    let kind = RequestKind::KillProcess;
                    self.control.request(ProcessRequest { kind, drone: id, tick: self.world.tick() }, REQUEST_LIMIT)?;
                    let reason = format!("it did not answer for {} s and was killed", self.patience.as_secs_f64());
                    self.world.note_failure(id, &reason);
                    self.world.mark_dead(id, FaultKind::Hung, false, &reason);
                }
                // A stopped process that was killed from outside.
                TickOutcome::Absent if self.control.is_dead(drone) => self.mark_dead(drone),
                TickOutcome::Pending | TickOutcome::Absent => {}
            }
        }
        Ok(())
    }

    fn mark_dead(&mut self, drone: usize) {
        let id = DroneId(drone as u32);
        if !self.world.is_alive(id) {
            return;
        }
        let end = self.control.end(drone);
        if let (None, Some(host)) = (end, self.hosts.get(drone).and_then(Option::as_ref)) {
            let detail = format!("its host {host} is gone");
            return self.world.mark_dead(id, FaultKind::HostDown, false, &detail);
        }
        let (code, signal) = (end.and_then(|end| end.code()), end.and_then(|end| end.signal()));
        let detail = match (code, signal) {
            (Some(code), _) => format!("its process exited with code {code}"),
            (None, Some(signal)) if signal != SIGKILL => format!("its process was ended by signal {signal}"),
            _ => "its process ended unasked".to_owned(),
        };
        // SIGKILL comes from outside: it is no failure of the pilot.
        if end.is_some() && signal != Some(SIGKILL) {
            self.world.note_failure(id, &detail);
        }
        self.world.mark_dead(id, FaultKind::Kill, false, &detail);
    }

    fn take_frames(&mut self) -> Result<(), RuntimeError> {
        let late = self.outcomes.contains(&TickOutcome::Late);
        let world = &mut self.world;
        self.uplinks.take((late, self.wall_clock), |header, frames| {
            let source = DroneId(header.source);
            let current = world.incarnation(source) == Some(header.incarnation);
            if current {
                world.take_frames(source, frames);
            }
            current
        })
    }

    /// Sends the record of the tick that ended. By the wall clock, a full recorder drops it. The next record that is
    /// delivered counts it and carries its events.
    fn send_tick_record(&mut self) -> Result<(), RuntimeError> {
        self.send_watch()?;
        self.unsent_events.extend_from_slice(self.world.record().events);
        if self.send_record()? || (!self.wall_clock && self.insist()?) {
            self.lost_records = 0;
            self.unsent_events.clear();
        } else {
            self.lost_records += 1;
        }
        Ok(())
    }

    /// Offers the record until the launcher takes it. Returns false if the launcher asked to stop meanwhile. A launcher that
    /// is stopped is waited for.
    fn insist(&self) -> Result<bool, RuntimeError> {
        let (since, mut wait) = (Instant::now(), RecordWait::new(self.record_limits));
        while !self.send_record()? {
            if self.control.stop_requested().is_some() {
                return Ok(false);
            }
            clean_dead_nodes(&self.domain)?;
            let waited = since.elapsed() + self.record_limits.patience;
            match wait.after(waited, || self.args.launcher_is_stopped()) {
                NextOffer::Offer => {}
                NextOffer::Warn => {
                    tracing::warn!("the launcher has taken no record for {waited:.0?}: the swarm waits");
                }
                NextOffer::GiveUp => return Err(RuntimeError::RecordNotTaken { waited }),
            }
            std::thread::sleep(DISMISSAL_POLL);
        }
        Ok(true)
    }

    /// Sends the record to observers. They have a service of their own, so that observers do not change whether the
    /// recorder gets a record.
    fn send_watch(&self) -> Result<(), RuntimeError> {
        if self.watch.watched() {
            let record = self.world.record();
            self.watch.send(record.head.tick, record.byte_len(), |bytes| record.write_to(bytes))?;
        }
        Ok(())
    }

    /// Sends the record with the events of dropped ones. Returns whether it was delivered.
    fn send_record(&self) -> Result<bool, RuntimeError> {
        let record = self.world.record();
        let head =
            RecordHeader { events_len: self.unsent_events.len() as u32, lost: self.lost_records, ..*record.head };
        let record = RecordView { head: &head, events: &self.unsent_events, ..record };
        // The count of the full-buffer handler does not tell: a sample that it gave up may still be delivered.
        let receivers = self.record.send(head.tick, record.byte_len(), |bytes| record.write_to(bytes))?;
        Ok(receivers > 0)
    }

    /// Sends the last record until it is delivered. A launcher that does not want it ends this process.
    fn send_last_record(&mut self) -> Result<(), RuntimeError> {
        self.send_watch()?;
        self.unsent_events.extend_from_slice(self.world.record().events);
        let since = Instant::now();
        while !self.send_record()? {
            let waited = since.elapsed();
            if waited > self.record_limits.limit && !self.args.launcher_is_stopped() {
                return Err(RuntimeError::RecordNotTaken { waited });
            }
            std::thread::sleep(DISMISSAL_POLL);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_run::TestRun;
    use skein_bus::{ControlSpec, PinMode, WaitMode};

    /// The limits, each much shorter.
    const SHORT: RecordLimits = RecordLimits {
        patience: Duration::from_millis(5),
        warning: Duration::from_millis(20),
        limit: Duration::from_millis(100),
    };

    /// A world in lockstep without drones that answer.
    fn server(run: &TestRun) -> WorldServer {
        let spec = ControlSpec { drones: run.drones(), cores: 1, per_process: 1, wait: WaitMode::Block };
        let control = Arc::new(Control::create(spec).unwrap());
        let (path, parent) = (run.domain().path().to_owned(), std::process::id());
        let args = ChildArgs { domain: path.clone(), control: -1, parent, pin: PinMode::Off };
        let pace = Pace { clock: Clock::Lockstep, patience: Duration::from_secs(5), record: SHORT };
        let services = Services::open(run.domain(), run.drones(), "world").unwrap();
        WorldServer::new(run.scenario(), pace, &services, control, Domain::join(&path).unwrap(), args).unwrap()
    }

    #[test]
    fn a_recorder_that_never_reads_ends_the_run_after_the_limit() {
        let run = TestRun::new("[formation]\ndrones = 2\n");
        let _unread = run.services().record_subscriber().unwrap();
        let mut server = server(&run);
        // Fill its buffer.
        let began = loop {
            let began = Instant::now();
            if let Err(error) = server.send_tick_record() {
                assert!(matches!(error, RuntimeError::RecordNotTaken { waited } if waited > SHORT.limit), "{error}");
                break began;
            }
            assert!(began.elapsed() < SHORT.limit, "a record that was not taken counts as taken");
        };
        assert!(began.elapsed() + SHORT.patience >= SHORT.limit);
    }

    #[test]
    fn a_recorder_that_reads_again_gets_every_record() {
        let run = TestRun::new("[formation]\ndrones = 2\n");
        let reader = run.services().record_subscriber().unwrap();
        let mut server = server(&run);
        let mut sent = 0;
        while server.send_record().unwrap() {
            sent += 1;
        }
        assert!(reader.receive().unwrap().is_some());
        server.send_tick_record().unwrap();
        let mut left = 0;
        while reader.receive().unwrap().is_some() {
            left += 1;
        }
        assert_eq!((left, server.lost_records), (sent, 0));
    }

    #[test]
    fn a_launcher_that_asks_to_stop_is_not_waited_for() {
        let run = TestRun::new("[formation]\ndrones = 2\n");
        let _unread = run.services().record_subscriber().unwrap();
        let mut server = server(&run);
        server.control.request_stop(15);
        while server.send_record().unwrap() {}
        server.send_tick_record().unwrap();
        assert_eq!(server.lost_records, 1);
    }
}
