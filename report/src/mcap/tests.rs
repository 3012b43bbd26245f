//! Writes recordings and reads them back, with this crate and with the MCAP library.

use super::draw::Drones;
use super::foxglove::Time;
use super::writer::{TOPICS, Topic};
use super::{McapWriter, read};
use crate::facts::RunFacts;
use crate::files::RECORDING;
use crate::folder::RunFolder;
use crate::interruption::Interrupted;
use crate::scene::{Sample, State};
use crate::testing::{facts, row};
use crate::topic_schema::TopicSchema;
use skein_protocol::DroneId;
use skein_protocol::SimTime;
use skein_protocol::frame::AirFrame;
use skein_protocol::record::{
    DroneRow, EventKind, FaultKind, Outcome, ROW_LEADS, RecordHeader, RecordView, RunEvent, Totals,
};
use skein_protocol::shape::ConvexShape;
use skein_protocol::telemetry::{Telemetry, TelemetryRow};
use skein_protocol::{GroupId, Message, MetricName, ShortText, TopicName, UserMessage, Vec2};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

fn facts_with_obstacle() -> RunFacts {
    let block = ConvexShape::rectangle(Vec2::new(60.0, 20.0), Vec2::new(5.0, 15.0), 0.3).unwrap();
    RunFacts { obstacles: vec![block], ..facts(3) }
}

/// Records two seconds of three drones. All wall times are `wall`.
fn record(folder: &Path, wall: u32) -> PathBuf {
    let path = folder.join(RECORDING);
    let (file, scenario) = (std::fs::File::create(&path).unwrap(), serde_json::json!({"name": "s1"}));
    let mut writer = McapWriter::new(file, path.clone(), &facts_with_obstacle(), &scenario).unwrap();
    for tick in 0..100u64 {
        let rows: Vec<DroneRow> = (0..3)
            .map(|drone| {
                let leads = if drone == 1 { ROW_LEADS } else { 0 };
                let at = row(tick as f64 * 0.2, f64::from(drone) * 30.0);
                DroneRow { step_ns: wall, group: GroupId::ALL.child(1), flags: at.flags | leads, ..at }
            })
            .collect();
        let head = RecordHeader { tick, now: SimTime((tick as i64 + 1) * 20_000_000), ..RecordHeader::default() };
        let events = events(tick, wall);
        writer
            .take(RecordView { head: &head, rows: &rows, frames: &[], telemetry: &[], events: &[] }, &events)
            .unwrap();
    }
    writer.finish().unwrap();
    path
}

fn events(tick: u64, wall: u32) -> Vec<RunEvent> {
    let totals = Totals { wall_s: f64::from(wall), ..Totals::default() };
    let what = match tick {
        40 => EventKind::Fault { kind: FaultKind::Kill, target: DroneId(2), scheduled: true, detail: "asked".into() },
        99 => EventKind::End {
            outcome: Outcome::Reached,
            reason: "there".into(),
            stuck: Vec::new(),
            unfinished: Vec::new(),
            standstill_s: None,
            totals: Box::new(totals),
        },
        _ => return Vec::new(),
    };
    vec![RunEvent { t_s: (tick + 1) as f64 * 0.02, what }]
}

#[test]
fn equal_runs_make_equal_files() {
    let (one, other) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let bytes = |path: PathBuf| std::fs::read(path).unwrap();
    assert!(bytes(record(one.path(), 7)) == bytes(record(other.path(), 8000)), "wall times are in the recording");
}

#[test]
fn the_mcap_library_finds_topics_schemas_and_the_scenario() {
    let folder = tempfile::tempdir().unwrap();
    let bytes = std::fs::read(record(folder.path(), 1)).unwrap();
    let summary = ::mcap::Summary::read(&bytes).unwrap().unwrap();
    let mut topics: Vec<&str> = summary.channels.values().map(|channel| channel.topic.as_str()).collect();
    topics.sort_unstable();
    let mut wanted = TOPICS.to_vec();
    wanted.sort_unstable();
    assert_eq!(topics, wanted);
    for channel in summary.channels.values() {
        let schema = channel.schema.as_ref().unwrap();
        assert_eq!((channel.message_encoding.as_str(), schema.encoding.as_str()), ("json", "jsonschema"));
        let text = String::from_utf8(schema.data.to_vec()).unwrap();
        assert!(!text.contains("$ref"), "{}: {text}", schema.name);
    }
    let attachment = ::mcap::read::attachment(&bytes, &summary.attachment_indexes[0]).unwrap();
    let scenario: serde_json::Value = serde_json::from_slice(&attachment.data).unwrap();
    assert_eq!((attachment.name.as_str(), &scenario["name"]), ("scenario.json", &serde_json::json!("s1")));
    let counts = &summary.stats.unwrap().channel_message_counts;
    let count =
        |topic: Topic| counts.iter().find(|(id, _)| summary.channels[id].topic == TOPICS[topic as usize]).unwrap().1;
    assert_eq!((*count(Topic::State), *count(Topic::Scene), *count(Topic::Log), *count(Topic::Events)), (20, 6, 2, 2));
}

