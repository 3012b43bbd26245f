//! Safety by word alone: for drones that sense no neighbours. Each pair of drones is separated by a line, and each of the two drones
//! keeps its braking path half of the distance to keep away from it. The two drones change the line by messages that may be
//! late, lost, doubled or reordered. `docs/safety.md`, "By word alone", states and proves the rule.

pub mod own_path;
mod relayed_lines;
pub mod separating_line;
pub mod separation_pair;

use crate::tuning::STILL_MPS;
use own_path::OwnPath;
use relayed_lines::{Distances, RelayedLines};
use separating_line::{SeparatingLine, Side};
use separation_pair::{MAX_LINES, NO_LINE, NumberedLine, SeparationPair, Statement};
use skein_leader::peers::Peers;
use skein_protocol::payload::{MAX_SEPARATORS, Pose, Separation, Separator};
use skein_protocol::scale::Scale;
use skein_protocol::{DroneId, Message, SimTime, Vec2, raised};
use std::sync::Arc;

/// Greatest number of messages in which a drone states its lines at one time. A larger swarm states the lines of near pairs more
/// often.
const MAX_MESSAGES: usize = 2;
/// A new line is stated only if it differs from the present one by this much, m, or if it turned.
const SHIFT_M: f64 = 0.25;
/// A line keeps its normal while the wanted normal differs by less than this, as the sine of the angle.
const TURN: f64 = 0.1;
/// Two drones fly side by side if their mean speed along the line between them is below this, m/s.
const ABREAST_MPS: f64 = 0.5;
/// Silence of the drone whose turn it is to make lines, in times of the round trip, after which the other one makes a line.
const PATIENCE_ROUND_TRIPS: f64 = 1.0;
/// The same as a time, s. It is added.
const PATIENCE_S: f64 = 0.5;
/// Time without a new line, in times of this patience, after which a drone makes one however many it is bound to.
const LAST_PATIENCE: f64 = 10.0;
/// A path is kept this far beyond what a new line demands, m, so that rounding does not matter.
const ROUNDING_M: f64 = 1e-6;

/// Of two drones that are both still and nearer to each other than this, in distances to keep, one has all the room between them.
const CLOSE: f64 = 2.0;
/// The two have it in turn: the one with the lower id first, for this long, s.
const FRONT_TURN_S: f64 = 60.0;
/// Then the one with the higher id, for this long, s.
const BACK_TURN_S: f64 = 20.0;

/// Two drones that are this far beside each other, in distances to keep, can fly past each other. Chosen by hand: drones that follow each other
/// round a corner are less far aside.
const ASIDE: f64 = 2.0;
/// One drone flies ahead of another one if the direction from this to that has at least this component along the flight. No unit. The cosine
/// of 45°.
const AHEAD: f64 = std::f64::consts::FRAC_1_SQRT_2;
/// It flies beside the other one if that component is at most this. No unit. The cosine of 30°. Chosen by hand: a line along the flight leaves
/// little room to the side between drones of which one is almost straight ahead.
const BESIDE: f64 = 0.866;
/// A drone of which the last word is older than this is lost, s. Chosen by hand: longer than words take over several other drones.
const OLD_S: f64 = 5.0;

/// A line that moves for longer than this is no line that a drone makes, s.
const LONGEST_MOTION_S: f64 = 300.0;

/// Constants of the exchange.
#[derive(Clone, Debug)]
pub struct SeparationParams {
    /// This drone.
    pub me: DroneId,
    /// Incarnation of its process, from 1.
    pub incarnation: u32,
    /// Where each drone starts, world frame, m. All drones know it.
    pub starts_m: Arc<[Vec2]>,
    /// The velocity at the start, world frame, m/s.
    pub start_velocity: Vec2,
    /// Time for which drones keep this velocity before the first command takes effect, s.
    pub reaction_time_s: f64,
    /// Distance that two drones keep, m.
    pub keep_m: f64,
    /// Distance over which drones hear each other, m; infinite without a limit.
    pub radio_range_m: f64,
    /// Deceleration of full braking, m/s².
    pub braking_mps2: f64,
    /// Time between two statements, s.
    pub period_s: f64,
    /// Length of a tick, s.
    pub dt_s: f64,
}

