//! One drone's process as the world sees it: its last answer, its incarnation, whether it is frozen.

use skein_protocol::slot::Slot;

/// How a drone has answered in the current tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Answer {
    Pending,
    Received,
    Late,
    /// The process is frozen, so no answer is expected.
    Frozen,
}

/// One drone's process.
#[derive(Clone, Debug)]
pub(crate) struct Process {
    /// The last answer. In ticks without one, its counters are 0.
    slot: Slot,
    answer: Answer,
    incarnation: u32,
    frozen: bool,
    sequence: u32,
}

impl Default for Process {
    fn default() -> Self {
        Self { slot: Slot::default(), answer: Answer::Pending, incarnation: 1, frozen: false, sequence: 0 }
    }
}

impl Process {
    /// The last answer.
    pub(crate) fn slot(&self) -> &Slot {
        &self.slot
    }

    /// Number of the process, from 1. Each restart adds 1.
    pub(crate) fn incarnation(&self) -> u32 {
        self.incarnation
    }

    /// Whether the process is stopped (SIGSTOP).
    pub(crate) fn is_frozen(&self) -> bool {
        self.frozen
    }

    /// Whether the process has missed the current tick.
    pub(crate) fn is_late(&self) -> bool {
        self.answer == Answer::Late
    }

    /// Whether the current tick still waits for an answer.
    pub(crate) fn is_pending(&self) -> bool {
        self.answer == Answer::Pending
    }

    /// Takes the answer to the current tick.
    pub(crate) fn take(&mut self, slot: &Slot) {
        self.slot = *slot;
        self.answer = Answer::Received;
    }

    /// The process missed the current tick: it brakes, and it has heard nothing.
    pub(crate) fn miss(&mut self) {
        self.answer = Answer::Late;
        self.clear_counters();
    }

    /// The frozen process heard nothing in the current tick.
    pub(crate) fn skip(&mut self) {
        self.answer = Answer::Frozen;
        self.clear_counters();
    }

    /// A new tick begins.
    pub(crate) fn open_tick(&mut self) {
        self.answer = Answer::Pending;
    }

    /// Stops or continues the process. Returns whether it was stopped before.
    pub(crate) fn set_frozen(&mut self, frozen: bool) -> bool {
        std::mem::replace(&mut self.frozen, frozen)
    }

    /// Notes the incarnation. Returns whether it is another one than before.
    pub(crate) fn set_incarnation(&mut self, incarnation: u32) -> bool {
        std::mem::replace(&mut self.incarnation, incarnation) != incarnation
    }

    /// A new process begins with an empty answer. Returns its incarnation.
    pub(crate) fn restart(&mut self) -> u32 {
        self.incarnation += 1;
        self.slot = Slot::default();
        self.incarnation
    }

    /// The sequence number of the next frame, from 0. It continues over restarts.
    pub(crate) fn next_sequence(&mut self) -> u32 {
        let sequence = self.sequence;
        self.sequence = sequence.wrapping_add(1);
        sequence
    }

    fn clear_counters(&mut self) {
        self.slot =
            Slot { heard: 0, duplicates: 0, dropped: Default::default(), heard_hash: 0, step_ns: 0, ..self.slot };
    }
}