#[test]
fn what_pilots_say_is_recorded_as_bytes_and_their_figures_by_drone() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(RECORDING);
    let file = std::fs::File::create(&path).unwrap();
    let mut writer = McapWriter::new(file, path.clone(), &facts(1), &serde_json::Value::Null).unwrap();
    let said = UserMessage::new(TopicName::new("gossip").unwrap(), b"hello").unwrap();
    let frame = AirFrame {
        tick: 0,
        source: DroneId(0),
        sequence: 3,
        position_m: [0.0; 3],
        queue_ns: 0,
        link_faults: Default::default(),
        frame: Message::User(said).encode(),
    };
    let metric = Telemetry::Metric { name: MetricName::new("order").unwrap(), value: 0.5 };
    let telemetry = [TelemetryRow::new(DroneId(0), &metric).unwrap()];
    let (head, rows) = (RecordHeader { now: SimTime(20_000_000), ..RecordHeader::default() }, [row(0.0, 0.0)]);
    let record = RecordView { head: &head, rows: &rows, frames: &[frame], telemetry: &telemetry, events: &[] };
    writer.take(record, &[]).unwrap();
    writer.finish().unwrap();
    let bytes = std::fs::read(&path).unwrap();
    let found: BTreeMap<String, Vec<u8>> = ::mcap::MessageStream::new(&bytes)
        .unwrap()
        .map(Result::unwrap)
        .map(|message| (message.channel.topic.clone(), message.data.to_vec()))
        .collect();
    assert_eq!(found["/pilots/gossip"], b"\0\0\0\0hello");
    let metrics: serde_json::Value = serde_json::from_slice(&found["/skein/metrics"]).unwrap();
    assert_eq!(metrics, serde_json::json!({"t_s": 0.02, "metrics": {"order": {"0": 0.5}}}));
}

#[test]
fn messages_of_a_topic_with_a_schema_have_a_channel_for_each_drone() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(RECORDING);
    let file = std::fs::File::create(&path).unwrap();
    let topics = vec![TopicSchema { topic: "state".to_owned(), schema: serde_json::json!({"type": "object"}) }];
    let facts = RunFacts { topics, ..facts(2) };
    let mut writer = McapWriter::new(file, path.clone(), &facts, &serde_json::Value::Null).unwrap();
    let said = |source, bytes: &[u8]| AirFrame {
        tick: 0,
        source: DroneId(source),
        sequence: 3,
        position_m: [0.0; 3],
        queue_ns: 0,
        link_faults: Default::default(),
        frame: Message::User(UserMessage::new(TopicName::new("state").unwrap(), bytes).unwrap()).encode(),
    };
    let frames = [said(0, b"{\"mode\": 1}"), said(1, b"{\"mode\": 2}"), said(1, b"no object")];
    let (head, rows) = (RecordHeader { now: SimTime(20_000_000), ..RecordHeader::default() }, [row(0.0, 0.0); 2]);
    let record = RecordView { head: &head, rows: &rows, frames: &frames, telemetry: &[], events: &[] };
    writer.take(record, &[]).unwrap();
    writer.finish().unwrap();
    let bytes = std::fs::read(&path).unwrap();
    let messages = ::mcap::MessageStream::new(&bytes).unwrap().map(Result::unwrap);
    let of_pilots: BTreeMap<String, (Option<String>, Vec<u8>)> = messages
        .filter(|message| message.channel.topic.starts_with("/pilots/"))
        .map(|message| {
            let schema = message.channel.schema.as_ref().map(|schema| schema.name.clone());
            (message.channel.topic.clone(), (schema, message.data.to_vec()))
        })
        .collect();
    let schema = Some("pilots.state".to_owned());
    assert_eq!(of_pilots["/pilots/state/0"], (schema.clone(), b"{\"mode\": 1}".to_vec()));
    assert_eq!(of_pilots["/pilots/state/1"], (schema, b"{\"mode\": 2}".to_vec()));
    assert_eq!(of_pilots["/pilots/state"], (None, b"\x01\0\0\0no object".to_vec()));
}