/// Number of messages in which each drone of a swarm states its lines at one time.
#[must_use]
pub fn messages(drones: usize) -> usize {
    drones.saturating_sub(1).div_ceil(MAX_SEPARATORS).min(MAX_MESSAGES)
}

/// What a drone knows of its lines with one other drone.
#[derive(Clone, Debug)]
struct Known {
    pair: SeparationPair,
    peer: DroneId,
    /// The newest line that the other drone has stated.
    heard: Option<NumberedLine>,
    /// When this drone last stated its line.
    said: SimTime,
    /// When the line last changed.
    changed: SimTime,
    /// What this drone ranges of the other one in this tick.
    seen: Option<Sighting>,
    /// Whether this drone makes a first line if there is none.
    opens: bool,
    /// Whether it last said what it says in turn with its newest line.
    answered: bool,
    /// Whether the other drone has been restarted and was not heard since to be bound to a line of this drone.
    forgotten: bool,
    /// How often this drone has spoken to it.
    turn: usize,
}

impl Known {
    fn new(pair: SeparationPair, peer: DroneId, changed: SimTime) -> Self {
        Self {
            pair,
            peer,
            heard: None,
            said: SimTime::ZERO,
            changed,
            seen: None,
            opens: false,
            answered: false,
            forgotten: false,
            turn: 0,
        }
    }

    /// Hears which incarnation of the other drone speaks.
    fn hear_incarnation(&mut self, incarnation: u32) {
        self.forgotten |= self.pair.hear_incarnation(incarnation);
    }

    /// What is to be said now: the newest line; each line in turn if the other drone has forgotten them; or, every other time, an answer to
    /// the other drone. Without a line, that there is none, unless ranging keeps the two apart.
    fn statement(&mut self, ranges: bool) -> Option<Statement> {
        let answer = self.pair.answer().filter(|_| !self.answered);
        self.answered = answer.is_some();
        self.turn = self.turn.wrapping_add(1);
        let in_turn = if self.forgotten { self.pair.statement_in_turn(self.turn) } else { None };
        in_turn.or(answer).or_else(|| self.pair.statement()).or_else(|| self.pair.lacks_line().filter(|_| !ranges))
    }
}

/// What a drone ranges of another one, world frame. It may be wrong in any way: it helps to place lines well, and nothing else.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sighting {
    /// Position, m.
    pub position: Vec2,
    /// Velocity, m/s.
    pub velocity: Vec2,
}

/// The lines between one drone and all others.
#[derive(Clone, Debug)]
pub struct Separations {
    params: SeparationParams,
    /// Whether what the drones range of each other keeps them apart where there is no line.
    ranges: bool,
    known: Vec<Known>,
    /// How far away the farthest drone is that this drone hears, m; `None` while all drones hear each other.
    reach_m: Option<f64>,
    /// Lines of others that this drone passes on.
    relayed: RelayedLines,
    /// Whether this drone passed lines on when it last spoke.
    relays_last: bool,
    /// Order in which lines are stated: scratch memory.
    order: Vec<(f64, usize)>,
}

impl Separations {
    /// The lines at the start, which follow from where the drones start. A restarted drone knows no lines.
    #[must_use]
    pub fn new(params: SeparationParams, now: SimTime) -> Self {
        let (me, incarnation) = (params.me, params.incarnation);
        let known = params.others().map(|peer| {
            let side = side_of(me, peer);
            let pair = match incarnation {
                0 | 1 => SeparationPair::new(side, params.first_line(me.min(peer), me.max(peer))),
                _ => SeparationPair::restarted(side, incarnation),
            };
            Known::new(pair, peer, now)
        });
        let known = known.collect();
        Self::of(params, known, false)
    }

