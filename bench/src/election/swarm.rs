//! The state machines of leadership over a simulated radio.

use super::topology::{longest_way, parts, uniform};
use super::trial::Trial;
use skein_leader::leading::Leading;
use skein_leader::own_state::OwnState;
use skein_protocol::radio::HEAD_BYTES;
use skein_protocol::{Ballot, DroneId, Message, SimTime, Vec2};
use skein_runtime::mission::{dt_ns, pilot_params};
use skein_scenario::Scenario;
use std::collections::BTreeMap;

/// Purposes of random numbers.
const LOSS: u64 = 1;
const VICTIM: u64 = 2;
const MOMENT: u64 = 3;
/// Failing drones die within this time, s.
const FAILING_S: f64 = 5.0;

/// The drones, and the messages under way. A message arrives in the tick after it was sent, or never.
pub(super) struct Swarm {
    trial: Trial,
    dt_ns: i64,
    tick: u64,
    /// `None` if the drone is dead.
    drones: Vec<Option<Leading>>,
    own: Vec<OwnState>,
    links: Vec<Vec<usize>>,
    /// The connected parts of the living drones.
    parts: Vec<Vec<usize>>,
    /// When which drones die, the first one last.
    deaths: Vec<(u64, usize)>,
    sent: Vec<(usize, Message)>,
    frames: u64,
    bytes: u64,
    /// The drones that lead or led, by their terms.
    leaders: BTreeMap<Ballot, DroneId>,
}

impl Swarm {
    /// All drones start in the first tick.
    pub(super) fn new(scenario: &Scenario, trial: Trial) -> Self {
        let count = trial.drones as usize;
        let places = trial.topology.places(count, trial.seed);
        let links = trial.topology.links(&places);
        let velocity = Vec2::new(scenario.drone.speed_mps, 0.0);
        let own = |&position: &Vec2| OwnState { tick: 0, position, velocity, altitude_m: 50.0, climb_mps: 0.0 };
        let machine = |me| Some(Leading::new(&pilot_params(scenario, DroneId(me), 1, SimTime::ZERO).leading()));
        let dt_ns = dt_ns(scenario);
        Self {
            dt_ns,
            tick: 0,
            drones: (0..trial.drones).map(machine).collect(),
            own: places.iter().map(own).collect(),
            parts: parts(&links, &vec![true; count]),
            deaths: deaths(trial, dt_ns as f64 * 1e-9),
            links,
            sent: Vec::new(),
            frames: 0,
            bytes: 0,
            leaders: BTreeMap::new(),
            trial,
        }
    }

    pub(super) fn now_s(&self) -> f64 {
        self.now().secs()
    }

    fn now(&self) -> SimTime {
        SimTime(self.tick as i64 * self.dt_ns)
    }

    /// Frames that all drones have sent.
    pub(super) fn frames(&self) -> u64 {
        self.frames
    }

    /// Bytes that all drones have sent, the head of each frame included.
    pub(super) fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Number of drones that live.
    pub(super) fn living(&self) -> usize {
        self.drones.iter().flatten().count()
    }

    /// Hops between the two living drones of one part that are farthest from each other.
    pub(super) fn hops(&self) -> usize {
        let alive: Vec<bool> = self.drones.iter().map(Option::is_some).collect();
        longest_way(&self.links, &alive)
    }

    /// Number of terms so far.
    pub(super) fn terms(&self) -> usize {
        self.leaders.len()
    }

    /// Terms of drones that live and no longer lead by them.
    pub(super) fn false_leaders(&self) -> usize {
        let gave_way = |&(term, leader): &(&Ballot, &DroneId)| {
            self.drones[leader.index()].as_ref().is_some_and(|l| !(l.is_leader() && l.term() == *term))
        };
        self.leaders.iter().filter(gave_way).count()
    }

    /// Whether all drones that are to die are dead, and each connected part of the living has one leader, whom all its drones obey.
    pub(super) fn is_united(&self) -> bool {
        let led = |part: &Vec<usize>| {
            let members = || part.iter().filter_map(|&i| Some((i, self.drones[i].as_ref()?)));
            let Some((_, first)) = members().next() else { return true };
            let term = first.term();
            let leads = |(i, l): (usize, &Leading)| l.is_leader() && term.claimant.index() == i;
            members().all(|(_, l)| l.term() == term) && members().filter(|&member| leads(member)).count() == 1
        };
        self.deaths.is_empty() && self.parts.iter().all(led)
    }

    /// One tick: deaths, then all drones hear, then all act.
    pub(super) fn step(&mut self) {
        self.die();
        let now = self.now();
        let mut sent = Vec::new();
        for (from, message) in std::mem::take(&mut self.sent) {
            self.frames += 1;
            self.bytes += HEAD_BYTES + u64::from(message.encode().len);
            for &to in &self.links[from] {
                let Some(leading) = &mut self.drones[to] else { continue };
                let words = [self.trial.seed, LOSS, self.frames, to as u64];
                if self.trial.loss == 0.0 || uniform(&words) >= self.trial.loss {
                    let mut answers = Vec::new();
                    leading.hear(now, DroneId(from as u32), &message, &mut answers);
                    sent.extend(answers.into_iter().map(|answer| (to, answer)));
                }
            }
        }
        for (i, drone) in self.drones.iter_mut().enumerate() {
            let Some(leading) = drone else { continue };
            self.own[i].tick = self.tick;
            let mut said = Vec::new();
            act(leading, now, &self.own[i], &mut said);
            if leading.is_leader() {
                self.leaders.entry(leading.term()).or_insert(DroneId(i as u32));
            }
            sent.extend(said.into_iter().map(|message| (i, message)));
        }
        self.sent = sent;
        for own in &mut self.own {
            own.position += own.velocity * (self.dt_ns as f64 * 1e-9);
        }
        self.tick += 1;
    }

    fn die(&mut self) {
        let before = self.deaths.len();
        while let Some((_, drone)) = self.deaths.pop_if(|(at, _)| *at <= self.tick) {
            self.drones[drone] = None;
        }
        if self.deaths.len() < before {
            let alive: Vec<bool> = self.drones.iter().map(Option::is_some).collect();
            self.parts = parts(&self.links, &alive);
        }
    }
}

/// What a drone does in a tick after it has heard, in the pilot's order.
fn act(leading: &mut Leading, now: SimTime, own: &OwnState, say: &mut Vec<Message>) {
    leading.elect(now, own, say);
    if leading.is_leader() {
        leading.refresh_members(now, own);
        let mut bundle = leading.decide(now, &[], say);
        if !bundle.is_empty() {
            leading.adopt(now, bundle.swap_remove(0));
        }
    }
    leading.speak(now, own, &Default::default(), say);
}

/// The share of drones that die, chosen at random, at moments chosen at random; the first death last.
fn deaths(trial: Trial, dt_s: f64) -> Vec<(u64, usize)> {
    let count = (trial.failing * f64::from(trial.drones)).round() as usize;
    let draw = |purpose: u64, drone: usize| uniform(&[trial.seed, purpose, drone as u64]);
    let mut all: Vec<usize> = (0..trial.drones as usize).collect();
    all.sort_by(|&a, &b| draw(VICTIM, a).total_cmp(&draw(VICTIM, b)));
    let moment = |drone: usize| (draw(MOMENT, drone) * FAILING_S / dt_s) as u64;
    let mut deaths: Vec<(u64, usize)> = all.into_iter().take(count).map(|drone| (moment(drone), drone)).collect();
    deaths.sort_by(|a, b| b.cmp(a));
    deaths
}
