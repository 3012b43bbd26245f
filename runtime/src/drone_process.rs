//! A drone's process, or that of several: it waits for a tick, hears, steps its pilots, speaks, answers.

use crate::pilot_host::{PilotHost, StepScratch};
use crate::{PilotKind, RuntimeError, mission};
use skein_bus::{
    BusError, Control, Domain, DownlinkSubscriber, DroneEndpoint, PinMode, SHARD_DRONES, Services, TickSignal,
    UplinkHeader, UplinkPublisher, pin_to_core, raise_file_limit,
};
use skein_protocol::downlink::DownlinkView;
use skein_protocol::frame::Frame;
use skein_protocol::slot::Slot;
use skein_protocol::{DroneId, Message, SimTime, Tick};
use skein_scenario::Scenario;
use std::os::fd::RawFd;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// What the launcher tells a child process in its arguments.
#[derive(Clone, Debug)]
pub struct ChildArgs {
    /// Folder of the run's domain.
    pub domain: PathBuf,
    /// Number of the control segment's descriptor.
    pub control: RawFd,
    /// Process id of the launcher.
    pub parent: u32,
    /// Whether to keep to one core.
    pub pin: PinMode,
}

impl ChildArgs {
    /// Ties this process to its launcher: it dies with it.
    ///
    /// # Errors
    /// [`RuntimeError::Process`] if the launcher is gone already.
    pub fn bind_to_parent(&self) -> Result<(), RuntimeError> {
        use rustix::process::{Signal, getppid, set_parent_process_death_signal};
        set_parent_process_death_signal(Some(Signal::KILL))
            .map_err(|error| RuntimeError::system("asking to die with the launcher")(error.into()))?;
        // The launcher may have died before that call.
        if getppid().map(|pid| pid.as_raw_nonzero().get().unsigned_abs()) != Some(self.parent) {
            return Err(RuntimeError::Process(format!("the launcher, process {}, is gone", self.parent)));
        }
        Ok(())
    }

    /// The scenario as the launcher resolved it.
    ///
    /// # Errors
    /// [`RuntimeError::System`], [`RuntimeError::Process`] if the file is no scenario.
    pub fn scenario(&self) -> Result<Scenario, RuntimeError> {
        let path = scenario_path(&self.domain);
        let text = std::fs::read(&path).map_err(RuntimeError::system(format!("reading {}", path.display())))?;
        serde_json::from_slice(&text)
            .map_err(|error| RuntimeError::Process(format!("{} is no scenario: {error}", path.display())))
    }
}

/// Where the launcher puts the resolved scenario for its children.
#[must_use]
pub fn scenario_path(domain: &Path) -> PathBuf {
    domain.join("scenario.json")
}

/// The drones of one process.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DroneRange {
    /// The first of them.
    pub first: DroneId,
    /// How many, by id.
    pub count: u32,
    /// Which start of this process it is, from 1.
    pub incarnation: u32,
    /// The first tick it answers.
    pub first_tick: Tick,
}

impl DroneRange {
    /// Their ids.
    pub fn ids(&self) -> impl Iterator<Item = DroneId> + use<> {
        (self.first.0..self.first.0 + self.count).map(DroneId)
    }
}

/// Runs drones of a swarm until their mission ends, with pilots of this kind.
///
/// # Errors
/// [`RuntimeError`]; the launcher sees the process end.
pub fn run(args: &ChildArgs, range: DroneRange, pilot: PilotKind) -> Result<(), RuntimeError> {
    fly(args, range, |scenario, id| {
        let start = SimTime(range.first_tick as i64 * mission::dt_ns(scenario));
        mission::DroneFactory::new(scenario, pilot).pilot_host(id, range.incarnation, start)
    })
}

