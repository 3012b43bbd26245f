//! What a drone has heard and may have to pass on, and when it does. See [`crate::relays`].
//!
//! A large swarm has a thousand assignments, so a drone looks at those only whose turn has come.

use crate::beacons::Beacon;
use crate::fact_store::FactStore;
use crate::gossip::Gossip;
use crate::knowledge::Knowledge;
use crate::params::LeadingParams;
use crate::subject::Subject;
use crate::tuning::{DETOUR_DOUBLINGS, PASSAGES, RELAY_MEMORY_S, UNWANTED_REPEATS};
use crate::turns::Turns;
use skein_protocol::payload::{Arrivals, Assignment, AssignmentList, Passed, Plan};
use skein_protocol::{Ballot, DroneId, GroupId, Message, MessageRef, SimTime, Vec2};

/// Of the messages whose turn has come, that many are read into the cache at once. Chosen by hand: few, because the rest may have to wait.
const DUE_AT_ONCE: usize = 32;

/// Which of two messages about the same subject is newer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
struct Version {
    ballot: Ballot,
    epoch: u32,
    stamp: SimTime,
}

/// What a message says. Most are assignments, so the others are elsewhere.
#[derive(Clone, Debug, PartialEq)]
enum Fact {
    Plan(Box<Plan>),
    Part(Assignment),
    Arrivals(Box<Arrivals>),
    Passed(Box<Passed>),
}

/// Whether some drone needs a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Need {
    Now,
    /// None needs it now, but time alone can change that.
    Later,
    /// None needs it, unless what the drone obeys changes.
    Over,
}

/// A message that may be passed on.
#[derive(Clone, Debug, PartialEq)]
struct Relayed {
    fact: Fact,
    version: Version,
    /// The drone it was first heard from.
    from: DroneId,
    /// When it was last heard.
    heard: SimTime,
    gossip: Gossip,
    /// When it is looked at next; `None` if it need not be passed on again, unless [`RelayedFacts::wake`] is called.
    turn: Option<SimTime>,
}

/// The messages that one drone may pass on. Memory is bounded by the size of the swarm.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct RelayedFacts {
    me: DroneId,
    repeat_s: f64,
    room: usize,
    known: FactStore<Relayed>,
    /// The messages that will be looked at, by their turns.
    turns: Turns<Subject>,
    /// No message is forgotten earlier than [`RELAY_MEMORY_S`] after this.
    heard_since: SimTime,
    /// For how long a passage is remembered, s. Its drone goes on saying it, so once it is forgotten it is passed on again. In a large swarm
    /// it is remembered for longer, so that a drone does not hear more passages than in a small one.
    passage_s: f64,
}

impl RelayedFacts {
    /// Nothing heard.
    pub(crate) fn new(params: &LeadingParams) -> Self {
        let (me, repeat_s, room) = (params.me, params.repeat_period_s, 8 * params.drones as usize + 64);
        Self {
            me,
            repeat_s,
            room,
            known: FactStore::new(params.drones),
            turns: Turns::default(),
            heard_since: params.start,
            passage_s: passage_s(params.drones),
        }
    }

    /// Forgets all.
    pub(crate) fn clear(&mut self) {
        self.known.clear();
        self.turns.clear();
    }

    /// Forgets what was not heard for long.
    pub(crate) fn forget(&mut self, now: SimTime) {
        // A look at all costs as much as many ticks.
        if now.since(self.heard_since) < RELAY_MEMORY_S {
            return;
        }
        self.heard_since = now;
        let passage_s = self.passage_s;
        let stays = |one: &Relayed| {
            let memory_s = if matches!(one.fact, Fact::Passed(_)) { passage_s } else { RELAY_MEMORY_S };
            let stays = now.since(one.heard) < memory_s;
            if stays {
                self.heard_since = self.heard_since.min(one.heard.after(memory_s - RELAY_MEMORY_S));
            }
            stays
        };
        if self.known.retain(stays) {
            self.turns.retain(|subject| self.known.contains(subject));
        }
    }

