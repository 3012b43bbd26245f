//! Writes run.mcap.

use crate::error::ReportError;
use crate::facts::RunFacts;
use crate::mcap::draw::{self, Drones};
use crate::mcap::foxglove::{
    FrameTransform, FrameTransforms, Log, Pose, PosesInFrame, Quaternion, SceneUpdate, Time, Vector3, WORLD,
};
use crate::scene::{EnergySample, Observer, RadioSample, Sample, Shown, State, event_text, rounded};
use crate::tuning::{FULL_RATE_DRONES, SAMPLE_RATE_HZ, SCENE_PERIOD};
use ::mcap::records::{MessageHeader, Metadata};
use ::mcap::{Attachment, McapResult, WriteOptions, Writer};
use schemars::JsonSchema;
use schemars::generate::SchemaSettings;
use serde::Serialize;
use skein_protocol::record::{EventKind, RecordView, RunEvent};
use skein_protocol::{DroneId, OWN_TOPIC, SimTime, TopicName, UserMessage};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::io::{Seek, Write};
use std::path::PathBuf;

/// Compression level of zstd: the fastest, because a run must not wait for its recording.
const COMPRESSION_LEVEL: u32 = 1;
/// Uncompressed size of a chunk, bytes.
const CHUNK_BYTES: u64 = 1 << 20;
/// The topics, in the order of [`Topic`].
pub(super) const TOPICS: [&str; 12] = [
    "/tf",
    "/drones",
    "/scene",
    "/log",
    "/skein/state",
    "/skein/energy",
    "/skein/radio",
    "/skein/groups",
    "/skein/leadership",
    "/skein/events",
    "/skein/metrics",
    "/skein/marks",
];

/// The topics of the recording, as indices of [`TOPICS`].
#[derive(Clone, Copy)]
#[repr(usize)]
pub(super) enum Topic {
    Transforms,
    Drones,
    Scene,
    Log,
    State,
    Energy,
    Radio,
    Groups,
    Leadership,
    Events,
    Metrics,
    Marks,
}

/// Writes run.mcap.
pub(crate) struct McapWriter<W: Write + Seek> {
    path: PathBuf,
    out: Writer<W>,
    /// The channel of each topic.
    channels: Vec<u16>,
    /// Number of messages on each topic so far.
    sequences: Vec<u32>,
    /// The channel of each topic that pilots define.
    own: BTreeMap<TopicName, u16>,
    /// The channel of each drone on each of these topics that has a schema.
    typed: BTreeMap<(TopicName, DroneId), u16>,
    facts: RunFacts,
    observer: Observer,
    /// Ticks from one sample to the next.
    stride: u64,
    /// Number of samples so far.
    samples: u64,
    drones: Drones,
    /// Buffer for the JSON of one message.
    json: Vec<u8>,
}

/// The figures that pilots reported in a tick.
#[derive(Clone, Debug, Default, Serialize, JsonSchema)]
struct MetricsSample {
    /// Simulated time, s.
    t_s: f64,
    /// The values by the figure's name and the drone's number.
    metrics: BTreeMap<String, BTreeMap<String, f64>>,
}

/// Ticks from one sample to the next.
fn stride(facts: &RunFacts) -> u64 {
    let rarer = (f64::from(facts.drones) / FULL_RATE_DRONES).max(1.0);
    (rarer / SAMPLE_RATE_HZ / facts.dt_s).round().max(1.0) as u64
}

impl<W: Write + Seek> McapWriter<W> {
    /// Begins a recording. `path` names its file in errors, `scenario` is the resolved scenario.
    pub(crate) fn new(
        out: W,
        path: PathBuf,
        facts: &RunFacts,
        scenario: &serde_json::Value,
    ) -> Result<Self, ReportError> {
        // With one thread, the bytes do not depend on the number of cores.
        let options = WriteOptions::new()
            .profile("skein")
            .chunk_size(Some(CHUNK_BYTES))
            .compression_level(COMPRESSION_LEVEL)
            .compression_threads(0);
        let out = options.create(out).map_err(ReportError::recording(&path))?;
        let mut writer = Self {
            out,
            channels: Vec::new(),
            sequences: vec![0; TOPICS.len()],
            stride: stride(facts),
            samples: 0,
            drones: Drones::default(),
            own: BTreeMap::new(),
            typed: BTreeMap::new(),
            json: Vec::new(),
            observer: Observer::new(facts.clone()),
            facts: facts.clone(),
            path,
        };
        writer.open(scenario).map_err(ReportError::recording(&writer.path))?;
        Ok(writer)
    }

    /// Takes the record of a tick and its events.
    pub(crate) fn take(&mut self, record: RecordView<'_>, events: &[RunEvent]) -> Result<(), ReportError> {
        let wanted = record.head.tick.wrapping_add(1).is_multiple_of(self.stride);
        let fresh = !record.rows.is_empty();
        let sample = self.observer.take(record, wanted);
        let written = sample
            .map_or(Ok(()), |sample| self.sample(&sample, record.head.now))
            .and_then(|()| if fresh { self.of_pilots(record) } else { Ok(()) })
            .and_then(|()| events.iter().try_for_each(|event| self.event(event)));
        written.map_err(ReportError::recording(&self.path))
    }

