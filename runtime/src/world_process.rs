//! The world's process: it opens a tick, waits for the drones, moves the truth on, tells the recorder.

use crate::drone_process::ChildArgs;
use crate::{Clock, RuntimeError, clock::Pacer, mission};
use skein_bus::{
    Control, Domain, DownlinkPublisher, Patience, ProcessRequest, RecordPolicy, RecordPublisher, RequestKind,
    SHARD_DRONES, Services, TickOutcome, UplinkSubscriber, WatchPublisher, WorldState, pin_to_core, raise_file_limit,
    shards,
};
use skein_protocol::DroneId;
use skein_protocol::record::{FaultKind, RecordHeader, RecordView};
use skein_protocol::slot::LinkStats;
use skein_world::World;
use skein_world::faults::ProcessCommand;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// A drone that does not answer for so long in lockstep is hung.
const HUNG: Duration = Duration::from_secs(5);
/// Stop request of a launcher that has read the whole record.
pub(crate) const DISMISSED: u32 = u32::MAX;
const DISMISSAL_LOOK: Duration = Duration::from_millis(1);
/// The supervisor kills, stops and continues within this.
const ORDER_LIMIT: Duration = Duration::from_secs(5);
/// It starts a process within this.
const RESTART_LIMIT: Duration = Duration::from_secs(30);

/// Runs the world of a swarm until its mission ends.
///
/// # Errors
/// [`RuntimeError`]; the launcher sees the process end.
pub fn run(args: &ChildArgs, clock: Clock) -> Result<(), RuntimeError> {
    args.bind_to_parent()?;
    raise_file_limit()?;
    let scenario = args.scenario()?;
    let control = Arc::new(Control::attach(args.control)?);
    // The barrier expects the world on core 0.
    pin_to_core(0, args.pin)?;
    let drones = mission::drones(&scenario);
    let domain = Domain::join(&args.domain)?;
    let services = Services::open(&domain, drones, "world")?;
    let policy = match clock {
        // The launcher records, and this process dies with it.
        Clock::Lockstep => RecordPolicy::Wait(Box::new(|| true)),
        Clock::Realtime { .. } => RecordPolicy::Drop,
    };
    let mut server = WorldServer {
        down: services.downlink_publisher()?,
        up: (0..shards(drones)).map(|shard| services.uplink_subscriber(shard)).collect::<Result<_, _>>()?,
        record: services.record_publisher(policy)?,
        watch: services.watch_publisher()?,
        control,
        world: mission::world(&scenario)?,
        answers: vec![TickOutcome::Pending; drones],
        taken: vec![0; drones],
        due: vec![0; drones],
        lost: 0,
        untold: Vec::new(),
        wall_clock: clock != Clock::Lockstep,
    };
    server.control.set_world_state(WorldState::Ready);
    if server.control.wait_go(|| true) {
        server.control.set_world_state(WorldState::Flying);
        server.connect()?;
        server.fly(clock, scenario.time.dt_s)?;
    }
    server.control.set_world_state(WorldState::Finished);
    // A publisher takes its last samples with it: wait until the launcher has read them. This process dies with it.
    while server.control.stop_requested() != Some(DISMISSED) {
        std::thread::sleep(DISMISSAL_LOOK);
    }
    Ok(())
}

/// The world and its ports.
struct WorldServer {
    down: DownlinkPublisher,
    up: Vec<UplinkSubscriber>,
    record: RecordPublisher,
    watch: WatchPublisher,
    control: Arc<Control>,
    world: World,
    answers: Vec<TickOutcome>,
    /// Frames taken from each drone so far, and frames it has announced.
    taken: Vec<u64>,
    due: Vec<u64>,
    /// Records dropped since the last one that got through, and their events.
    lost: u32,
    untold: Vec<u8>,
    /// Then a drone may have found its buffer full, and announced frames that never come.
    wall_clock: bool,
}

