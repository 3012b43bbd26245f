//! A part of a swarm that flies on this machine for a world on another one. It is launcher and tick source of its drones: they
//! are processes with services and a barrier, exactly as on the world's machine.

use crate::child_args::ChildArgs;
use crate::children::{ChildRole, Children};
use crate::clock::Clock;
use crate::drone_range::DroneRange;
use crate::error::RuntimeError;
use crate::program::Program;
use crate::programs::Programs;
use crate::relay_line::RelayRequest;
use crate::tuning::{END_LIMIT, RESTART_READY_LIMIT, START_LIMIT, START_LIMIT_PER_DRONE, SUPERVISOR_POLL, WING_POLL};
use crate::uplinks::Uplinks;
use crate::{mission, scenario_file};
use skein_bus::{
    Control, ControlSpec, Domain, DownlinkPublisher, Patience, PinMode, RequestKind, Services, TickOutcome, WaitMode,
    allowed_cores, clean_dead_nodes, outlive_file_limit, raise_file_limit,
};
use skein_protocol::frame::Frame;
use skein_protocol::slot::{LinkStats, Slot};
use skein_protocol::{DroneId, Tick};
use skein_scenario::Scenario;
use std::process::ExitStatus;
use std::time::{Duration, Instant};

/// How a part of a swarm is started.
#[derive(Debug)]
pub struct WingLaunch<'a> {
    /// What the whole swarm flies.
    pub scenario: &'a Scenario,
    /// The drones that fly here, with the incarnation of their processes and the first tick that they answer.
    pub drones: DroneRange,
    /// Whether each process stays on one core.
    pub pin: PinMode,
    /// How processes wait for each other.
    pub wait: WaitMode,
    /// Drones per process, from 1.
    pub per_process: u32,
    /// The program with the role `drone`.
    pub program: &'a Program,
}

/// A part of a swarm, in flight. Dropping it ends its processes. It stays on the thread that started it.
pub struct Wing<'l> {
    range: DroneRange,
    children: Children<'l>,
    downlink: DownlinkPublisher,
    uplinks: Uplinks,
    control: Control,
    /// How each drone of the swarm answered the tick; those that fly elsewhere are absent.
    outcomes: Vec<TickOutcome>,
    /// The frames that each drone of this wing said in the tick.
    frames: Vec<Vec<Frame>>,
    /// The incarnation of each drone's newest process.
    incarnations: Vec<u32>,
    _services: Services,
    /// Dropped last: it removes the files of all the others.
    domain: Domain,
}

impl<'l> Wing<'l> {
    /// Starts the processes and waits until they are ready. `given_up` is asked about once per millisecond.
    ///
    /// # Errors
    /// [`RuntimeError`] if the drones could not be started.
    pub fn start(launch: &WingLaunch<'l>, mut given_up: impl FnMut() -> bool) -> Result<Self, RuntimeError> {
        outlive_file_limit();
        raise_file_limit()?;
        let (drones, per_process) = (mission::drones(launch.scenario), launch.per_process.max(1));
        let domain = Domain::create(&launch.scenario.name)?;
        let cores = match launch.pin {
            PinMode::Auto => allowed_cores()?.min(launch.drones.count.div_ceil(per_process) as usize + 1),
            PinMode::Off => 1,
        };
        let spec = ControlSpec { drones, cores, per_process: per_process as usize, wait: launch.wait };
        let control = Control::create(spec)?;
        let services = Services::create(&domain, drones, per_process as usize, "wing")?;
        scenario_file::write(domain.path(), launch.scenario)?;
        let args = ChildArgs::of_this_process(&domain, &control, launch.pin);
        let programs = Programs::new(launch.scenario, launch.program);
        let mut outcomes = vec![TickOutcome::Absent; drones];
        launch.drones.ids().for_each(|id| outcomes[id.index()] = TickOutcome::Pending);
        let mut wing = Self {
            range: launch.drones,
            children: Children::new(programs, &[], args, Duration::ZERO)?,
            downlink: services.downlink_publisher()?,
            uplinks: Uplinks::new(&services, drones)?,
            control,
            outcomes,
            frames: vec![Vec::new(); launch.drones.count as usize],
            incarnations: vec![launch.drones.incarnation; drones],
            _services: services,
            domain,
        };
        let DroneRange { first, count, incarnation, first_tick } = launch.drones;
        for id in launch.drones.ids() {
            wing.control.revive(id.index(), first_tick);
        }
        let ends = (first.0, first.0 + count);
        wing.children.spawn_drones(ends, per_process, (incarnation, first_tick), Clock::Lockstep)?;
        wing.wait_ready(&mut given_up)?;
        wing.connect()?;
        wing._services.reserve()?;
        wing.control.give_go();
        Ok(wing)
    }

