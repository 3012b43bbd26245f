//! Who leads: a sans-IO machine. The member closest to the destination claims; a term is a ballot, ordered
//! lexicographically, for a group: the term's scope. Of all terms whose scope holds its own group a drone obeys the
//! highest it has heard of. Closeness decides elections only: a healthy leader is not deposed by being overtaken.
//!
//! Uniqueness of a leader for a ballot holds by construction: a ballot names its claimant, and the launcher gives each
//! start of a process an incarnation of its own.

use crate::adaptive_timeout::AdaptiveTimeout;
use skein_protocol::LeadershipKind;
use skein_protocol::payload::Leadership;
use skein_protocol::{Ballot, DroneId, GroupId, SimTime};

/// No honest swarm claims more often than this, 1/s: a round that is higher than what that gives since the start is
/// refused, so that nobody drives rounds to where they cannot be raised any more.
const CLAIMS_PER_S: f64 = 1000.0;

/// Signs of a leader that come sooner after another one than this part of its period belong to the same beat.
const BEAT: f64 = 0.75;

/// A drone that was started again listens for so many time-outs before it claims.
const NEWCOMER_TIMEOUTS: f64 = 4.0;

/// A drone whose group was split without it waits for so many time-outs to be taken in, and then claims its group.
const PARTED_TIMEOUTS: f64 = 4.0;

/// Periods and time-outs.
#[derive(Clone, Copy, Debug)]
pub struct ElectionParams {
    /// A leader says that it lives this often, s.
    pub heartbeat_period_s: f64,
    /// A leader that is silent for so long is missed, s; it is given more on a bad link.
    pub leader_timeout_s: f64,
    /// How long the closest member waits for objections before it claims, s; the next one waits as much longer, and so
    /// on, so that one claim reaches all before the next is due. Longer if the air takes longer.
    pub wait_s: f64,
}

/// What the machine is told.
#[derive(Clone, Copy, Debug)]
pub enum Input {
    /// A message about leading was heard.
    Heard(Leadership),
    /// Something was heard that the leader of this term said: as good as a heartbeat.
    Sign {
        /// The term.
        ballot: Ballot,
        /// The group it is for.
        scope: GroupId,
        /// Whether it was said to this drone by name: then it is for this drone, whatever its group is.
        named: bool,
    },
    /// This drone is in this group from now on.
    Joined(GroupId),
    /// Lead this group, whoever led before.
    Claim(GroupId),
    /// Ask another member to take over; nothing unless this drone leads.
    Yield(DroneId),
    /// Time went on; `closer` living members are closer to the destination than this drone.
    Tick {
        /// How many, not counting the leader whose silence started the election.
        closer: usize,
        /// How long a message is on the air, s.
        delay_s: f64,
    },
}

/// The machine of one drone.
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
    /// Last sign of life of the leader, heard by itself or by another, or the start.
    heard: SimTime,
    /// Of the leaders' own signs.
    adaptive_timeout: AdaptiveTimeout,
    /// Since when only leaders of parts of its group are heard.
    parted: Option<SimTime>,
    next_heartbeat: SimTime,
    /// When it asked who has heard of the leader it misses.
    probed: Option<SimTime>,
}

