//! Every course of the exchange of lines between drones on a straight track, on the machine that flies
//! (`agent/src/separation/separation_pair.rs`): docs/safety.md, "By word alone".
//!
//! Drones stand on the places of the track. A drone may state a new line, move by one place, hear any statement that was ever
//! made to it, or be killed and restarted with empty memory. So a message may be lost, late, doubled and overtaken in every
//! way. Lines have bounded numbers, and so the courses are explored completely.
#![allow(clippy::unwrap_used, clippy::disallowed_macros, reason = "a test, which prints what it found")]

use skein_agent::separation::separating_line::{SeparatingLine, Side};
use skein_agent::separation::separation_pair::{SeparationPair, Statement};
use skein_protocol::{SimTime, Vec2};
use stateright::{Checker, Model, Property};
use std::hash::{Hash, Hasher};

/// Number of places of the track.
const PLACES: i32 = 4;
/// Two drones keep this distance, in places.
const KEEP: f64 = 1.0;

/// The mission that is explored.
#[derive(Clone, Copy, Debug)]
struct Track {
    drones: usize,
    /// The greatest number of a line.
    numbers: u32,
    /// Number of new lines, over all pairs.
    proposals: u32,
    /// Number of restarts.
    restarts: u32,
    /// Whether a drone keeps to the old lines until the other one is bound to the new one. Without it the rule is broken.
    waits_for_acknowledgement: bool,
    /// Whether a restarted drone makes a first line only if the other one has said that it knows none either. Without it the rule is broken.
    waits_for_invitation: bool,
}

/// A statement on its way.
#[derive(Clone, Debug, PartialEq)]
struct Sent {
    from: usize,
    to: usize,
    statement: Statement,
}

impl Sent {
    fn key(&self) -> (usize, usize, u32, u32, u32, u64) {
        let Statement { bound_to, incarnation, addressed } = self.statement;
        (self.from, self.to, incarnation, addressed, bound_to.number, bound_to.line.stop_m().to_bits())
    }
}

#[derive(Clone, Debug, PartialEq)]
struct State {
    places: Vec<i32>,
    incarnations: Vec<u32>,
    /// `pairs[i][j]`: what drone `i` knows of drone `j`. The entry of a drone with itself is unused.
    pairs: Vec<Vec<SeparationPair>>,
    sent: Vec<Sent>,
    proposals: u32,
    restarts: u32,
}

impl Eq for State {}

impl Hash for State {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.places.hash(state);
        self.incarnations.hash(state);
        for (i, j) in (0..self.places.len()).flat_map(|i| (0..self.places.len()).map(move |j| (i, j))) {
            self.pairs[i][j].hash(state);
        }
        (self.proposals, self.restarts).hash(state);
        self.sent.iter().for_each(|sent| sent.key().hash(state));
    }
}

#[derive(Clone, Debug, PartialEq)]
enum Action {
    Propose { drone: usize, peer: usize, place: i32 },
    Open { drone: usize, peer: usize, place: i32 },
    Move { drone: usize, by: i32 },
    Hear(usize),
    LearnIncarnation { drone: usize, peer: usize },
    Restart { drone: usize },
}

/// The line between `place` and the next one.
fn line(place: i32) -> SeparatingLine {
    SeparatingLine::resting(SimTime::ZERO, Vec2::x(), f64::from(place) + 0.5)
}

/// Whether a drone that stands on `place` keeps to a line.
fn keeps(place: i32, line: &SeparatingLine, side: Side) -> bool {
    side.sign() * (f64::from(place) - line.stop_m()) >= KEEP / 2.0
}

/// The lower id is in front.
fn side(drone: usize, peer: usize) -> Side {
    if drone < peer { Side::Front } else { Side::Back }
}

impl Track {
    fn explore(self) -> impl Checker<Self> {
        self.checker().threads(2).spawn_bfs().join()
    }

    /// Says every line to which the drone is bound: which of them it says in flight does not matter.
    fn say(state: &mut State, from: usize, to: usize) {
        let pair = &state.pairs[from][to];
        let lacks = pair.lacks_line().map(|statement| Sent { from, to, statement });
        let newest = pair.statement();
        let bound_to = |bound_to| newest.map(|newest| Sent { from, to, statement: Statement { bound_to, ..newest } });
        let lines = pair.lines().iter().filter_map(|&line| bound_to(line)).chain(lacks);
        let new: Vec<Sent> = lines.filter(|sent| !state.sent.contains(sent)).collect();
        state.sent.extend(new);
        // The order in which statements were made does not matter.
        state.sent.sort_by_key(Sent::key);
    }
}

impl Model for Track {
    type State = State;
    type Action = Action;

    fn init_states(&self) -> Vec<State> {
        let n = self.drones;
        let places: Vec<i32> = (0..n as i32).map(|i| PLACES - 1 - i).collect();
        let pair = |i: usize, j: usize| SeparationPair::new(side(i, j), line(places[i.max(j)]));
        let pairs = (0..n).map(|i| (0..n).map(|j| pair(i, j)).collect()).collect();
        vec![State { places, incarnations: vec![1; n], pairs, sent: Vec::new(), proposals: 0, restarts: 0 }]
    }