    fn wait_ready(&mut self, given_up: &mut dyn FnMut() -> bool) -> Result<(), RuntimeError> {
        let (begun, drones) = (Instant::now(), self.range.count as usize);
        let limit = START_LIMIT + START_LIMIT_PER_DRONE * self.range.count;
        loop {
            if let Some((role, status)) = self.children.wait_any(SUPERVISOR_POLL).into_iter().next() {
                let (process, program) = (role.to_string(), self.children.program(role).to_string());
                return Err(match self.control.refused() {
                    Some(found) => RuntimeError::OtherVersion { process, program, found },
                    None => RuntimeError::EndedEarly { process, status },
                });
            }
            let ready = self.range.ids().take_while(|id| self.control.ready(id.index()).is_some()).count();
            let waited = begun.elapsed();
            if ready == drones {
                return Ok(());
            }
            if waited > limit || given_up() {
                return Err(RuntimeError::NotReady { ready, drones, waited });
            }
        }
    }

    fn connect(&self) -> Result<(), RuntimeError> {
        self.downlink.connect()?;
        self.uplinks.connect()
    }

    /// The drones of this wing.
    #[must_use]
    pub fn range(&self) -> DroneRange {
        self.range
    }

    /// Gives the drones the downlink of a tick, without opening it.
    ///
    /// # Errors
    /// [`RuntimeError::Bus`].
    pub fn send(&mut self, tick: Tick, downlink: &[u8]) -> Result<(), RuntimeError> {
        self.downlink.send(tick, downlink.len(), |bytes| bytes.copy_from_slice(downlink))?;
        Ok(())
    }

    /// Opens a tick whose downlink was sent, and waits until every drone has answered, died, or used up `limit`. By the wall clock
    /// (`lossy`) a drone that is overdue is late, otherwise it is hung.
    ///
    /// # Errors
    /// [`RuntimeError::Bus`], [`RuntimeError::MissingFrames`].
    pub fn tick(&mut self, tick: Tick, limit: Duration, lossy: bool) -> Result<(), RuntimeError> {
        let end = Instant::now() + limit;
        self.control.open_tick(tick)?;
        loop {
            let slice = (Instant::now() + WING_POLL).min(end);
            self.control.wait_done(tick, Patience::Until(slice), &mut self.outcomes)?;
            if !self.outcomes.contains(&TickOutcome::Late) || Instant::now() >= end {
                break;
            }
            self.reap();
        }
        for id in self.range.ids() {
            match self.outcomes[id.index()] {
                TickOutcome::Done => self.uplinks.announce(id.index(), self.control.slot(id.index()).frames_total),
                TickOutcome::Late if !lossy => self.outcomes[id.index()] = TickOutcome::Hung,
                _ => {}
            }
        }
        self.take_frames(lossy)
    }

    fn take_frames(&mut self, lossy: bool) -> Result<(), RuntimeError> {
        self.frames.iter_mut().for_each(Vec::clear);
        let late = lossy && self.outcomes.contains(&TickOutcome::Late);
        let (frames, incarnations, first) = (&mut self.frames, &self.incarnations, self.range.first.0);
        self.uplinks.take((late, lossy), |header, said| {
            let current = incarnations.get(header.source as usize) == Some(&header.incarnation);
            let place = header.source.checked_sub(first).and_then(|place| frames.get_mut(place as usize));
            if let Some(place) = place.filter(|_| current) {
                place.extend_from_slice(said);
            }
            current
        })
    }