/// Runs drones with a pilot of one's own.
///
/// # Errors
/// [`RuntimeError`].
pub fn fly(
    args: &ChildArgs,
    range: DroneRange,
    mut make: impl FnMut(&Scenario, DroneId) -> PilotHost,
) -> Result<(), RuntimeError> {
    args.bind_to_parent()?;
    raise_file_limit()?;
    let scenario = args.scenario()?;
    let control = Arc::new(Control::attach(args.control)?);
    pin_to_core(control.core_of(range.first.index()), args.pin)?;
    let domain = Domain::join(&args.domain)?;
    let services = Services::open(&domain, mission::drones(&scenario), &format!("drone-{}", range.first))?;
    let seat = |id: DroneId| -> Result<DroneHandle, RuntimeError> {
        let barrier = DroneEndpoint::new(Arc::clone(&control), id.index())?.bound();
        Ok(DroneHandle { id, pilot_host: make(&scenario, id), barrier, slot: Slot::default() })
    };
    let handles: Vec<DroneHandle> = range.ids().map(seat).collect::<Result<_, _>>()?;
    let shard = |id: DroneId| id.index() / SHARD_DRONES;
    let shards = shard(range.first)..=handles.last().map_or(0, |seat| shard(seat.id));
    let mut process = DroneProcess {
        first_shard: *shards.start(),
        speaks: shards.map(|shard| services.uplink_publisher(shard * SHARD_DRONES)).collect::<Result<_, _>>()?,
        hears: services.downlink_subscriber()?,
        incarnation: range.incarnation,
        handles,
        desk: StepScratch::default(),
    };
    process.handles.iter().for_each(|seat| seat.barrier.announce(range.incarnation));
    process.fly()
}

/// One drone of the process.
struct DroneHandle {
    id: DroneId,
    pilot_host: PilotHost,
    barrier: DroneEndpoint,
    slot: Slot,
}

/// The drones of this process, and the ports that they share.
struct DroneProcess {
    incarnation: u32,
    hears: DownlinkSubscriber,
    /// One a shard, from the first one's on.
    speaks: Vec<UplinkPublisher>,
    first_shard: usize,
    handles: Vec<DroneHandle>,
    desk: StepScratch,
}

impl DroneProcess {
    fn fly(&mut self) -> Result<(), RuntimeError> {
        loop {
            let Some((first, others)) = self.handles.split_first_mut() else { return Ok(()) };
            let TickSignal::Tick(tick) = first.barrier.wait_tick(|| true) else { return Ok(()) };
            others.iter_mut().for_each(|seat| _ = seat.barrier.join_tick(tick));
            self.answer(tick)?;
        }
    }

    /// Reads the downlinks up to the newest, and answers that one.
    fn answer(&mut self, tick: Tick) -> Result<(), RuntimeError> {
        let desk = &mut self.desk;
        let resume_from = self.handles.first().map_or(0, |seat| seat.barrier.resume_from());
        while let Some(sample) = self.hears.receive()? {
            if sample.tick() < resume_from {
                // Sent while this process was stopped: nobody heard it.
                continue;
            }
            let down = DownlinkView::parse(sample.bytes())
                .map_err(|error| RuntimeError::Process(format!("drone process: {error}")))?;
            if sample.tick() < tick {
                self.handles
                    .iter_mut()
                    .for_each(|seat| seat.pilot_host.overhear(&down, desk, seat.barrier.stats_mut()));
                continue;
            }
            for seat in &mut self.handles {
                let header = UplinkHeader { tick, source: seat.id.0, incarnation: self.incarnation };
                seat.step(&down, desk, header, &self.speaks[seat.id.index() / SHARD_DRONES - self.first_shard])?;
            }
            // The world waits for them in turn: when the first has answered, all have.
            self.handles.iter_mut().rev().for_each(|seat| _ = seat.barrier.finish(tick, &seat.slot));
            break;
        }
        Ok(())
    }
}

impl DroneHandle {
    fn step(
        &mut self,
        down: &DownlinkView<'_>,
        desk: &mut StepScratch,
        header: UplinkHeader,
        speaks: &UplinkPublisher,
    ) -> Result<(), RuntimeError> {
        let watch = self.barrier.stopwatch();
        let lap = watch.start();
        let said = self.pilot_host.step(down, desk, &mut self.slot, self.barrier.stats_mut());
        if !said.is_empty() {
            let encode = |(frame, message): (&mut Frame, &Message)| *frame = message.encode();
            match speaks.send(header, said.len(), |out| out.iter_mut().zip(said).for_each(encode)) {
                // By the wall clock only: the world is far behind, what is said is lost.
                Err(BusError::Full { .. }) => {}
                sent => sent?,
            }
        }
        self.slot.step_ns = watch.ns(lap);
        Ok(())
    }
}