    /// Reads what is kept of the drones that a message of `source` is about, so that it is in the cache.
    pub(crate) fn warm(&self, source: DroneId, message: MessageRef<'_>) {
        let warm = |drone| self.known.warm(drone, |one| one.heard);
        match message {
            MessageRef::Assignment(part) => warm(part.drone),
            MessageRef::AssignmentList(list) => list.assignments().for_each(|part| warm(part.drone)),
            MessageRef::Arrivals(row) => warm(row.drone),
            MessageRef::Passed(passed) => warm(passed.drone(source)),
            _ => {}
        }
    }

    /// Notes a message of `source`. `near`: that drone is close to this one.
    pub(crate) fn hear(&mut self, now: SimTime, source: DroneId, message: MessageRef<'_>, near: bool) {
        let Some((subject, version)) = subject(source, message) else { return };
        let known = self.known.get_mut(&subject);
        if let Some(one) = known.filter(|one| one.version >= version || is_same_passage(&one.fact, message)) {
            if one.version == version {
                one.heard = now;
                if near {
                    one.gossip.hear();
                }
            }
            return;
        }
        let old = self.known.get_mut(&subject).map(|one| one.turn);
        let Some(fact) = fact(message).filter(|_| old.is_some() || self.known.len() < self.room) else { return };
        if let Some(turn) = old.flatten() {
            self.turns.remove(turn, subject);
        }
        let gossip = Gossip::varying(now, self.repeat_s, self.me);
        let turn = gossip.next_turn();
        self.turns.add(turn, subject);
        self.known.insert(subject, Relayed { fact, version, from: source, heard: now, gossip, turn: Some(turn) });
    }

    /// Notes that what a drone obeys has changed: it may need its assignments again.
    pub(crate) fn wake(&mut self, now: SimTime, drone: DroneId) {
        let turn = Gossip::varying(now, self.repeat_s, self.me).next_turn();
        for (scope, one) in self.known.parts_of(drone).filter(|(_, one)| one.turn.is_none()) {
            one.turn = Some(turn);
            self.turns.add(turn, Subject::Part(scope, drone));
        }
    }

    /// Says what is due, until `last` messages are said. Assignments of one group share messages. This drone is at `position`,
    /// world frame, m.
    pub(crate) fn speak(&mut self, k: &Knowledge, now: SimTime, position: Vec2, last: usize, say: &mut Vec<Message>) {
        for subject in self.turns.due(now).take(DUE_AT_ONCE).filter(|_| say.len() < last) {
            if let Subject::Part(_, drone) = subject {
                self.known.warm(drone, |one| one.heard);
                k.peers().warm(drone);
            }
        }
        let first = say.len();
        while let Some(subject) = self.turns.first_due(now) {
            let open = self.known.get_mut(&subject).and_then(|one| open_list(&say[first..], &one.fact));
            if open.is_none() && say.len() >= last {
                break;
            }
            self.turns.take_due(now);
            let Some(one) = self.known.get_mut(&subject) else { continue };
            let need = need(k, now, subject, one);
            if need == Need::Now && one.gossip.is_due(now) && is_on_the_way(k, position, one) {
                match (open.and_then(|place| say.get_mut(first + place)), &one.fact) {
                    (Some(Message::AssignmentList(list)), Fact::Part(part)) => drop(list.push(part)),
                    _ => say.push(one.passed_on()),
                }
            }
            one.turn = one.next_look(now, need, self.repeat_s);
            if let Some(turn) = one.turn {
                self.turns.add(turn, subject);
            }
        }
    }
}

