//! One part of a divided world.

use super::halo::{Halo, Mover};
use super::reaches::Reaches;
use super::tick_share::{Announcement, TickShare};
use super::tiles::Tiles;
use crate::body::Body;
use crate::drones::DroneTable;
use crate::geometry::Outline;
use crate::params::{WorldError, WorldParams};
use crate::sense_writer::{SenseWriter, Sensed};
use crate::sensor_fault::SensorFault;
use crate::sensor_model::SensorModel;
use crate::sweep::{SensorSweep, SweepRange};
use crate::tick_digest::TickDigest;
use crate::uplink::Uplink;
use skein_protocol::downlink::{Downlink, SensesHeader};
use skein_protocol::frame::{AirFrame, Frame};
use skein_protocol::link_faults::LinkFaults;
use skein_protocol::radio::DropReason;
use skein_protocol::shape::ConvexShape;
use skein_protocol::slot::Slot;
use skein_protocol::telemetry::Telemetry;
use skein_protocol::{DroneId, SimTime, Tick, Vec3};
use std::sync::Arc;
use thiserror::Error;

/// Why a world is not divided.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum SplitError {
    /// Faults choose their targets among all drones.
    #[error("a world with scheduled faults is not divided: expected none")]
    Faults,
    /// All drones wait for the same channel.
    #[error("a world whose drones share a radio channel is not divided: expected no limit of bandwidth")]
    Channel,
    /// Errors of sensors are drawn for all drones in turn.
    #[error("a world whose sensors have errors is not divided: expected exact sensors and clocks")]
    Sensors,
    /// A pilot failed, which is a fault.
    #[error("the pilot of drone {0} failed: expected none to fail in a world that is divided")]
    Failed(DroneId),
    /// The parameters are invalid.
    #[error(transparent)]
    World(#[from] WorldError),
}

/// One part of a divided world.
pub struct WorldPart {
    number: usize,
    params: WorldParams,
    tiles: Arc<Tiles>,
    reaches: Arc<Reaches>,
    tick: Tick,
    /// Its drones, ascending.
    ids: Vec<u32>,
    /// The same drones, in the same order.
    drones: DroneTable,
    /// The bodies of its drones and of the halo, and their ids, ascending.
    around: Vec<(u32, Body)>,
    bodies: Vec<Body>,
    sweep: SensorSweep,
    sense_writer: SenseWriter,
    /// Exact sensors.
    sensors: SensorModel,
    uplink: Uplink,
    /// The senses of `around`.
    sensed: Downlink,
    downlink: Downlink,
    /// Number of frames of the tick before that none of its drones can hear.
    unheard: u32,
    failed: Option<DroneId>,
}

impl WorldPart {
    /// A part at the start of a mission: that of the drones in its tile. `starts` and `obstacles` are as in
    /// [`World::new`](crate::World::new); the obstacles are a map that all parts have.
    ///
    /// # Errors
    /// [`SplitError`].
    pub fn new(
        number: usize,
        (tiles, reaches): (Arc<Tiles>, Arc<Reaches>),
        params: &WorldParams,
        starts: &[(Vec3, Vec3)],
        obstacles: &[ConvexShape],
    ) -> Result<Self, SplitError> {
        params.check()?;
        if !params.faults.faults.is_empty() {
            return Err(SplitError::Faults);
        }
        if params.channel.is_some() {
            return Err(SplitError::Channel);
        }
        if !params.sensors.is_ideal() {
            return Err(SplitError::Sensors);
        }
        let outlines = obstacles.iter().map(Outline::new).collect();
        let mut part = Self {
            number,
            params: params.clone(),
            reaches,
            tick: 0,
            ids: Vec::new(),
            drones: DroneTable::new(&[]),
            around: Vec::new(),
            bodies: Vec::new(),
            sweep: SensorSweep::new(outlines),
            sense_writer: SenseWriter::new(obstacles),
            sensors: SensorModel::new(params, 0),
            uplink: Uplink::new(None),
            sensed: Downlink::default(),
            downlink: Downlink::default(),
            unheard: 0,
            failed: None,
            tiles,
        };
        part.begin(starts);
        Ok(part)
    }

    /// Takes its drones and its first halo from the starts.
    fn begin(&mut self, starts: &[(Vec3, Vec3)]) {
        self.downlink.drones.resize(starts.len(), SensesHeader::default());
        let all = DroneTable::new(starts);
        let mut halo = Vec::new();
        for (&body, id) in all.bodies().iter().zip(0..) {
            if self.tiles.owner(body.position().xy(), 0.0) == self.number {
                self.ids.push(id);
            } else if self.is_near(&body, self.number, 0.0) {
                halo.push((id, body));
            }
        }
        let own: Vec<(Vec3, Vec3)> = self.ids.iter().map(|&id| starts[id as usize]).collect();
        self.drones = DroneTable::new(&own);
        self.look_around(halo.into_iter());
    }

