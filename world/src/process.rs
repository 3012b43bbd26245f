//! A drone's process, as far as the world sees it: its answers.

use crate::body::Body;
use crate::invariants::Obedience;
use skein_protocol::flag;
use skein_protocol::link_faults::LinkFaults;
use skein_protocol::record::{DroneRow, ROW_ALIVE, ROW_FROZEN, ROW_LATE, ROW_LEADS, ROW_QUEUED};
use skein_protocol::slot::Slot;

/// How a drone has answered in the current tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Answer {
    Awaited,
    Given,
    Late,
    /// It is frozen: no answer is awaited.
    Frozen,
}

/// One drone's process.
#[derive(Clone, Debug)]
pub(crate) struct Process {
    /// Its last answer; without the tally while it is held.
    pub slot: Slot,
    pub answer: Answer,
    /// Ticks without an answer, up to now.
    pub late_ticks: u32,
    pub incarnation: u32,
    /// Whether it is stopped.
    pub frozen: bool,
    pub obedience: Obedience,
    sequence: u32,
}

impl Default for Process {
    fn default() -> Self {
        Self {
            slot: Slot::default(),
            answer: Answer::Awaited,
            late_ticks: 0,
            incarnation: 1,
            frozen: false,
            obedience: Obedience::default(),
            sequence: 0,
        }
    }
}

impl Process {
    /// It answered.
    pub fn answered(&mut self) {
        self.answer = Answer::Given;
        self.late_ticks = 0;
    }

    /// Its last command goes on; it heard nothing in this tick.
    pub fn hold(&mut self, why: Answer) {
        self.answer = why;
        self.late_ticks = self.late_ticks.saturating_add(u32::from(why == Answer::Late));
        self.slot =
            Slot { heard: 0, duplicates: 0, dropped: Default::default(), heard_hash: 0, step_ns: 0, ..self.slot };
    }

    /// The number of the next frame, from 0; it goes on over restarts.
    pub fn next_sequence(&mut self) -> u32 {
        let sequence = self.sequence;
        self.sequence = sequence.wrapping_add(1);
        sequence
    }

    /// The drone at the end of a tick. Of a dead one's answers only what it obeyed is left.
    pub fn row(&self, body: &Body, link_faults: LinkFaults) -> DroneRow {
        let (slot, alive) = (&self.slot, u32::from(body.alive));
        let flags = flag(slot.leads(), ROW_LEADS)
            | flag(slot.is_queued(), ROW_QUEUED)
            | flag(self.answer == Answer::Late, ROW_LATE)
            | flag(self.frozen, ROW_FROZEN)
            | ROW_ALIVE;
        DroneRow {
            position_m: body.position.into(),
            velocity_mps: body.velocity.into(),
            energy_j: body.energy_j,
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
}