impl Relayed {
    /// When the message is looked at again after a look at `now`.
    fn next_look(&self, now: SimTime, need: Need, repeat_s: f64) -> Option<SimTime> {
        match (&self.fact, need) {
            (Fact::Arrivals(_) | Fact::Passed(_), _) if !self.gossip.is_first() => None,
            (_, Need::Over) => None,
            (Fact::Plan(_), Need::Later) => Some(now.after(repeat_s)),
            (_, Need::Later) => Some(now.after(repeat_s * UNWANTED_REPEATS)),
            (_, Need::Now) => Some(self.gossip.next_turn().max(SimTime(now.0 + 1))),
        }
    }

    /// The message as it is passed on.
    fn passed_on(&self) -> Message {
        match &self.fact {
            Fact::Plan(plan) => Message::Plan(**plan),
            Fact::Part(part) => Message::AssignmentList(AssignmentList::of(part)),
            Fact::Arrivals(row) => Message::Arrivals(**row),
            Fact::Passed(passed) => {
                Message::Passed(Passed { of: passed.drone(self.from).0.saturating_add(1), ..**passed })
            }
        }
    }
}

/// For how long a drone of a swarm of this size remembers a passage, s.
fn passage_s(drones: u32) -> f64 {
    RELAY_MEMORY_S * (f64::from(drones) / PASSAGES).max(1.0)
}

/// The place among these messages of a list with room for this assignment.
fn open_list(said: &[Message], fact: &Fact) -> Option<usize> {
    let Fact::Part(part) = fact else { return None };
    said.iter().position(|message| matches!(message, Message::AssignmentList(list) if list.takes(part)))
}

/// What a message is about, and its version; `None` if it is not passed on.
fn subject(source: DroneId, message: MessageRef<'_>) -> Option<(Subject, Version)> {
    let at = |stamp| Version { stamp, ..Version::default() };
    Some(match message {
        MessageRef::Plan(plan) => {
            let version = Version { ballot: plan.id.ballot, epoch: plan.id.epoch, ..Version::default() };
            (Subject::Plan(plan.group), version)
        }
        MessageRef::Assignment(part) => {
            let version = Version { ballot: part.id.ballot, epoch: part.id.epoch, ..Version::default() };
            (Subject::Part(part.scope, part.drone), version)
        }
        MessageRef::Arrivals(row) => (Subject::Arrivals(row.kind, row.drone), at(row.stamp)),
        MessageRef::Passed(passed) => (Subject::Passed(passed.drone(source)), at(passed.stamp)),
        _ => return None,
    })
}

/// What a message says; `None` if it is not passed on.
fn fact(message: MessageRef<'_>) -> Option<Fact> {
    Some(match message {
        MessageRef::Plan(plan) => Fact::Plan(Box::new(*plan)),
        MessageRef::Assignment(part) => Fact::Part(*part),
        MessageRef::Arrivals(row) => Fact::Arrivals(Box::new(*row)),
        MessageRef::Passed(passed) => Fact::Passed(Box::new(*passed)),
        _ => return None,
    })
}

/// Whether both messages report that a drone has passed the same obstacles.
fn is_same_passage(known: &Fact, heard: MessageRef<'_>) -> bool {
    matches!((known, heard), (Fact::Passed(a), MessageRef::Passed(b)) if a.set_count == b.set_count && a.set == b.set)
}

/// Whether some drone may still need the message.
fn need(k: &Knowledge, now: SimTime, subject: Subject, one: &Relayed) -> Need {
    let now_or_later = |wanted| if wanted { Need::Now } else { Need::Later };
    match (subject, &one.fact) {
        (Subject::Plan(scope), Fact::Plan(plan)) => now_or_later(is_plan_wanted(k, now, scope, plan)),
        (Subject::Part(..), Fact::Part(part)) => match k.peers().last_of_living(part.drone, now) {
            Some(pose) if is_late(&pose, part.id.ballot, part.id.epoch) => Need::Now,
            // Unless it was said, it is said once if the drone falls silent.
            Some(_) if one.gossip.is_first() => Need::Later,
            Some(_) => Need::Over,
            None => now_or_later(one.gossip.is_first()),
        },
        _ => now_or_later(one.gossip.is_first()),
    }
}

