//! Who leads: a sans-IO machine. The member closest to the destination claims; a term is a ballot, ordered
//! lexicographically; the highest ballot heard of is obeyed. Closeness decides elections only: a healthy leader is not
//! deposed by being overtaken.
//!
//! Uniqueness of a leader for a ballot holds by construction: a ballot names its claimant, and the launcher gives each
//! start of a process an incarnation of its own.

use skein_protocol::payload::{LEADERSHIP_CLAIM, LEADERSHIP_HEARTBEAT, Leadership};
use skein_protocol::{Ballot, DroneId, GroupId, SimTime};

/// Periods and time-outs.
#[derive(Clone, Copy, Debug)]
pub struct ElectionParams {
    /// A leader says that it lives this often, s.
    pub heartbeat_period_s: f64,
    /// A leader that is silent for so long is given up, s.
    pub leader_timeout_s: f64,
    /// How long the closest member listens before it claims, s; the next one waits as much longer, and so on, so that
    /// one claim reaches all before the next is due.
    pub wait_s: f64,
}

/// What the machine is told.
#[derive(Clone, Copy, Debug)]
pub enum Input {
    /// A message about leading was heard.
    Heard(Leadership),
    /// A leader's plan or beacon was heard: as good as a heartbeat of this term.
    Sign(Ballot),
    /// Time went on; `closer` living members are closer to the destination than this drone.
    Tick {
        /// How many, not counting the leader whose silence started the election.
        closer: usize,
        /// How long the leader may be silent, s: at least [`ElectionParams::leader_timeout_s`], more on a bad link.
        patience_s: f64,
    },
}

/// The machine of one drone.
#[derive(Clone, Debug)]
pub struct Election {
    me: DroneId,
    incarnation: u32,
    params: ElectionParams,
    obeyed: Ballot,
    highest_round: u32,
    leads: bool,
    /// Last sign of life of the leader, or the start.
    heard: SimTime,
    next_heartbeat: SimTime,
}

