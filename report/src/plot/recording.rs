//! What the recording tells beside the trace: events, and how much was said and heard.

use super::lines::Line;
use crate::error::ReportError;
use crate::folder::RunFolder;
use crate::mcap;
use skein_protocol::record::RunEvent;

/// Seconds over which messages are counted.
const EVERY_S: f64 = 1.0;

/// Messages in one second.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Count {
    sent: f64,
    heard: f64,
    dropped: f64,
}

/// Events and messages of a run.
#[derive(Default)]
pub(super) struct Recording {
    pub events: Vec<RunEvent>,
    counts: Vec<Count>,
    end_s: f64,
}

impl Recording {
    /// Reads run.mcap.
    pub fn read(folder: &RunFolder) -> Result<Self, ReportError> {
        let (mut recording, mut events) = (Self::default(), Vec::new());
        mcap::read(
            folder.path(),
            |sample| {
                let sum = |counts: &mut dyn Iterator<Item = &u32>| counts.map(|&count| f64::from(count)).sum::<f64>();
                let radio = &sample.radio;
                recording.count(
                    sample.state.t_s,
                    sum(&mut radio.sent.values()),
                    sum(&mut radio.heard.iter()),
                    sum(&mut radio.dropped.values()),
                );
            },
            |event| events.push(event),
        )?;
        recording.events = events;
        Ok(recording)
    }

    fn count(&mut self, t_s: f64, sent: f64, heard: f64, dropped: f64) {
        // A sample tells what was said before it.
        let bin = ((t_s / EVERY_S - 1e-6).max(0.0)).floor() as usize;
        if self.counts.len() <= bin {
            self.counts.resize(bin + 1, Count::default());
        }
        let count = &mut self.counts[bin];
        count.sent += sent / EVERY_S;
        count.heard += heard / EVERY_S;
        count.dropped += dropped / EVERY_S;
        self.end_s = t_s;
    }

    /// Whether anything was said.
    pub fn any(&self) -> bool {
        self.counts.iter().any(|count| count.sent > 0.0)
    }

    /// Sent, heard, dropped, one a second; the last second only if it is whole.
    pub fn lines(&self) -> Vec<Line> {
        let whole = ((self.end_s + 1e-6) / EVERY_S).floor().max(1.0) as usize;
        let line = |label: &str, value: fn(&Count) -> f64| Line {
            label: label.to_owned(),
            points: (self.counts.iter().take(whole).enumerate())
                .map(|(bin, count)| ((bin as f64 + 0.5) * EVERY_S, value(count)))
                .collect(),
        };
        vec![
            line("sent", |count| count.sent),
            line("heard, over all receivers", |count| count.heard),
            line("dropped, over all receivers", |count| count.dropped),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_are_counted_by_the_second() {
        let mut recording = Recording::default();
        for tenth in 1..=25 {
            recording.count(f64::from(tenth) * 0.1, 2.0, 6.0, 1.0);
        }
        let lines = recording.lines();
        assert_eq!(lines[0].points, [(0.5, 20.0), (1.5, 20.0)]);
        assert_eq!((lines[1].points[1].1, lines[2].points[1].1), (60.0, 10.0));
        assert!(recording.any() && !Recording::default().any());
    }
}
