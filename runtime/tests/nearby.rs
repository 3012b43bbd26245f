//! A drone receives and counts the same frames whether the downlink sorts them by place or not, and whether receivers share memory or not.

use proptest::prelude::*;
use skein_pilot::{Command, Inbox, Out, Pilot, Senses};
use skein_protocol::downlink::{Downlink, SensesHeader};
use skein_protocol::frame::AirFrame;
use skein_protocol::message::Topic;
use skein_protocol::payload::Leadership;
use skein_protocol::radio::{ChannelModel, Delay, Radio, Range, Rule};
use skein_protocol::slot::{LinkStats, Slot};
use skein_protocol::{DroneId, Message, SimTime};
use skein_runtime::{HostParams, PilotHost, StepScratch};

/// A pilot that does nothing.
struct Idle;

impl Pilot for Idle {
    fn step(&mut self, _: &Senses<'_>, _: &Inbox<'_>, _: &mut Out) -> Command {
        Command::default()
    }
}

fn message(leads: bool) -> Message {
    if leads {
        Message::Leadership(Leadership { kind: 1, ..bytemuck::Zeroable::zeroed() })
    } else {
        Message::Pose(bytemuck::Zeroable::zeroed())
    }
}

fn downlink(points: &[([f64; 2], bool)]) -> Downlink {
    let sense = |&([x, y], _): &([f64; 2], bool)| SensesHeader {
        position_m: [x, y, 50.0],
        alive: 1,
        ..SensesHeader::default()
    };
    let frame = |(&([x, y], leads), id): (&([f64; 2], bool), u32)| AirFrame {
        source: DroneId(id),
        position_m: [x, y, 50.0],
        frame: message(leads).encode(),
        ..bytemuck::Zeroable::zeroed()
    };
    let (drones, frames) = (points.iter().map(sense).collect(), points.iter().zip(0..).map(frame).collect());
    let mut down = Downlink { drones, frames, ..Downlink::default() };
    down.seal(1, SimTime(20_000_000));
    down
}

fn receive(me: u32, radio: &Radio, down: &Downlink) -> (Slot, LinkStats) {
    let params = HostParams { me: DroneId(me), dt_s: 0.02, velocity_gain_per_s: 1.0 };
    let mut pilot_host = PilotHost::new(params, radio.clone(), Box::new(Idle));
    let (mut slot, mut stats) = (Slot::default(), LinkStats::default());
    pilot_host.step(&down.view(), &mut StepScratch::default(), &mut slot, &mut stats);
    (slot, stats)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]
    #[test]
    fn a_drone_receives_the_same_from_a_sorted_downlink(
        points in prop::collection::vec(([-300f64..300.0, -300f64..300.0], any::<bool>()), 40..120),
        far in 0u32..40,
        loss in 0.0..0.5,
    ) {
        let short = Range { half_m: 80.0, shadowing_db: 0.0, exponent: 2.0 };
        let air = ChannelModel { loss, range: Some(short), ..ChannelModel::default() };
        let leading = Rule { topics: Some([Topic::Leadership].into()), channel: ChannelModel { range: None, ..air }, ..Rule::default() };
        let base = Rule { to: Some([DroneId(far)].into()), channel: ChannelModel { range: None, ..air }, ..Rule::default() };
        let radio = Radio { seed: 7, channel: air, rules: vec![leading, base], ..Radio::default() };
        let plain = downlink(&points);
        let mut sorted = plain.clone();
        sorted.index.build(radio.locality(), &sorted.frames);
        sorted.seal(1, SimTime(20_000_000));
        prop_assert!(sorted.index.locality.topics != 0);
        for me in 0..points.len() as u32 {
            let (expected, found) = (receive(me, &radio, &plain), receive(me, &radio, &sorted));
            prop_assert_eq!(expected.0, found.0);
            prop_assert!(expected.1 == found.1);
        }
    }
}

/// Frames of the same places in the list are valid in one tick and not in the next, and each receiver finds out.
#[test]
fn receivers_that_share_memory_find_the_same_malformed_frames_as_those_that_do_not() {
    for mean_s in [0.0, 0.05] {
        let channel = ChannelModel { delay: Delay { mean_s, ..Delay::default() }, ..ChannelModel::default() };
        let radio = Radio { seed: 7, channel, ..Radio::default() };
        let hosts = || {
            let params = |me| HostParams { me: DroneId(me), dt_s: 0.02, velocity_gain_per_s: 1.0 };
            (0..3).map(|me| PilotHost::new(params(me), radio.clone(), Box::new(Idle))).collect::<Vec<_>>()
        };
        let (mut together, mut apart) = (hosts(), hosts());
        let (mut shared, mut malformed, mut heard) = (StepScratch::default(), 0, 0);
        for tick in 1..12_u64 {
            let mut down = downlink(&[([0.0; 2], false), ([9.0; 2], false), ([20.0; 2], false)]);
            for (frame, id) in down.frames.iter_mut().zip(0..) {
                (frame.tick, frame.sequence) = (tick - 1, tick as u32);
                if (tick + id).is_multiple_of(3) {
                    frame.frame.payload[8..16].copy_from_slice(&f64::NAN.to_le_bytes());
                }
            }
            down.seal(tick, SimTime(tick as i64 * 20_000_000));
            for (host, alone) in together.iter_mut().zip(&mut apart) {
                let (mut slots, mut stats) = ([Slot::default(); 2], [LinkStats::default(), LinkStats::default()]);
                host.step(&down.view(), &mut shared, &mut slots[0], &mut stats[0]);
                alone.step(&down.view(), &mut StepScratch::default(), &mut slots[1], &mut stats[1]);
                assert_eq!(slots[0], slots[1], "tick {tick}");
                assert!(stats[0] == stats[1], "tick {tick}");
                malformed += stats[1].malformed;
                heard += u64::from(slots[1].heard);
            }
        }
        assert!(malformed > 10 && heard > 2 * malformed - 10, "{malformed} malformed, {heard} heard");
    }
}
