//! The events of a tick as JSON lines, in reused memory.

use crate::burst::give_back;
use skein_protocol::record::{EventKind, RunEvent, ViolationKind};
use skein_protocol::{DroneId, SimTime};

/// Memory for four times this many bytes is kept in any case. By hand: about 80 events.
const LEAST_KEPT: usize = 2048;

/// Two buffers: the events of the current tick, and those of the tick that ended last.
#[derive(Clone, Debug, Default)]
pub(crate) struct EventLog {
    current: Vec<u8>,
    ended: Vec<u8>,
}

impl EventLog {
    /// Adds an event to the current tick.
    pub(crate) fn push(&mut self, at: SimTime, what: EventKind) {
        serde_json::to_writer(&mut self.current, &RunEvent { t_s: at.secs(), what })
            .expect("an event's keys are strings, and a Vec takes every write");
        self.current.push(b'\n');
    }

    /// Adds the violation of an invariant. `value_m` is the distance, m; 0 where there is none.
    pub(crate) fn push_violation(&mut self, at: SimTime, kind: ViolationKind, drones: &[DroneId], value_m: f64) {
        self.push(at, EventKind::Violation { kind, drones: drones.to_vec(), value_m });
    }

    /// Ends the tick.
    pub(crate) fn end_tick(&mut self) {
        std::mem::swap(&mut self.current, &mut self.ended);
        self.current.clear();
        give_back(&mut self.current, self.ended.len(), LEAST_KEPT);
    }

    /// The events of the tick that ended last, one JSON line per event.
    pub(crate) fn ended(&self) -> &[u8] {
        &self.ended
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// Ends the tick and reads its events.
    pub(crate) fn read(log: &mut EventLog) -> Vec<RunEvent> {
        log.end_tick();
        let lines = log.ended().split(|&byte| byte == b'\n').filter(|line| !line.is_empty());
        lines.map(|line| serde_json::from_slice(line).unwrap()).collect()
    }

    #[test]
    fn events_are_kept_for_one_tick_in_their_order() {
        let mut log = EventLog::default();
        log.push(SimTime::from_secs(1.5), EventKind::Passed { stage: 0 });
        log.push(SimTime::from_secs(1.5), EventKind::Passed { stage: 1 });
        let events = read(&mut log);
        assert_eq!(events[1], RunEvent { t_s: 1.5, what: EventKind::Passed { stage: 1 } });
        assert_eq!(events.len(), 2);
        assert_eq!(read(&mut log), []);
    }

    #[test]
    fn the_memory_of_many_events_is_given_back() {
        let mut log = EventLog::default();
        (0..1000).for_each(|_| log.push(SimTime::ZERO, EventKind::Passed { stage: 0 }));
        log.end_tick();
        assert!(log.ended().len() > 4 * LEAST_KEPT);
        log.end_tick();
        assert_eq!([log.current.capacity(), log.ended.capacity()], [0, 0]);
    }
}
