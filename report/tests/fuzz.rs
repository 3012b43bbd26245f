//! No content of a run's folder causes a panic: each reader returns what it could read, or an error. `PROPTEST_CASES` sets the number
//! of cases.
#![allow(clippy::unwrap_used, reason = "a test fails where it cannot go on")]

use proptest::prelude::*;
use skein_protocol::formation::Shape;
use skein_protocol::record::{DroneRow, Outcome, ROW_ALIVE, RecordHeader, RecordSink, RecordView};
use skein_protocol::shape::ConvexShape;
use skein_protocol::{SimTime, Vec2};
use skein_report::{
    DataFiles, FlightRecord, Interrupted, Manifest, MissionEnd, Recorder, RunCompletion, RunFacts, RunFolder, page,
};
use std::fs;
use std::num::NonZero;
use std::path::Path;
use std::sync::LazyLock;

/// The files that are changed. Those from `trace.csv` on are made from the record.
const FILES: [&str; 6] = ["manifest.json", "summary.json", "flight.spool", "trace.csv", "events.jsonl", "run.mcap"];

fn facts() -> RunFacts {
    RunFacts {
        scenario: "fuzz".to_owned(),
        strategy: "congestion-aware".to_owned(),
        seed: 1,
        runtime: "inline".to_owned(),
        clock: "lockstep".to_owned(),
        drones: 2,
        dt_s: 0.1,
        shape: Shape::Line,
        spacing_m: 30.0,
        end: MissionEnd::Hold,
        course: skein_protocol::Course::East,
        course_y_m: 0.0,
        safe_distance_m: 25.0,
        clearance_m: 15.0,
        planning_distance_m: 20.0,
        arrival_error_m: 0.8,
        radio_range_m: None,
        pilots: Vec::new(),
        obstacles: vec![ConvexShape::circle(Vec2::new(50.0, 0.0), 10.0).unwrap()],
        topics: vec![],
        scene: Default::default(),
    }
}

/// The files of a short recorded run, by name. The record is among them, as if the launcher had been killed.
fn recorded() -> Vec<(&'static str, Vec<u8>)> {
    let root = tempfile::tempdir().unwrap();
    let folder = RunFolder::at(&root.path().join("run"), false).unwrap();
    let manifest = Manifest::new(facts(), serde_json::json!({}), "0", None);
    folder.begin(&manifest).unwrap();
    let mut recorder = Recorder::in_folder(facts(), &folder).unwrap();
    for tick in 0..8 {
        let head = RecordHeader { tick, now: SimTime::from_secs(0.1), rows: 2, ..RecordHeader::default() };
        let rows = [DroneRow { flags: ROW_ALIVE, energy_j: tick as f64, ..DroneRow::default() }; 2];
        let events = format!("{{\"t_s\":{tick}.0,\"event\":\"passed\",\"stage\":0}}\n");
        let head = RecordHeader { events_len: events.len() as u32, ..head };
        let view = RecordView { head: &head, rows: &rows, frames: &[], telemetry: &[], events: events.as_bytes() };
        recorder.take(view).unwrap();
    }
    let (summary, record) = recorder.finish(&completion());
    folder.write_summary(&summary).unwrap();
    let record = record.unwrap();
    record.write_files(&manifest, &Interrupted::never()).unwrap();
    let read = |name| (name, fs::read(folder.path().join(name)).unwrap());
    FILES.map(read).into()
}

fn completion() -> RunCompletion {
    RunCompletion { fallback: Outcome::Aborted, wall_s: None, startup_s: None }
}

/// Reads everything that a folder holds, as `skein report` does.
fn read(path: &Path) {
    let never = Interrupted::never();
    let Ok(folder) = RunFolder::open(path) else { return };
    let Ok(manifest) = folder.read_manifest() else { return };
    let record = FlightRecord::left_in(&folder).unwrap();
    if let Some(record) = &record {
        let _ = record.summary(&manifest.facts, &never);
    }
    let Ok(summary) = folder.read_summary() else { return };
    let _ = skein_report::text::summary(&summary, false);
    let _ = page::write(&folder, &manifest, &summary, &never);
    let data = DataFiles { every: NonZero::new(2), messages: true, parquet: false };
    let _ = data.write(&folder, &manifest.facts, &never);
    if let Some(record) = record {
        let _ = record.write_files(&manifest, &never);
    }
}

/// A change of a file: bytes that are written over those at a place, or a cut there.
#[derive(Clone, Debug)]
enum Change {
    Over(prop::sample::Index, Vec<u8>),
    Cut(prop::sample::Index),
}

fn change() -> impl Strategy<Value = Change> {
    let words =
        ["null", "-1", "1e999", "18446744073709551616", "\"\"", "[]", "{}", ",", "\n", "NaN", "\u{1b}[2J", "9", "-"];
    let numbers = [f64::NAN, f64::INFINITY, -1e300, 1e18, 5e-324];
    let bytes = prop_oneof![
        prop::sample::select(words.to_vec()).prop_map(|word| word.as_bytes().to_vec()),
        prop::sample::select(numbers.to_vec()).prop_map(|value| value.to_le_bytes().to_vec()),
        prop::collection::vec(any::<u8>(), 1..9),
    ];
    prop_oneof![
        8 => (any::<prop::sample::Index>(), bytes).prop_map(|(place, bytes)| Change::Over(place, bytes)),
        1 => any::<prop::sample::Index>().prop_map(Change::Cut),
    ]
}

impl Change {
    fn apply(&self, content: &mut Vec<u8>) {
        match self {
            _ if content.is_empty() => {}
            Self::Over(place, bytes) => {
                let place = place.index(content.len());
                let end = (place + bytes.len()).min(content.len());
                content.splice(place..end, bytes.iter().copied());
            }
            Self::Cut(place) => content.truncate(place.index(content.len())),
        }
    }
}

static RECORDED: LazyLock<Vec<(&str, Vec<u8>)>> = LazyLock::new(recorded);

/// What has to be done to which file.
fn folders() -> impl Strategy<Value = (usize, Vec<Change>, bool)> {
    (0..FILES.len(), prop::collection::vec(change(), 1..5), any::<bool>())
}

proptest! {
    #[test]
    fn run_folders((file, changes, with_record) in folders()) {
        let root = tempfile::tempdir().unwrap();
        for (place, (name, content)) in RECORDED.iter().enumerate() {
            let mut content = content.clone();
            if place == file {
                changes.iter().for_each(|change| change.apply(&mut content));
            }
            if with_record || *name != "flight.spool" {
                fs::write(root.path().join(name), content).unwrap();
            }
        }
        read(root.path());
    }
}
