//! run.mcap: a run for Foxglove, Lichtblick and whatever else reads MCAP. Holds no wall time: equal runs make equal files.
//!
//! | topic | schema | when |
//! |---|---|---|
//! | `/tf` | `foxglove.FrameTransforms`: a frame `drone_3` for each drone, in the frame `world` | every sample |
//! | `/drones` | `foxglove.PosesInFrame` | every fifth sample |
//! | `/scene` | `foxglove.SceneUpdate`: obstacles, hulls, routes; drones; danger zones, slots, radio links | once; when they change; every fifth sample |
//! | `/log` | `foxglove.Log` | every event |
//! | `/skein/state`, `/skein/energy`, `/skein/radio` | `skein.State`, … : JSON, see [`Sample`] | every sample |
//! | `/skein/groups`, `/skein/leadership`, `/skein/events` | `skein.Event`: a line of events.jsonl | every event |
//!
//! A sample is taken ten times a simulated second, in large swarms less often. The resolved scenario is the attachment
//! `scenario.json`; what was ordered, the metadata `run`.

mod draw;
mod foxglove;
mod read;
#[cfg(test)]
mod tests;

use crate::error::ReportError;
use crate::facts::RunFacts;
use crate::scene::{EnergySample, Observer, RadioSample, Sample, State, event_text, fine};
use ::mcap::records::{MessageHeader, Metadata};
use ::mcap::{Attachment, McapResult, WriteOptions, Writer};
use draw::Drones;
use foxglove::{FrameTransform, FrameTransforms, Log, Pose, PosesInFrame, SceneUpdate, Time, Vector3, WORLD};
use schemars::JsonSchema;
use schemars::generate::SchemaSettings;
use serde::Serialize;
use skein_protocol::SimTime;
use skein_protocol::record::{EventKind, RecordView, RunEvent};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

pub(crate) use read::read;

/// Name of the file in a run's folder.
pub(crate) const FILE: &str = "run.mcap";
/// Samples a simulated second.
const RATE_HZ: f64 = 10.0;
/// In a swarm of more drones than this, samples are as much rarer as it is larger.
const RATE_DRONES: f64 = 100.0;
/// Samples between two pictures of what `/tf` does not move.
const SCENE_EVERY: u64 = 5;
/// Of zstd: a run must not wait for its recording.
const LEVEL: u32 = 1;
/// Uncompressed size of a chunk, bytes.
const CHUNK: u64 = 1 << 20;
const TOPICS: [&str; 10] = [
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
];

/// Numbers of the channels, in the order of [`TOPICS`].
#[derive(Clone, Copy)]
#[repr(usize)]
enum To {
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
}

/// Writes run.mcap.
pub(crate) struct McapWriter {
    path: PathBuf,
    out: Writer<BufWriter<File>>,
    channels: Vec<u16>,
    sequences: Vec<u32>,
    facts: RunFacts,
    observer: Observer,
    /// Ticks from one sample to the next.
    every: u64,
    samples: u64,
    drones: Drones,
    json: Vec<u8>,
}

/// Ticks from one sample to the next.
pub(crate) fn stride(facts: &RunFacts) -> u64 {
    let rarer = (f64::from(facts.drones) / RATE_DRONES).max(1.0);
    (rarer / RATE_HZ / facts.dt_s).round().max(1.0) as u64
}

impl McapWriter {
    /// Starts the file in a run's folder. `scenario` is the resolved one.
    pub fn create(folder: &Path, facts: &RunFacts, scenario: &serde_json::Value) -> Result<Self, ReportError> {
        let path = folder.join(FILE);
        let file = File::create(&path).map_err(ReportError::io(&path))?;
        // One thread, so that the bytes do not depend on the number of cores.
        let options = WriteOptions::new()
            .profile("skein")
            .chunk_size(Some(CHUNK))
            .compression_level(LEVEL)
            .compression_threads(0);
        let out = options.create(BufWriter::with_capacity(1 << 18, file)).map_err(ReportError::recording(&path))?;
        let mut writer = Self {
            out,
            channels: Vec::new(),
            sequences: vec![0; TOPICS.len()],
            every: stride(facts),
            samples: 0,
            drones: Drones::default(),
            json: Vec::new(),
            observer: Observer::new(facts.clone()),
            facts: facts.clone(),
            path,
        };
        writer.open(scenario).map_err(ReportError::recording(&writer.path))?;
        Ok(writer)
    }

    /// Takes the record of a tick.
    pub fn take(&mut self, record: RecordView<'_>, events: &[RunEvent]) -> Result<(), ReportError> {
        let wanted = (record.head.tick + 1).is_multiple_of(self.every);
        let sample = self.observer.take(record, wanted);
        let written = sample
            .map_or(Ok(()), |sample| self.sample(&sample, record.head.now))
            .and_then(|()| events.iter().try_for_each(|event| self.event(event)));
        written.map_err(ReportError::recording(&self.path))
    }

