//! A swarm in one thread whose commands come from outside, tick by tick: the base of environments for learning.

use crate::error::RuntimeError;
use crate::mission;
use crate::pilot_host::{HostParams, PilotHost, StepScratch};
use skein_agent::command_delay::CommandDelay;
use skein_pilot::{Command, Inbox, Out, Pilot, Senses};
use skein_protocol::downlink::Downlink;
use skein_protocol::frame::Frame;
use skein_protocol::radio::Radio;
use skein_protocol::slot::{LinkStats, Slot};
use skein_protocol::{DroneId, MessageRef, UserMessage};
use skein_scenario::Scenario;
use skein_world::World;
use skein_world::faults::ProcessCommand;
use std::sync::{Arc, Mutex, PoisonError};

/// The world and all drones of a mission. The pilots are the caller's: it reads what the drones sense and hear, steers them, and
/// advances the world by a tick. Radio and faults are those of the scenario: a drone that is killed or frozen ignores what it is
/// told, a slow one does it later, and what drones say comes as late, as seldom and as far as the radio lets it.
///
/// ```
/// use skein_pilot::Command;
/// use skein_protocol::DroneId;
/// use skein_runtime::SteeredSwarm;
/// use skein_scenario::{Scenario, ScenarioSource};
///
/// let text = "formation = { shape = \"line\", drones = 2, spacing_m = 60 }";
/// let scenario = Scenario::parse(text, ScenarioSource { name: "two.toml", stem: "two" }, &[])?;
/// let mut swarm = SteeredSwarm::new(&scenario, false)?;
/// let before = swarm.senses().drones[0].velocity_mps[0];
/// swarm.steer(DroneId(0), &Command::acceleration([1.0, 0.0, 0.0]));
/// swarm.advance();
/// assert!(swarm.senses().drones[0].velocity_mps[0] > before);
/// assert!(swarm.world().ended().is_none());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct SteeredSwarm {
    /// The world before its first tick.
    start: World,
    world: World,
    /// The receivers' radio; `None` if nobody listens.
    radio: Option<Arc<Radio>>,
    dt_s: f64,
    velocity_gain_per_s: f64,
    drones: Vec<SteeredDrone>,
    scratch: StepScratch,
    stats: LinkStats,
}

impl SteeredSwarm {
    /// A swarm at the start of its mission. `listens`: whether the drones hear each other; without that a tick is faster.
    ///
    /// # Errors
    /// [`RuntimeError::Scenario`] and [`RuntimeError::Shape`] if no world can be made of the scenario.
    pub fn new(scenario: &Scenario, listens: bool) -> Result<Self, RuntimeError> {
        let start = mission::world(scenario)?;
        let mut swarm = Self {
            world: start.clone(),
            start,
            radio: listens.then(|| Arc::new(scenario.radio())),
            dt_s: scenario.time.dt_s,
            velocity_gain_per_s: scenario.guidance.velocity_gain_per_s,
            drones: std::iter::repeat_with(SteeredDrone::default).take(mission::drones(scenario)).collect(),
            scratch: StepScratch::default(),
            stats: LinkStats::default(),
        };
        swarm.reset();
        Ok(swarm)
    }

    /// Goes back to the start of the mission.
    pub fn reset(&mut self) {
        self.world.clone_from(&self.start);
        self.stats = LinkStats::default();
        for id in 0..self.drones.len() {
            self.drones[id] = self.new_drone(DroneId(id as u32));
        }
        self.open();
    }

    /// The world: time, outcome, and the record of the last tick.
    #[must_use]
    pub fn world(&self) -> &World {
        &self.world
    }

    /// What all drones sense at the beginning of the current tick.
    #[must_use]
    pub fn senses(&self) -> &Downlink {
        self.world.sensed()
    }

    /// Appends what a drone heard since the tick before, in the order of arrival.
    pub fn heard(&self, drone: DroneId, messages: &mut Vec<(DroneId, UserMessage)>) {
        if let Some(drone) = self.drones.get(drone.index()) {
            messages.extend_from_slice(&drone.heard.lock().unwrap_or_else(PoisonError::into_inner));
        }
    }

