//! A swarm in simulated time, with a lossy channel between the drones.

use super::{Breach, Periods, SPEED_MPS, Watch, disunion, params, step};
use skein_leader::leading::Leading;
use skein_leader::own_state::OwnState;
use skein_protocol::digest::Digest;
use skein_protocol::shape::ConvexShape;
use skein_protocol::{Ballot, DroneId, Message, ObstacleId, SimTime, Vec2};
use std::collections::BTreeMap;

/// Channel between the drones. Loss and delay of each message are drawn by a keyed hash.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Air {
    pub seed: u64,
    /// Probability that a receiver loses a message, 0 to 1.
    pub loss: f64,
    /// Mean delay, s.
    pub delay_s: f64,
    /// Greatest deviation of the delay from its mean, s.
    pub jitter_s: f64,
}

impl Air {
    /// A random number from 0 to 1 for this message and receiver. `purpose` separates independent draws.
    fn draw(&self, purpose: u64, sequence: u64, to: usize) -> f64 {
        let mut digest = Digest::default();
        digest.word(self.seed).word(purpose).word(sequence).word(to as u64);
        (digest.value() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Delay of a message to a receiver, s; `None` if it is lost.
    fn delay_s(&self, sequence: u64, to: usize) -> Option<f64> {
        let delivered = self.draw(1, sequence, to) >= self.loss;
        delivered.then(|| self.delay_s + self.jitter_s * (2.0 * self.draw(2, sequence, to) - 1.0))
    }
}

/// A message under way: tick at which it is due, source, sequence number, destination.
pub(crate) type Post = (u64, usize, u64, usize);

/// The leadership state machines of all drones, their motion, and the channel between them.
#[derive(Clone)]
pub(crate) struct Swarm {
    pub periods: Periods,
    pub air: Air,
    pub tick: u64,
    /// State machine of each drone; `None` if the drone is dead.
    pub drones: Vec<Option<Leading>>,
    /// Whether each drone is frozen: alive, but it does nothing and hears nothing.
    pub frozen: Vec<bool>,
    pub incarnations: Vec<u32>,
    pub own: Vec<OwnState>,
    /// Drones of different sides do not hear each other.
    pub sides: Vec<u8>,
    /// Drones whose indices differ by more than this do not hear each other. With 1 the drones form a chain.
    pub reach: usize,
    pub scenery: Vec<(ObstacleId, ConvexShape)>,
    /// Detection range of obstacles, m.
    pub range_m: f64,
    /// Checks the invariants in every tick; `None` if the test injects dishonest messages, so that they need not hold.
    pub watch: Option<Watch>,
    posts: BTreeMap<Post, Message>,
    sequence: u64,
}

impl Swarm {
    /// Drones in a column, 40 m apart, the first drone ahead. All have just started.
    pub(crate) fn new(periods: Periods, air: Air, drones: usize) -> Self {
        let own = |i: usize| {
            let position = Vec2::new(-40.0 * i as f64, 7.0 * i as f64 - 3.0 * drones as f64);
            OwnState { tick: 0, position, velocity: Vec2::new(SPEED_MPS, 0.0), altitude_m: 50.0, climb_mps: 0.0 }
        };
        let machine = |i| Some(Leading::new(&params(&periods, drones as u32, i, 1, SimTime::ZERO)));
        Self {
            periods,
            air,
            tick: 0,
            drones: (0..drones as u32).map(machine).collect(),
            frozen: vec![false; drones],
            incarnations: vec![1; drones],
            own: (0..drones).map(own).collect(),
            sides: vec![0; drones],
            reach: usize::MAX,
            scenery: Vec::new(),
            range_m: 100.0,
            watch: Some(Watch::default()),
            posts: BTreeMap::new(),
            sequence: 0,
        }
    }

    pub(crate) fn now(&self) -> SimTime {
        SimTime::from_secs(self.tick as f64 * self.periods.dt_s)
    }

    pub(crate) fn kill(&mut self, drone: usize) {
        self.drones[drone] = None;
        self.frozen[drone] = false;
        self.posts.retain(|post, _| post.3 != drone);
    }

    pub(crate) fn restart(&mut self, drone: usize) {
        self.incarnations[drone] += 1;
        let params = params(&self.periods, self.own.len() as u32, drone as u32, self.incarnations[drone], self.now());
        self.drones[drone] = Some(Leading::new(&params));
    }

    /// Sends a message to all other drones. The channel decides loss and delay.
    pub(crate) fn send(&mut self, from: usize, message: Message) {
        self.sequence += 1;
        for to in (0..self.own.len()).filter(|&to| to != from) {
            let Some(delay_s) = self.air.delay_s(self.sequence, to) else { continue };
            let due = self.tick + ((delay_s / self.periods.dt_s).ceil().max(1.0)) as u64;
            self.posts.insert((due, from, self.sequence, to), message);
        }
    }

    /// Messages under way, the next due message first.
    pub(crate) fn posts(&mut self) -> &mut BTreeMap<Post, Message> {
        &mut self.posts
    }

    /// Removes the message with this index, modulo the number of messages under way.
    pub(crate) fn take_post(&mut self, index: usize) -> Option<(Post, Message)> {
        let index = index.checked_rem(self.posts.len())?;
        let post = *self.posts.keys().nth(index)?;
        self.posts.remove_entry(&post)
    }

    /// One tick. First all drones receive the messages that are due, then all act.
    pub(crate) fn step(&mut self) -> Result<(), Breach> {
        self.deliver();
        let now = self.now();
        let mut sent = Vec::new();
        for i in 0..self.drones.len() {
            let Some(leading) = self.drones[i].as_mut().filter(|_| !self.frozen[i]) else { continue };
            self.own[i].tick = self.tick;
            let own = self.own[i];
            for (id, shape) in &self.scenery {
                if (shape.centre() - own.position).norm() <= self.range_m {
                    leading.sense(now, *id, *shape);
                }
            }
            let mut outgoing = Vec::new();
            step(leading, now, &own, &mut outgoing);
            if let Some(watch) = &mut self.watch {
                watch.see(DroneId(i as u32), self.incarnations[i], leading)?;
            }
            sent.extend(outgoing.into_iter().map(|message| (i, message)));
        }
        for (from, message) in sent {
            self.send(from, message);
        }
        for own in &mut self.own {
            own.position += own.velocity * self.periods.dt_s;
        }
        self.tick += 1;
        Ok(())
    }

    fn deliver(&mut self) {
        let later = self.posts.split_off(&(self.tick + 1, 0, 0, 0));
        let (now, mut answers) = (self.now(), Vec::new());
        for ((_, from, _, to), message) in std::mem::replace(&mut self.posts, later) {
            if self.sides[from] != self.sides[to] || from.abs_diff(to) > self.reach || self.frozen[to] {
                continue;
            }
            let Some(leading) = &mut self.drones[to] else { continue };
            let mut outgoing = Vec::new();
            leading.hear(now, DroneId(from as u32), &message, &mut outgoing);
            answers.extend(outgoing.into_iter().map(|message| (to, message)));
        }
        for (from, message) in answers {
            self.send(from, message);
        }
    }

    /// Runs for `seconds`.
    pub(crate) fn run(&mut self, seconds: f64) {
        for _ in 0..(seconds / self.periods.dt_s).round() as u64 {
            self.step().unwrap();
        }
    }

    /// Runs until `wrong` returns `None`. Returns the time that this took, s, or the result of `wrong` after `limit_s`.
    pub(crate) fn until(&mut self, limit_s: f64, wrong: impl Fn(&Self) -> Option<String>) -> Result<f64, String> {
        let start = self.tick;
        loop {
            let passed_s = (self.tick - start) as f64 * self.periods.dt_s;
            match wrong(self) {
                None => return Ok(passed_s),
                Some(what) if passed_s >= limit_s => return Err(format!("after {passed_s} s: {what}")),
                Some(_) => self.step().map_err(|breach| format!("{breach:?}"))?,
            }
        }
    }

    /// The drones of one side that are neither dead nor frozen.
    pub(crate) fn side(&self, side: u8) -> Vec<(DroneId, &Leading)> {
        let of_side = |&i: &usize| self.sides[i] == side && !self.frozen[i];
        let living = |i: usize| self.drones[i].as_ref().map(|leading| (DroneId(i as u32), leading));
        (0..self.drones.len()).filter(of_side).filter_map(living).collect()
    }

    /// The first reason why the drones of a side are not one group, if there is one.
    pub(crate) fn disunion(&self, side: u8) -> Option<String> {
        disunion(&self.side(side))
    }

    /// The term that a drone obeys; `None` if it is dead.
    pub(crate) fn term(&self, drone: usize) -> Option<Ballot> {
        self.drones[drone].as_ref().map(|leading| leading.term())
    }
}
