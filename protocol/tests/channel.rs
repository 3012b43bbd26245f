//! The channel that all drones share: how long each frame waits, and which frames are not transmitted at all.
#![allow(clippy::unwrap_used, reason = "a test that cannot continue must fail")]

use skein_protocol::frame::{AirFrame, FRAME_PAYLOAD, Frame};
use skein_protocol::message::Topic;
use skein_protocol::radio::{
    ChannelModel, ChannelQueue, Delay, Delivery, DropReason, NEVER_TRANSMITTED, Radio, SharedChannel,
};
use skein_protocol::{DroneId, SimTime, Vec3};

/// A frame that occupies 100 bytes on the channel.
fn sent(tick: u64, source: u32, sequence: u32) -> AirFrame {
    let frame = Frame { kind: Topic::Pose as u16, version: 1, len: 92, payload: [0; FRAME_PAYLOAD] };
    AirFrame {
        tick,
        source: DroneId(source),
        sequence,
        position_m: [0.0; 3],
        queue_ns: 0,
        link_faults: Default::default(),
        frame,
    }
}

#[test]
fn frames_queue_for_the_channel_over_ticks() {
    // A frame of 100 bytes occupies the channel for 10 ms. A tick is 20 ms.
    let channel = SharedChannel { seed: 1, rate_bps: 80_000.0, limit_s: 0.05, carrier_sense_m: f64::INFINITY };
    let mut queue = ChannelQueue::new(channel);
    let mut queue_times = |tick: u64, count: u32| {
        let mut frames: Vec<AirFrame> = (0..count).map(|source| sent(tick, source, tick as u32)).collect();
        queue.schedule(SimTime(tick as i64 * 20_000_000), &mut frames);
        assert!(frames.is_sorted_by_key(|frame| frame.source), "schedule does not reorder the slice");
        let mut waits: Vec<u64> = frames.iter().map(|frame| frame.queue_ns).collect();
        waits.sort_unstable();
        waits
    };
    let ms = |waits: &[u64]| waits.iter().map(|ms| ms * 1_000_000).collect::<Vec<_>>();
    assert_eq!(queue_times(0, 3), ms(&[10, 20, 30]));
    assert_eq!(queue_times(1, 2), ms(&[20, 30]), "tick 0 still occupies the channel for 10 ms");
    // Tick 1 still occupies the channel for 10 ms. Frames that start within 50 ms are transmitted.
    assert_eq!(queue_times(2, 7), [ms(&[20, 30, 40, 50, 60]), vec![NEVER_TRANSMITTED; 2]].concat());
    assert_eq!(queue_times(9, 1), ms(&[10]), "idle time of the channel is not saved for later frames");
    let overlong = AirFrame { frame: Frame { len: u32::MAX, ..sent(0, 0, 0).frame }, ..sent(0, 0, 0) };
    assert_eq!(channel.airtime_ns(&overlong), (8 + FRAME_PAYLOAD as u64) * 100_000);
}

#[test]
fn drones_that_do_not_sense_each_other_transmit_at_the_same_time() {
    // A frame of 100 bytes occupies the channel for 10 ms. The outer two of three drones are 1000 m apart.
    let waits = |carrier_sense_m: f64, ticks: u64, dt_ms: i64| {
        let mut queue = ChannelQueue::new(SharedChannel { seed: 1, rate_bps: 80_000.0, limit_s: 1.0, carrier_sense_m });
        let mut tick = |tick: u64| {
            let place = |source: u32| [500.0 * f64::from(source), 0.0, 0.0];
            let mut frames: Vec<AirFrame> =
                (0..3).map(|source| AirFrame { position_m: place(source), ..sent(tick, source, 0) }).collect();
            queue.schedule(SimTime(tick as i64 * dt_ms * 1_000_000), &mut frames);
            frames.iter().map(|frame| frame.queue_ns / 1_000_000).collect::<Vec<_>>()
        };
        (0..ticks).map(&mut tick).collect::<Vec<_>>()
    };
    assert!(waits(400.0, 3, 20).iter().all(|tick| *tick == [10, 10, 10]));
    for tick in waits(600.0, 20, 100) {
        // The one in the middle waits for both others, or they wait for it.
        assert!(
            tick == [10, 20, 10] || tick == [20, 10, 20] || tick == [10, 20, 30] || tick == [30, 20, 10],
            "{tick:?}"
        );
    }
    let late = waits(1000.0, 3, 20);
    assert_eq!(late[0].iter().sum::<u64>(), 60, "{late:?}");
    assert_eq!(late[2].iter().sum::<u64>(), 60 + 3 * 20, "three frames in 30 ms are more than a tick has room for");
}

#[test]
fn no_drone_gets_the_channel_first_because_of_its_id() {
    let mut queue =
        ChannelQueue::new(SharedChannel { seed: 1, rate_bps: 1e9, limit_s: 1.0, carrier_sense_m: f64::INFINITY });
    let mut first = [0u32; 8];
    for tick in 0..8000u64 {
        let mut frames: Vec<AirFrame> = (0..8).flat_map(|source| (0..2).map(move |n| sent(tick, source, n))).collect();
        queue.schedule(SimTime(tick as i64 * 20_000_000), &mut frames);
        let earliest = frames.iter().min_by_key(|frame| frame.queue_ns).unwrap();
        first[earliest.source.index()] += 1;
        assert!(frames.chunks(2).all(|pair| pair[0].queue_ns < pair[1].queue_ns), "a drone's frames keep their order");
    }
    for count in first {
        // The expected count is an eighth of 8000. The bound is five standard deviations of the binomial distribution.
        assert!((f64::from(count) - 1000.0).abs() < 5.0 * (8000.0f64 * 0.125 * 0.875).sqrt(), "{first:?}");
    }
}

#[test]
fn queue_time_adds_to_the_delay_and_a_frame_never_transmitted_is_dropped_as_queue() {
    let channel = ChannelModel { delay: Delay { mean_s: 0.1, ..Delay::default() }, ..ChannelModel::default() };
    let radio = Radio { seed: 3, channel, ..Radio::default() };
    let delivery = |frame: AirFrame| radio.delivery(&frame, DroneId(1), Vec3::zeros(), 20_000_000);
    let due = SimTime(5 * 20_000_000 + 3_000_000 + 100_000_000);
    assert_eq!(delivery(AirFrame { queue_ns: 3_000_000, ..sent(5, 0, 0) }), Delivery::Deliver { due, again: None });
    assert_eq!(delivery(AirFrame { queue_ns: NEVER_TRANSMITTED, ..sent(5, 0, 0) }), Delivery::Drop(DropReason::Queue));
}
