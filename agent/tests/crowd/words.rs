//! Crowds that sense no neighbours. Their drones keep apart by the lines of `skein_agent::separation`, over an adverse radio.

use super::errors::Errors;
use super::{Crowd, Flown, Keyed, Wish, shape_distance_m};
use bytemuck::Zeroable;
use skein_agent::braking_filter::{BrakingFilter, OwnMotion};
use skein_agent::separation::own_path::OwnPath;
use skein_agent::separation::{SeparationParams, Separations};
use skein_leader::peers::Peers;
use skein_protocol::payload::Pose;
use skein_protocol::{DroneId, Message, SimTime, Vec2, raised};
use std::sync::Arc;

/// Time between two beacons, s.
const BEACON_S: f64 = 0.1;
/// Share of the messages that arrive twice.
const DOUBLED: f64 = 0.1;

/// What the adversary does.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Adversary {
    /// Greatest delay of a message, s. Each message has a delay of its own, so that messages overtake each other.
    pub(crate) delay_s: f64,
    /// Share of the messages that are lost.
    pub(crate) loss: f64,
    /// Share of the drones that die for a while and are restarted with empty memory.
    pub(crate) restarts: f64,
    /// Distance over which lines are heard, m. Drones that are farther apart, and every third pair, only get them passed on. States are heard by all.
    pub(crate) reach_m: f64,
}

impl Adversary {
    /// Everybody hears everybody.
    pub(crate) fn new(delay_s: f64, loss: f64, restarts: f64) -> Self {
        Self { delay_s, loss, restarts, reach_m: f64::INFINITY }
    }

    /// Lines are heard over `reach_m` only, and passed on.
    pub(crate) fn with_reach(self, reach_m: f64) -> Self {
        Self { reach_m, ..self }
    }

    /// Delays up to 3 s, up to 80 % lost; half of the crowds have restarts, and half of them pass lines on.
    pub(crate) fn random(random: &mut Keyed) -> Self {
        let adversary = Self::new(random.within(0.0, 3.0), random.within(0.0, 0.8), random.within(-0.2, 0.2));
        let wide = random.unit() < 0.5;
        if wide { adversary.with_reach(random.within(30.0, 200.0)) } else { adversary }
    }

    /// Whether a message of one drone reaches another one at this distance. Where lines are passed on, every third pair of drones
    /// never hears the lines that one says to the other, so that they matter however near the two are.
    fn reaches(&self, message: &Message, (from, to): (usize, usize), distance_m: f64) -> bool {
        let deaf = self.reach_m.is_finite() && (from + to).is_multiple_of(3);
        matches!(message, Message::Pose(_)) || (distance_m <= self.reach_m && !deaf)
    }
}

/// A message on its way.
pub(crate) struct Sent {
    pub(crate) arrives: u64,
    from: usize,
    pub(crate) message: Message,
}

/// A crowd and its radio.
struct Talk {
    adversary: Adversary,
    errors: Errors,
    incarnations: Vec<u32>,
    /// What each drone knows of the lines; `None` while it is dead.
    separations: Vec<Option<Separations>>,
    peers: Vec<Peers>,
    /// For each drone, the messages on their way to it.
    air: Vec<Vec<Sent>>,
    starts_m: Arc<[Vec2]>,
    start_velocity: Vec2,
}

impl Crowd {
    /// Starts anew: all drones of the crowd fly straight on with one velocity until their first commands take effect. From there their
    /// braking paths keep all distances.
    fn with_one_velocity(&mut self, random: &mut Keyed) -> Vec2 {
        let velocity = random.disc(self.params.speed_max_mps);
        let straight_m = velocity * self.reaction_time_s();
        let bodies = std::mem::take(&mut self.bodies);
        self.pending.clear();
        self.frozen.clear();
        self.tick = 0;
        for (position, _) in bodies {
            // As the velocity is common, bodies that are apart when their first commands take effect are apart before.
            if self.admits((position + straight_m, velocity)) && self.is_clear(position, position + straight_m) {
                self.bodies.push((position + straight_m, velocity));
                self.pending.push(std::iter::repeat_n(Vec2::zeros(), self.lag as usize).collect());
                self.frozen.push(0);
            }
        }
        self.bodies.iter_mut().for_each(|body| body.0 -= straight_m);
        velocity
    }