    /// Completes the file.
    pub(crate) fn finish(&mut self) -> Result<(), ReportError> {
        self.out.finish().map(|_| ()).map_err(ReportError::recording(&self.path))
    }

    /// Writes schemas, channels, metadata and all that does not move.
    fn open(&mut self, scenario: &serde_json::Value) -> McapResult<()> {
        let schemas = [
            ("foxglove.FrameTransforms", schema::<FrameTransforms>()),
            ("foxglove.PosesInFrame", schema::<PosesInFrame>()),
            ("foxglove.SceneUpdate", schema::<SceneUpdate>()),
            ("foxglove.Log", schema::<Log>()),
            ("skein.State", schema::<State>()),
            ("skein.Energy", schema::<EnergySample>()),
            ("skein.Radio", schema::<RadioSample>()),
        ];
        let event = ("skein.Event", serde_json::json!({"type": "object", "required": ["t_s", "event"]}));
        let events = std::iter::repeat_n(event, 3);
        let all = schemas
            .into_iter()
            .chain(events)
            .chain([("skein.Metrics", schema::<MetricsSample>()), ("skein.Marks", schema::<Shown>())]);
        for (topic, (name, schema)) in TOPICS.iter().zip(all) {
            let id = self.out.add_schema(name, "jsonschema", schema.to_string().as_bytes())?;
            self.channels.push(self.out.add_channel(id, topic, "json", &BTreeMap::new())?);
        }
        self.out.write_metadata(&Metadata { name: "run".to_owned(), metadata: metadata(&self.facts) })?;
        self.out.attach(&Attachment {
            log_time: 0,
            create_time: 0,
            name: "scenario.json".to_owned(),
            media_type: "application/json".to_owned(),
            data: Cow::Owned(serde_json::to_vec_pretty(scenario).unwrap_or_default()),
        })?;
        self.put(Topic::Scene, SimTime::ZERO, &draw::static_scene(&self.facts))
    }

    fn sample(&mut self, sample: &Sample, now: SimTime) -> McapResult<()> {
        let (at, state) = (Time::from(now), &sample.state);
        self.put(Topic::Transforms, now, &transforms(state, at))?;
        self.put(Topic::State, now, state)?;
        self.put(Topic::Energy, now, &sample.energy)?;
        if !sample.shown.is_empty() {
            self.put(Topic::Marks, now, &sample.shown)?;
        }
        self.put(Topic::Radio, now, &sample.radio)?;
        self.samples += 1;
        if let Some(changed) = self.drones.changed(state, at) {
            self.put(Topic::Scene, now, &changed)?;
        }
        if let Some(marks) = self.drones.marks(sample, at) {
            self.put(Topic::Scene, now, &marks)?;
        }
        if self.samples % SCENE_PERIOD == 1 {
            self.put(Topic::Drones, now, &poses(state, at))?;
            self.put(Topic::Scene, now, &draw::moving_scene(&self.facts, sample, at))?;
        }
        Ok(())
    }

    /// Writes what pilots say under topics of their own, as bytes, and the figures that they report.
    fn of_pilots(&mut self, record: RecordView<'_>) -> McapResult<()> {
        for frame in record.frames.iter().filter(|frame| frame.frame.kind & OWN_TOPIC != 0) {
            let Ok(message) = UserMessage::read(&frame.frame) else { continue };
            let typed = self.typed_channel(message, frame.source)?;
            let channel_id = typed.map_or_else(|| self.own_channel(*message.topic()), Ok)?;
            let sequence = frame.sequence;
            let time = record.head.now.0.max(0).unsigned_abs();
            let header = MessageHeader { channel_id, sequence, log_time: time, publish_time: time };
            self.json.clear();
            if typed.is_none() {
                self.json.extend_from_slice(&frame.source.0.to_le_bytes());
            }
            self.json.extend_from_slice(message.bytes());
            self.out.write_to_known_channel(&header, &self.json)?;
        }
        let mut sample = MetricsSample { t_s: record.head.now.secs(), ..MetricsSample::default() };
        for row in record.telemetry {
            let Some((name, value)) = row.metric() else { continue };
            sample.metrics.entry(name.as_str().to_owned()).or_default().insert(row.drone.0.to_string(), value);
        }
        if sample.metrics.is_empty() { Ok(()) } else { self.put(Topic::Metrics, record.head.now, &sample) }
    }

