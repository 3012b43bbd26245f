//! Crowds that range each other, and whose ranging sensors fail one after the other. Drones that cannot range agree on lines by words.

use super::words::Adversary;
use super::{Crowd, Flown, Keyed, Wish, shape_distance_m};
use skein_agent::braking_filter::{BrakingFilter, Moving, OwnMotion};
use skein_agent::separation::own_path::OwnPath;
use skein_agent::separation::{SeparationParams, Separations};
use skein_leader::peers::Peers;
use skein_protocol::payload::Pose;
use skein_protocol::{DroneId, Message, SimTime, Vec2, raised};

/// Time between two beacons, s.
const BEACON_S: f64 = 0.1;

/// A drone of such a crowd.
struct Member {
    blind: bool,
    /// Its lines, once it is blind or a blind drone has spoken to it.
    lines: Option<Separations>,
    peers: Peers,
    /// Messages on their way to it: when they arrive, and from whom they come.
    air: Vec<(u64, usize, Message)>,
}

/// How the drones of a crowd change.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Failures {
    /// Share of the drones whose sensors fail in a second, and of the blind ones whose sensors work again.
    pub(crate) rate_per_s: f64,
    /// Whether a blind drone waits for common lines. Without it, it flies on as if nobody were near.
    pub(crate) waits: bool,
}

impl Crowd {
    fn time(&self) -> SimTime {
        SimTime::from_secs(self.tick as f64 * self.params.dt_s)
    }

    fn path(&self, i: usize) -> OwnPath {
        let (mut body, mut given) = (self.bodies[i], vec![self.bodies[i].0]);
        for command in &self.pending[i] {
            body = self.fly(body, *command);
            given.push(body.0);
        }
        OwnPath::new((self.tick, self.time()), given, body.1, self.params.law(), self.params.stride())
    }

    fn unbound(&self, i: usize) -> Separations {
        let params = SeparationParams {
            me: DroneId(i as u32),
            incarnation: 1,
            starts_m: vec![Vec2::zeros(); self.bodies.len()].into(),
            start_velocity: Vec2::zeros(),
            reaction_time_s: 0.0,
            keep_m: self.params.keep_m(),
            radio_range_m: f64::INFINITY,
            braking_mps2: self.params.braking_mps2,
            period_s: BEACON_S,
            dt_s: self.params.dt_s,
        };
        Separations::unbound(params, self.time())
    }

    /// Hears, and says what is due. Returns what is said.
    fn talk(&self, i: usize, member: &mut Member) -> Vec<Message> {
        let (tick, now, me) = (self.tick, self.time(), DroneId(i as u32));
        let heard: Vec<_> = member.air.extract_if(.., |(arrives, ..)| *arrives <= tick).collect();
        let names_me = |message: &Message| match message {
            Message::Separation(lines) => lines.separators().iter().any(|line| line.peer == me),
            _ => false,
        };
        if member.blind || heard.iter().any(|(.., message)| names_me(message)) {
            let lines = member.lines.get_or_insert_with(|| self.unbound(i));
            if member.blind {
                lines.open_all();
            }
        }
        let path = self.path(i);
        for (_, from, message) in heard {
            match (message, &mut member.lines) {
                (Message::Pose(pose), _) => member.peers.hear(now, DroneId(from as u32), pose),
                (Message::Separation(said), Some(lines)) => {
                    lines.hear(DroneId(from as u32), &said, &member.peers, &path)
                }
                _ => {}
            }
        }
        let mut said = Vec::new();
        let period = ((BEACON_S / self.params.dt_s).round() as u64).max(1);
        if tick % period == i as u64 % period {
            let (position, velocity) = self.bodies[i];
            let (position_m, velocity_mps) = (raised(position, 0.0), raised(velocity, 0.0));
            said.push(Message::Pose(Pose {
                stamp: now,
                position_m,
                velocity_mps,
                incarnation: 1,
                ..bytemuck::Zeroable::zeroed()
            }));
        }
        if let Some(lines) = &mut member.lines {
            lines.speak(&member.peers, &path, &mut said);
        }
        said
    }

    fn decide(&self, i: usize, member: &Member, filter: &mut BrakingFilter, waits: bool, wanted: Vec2) -> Vec2 {
        let (mut position, mut velocity) = self.bodies[i];
        for command in &self.pending[i] {
            (position, velocity) = self.fly((position, velocity), *command);
        }
        let lines = member.lines.as_ref();
        if waits && member.blind && !lines.is_some_and(Separations::has_agreed_with_all) {
            return self.params.law().braking(velocity);
        }
        let here = self.bodies[i];
        let own = OwnMotion {
            tick: self.tick,
            now: self.time(),
            sensed_position: here.0,
            sensed_velocity: here.1,
            position,
            velocity,
            speed_limit_mps: self.speed_limit_mps,
            lag: self.lag,
        };
        let obstacles = self.obstacles.iter().map(|shape| (shape, shape_distance_m(shape, position)));
        let by_words = |j: usize| self.lag > 0 && lines.is_some_and(|lines| lines.has_agreed(DroneId(j as u32)));
        let near =
            |j: usize, at: Vec2| j != i && !member.blind && (at - here.0).norm() <= self.ranging_m && !by_words(j);
        let ranged = self.bodies.iter().enumerate().filter(|(j, body)| near(*j, body.0));
        let ranged =
            ranged.map(|(j, body)| Moving { id: DroneId(j as u32), position_m: body.0 - here.0, velocity_mps: body.1 });
        filter.filter(&own, wanted, obstacles, ranged, lines.into_iter().flat_map(Separations::lines))
    }
}

/// Flies a crowd whose ranging sensors fail.
pub(crate) fn fly_blind(
    seed: u64,
    (drones, density): (usize, f64),
    ticks: usize,
    (wish, lag): (Wish, u32),
    (adversary, failures): (Adversary, Failures),
) -> Flown {
    let mut crowd = Crowd::random(seed, drones, density, lag);
    let mut random = Keyed(seed ^ 0xb11d);
    let n = crowd.bodies.len();
    let member = |_| Member { blind: false, lines: None, peers: Peers::new(n as u32, 2.0), air: Vec::new() };
    let mut members: Vec<Member> = (0..n).map(member).collect();
    let mut filters = vec![BrakingFilter::new(crowd.params); n];
    let (mut least_m, mut flown_m) = (crowd.least_m(), 0.0);
    for _ in 0..ticks {
        for i in 0..n {
            if random.unit() < failures.rate_per_s * crowd.params.dt_s {
                members[i].blind = !members[i].blind;
            }
            for message in crowd.talk(i, &mut members[i]) {
                for to in (0..n).filter(|&to| to != i) {
                    let sent = adversary.transmit(&crowd, i, message, &mut random);
                    members[to].air.extend(sent.into_iter().map(|sent| (sent.arrives, i, sent.message)));
                }
            }
            let wanted = crowd.wish(i, wish, &mut random);
            let command = crowd.decide(i, &members[i], &mut filters[i], failures.waits, wanted);
            crowd.pending[i].push_back(command);
        }
        flown_m += crowd.fly_pending();
        least_m = least_m.min(crowd.least_m());
    }
    Flown { least_m, drone_ticks: ticks * n, mean_m: flown_m / n.max(1) as f64 }
}