    /// Delay from a command to its effect, s.
    fn reaction_time_s(&self) -> f64 {
        f64::from(self.lag) * self.params.dt_s
    }

    /// The time by the clock of a drone.
    fn now(&self, i: usize, errors: &Errors) -> SimTime {
        SimTime::from_secs(self.tick as f64 * self.params.dt_s).after(errors.clock_s(i))
    }

    /// The positions that a drone reads after each of its pending commands, from its present position on, and its velocity then.
    fn given(&self, i: usize, errors: &Errors) -> (Vec<Vec2>, Vec2) {
        let error_m = errors.position_m(i);
        let (mut body, mut given) = (self.bodies[i], vec![self.bodies[i].0 + error_m]);
        for command in &self.pending[i] {
            body = self.fly(body, *command);
            given.push(body.0 + error_m);
        }
        (given, body.1)
    }

    fn own_path(&self, i: usize, errors: &Errors) -> OwnPath {
        let (given, velocity) = self.given(i, errors);
        let path =
            OwnPath::new((self.tick, self.now(i, errors)), given, velocity, self.params.law(), self.params.stride());
        path.with_clock_error(errors.allowed.clock_s)
    }

    /// One tick of drone `i`, which hears, makes lines, and gives a command.
    fn step_by_words(&mut self, i: usize, filter: &mut BrakingFilter, wish: Wish, talk: &mut Talk, random: &mut Keyed) {
        let (given, velocity) = self.given(i, &talk.errors);
        let (now, own_error_m) = (self.now(i, &talk.errors), talk.errors.position_m(i));
        let outlines = talk.errors.outlines(i, self.bodies[i].0, &self.obstacles);
        let braking = self.params.law().braking(velocity);
        let acceleration = match talk.exchange(self, i, random) {
            None => braking,
            Some(lines) if !lines.has_agreed_with_all() => braking,
            Some(lines) => {
                let position = given.last().copied().unwrap();
                let own = OwnMotion {
                    tick: self.tick,
                    now,
                    sensed_position: self.bodies[i].0 + own_error_m,
                    sensed_velocity: self.bodies[i].1,
                    position,
                    velocity,
                    speed_limit_mps: f64::INFINITY,
                    lag: self.lag,
                };
                let obstacles = outlines.iter().map(|shape| (shape, shape_distance_m(shape, position)));
                let wanted = self.wish(i, wish, random);
                filter.filter(&own, wanted, obstacles, std::iter::empty(), lines.lines())
            }
        };
        self.pending[i].push_back(acceleration);
    }
}

impl Talk {
    fn new(crowd: &Crowd, adversary: Adversary, errors: Errors, start_velocity: Vec2) -> Self {
        let n = crowd.bodies.len();
        let starts_m: Arc<[Vec2]> = crowd.bodies.iter().map(|body| body.0).collect();
        let mut talk = Self {
            adversary,
            errors,
            incarnations: vec![1; n],
            separations: Vec::new(),
            peers: (0..n).map(|_| Peers::new(n as u32, 2.0)).collect(),
            air: (0..n).map(|_| Vec::new()).collect(),
            starts_m,
            start_velocity,
        };
        talk.separations = (0..n).map(|i| Some(talk.born(crowd, i))).collect();
        talk
    }

    fn born(&self, crowd: &Crowd, i: usize) -> Separations {
        let params = SeparationParams {
            me: DroneId(i as u32),
            incarnation: self.incarnations[i],
            starts_m: Arc::clone(&self.starts_m),
            start_velocity: self.start_velocity,
            reaction_time_s: crowd.reaction_time_s(),
            keep_m: crowd.params.keep_m() + 2.0 * self.errors.allowed.position_m,
            radio_range_m: f64::INFINITY,
            braking_mps2: crowd.params.braking_mps2,
            period_s: BEACON_S,
            dt_s: crowd.params.dt_s,
        };
        Separations::new(params, crowd.now(i, &self.errors))
    }

