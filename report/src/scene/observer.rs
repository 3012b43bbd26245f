//! Makes samples from the records of a run.

use crate::facts::RunFacts;
use crate::scene::frames;
use crate::scene::rounding::rounded;
use crate::scene::sample::{EnergySample, RadioSample, Sample, SentFrame, State};
use crate::scene::shown::ShownSince;
use crate::scene::slots::Slots;
use crate::tuning::SAMPLE_FRAMES_MAX;
use skein_protocol::frame::AirFrame;
use skein_protocol::payload::NO_ROUTE;
use skein_protocol::radio::DropReason;
use skein_protocol::record::{DroneRow, RecordView};
use skein_protocol::{DroneId, SimTime};
use std::collections::BTreeMap;

/// Largest number of drones for which samples list every frame, with its delivery to every receiver.
pub const MAX_LISTED_DRONES: usize = 64;

/// Follows the records of a run and makes samples from them.
pub struct Observer {
    facts: RunFacts,
    /// Length of a tick, ns.
    dt_ns: i64,
    slots: Slots,
    /// Radio traffic since the previous sample.
    radio: RadioSample,
    /// What pilots show since the previous sample.
    shown: ShownSince,
    /// The receiver selected in a large swarm.
    receiver: Option<DroneId>,
    last_tick: Option<u64>,
}

impl Observer {
    /// For a run with these facts.
    #[must_use]
    pub fn new(facts: RunFacts) -> Self {
        let dt_ns = (facts.dt_s * 1e9).round() as i64;
        let (slots, radio, shown) = (Slots::default(), RadioSample::default(), ShownSince::default());
        Self { facts, dt_ns, slots, radio, shown, receiver: None, last_tick: None }
    }

    /// In a swarm of more than [`MAX_LISTED_DRONES`] drones, samples list from now on the frames to this receiver, or none.
    /// Without effect in a smaller swarm.
    pub fn select_receiver(&mut self, receiver: Option<DroneId>) {
        self.receiver = receiver.filter(|_| self.facts.drones as usize > MAX_LISTED_DRONES);
        self.radio.frames.clear();
    }

    /// Takes the record of a tick, and returns a sample if `wanted`. The last record of a run, which repeats a tick, gives
    /// no sample.
    pub fn take(&mut self, record: RecordView<'_>, wanted: bool) -> Option<Sample> {
        let head = record.head;
        if record.rows.is_empty() || self.last_tick.is_some_and(|last| head.tick <= last) {
            return None;
        }
        self.last_tick = Some(head.tick);
        self.slots.take_frames(record.frames, record.rows);
        self.count(record);
        self.shown.take(head.tick, record.telemetry);
        wanted.then(|| Sample {
            state: self.state(record),
            energy: energy(record.rows),
            radio: RadioSample {
                receiver: self.receiver.map(|receiver| receiver.0),
                ..std::mem::take(&mut self.radio)
            },
            shown: self.shown.finish(),
        })
    }

    /// Takes the record of a tick without listing or counting its frames, for a live view that cannot keep up.
    pub fn skip(&mut self, record: RecordView<'_>) {
        self.slots.take_frames(record.frames, record.rows);
    }

    /// Counts and lists the frames of a tick.
    fn count(&mut self, record: RecordView<'_>) {
        let radio = &mut self.radio;
        radio.heard.resize(record.rows.len(), 0);
        radio.dropped_by.resize(record.rows.len(), 0);
        for (drone, row) in record.rows.iter().enumerate() {
            radio.heard[drone] = radio.heard[drone].saturating_add(row.heard);
            for (reason, &count) in DropReason::ALL.into_iter().zip(&row.dropped).filter(|(_, count)| **count > 0) {
                add(&mut radio.dropped, frames::reason(reason), count);
                radio.dropped_by[drone] = radio.dropped_by[drone].saturating_add(count);
            }
        }
        let listed = self.facts.drones as usize <= MAX_LISTED_DRONES || self.receiver.is_some();
        for frame in record.frames {
            let topic = frames::topic(frame);
            if listed {
                let deliveries = self.deliveries(frame, record.rows);
                let (source, sequence) = (frame.source.0, frame.sequence);
                let t_s = SimTime((frame.tick as i64).saturating_mul(self.dt_ns)).secs();
                let content = frames::content(frame);
                self.radio.frames.push(SentFrame { t_s, source, sequence, kind: topic.clone(), content, deliveries });
            }
            add(&mut self.radio.sent, &topic, 1);
        }
        let surplus = self.radio.frames.len().saturating_sub(SAMPLE_FRAMES_MAX);
        self.radio.frames.drain(..surplus);
    }

    /// The letters of [`SentFrame::deliveries`].
    fn deliveries(&self, frame: &AirFrame, rows: &[DroneRow]) -> String {
        let delivery = |drone| frames::delivery(&self.facts.scene, frame, drone, rows, self.dt_ns);
        match self.receiver {
            Some(receiver) => delivery(receiver).to_string(),
            None => (0..rows.len() as u32).map(|drone| delivery(DroneId(drone))).collect(),
        }
    }

