//! What the plots need from run.mcap: the events, and the number of messages over time.

use super::lines::Line;
use super::shown_frames::ShownFrames;
use crate::error::ReportError;
use crate::folder::RunFolder;
use crate::group_order::GroupOrder;
use crate::interruption::Interrupted;
use crate::mcap;
use skein_protocol::record::RunEvent;

/// Length of the intervals in which messages are counted, s.
const INTERVAL_S: f64 = 1.0;

/// Messages per second in one interval.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Count {
    sent: f64,
    received: f64,
    dropped: f64,
}

/// Events and messages of a run.
#[derive(Default)]
pub(super) struct Recording {
    events: Vec<RunEvent>,
    groups: GroupOrder,
    counts: Vec<Count>,
    shown: ShownFrames,
    /// Time of the last sample, s.
    end_s: f64,
}

impl Recording {
    /// Reads run.mcap.
    pub(crate) fn read(folder: &RunFolder, interrupted: &Interrupted<'_>) -> Result<Self, ReportError> {
        let (mut recording, mut events) = (Self::default(), Vec::new());
        mcap::read(
            folder,
            interrupted,
            |sample| {
                let sum = |counts: &mut dyn Iterator<Item = &u32>| counts.map(|&count| f64::from(count)).sum::<f64>();
                let radio = &sample.radio;
                recording.groups.note(&sample.state.group);
                recording.shown.take(&sample);
                recording.count(
                    sample.state.t_s,
                    sum(&mut radio.sent.values()),
                    sum(&mut radio.heard.iter()),
                    sum(&mut radio.dropped.values()),
                );
                Ok(())
            },
            |event| events.push(event),
        )?;
        recording.events = events;
        Ok(recording)
    }

    fn count(&mut self, t_s: f64, sent: f64, received: f64, dropped: f64) {
        // A sample counts the messages before it.
        let bin = ((t_s / INTERVAL_S - 1e-6).max(0.0)).floor() as usize;
        if self.counts.len() <= bin {
            self.counts.resize(bin + 1, Count::default());
        }
        let count = &mut self.counts[bin];
        count.sent += sent / INTERVAL_S;
        count.received += received / INTERVAL_S;
        count.dropped += dropped / INTERVAL_S;
        self.end_s = t_s;
    }

    /// The events in order.
    pub(super) fn events(&self) -> &[RunEvent] {
        &self.events
    }

    /// The groups in the order of their colours.
    pub(super) fn groups(&self) -> &GroupOrder {
        &self.groups
    }

    /// The marks and lines of pilots.
    pub(super) fn shown(&self) -> &ShownFrames {
        &self.shown
    }

    /// Whether any message was sent.
    pub(super) fn has_messages(&self) -> bool {
        self.counts.iter().any(|count| count.sent > 0.0)
    }

    /// Messages sent, received and dropped per second. An incomplete last interval is left out.
    pub(crate) fn lines(&self) -> Vec<Line> {
        let whole = ((self.end_s + 1e-6) / INTERVAL_S).floor().max(1.0) as usize;
        let line = |label: &str, value: fn(&Count) -> f64| Line {
            label: label.to_owned(),
            points: (self.counts.iter().take(whole).enumerate())
                .map(|(bin, count)| ((bin as f64 + 0.5) * INTERVAL_S, value(count)))
                .collect(),
        };
        vec![
            line("sent", |count| count.sent),
            line("received, over all receivers", |count| count.received),
            line("dropped, over all receivers", |count| count.dropped),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_are_counted_per_second() {
        let mut recording = Recording::default();
        for tenth in 1..=25 {
            recording.count(f64::from(tenth) * 0.1, 2.0, 6.0, 1.0);
        }
        let lines = recording.lines();
        assert_eq!(lines[0].points, [(0.5, 20.0), (1.5, 20.0)]);
        assert_eq!((lines[1].points[1].1, lines[2].points[1].1), (60.0, 10.0));
        assert!(recording.has_messages() && !Recording::default().has_messages());
    }
}