impl Election {
    /// A drone that has just started and obeys nobody.
    #[must_use]
    pub fn new(me: DroneId, incarnation: u32, params: ElectionParams, now: SimTime) -> Self {
        Self {
            me,
            incarnation,
            params,
            obeyed: Ballot::NONE,
            highest_round: 0,
            leads: false,
            heard: now,
            next_heartbeat: now,
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

    /// Whether it leads, or the leader it obeys gave a sign of life within `patience_s`.
    #[must_use]
    pub fn has_leader(&self, now: SimTime, patience_s: f64) -> bool {
        self.leads || (self.obeyed.is_some() && now.since(self.heard) <= patience_s)
    }

    /// When the machine next wants a [`Input::Tick`], if nothing is heard until then.
    #[must_use]
    pub fn next_deadline(&self, closer: usize, patience_s: f64) -> SimTime {
        if self.leads {
            return self.next_heartbeat;
        }
        let silence = if self.obeyed.is_some() { patience_s.max(self.params.leader_timeout_s) } else { 0.0 };
        self.heard.after(silence + self.params.wait_s * (closer + 1) as f64)
    }

    /// Takes an input; returns what is to be said, if anything. `epoch` is the number of the last plan this drone made
    /// or obeys, told along with a heartbeat.
    pub fn handle(&mut self, now: SimTime, epoch: u32, input: Input) -> Option<Leadership> {
        match input {
            Input::Heard(message) => {
                self.hear(now, message.ballot);
                None
            }
            Input::Sign(ballot) => {
                self.hear(now, ballot);
                None
            }
            Input::Tick { closer, patience_s } => self.tick(now, epoch, closer, patience_s),
        }
    }

    fn hear(&mut self, now: SimTime, ballot: Ballot) {
        self.highest_round = self.highest_round.max(ballot.round);
        if ballot > self.obeyed {
            self.obeyed = ballot;
            self.leads = false;
        }
        if ballot == self.obeyed {
            self.heard = now;
        }
    }

    fn tick(&mut self, now: SimTime, epoch: u32, closer: usize, patience_s: f64) -> Option<Leadership> {
        if now < self.next_deadline(closer, patience_s) {
            return None;
        }
        let kind = if self.leads { LEADERSHIP_HEARTBEAT } else { LEADERSHIP_CLAIM };
        if !self.leads {
            // A round at the very top cannot be raised: then nobody claims any more, and the drones fly on by themselves.
            let round = self.highest_round.checked_add(1)?;
            self.highest_round = round;
            self.obeyed = Ballot { round, incarnation: self.incarnation, claimant: self.me };
            self.leads = true;
        }
        self.heard = now;
        self.next_heartbeat = now.after(self.params.heartbeat_period_s);
        Some(Leadership { stamp: now, ballot: self.obeyed, kind, group: GroupId::ALL, epoch, reserved: 0 })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PARAMS: ElectionParams = ElectionParams { heartbeat_period_s: 0.2, leader_timeout_s: 1.0, wait_s: 0.2 };

    fn at(seconds: f64) -> SimTime {
        SimTime::from_secs(seconds)
    }

    fn machine(id: u32) -> Election {
        Election::new(DroneId(id), 1, PARAMS, SimTime::ZERO)
    }

    /// Ticks a drone every 20 ms until it says something.
    fn until_said(drone: &mut Election, from_s: f64, closer: usize) -> (f64, Leadership) {
        (0..500)
            .map(|i| from_s + f64::from(i) * 0.02)
            .find_map(|t| drone.handle(at(t), 0, Input::Tick { closer, patience_s: 1.0 }).map(|said| (t, said)))
            .expect("says something within ten seconds")
    }

    #[test]
    fn the_closest_claims_first_and_the_next_only_if_it_hears_nothing() {
        let (first, claim) = until_said(&mut machine(5), 0.0, 0);
        let mut second = machine(3);
        assert!((0.2..0.24).contains(&first));
        second.handle(at(first + 0.02), 0, Input::Heard(claim));
        assert!(!second.leads() && second.obeyed() == claim.ballot);
        let (alone, _) = until_said(&mut machine(3), 0.0, 1);
        assert!((0.4..0.44).contains(&alone));
    }

    #[test]
    fn two_claims_settle_on_the_higher_ballot() {
        let (mut a, mut b) = (machine(1), machine(2));
        let (_, claim_a) = until_said(&mut a, 0.0, 0);
        let (_, claim_b) = until_said(&mut b, 0.0, 0);
        a.handle(at(0.3), 0, Input::Heard(claim_b));
        b.handle(at(0.3), 0, Input::Heard(claim_a));
        assert!(!a.leads() && b.leads());
        assert_eq!(a.obeyed(), b.obeyed());
    }

    #[test]
    fn a_silent_leader_is_replaced_by_a_higher_round_and_steps_down_when_it_wakes() {
        let (mut old, mut heir) = (machine(1), machine(2));
        let (t, claim) = until_said(&mut old, 0.0, 0);
        heir.handle(at(t), 0, Input::Heard(claim));
        let (later, next) = until_said(&mut heir, t, 0);
        assert!(later >= t + PARAMS.leader_timeout_s + PARAMS.wait_s - 0.021 && next.ballot > claim.ballot);
        old.handle(at(later), 0, Input::Heard(next));
        assert!(!old.leads());
    }

    #[test]
    fn heartbeats_and_plans_keep_a_leader_in_office() {
        let (mut leader, mut member) = (machine(1), machine(2));
        let (mut t, mut said) = until_said(&mut leader, 0.0, 3);
        for _ in 0..20 {
            member.handle(at(t), 0, Input::Heard(said));
            (t, said) = until_said(&mut leader, t + 0.02, 3);
            assert!(
                member.handle(at(t), 0, Input::Tick { closer: 0, patience_s: 1.0 }).is_none()
                    && member.has_leader(at(t), 1.0)
            );
        }
        for step in 1..10 {
            let now = at(t + f64::from(step) * 0.9);
            member.handle(now, 0, Input::Sign(said.ballot));
            assert!(member.has_leader(now, 1.0));
        }
    }

    #[test]
    fn the_greatest_round_neither_panics_nor_wraps() {
        let mut drone = machine(1);
        let top = Ballot { round: u32::MAX, incarnation: u32::MAX, claimant: DroneId(9) };
        drone.handle(at(0.0), 0, Input::Sign(top));
        assert!(drone.handle(at(60.0), 0, Input::Tick { closer: 0, patience_s: 1.0 }).is_none() && !drone.leads());
    }
}
