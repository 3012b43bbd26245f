//! Bytes that another process wrote cause no panic, and what is accepted can be used. `PROPTEST_CASES` sets the number of cases.
#![allow(clippy::unwrap_used, reason = "a test fails where it cannot go on")]

use proptest::prelude::*;
use skein_protocol::downlink::{Downlink, DownlinkView, SensedNeighbour, SensedObstacle, SensedShape, SensesHeader};
use skein_protocol::frame::{AirFrame, FRAME_PAYLOAD, Frame};
use skein_protocol::message::{DecodeError, MAX_ABS};
use skein_protocol::record::{DroneRow, RecordHeader, RecordView, RunEvent};
use skein_protocol::telemetry::TelemetryRow;
use skein_protocol::{DroneId, Message, SimTime, Vec2, payload};

/// Eight bytes that are a value which somebody might not expect, or any.
fn word() -> impl Strategy<Value = u64> {
    let numbers = [0.0, -0.0, 1.0, -35.5, 1e9, -1e10, f64::MAX, f64::MIN_POSITIVE, f64::NAN];
    let infinite = [f64::INFINITY, f64::NEG_INFINITY];
    prop_oneof![
        4 => Just(0u64),
        4 => prop::sample::select(numbers.to_vec()).prop_map(f64::to_bits),
        1 => prop::sample::select(infinite.to_vec()).prop_map(f64::to_bits),
        4 => 0..40u64,
        2 => (0..40u64, 0..40u64).prop_map(|(low, high)| low | high << 32),
        1 => any::<u64>(),
    ]
}

/// A frame of a known kind and of the length of its payload.
fn frame() -> impl Strategy<Value = Frame> {
    (0..10u16, prop::collection::vec(word(), FRAME_PAYLOAD / 8)).prop_map(|(kind, words)| {
        let mut frame = Frame { kind, version: payload::VERSION, len: 1, payload: [0; FRAME_PAYLOAD] };
        frame.payload[..words.len() * 8].copy_from_slice(bytemuck::cast_slice(&words));
        if let Err(DecodeError::Length(_, wanted)) = Message::decode(&frame) {
            frame.len = wanted as u32;
        }
        frame
    })
}

/// Changes words of a sample: each change is a place and its new value.
fn change(words: &mut [u64], changes: &[(prop::sample::Index, u64)]) {
    for (place, value) in changes {
        let place = place.index(words.len());
        words[place] = *value;
    }
}

/// Words of a sample's head, and of all of it, with their new values.
type Changes = (Vec<(usize, u64)>, Vec<(prop::sample::Index, u64)>);

fn changes(head: usize) -> impl Strategy<Value = Changes> {
    let in_head = prop::collection::vec((0..head, word()), 0..3);
    (in_head, prop::collection::vec((any::<prop::sample::Index>(), word()), 0..6))
}

fn downlink() -> Vec<u64> {
    let mut down = Downlink::default();
    for drone in 0..4 {
        let first = |count: usize| count as u32;
        down.drones.push(SensesHeader {
            position_m: [f64::from(drone) * 30.0, 0.0, 50.0],
            obstacle_first: first(down.obstacles.len()),
            obstacle_count: 1,
            neighbour_first: first(down.neighbours.len()),
            neighbour_count: 2,
            ..bytemuck::Zeroable::zeroed()
        });
        down.obstacles.push(SensedObstacle { shape: 0, ..bytemuck::Zeroable::zeroed() });
        down.neighbours.extend([<SensedNeighbour as bytemuck::Zeroable>::zeroed(); 2]);
    }
    down.shapes.push(<SensedShape as bytemuck::Zeroable>::zeroed());
    down.frames.extend([<AirFrame as bytemuck::Zeroable>::zeroed(); 40]);
    let locality = Default::default();
    let down_frames = down.frames.clone();
    down.index.build(locality, &down_frames);
    down.seal(7, SimTime::from_secs(0.14));
    let mut words = vec![0; down.byte_len().div_ceil(8)];
    down.write_to(bytemuck::cast_slice_mut(&mut words));
    words
}