/// Whether this drone, which is at `position`, is closer to the drone that a message is for than the one it heard it from. In the end
/// the message is passed on in all directions.
fn is_on_the_way(k: &Knowledge, position: Vec2, one: &Relayed) -> bool {
    let Fact::Part(part) = &one.fact else { return true };
    let Some(pose) = k.peers().last(part.drone) else { return true };
    let away_m = |from: Vec2| (from - pose.position()).norm();
    let closer = || k.peers().last(one.from).is_none_or(|from| away_m(position) < away_m(from.position()));
    one.gossip.doublings() >= DETOUR_DOUBLINGS || closer()
}

/// Whether a neighbour of the plan's group does not obey it yet.
fn is_plan_wanted(k: &Knowledge, now: SimTime, scope: GroupId, plan: &Plan) -> bool {
    let late = |pose: &Beacon<'_>| scope.contains(pose.group()) && is_late(pose, plan.id.ballot, plan.id.epoch);
    k.peers().direct(now).any(|(_, pose)| late(&pose))
}

/// Whether a drone has not obeyed a plan yet, and will.
fn is_late(pose: &Beacon<'_>, ballot: Ballot, epoch: u32) -> bool {
    (pose.obeyed().ballot, pose.obeyed().epoch) < (ballot, epoch) && pose.term() <= ballot
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;

    #[test]
    fn each_message_is_forgotten_when_it_was_not_heard_for_long() {
        let mut facts = RelayedFacts {
            me: DroneId(8),
            repeat_s: 0.2,
            room: 64,
            known: FactStore::new(8),
            turns: Turns::default(),
            heard_since: SimTime::ZERO,
            passage_s: RELAY_MEMORY_S,
        };
        let mut heard = [None; 8];
        let passed = Passed { set_count: 1, ..Passed::zeroed() };
        let (mut kept, mut forgotten) = (0, 0);
        for second in 0..600_u32 {
            let now = SimTime::from_secs(f64::from(second));
            let drone = second.wrapping_mul(0x9e37_79b9) >> 29;
            // Drones are heard in some minutes only.
            if (second / 60 + drone).is_multiple_of(3) {
                facts.hear(now, DroneId(drone), MessageRef::Passed(&passed), false);
                heard[drone as usize] = Some(now);
            }
            facts.forget(now);
            for (drone, heard) in (0..).map(DroneId).zip(heard) {
                let lives = heard.is_some_and(|heard| now.since(heard) < RELAY_MEMORY_S);
                let subject = Subject::Passed(drone);
                assert_eq!(facts.known.contains(&subject), lives, "{drone:?} at {second} s");
                assert_eq!(facts.turns.due(SimTime::MAX).any(|turn| turn == subject), lives, "{drone:?} at {second} s");
                (kept, forgotten) = (kept + u32::from(lives), forgotten + u32::from(heard.is_some() && !lives));
            }
        }
        assert!(kept > 1000 && forgotten > 1000, "{kept} {forgotten}");
    }

    #[test]
    fn a_passage_is_passed_on_less_often_in_a_large_swarm() {
        let passed_on = |drones: u32| {
            let mut facts = RelayedFacts {
                me: DroneId(8),
                repeat_s: 0.2,
                room: 64,
                known: FactStore::new(9),
                turns: Turns::default(),
                heard_since: SimTime::ZERO,
                passage_s: passage_s(drones),
            };
            let mut turns = 0;
            for second in 0..1200 {
                let now = SimTime::from_secs(f64::from(second));
                // The drone says it again and again.
                let passed = Passed { stamp: now, set_count: 1, ..Passed::zeroed() };
                facts.hear(now, DroneId(1), MessageRef::Passed(&passed), false);
                turns += std::iter::from_fn(|| facts.turns.take_due(now)).count();
                facts.forget(now);
            }
            turns
        };
        assert_eq!([1, 64, 256, 1280].map(passed_on), [39, 39, 10, 2]);
    }
}
