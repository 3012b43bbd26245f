//! What the radio did in a flight, in the counters and in the record: they agree to the frame.
#![allow(clippy::unwrap_used)]

use skein_protocol::SimTime;
use skein_protocol::radio::{DROP_REASONS, Delivery, DropReason, Radio};
use skein_protocol::record::{EventKind, RecordSink, RecordView, RunEvent, SinkError, Totals};
use skein_runtime::{inline, mission};
use skein_scenario::{Scenario, ScenarioSource};

fn scenario(sets: &[(&str, &str)]) -> Scenario {
    let path = format!("{}/../scenarios/paper/s2-right.toml", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(&path).unwrap();
    let sets: Vec<_> = sets.iter().map(|(key, value)| ((*key).to_owned(), (*value).to_owned())).collect();
    Scenario::parse(&text, ScenarioSource { name: &path, stem: "s2-right" }, &sets)
        .unwrap_or_else(|errors| panic!("{errors}"))
}

/// Looks every frame's fate up in the records, but for the last tick's: those are on the air when the mission ends.
struct Lookup {
    radio: Radio,
    dt_ns: i64,
    verdicts: Vec<Delivery>,
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
        self.verdicts.append(&mut self.last_tick);
        self.last_tick = self.radio.deliveries(record, self.dt_ns).map(|(_, _, verdict)| verdict).collect();
        self.opened = SimTime(record.head.tick as i64 * self.dt_ns);
        Ok(())
    }
}

/// Flies ten seconds; the counters must be what the record tells.
fn fly(sets: &[(&str, &str)]) -> Totals {
    let scenario = scenario(&[sets, &[("time.timeout_s", "10")]].concat());
    let (radio, dt_ns) = (scenario.radio(), mission::dt_ns(&scenario));
    let mut lookup =
        Lookup { radio, dt_ns, verdicts: Vec::new(), last_tick: Vec::new(), opened: SimTime::ZERO, totals: None };
    let end = inline::run(&scenario, &mut lookup, || None).unwrap();
    assert_eq!(end.sink_error, None);
    let (totals, by) = (lookup.totals.unwrap(), lookup.opened);
    let mut dropped = [0u64; DROP_REASONS];
    let (mut delivered, mut duplicates) = (0, 0);
    for verdict in lookup.verdicts {
        match verdict {
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
fn every_drop_is_counted_by_its_reason_and_found_in_the_record() {
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
fn every_preset_flies_and_tells_what_it_does() {
    for preset in ["ideal", "wifi", "mesh-lossy", "lte", "jammed", "satellite"] {
        let totals = fly(&[("radio.preset", preset)]);
        let lost = totals.dropped.iter().sum::<u64>() > 0;
        assert_eq!(lost, preset != "ideal", "{preset}: {:?}", totals.dropped);
    }
}
