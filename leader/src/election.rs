//! Leader election: a sans-IO state machine.
//!
//! A term is a ballot for a group, the term's scope. Ballots are ordered lexicographically. Of all terms whose scope
//! contains its own group, a drone obeys the highest one it has heard of. The living member that is closest to the
//! destination claims a new term. Closeness decides elections only: a healthy leader keeps its term when it is overtaken.
//!
//! In Raft's words: a drone that misses its leader first asks for a *pre-vote*. A member that has heard the leader since
//! *rejects* it. Without a rejection the drone claims. A leader can *transfer* its leadership to a named drone. There are
//! no votes: a claim takes effect wherever it is heard, and the higher ballot wins.
//!
//! A ballot has only one leader by construction: it names its claimant, and the launcher gives each start of a process an
//! incarnation of its own.

//!
//! # Example
//!
//! A drone that hears nobody asks for a pre-vote, waits for a rejection, and then leads.
//!
//! ```
//! use skein_leader::election::{Election, ElectionParams, Input};
//! use skein_protocol::{DroneId, SimTime};
//!
//! let params = ElectionParams { heartbeat_period_s: 0.2, leader_timeout_s: 1.0, wait_s: 0.2 };
//! let mut election = Election::new(DroneId(3), 1, params, SimTime::ZERO);
//! let mut said = Vec::new();
//! for tick in 0..200 {
//!     let now = SimTime::from_secs(f64::from(tick) * 0.02);
//!     said.extend(election.handle(now, 0, Input::Tick { closer: 0, delay_s: 0.02 }));
//! }
//! assert!(election.leads());
//! assert_eq!(election.obeyed().claimant, DroneId(3));
//! assert!(said.len() > 2, "a pre-vote, a claim and heartbeats");
//! ```

use crate::adaptive_timeout::AdaptiveTimeout;
use crate::tuning::{CLOCKS_S, NEWCOMER_TIMEOUTS, PARTED_TIMEOUTS, SAME_BEAT};
use skein_protocol::payload::Leadership;
use skein_protocol::{Ballot, DroneId, GroupId, LeadershipKind, SimTime};

/// Upper bound of claims in an honest swarm, 1/s. A round that is higher than this rate allows since the start is ignored,
/// so that a hostile drone cannot exhaust the rounds.
const CLAIMS_PER_S: f64 = 1000.0;

/// Periods and time-outs.
#[derive(Clone, Copy, Debug)]
pub struct ElectionParams {
    /// Period of a leader's heartbeats, s.
    pub heartbeat_period_s: f64,
    /// A leader that is silent for longer is missed, s. Longer on a bad link.
    pub leader_timeout_s: f64,
    /// How long the closest member waits for a rejection of its pre-vote before it claims, s. The next one waits as much
    /// longer, and so on, so that one claim reaches all members before the next is due. Longer if messages take longer.
    pub wait_s: f64,
}

/// An input of the state machine.
#[derive(Clone, Copy, Debug)]
pub enum Input {
    /// A message about leading was heard.
    Heard(Leadership),
    /// A message of the leader of this term was heard. It counts as a heartbeat.
    Sign {
        /// The term.
        ballot: Ballot,
        /// The group that the term is for, if the message says so.
        scope: Option<GroupId>,
        /// Whether the message names this drone: then the term is for this drone, whatever its group is.
        named: bool,
        /// When the leader sent it, by the leader's clock, if the message says so.
        stamp: Option<SimTime>,
    },
    /// This drone is in this group now.
    Joined(GroupId),
    /// Claim this group, whichever drone leads it.
    Claim(GroupId),
    /// Transfer the leadership to this drone. Without effect unless this drone leads.
    Transfer(DroneId),
    /// Further drones become known: it is too early for a first claim.
    Settling,
    /// Time has passed.
    Tick {
        /// Number of living members that are closer to the destination than this drone, without the missing leader.
        closer: usize,
        /// How long a message takes to arrive, s.
        delay_s: f64,
    },
}

/// The share of the longest silence after which a pre-vote is asked for at the earliest.
const PRE_VOTE_SHARE: f64 = 0.5;