    /// No lines: so far, what the drones range of each other keeps them apart.
    #[must_use]
    pub fn unbound(params: SeparationParams, now: SimTime) -> Self {
        let (me, incarnation) = (params.me, params.incarnation);
        let known = params.others().map(|peer| {
            let pair = SeparationPair::restarted(side_of(me, peer), incarnation);
            Known::new(pair, peer, now)
        });
        let known = known.collect();
        Self::of(params, known, true)
    }

    fn of(params: SeparationParams, known: Vec<Known>, ranges: bool) -> Self {
        let relayed = RelayedLines::default();
        Self { params, ranges, known, reach_m: None, relayed, relays_last: false, order: Vec::new() }
    }

    /// From now on, makes a first line with every other drone with which there is none.
    pub fn open_all(&mut self) {
        self.known.iter_mut().for_each(|known| known.opens = true);
    }

    /// Whether this drone and another one have a common line, as far as this drone knows.
    #[must_use]
    pub fn has_agreed(&self, peer: DroneId) -> bool {
        self.known.get(self.place(peer)).is_some_and(|known| known.peer == peer && known.pair.has_agreed())
    }

    /// Whether this drone knows that it has a common line with every other drone.
    #[must_use]
    pub fn has_agreed_with_all(&self) -> bool {
        self.known.iter().all(|known| known.pair.has_agreed())
    }

    /// The lines to which this drone is bound, and its side of each.
    pub fn lines(&self) -> impl Iterator<Item = (&SeparatingLine, Side)> {
        self.known
            .iter()
            .flat_map(|known| known.pair.lines().iter().map(|numbered| (&numbered.line, known.pair.side())))
    }

    /// Notes how far away the farthest drone is that this drone hears, m; `None` while all drones hear each other. Lines of others are
    /// passed on only where some drones do not hear each other.
    pub fn set_reach(&mut self, reach_m: Option<f64>) {
        self.reach_m = reach_m;
        if reach_m.is_none() {
            self.relayed.clear();
        }
    }

    /// Hears the lines in a message of `source`. `path`: this drone's path with full braking from now on.
    pub fn hear(&mut self, source: DroneId, separation: &Separation, peers: &Peers, path: &OwnPath) {
        let speaker = separation.drone(source);
        self.hear_own(speaker, separation, path);
        if let Some(reach_m) = self.reach_m.filter(|_| self.params.knows(speaker) && speaker != self.params.me) {
            self.hear_others(source, separation, reach_m, peers, path);
        }
    }

    /// Hears the lines in a message of `source` that are meant for other drones.
    fn hear_others(&mut self, source: DroneId, separation: &Separation, reach_m: f64, peers: &Peers, path: &OwnPath) {
        let (me, params) = (self.params.me, &self.params);
        let place = |drone: DroneId| peers.last(drone).map_or(params.start(drone), |pose| pose.position());
        let speaker = separation.drone(source);
        let (from, of) = (place(source), place(speaker));
        for line in separation.separators().iter().filter(|line| line.peer != me && params.knows(line.peer)) {
            let to = place(line.peer);
            let (said_m, own_m) = ((from - to).norm(), (path.end() - to).norm());
            let distances = Distances { said_m, own_m, pair_m: (of - to).norm(), reach_m };
            self.relayed.hear(path.now(), speaker, line, source == speaker, distances);
        }
    }