#[test]
fn marks_of_pilots_are_in_the_scene_until_they_are_gone_and_read_back() {
    let root = tempfile::tempdir().unwrap();
    let folder = RunFolder::at(&root.path().join("run"), false).unwrap();
    let path = folder.path().join(RECORDING);
    let file = std::fs::File::create(&path).unwrap();
    let mut writer = McapWriter::new(file, path.clone(), &facts(1), &serde_json::Value::Null).unwrap();
    let label = ShortText::cut("goal");
    let shown = [
        Telemetry::Mark { label, point_m: [1.0, 2.0, 3.0] },
        Telemetry::Line { label: ShortText::default(), from_m: [0.0; 3], to_m: [4.0, 5.0, 6.0] },
    ];
    let shown = shown.map(|what| TelemetryRow::new(DroneId(0), &what).unwrap());
    for tick in 0..20u64 {
        let now = SimTime((tick as i64 + 1) * 20_000_000);
        let (head, rows) = (RecordHeader { tick, now, ..RecordHeader::default() }, [row(0.0, 0.0)]);
        // Shown for a tick between two samples only.
        let telemetry = if tick == 2 { &shown[..] } else { &[] };
        writer.take(RecordView { head: &head, rows: &rows, frames: &[], telemetry, events: &[] }, &[]).unwrap();
    }
    writer.finish().unwrap();
    let mut samples = Vec::new();
    let take = |sample: Sample| {
        samples.push(sample.shown);
        Ok(())
    };
    read(&folder, &Interrupted::never(), take, |_| {}).unwrap();
    assert_eq!(
        (samples.len(), samples[0].marks[0].at_m, samples[0].lines[0].to_m),
        (4, [1.0, 2.0, 3.0], [4.0, 5.0, 6.0])
    );
    assert!(samples[1..].iter().all(|shown| shown.is_empty()));
    let bytes = std::fs::read(&path).unwrap();
    let scenes = ::mcap::MessageStream::new(&bytes).unwrap().map(Result::unwrap);
    let scenes = scenes.filter(|message| message.channel.topic == "/scene");
    let entities = scenes.flat_map(|message| {
        let scene: serde_json::Value = serde_json::from_slice(&message.data).unwrap();
        scene["entities"].as_array().unwrap().clone()
    });
    let marks: Vec<_> = entities.filter(|entity| entity["id"] == "marks").collect();
    let count = |entity: &serde_json::Value, kind: &str| entity[kind].as_array().unwrap().len();
    let counts: Vec<_> = marks.iter().map(|m| ["spheres", "lines", "texts"].map(|kind| count(m, kind))).collect();
    assert_eq!(counts, [[1, 1, 1], [0, 0, 0]]);
}

#[test]
fn messages_hold_the_positions_of_the_drones() {
    let folder = tempfile::tempdir().unwrap();
    let bytes = std::fs::read(record(folder.path(), 1)).unwrap();
    let mut last = BTreeMap::new();
    for message in ::mcap::MessageStream::new(&bytes).unwrap().map(Result::unwrap) {
        let json: serde_json::Value = serde_json::from_slice(&message.data).unwrap();
        last.insert(message.channel.topic.clone(), (message.log_time, json));
    }
    let (time, state) = &last["/skein/state"];
    assert_eq!((*time, state["x_m"][2].as_f64(), state["leads"][1].as_str()), (2_000_000_000, Some(19.8), Some("N")));
    let (_, transforms) = &last["/tf"];
    assert_eq!(transforms["transforms"][2]["child_frame_id"], "drone_2");
    assert_eq!(transforms["transforms"][2]["translation"]["y"], 60.0);
    let (_, scene) = &last["/scene"];
    let ids: Vec<_> = scene["entities"].as_array().unwrap().iter().map(|entity| entity["id"].clone()).collect();
    assert_eq!(ids, ["danger zones", "slots", "radio links"]);
    assert_eq!(last["/log"].1["message"], "reached: there");
}

#[test]
fn a_truncated_recording_reads_back() {
    let root = tempfile::tempdir().unwrap();
    let folder = RunFolder::at(&root.path().join("run"), false).unwrap();
    let path = record(folder.path(), 1);
    let read_back = || {
        let (mut times, mut events) = (Vec::new(), Vec::new());
        let sample = |sample: Sample| {
            times.push(sample.state.t_s);
            Ok(())
        };
        read(&folder, &Interrupted::never(), sample, |event| events.push(event)).unwrap();
        (times, events)
    };
    let (times, events) = read_back();
    assert_eq!((times.len(), times[0], times[19]), (20, 0.1, 2.0));
    assert!(matches!(events[0].what, EventKind::Fault { target: DroneId(2), .. }));
    let bytes = std::fs::read(&path).unwrap();
    std::fs::write(&path, &bytes[..bytes.len() - 30]).unwrap();
    assert_eq!(read_back().0.len(), 20);
}

#[test]
fn a_drone_is_sent_again_only_if_its_look_changes() {
    let state = |alive: u8| State {
        x_m: vec![0.0; 2],
        group: vec!["N".to_owned(), "N1".to_owned()],
        leads: vec![None, Some("N1".to_owned())],
        alive: vec![1, alive],
        ..State::default()
    };
    let mut drones = Drones::default();
    let mut changed = |alive| drones.changed(&state(alive), Time::default()).map(|update| update.entities);
    let first = changed(1).unwrap();
    assert_eq!(
        (first.len(), first[1].frame_id.as_str(), first[1].texts[0].text.as_str()),
        (2, "drone_1", "1 leads N1")
    );
    assert!(changed(1).is_none());
    let dead = changed(0).unwrap();
    assert_eq!((dead.len(), dead[0].texts[0].text.as_str()), (1, "1 dead"));
}
