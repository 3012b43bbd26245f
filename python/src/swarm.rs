//! A swarm whose commands are a batch of numbers.

use crate::array::Array;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use skein_pilot::Command;
use skein_protocol::downlink::{Downlink, SensedNeighbour, SensedObstacle};
use skein_protocol::record::{EventKind, Outcome};
use skein_protocol::{DroneId, TopicName, UserMessage};
use skein_runtime::SteeredSwarm;
use skein_scenario::{Scenario, ScenarioSource};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// The topic of what drones say in a batch.
const TOPIC: &str = "env";

/// The greatest number of values in a message.
const MAX_VALUES: usize = skein_protocol::USER_BYTES / 4;

/// Numbers of an observation for the drone itself, for each neighbour, for each obstacle, and before the values of each message.
const OWN: usize = 6;
const PER_NEIGHBOUR: usize = 7;
const PER_OBSTACLE: usize = 5;
const PER_MESSAGE: usize = 3;

/// A swarm in this process that is steered by arrays: write `actions`, call `step`, read `observations` and the other arrays.
/// The arrays stay the same objects; `step` and `reset` write them.
#[pyclass(frozen, name = "Swarm", module = "skein")]
pub(crate) struct PySwarm(Mutex<State>);

struct State {
    text: String,
    name: String,
    overrides: Vec<(String, String)>,
    scenario: Scenario,
    layout: Layout,
    swarm: SteeredSwarm,
    arrays: Arrays,
    topic: TopicName,
    /// The newest messages that each drone heard, in the order of their age.
    memory: Vec<Vec<Remembered>>,
    heard: Vec<(DroneId, UserMessage)>,
    ticks: u64,
}

/// How many of each a drone is shown.
#[derive(Clone, Copy)]
struct Layout {
    neighbours: usize,
    obstacles: usize,
    /// Messages, each of another drone.
    peers: usize,
    /// Numbers in a message.
    values: usize,
}

impl Layout {
    fn observation(&self) -> usize {
        let messages = if self.values == 0 { 0 } else { self.peers * (PER_MESSAGE + self.values) };
        OWN + self.neighbours * PER_NEIGHBOUR + self.obstacles * PER_OBSTACLE + messages
    }

    fn action(&self) -> usize {
        3 + self.values
    }
}

struct Remembered {
    source: DroneId,
    tick: u64,
    values: Vec<f32>,
}

struct Arrays {
    actions: Array<f32>,
    observations: Array<f32>,
    position_m: Array<f64>,
    velocity_mps: Array<f64>,
    energy_j: Array<f64>,
    alive: Array<u8>,
    violated: Array<u8>,
}

impl Arrays {
    fn new(py: Python<'_>, drones: usize, layout: Layout) -> PyResult<Self> {
        Ok(Self {
            actions: Array::zeros(py, &[drones, layout.action()])?,
            observations: Array::zeros(py, &[drones, layout.observation()])?,
            position_m: Array::zeros(py, &[drones, 3])?,
            velocity_mps: Array::zeros(py, &[drones, 3])?,
            energy_j: Array::zeros(py, &[drones])?,
            alive: Array::zeros(py, &[drones])?,
            violated: Array::zeros(py, &[drones])?,
        })
    }
}

#[pymethods]
impl PySwarm {
    #[new]
    #[allow(clippy::too_many_arguments, reason = "they are keywords in Python")]
    #[pyo3(signature = (text, name, overrides, *, neighbours = 6, obstacles = 2, peers = 4, message = 0))]
    fn new(
        py: Python<'_>,
        text: String,
        name: String,
        overrides: Vec<(String, String)>,
        neighbours: usize,
        obstacles: usize,
        peers: usize,
        message: usize,
    ) -> PyResult<Self> {
        if message > MAX_VALUES {
            return Err(PyValueError::new_err(format!("message={message}: expected at most {MAX_VALUES} values")));
        }
        let scenario = parse(&text, &name, &overrides)?;
        let layout = Layout { neighbours, obstacles, peers, values: message };
        let swarm = SteeredSwarm::new(&scenario, message > 0).map_err(value_error)?;
        let drones = scenario.formation.drones as usize;
        let mut state = State {
            arrays: Arrays::new(py, drones, layout)?,
            topic: TopicName::new(TOPIC).map_err(value_error)?,
            memory: std::iter::repeat_with(Vec::new).take(drones).collect(),
            heard: Vec::new(),
            ticks: 0,
            text,
            name,
            overrides,
            scenario,
            layout,
            swarm,
        };
        state.observe();
        Ok(Self(Mutex::new(state)))
    }

