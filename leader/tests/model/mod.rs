//! The machine that flies under a model checker: every course of a short mission, with a bounded number of faults of
//! messages, processes and links.
//!
//! Time advances in steps of one heartbeat. In a step, every living drone hears the messages that are due and then acts,
//! as the pilot does. Between two steps the adversary may lose, double, or delay by a step any single message that is due
//! (later messages overtake a delayed one). It may kill a drone, restart it with empty memory, partition the swarm and heal
//! it. Time is part of the state and bounded: all courses within the bounds are explored completely.

use crate::swarm::{Breach, Periods, Watch, discord, disunion, hash, params, step, wall};
use skein_leader::leading::Leading;
use skein_leader::own_state::OwnState;
use skein_protocol::{DroneId, GroupId, Message, Phase, SimTime, Vec2};
use stateright::{Model, Property};
use std::fmt::Write;
use std::hash::{Hash, Hasher};
use std::sync::Arc;

/// All periods are one step.
const PERIODS: Periods = Periods {
    dt_s: 0.2,
    beacon_s: 0.2,
    heartbeat_s: 0.2,
    repeat_s: 0.2,
    wait_s: 0.2,
    leader_timeout_s: 0.4,
    peer_timeout_s: 0.6,
    debounce_s: 0.0,
};
/// Faster than real drones, so that a mission is short: 20 m per step.
const SPEED_MPS: f64 = 100.0;
/// Number of steps after the last fault within which all drones must be one group again.
const MAX_RECOVERY_STEPS: u32 = 60;

/// The faults that the adversary may still cause.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub(crate) struct Faults {
    /// Number of messages lost, delayed or doubled.
    pub messages: u8,
    /// Number of drones killed. Each may be restarted.
    pub crashes: u8,
    /// Number of partitions of the swarm. Each may be healed.
    pub cuts: u8,
}

/// A mission of few drones, and its faults.
#[derive(Clone, Debug)]
pub(crate) struct Mission {
    /// Number of drones, in a column, alternately left and right of the course.
    pub drones: u32,
    /// Number of steps with faults. The steps after them have none.
    pub steps: u32,
    /// Number of walls ahead. The first one splits the swarm; two leaders plan jointly for the second one.
    pub walls: u32,
    /// The faults of the adversary.
    pub faults: Faults,
}

/// One drone's process.
#[derive(Clone, Debug)]
struct Process {
    /// `None`: dead.
    machine: Option<Arc<Leading>>,
    /// Hash of the machine's whole state.
    print: u64,
    incarnation: u32,
}

/// A message on its way to one drone. The order of posts is the order in which they are heard.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
struct Post {
    due: u32,
    from: u32,
    number: u32,
    to: u32,
    print: u64,
}

/// The whole state at one moment.
#[derive(Clone, Debug)]
pub(crate) struct State {
    step: u32,
    processes: Vec<Process>,
    posts: Vec<(Post, Arc<Message>)>,
    left: Faults,
    /// One bit per drone: its side of the partition.
    cut: Option<u32>,
    watch: Arc<Watch>,
    /// The first breach of an invariant.
    pub breach: Option<Breach>,
}

impl State {
    fn key(&self) -> impl Hash + PartialEq + '_ {
        let machines: Vec<(u64, u32)> = self.processes.iter().map(|p| (p.print, p.incarnation)).collect();
        let posts: Vec<&Post> = self.posts.iter().map(|(post, _)| post).collect();
        (self.step, machines, posts, self.left, self.cut, &*self.watch, &self.breach)
    }

    fn now(&self) -> SimTime {
        SimTime::from_secs(f64::from(self.step) * PERIODS.dt_s)
    }

    fn hear_each_other(&self, a: u32, b: u32) -> bool {
        self.cut.is_none_or(|cut| cut >> a & 1 == cut >> b & 1)
    }

    /// The living drones of each side.
    fn sides(&self) -> Vec<Vec<(DroneId, &Leading)>> {
        let side = |bit: u32| {
            let of_side = move |id: &u32| self.cut.map_or(0, |cut| cut >> id & 1) == bit;
            let ids = (0..self.processes.len() as u32).filter(of_side);
            ids.filter_map(|id| Some((DroneId(id), &**self.processes[id as usize].machine.as_ref()?))).collect()
        };
        (0..2).map(side).collect()
    }

    /// The groups that have a leader.
    fn led(&self) -> Vec<GroupId> {
        let leading = self.processes.iter().filter_map(|p| p.machine.as_ref()).filter(|l| l.is_leader());
        leading.map(|l| l.scope()).collect()
    }
}