impl WorldServer {
    /// Joins all ports now rather than in the midst of the first tick.
    fn connect(&self) -> Result<(), RuntimeError> {
        self.down.connect()?;
        self.up.iter().try_for_each(UplinkSubscriber::connect)?;
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
            self.world.note_lateness(pacer.lateness().spread());
        }
        let mut stats = LinkStats::default();
        (0..self.answers.len()).for_each(|drone| stats.merge(&self.control.stats(drone)));
        self.world.finish(&stats, wall_s);
        self.tell_last()?;
        self.control.close();
        Ok(())
    }

    fn tick(&mut self, mut pacer: Option<&mut Pacer>) -> Result<(), RuntimeError> {
        let tick = self.world.tick();
        for order in self.world.process_commands().to_vec() {
            let begun = Instant::now();
            self.carry_out(order)?;
            if let Some(pacer) = &mut pacer {
                // What a start takes must not make everybody else late.
                pacer.stand_still(begun.elapsed());
            }
        }
        let down = self.world.downlink();
        self.down.send(tick, down.byte_len(), |bytes| down.write_to(bytes))?;
        self.control.open_tick(tick)?;
        let patience = pacer.map_or(Patience::For(HUNG), |pacer| Patience::Until(pacer.open()));
        self.control.wait_done(tick, patience, &mut self.answers)?;
        self.take_answers()?;
        self.take_frames()?;
        self.world.advance();
        self.tell()
    }

    /// Has the supervisor do what the tick's faults do to processes, and waits until it is done.
    fn carry_out(&mut self, order: ProcessCommand) -> Result<(), RuntimeError> {
        let (kind, id) = match order {
            ProcessCommand::Kill(id) => (RequestKind::Kill, id),
            ProcessCommand::Freeze(id) => (RequestKind::Freeze, id),
            ProcessCommand::Resume(id) => (RequestKind::Resume, id),
            ProcessCommand::Restart(id, _) => (RequestKind::Restart, id),
        };
        let limit = if kind == RequestKind::Restart { RESTART_LIMIT } else { ORDER_LIMIT };
        let reply = self.control.request(ProcessRequest { kind, drone: id, tick: self.world.tick() }, limit)?;
        let drone = id.index();
        match order {
            // Whoever is gone already is as dead as can be.
            ProcessCommand::Kill(_) => self.answers[drone] = TickOutcome::Dead,
            ProcessCommand::Freeze(_) => self.answers[drone] = TickOutcome::Absent,
            // Gone meanwhile: it is found dead in this tick.
            ProcessCommand::Resume(_) => self.answers[drone] = TickOutcome::Pending,
            ProcessCommand::Restart(_, incarnation) => {
                if reply != incarnation {
                    let what =
                        format!("drone {id} was not started again: expected incarnation {incarnation}, got {reply}");
                    return Err(RuntimeError::Process(what));
                }
                self.answers[drone] = TickOutcome::Pending;
                (self.taken[drone], self.due[drone]) = (0, 0);
                self.connect()?;
            }
        }
        Ok(())
    }

    /// Slots of those that answered; those that are gone; those that are late.
    fn take_answers(&mut self) -> Result<(), RuntimeError> {
        for drone in 0..self.answers.len() {
            let id = DroneId(drone as u32);
            match self.answers[drone] {
                TickOutcome::Done => {
                    let slot = self.control.slot(drone);
                    self.due[drone] = slot.frames_total;
                    self.world.take_slot(id, &slot);
                }
                TickOutcome::Late => self.world.hold(id),
                TickOutcome::Dead => self.mark_dead(drone),
                TickOutcome::Hung => {
                    let order = ProcessRequest { kind: RequestKind::Kill, drone: id, tick: self.world.tick() };
                    self.control.request(order, ORDER_LIMIT)?;
                    self.world.mark_dead(id, FaultKind::Hung, false, "it did not answer for 5 s and was killed");
                }
                // Stopped, and killed by somebody else meanwhile.
                TickOutcome::Absent if self.control.is_dead(drone) => self.mark_dead(drone),
                TickOutcome::Pending | TickOutcome::Absent => {}
            }
        }
        Ok(())
    }

    fn mark_dead(&mut self, drone: usize) {
        self.world.mark_dead(DroneId(drone as u32), FaultKind::Kill, false, "its process ended unasked");
    }

    /// Drains each shard of just what its drones have announced: every further call would look through all of them. Of
    /// a late drone, whatever is there: its buffer must not fill up.
    fn take_frames(&mut self) -> Result<(), RuntimeError> {
        let late = self.answers.contains(&TickOutcome::Late);
        for (shard, port) in self.up.iter().enumerate() {
            let first = shard * SHARD_DRONES;
            let drones = first..(first + SHARD_DRONES).min(self.due.len());
            let mut missing = drones.clone().any(|drone| self.taken[drone] < self.due[drone]);
            while missing || late {
                let Some(sample) = port.receive()? else {
                    if self.wall_clock {
                        break;
                    }
                    return Err(RuntimeError::Process(format!("frames announced on uplink {shard} did not arrive")));
                };
                let source = DroneId(sample.header().source);
                let current = self.world.incarnation(source) == Some(sample.header().incarnation);
                // What a process before this one said by the wall clock and nobody fetched is lost with it.
                if let Some(taken) = self.taken.get_mut(source.index()).filter(|_| current) {
                    *taken += sample.frames().len() as u64;
                    self.world.take_frames(source, sample.frames());
                }
                missing = drones.clone().any(|drone| self.taken[drone] < self.due[drone]);
            }
        }
        Ok(())
    }

    /// Sends the record of the tick that ended. One that a full recorder drops (wall clock only) is counted in the next
    /// that gets through, and its events go along with that.
    fn tell(&mut self) -> Result<(), RuntimeError> {
        self.show()?;
        self.untold.extend_from_slice(self.world.record().events);
        if self.send_record()? {
            self.lost = 0;
            self.untold.clear();
        } else {
            self.lost += 1;
        }
        Ok(())
    }

    /// Shows the tick to observers, who have a service of their own: whether the recorder has got a record must not
    /// depend on who else looks on.
    fn show(&self) -> Result<(), RuntimeError> {
        if self.watch.watched() {
            let record = self.world.record();
            self.watch.send(record.head.tick, record.byte_len(), |bytes| record.write_to(bytes))?;
        }
        Ok(())
    }

    /// Whether it was delivered.
    fn send_record(&self) -> Result<bool, RuntimeError> {
        let record = self.world.record();
        let head = RecordHeader { events_len: self.untold.len() as u32, lost: self.lost, ..*record.head };
        let record = RecordView { head: &head, events: &self.untold, ..record };
        // Not what the handler of a full buffer counted: a sample that it gave up may still be delivered.
        let receivers = self.record.send(head.tick, record.byte_len(), |bytes| record.write_to(bytes))?;
        Ok(receivers > 0)
    }

    /// Sends the last record, which must get through. The launcher ends this process if it does not want it.
    fn tell_last(&mut self) -> Result<(), RuntimeError> {
        self.show()?;
        self.untold.extend_from_slice(self.world.record().events);
        while !self.send_record()? {
            std::thread::sleep(DISMISSAL_LOOK);
        }
        Ok(())
    }
}