    /// Goes back to the start of the mission; with another seed, to the start of that mission.
    #[pyo3(signature = (seed = None))]
    fn reset(&self, seed: Option<u64>) -> PyResult<()> {
        let mut state = self.state();
        match seed.filter(|&seed| seed != state.scenario.seed) {
            Some(seed) => {
                let mut overrides = state.overrides.clone();
                overrides.push(("seed".to_owned(), seed.to_string()));
                state.scenario = parse(&state.text, &state.name, &overrides)?;
                state.swarm = SteeredSwarm::new(&state.scenario, state.layout.values > 0).map_err(value_error)?;
            }
            None => state.swarm.reset(),
        }
        state.restart();
        Ok(())
    }

    /// Flies one tick with the commands in `actions`. Returns the outcome if the mission has ended, otherwise None.
    fn step(&self) -> Option<&'static str> {
        let mut state = self.state();
        state.act();
        state.swarm.advance();
        state.ticks += 1;
        state.remember();
        state.observe();
        state.outcome()
    }

    /// The outcome of the mission: "reached", "timeout", "stuck", "unsafe" or "aborted"; None while it goes on.
    #[getter]
    fn outcome(&self) -> Option<&'static str> {
        self.state().outcome()
    }

    /// Number of drones.
    #[getter]
    fn drones(&self) -> u32 {
        self.state().scenario.formation.drones
    }

    /// Length of a tick, s.
    #[getter]
    fn dt_s(&self) -> f64 {
        self.state().scenario.time.dt_s
    }

    /// Simulated time, s.
    #[getter]
    fn now_s(&self) -> f64 {
        self.state().swarm.world().now().secs()
    }

    /// Seed of the mission.
    #[getter]
    fn seed(&self) -> u64 {
        self.state().scenario.seed
    }

    /// The digest so far, over every drone's state and what it received in every tick.
    #[getter]
    fn digest(&self) -> String {
        format!("{:016x}", self.state().swarm.world().digest())
    }

    /// Least distance of two drones so far, m; infinite if there were never two.
    #[getter]
    fn min_separation_m(&self) -> f64 {
        self.state().swarm.world().min_separation_m()
    }

    /// Violations of invariants so far.
    #[getter]
    fn violations(&self) -> u64 {
        self.state().swarm.world().violations()
    }

    /// The whole scenario as resolved, with all defaults.
    #[getter]
    fn scenario(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        let json = serde_json::to_value(&self.state().scenario).map_err(value_error)?;
        crate::json::value(py, &json)
    }

    /// The arrays by their names.
    fn arrays(&self, py: Python<'_>) -> PyResult<Py<PyDict>> {
        let state = self.state();
        let arrays = &state.arrays;
        let dict = PyDict::new(py);
        dict.set_item("actions", arrays.actions.object(py))?;
        dict.set_item("observations", arrays.observations.object(py))?;
        dict.set_item("position_m", arrays.position_m.object(py))?;
        dict.set_item("velocity_mps", arrays.velocity_mps.object(py))?;
        dict.set_item("energy_j", arrays.energy_j.object(py))?;
        dict.set_item("alive", arrays.alive.object(py))?;
        dict.set_item("violated", arrays.violated.object(py))?;
        Ok(dict.unbind())
    }
}