impl Election {
    /// A drone that has just started and obeys nobody.
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
            adaptive_timeout: AdaptiveTimeout::expecting(now, params.heartbeat_period_s),
            parted: None,
            next_heartbeat: now,
            probed: None,
        }
    }

    /// Whether this drone leads.
    #[must_use]
    pub fn leads(&self) -> bool {
        self.leads
    }

    /// The term it obeys; [`Ballot::NONE`] before the first.
    #[must_use]
    pub fn obeyed(&self) -> Ballot {
        self.obeyed
    }

    /// The group that the term is for.
    #[must_use]
    pub fn scope(&self) -> GroupId {
        self.scope
    }

    /// The group this drone is in: the scope, or split from it.
    #[must_use]
    pub fn group(&self) -> GroupId {
        self.group
    }

    /// How long the leader may be silent, s: the time-out, or more if its signs come in rarely or irregularly.
    #[must_use]
    pub fn patience_s(&self) -> f64 {
        self.adaptive_timeout.patience_s(self.leader_timeout_s)
    }

    /// Whether it leads, or the leader it obeys is not silent for too long.
    #[must_use]
    pub fn has_leader(&self, now: SimTime) -> bool {
        self.leads || (self.obeyed.is_some() && now.since(self.heard) <= self.patience_s())
    }

    /// Whether it has no leader, or has asked who heard of the one it misses.
    #[must_use]
    pub fn seeks(&self, now: SimTime) -> bool {
        self.probed.is_some() || !self.has_leader(now)
    }

    /// When the machine next wants a [`Input::Tick`], if nothing is heard until then. Answers to a probe need the air's
    /// delay twice, a claim needs it once. It is asked so early that the answer is there when patience ends, but not
    /// before half of it.
    #[must_use]
    pub fn next_deadline(&self, closer: usize, delay_s: f64) -> SimTime {
        let (closer, answer_s) = (closer as f64, self.wait_s.max(2.0 * delay_s));
        match self.probed {
            _ if self.leads => self.next_heartbeat,
            Some(probed) => probed.after(answer_s + self.wait_s.max(delay_s) * closer),
            None if self.obeyed.is_some() => {
                self.heard.after((self.patience_s() - answer_s).max(0.5 * self.patience_s()))
            }
            None => self.heard.after(self.newcomer_s() + self.wait_s * (closer + 1.0)),
        }
    }

    /// How long a drone that was started again listens, before it takes it that nobody leads, s: in its first life nobody
    /// can lead yet, later somebody most likely does.
    fn newcomer_s(&self) -> f64 {
        if self.incarnation > 1 { NEWCOMER_TIMEOUTS * self.leader_timeout_s } else { 0.0 }
    }

    /// Takes an input; returns what is to be said, if anything. `epoch` is the number of the last plan this drone made
    /// or obeys, told along with a heartbeat.
    pub fn handle(&mut self, now: SimTime, epoch: u32, input: Input) -> Option<Leadership> {
        match input {
            Input::Heard(message) => self.hear(now, epoch, &message),
            Input::Sign { ballot, scope, named } => {
                self.sign(now, ballot, scope, named);
                None
            }
            Input::Joined(group) => {
                self.group = group;
                None
            }
            Input::Claim(scope) => self.claim(now, scope),
            Input::Yield(heir) => {
                self.leads.then(|| self.message(LeadershipKind::LeadershipTransfer, now, epoch, heir))
            }
            Input::Tick { closer, delay_s } => self.tick(now, epoch, closer, delay_s),
        }
    }

    fn hear(&mut self, now: SimTime, epoch: u32, message: &Leadership) -> Option<Leadership> {
        let ballot = message.ballot;
        match message.kind() {
            LeadershipKind::PreVote => {
                let heard = if self.leads { now } else { self.heard };
                let news = ballot == self.obeyed && heard.since(message.stamp) >= self.heartbeat_period_s;
                news.then(|| self.message(LeadershipKind::PreVoteRejection, heard, epoch, DroneId::NONE))
            }
            LeadershipKind::PreVoteRejection => {
                if ballot == self.obeyed && message.stamp > self.heard && message.stamp <= now {
                    self.heard = message.stamp;
                    self.probed = None;
                }
                None
            }
            LeadershipKind::LeadershipTransfer if message.heir == self.me && ballot == self.obeyed => {
                self.claim(now, self.scope)
            }
            LeadershipKind::Claim | LeadershipKind::Heartbeat | LeadershipKind::LeadershipTransfer => {
                self.sign(now, ballot, message.group, false);
                None
            }
        }
    }

    fn sign(&mut self, now: SimTime, ballot: Ballot, scope: GroupId, named: bool) {
        if f64::from(ballot.round) > CLAIMS_PER_S * (1.0 + now.since(SimTime::ZERO)) {
            return;
        }
        self.highest_round = self.highest_round.max(ballot.round);
        if ballot > self.obeyed && (named || scope.contains(self.group)) {
            self.obeyed = ballot;
            self.scope = scope;
            self.leads = false;
            self.adaptive_timeout.turn(now);
        }
        // Its group was split without it: whoever leads a part will take it in, and what it led is no more. One of an
        // older term cannot.
        let parted = ballot > self.obeyed && scope != self.group && self.group.contains(scope);
        if parted {
            self.leads = false;
        }
        if ballot == self.obeyed {
            self.parted = None;
            self.adaptive_timeout.hear(now, BEAT * self.heartbeat_period_s, self.patience_s());
        }
        if ballot == self.obeyed || (parted && self.may_be_taken_in(now)) {
            self.heard = now;
            self.probed = None;
        }
    }

    /// Whether the leaders of parts have not had their time yet to take this drone in.
    fn may_be_taken_in(&mut self, now: SimTime) -> bool {
        now.since(*self.parted.get_or_insert(now)) < PARTED_TIMEOUTS * self.leader_timeout_s
    }

    fn tick(&mut self, now: SimTime, epoch: u32, closer: usize, delay_s: f64) -> Option<Leadership> {
        if now < self.next_deadline(closer, delay_s) {
            return None;
        }
        if self.leads {
            self.heard = now;
            self.next_heartbeat = now.after(self.heartbeat_period_s);
            return Some(self.message(LeadershipKind::Heartbeat, now, epoch, DroneId::NONE));
        }
        if self.obeyed.is_some() && self.probed.is_none() {
            self.probed = Some(now);
            return Some(self.message(LeadershipKind::PreVote, self.heard, epoch, DroneId::NONE));
        }
        let scope = if self.scope.contains(self.group) { self.scope } else { self.group };
        self.claim(now, scope)
    }

    /// A round at the very top cannot be raised: then nobody claims any more, and the drones fly on by themselves.
    fn claim(&mut self, now: SimTime, scope: GroupId) -> Option<Leadership> {
        let round = self.highest_round.checked_add(1)?;
        self.highest_round = round;
        self.obeyed = Ballot { round, incarnation: self.incarnation, claimant: self.me };
        self.scope = scope;
        self.leads = true;
        self.parted = None;
        self.heard = now;
        self.probed = None;
        self.next_heartbeat = now.after(self.heartbeat_period_s);
        Some(self.message(LeadershipKind::Claim, now, 0, DroneId::NONE))
    }

    fn message(&self, kind: LeadershipKind, stamp: SimTime, epoch: u32, heir: DroneId) -> Leadership {
        Leadership { stamp, ballot: self.obeyed, kind: kind.to_wire(), group: self.scope, epoch, heir }
    }
}

#[cfg(test)]
mod tests;
