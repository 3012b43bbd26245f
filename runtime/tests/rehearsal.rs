//! A leader that rehearses: what it foresees is what happens.
#![allow(clippy::unwrap_used)]

use skein_protocol::record::{Happening, Outcome, RecordSink, RecordView, RunEvent};
use skein_runtime::inline;
use skein_scenario::{Scenario, Source};

/// What the record tells of one avoided obstacle.
#[derive(Default)]
struct Watch {
    detected_s: f64,
    planned_s: f64,
    predicted_s: f64,
    passed_s: f64,
    outcome: Option<Outcome>,
    digest: u64,
}

impl RecordSink for Watch {
    fn take(&mut self, record: RecordView<'_>) -> Result<(), String> {
        self.digest = record.head.digest;
        let parse = |line: &[u8]| serde_json::from_slice::<RunEvent>(line).map_err(|error| error.to_string());
        for event in record.parse_events(parse)? {
            match event.what {
                Happening::Detected { .. } => self.detected_s = event.t_s,
                Happening::Grouping { predicted_s: Some(predicted_s), .. } => {
                    (self.planned_s, self.predicted_s) = (event.t_s, predicted_s);
                }
                Happening::Passed { .. } => self.passed_s = event.t_s,
                Happening::End { outcome, .. } => self.outcome = Some(outcome),
                _ => {}
            }
        }
        Ok(())
    }
}

fn fly(name: &str) -> Watch {
    let path = format!("{}/../scenarios/paper/{name}.toml", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(&path).unwrap();
    let strategy = [("strategy".to_owned(), "congestion-aware-rehearsed".to_owned())];
    let scenario = Scenario::parse(&text, Source { name: &path, stem: name }, &strategy).unwrap();
    let mut watch = Watch::default();
    inline::run(&scenario, &mut watch, || None).unwrap();
    watch
}

#[test]
fn the_flight_is_as_rehearsed() {
    for name in ["s1-right", "s2-right", "s3b-right"] {
        let watch = fly(name);
        assert_eq!(watch.outcome, Some(Outcome::Reached), "{name}");
        // Rehearsing takes ticks: the paper's t_c.
        let taken_s = watch.planned_s - watch.detected_s;
        assert!((0.15..1.5).contains(&taken_s), "{name}: decided after {taken_s} s");
        let flown_s = watch.passed_s - watch.detected_s;
        // The forecast counts from when the rehearsal began.
        assert!((flown_s - watch.predicted_s).abs() < 0.5, "{name}: {} s foreseen, {flown_s} s", watch.predicted_s);
    }
}

#[test]
fn rehearsals_are_deterministic() {
    assert_eq!(fly("s2-right").digest, fly("s2-right").digest);
}