    /// Hears the lines of `speaker` that are meant for this drone.
    fn hear_own(&mut self, speaker: DroneId, separation: &Separation, path: &OwnPath) {
        let (me, half_m) = (self.params.me, self.params.keep_m / 2.0);
        let ranges = self.ranges;
        let Some(known) = self.find(speaker) else { return };
        for separator in separation.separators().iter().filter(|s| s.peer == me) {
            let heard = statement(separator);
            known.opens |= !ranges && known.pair.may_open(&heard);
            let motion_s = heard.bound_to.line.rests_after_s(path.now());
            if !known.pair.counts(&heard) || heard.bound_to.number == NO_LINE || motion_s > LONGEST_MOTION_S {
                continue;
            }
            if known.heard.is_none_or(|before| before.number < heard.bound_to.number) {
                known.heard = Some(heard.bound_to);
                known.changed = path.now();
            }
            let side = known.pair.side();
            known.pair.hear(&heard, |line| path.distance_m(line, side) >= half_m);
            known.forgotten &= !known.pair.is_bound_to(heard.bound_to.number);
            known.opens |= ranges;
        }
    }

    /// Hears which incarnation of another drone speaks.
    pub fn hear_incarnation(&mut self, source: DroneId, incarnation: u32) {
        if let Some(known) = self.find(source) {
            known.hear_incarnation(incarnation);
        }
    }

    /// Notes what this drone ranges of another one in this tick.
    pub fn see(&mut self, peer: DroneId, sighting: Sighting) {
        if let Some(known) = self.find(peer) {
            known.seen = Some(sighting);
        }
    }

    /// Makes new lines and states them, if that is due. Call once per tick, before the command of the tick is computed.
    pub fn speak(&mut self, peers: &Peers, path: &OwnPath, say: &mut Vec<Message>) {
        if self.params.is_due(path.tick()) {
            self.state(peers, path, say);
        }
        self.known.iter_mut().for_each(|known| known.seen = None);
    }

    fn state(&mut self, peers: &Peers, path: &OwnPath, say: &mut Vec<Message>) {
        let messages = messages(self.params.starts_m.len());
        let passes_on = self.pass_on(path.now(), messages, say);
        self.state_own(messages - usize::from(passes_on), peers, path, say);
    }

    /// Passes lines of others on, in one of the messages that this drone may say now. A drone that may say one message says its own
    /// lines every other time. Returns whether it passed lines on.
    fn pass_on(&mut self, now: SimTime, messages: usize, say: &mut Vec<Message>) -> bool {
        let is_turn = self.reach_m.is_some() && (messages > 1 || !self.relays_last);
        let relayed = if is_turn { self.relayed.speak(now) } else { None };
        self.relays_last = relayed.is_some();
        say.extend(relayed.map(Message::Separation));
        self.relays_last
    }

    /// States the lines to which this drone is bound, in so many messages.
    fn state_own(&mut self, messages: usize, peers: &Peers, path: &OwnPath, say: &mut Vec<Message>) {
        let now = path.now();
        self.order.clear();
        for (index, known) in self.known.iter().enumerate() {
            let distance_m = peers.last(known.peer).map_or(0.0, |pose| (pose.position() - path.end()).norm());
            let urgency = now.since(known.said) / (self.params.keep_m + distance_m);
            self.order.push((-urgency, index));
        }
        self.order.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        self.order.truncate(messages * MAX_SEPARATORS);
        let mut separators = Vec::with_capacity(self.order.len());
        for &(_, index) in &self.order {
            let known = &mut self.known[index];
            known.said = now;
            if let Some(pose) = peers.last(known.peer).map(|beacon| beacon.pose()) {
                // A drone that is out of reach may have been restarted: its state is passed on.
                known.hear_incarnation(pose.incarnation);
                let pose = known.seen.map_or(pose, |seen| seen.at(now, &pose));
                let lost = !peers.is_living(known.peer, now) || now.since(pose.stamp) > OLD_S;
                self.params.propose(known, &pose, lost, peers.delay_s(), path);
            }
            separators.extend(known.statement(self.ranges).map(|said| separator(known.peer, &said)));
        }
        say.extend(separators.chunks(MAX_SEPARATORS).map(message));
    }