/// A sign that the leader of a term lives.
#[derive(Clone, Copy, Debug)]
struct Sign {
    ballot: Ballot,
    /// The group that the term is for, if it says so.
    scope: Option<GroupId>,
    /// Whether it names this drone.
    named: bool,
    /// When the leader sent it, by the leader's clock, if it says so.
    stamp: Option<SimTime>,
    /// How often it was passed on.
    hops: u16,
}

/// The election state of one drone.
#[derive(Clone, Debug, PartialEq)]
pub struct Election {
    me: DroneId,
    incarnation: u32,
    heartbeat_period_s: f64,
    leader_timeout_s: f64,
    wait_s: f64,
    group: GroupId,
    obeyed: Ballot,
    scope: GroupId,
    highest_round: u32,
    leads: bool,
    /// Last sign of life of the leader, heard by this drone or by another one; or the start.
    heard: SimTime,
    /// The greatest time stamp of the leader's signs, by the leader's clock.
    newest: SimTime,
    /// How much later this drone heard that sign, by its own clock, ns.
    lag_ns: i64,
    /// How often that sign was passed on before this drone heard it.
    hops: u16,
    /// Of the leaders' signs that this drone heard itself.
    adaptive_timeout: AdaptiveTimeout,
    /// Whether the last message that named the group of the term it obeys named another one than the first: one of them is forged.
    disputed: bool,
    /// Since when it has heard only leaders of parts of its group.
    parted: Option<SimTime>,
    next_heartbeat: SimTime,
    /// When it asked for a pre-vote.
    pre_voted: Option<SimTime>,
}

impl Election {
    /// A drone that has just started and obeys no leader.
    #[must_use]
    pub fn new(me: DroneId, incarnation: u32, params: ElectionParams, now: SimTime) -> Self {
        Self {
            me,
            incarnation,
            heartbeat_period_s: params.heartbeat_period_s,
            leader_timeout_s: params.leader_timeout_s,
            wait_s: params.wait_s,
            group: GroupId::ALL,
            obeyed: Ballot::NONE,
            scope: GroupId::ALL,
            highest_round: 0,
            leads: false,
            heard: now,
            newest: SimTime::ZERO,
            lag_ns: 0,
            hops: 0,
            adaptive_timeout: AdaptiveTimeout::expecting(now, params.heartbeat_period_s),
            disputed: false,
            parted: None,
            next_heartbeat: now,
            pre_voted: None,
        }
    }

    /// Whether this drone leads its term.
    #[must_use]
    pub fn leads(&self) -> bool {
        self.leads
    }

    /// The term it obeys, or leads; [`Ballot::NONE`] before the first.
    #[must_use]
    pub fn obeyed(&self) -> Ballot {
        self.obeyed
    }

    /// The group that the term is for.
    #[must_use]
    pub fn scope(&self) -> GroupId {
        self.scope
    }

    /// The group this drone is in: the scope, or a part of it.
    #[must_use]
    pub fn group(&self) -> GroupId {
        self.group
    }

    /// How many drones passed on the newest sign of the leader before this one heard it.
    pub(crate) fn hops(&self) -> u16 {
        self.hops
    }

    /// How long the closest member waits before it claims, s. The next one waits as much longer, and so on.
    pub(crate) fn wait_s(&self) -> f64 {
        self.wait_s
    }

    /// The longest silence of the leader that is not yet significant, s: the time-out, or more if its signs come rarely or
    /// irregularly.
    #[must_use]
    pub fn silence_s(&self) -> f64 {
        self.adaptive_timeout.timeout_s(self.leader_timeout_s)
    }

    /// Whether it leads, or the leader it obeys has not been silent for too long.
    #[must_use]
    pub fn has_leader(&self, now: SimTime) -> bool {
        let silence_s = now.since(self.heard);
        // The longest silence is never shorter than the time-out, and it is computed only if that matters.
        self.leads || (self.obeyed.is_some() && (silence_s <= self.leader_timeout_s || silence_s <= self.silence_s()))
    }

    /// Whether it has no leader, or has asked for a pre-vote.
    #[must_use]
    pub fn seeks(&self, now: SimTime) -> bool {
        self.pre_voted.is_some() || !self.has_leader(now)
    }