    /// Commands a drone in the current tick. A drone without a command does not accelerate.
    pub fn steer(&mut self, drone: DroneId, command: &Command) {
        let Some(sensed) = self.world.sensed().drones.get(drone.index()) else { return };
        let acceleration_mps2 = command.acceleration_mps2(sensed.velocity_mps, self.velocity_gain_per_s);
        let slot = &mut self.drones[drone.index()].slot;
        command.status().fill(slot);
        slot.acceleration_mps2 = acceleration_mps2;
    }

    /// Broadcasts a message of a drone in the current tick.
    pub fn say(&mut self, drone: DroneId, message: UserMessage) {
        if let Some(drone) = self.drones.get_mut(drone.index()) {
            drone.frames.push(skein_protocol::Message::User(message).encode());
        }
    }

    /// Flies the current tick and opens the next one, unless the mission has ended.
    pub fn advance(&mut self) {
        if self.world.ended().is_some() {
            return;
        }
        let sensed = &self.world.sensed().drones;
        for (drone, sensed) in self.drones.iter_mut().zip(sensed).filter(|(drone, _)| drone.flies()) {
            drone.react_after((sensed.extra_reaction_s / self.dt_s).round() as usize);
        }
        for (drone, id) in self.drones.iter_mut().zip(0..).filter(|(drone, _)| drone.flies()) {
            drone.frames_total += drone.frames.len() as u64;
            drone.slot.frames_total = drone.frames_total;
            self.world.take_slot(DroneId(id), &drone.slot);
            self.world.take_frames(DroneId(id), &drone.frames);
        }
        self.world.advance();
        if self.world.ended().is_none() {
            self.open();
        }
    }

    /// Opens a tick: what faults do to processes happens, then all drones sense and hear.
    fn open(&mut self) {
        for &command in self.world.process_commands().to_vec().iter() {
            self.carry_out(command);
        }
        let down = self.world.downlink().view();
        for drone in &mut self.drones {
            drone.frames.clear();
            drone.slot = Slot::default();
            if drone.flies()
                && let Some(ears) = &mut drone.ears
            {
                ears.step(&down, &mut self.scratch, &mut drone.slot, &mut self.stats);
            }
        }
    }

    fn carry_out(&mut self, command: ProcessCommand) {
        match command {
            ProcessCommand::Kill(id) => self.drones[id.index()].killed = true,
            ProcessCommand::Freeze(id) => self.drones[id.index()].frozen = true,
            ProcessCommand::Resume(id) => self.drones[id.index()].frozen = false,
            ProcessCommand::Restart(id, _) => self.drones[id.index()] = self.new_drone(id),
        }
    }

    fn new_drone(&self, me: DroneId) -> SteeredDrone {
        let heard = Heard::default();
        let params = HostParams { me, dt_s: self.dt_s, velocity_gain_per_s: self.velocity_gain_per_s };
        let ears = |radio| PilotHost::new(params, radio, Box::new(Ears(Arc::clone(&heard))));
        let ears = self.radio.as_ref().map(Arc::clone).map(ears);
        SteeredDrone { ears, heard, ..SteeredDrone::default() }
    }
}

/// What a drone heard in a tick.
type Heard = Arc<Mutex<Vec<(DroneId, UserMessage)>>>;

/// One drone and its answer to the current tick.
#[derive(Default)]
struct SteeredDrone {
    ears: Option<PilotHost>,
    heard: Heard,
    killed: bool,
    frozen: bool,
    slot: Slot,
    frames: Vec<Frame>,
    frames_total: u64,
    /// Commands that a fault holds back, m/s².
    held_mps2: CommandDelay<[f64; 3]>,
}

impl SteeredDrone {
    /// Holds the command of this tick back for so many ticks, as the paper's pilot does.
    fn react_after(&mut self, ticks: usize) {
        self.held_mps2.set_ticks(ticks);
        self.slot.acceleration_mps2 = self.held_mps2.push(self.slot.acceleration_mps2);
    }

    fn flies(&self) -> bool {
        !self.killed && !self.frozen
    }
}

/// A pilot that only listens.
struct Ears(Heard);

impl Pilot for Ears {
    fn step(&mut self, _: &Senses<'_>, inbox: &Inbox<'_>, _: &mut Out) -> Command {
        let mut heard = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        heard.clear();
        heard.extend(inbox.heard().iter().filter_map(|heard| match heard.message {
            MessageRef::User(message) => Some((heard.source, *message)),
            _ => None,
        }));
        Command::default()
    }
}