    /// The index of what is known of another drone.
    fn place(&self, peer: DroneId) -> usize {
        peer.index() - usize::from(peer > self.params.me)
    }

    fn find(&mut self, peer: DroneId) -> Option<&mut Known> {
        let place = self.place(peer);
        self.known.get_mut(place).filter(|known| known.peer == peer)
    }
}

impl Sighting {
    /// The beacon that the other drone would send now.
    fn at(&self, now: SimTime, last: &Pose) -> Pose {
        let (position_m, velocity_mps) = (raised(self.position, 0.0), raised(self.velocity, 0.0));
        Pose { stamp: now, position_m, velocity_mps, ..*last }
    }
}

fn statement(separator: &Separator) -> Statement {
    let line = SeparatingLine::of_message(separator);
    Statement {
        bound_to: NumberedLine { number: separator.number, line },
        incarnation: separator.incarnation.into(),
        addressed: separator.peer_incarnation.into(),
    }
}

fn separator(peer: DroneId, said: &Statement) -> Separator {
    Separator {
        peer,
        number: said.bound_to.number,
        incarnation: said.incarnation as u16,
        peer_incarnation: said.addressed as u16,
        ..said.bound_to.line.to_message()
    }
}

fn message(separators: &[Separator]) -> Message {
    let mut message = Separation { count: separators.len() as u32, of: 0, separators: Default::default() };
    message.separators[..separators.len()].copy_from_slice(separators);
    Message::Separation(message)
}

/// Where a drone would stop, as far as this drone knows, and how it moves.
#[derive(Clone, Copy, Debug)]
struct Stop {
    at: Vec2,
    velocity: Vec2,
}

/// Which of two drones that are still and close has all the room between them. Each of the two says so by its own clock: where their clocks
/// differ, they differ for that long in each turn about the line to make, and in nothing else.
fn turn_at(now: SimTime) -> Side {
    let into_turns_s = now.secs() % (FRONT_TURN_S + BACK_TURN_S);
    if into_turns_s < FRONT_TURN_S { Side::Front } else { Side::Back }
}

/// The side of drone `me` of its lines with another one.
fn side_of(me: DroneId, peer: DroneId) -> Side {
    if me < peer { Side::Front } else { Side::Back }
}

impl SeparationParams {
    /// How small the swarm is. The lengths and speeds in this file are those at full scale. Drones that start at rest have no speed to
    /// compare with.
    fn scale(&self) -> Scale {
        let speed_mps = self.start_velocity.norm();
        if speed_mps > 0.0 { Scale::of(self.keep_m, speed_mps) } else { Scale::FULL }
    }

    /// All drones but this one.
    fn others(&self) -> impl Iterator<Item = DroneId> + use<> {
        let me = self.me;
        (0..self.starts_m.len() as u32).map(DroneId).filter(move |&peer| peer != me)
    }

    /// Whether there is a drone with this id.
    fn knows(&self, drone: DroneId) -> bool {
        drone.index() < self.starts_m.len()
    }

    /// Where a drone starts, m.
    fn start(&self, drone: DroneId) -> Vec2 {
        self.starts_m.get(drone.index()).copied().unwrap_or_default()
    }

    /// Whether a statement is due. Those of different drones fall into different ticks.
    fn is_due(&self, tick: u64) -> bool {
        let period = ((self.period_s / self.dt_s).round() as u64).max(1);
        tick % period == u64::from(self.me.0) % period
    }