impl PySwarm {
    fn state(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl State {
    fn restart(&mut self) {
        self.memory.iter_mut().for_each(Vec::clear);
        self.ticks = 0;
        self.arrays.actions.numbers().fill(0.0);
        self.observe();
    }

    /// Steers all drones by the array of actions.
    fn act(&mut self) {
        let width = self.layout.action();
        for (action, id) in self.arrays.actions.numbers().chunks_exact(width).zip(0..) {
            let (acceleration, values) = action.split_at(3);
            let acceleration = std::array::from_fn(|axis| f64::from(acceleration[axis]));
            self.swarm.steer(DroneId(id), &Command::acceleration(acceleration));
            if !values.is_empty() {
                let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
                // The number of values is limited so that they fit.
                if let Ok(message) = UserMessage::new(self.topic, &bytes) {
                    self.swarm.say(DroneId(id), message);
                }
            }
        }
    }

    /// Keeps the newest message of each peer that each drone heard.
    fn remember(&mut self) {
        if self.layout.values == 0 {
            return;
        }
        for (memory, id) in self.memory.iter_mut().zip(0..) {
            self.heard.clear();
            self.swarm.heard(DroneId(id), &mut self.heard);
            for (source, message) in self.heard.iter().filter(|(_, message)| *message.topic() == self.topic) {
                let numbers = message.bytes().chunks_exact(4);
                let values = numbers.map(|bytes| f32::from_le_bytes(std::array::from_fn(|i| bytes[i]))).collect();
                memory.retain(|known| known.source != *source);
                memory.push(Remembered { source: *source, tick: self.ticks, values });
            }
            let surplus = memory.len().saturating_sub(self.layout.peers);
            memory.drain(..surplus);
        }
    }

    fn observe(&mut self) {
        self.read_record();
        let Self { swarm, arrays, layout, memory, ticks, scenario, .. } = self;
        let down = swarm.senses();
        let width = layout.observation();
        for ((row, memory), id) in arrays.observations.numbers().chunks_exact_mut(width).zip(memory).zip(0..) {
            row.fill(0.0);
            let messages = observe_one(row, down, id, *layout);
            let chunks = messages.chunks_exact_mut((PER_MESSAGE + layout.values).max(1));
            for (out, known) in chunks.zip(memory.iter().rev()) {
                let age_s = (*ticks - known.tick) as f64 * scenario.time.dt_s;
                out[0] = 1.0;
                out[1] = known.source.0 as f32;
                out[2] = age_s as f32;
                for (out, value) in out[PER_MESSAGE..].iter_mut().zip(&known.values) {
                    *out = *value;
                }
            }
        }
    }

    /// Copies the true state at the end of the last tick.
    fn read_record(&mut self) {
        let Self { swarm, arrays, .. } = self;
        arrays.violated.numbers().fill(0);
        if self.ticks == 0 {
            // Before the first tick there is no record: what the drones sense.
            let down = swarm.senses();
            for (drone, at) in down.drones.iter().zip(0..) {
                arrays.position_m.numbers()[3 * at..][..3].copy_from_slice(&drone.position_m);
                arrays.velocity_mps.numbers()[3 * at..][..3].copy_from_slice(&drone.velocity_mps);
                arrays.energy_j.numbers()[at] = 0.0;
                arrays.alive.numbers()[at] = 1;
            }
            return;
        }
        let record = swarm.world().record();
        let (positions, velocities) = (arrays.position_m.numbers(), arrays.velocity_mps.numbers());
        let (energies, alive) = (arrays.energy_j.numbers(), arrays.alive.numbers());
        for (row, at) in record.rows.iter().zip(0..) {
            positions[3 * at..][..3].copy_from_slice(&row.position_m);
            velocities[3 * at..][..3].copy_from_slice(&row.velocity_mps);
            energies[at] = row.energy_j;
            alive[at] = u8::from(row.alive());
        }
        if record.events.is_empty() {
            return;
        }
        let events = record.parse_events(|line| serde_json::from_slice(line).map_err(|error| error.to_string()));
        for event in events.into_iter().flatten() {
            if let EventKind::Violation { drones, .. } = event.what {
                for drone in drones {
                    if let Some(flag) = arrays.violated.numbers().get_mut(drone.index()) {
                        *flag = 1;
                    }
                }
            }
        }
    }

    fn outcome(&self) -> Option<&'static str> {
        self.swarm.world().ended().map(|outcome| match outcome {
            Outcome::Reached => "reached",
            Outcome::Timeout => "timeout",
            Outcome::Stuck => "stuck",
            Outcome::Unsafe => "unsafe",
            Outcome::Aborted => "aborted",
        })
    }
}

/// Writes what a drone senses, and returns the rest of the row.
fn observe_one<'r>(row: &'r mut [f32], down: &Downlink, id: usize, layout: Layout) -> &'r mut [f32] {
    let (own, rest) = row.split_at_mut(OWN);
    let (around, rest) = rest.split_at_mut(layout.neighbours * PER_NEIGHBOUR);
    let (walls, rest) = rest.split_at_mut(layout.obstacles * PER_OBSTACLE);
    let Some(head) = down.drones.get(id) else { return rest };
    write(own, &head.position_m);
    write(&mut own[3..], &head.velocity_mps);
    let neighbours = range(&down.neighbours, head.neighbour_first, head.neighbour_count);
    nearest(neighbours, around.chunks_exact_mut(PER_NEIGHBOUR), distance2, |out, sensed| {
        out[0] = 1.0;
        write(&mut out[1..], &sensed.position_m);
        write(&mut out[4..], &sensed.velocity_mps);
    });
    let obstacles = range(&down.obstacles, head.obstacle_first, head.obstacle_count);
    let distance = |sensed: &SensedObstacle| sensed.distance_m;
    nearest(obstacles, walls.chunks_exact_mut(PER_OBSTACLE), distance, |out, sensed| {
        out[0] = 1.0;
        let relative: [f64; 3] = std::array::from_fn(|axis| sensed.nearest_m[axis] - head.position_m[axis]);
        write(&mut out[1..], &relative);
        out[4] = sensed.distance_m as f32;
    });
    rest
}