    /// Its drones, ascending.
    #[must_use]
    pub fn ids(&self) -> &[u32] {
        &self.ids
    }

    /// Number of bodies of other parts that it knows of.
    #[must_use]
    pub fn halo_len(&self) -> usize {
        self.around.len() - self.ids.len()
    }

    /// The senses of its drones in the current tick, and the frames of the tick before that they may hear. The senses of other drones
    /// are empty.
    pub fn downlink(&mut self) -> &Downlink {
        let own = &self.ids;
        let blind = SensorFault { no_ranging: true, ..SensorFault::default() };
        let drones = self.around.iter().map(|(id, _)| match own.binary_search(id) {
            Ok(place) => (self.drones.processes()[place].incarnation(), SensorFault::default()),
            Err(_) => (1, blind),
        });
        let sensed = Sensed {
            bodies: &self.bodies,
            sweep: &self.sweep,
            ranging_m: self.params.ranging_m,
            model: &self.sensors,
            now: self.time_of(self.tick),
        };
        self.sense_writer.write(&sensed, drones, &mut self.sensed);
        self.downlink.obstacles.clone_from(&self.sensed.obstacles);
        self.downlink.shapes.clone_from(&self.sensed.shapes);
        self.downlink.neighbours.clone_from(&self.sensed.neighbours);
        for neighbour in &mut self.downlink.neighbours {
            neighbour.drone = DroneId(self.around[neighbour.drone.index()].0);
        }
        for (header, (id, _)) in self.sensed.drones.iter().zip(&self.around) {
            if own.binary_search(id).is_ok() {
                self.downlink.drones[*id as usize] = *header;
            }
        }
        self.downlink.index.build(self.params.locality, &self.downlink.frames);
        self.downlink.seal(self.tick, self.time_of(self.tick));
        &self.downlink
    }

    /// As [`World::take_slot`](crate::World::take_slot). Its radio could not hear the frames that did not come here, which is how it would
    /// have counted them.
    pub fn take_slot(&mut self, id: DroneId, slot: &Slot) {
        let Ok(place) = self.ids.binary_search(&id.0) else { return };
        if slot.has_failed() {
            self.failed = Some(id);
        }
        let mut slot = *slot;
        slot.dropped[DropReason::Range as usize] += self.unheard;
        self.drones.take_slot(DroneId(place as u32), &slot);
    }

    /// As [`World::take_frames`](crate::World::take_frames).
    pub fn take_frames(&mut self, id: DroneId, frames: &[Frame]) {
        let Ok(place) = self.ids.binary_search(&id.0) else { return };
        for &frame in frames.iter().filter(|frame| !Telemetry::is_kind(frame.kind)) {
            let Some((sequence, position)) = self.drones.next_frame(DroneId(place as u32)) else { return };
            let (tick, position_m) = (self.tick, position.into());
            let link_faults = LinkFaults::default();
            self.uplink.push(AirFrame { tick, source: id, sequence, position_m, queue_ns: 0, link_faults, frame });
        }
    }

    /// Ends the tick for its drones.
    ///
    /// # Errors
    /// [`SplitError::Failed`] if a pilot has failed.
    pub fn advance(&mut self) -> Result<TickShare, SplitError> {
        if let Some(id) = self.failed {
            return Err(SplitError::Failed(id));
        }
        self.uplink.close(self.time_of(self.tick));
        self.drones.hold_unanswered();
        let opening = self.time_of(self.tick);
        self.drones.fly(&self.params, opening, |_| Vec3::zeros());
        let (mut drones, mut words) = (Vec::with_capacity(self.ids.len()), Vec::new());
        for ((&id, body), process) in self.ids.iter().zip(self.drones.bodies()).zip(self.drones.processes()) {
            TickDigest::write_drone(&mut words, body, process);
            drones.push((DroneId(id), words.len()));
        }
        let frames = self.uplink.frames().to_vec();
        self.tick += 1;
        let announcement = Announcement { sent: frames.len() as u32, owners: self.owners() };
        Ok(TickShare { announcement, drones, words, frames })
    }

    /// Where its drones that hear differently far will be.
    fn owners(&self) -> Vec<(DroneId, usize)> {
        let now_s = self.now_s();
        let own = |id: DroneId| {
            let body = &self.drones.bodies()[self.ids.binary_search(&id.0).ok()?];
            Some((id, self.tiles.owner(body.position().xy(), now_s)))
        };
        self.reaches.others().filter_map(own).collect()
    }