    fn state(&self, record: RecordView<'_>) -> State {
        let (now, rows) = (record.head.now, record.rows);
        let mut state = State { tick: record.head.tick, t_s: now.secs(), ..State::default() };
        for (drone, row) in rows.iter().enumerate() {
            state.x_m.push(rounded(row.position_m[0]));
            state.y_m.push(rounded(row.position_m[1]));
            state.z_m.push(rounded(row.position_m[2]));
            state.vx_mps.push(rounded(row.velocity_mps[0]));
            state.vy_mps.push(rounded(row.velocity_mps[1]));
            state.vz_mps.push(rounded(row.velocity_mps[2]));
            state.alive.push(u8::from(row.alive()));
            state.group.push(row.group.to_string());
            state.leader.push(row.leader().map(|leader| leader.0));
            state.leads.push((row.leads()).then(|| row.led.to_string()));
            state.phase.push(row.phase);
            state.route.push((row.route != NO_ROUTE && row.obeyed.ballot.is_some()).then_some(row.route));
            state.rank.push(row.rank);
            state.plan.push([row.obeyed.ballot.round, row.obeyed.epoch]);
            let slot = self.slots.of(drone, row, now).filter(|_| row.alive());
            state.slot_m.push(slot.map(|slot| [rounded(slot.x), rounded(slot.y)]));
            state.late.push(u8::from(row.is_late()));
        }
        state
    }
}

fn add(counts: &mut BTreeMap<String, u32>, name: &str, count: u32) {
    // Allocates the name once, and not for every frame.
    if let Some(known) = counts.get_mut(name) {
        *known = known.saturating_add(count);
    } else {
        counts.insert(name.to_owned(), count);
    }
}

fn energy(rows: &[DroneRow]) -> EnergySample {
    // The sum of no numbers is −0.
    let total_j = 0.0 + rows.iter().filter(|row| row.alive()).map(|row| row.energy_j).sum::<f64>();
    EnergySample { total_j: rounded(total_j), drone_j: rows.iter().map(|row| rounded(row.energy_j)).collect() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{facts, row};
    use skein_protocol::Message;
    use skein_protocol::payload::Passed;
    use skein_protocol::record::RecordHeader;

    fn frame(tick: u64) -> AirFrame {
        let passed = Passed { stamp: SimTime::ZERO, set_count: 1, set: Default::default(), of: 0 };
        AirFrame {
            tick,
            source: DroneId(1),
            sequence: tick as u32,
            position_m: [0.0, 0.0, 50.0],
            queue_ns: 0,
            link_faults: Default::default(),
            frame: Message::Passed(passed).encode(),
        }
    }

    fn take(observer: &mut Observer, tick: u64, drones: usize, wanted: bool) -> Option<Sample> {
        let rows: Vec<DroneRow> = (0..drones)
            .map(|drone| DroneRow { heard: 2, dropped: [0, 0, 1, 0, 0, 0, 0], ..row(1.00049, drone as f64) })
            .collect();
        let head = RecordHeader { tick, now: SimTime((tick as i64 + 1) * 20_000_000), ..RecordHeader::default() };
        observer
            .take(RecordView { head: &head, rows: &rows, frames: &[frame(tick)], telemetry: &[], events: &[] }, wanted)
    }

    #[test]
    fn frames_between_two_samples_are_in_the_second() {
        let mut observer = Observer::new(facts(3));
        assert!(take(&mut observer, 0, 3, false).is_none());
        let sample = take(&mut observer, 1, 3, true).unwrap();
        assert_eq!((sample.state.tick, sample.state.t_s, sample.state.x_m[2]), (1, 0.04, 1.0));
        assert_eq!((sample.radio.sent["passed"], sample.radio.dropped["range"]), (2, 6));
        assert_eq!((sample.radio.heard, sample.radio.dropped_by), (vec![4; 3], vec![2; 3]));
        assert_eq!((sample.radio.frames.len(), sample.radio.frames[1].deliveries.as_str()), (2, "h-h"));
        assert_eq!(sample.radio.frames[1].t_s, 0.02);
        assert!(take(&mut observer, 1, 3, true).is_none(), "the last record repeats a tick");
        assert_eq!(take(&mut observer, 2, 3, true).unwrap().radio.frames.len(), 1);
    }

    #[test]
    fn in_a_large_swarm_frames_to_the_selected_receiver_are_listed() {
        let mut observer = Observer::new(facts(65));
        assert!(take(&mut observer, 0, 65, true).unwrap().radio.frames.is_empty());
        observer.select_receiver(Some(DroneId(4)));
        let sample = take(&mut observer, 1, 65, true).unwrap();
        assert_eq!((sample.radio.receiver, sample.radio.frames[0].deliveries.as_str()), (Some(4), "h"));
    }
}