    /// When the machine next needs an [`Input::Tick`], if it hears nothing until then. A rejection needs the message delay
    /// twice, a claim once. The pre-vote is asked for so early that its answer is there when the time-out ends, but not
    /// before half of the time-out.
    #[must_use]
    pub fn next_deadline(&self, closer: usize, delay_s: f64) -> SimTime {
        let (closer, answer_s) = (closer as f64, self.wait_s.max(2.0 * delay_s));
        match self.pre_voted {
            _ if self.leads => self.next_heartbeat,
            Some(asked) => asked.after(answer_s + self.wait_s.max(delay_s) * closer),
            None if self.obeyed.is_some() => {
                let silence_s = self.silence_s();
                self.heard.after((silence_s - answer_s).max(PRE_VOTE_SHARE * silence_s))
            }
            None => self.heard.after(self.newcomer_s() + self.wait_s * (closer + 1.0)),
        }
    }

    /// How long a drone listens before it concludes that no drone leads, s. In its first incarnation no drone can lead yet;
    /// after a restart there most likely is a leader.
    fn newcomer_s(&self) -> f64 {
        if self.incarnation > 1 { NEWCOMER_TIMEOUTS * self.leader_timeout_s } else { 0.0 }
    }

    /// Takes an input; returns what is to be said, if anything. `epoch`: number of the plan this drone obeys, which goes
    /// into the messages.
    pub fn handle(&mut self, now: SimTime, epoch: u32, input: Input) -> Option<Leadership> {
        match input {
            Input::Heard(message) => self.hear(now, epoch, &message),
            Input::Sign { ballot, scope, named, stamp } => {
                self.sign(now, Sign { ballot, scope, named, stamp, hops: 0 });
                None
            }
            Input::Joined(group) => {
                self.group = group;
                None
            }
            Input::Claim(scope) => self.claim(now, scope),
            Input::Settling => {
                if !self.obeyed.is_some() {
                    self.heard = now;
                }
                None
            }
            Input::Transfer(heir) => {
                self.leads.then(|| self.message(LeadershipKind::LeadershipTransfer, now, epoch, heir))
            }
            Input::Tick { closer, delay_s } => self.tick(now, epoch, closer, delay_s),
        }
    }

    fn hear(&mut self, now: SimTime, epoch: u32, message: &Leadership) -> Option<Leadership> {
        let ballot = message.ballot;
        match message.kind() {
            LeadershipKind::PreVote => {
                let newest = if self.leads { now } else { self.newest };
                let news = ballot == self.obeyed && newest.since(message.stamp) >= self.heartbeat_period_s;
                news.then(|| self.message(LeadershipKind::PreVoteRejection, newest, epoch, DroneId::NONE))
            }
            LeadershipKind::PreVoteRejection => {
                if ballot == self.obeyed && message.stamp.since(now) <= CLOCKS_S {
                    self.catch_up(now, message.stamp);
                }
                None
            }
            LeadershipKind::LeadershipTransfer if message.heir == self.me && ballot == self.obeyed => {
                self.claim(now, self.scope)
            }
            LeadershipKind::Claim | LeadershipKind::Heartbeat | LeadershipKind::LeadershipTransfer => {
                let is_echo = message.hops > 0 && ballot == self.obeyed && message.stamp <= self.newest;
                if !is_echo {
                    let (scope, stamp) = (Some(message.group), Some(message.stamp));
                    self.sign(now, Sign { ballot, scope, named: false, stamp, hops: message.hops });
                }
                None
            }
        }
    }

    /// Notes that another drone heard a sign of the leader with this stamp, if that is news: as if this drone had heard it, as
    /// late after the leader sent it as the newest one that it heard.
    fn catch_up(&mut self, now: SimTime, stamp: SimTime) {
        let heard = now.min(stamp + self.lag_ns);
        if stamp > self.newest && heard > self.heard {
            (self.newest, self.heard, self.pre_voted) = (stamp, heard, None);
        }
    }

