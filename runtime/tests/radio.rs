//! The counters of the radio agree with the record, to the frame.
#![allow(clippy::unwrap_used, reason = "a test fails where it cannot go on")]

mod support;

use skein_protocol::SimTime;
use skein_protocol::radio::{DROP_REASONS, Delivery, DropReason, Radio};
use skein_protocol::record::{EventKind, RecordSink, RecordView, RunEvent, SinkError, Totals};
use skein_runtime::{PilotRegistry, inline, mission};
use support::scenario;

/// Computes the delivery of every recorded frame. The frames of the last tick do not count: they have not arrived when the
/// mission ends.
struct Lookup {
    radio: Radio,
    dt_ns: i64,
    deliveries: Vec<Delivery>,
    last_tick: Vec<Delivery>,
    /// When the last tick opened.
    opened: SimTime,
    totals: Option<Totals>,
}

impl RecordSink for Lookup {
    fn take(&mut self, record: RecordView<'_>) -> Result<(), SinkError> {
        let parse = |line: &[u8]| serde_json::from_slice::<RunEvent>(line);
        for event in record.parse_events(parse).map_err(|error| error.to_string())? {
            if let EventKind::End { totals, .. } = event.what {
                self.totals = Some(*totals);
                return Ok(());
            }
        }
        self.deliveries.append(&mut self.last_tick);
        self.last_tick = self.radio.deliveries(record, self.dt_ns).map(|(_, _, delivery)| delivery).collect();
        self.opened = SimTime(record.head.tick as i64 * self.dt_ns);
        Ok(())
    }
}

/// Flies for ten seconds. The counters must equal what the record gives.
fn fly(sets: &[(&str, &str)]) -> Totals {
    let scenario = scenario("paper/s2-right", &[sets, &[("time.timeout_s", "10")]].concat());
    let (radio, dt_ns) = (scenario.radio(), mission::dt_ns(&scenario));
    let mut lookup =
        Lookup { radio, dt_ns, deliveries: Vec::new(), last_tick: Vec::new(), opened: SimTime::ZERO, totals: None };
    let end = inline::run(&scenario, &PilotRegistry::built_in().unwrap(), &mut lookup, || None).unwrap();
    assert_eq!(end.sink_error, None);
    let (totals, by) = (lookup.totals.unwrap(), lookup.opened);
    let mut dropped = [0u64; DROP_REASONS];
    let (mut delivered, mut duplicates) = (0, 0);
    for delivery in lookup.deliveries {
        match delivery {
            Delivery::Drop(reason) => dropped[reason as usize] += 1,
            Delivery::Deliver { due, again } => {
                delivered += u64::from(due <= by);
                duplicates += u64::from(again.is_some_and(|again| again <= by));
            }
        }
    }
    assert_eq!((dropped, delivered, duplicates), (totals.dropped, totals.delivered, totals.duplicates), "{sets:?}");
    assert!(delivered > 1000, "{totals:?}");
    totals
}

#[test]
fn the_counters_agree_for_every_reason_to_drop_a_frame() {
    let count = |totals: &Totals, reason: DropReason| totals.dropped[reason as usize];
    let ideal = fly(&[]);
    assert_eq!((ideal.dropped, ideal.duplicates), ([0; DROP_REASONS], 0));
    let lossy = fly(&[("radio.loss", "0.2"), ("radio.duplicate", "0.1"), ("radio.burst.share", "0.1")]);
    assert!(count(&lossy, DropReason::Loss) > 0 && count(&lossy, DropReason::Burst) > 0 && lossy.duplicates > 0);
    let far = fly(&[("radio.range_m", "150"), ("radio.shadowing_db", "4"), ("radio.delay_s", "0.3")]);
    assert!(count(&far, DropReason::Range) > 0 && count(&far, DropReason::Loss) == 0);
    let narrow = fly(&[("radio.rate_bps", "60000"), ("radio.queue_limit_s", "0.2")]);
    assert!(count(&narrow, DropReason::Queue) > 0);
    let shares = [narrow.delivered, count(&narrow, DropReason::Queue)];
    assert!(narrow.delay_s.max.unwrap() > 0.2, "frames wait for the channel: {shares:?} {:?}", narrow.delay_s);
}

#[test]
fn the_counters_agree_with_every_preset() {
    for preset in ["ideal", "wifi", "mesh-lossy", "lte", "jammed", "satellite"] {
        let totals = fly(&[("radio.preset", preset)]);
        let lost = totals.dropped.iter().sum::<u64>() > 0;
        assert_eq!(lost, preset != "ideal", "{preset}: {:?}", totals.dropped);
    }
}
