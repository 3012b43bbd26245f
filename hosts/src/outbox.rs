//! The samples that a viewer has not fetched yet. If it is too slow, it misses the oldest ones.

use skein_protocol::record::{RecordHeader, RecordView};
use skein_runtime::push_sample;
use std::collections::VecDeque;

/// Most samples that wait. Chosen by hand: some seconds at 50 Hz, and all ticks of a fast swarm while a viewer over a slow network
/// asks again.
const MAX_SAMPLES: usize = 256;
/// Greatest size of the samples that wait, bytes; one sample may exceed it.
const MAX_BYTES: usize = 8 << 20;
/// Greatest size of the samples that are fetched at a time, bytes; the last one may exceed it. Chosen by hand.
const PIECE: usize = 512 << 10;
/// Greatest size of the events of missed records that are kept, bytes.
const MAX_EVENTS: usize = 4 << 20;

/// The samples that wait, the oldest first.
#[derive(Default)]
pub(crate) struct Outbox {
    samples: VecDeque<Sample>,
    bytes: usize,
}

/// A sample, in words so that it is aligned.
struct Sample {
    words: Vec<u64>,
    len: usize,
}

impl Sample {
    fn new(bytes: &[u8]) -> Self {
        let mut words = vec![0; bytes.len().div_ceil(size_of::<u64>())];
        bytemuck::cast_slice_mut(&mut words)[..bytes.len()].copy_from_slice(bytes);
        Self { words, len: bytes.len() }
    }

    fn bytes(&self) -> &[u8] {
        &bytemuck::cast_slice(&self.words)[..self.len]
    }
}

impl Outbox {
    /// Adds a record. If older ones must make room, their events go into the record behind them: no viewer misses an event.
    pub(crate) fn push_record(&mut self, bytes: &[u8]) {
        self.push(bytes, |missed, next| {
            let (Ok(missed), Ok(record)) = (RecordView::parse(missed.bytes()), RecordView::parse(next.bytes())) else {
                return;
            };
            if !missed.events.is_empty() && missed.events.len() + record.events.len() < MAX_EVENTS {
                *next = with_events(record, missed.events);
            }
        });
    }

    /// Adds a downlink.
    pub(crate) fn push_downlink(&mut self, bytes: &[u8]) {
        self.push(bytes, |_, _| {});
    }

    /// Adds a sample. `pass_on` gets each sample that makes room, and the one behind it.
    fn push(&mut self, bytes: &[u8], pass_on: impl Fn(&Sample, &mut Sample)) {
        self.bytes += bytes.len();
        self.samples.push_back(Sample::new(bytes));
        while self.samples.len() > 1 && (self.samples.len() > MAX_SAMPLES || self.bytes > MAX_BYTES) {
            let Some(missed) = self.samples.pop_front() else { return };
            self.bytes -= missed.len;
            if let Some(next) = self.samples.front_mut() {
                let before = next.len;
                pass_on(&missed, next);
                self.bytes = self.bytes - before + next.len;
            }
        }
    }

    /// Whether nothing waits.
    pub(crate) fn is_empty(&self) -> bool {
        self.samples.is_empty()
    }

    /// Takes some of the oldest samples.
    pub(crate) fn take(&mut self) -> Vec<u64> {
        let mut words = Vec::new();
        while words.len() * size_of::<u64>() < PIECE
            && let Some(sample) = self.samples.pop_front()
        {
            self.bytes -= sample.len;
            push_sample(&mut words, sample.bytes());
        }
        words
    }
}

/// The record with these events before its own.
fn with_events(record: RecordView<'_>, events: &[u8]) -> Sample {
    let all = [events, b"\n", record.events].concat();
    let head = RecordHeader { events_len: all.len() as u32, ..*record.head };
    let record = RecordView { head: &head, events: &all, ..record };
    let len = record.byte_len();
    let mut words = vec![0; len.div_ceil(size_of::<u64>())];
    record.write_to(bytemuck::cast_slice_mut(&mut words));
    Sample { words, len }
}

#[cfg(test)]
mod tests {
    use super::*;
    use skein_protocol::record::DroneRow;
    use skein_runtime::samples;

    fn record(tick: u64, events: &str) -> Vec<u8> {
        let rows = [DroneRow::default(); 2];
        let head = RecordHeader { tick, rows: 2, events_len: events.len() as u32, ..RecordHeader::default() };
        let view = RecordView { head: &head, rows: &rows, frames: &[], telemetry: &[], events: events.as_bytes() };
        let mut bytes = vec![0; view.byte_len()];
        view.write_to(&mut bytes);
        bytes
    }

    /// The ticks and events of all that waits.
    fn fetch(outbox: &mut Outbox) -> Vec<(u64, String)> {
        let mut found = Vec::new();
        while !outbox.is_empty() {
            let words = outbox.take();
            for sample in samples(&words) {
                let (words, len) = sample.unwrap();
                let record = RecordView::parse(&bytemuck::cast_slice(words)[..len]).unwrap();
                found.push((record.head.tick, String::from_utf8(record.events.to_owned()).unwrap()));
            }
        }
        assert_eq!(outbox.bytes, 0);
        found
    }

    #[test]
    fn a_slow_viewer_misses_the_oldest_records_and_no_event() {
        let mut outbox = Outbox::default();
        outbox.push_record(&record(0, "zero\n"));
        outbox.push_record(&record(1, ""));
        outbox.push_record(&record(2, "two\n"));
        assert_eq!(fetch(&mut outbox).len(), 3);
        outbox.push_record(&record(0, "zero\n"));
        outbox.push_record(&record(1, "one\n"));
        for tick in 2..MAX_SAMPLES as u64 + 10 {
            outbox.push_record(&record(tick, ""));
        }
        let found = fetch(&mut outbox);
        assert_eq!((found.len(), found[0].0, found.last().unwrap().0), (MAX_SAMPLES, 10, MAX_SAMPLES as u64 + 9));
        let events: Vec<&str> = found[0].1.lines().filter(|line| !line.is_empty()).collect();
        assert_eq!(events, ["zero", "one"]);
    }

    #[test]
    fn what_waits_is_limited_also_in_bytes() {
        let mut outbox = Outbox::default();
        for _ in 0..10 {
            outbox.push_downlink(&vec![7; MAX_BYTES / 3]);
        }
        assert_eq!(outbox.samples.len(), 3);
        assert_eq!(samples(&outbox.take()).count(), 1);
        // A sample that is larger than the limit replaces all others.
        outbox.push_downlink(&vec![7; MAX_BYTES + 1]);
        assert_eq!(samples(&outbox.take()).count(), 1);
        assert!(outbox.is_empty());
    }
}