    fn sign(&mut self, now: SimTime, sign: Sign) {
        let Sign { ballot, scope, named, stamp, hops } = sign;
        if f64::from(ballot.round) > CLAIMS_PER_S * (1.0 + now.since(SimTime::ZERO)) {
            return;
        }
        self.highest_round = self.highest_round.max(ballot.round);
        if let Some(scope) = scope.filter(|scope| ballot > self.obeyed && (named || scope.contains(self.group))) {
            self.follow(now, ballot, scope, hops);
        }
        // A term is for one group. If messages name two, one of them is forged: the leader may be that of another group.
        if ballot == self.obeyed {
            self.disputed = scope.map_or(self.disputed, |scope| scope != self.scope);
        }
        let lives = ballot == self.obeyed && !self.disputed;
        if let Some(stamp) = stamp.filter(|&stamp| lives && stamp > self.newest) {
            (self.newest, self.lag_ns, self.hops) = (stamp, now - stamp, hops);
        }
        // Its group was split without it. A leader of a part will take it in, and its own term ends. A leader of an older
        // term cannot do that.
        let is_part = |scope: GroupId| scope != self.group && self.group.contains(scope);
        let parted = ballot > self.obeyed && scope.is_some_and(is_part);
        if parted {
            self.leads = false;
        }
        if lives {
            self.parted = None;
            self.adaptive_timeout.hear(now, SAME_BEAT * self.heartbeat_period_s, self.silence_s());
        }
        if lives || (parted && self.may_be_taken_in(now, hops)) {
            self.heard = now;
            self.pre_voted = None;
        }
    }

    /// Obeys a higher term from now on. `hops`: how often its message was passed on.
    fn follow(&mut self, now: SimTime, ballot: Ballot, scope: GroupId, hops: u16) {
        (self.obeyed, self.scope) = (ballot, scope);
        self.leads = false;
        (self.newest, self.lag_ns) = (SimTime::ZERO, 0);
        // Far away, gaps are longer: they grow with the square root of the distance if frames get lost.
        match f64::from(hops).sqrt() {
            0.0 => self.adaptive_timeout.restart(now),
            root => self.adaptive_timeout = AdaptiveTimeout::expecting(now, root * self.heartbeat_period_s),
        }
    }

    /// Whether the leaders of parts still have time to take this drone in. Word takes longer over several hops.
    fn may_be_taken_in(&mut self, now: SimTime, hops: u16) -> bool {
        let patience_s = PARTED_TIMEOUTS * self.leader_timeout_s * (1.0 + f64::from(hops));
        now.since(*self.parted.get_or_insert(now)) < patience_s
    }

    fn tick(&mut self, now: SimTime, epoch: u32, closer: usize, delay_s: f64) -> Option<Leadership> {
        let hears = !self.leads && self.obeyed.is_some() && self.pre_voted.is_none();
        // A bound that holds however rarely the leader is heard comes first: it costs less.
        if hears && now < self.heard.after(PRE_VOTE_SHARE * self.leader_timeout_s) {
            return None;
        }
        if now < self.next_deadline(closer, delay_s) {
            return None;
        }
        if self.leads {
            self.heard = now;
            self.next_heartbeat = now.after(self.heartbeat_period_s);
            return Some(self.message(LeadershipKind::Heartbeat, now, epoch, DroneId::NONE));
        }
        if self.obeyed.is_some() && self.pre_voted.is_none() {
            self.pre_voted = Some(now);
            return Some(self.message(LeadershipKind::PreVote, self.newest, epoch, DroneId::NONE));
        }
        let scope = if self.scope.contains(self.group) { self.scope } else { self.group };
        self.claim(now, scope)
    }

    /// Claims a new term. `None` if the rounds are exhausted: then the drones fly on without a leader.
    fn claim(&mut self, now: SimTime, scope: GroupId) -> Option<Leadership> {
        let round = self.highest_round.checked_add(1)?;
        self.highest_round = round;
        self.obeyed = Ballot { round, incarnation: self.incarnation, claimant: self.me };
        self.scope = scope;
        self.leads = true;
        (self.disputed, self.parted) = (false, None);
        (self.heard, self.newest, self.lag_ns) = (now, now, 0);
        self.pre_voted = None;
        self.next_heartbeat = now.after(self.heartbeat_period_s);
        Some(self.message(LeadershipKind::Claim, now, 0, DroneId::NONE))
    }

    fn message(&self, kind: LeadershipKind, stamp: SimTime, epoch: u32, heir: DroneId) -> Leadership {
        let (ballot, group, kind) = (self.obeyed, self.scope, kind.to_wire() as u16);
        Leadership { stamp, ballot, kind, hops: 0, group, epoch, heir }
    }
}

#[cfg(test)]
mod tests;
