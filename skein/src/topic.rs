//! `skein topic`: prints the messages, senses and records of a running swarm.

use crate::complaint::complain;
use crate::exit::{Exit, Failure};
use crate::interrupt::Interrupt;
use crate::output::print_line;
use crate::tap::{LookArgs, RunningSwarm, Sample, SwarmTap, Swarms};
use clap::{Args, Subcommand};
use serde_json::{Value, json};
use skein_protocol::downlink::DownlinkView;
use skein_protocol::frame::AirFrame;
use skein_protocol::message::Topic;
use skein_protocol::record::RecordView;
use skein_protocol::{Message, SimTime, TopicName};
use skein_report::scene::message_json;
use skein_scenario::did_you_mean;
use std::collections::BTreeMap;
use std::time::{Duration, Instant};

/// Time between two looks for new samples.
const POLL: Duration = Duration::from_millis(1);
/// Time between two checks whether the swarm still runs.
const ALIVE: Duration = Duration::from_millis(500);
/// Wall time over which `hz` counts.
const WINDOW: Duration = Duration::from_secs(1);

/// Arguments of `topic`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  skein topic list
  skein topic echo air --kind plan
  skein topic echo senses --drone 3 --count 1
  skein topic hz air
  skein topic list --connect tls/10.0.0.2:7448 --keys keys      swarms of another machine, see `skein share`")]
pub(crate) struct TopicArgs {
    /// What to do.
    #[command(subcommand)]
    pub(crate) action: Action,
    /// Use the swarm whose name begins with NAME, as shown by `skein top` [default: the first one]
    #[arg(long, global = true, value_name = "NAME")]
    pub(crate) run: Option<String>,
    /// Where swarms are looked for.
    #[command(flatten)]
    pub(crate) look: LookArgs,
}

/// What to do with a topic.
#[derive(Debug, Subcommand)]
pub(crate) enum Action {
    /// Print the topics of the running swarms, and those that their pilots declare
    List,
    /// Print each message as one line of JSON, until the swarm ends or --count is reached
    Echo(Filter),
    /// Print the message rate once per second, as one line of JSON
    Hz(Filter),
}

/// Which messages.
#[derive(Debug, Args)]
pub(crate) struct Filter {
    /// senses, air (frames that the world passes on), uplink (frames that drones send) or record
    #[arg(value_enum)]
    pub(crate) topic: Name,
    /// Only messages of this drone
    #[arg(long, value_name = "ID")]
    pub(crate) drone: Option<u32>,
    /// Only frames of this kind: pose, obstacle, leadership, plan, assignment, passed, arrivals, presence, or a topic that pilots define
    #[arg(long, value_parser = kind)]
    pub(crate) kind: Option<String>,
    /// Stop after N lines
    #[arg(long, value_name = "N")]
    pub(crate) count: Option<u64>,
}

/// The topics.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum Name {
    /// What each drone senses: its own state, neighbours, obstacles
    Senses,
    /// Frames that the world passes on to the drones
    Air,
    /// Frames that drones send
    Uplink,
    /// The true state of each drone
    Record,
}

impl Name {
    const ALL: [(Self, &'static str, &'static str); 4] = [
        (Self::Senses, "senses", "skein/downlink"),
        (Self::Air, "air", "skein/downlink"),
        (Self::Uplink, "uplink", "skein/uplink, as the world took it"),
        (Self::Record, "record", "skein/watch"),
    ];
}

fn kind(text: &str) -> Result<String, KindError> {
    let known = Topic::ALL.map(Topic::name);
    if known.contains(&text) || TopicName::new(text).is_ok() {
        Ok(text.to_owned())
    } else {
        Err(KindError { expected: known.join(", ") })
    }
}

/// Why a kind of frame is refused.
#[derive(Debug, thiserror::Error)]
#[error("expected one of {expected}, or the name of a topic that pilots define")]
struct KindError {
    expected: String,
}