    /// The line between two drones at the start. `front` has the lower id. It moves as the two drones do if their first command is to
    /// brake fully: at constant speed for the reaction time, and then with constant deceleration.
    fn first_line(&self, front: DroneId, back: DroneId) -> SeparatingLine {
        let (velocity, braking) = (self.start_velocity, self.braking_mps2);
        let normal = (self.start(front) - self.start(back)).try_normalize(1e-9).unwrap_or(Vec2::x());
        let line = SeparatingLine::resting(SimTime::ZERO.after(self.reaction_time_s), normal, 0.0);
        let speed = velocity.norm();
        let way = velocity * (self.reaction_time_s + speed / (2.0 * braking));
        let middle = (self.start(front) + self.start(back)) / 2.0 + way;
        let along = line.normal().dot(&velocity);
        let way_m = along * speed / (2.0 * braking);
        let moving = line.shifted(line.normal().dot(&middle));
        if speed > 0.0 { moving.arriving_at(way_m, braking * along.abs() / speed) } else { moving }
    }

    /// Makes a new line, if it is this drone's turn and the new line is better than the present one. `lost`: whether the last word of the
    /// other drone is too old.
    fn propose(&self, known: &mut Known, pose: &Pose, lost: bool, delay_s: f64, path: &OwnPath) {
        let now = path.now();
        let age_s = now.since(pose.stamp).max(0.0);
        let late_s = age_s.max(delay_s);
        let stopped = pose.position() + pose.velocity() * (pose.velocity().norm() / (2.0 * self.braking_mps2));
        let stop = self.peer_stop(known, stopped, pose.velocity(), age_s);
        let own = Stop { at: path.end(), velocity: path.velocity() };
        let Some(towards_me) = (own.at - stop.at).try_normalize(1e-9) else { return };
        let Some(Statement { bound_to: stated, .. }) = known.pair.statement() else {
            let first = if known.opens { self.line(None, known.pair.side(), &own, &stop, late_s, path) } else { None };
            if first.is_some_and(|line| known.pair.open(line)) {
                known.changed = now;
            }
            return;
        };
        // A drone that is out of reach would not hear of a line that binds this one.
        if lost && self.radio_range_m.is_finite() {
            return;
        }
        let side = known.pair.side();
        let along_mps = towards_me.dot(&(own.velocity + stop.velocity)) / 2.0;
        let abreast_mps = self.scale().speed(ABREAST_MPS);
        let ahead = along_mps > abreast_mps || (along_mps >= -abreast_mps && side == Side::Front);
        let patience_s = PATIENCE_S + PATIENCE_ROUND_TRIPS * 2.0 * late_s + self.period_s;
        let unchanged_s = now.since(known.changed);
        if !ahead && unchanged_s < patience_s {
            return;
        }
        let Some(line) = self.line(Some(&stated.line), side, &own, &stop, late_s, path) else { return };
        let turned = line.normal() != stated.line.normal();
        let shifted_m = (line.offset_m(now, late_s) - stated.line.offset_m(now, late_s)).abs();
        let most = if unchanged_s < LAST_PATIENCE * patience_s { MAX_LINES } else { usize::MAX };
        if (turned || shifted_m >= self.scale().length(SHIFT_M)) && known.pair.propose(line, path.earliest(), most) {
            known.changed = now;
        }
    }

    /// Where the other drone would stop now. It is taken to have flown on since its beacon, by which it would have stopped `at` this place, as
    /// far as the line allows that it stated last.
    fn peer_stop(&self, known: &Known, at: Vec2, velocity: Vec2, age_s: f64) -> Stop {
        let mut flown_s = age_s;
        if let Some(NumberedLine { line, .. }) = known.heard.or(known.pair.statement().map(|said| said.bound_to)) {
            let side = known.pair.side().opposite().sign();
            let room_m = side * (line.normal().dot(&at) - line.stop_m()) - self.keep_m / 2.0;
            let closing_mps = -side * line.normal().dot(&velocity);
            if closing_mps > 0.0 {
                flown_s = flown_s.min((room_m / closing_mps).max(0.0));
            }
        }
        Stop { at: at + velocity * flown_s, velocity }
    }

    /// Whether two drones that would stop this far `apart` (m) hear of each other over other drones only, or not at all.
    fn is_far(&self, apart: Vec2) -> bool {
        apart.norm() > self.radio_range_m
    }