    fn actions(&self, state: &State, actions: &mut Vec<Action>) {
        let others = |drone: usize| (0..self.drones).filter(move |&peer| peer != drone);
        for drone in 0..self.drones {
            let place = state.places[drone];
            let free = |to: i32| {
                others(drone).all(|peer| {
                    let pair = &state.pairs[drone][peer];
                    pair.has_agreed() && pair.lines().iter().all(|l| keeps(to, &l.line, pair.side()))
                })
            };
            actions.extend([-1, 1].map(|by| Action::Move { drone, by }).into_iter().filter(|action| {
                matches!(action, Action::Move { by, .. } if (0..PLACES).contains(&(place + by)) && free(place + by))
            }));
            for peer in others(drone) {
                let newest = state.pairs[drone][peer].statement().map_or(u32::MAX, |said| said.bound_to.number);
                if newest.saturating_add(2) <= self.numbers && state.proposals < self.proposals {
                    let lines = (0..PLACES - 1).filter(|&to| keeps(place, &line(to), side(drone, peer)));
                    actions.extend(lines.map(|place| Action::Propose { drone, peer, place }));
                }
                let lacks = |sent: &&Sent| (sent.from, sent.to) == (peer, drone);
                let pair = &state.pairs[drone][peer];
                let mut heard = state.sent.iter().filter(lacks);
                let invited = heard.any(|sent| pair.may_open(&sent.statement)) || !self.waits_for_invitation;
                if state.proposals < self.proposals && invited && pair.lines().is_empty() {
                    let lines = (0..PLACES - 1).filter(|&to| keeps(place, &line(to), side(drone, peer)));
                    actions.extend(lines.map(|place| Action::Open { drone, peer, place }));
                }
                actions.push(Action::LearnIncarnation { drone, peer });
            }
            if state.restarts < self.restarts {
                actions.push(Action::Restart { drone });
            }
        }
        actions.extend((0..state.sent.len()).map(Action::Hear));
    }

    fn next_state(&self, last: &State, action: Action) -> Option<State> {
        let mut state = last.clone();
        match action {
            Action::Propose { drone, peer, place } => {
                state.proposals += 1;
                if !state.pairs[drone][peer].propose(line(place), SimTime::ZERO, usize::MAX) {
                    return None;
                }
                if !self.waits_for_acknowledgement {
                    // As if the other drone had confirmed the new line.
                    let mut confirmed = state.pairs[drone][peer].statement()?;
                    std::mem::swap(&mut confirmed.incarnation, &mut confirmed.addressed);
                    state.pairs[drone][peer].hear(&confirmed, |_| true);
                }
                Self::say(&mut state, drone, peer);
            }
            Action::Open { drone, peer, place } => {
                state.proposals += 1;
                if !state.pairs[drone][peer].open(line(place)) {
                    return None;
                }
                Self::say(&mut state, drone, peer);
            }
            Action::Move { drone, by } => state.places[drone] += by,
            Action::Hear(index) => {
                let Sent { from, to, statement } = state.sent[index].clone();
                let place = state.places[to];
                let side = side(to, from);
                state.pairs[to][from].hear(&statement, |line| keeps(place, line, side));
                Self::say(&mut state, to, from);
            }
            Action::LearnIncarnation { drone, peer } => {
                let incarnation = state.incarnations[peer];
                state.pairs[drone][peer].hear_incarnation(incarnation);
                Self::say(&mut state, drone, peer);
            }
            Action::Restart { drone } => {
                state.restarts += 1;
                state.incarnations[drone] += 1;
                let incarnation = state.incarnations[drone];
                for peer in (0..self.drones).filter(|peer| *peer != drone) {
                    state.pairs[drone][peer] = SeparationPair::restarted(side(drone, peer), incarnation);
                    Self::say(&mut state, drone, peer);
                }
            }
        }
        (state != *last).then_some(state)
    }

    fn properties(&self) -> Vec<Property<Self>> {
        vec![
            Property::always("no two drones are on one place", |_: &Self, state: &State| {
                let mut places = state.places.clone();
                places.sort_unstable();
                places.windows(2).all(|pair| pair[0] < pair[1])
            }),
            Property::sometimes("a drone takes room that another one gave", |_: &Self, state: &State| {
                let start = |drone: usize| PLACES - 1 - drone as i32;
                let drones = 0..state.places.len();
                drones.clone().any(|i| drones.clone().any(|j| i != j && state.places[i] == start(j)))
            }),
            Property::sometimes("two drones agree again that were both restarted", |track: &Self, state: &State| {
                let again = |i: usize, j: usize| state.incarnations[i] > 1 && state.pairs[i][j].has_agreed();
                track.restarts < 2 || (again(0, 1) && again(1, 0))
            }),
        ]
    }
}

/// Explores all courses and asserts the number of different states, so that no part of the state space gets lost unnoticed.
fn safe(track: Track, states: usize) {
    let checker = track.explore();
    println!("{track:?}: {} states", checker.unique_state_count());
    checker.assert_properties();
    assert_eq!(checker.unique_state_count(), states);
}

const TRACK: Track = Track {
    drones: 2,
    numbers: 4,
    proposals: 4,
    restarts: 0,
    waits_for_acknowledgement: true,
    waits_for_invitation: true,
};

#[test]
fn no_two_drones_take_the_same_room() {
    safe(TRACK, 48_052);
    safe(Track { drones: 3, numbers: 2, proposals: 2, ..TRACK }, 54_056);
}

#[test]
fn a_restarted_drone_takes_no_room_that_its_predecessor_gave() {
    safe(Track { restarts: 2, numbers: 2, ..TRACK }, 448_084);
}

#[test]
fn without_acknowledgements_two_drones_meet() {
    let checker = Track { waits_for_acknowledgement: false, ..TRACK }.explore();
    let course = checker.discovery("no two drones are on one place").unwrap();
    println!("{:#?}", course.last_state());
    assert!(course.into_actions().len() <= 6);
}

#[test]
fn without_an_invitation_two_drones_meet() {
    let checker = Track { restarts: 2, waits_for_invitation: false, ..TRACK }.explore();
    let course = checker.discovery("no two drones are on one place").unwrap();
    println!("{:#?}", course.last_state());
}
