//! The record of the tick that ended last: one row per drone, and the head.

use crate::body::Body;
use crate::drones::DroneTable;
use crate::faults::schedule::FaultSchedule;
use crate::process::Process;
use skein_protocol::flag;
use skein_protocol::frame::AirFrame;
use skein_protocol::link_faults::LinkFaults;
use skein_protocol::record::{
    DroneRow, ROW_ALIVE, ROW_FROZEN, ROW_LATE, ROW_LEADS, ROW_QUEUED, RecordHeader, RecordView,
};
use skein_protocol::telemetry::TelemetryRow;
use skein_protocol::{DroneId, SimTime, Tick};

/// A tick that has ended.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EndedTick {
    /// Its number.
    pub(crate) tick: Tick,
    /// The time of its end.
    pub(crate) end: SimTime,
    /// The digest up to its end.
    pub(crate) digest: u64,
    /// Length of its events, bytes.
    pub(crate) events_len: usize,
    /// Number of its frames.
    pub(crate) frames: usize,
    /// Number of figures, marks and lines that pilots reported in it.
    pub(crate) telemetry: usize,
}

/// The head and the rows, in reused memory.
#[derive(Clone, Debug, Default)]
pub(crate) struct TickRecord {
    head: RecordHeader,
    rows: Vec<DroneRow>,
}

impl TickRecord {
    /// Records the tick that has ended.
    pub(crate) fn close_tick(&mut self, ended: EndedTick, drones: &DroneTable, faults: &FaultSchedule) {
        self.rows.clear();
        for ((body, process), id) in drones.bodies().iter().zip(drones.processes()).zip(0..) {
            self.rows.push(row(body, process, faults.standing(DroneId(id)).link_faults));
        }
        self.head = RecordHeader {
            tick: ended.tick,
            now: ended.end,
            rows: self.rows.len() as u32,
            frames: ended.frames as u32,
            telemetry: ended.telemetry as u32,
            events_len: ended.events_len as u32,
            lost: 0,
            reserved: 0,
            digest: ended.digest,
        };
    }

    /// Makes the last record of the mission: without rows and frames, under the tick and time of the last one.
    pub(crate) fn close_mission(&mut self, digest: u64, events_len: usize) {
        self.rows.clear();
        self.head =
            RecordHeader { rows: 0, frames: 0, telemetry: 0, events_len: events_len as u32, digest, ..self.head };
    }

    /// The record with its frames, telemetry and events. A record without frames or telemetry ignores these.
    pub(crate) fn view<'a>(
        &'a self,
        frames: &'a [AirFrame],
        telemetry: &'a [TelemetryRow],
        events: &'a [u8],
    ) -> RecordView<'a> {
        let frames = if self.head.frames == 0 { &[] } else { frames };
        let telemetry = if self.head.telemetry == 0 { &[] } else { telemetry };
        RecordView { head: &self.head, rows: &self.rows, frames, telemetry, events }
    }
}

/// One drone at the end of a tick. Of a dead drone's answers, only what it obeyed is left.
fn row(body: &Body, process: &Process, link_faults: LinkFaults) -> DroneRow {
    let (slot, alive) = (process.slot(), u32::from(body.is_alive()));
    let flags = flag(slot.leads(), ROW_LEADS)
        | flag(slot.is_queued(), ROW_QUEUED)
        | flag(process.is_late(), ROW_LATE)
        | flag(process.is_frozen(), ROW_FROZEN)
        | ROW_ALIVE;
    let commands = body.is_alive() && !process.is_frozen() && !process.is_late();
    DroneRow {
        commanded_mps2: if commands { slot.acceleration_mps2 } else { [f64::NAN; 3] },
        position_m: body.position().into(),
        velocity_mps: body.velocity().into(),
        energy_j: body.energy_j(),
        obeyed: slot.obeyed,
        term: slot.term,
        group: slot.group,
        led: slot.led,
        flags: alive * flags,
        phase: slot.phase,
        heard: alive * slot.heard,
        dropped: slot.dropped.map(|count| alive * count),
        link_faults,
        step_ns: alive * slot.step_ns,
        route: slot.route,
        rank: slot.rank,
        reserved: Default::default(),
    }
}