impl PartialEq for State {
    fn eq(&self, other: &Self) -> bool {
        self.key() == other.key()
    }
}

impl Hash for State {
    fn hash<H: Hasher>(&self, hasher: &mut H) {
        self.key().hash(hasher);
    }
}

/// An action of the model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Event {
    /// All drones hear and act.
    Step,
    /// The message with this index is lost.
    Lose(usize),
    /// The message comes a step later.
    Delay(usize),
    /// The message comes now and again a step later.
    Double(usize),
    /// A process dies.
    Kill(u32),
    /// A dead process is restarted.
    Restart(u32),
    /// The swarm is partitioned into two sides that do not hear each other.
    Cut(u32),
    /// The partition is healed.
    Heal,
}

/// Hash of a machine's whole state: of the output of `derive(Debug)`, which contains every field.
fn print_of(machine: &Leading) -> u64 {
    struct Sink(Vec<u8>);
    impl Write for Sink {
        fn write_str(&mut self, s: &str) -> std::fmt::Result {
            self.0.extend_from_slice(s.as_bytes());
            Ok(())
        }
    }
    let mut sink = Sink(Vec::with_capacity(1 << 14));
    write!(sink, "{machine:?}").unwrap();
    hash(&sink.0)
}

impl Mission {
    fn start(&self, id: u32, incarnation: u32, now: SimTime) -> Process {
        let machine = Leading::new(&params(&PERIODS, self.drones, id, incarnation, now));
        Process { print: print_of(&machine), machine: Some(Arc::new(machine)), incarnation }
    }

    fn own(id: u32, step: u32) -> OwnState {
        let y_m = if id.is_multiple_of(2) { 30.0 } else { -30.0 };
        let x_m = 20.0 - 20.0 * f64::from(id) + SPEED_MPS * PERIODS.dt_s * f64::from(step);
        let (position, velocity) = (Vec2::new(x_m, y_m), Vec2::new(SPEED_MPS, 0.0));
        OwnState { tick: u64::from(step), position, velocity, altitude_m: 50.0, climb_mps: 0.0 }
    }

    /// All drones hear the messages that are due, then all act.
    fn step(&self, state: &mut State) {
        let now = state.now();
        let later = state.posts.partition_point(|(post, _)| post.due <= state.step);
        let due: Vec<_> = state.posts.drain(..later).collect();
        let (mut said, mut number) = (Vec::new(), 0);
        for id in 0..self.drones {
            let process = &state.processes[id as usize];
            let Some(machine) = &process.machine else { continue };
            let (mut machine, mut say) = (Leading::clone(machine), Vec::new());
            for (post, message) in due.iter().filter(|(post, _)| post.to == id && state.hear_each_other(post.from, id))
            {
                machine.hear(now, DroneId(post.from), &**message, &mut say);
            }
            // The first drone senses the walls; the others are told.
            for wall in (0..self.walls).filter(|w| id == 0 && state.step >= 2 + 3 * w) {
                let (obstacle, shape) = wall_at(wall);
                machine.sense(now, obstacle, shape);
            }
            step(&mut machine, now, &Self::own(id, state.step), &mut say);
            let seen = Arc::make_mut(&mut state.watch).see(DroneId(id), process.incarnation, &machine);
            state.breach = state.breach.take().or(seen.err());
            let process = &mut state.processes[id as usize];
            (process.print, process.machine) = (print_of(&machine), Some(Arc::new(machine)));
            for message in say.into_iter().map(Arc::new) {
                let print = hash(bytemuck::bytes_of(&message.encode()));
                number += 1;
                for to in (0..self.drones).filter(|&to| to != id) {
                    said.push((Post { due: state.step + 1, from: id, number, to, print }, message.clone()));
                }
            }
        }
        state.posts.extend(said);
        state.posts.sort_by(|a, b| a.0.cmp(&b.0));
        state.step += 1;
    }

    /// Whether all drones become one group once there are no more faults: first each side, then, healed, the whole swarm.
    fn becomes_one(&self, state: &State) -> bool {
        let mut state = state.clone();
        let apart = state.cut.is_none() || self.settles(&mut state);
        state.cut = None;
        apart && self.settles(&mut state)
    }