/// Lists topics, or prints messages or rates.
pub(crate) fn topic(args: &TopicArgs) -> Result<Exit, Failure> {
    let swarms = Swarms::of(&args.look)?;
    let name = args.run.as_deref();
    let found = swarms.running(name)?;
    let first = found.first().ok_or_else(|| Failure::environment(swarms.none(name)))?;
    match &args.action {
        Action::List => list(&swarms, &found),
        Action::Echo(filter) => {
            let mut left = filter.count.unwrap_or(u64::MAX);
            listen((&swarms, first), filter, |line| {
                let Some(line) = line else { return Ok(true) };
                left -= 1;
                Ok(print_line(line)? && left > 0)
            })
        }
        Action::Hz(filter) => hz((&swarms, first), filter),
    }
}

fn list(swarms: &Swarms, found: &[RunningSwarm]) -> Result<Exit, Failure> {
    for run in found {
        let tap = SwarmTap::attach(swarms, run)?;
        let line = |topic: &str, service: &str| {
            print_line(json!({ "run": run.name(), "topic": topic, "service": service, "drones": tap.facts.drones }))
        };
        for (_, name, service) in Name::ALL {
            line(name, service)?;
        }
        for topic in &tap.own_topics {
            line(topic, &format!("skein/downlink: skein topic echo air --kind {topic}"))?;
        }
    }
    Ok(Exit::Reached)
}

fn hz(run: (&Swarms, &RunningSwarm), filter: &Filter) -> Result<Exit, Failure> {
    let (mut counts, mut since): (BTreeMap<String, u64>, Instant) = (BTreeMap::new(), Instant::now());
    let mut left = filter.count.unwrap_or(u64::MAX);
    listen(run, filter, |line| {
        if let Some(line) = line {
            let key = line.get("kind").and_then(Value::as_str).unwrap_or("messages").to_owned();
            *counts.entry(key).or_default() += 1;
        }
        let passed = since.elapsed();
        if passed < WINDOW {
            return Ok(true);
        }
        let rate = |count: &u64| (*count as f64 / passed.as_secs_f64() * 10.0).round() / 10.0;
        let rates: BTreeMap<&String, f64> = counts.iter().map(|(kind, count)| (kind, rate(count))).collect();
        let read = print_line(json!({ "hz": rates }))?;
        (counts, since) = (BTreeMap::new(), Instant::now());
        left -= 1;
        Ok(read && left > 0)
    })
}

/// Refuses a filter that nothing of the run can match.
fn check(filter: &Filter, tap: &SwarmTap) -> Result<(), Failure> {
    let drones = tap.facts.drones;
    if let Some(drone) = filter.drone.filter(|drone| *drone >= drones) {
        let last = drones.saturating_sub(1);
        return Err(Failure::usage(format!("--drone {drone}: expected a drone of the run: 0 to {last}")));
    }
    let Some(kind) = &filter.kind else { return Ok(()) };
    if !matches!(filter.topic, Name::Air | Name::Uplink) {
        return Err(Failure::usage(format!("--kind {kind}: expected the topic `air` or `uplink`, which have frames")));
    }
    let own = tap.own_topics.iter().map(String::as_str);
    let known: Vec<&str> = Topic::ALL.map(Topic::name).into_iter().chain(own).collect();
    if known.contains(&kind.as_str()) {
        return Ok(());
    }
    let list = known.join(", ");
    if tap.topics_known {
        let hint = did_you_mean(kind, known);
        return Err(Failure::usage(format!("--kind {kind}: expected a kind of frame of the run: {list}{hint}")));
    }
    // Pilots may say what they do not declare.
    complain(format!("warning: no pilot of the run declares the topic {kind}; known are {list}"));
    Ok(())
}

/// Passes each line that matches the filter to `take`, and `None` when there are no new samples. Ends when the swarm has
/// ended or `take` returns false.
fn listen(
    (swarms, run): (&Swarms, &RunningSwarm),
    filter: &Filter,
    mut take: impl FnMut(Option<Value>) -> Result<bool, Failure>,
) -> Result<Exit, Failure> {
    let interrupt = Interrupt::watch()?;
    let tap = SwarmTap::attach(swarms, run)?;
    check(filter, &tap)?;
    let dt_s = tap.facts.dt_s;
    let downlink = match filter.topic {
        Name::Senses | Name::Air => Some(tap.downlink()?),
        Name::Uplink | Name::Record => None,
    };
    let mut checked = Instant::now();
    loop {
        let lines = match &downlink {
            Some(port) => lines_of(port.receive(), |sample| {
                DownlinkView::parse(sample.bytes()).map(|down| of_downlink(&down, filter, dt_s)).unwrap_or_default()
            })?,
            None => lines_of(tap.record(), |sample| {
                RecordView::parse(sample.bytes()).map(|record| of_record(record, filter, dt_s)).unwrap_or_default()
            })?,
        };
        if let Some(signal) = interrupt.signal() {
            return Ok(Exit::Interrupted(signal));
        }
        let idle = lines.is_none();
        for line in lines.into_iter().flatten().map(Some).chain(idle.then_some(None)) {
            if !take(line)? {
                return Ok(Exit::Reached);
            }
        }
        if idle {
            std::thread::sleep(POLL);
            if checked.elapsed() > ALIVE {
                checked = Instant::now();
                if !tap.alive() {
                    return Ok(Exit::Reached);
                }
            }
        }
    }
}