    /// Hears what has arrived, says what is due, and returns the lines; `None` if the drone is dead.
    fn exchange(&mut self, crowd: &Crowd, i: usize, random: &mut Keyed) -> Option<&Separations> {
        let path = crowd.own_path(i, &self.errors);
        let (now, position) = (crowd.now(i, &self.errors), crowd.bodies[i].0 + self.errors.position_m(i));
        let heard: Vec<Sent> = self.air[i].extract_if(.., |sent| sent.arrives <= crowd.tick).collect();
        let separations = self.separations[i].as_mut()?;
        let peers = &mut self.peers[i];
        for Sent { from, message, .. } in heard {
            let source = DroneId(from as u32);
            match message {
                Message::Pose(pose) => {
                    separations.hear_incarnation(source, pose.incarnation);
                    peers.hear(now, source, Pose { stamp: pose.stamp.min(now), ..pose });
                }
                Message::Separation(lines) => separations.hear(source, &lines, peers, &path),
                _ => {}
            }
        }
        let period = ((BEACON_S / crowd.params.dt_s).round() as u64).max(1);
        if crowd.tick % period == i as u64 % period {
            let velocity = crowd.bodies[i].1;
            let pose = Pose {
                stamp: now,
                position_m: raised(position, 0.0),
                velocity_mps: raised(velocity, 0.0),
                incarnation: self.incarnations[i],
                ..Pose::zeroed()
            };
            let mut said = vec![Message::Pose(pose)];
            separations.set_reach(Some(self.adversary.reach_m).filter(|reach_m| reach_m.is_finite()));
            separations.speak(peers, &path, &mut said);
            for message in said {
                let away_m = |to: usize| (crowd.bodies[to].0 - crowd.bodies[i].0).norm();
                let reached = |&to: &usize| to != i && self.adversary.reaches(&message, (i, to), away_m(to));
                for to in (0..crowd.bodies.len()).filter(reached) {
                    self.air[to].extend(self.adversary.transmit(crowd, i, message, random));
                }
            }
        }
        self.separations[i].as_ref()
    }

    /// Kills drones and restarts them.
    fn restart(&mut self, crowd: &Crowd, random: &mut Keyed) {
        for i in 0..crowd.bodies.len() {
            if random.unit() >= self.adversary.restarts * crowd.params.dt_s {
                continue;
            }
            if self.separations[i].take().is_none() {
                self.incarnations[i] += 1;
                self.peers[i] = Peers::new(crowd.bodies.len() as u32, 2.0);
                self.separations[i] = Some(self.born(crowd, i));
            }
        }
    }
}

impl Adversary {
    pub(crate) fn transmit(&self, crowd: &Crowd, from: usize, message: Message, random: &mut Keyed) -> Vec<Sent> {
        let copies = if random.unit() < self.loss { 0 } else { 1 + usize::from(random.unit() < DOUBLED) };
        let mut arrives = || crowd.tick + 1 + (random.within(0.0, self.delay_s) / crowd.params.dt_s) as u64;
        (0..copies).map(|_| Sent { arrives: arrives(), from, message }).collect()
    }
}

/// Flies a crowd by word alone.
pub(crate) fn fly_by_words(
    seed: u64,
    size: (usize, f64),
    ticks: usize,
    (wish, lag): (Wish, u32),
    adversary: Adversary,
) -> Flown {
    fly_with_errors(seed, size, ticks, (wish, lag), adversary, Errors::none)
}

/// Flies a crowd by words, whose drones have wrong positions, clocks and outlines.
pub(crate) fn fly_with_errors(
    seed: u64,
    (drones, density): (usize, f64),
    ticks: usize,
    (wish, lag): (Wish, u32),
    adversary: Adversary,
    errors: impl FnOnce(&Crowd) -> Errors,
) -> Flown {
    let mut crowd = Crowd::random(seed, drones, density, lag);
    let mut random = Keyed(seed ^ 0xabcdef);
    let velocity = crowd.with_one_velocity(&mut random);
    let errors = errors(&crowd);
    let filter = BrakingFilter::new(crowd.params).with_errors(errors.allowed);
    let mut talk = Talk::new(&crowd, adversary, errors, velocity);
    let mut filters = vec![filter; crowd.bodies.len()];
    let (mut least_m, mut flown_m) = (crowd.least_m(), 0.0);
    for _ in 0..ticks {
        talk.restart(&crowd, &mut random);
        talk.errors.step();
        for (i, filter) in filters.iter_mut().enumerate() {
            crowd.step_by_words(i, filter, wish, &mut talk, &mut random);
        }
        flown_m += crowd.fly_pending();
        least_m = least_m.min(crowd.least_m());
    }
    let n = crowd.bodies.len();
    Flown { least_m, drone_ticks: ticks * n, mean_m: flown_m / n.max(1) as f64 }
}