    /// Completes the file.
    pub fn finish(&mut self) -> Result<(), ReportError> {
        self.out.finish().map(|_| ()).map_err(ReportError::recording(&self.path))
    }

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
        let all = schemas.into_iter().chain(std::iter::repeat(event));
        for (topic, (name, schema)) in TOPICS.iter().zip(all) {
            let id = self.out.add_schema(name, "jsonschema", schema.to_string().as_bytes())?;
            self.channels.push(self.out.add_channel(id, topic, "json", &BTreeMap::new())?);
        }
        self.out.write_metadata(&Metadata { name: "run".to_owned(), metadata: ordered(&self.facts) })?;
        self.out.attach(&Attachment {
            log_time: 0,
            create_time: 0,
            name: "scenario.json".to_owned(),
            media_type: "application/json".to_owned(),
            data: Cow::Owned(serde_json::to_vec_pretty(scenario).unwrap_or_default()),
        })?;
        self.put(To::Scene, SimTime::ZERO, &draw::still(&self.facts))
    }

    fn sample(&mut self, sample: &Sample, now: SimTime) -> McapResult<()> {
        let (at, state) = (Time::from(now), &sample.state);
        self.put(To::Transforms, now, &transforms(state, at))?;
        self.put(To::State, now, state)?;
        self.put(To::Energy, now, &sample.energy)?;
        self.put(To::Radio, now, &sample.radio)?;
        self.samples += 1;
        if let Some(changed) = self.drones.changed(state, at) {
            self.put(To::Scene, now, &changed)?;
        }
        if self.samples % SCENE_EVERY == 1 {
            self.put(To::Drones, now, &poses(state, at))?;
            self.put(To::Scene, now, &draw::moving(&self.facts, sample, at))?;
        }
        Ok(())
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
        self.put(To::Log, at, &Log { timestamp: at.into(), level, message, name, file, line: 0 })?;
        let topic = match event.what {
            EventKind::Leader { .. } => To::Leadership,
            EventKind::Grouping { .. } | EventKind::Assigned { .. } => To::Groups,
            _ => To::Events,
        };
        self.put(topic, at, &timeless(event))
    }

    fn put(&mut self, to: To, at: SimTime, what: &impl Serialize) -> McapResult<()> {
        self.json.clear();
        // Keys are strings, and a Vec takes every write: nothing of ours fails to become JSON.
        serde_json::to_writer(&mut self.json, what).map_err(std::io::Error::from)?;
        let time = at.0.max(0).unsigned_abs();
        let (channel_id, sequence) = (self.channels[to as usize], self.sequences[to as usize]);
        self.sequences[to as usize] += 1;
        let header = MessageHeader { channel_id, sequence, log_time: time, publish_time: time };
        self.out.write_to_known_channel(&header, &self.json)
    }
}

/// The run's last event tells how long it took on the wall: no part of a recording.
fn timeless(event: &RunEvent) -> Cow<'_, RunEvent> {
    let mut event = Cow::Borrowed(event);
    if matches!(event.what, EventKind::End { .. })
        && let EventKind::End { totals, .. } = &mut event.to_mut().what
    {
        totals.wall_s = 0.0;
    }
    event
}

/// What was ordered, in words.
fn ordered(facts: &RunFacts) -> BTreeMap<String, String> {
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

/// A JSON schema without references, which the viewers do not follow.
fn schema<T: JsonSchema>() -> serde_json::Value {
    let settings = SchemaSettings::default().for_serialize().with(|settings| settings.inline_subschemas = true);
    settings.into_generator().into_root_schema_for::<T>().to_value()
}

fn heading(state: &State, drone: usize) -> f64 {
    state.vy_mps[drone].atan2(state.vx_mps[drone])
}

fn transforms(state: &State, timestamp: Time) -> FrameTransforms {
    let transform = |drone: usize| FrameTransform {
        timestamp,
        parent_frame_id: WORLD.to_owned(),
        child_frame_id: format!("drone_{drone}"),
        translation: Vector3 { x: state.x_m[drone], y: state.y_m[drone], z: 0.0 },
        rotation: foxglove::Quaternion::yaw(heading(state, drone)),
    };
    FrameTransforms { transforms: (0..state.x_m.len()).map(transform).collect() }
}

fn poses(state: &State, timestamp: Time) -> PosesInFrame {
    let pose = |drone: usize| Pose::new(fine(state.x_m[drone]), fine(state.y_m[drone]), 0.0, heading(state, drone));
    PosesInFrame { timestamp, frame_id: WORLD.to_owned(), poses: (0..state.x_m.len()).map(pose).collect() }
}
