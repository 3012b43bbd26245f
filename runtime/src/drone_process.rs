//! A drone's process: it waits for a tick, hears, steps its pilot, speaks, answers.

use crate::cockpit::Cockpit;
use crate::{RuntimeError, mission};
use skein_bus::{
    BusError, Control, Domain, DownlinkSubscriber, DroneEnd, PinMode, Services, TickSignal, UplinkHeader,
    UplinkPublisher, pin_to_core, raise_file_limit,
};
use skein_protocol::downlink::DownlinkView;
use skein_protocol::slot::Slot;
use skein_protocol::{DroneId, SimTime, Tick};
use skein_scenario::Scenario;
use std::os::fd::RawFd;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

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

/// Runs drone `id` of a swarm until its mission ends, with the paper's pilot.
///
/// # Errors
/// [`RuntimeError`]; the launcher sees the process end.
pub fn run(args: &ChildArgs, id: DroneId, incarnation: u32, first_tick: Tick) -> Result<(), RuntimeError> {
    fly(args, id, incarnation, |scenario| {
        let start = SimTime(first_tick as i64 * mission::dt_ns(scenario));
        mission::cockpit(scenario, id, incarnation, start)
    })
}

/// Runs drone `id` with a pilot of one's own.
///
/// # Errors
/// [`RuntimeError`].
pub fn fly(
    args: &ChildArgs,
    id: DroneId,
    incarnation: u32,
    make: impl FnOnce(&Scenario) -> Cockpit,
) -> Result<(), RuntimeError> {
    args.bind_to_parent()?;
    raise_file_limit()?;
    let scenario = args.scenario()?;
    let control = Arc::new(Control::attach(args.control)?);
    pin_to_core(control.core_of(id.index()), args.pin)?;
    let domain = Domain::join(&args.domain)?;
    let services = Services::open(&domain, mission::drones(&scenario), &format!("drone-{id}"))?;
    let mut drone = Drone {
        id,
        incarnation,
        cockpit: make(&scenario),
        hears: services.downlink_subscriber()?,
        speaks: services.uplink_publisher(id.index())?,
        barrier: DroneEnd::new(control, id.index())?,
        slot: Slot::default(),
    };
    drone.barrier.announce(incarnation);
    loop {
        match drone.barrier.wait_tick(|| true) {
            TickSignal::Tick(tick) => drone.answer(tick)?,
            TickSignal::Stop | TickSignal::Orphaned => return Ok(()),
        }
    }
}

struct Drone {
    id: DroneId,
    incarnation: u32,
    cockpit: Cockpit,
    hears: DownlinkSubscriber,
    speaks: UplinkPublisher,
    barrier: DroneEnd,
    slot: Slot,
}

impl Drone {
    /// Reads the downlinks up to the newest, and answers that one.
    fn answer(&mut self, tick: Tick) -> Result<(), RuntimeError> {
        let started = Instant::now();
        while let Some(sample) = self.hears.receive()? {
            if sample.tick() < self.barrier.resume_from() {
                // Sent while this process was stopped: nobody heard it.
                continue;
            }
            let down = DownlinkView::parse(sample.bytes())
                .map_err(|error| RuntimeError::Process(format!("drone {}: {error}", self.id)))?;
            self.cockpit.receive(&down, self.barrier.stats_mut());
            if sample.tick() < tick {
                continue;
            }
            let frames = self.cockpit.step(&down, &mut self.slot, self.barrier.stats_mut());
            if !frames.is_empty() {
                let header = UplinkHeader { tick, source: self.id.0, incarnation: self.incarnation };
                match self.speaks.send(header, frames.len(), |out| out.copy_from_slice(frames)) {
                    // By the wall clock only: the world is far behind, what is said is lost.
                    Err(BusError::Full { .. }) => {}
                    sent => sent?,
                }
            }
            self.slot.step_ns = u32::try_from(started.elapsed().as_nanos()).unwrap_or(u32::MAX);
            self.barrier.finish(tick, &self.slot);
            break;
        }
        Ok(())
    }
}