    /// What each part is told, by its number, this one included. Drones that have left its tile go with it.
    pub fn leave(&mut self, announcements: &[Announcement]) -> Vec<Halo> {
        let mut halos = vec![Halo::default(); self.tiles.count()];
        let now_s = self.now_s();
        let range_m = self.params.ranging_m.unwrap_or(0.0);
        for (&id, body) in self.ids.iter().zip(self.drones.bodies()) {
            let place = body.position().xy();
            let owner = self.tiles.owner(place, now_s);
            self.tiles.each_near(place, range_m, now_s, &mut |part| {
                if part != owner {
                    halos[part].bodies.push((id, *body));
                }
            });
        }
        let listeners: Vec<(DroneId, usize)> = announcements.iter().flat_map(|other| &other.owners).copied().collect();
        for frame in self.uplink.frames() {
            self.address(frame, &listeners, &mut halos);
        }
        for place in (0..self.ids.len()).rev() {
            let owner = self.tiles.owner(self.drones.bodies()[place].position().xy(), now_s);
            if owner != self.number {
                let (body, process) = self.drones.remove(place);
                halos[owner].movers.push(Mover { id: self.ids.remove(place), body, process });
            }
        }
        self.unheard = announcements.iter().map(|other| other.sent).sum();
        halos
    }

    /// Puts a frame into the halo of each part with a drone that may hear it.
    fn address(&self, frame: &AirFrame, listeners: &[(DroneId, usize)], halos: &mut [Halo]) {
        let (place, kind) = (frame.position().xy(), frame.frame.kind);
        let mut add = |part: usize| {
            let frames = &mut halos[part].frames;
            let is_last = |last: &AirFrame| (last.source, last.sequence) == (frame.source, frame.sequence);
            if !frames.last().is_some_and(is_last) {
                frames.push(*frame);
            }
        };
        self.tiles.each_near(place, self.reaches.most_m(kind), self.now_s(), &mut add);
        for &(id, part) in listeners {
            self.tiles.each_near(place, self.reaches.other_m(id, kind), self.now_s(), &mut |near| {
                if near == part {
                    add(part);
                }
            });
        }
    }

    /// Takes in what all parts tell it, itself included, and opens the next tick.
    pub fn meet(&mut self, halos: &[&Halo]) {
        for mover in halos.iter().flat_map(|halo| &halo.movers) {
            if let Err(place) = self.ids.binary_search(&mover.id) {
                self.ids.insert(place, mover.id);
                self.drones.insert(place, mover.body, mover.process.clone());
            }
        }
        let mut frames: Vec<AirFrame> = halos.iter().flat_map(|halo| &halo.frames).copied().collect();
        frames.sort_unstable_by_key(|frame| (frame.source, frame.sequence));
        self.unheard = self.unheard.saturating_sub(frames.len() as u32);
        self.uplink.hand_over(&mut self.downlink.frames);
        self.downlink.frames = frames;
        self.drones.open_tick();
        let bodies: Vec<(u32, Body)> = halos.iter().flat_map(|halo| &halo.bodies).copied().collect();
        self.look_around(bodies.into_iter());
    }

    /// Finds out what its drones sense, among themselves and these bodies. Bodies of its own may be among them.
    fn look_around(&mut self, halo: impl Iterator<Item = (u32, Body)>) {
        self.around.clear();
        self.around.extend(halo.filter(|(id, _)| self.ids.binary_search(id).is_err()));
        self.around.extend(self.ids.iter().copied().zip(self.drones.bodies().iter().copied()));
        self.around.sort_unstable_by_key(|(id, _)| *id);
        self.bodies.clear();
        self.bodies.extend(self.around.iter().map(|(_, body)| *body));
        let range = SweepRange {
            bodies_m: self.params.ranging_m.unwrap_or(0.0),
            detection_m: self.params.detection_range_m,
            clearance_m: 0.0,
        };
        self.sweep.sweep(&self.bodies, range);
    }

    fn is_near(&self, body: &Body, part: usize, now_s: f64) -> bool {
        let mut found = false;
        let range_m = self.params.ranging_m.unwrap_or(0.0);
        self.tiles.each_near(body.position().xy(), range_m, now_s, &mut |near| found |= near == part);
        found
    }

    fn time_of(&self, tick: Tick) -> SimTime {
        SimTime((tick as i64).saturating_mul(self.params.dt_ns))
    }

    fn now_s(&self) -> f64 {
        self.time_of(self.tick).secs()
    }
}