    /// The normal of a line between this drone and another one, on this drone's side. `apart`: from where that one would stop to where this one
    /// would, m. Two drones that do not hear each other get a line along the flight, if they fly beside each other and far enough from each
    /// other: then each of them can fly on without a word from the other.
    fn normal(&self, apart: Vec2) -> Option<Vec2> {
        let direction = apart.try_normalize(1e-9)?;
        let beside = direction.x.abs() <= BESIDE && apart.y.abs() >= ASIDE * self.keep_m;
        Some(if beside && self.is_far(apart) { Vec2::new(0.0, apart.y.signum()) } else { direction })
    }

    /// The best line between this drone and another one, to which this drone's path keeps; `None` if there is none. When the
    /// other drone hears of it, both will have flown on for `late_s`. The line is in the middle of where they would stop then, as
    /// far as this drone's path now and the other's path then allow.
    fn line(
        &self,
        present: Option<&SeparatingLine>,
        side: Side,
        own: &Stop,
        peer: &Stop,
        late_s: f64,
        path: &OwnPath,
    ) -> Option<SeparatingLine> {
        let now = path.now();
        let half_m = self.keep_m / 2.0;
        let wanted = self.normal(own.at - peer.at)? * side.sign();
        let keeps =
            |line: &&SeparatingLine| line.normal().perp(&wanted).abs() < TURN && line.normal().dot(&wanted) > 0.0;
        let resting = match present.filter(keeps) {
            Some(present) => SeparatingLine::resting(now, present.normal(), 0.0).with_normal_of(present),
            None => SeparatingLine::resting(now, wanted, 0.0),
        };
        // From here on along the direction from the other drone to this one.
        let n = resting.normal() * side.sign();
        let (own_m, peer_m) = (n.dot(&own.at), n.dot(&peer.at));
        let (own_mps, peer_mps) = (n.dot(&own.velocity), n.dot(&peer.velocity));
        let middle_m = (own_m + peer_m + (own_mps + peer_mps) * late_s) / 2.0;
        let peer_needs_m = peer_m.max(peer_m + peer_mps * late_s) + half_m;
        let close = own_m - peer_m < CLOSE * self.keep_m;
        let still = own.velocity.norm().max(peer.velocity.norm()) < self.scale().speed(STILL_MPS);
        let leads = self.is_far(own.at - peer.at)
            && n.x > AHEAD
            && own_mps > 0.0
            && (own_mps + peer_mps) / 2.0 > self.scale().speed(ABREAST_MPS);
        // The first line is in the middle: the other drone, which hovers, must keep to it.
        let aimed_m = match (close && still && present.is_some(), side == turn_at(now)) {
            // A drone that flies far behind has most of the room: it may hear of the next line late.
            (false, _) if leads => middle_m.max(own_m - self.keep_m),
            (false, _) => middle_m,
            // Two drones that block each other would wait for ever if each of them always left the other one half of the room.
            (true, true) => peer_m + half_m,
            (true, false) => own_m - half_m,
        };
        let stop_m = aimed_m.max(peer_needs_m).min(own_m - half_m);
        // How much of the way of this drone's path the line has still to go, so that this drone's path keeps to it.
        let speed = own.velocity.norm();
        let spare_m = own_m - half_m - stop_m;
        let way_m = own_mps * speed / (2.0 * self.braking_mps2) - spare_m;
        let mut line = resting.shifted(side.sign() * stop_m);
        if own_mps > 0.0 && way_m > 0.0 {
            line = line.arriving(side.sign() * way_m, self.braking_mps2 * own_mps / speed, self.braking_mps2);
        }
        let missing_m = half_m + ROUNDING_M - path.distance_m(&line, side);
        let line = if missing_m > 0.0 { line.shifted(-side.sign() * missing_m) } else { line };
        (path.distance_m(&line, side) >= half_m).then_some(line)
    }
}

#[cfg(test)]
mod tests;
