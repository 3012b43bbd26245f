//! Events as JSON lines, in reused memory.

use skein_protocol::SimTime;
use skein_protocol::record::{EventKind, RunEvent};

/// Gathers a tick's events, then tells them while those of the next are gathered.
#[derive(Clone, Debug, Default)]
pub(crate) struct Log {
    gathered: Vec<u8>,
    told: Vec<u8>,
}

impl Log {
    /// Adds an event.
    pub fn push(&mut self, at: SimTime, what: EventKind) {
        serde_json::to_writer(&mut self.gathered, &RunEvent { t_s: at.secs(), what })
            .expect("an event's keys are strings, and a Vec takes every write");
        self.gathered.push(b'\n');
    }

    /// Ends the tick: what was gathered is told from now on.
    pub fn turn(&mut self) {
        std::mem::swap(&mut self.gathered, &mut self.told);
        self.gathered.clear();
    }

    /// The events of the last tick that ended.
    pub fn told(&self) -> &[u8] {
        &self.told
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// Everything gathered so far.
    pub(crate) fn read(log: &mut Log) -> Vec<RunEvent> {
        log.turn();
        let lines = log.told().split(|&byte| byte == b'\n').filter(|line| !line.is_empty());
        lines.map(|line| serde_json::from_slice(line).unwrap()).collect()
    }

    #[test]
    fn events_are_told_once_and_in_order() {
        let mut log = Log::default();
        log.push(SimTime::from_secs(1.5), EventKind::Passed { stage: 0 });
        log.push(SimTime::from_secs(1.5), EventKind::Passed { stage: 1 });
        let told = read(&mut log);
        assert_eq!(told[1], RunEvent { t_s: 1.5, what: EventKind::Passed { stage: 1 } });
        assert_eq!(told.len(), 2);
        assert_eq!(read(&mut log), []);
    }
}