fn record() -> Vec<u64> {
    let events = b"{\"t_s\":1.0,\"event\":\"passed\",\"stage\":0}\n";
    let (rows, frames) = ([DroneRow::default(); 3], [<AirFrame as bytemuck::Zeroable>::zeroed(); 2]);
    let telemetry = [<TelemetryRow as bytemuck::Zeroable>::zeroed(); 2];
    let head =
        RecordHeader { rows: 3, frames: 2, telemetry: 2, events_len: events.len() as u32, ..RecordHeader::default() };
    let view = RecordView { head: &head, rows: &rows, frames: &frames, telemetry: &telemetry, events };
    let mut words = vec![0; view.byte_len().div_ceil(8)];
    view.write_to(&mut bytemuck::cast_slice_mut(&mut words)[..view.byte_len()]);
    words
}

/// Numbers that a reader may compute with: within bounds, or positive infinity for "never".
fn usable(value: f64) -> bool {
    value.abs() <= MAX_ABS || value == f64::INFINITY
}

proptest! {
    #[test]
    fn frames(frame in frame()) {
        let Ok(message) = Message::decode(&frame) else { return Ok(()) };
        prop_assert_eq!(&message.encode().payload[..frame.len as usize], &frame.payload[..frame.len as usize]);
        match &message {
            Message::Plan(plan) => {
                prop_assert!(usable(plan.anchor_stop_x_m), "{plan:?}");
                prop_assert!(plan.predicted_s.is_nan() || plan.predicted_s.abs() <= MAX_ABS, "{plan:?}");
            }
            Message::Arrivals(row) => {
                prop_assert!(row.gate_s.iter().all(|&gate_s| usable(gate_s.into())), "{row:?}");
            }
            _ => {}
        }
        let text = format!("{message:?}");
        prop_assert!(!text.is_empty());
    }

    #[test]
    fn downlinks((head, body) in changes(7), len in any::<prop::sample::Index>()) {
        let mut words = downlink();
        head.into_iter().for_each(|(place, value)| words[place] = value);
        change(&mut words, &body);
        let bytes: &[u8] = bytemuck::cast_slice(&words);
        // One time of four, the sample is cut short.
        let len = len.index(4 * bytes.len()).min(bytes.len());
        let Ok(down) = DownlinkView::parse(&bytes[..len]) else { return Ok(()) };
        for drone in (0..6).map(DroneId) {
            let Some(senses) = down.senses(drone) else { continue };
            prop_assert!(senses.obstacles.len() <= down.obstacles.len() && senses.neighbours.len() <= down.neighbours.len());
            for shape in senses.obstacles.iter().filter_map(|obstacle| senses.shape(obstacle)) {
                let _ = shape.shape.check();
            }
            let mut visited = 0;
            down.nearby.each(senses.position(), |_| visited += 1);
            down.nearby.each(Vec2::new(f64::MAX, f64::NAN), |_| visited += 1);
            prop_assert!(visited <= 40 * (down.nearby.order.len() + down.frames.len() + 1), "{visited} visits");
        }
    }

    #[test]
    fn records((head, body) in changes(6), len in any::<prop::sample::Index>()) {
        let mut words = record();
        head.into_iter().for_each(|(place, value)| words[place] = value);
        change(&mut words, &body);
        let bytes: &[u8] = bytemuck::cast_slice(&words);
        let len = len.index(4 * bytes.len()).min(bytes.len());
        let Ok(record) = RecordView::parse(&bytes[..len]) else { return Ok(()) };
        prop_assert!(record.byte_len() <= len);
        for row in record.rows {
            let text = format!("{row:?} {:?} {} {:?}", row.phase(), row.group, row.leader());
            prop_assert!(!text.is_empty());
        }
        for frame in record.frames {
            let text = format!("{:?}", Message::decode(&frame.frame));
            prop_assert!(!text.is_empty());
        }
        prop_assert!(record.telemetry.iter().filter_map(TelemetryRow::metric).all(|(_, value)| value.is_finite()));
        let _ = record.parse_events(|line| serde_json::from_slice::<RunEvent>(line));
    }
}