    /// The channel of a drone's messages on a topic that has a schema; `None` if there is no schema, or the message is no JSON
    /// object.
    fn typed_channel(&mut self, message: &UserMessage, source: DroneId) -> McapResult<Option<u16>> {
        let topic = *message.topic();
        let Some(known) = self.facts.topics.iter().find(|known| known.topic == topic.as_str()) else { return Ok(None) };
        if serde_json::from_slice::<serde_json::Map<String, serde_json::Value>>(message.bytes()).is_err() {
            return Ok(None);
        }
        if let Some(&channel) = self.typed.get(&(topic, source)) {
            return Ok(Some(channel));
        }
        let schema =
            self.out.add_schema(&format!("pilots.{topic}"), "jsonschema", known.schema.to_string().as_bytes())?;
        let channel =
            self.out.add_channel(schema, &format!("/pilots/{topic}/{}", source.0), "json", &BTreeMap::new())?;
        self.typed.insert((topic, source), channel);
        Ok(Some(channel))
    }

    /// The channel of a topic that pilots define. The messages on it have no schema.
    fn own_channel(&mut self, topic: TopicName) -> McapResult<u16> {
        if let Some(&channel) = self.own.get(&topic) {
            return Ok(channel);
        }
        let about =
            [("layout".to_owned(), "the sender's number (4 bytes, little-endian), then what it said".to_owned())];
        let channel =
            self.out.add_channel(0, &format!("/pilots/{topic}"), "application/octet-stream", &about.into())?;
        self.own.insert(topic, channel);
        Ok(channel)
    }

    fn event(&mut self, event: &RunEvent) -> McapResult<()> {
        let at = SimTime::from_secs(event.t_s);
        let level = match event_text::severity(event) {
            event_text::Severity::Info => 2,
            event_text::Severity::Warning => 3,
            event_text::Severity::Error => 4,
        };
        let (message, name) = (event_text::line(event), "world".to_owned());
        let file = String::new();
        self.put(Topic::Log, at, &Log { timestamp: at.into(), level, message, name, file, line: 0 })?;
        let topic = match event.what {
            EventKind::Leader { .. } => Topic::Leadership,
            EventKind::Grouping { .. } | EventKind::Assigned { .. } => Topic::Groups,
            _ => Topic::Events,
        };
        self.put(topic, at, &without_wall_time(event))
    }

    fn put(&mut self, topic: Topic, at: SimTime, message: &impl Serialize) -> McapResult<()> {
        self.json.clear();
        // Serialization cannot fail: all keys are strings, and the writer is a Vec.
        serde_json::to_writer(&mut self.json, message).map_err(std::io::Error::from)?;
        let time = at.0.max(0).unsigned_abs();
        let (channel_id, sequence) = (self.channels[topic as usize], self.sequences[topic as usize]);
        self.sequences[topic as usize] += 1;
        let header = MessageHeader { channel_id, sequence, log_time: time, publish_time: time };
        self.out.write_to_known_channel(&header, &self.json)
    }
}

/// The event without wall time, which the end event contains and a recording must not.
fn without_wall_time(event: &RunEvent) -> Cow<'_, RunEvent> {
    let mut event = Cow::Borrowed(event);
    if matches!(event.what, EventKind::End { .. })
        && let EventKind::End { totals, .. } = &mut event.to_mut().what
    {
        totals.wall_s = 0.0;
    }
    event
}

/// The main facts of the run as text.
fn metadata(facts: &RunFacts) -> BTreeMap<String, String> {
    let pairs = [
        ("scenario", facts.scenario.clone()),
        ("strategy", facts.strategy.clone()),
        ("seed", facts.seed.to_string()),
        ("drones", facts.drones.to_string()),
        ("dt_s", facts.dt_s.to_string()),
        ("safe_distance_m", facts.safe_distance_m.to_string()),
        ("clearance_m", facts.clearance_m.to_string()),
    ];
    pairs.into_iter().map(|(key, value)| (key.to_owned(), value)).collect()
}

/// A JSON schema without references: the viewers do not follow them.
fn schema<T: JsonSchema>() -> serde_json::Value {
    let settings = SchemaSettings::default().for_serialize().with(|settings| settings.inline_subschemas = true);
    settings.into_generator().into_root_schema_for::<T>().to_value()
}

/// Direction of flight, rad, counter-clockwise from x.
fn heading(state: &State, drone: usize) -> f64 {
    state.vy_mps[drone].atan2(state.vx_mps[drone])
}

fn transforms(state: &State, timestamp: Time) -> FrameTransforms {
    let transform = |drone: usize| FrameTransform {
        timestamp,
        parent_frame_id: WORLD.to_owned(),
        child_frame_id: format!("drone_{drone}"),
        translation: Vector3 { x: state.x_m[drone], y: state.y_m[drone], z: state.z_m[drone] },
        rotation: Quaternion::yaw(heading(state, drone)),
    };
    FrameTransforms { transforms: (0..state.x_m.len()).map(transform).collect() }
}

fn poses(state: &State, timestamp: Time) -> PosesInFrame {
    let pose =
        |drone: usize| Pose::new(rounded(state.x_m[drone]), rounded(state.y_m[drone]), 0.0, heading(state, drone));
    PosesInFrame { timestamp, frame_id: WORLD.to_owned(), poses: (0..state.x_m.len()).map(pose).collect() }
}