fn lines_of(
    sample: Result<Option<Sample>, Failure>,
    lines: impl FnOnce(Sample) -> Vec<Value>,
) -> Result<Option<Vec<Value>>, Failure> {
    Ok(sample?.map(lines))
}

fn of_downlink(down: &DownlinkView<'_>, filter: &Filter, dt_s: f64) -> Vec<Value> {
    if filter.topic == Name::Air {
        return frames(down.frames, filter, dt_s);
    }
    let wanted = |drone: &u32| filter.drone.is_none_or(|only| only == *drone);
    let sensed = |drone: u32| {
        let senses = down.senses(skein_protocol::DroneId(drone))?;
        let obstacles: Vec<Value> = (senses.obstacles.iter())
            .map(|seen| {
                let id = senses.shape(seen).map(|shape| shape.id.0);
                json!({ "obstacle": id, "nearest_m": seen.nearest_m, "distance_m": seen.distance_m })
            })
            .collect();
        let neighbours: Vec<Value> = (senses.neighbours.iter())
            .map(
                |near| json!({ "drone": near.drone, "position_m": near.position_m, "velocity_mps": near.velocity_mps }),
            )
            .collect();
        Some(json!({
            "topic": "senses", "tick": senses.tick, "t_s": senses.now.secs(), "drone": drone,
            "position_m": senses.position_m, "velocity_mps": senses.velocity_mps, "obstacles": obstacles, "neighbours": neighbours,
        }))
    };
    (0..down.drones.len() as u32).filter(wanted).filter_map(sensed).collect()
}

fn of_record(record: RecordView<'_>, filter: &Filter, dt_s: f64) -> Vec<Value> {
    if filter.topic == Name::Uplink {
        return frames(record.frames, filter, dt_s);
    }
    let rows = record.rows.iter().enumerate();
    let wanted = rows.filter(|(drone, _)| filter.drone.is_none_or(|only| only as usize == *drone));
    wanted
        .map(|(drone, row)| {
            json!({
                "topic": "record", "tick": record.head.tick, "t_s": record.head.now.secs(), "drone": drone,
                "alive": row.alive(), "position_m": row.position_m, "velocity_mps": row.velocity_mps,
                "energy_j": row.energy_j, "group": row.group.to_string(), "leader": row.leader(),
                "heard": row.heard, "dropped": row.dropped.iter().sum::<u32>(),
            })
        })
        .collect()
}

fn frames(frames: &[AirFrame], filter: &Filter, dt_s: f64) -> Vec<Value> {
    let of_drone = |frame: &&AirFrame| filter.drone.is_none_or(|only| only == frame.source.0);
    let mut lines = Vec::new();
    for frame in frames.iter().filter(of_drone) {
        let kind = skein_report::scene::topic(frame);
        if filter.kind.as_ref().is_some_and(|only| *only != kind) {
            continue;
        }
        let (message, error) = match Message::decode(&frame.frame) {
            Ok(message) => (message_json(&message), None),
            Err(error) => (Value::Null, Some(error.to_string())),
        };
        let sent_s = SimTime((frame.tick as f64 * dt_s * 1e9).round() as i64).secs();
        let topic = if filter.topic == Name::Air { "air" } else { "uplink" };
        lines.push(json!({
            "topic": topic, "kind": kind, "tick": frame.tick, "t_s": sent_s, "drone": frame.source,
            "sequence": frame.sequence, "bytes": frame.frame.len, "message": message, "error": error,
        }));
    }
    lines
}