    fn settles(&self, state: &mut State) -> bool {
        let exit_m = wall_at(self.walls - 1).1.bounds().1.x + 25.0;
        (0..MAX_RECOVERY_STEPS).any(|_| {
            let past = Self::own(self.drones - 1, state.step).position.x > exit_m;
            self.step(state);
            past && state.breach.is_none() && state.sides().iter().all(|side| disunion(side).is_none())
        })
    }
}

fn wall_at(number: u32) -> (skein_protocol::ObstacleId, skein_protocol::shape::ConvexShape) {
    wall(number, 105.0 + 70.0 * f64::from(number))
}

impl Model for Mission {
    type State = State;
    type Action = Event;

    fn init_states(&self) -> Vec<State> {
        vec![State {
            step: 0,
            processes: (0..self.drones).map(|id| self.start(id, 1, SimTime::ZERO)).collect(),
            posts: Vec::new(),
            left: self.faults,
            cut: None,
            watch: Arc::default(),
            breach: None,
        }]
    }

    fn actions(&self, state: &State, events: &mut Vec<Event>) {
        if state.step == self.steps || state.breach.is_some() {
            return;
        }
        events.push(Event::Step);
        let due = state.posts.partition_point(|(post, _)| post.due <= state.step);
        if state.left.messages > 0 {
            events.extend((0..due).flat_map(|i| [Event::Lose(i), Event::Delay(i), Event::Double(i)]));
        }
        for id in 0..self.drones {
            match state.processes[id as usize].machine {
                Some(_) => events.extend((state.left.crashes > 0).then_some(Event::Kill(id))),
                None => events.push(Event::Restart(id)),
            }
        }
        match state.cut {
            Some(_) => events.push(Event::Heal),
            // The last drone is always on side 0: each cut once.
            None if state.left.cuts > 0 => events.extend((1..1 << (self.drones - 1)).map(Event::Cut)),
            None => {}
        }
    }

    fn next_state(&self, before: &State, event: Event) -> Option<State> {
        let mut state = before.clone();
        match event {
            Event::Step => self.step(&mut state),
            Event::Lose(i) => {
                state.left.messages -= 1;
                state.posts.remove(i);
            }
            Event::Delay(i) => {
                state.left.messages -= 1;
                state.posts[i].0.due += 1;
            }
            Event::Double(i) => {
                state.left.messages -= 1;
                let (post, message) = state.posts[i].clone();
                state.posts.push((Post { due: post.due + 1, ..post }, message));
            }
            Event::Kill(id) => {
                state.left.crashes -= 1;
                let process = &mut state.processes[id as usize];
                (process.machine, process.print) = (None, 0);
                state.posts.retain(|(post, _)| post.to != id);
            }
            Event::Restart(id) => {
                let incarnation = state.processes[id as usize].incarnation + 1;
                state.processes[id as usize] = self.start(id, incarnation, state.now());
            }
            Event::Cut(side) => {
                state.left.cuts -= 1;
                state.cut = Some(side);
            }
            Event::Heal => state.cut = None,
        }
        state.posts.sort_by(|a, b| a.0.cmp(&b.0));
        Some(state)
    }

    fn properties(&self) -> Vec<Property<Self>> {
        vec![
            Property::always("no drone obeys two assignments under one (ballot, epoch)", |_, s: &State| {
                !matches!(s.breach, Some(Breach::TwoPlans { .. }))
            }),
            Property::always("the stamp that a drone obeys never goes back", |_, s: &State| {
                !matches!(s.breach, Some(Breach::WentBack { .. } | Breach::NotOfTheTerm { .. }))
            }),
            Property::always("no two drones lead under one ballot", |_, s: &State| {
                !matches!(s.breach, Some(Breach::TwoLeaders { .. }))
            }),
            Property::always("on a fair network all drones become one group", |mission: &Self, s: &State| {
                s.step < mission.steps || mission.becomes_one(s)
            }),
            Property::sometimes("two groups have leaders of their own", |_, s: &State| {
                let led = s.led();
                (1..=2).all(|number| led.contains(&GroupId::ALL.child(number)))
            }),
            Property::sometimes("all drones fly in formation again", |_, s: &State| {
                let part = |l: &Leading| l.obeyed().is_some_and(|bundle| bundle.plan.phase() == Phase::Reform);
                let all = s.processes.iter().all(|p| p.machine.as_ref().is_some_and(|l| part(l)));
                all && s.sides().iter().all(|side| discord(side).is_none())
            }),
        ]
    }
}