fn range<T>(all: &[T], first: u32, count: u32) -> &[T] {
    all.get(first as usize..(first + count) as usize).unwrap_or_default()
}

fn write(out: &mut [f32], values: &[f64; 3]) {
    for (out, value) in out.iter_mut().zip(values) {
        *out = *value as f32;
    }
}

fn distance2(sensed: &SensedNeighbour) -> f64 {
    sensed.position_m.iter().map(|value| value * value).sum()
}

/// The most that a drone is shown of one kind.
const MOST: usize = 64;

/// Writes the nearest entries, the nearest first, to as many outputs as there are.
fn nearest<'o, T>(
    all: &[T],
    outputs: impl ExactSizeIterator<Item = &'o mut [f32]>,
    distance: impl Fn(&T) -> f64,
    write: impl Fn(&mut [f32], &T),
) {
    let room = outputs.len().min(MOST);
    let (mut best, mut count) = ([(f64::INFINITY, 0); MOST], 0);
    for (index, entry) in all.iter().enumerate() {
        let key = distance(entry);
        let at = best[..count].iter().rposition(|(other, _)| *other <= key).map_or(0, |before| before + 1);
        if at < room {
            count = (count + 1).min(room);
            best[at..count].rotate_right(1);
            best[at] = (key, index);
        }
    }
    for (out, (_, index)) in outputs.zip(&best[..count]) {
        write(out, &all[*index]);
    }
}

fn parse(text: &str, name: &str, overrides: &[(String, String)]) -> PyResult<Scenario> {
    let file = name.rsplit('/').next().unwrap_or(name);
    let stem = file.rsplit_once('.').map_or(file, |(stem, _)| stem);
    Scenario::parse(text, ScenarioSource { name, stem }, overrides).map_err(value_error)
}

fn value_error(error: impl std::fmt::Display) -> PyErr {
    PyValueError::new_err(error.to_string())
}