    /// How a drone answered the last tick.
    #[must_use]
    pub fn outcome(&self, drone: DroneId) -> TickOutcome {
        self.outcomes.get(drone.index()).copied().unwrap_or(TickOutcome::Absent)
    }

    /// What a drone answered, if [`Wing::outcome`] is [`TickOutcome::Done`]; its radio's counters; the frames that it said.
    #[must_use]
    pub fn answer(&self, drone: DroneId) -> (Slot, LinkStats, &[Frame]) {
        let place = drone.index() - self.range.first.index();
        (self.control.slot(drone.index()), self.control.stats(drone.index()), &self.frames[place])
    }

    /// How the last process of a dead drone ended, if it ended by itself.
    #[must_use]
    pub fn end(&self, drone: DroneId) -> Option<ExitStatus> {
        self.control.end(drone.index())
    }

    /// Notes which processes have ended.
    pub fn reap(&mut self) {
        for (role, status) in self.children.wait_any(Duration::ZERO) {
            for id in role.drones().iter().flat_map(DroneRange::ids) {
                self.control.set_end(id.index(), status);
                self.control.mark_dead(id.index());
            }
        }
    }

    /// Does to a drone's process what the world requests. Returns the new incarnation for a restart, 1 for anything else, and 0 if
    /// there is no such process.
    pub fn serve(&mut self, request: RelayRequest) -> u32 {
        let drone = DroneId(request.drone);
        let (Some(kind), true) = (request.kind(), self.range.has(drone)) else { return 0 };
        let place = drone.index();
        match kind {
            RequestKind::Kill | RequestKind::KillProcess => self.kill(drone),
            RequestKind::Freeze => {
                self.control.freeze(place);
                self.outcomes[place] = TickOutcome::Absent;
                u32::from(self.children.freeze_drone(drone))
            }
            RequestKind::Resume => {
                self.control.set_resume_from(place, request.tick);
                self.outcomes[place] = TickOutcome::Pending;
                u32::from(self.children.resume_drone(drone))
            }
            RequestKind::Restart => self.restart(request).unwrap_or_else(|error| {
                tracing::warn!(%error, "drone {drone} is dead again");
                self.kill(drone);
                self.control.mark_dead(place);
                0
            }),
        }
    }

    fn kill(&mut self, drone: DroneId) -> u32 {
        let killed = self.children.kill_drone(drone);
        for id in killed.iter().flat_map(DroneRange::ids) {
            self.control.mark_dead(id.index());
        }
        u32::from(killed.is_some())
    }

    fn restart(&mut self, request: RelayRequest) -> Result<u32, RuntimeError> {
        let (id, incarnation, first_tick) = (DroneId(request.drone), request.incarnation, request.tick);
        let place = id.index();
        // The ended process still holds its places in the services.
        clean_dead_nodes(&self.domain)?;
        self.control.revive(place, first_tick);
        self.outcomes[place] = TickOutcome::Pending;
        self.incarnations[place] = incarnation;
        self.uplinks.restart(place);
        let range = DroneRange { first: id, count: 1, incarnation, first_tick };
        self.children.spawn(ChildRole::Drones(range), Clock::Lockstep)?;
        let limit = Instant::now() + RESTART_READY_LIMIT;
        while self.control.ready(place) != Some(incarnation) {
            std::thread::sleep(WING_POLL);
            self.reap();
            if self.control.is_dead(place) || Instant::now() > limit {
                return Err(RuntimeError::NotRestarted { drone: id, incarnation });
            }
        }
        self.connect()?;
        Ok(incarnation)
    }
}

impl Drop for Wing<'_> {
    fn drop(&mut self) {
        self.control.close();
        self.children.resume_all();
        let limit = Instant::now() + END_LIMIT / 2;
        while !self.children.is_empty() && Instant::now() < limit {
            self.children.wait_any(SUPERVISOR_POLL);
        }
        self.children.kill_all();
    }
}
