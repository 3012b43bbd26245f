//! The channel that all drones share: who waits how long, and who is not sent at all.
#![allow(clippy::unwrap_used, reason = "a test fails where it cannot go on")]

use skein_protocol::frame::{AirFrame, FRAME_PAYLOAD, Frame};
use skein_protocol::message::Topic;
use skein_protocol::radio::{
    ChannelModel, ChannelQueue, Delay, Delivery, DropReason, NEVER_TRANSMITTED, Radio, SharedChannel,
};
use skein_protocol::{DroneId, SimTime, Vec2};

/// A frame of 100 bytes on the air.
fn sent(tick: u64, source: u32, sequence: u32) -> AirFrame {
    let frame = Frame { kind: Topic::Pose as u16, version: 1, len: 92, payload: [0; FRAME_PAYLOAD] };
    AirFrame {
        tick,
        source: DroneId(source),
        sequence,
        position_m: [0.0; 2],
        queue_ns: 0,
        link_faults: Default::default(),
        frame,
    }
}

#[test]
fn frames_queue_for_the_channel_over_ticks() {
    // 100 bytes take 10 ms; ticks of 20 ms.
    let channel = SharedChannel { seed: 1, rate_bps: 80_000.0, limit_s: 0.05 };
    let mut queue = ChannelQueue::new(channel);
    let mut pass = |tick: u64, count: u32| {
        let mut frames: Vec<AirFrame> = (0..count).map(|source| sent(tick, source, tick as u32)).collect();
        queue.schedule(SimTime(tick as i64 * 20_000_000), &mut frames);
        assert!(frames.is_sorted_by_key(|frame| frame.source), "the frames stay where they are");
        let mut waits: Vec<u64> = frames.iter().map(|frame| frame.queue_ns).collect();
        waits.sort_unstable();
        waits
    };
    let ms = |waits: &[u64]| waits.iter().map(|ms| ms * 1_000_000).collect::<Vec<_>>();
    assert_eq!(pass(0, 3), ms(&[10, 20, 30]));
    assert_eq!(pass(1, 2), ms(&[20, 30]), "behind the 10 ms that tick 0 left");
    // 10 ms are left; those that begin within 50 ms are sent.
    assert_eq!(pass(2, 7), [ms(&[20, 30, 40, 50, 60]), vec![NEVER_TRANSMITTED; 2]].concat());
    assert_eq!(pass(9, 1), ms(&[10]), "an idle channel saves nothing up");
    let lie = AirFrame { frame: Frame { len: u32::MAX, ..sent(0, 0, 0).frame }, ..sent(0, 0, 0) };
    assert_eq!(channel.airtime_ns(&lie), (8 + FRAME_PAYLOAD as u64) * 100_000);
}

#[test]
fn nobody_has_the_channel_first_by_number() {
    let mut queue = ChannelQueue::new(SharedChannel { seed: 1, rate_bps: 1e9, limit_s: 1.0 });
    let mut first = [0u32; 8];
    for tick in 0..8000u64 {
        let mut frames: Vec<AirFrame> = (0..8).flat_map(|source| (0..2).map(move |n| sent(tick, source, n))).collect();
        queue.schedule(SimTime(tick as i64 * 20_000_000), &mut frames);
        let best = frames.iter().min_by_key(|frame| frame.queue_ns).unwrap();
        first[best.source.index()] += 1;
        assert!(frames.chunks(2).all(|own| own[0].queue_ns < own[1].queue_ns), "a drone's frames keep their order");
    }
    for count in first {
        // An eighth of 8000, ± five standard deviations of the binomial.
        assert!((f64::from(count) - 1000.0).abs() < 5.0 * (8000.0f64 * 0.125 * 0.875).sqrt(), "{first:?}");
    }
}

#[test]
fn waiting_adds_to_the_delay_and_a_frame_not_sent_has_its_reason() {
    let air = ChannelModel { delay: Delay { mean_s: 0.1, ..Delay::default() }, ..ChannelModel::default() };
    let radio = Radio { seed: 3, channel: air, ..Radio::default() };
    let delivery = |frame: AirFrame| radio.delivery(&frame, DroneId(1), Vec2::zeros(), 20_000_000);
    let due = SimTime(5 * 20_000_000 + 3_000_000 + 100_000_000);
    assert_eq!(delivery(AirFrame { queue_ns: 3_000_000, ..sent(5, 0, 0) }), Delivery::Deliver { due, again: None });
    assert_eq!(delivery(AirFrame { queue_ns: NEVER_TRANSMITTED, ..sent(5, 0, 0) }), Delivery::Drop(DropReason::Queue));
}
