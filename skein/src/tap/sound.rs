//! Checks samples that came over the network. What parses is checked once more here: the commands count on it.

use skein_protocol::Tick;
use skein_protocol::downlink::DownlinkView;
use skein_protocol::frame::AirFrame;
use skein_protocol::record::RecordView;

/// Greatest tick and greatest time, ns, with which all can be computed: more than a century.
const MAX: u64 = 1 << 62;

/// Whether a sample is the record of a swarm of so many drones, not older than `last`. Returns its tick.
pub(super) fn record(bytes: &[u8], drones: u32, last: Tick) -> Option<Tick> {
    let record = RecordView::parse(bytes).ok()?;
    let head = record.head;
    // The record of the end may be without rows.
    let whole = [0, drones].contains(&head.rows) && record.telemetry.iter().all(|row| row.drone.0 < drones);
    let in_time = head.tick >= last && is_time(head.tick, head.now.0);
    (whole && in_time && are_frames(record.frames, drones)).then_some(head.tick)
}

/// Whether a sample is the downlink of a swarm of so many drones, not older than `last`. Returns its tick.
pub(super) fn downlink(bytes: &[u8], drones: u32, last: Tick) -> Option<Tick> {
    let down = DownlinkView::parse(bytes).ok()?;
    let head = down.head;
    let in_time = head.tick >= last && is_time(head.tick, head.now.0);
    (head.drones == drones && in_time && are_frames(down.frames, drones)).then_some(head.tick)
}

fn are_frames(frames: &[AirFrame], drones: u32) -> bool {
    frames.iter().all(|frame| frame.source.0 < drones && frame.tick <= MAX)
}

fn is_time(tick: Tick, now_ns: i64) -> bool {
    tick <= MAX && u64::try_from(now_ns).is_ok_and(|now| now <= MAX)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use skein_protocol::record::{DroneRow, RecordHeader};
    use skein_protocol::{SimTime, downlink::Downlink, downlink::SensesHeader};

    fn bytes(head: RecordHeader) -> Vec<u64> {
        let rows = vec![DroneRow::default(); head.rows as usize];
        let view = RecordView { head: &head, rows: &rows, frames: &[], telemetry: &[], events: &[] };
        let mut words = vec![0; view.byte_len() / 8];
        view.write_to(bytemuck::cast_slice_mut(&mut words));
        words
    }

    #[test]
    fn only_records_of_the_swarm_that_go_on_are_taken() {
        let head = RecordHeader { tick: 5, now: SimTime(100), rows: 2, ..RecordHeader::default() };
        let taken = |head, last| record(bytemuck::cast_slice(&bytes(head)), 2, last);
        assert_eq!((taken(head, 0), taken(head, 5), taken(head, 6)), (Some(5), Some(5), None));
        assert_eq!(taken(RecordHeader { rows: 0, ..head }, 0), Some(5));
        for wrong in [
            RecordHeader { rows: 3, ..head },
            RecordHeader { tick: u64::MAX, ..head },
            RecordHeader { now: SimTime(-1), ..head },
            RecordHeader { now: SimTime(i64::MAX), ..head },
        ] {
            assert_eq!(taken(wrong, 0), None, "{wrong:?}");
        }
    }

    #[test]
    fn only_downlinks_of_the_swarm_are_taken() {
        let mut down = Downlink { drones: vec![SensesHeader::default(); 2], ..Downlink::default() };
        down.seal(3, SimTime(60));
        let mut words = vec![0_u64; down.byte_len() / 8];
        down.write_to(bytemuck::cast_slice_mut(&mut words));
        let bytes = bytemuck::cast_slice(&words);
        assert_eq!((downlink(bytes, 2, 0), downlink(bytes, 3, 0), downlink(bytes, 2, 4)), (Some(3), None, None));
    }

    proptest! {
        #[test]
        fn any_words_are_taken_or_not(words in proptest::collection::vec(any::<u64>(), 0..200), drones: u32) {
            let bytes = bytemuck::cast_slice(&words);
            let _ = (record(bytes, drones, 0), downlink(bytes, drones, 0));
        }
    }
}
