//! What a drone has heard and may have to pass on, and when it does. See [`crate::relays`].
//!
//! A large swarm has a thousand assignments, so a drone looks at those only whose turn has come.

use crate::beacons::Beacon;
use crate::fact_store::{FactStore, Known};
use crate::fact_values::{Fact, Version};
use crate::gossip::{Gossip, GossipRhythm};
use crate::knowledge::Knowledge;
use crate::params::LeadingParams;
use crate::pool::{Linked, Pool};
use crate::subject::Subject;
use crate::tuning::{DETOUR_DOUBLINGS, PASSAGES, RELAY_MEMORY_S, UNWANTED_REPEATS};
use crate::turns::Turns;
use skein_protocol::payload::{Assignment, Plan};
use skein_protocol::{Ballot, DroneId, GroupId, Message, MessageRef, SimTime, Vec2};

/// Of the messages whose turn has come, that many are fetched into the cache at once. Chosen by hand: few, because the rest may have to wait.
const DUE_AT_ONCE: usize = 32;

/// Whether some drone needs a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Need {
    Now,
    /// None needs it now, but time alone can change that.
    Later,
    /// None needs it, unless what the drone obeys changes.
    Over,
}

/// What is kept with each message. A drone of a large swarm keeps thousands of them, so it is small.
#[repr(C, packed(4))]
#[derive(Clone, Copy, Debug)]
struct Relayed {
    /// When it was last heard.
    heard: SimTime,
    /// The place of what tells when it is passed on; [`DONE`] if it never is again.
    passing: u32,
}

/// When a message is passed on.
#[repr(C, packed(4))]
#[derive(Clone, Copy, Debug)]
struct Passing {
    /// When it is looked at next; [`NO_TURN`] if it need not be passed on again, unless [`RelayedFacts::wake`] is called.
    turn: SimTime,
    gossip: Gossip,
    /// The drone it was first heard from.
    from: DroneId,
}

/// [`Relayed::passing`] of a message that is never passed on again.
const DONE: u32 = u32::MAX;

/// The turn of a message that need not be passed on.
const NO_TURN: SimTime = SimTime::MAX;

/// The messages that one drone may pass on. Memory is bounded by the size of the swarm.
#[derive(Clone, Debug)]
pub(crate) struct RelayedFacts {
    rhythm: GossipRhythm,
    room: usize,
    drones: u32,
    known: FactStore<Relayed>,
    passing: Pool<Passing>,
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
        Self {
            rhythm: GossipRhythm::varying(params.repeat_period_s, params.me),
            room: 8 * params.drones as usize + 64,
            drones: params.drones,
            known: FactStore::new(params.drones),
            passing: Pool::default(),
            turns: Turns::default(),
            heard_since: params.start,
            passage_s: passage_s(params.drones),
        }
    }

    /// Forgets all.
    pub(crate) fn clear(&mut self) {
        self.known.clear();
        self.passing = Pool::default();
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
        let stays = |fact: Fact<'_>, one: &Relayed| {
            let memory_s = if matches!(fact, Fact::Passed(_)) { passage_s } else { RELAY_MEMORY_S };
            let stays = now.since(one.heard) < memory_s;
            if stays {
                let heard = one.heard;
                self.heard_since = self.heard_since.min(heard.after(memory_s - RELAY_MEMORY_S));
            } else if one.passing != DONE {
                self.passing.remove(one.passing);
            }
            stays
        };
        if self.known.retain(stays) {
            self.turns.retain(|subject| self.known.contains(subject));
        }
    }

    /// Fetches what is kept of the drones that a message of `source` is about into the cache.
    pub(crate) fn warm(&self, source: DroneId, message: MessageRef<'_>) {
        match message {
            MessageRef::AssignmentList(list) => {
                list.assignments().for_each(|part| self.known.warm(&Subject::Part(part.scope, part.drone)));
            }
            message => subject(source, message).iter().for_each(|(subject, _)| self.known.warm(subject)),
        }
    }

    /// Notes a message of `source`. `near`: that drone is close to this one.
    pub(crate) fn hear(&mut self, now: SimTime, source: DroneId, message: MessageRef<'_>, near: bool) {
        let Some((subject, version)) = subject(source, message) else { return };
        if subject.drone().is_some_and(|drone| drone.0 >= self.drones) {
            return;
        }
        let full = self.known.len() >= self.room;
        if let Some(known) = self.known.get_mut(&subject) {
            if known.version() == version {
                known.with.heard = now;
                if near && let Some(passing) = self.passing.get_mut(known.with.passing) {
                    passing.gossip.hear();
                }
            }
            if known.version() >= version || known.is_same_passage(message) {
                return;
            }
        } else if full {
            return;
        }
        let gossip = Gossip::new(now);
        let turn = gossip.next_turn(&self.rhythm);
        let passing = self.passing.add(Passing { turn, gossip, from: source });
        if let Some(old) = self.known.keep(subject, message, Relayed { heard: now, passing }) {
            self.stop(subject, old.passing);
        }
        self.turns.add(turn, subject);
    }

    /// What is at this place does not tell any more when a message about this subject is passed on.
    fn stop(&mut self, subject: Subject, passing: u32) {
        let Some(old) = self.passing.get(passing) else { return };
        if old.has_turn() {
            self.turns.remove(old.turn, subject);
        }
        self.passing.remove(passing);
    }

    /// Notes that what a drone obeys has changed: it may need its assignments again.
    pub(crate) fn wake(&mut self, now: SimTime, drone: DroneId) {
        let turn = Gossip::new(now).next_turn(&self.rhythm);
        self.known.change_parts_of(drone, |scope, one| {
            if let Some(passing) = self.passing.get_mut(one.passing).filter(|passing| !passing.has_turn()) {
                passing.turn = turn;
                self.turns.add(turn, Subject::Part(scope, drone));
            }
        });
    }

    /// Says what is due, until `last` messages are said. Assignments of one group share messages. This drone is at `position`,
    /// world frame, m.
    pub(crate) fn speak(&mut self, k: &Knowledge, now: SimTime, position: Vec2, last: usize, say: &mut Vec<Message>) {
        for subject in self.turns.due(now).take(DUE_AT_ONCE).filter(|_| say.len() < last) {
            if let Subject::Part(_, drone) = subject {
                self.known.warm(&subject);
                k.peers().warm(drone);
            }
        }
        let first = say.len();
        while let Some(subject) = self.turns.first_due(now) {
            let known = self.known.get_mut(&subject);
            let part = known.as_ref().and_then(Known::assignment);
            let open = part.and_then(|part| open_list(&say[first..], &part));
            if open.is_none() && say.len() >= last {
                break;
            }
            self.turns.take_due(now);
            let Some(known) = known else { continue };
            let Some(passing) = self.passing.get_mut(known.with.passing) else { continue };
            let need = need(k, now, subject, part, (known.fact(), passing));
            let is_due = need == Need::Now && passing.gossip.is_due(&self.rhythm, now);
            if is_due && is_on_the_way(k, position, part, passing) {
                match (open.and_then(|place| say.get_mut(first + place)), part) {
                    (Some(Message::AssignmentList(list)), Some(part)) => drop(list.push(&part)),
                    _ => say.extend(known.passed_on(subject)),
                }
            }
            passing.turn = passing.next_look(&self.rhythm, now, known.fact(), need);
            if passing.has_turn() {
                self.turns.add(passing.turn, subject);
            } else if part.is_none() {
                // Only assignments are needed again.
                self.passing.remove(known.with.passing);
                known.with.passing = DONE;
            }
        }
    }
}

impl Linked for Passing {
    fn link(&self) -> u32 {
        self.from.0
    }

    fn set_link(&mut self, place: u32) {
        self.from = DroneId(place);
    }
}

impl Passing {
    /// Whether the message is looked at again.
    fn has_turn(&self) -> bool {
        let turn = self.turn;
        turn != NO_TURN
    }

    /// When the message is looked at again after a look at `now`, or [`NO_TURN`].
    fn next_look(&self, rhythm: &GossipRhythm, now: SimTime, fact: Fact<'_>, need: Need) -> SimTime {
        match (fact, need) {
            (Fact::Arrivals(_) | Fact::Passed(_), _) if !self.gossip.is_first() => NO_TURN,
            (_, Need::Over) => NO_TURN,
            (Fact::Plan(_), Need::Later) => now.after(rhythm.shortest_s()),
            (_, Need::Later) => now.after(rhythm.shortest_s() * UNWANTED_REPEATS),
            (_, Need::Now) => self.gossip.next_turn(rhythm).max(SimTime(now.0 + 1)),
        }
    }
}

/// For how long a drone of a swarm of this size remembers a passage, s.
fn passage_s(drones: u32) -> f64 {
    RELAY_MEMORY_S * (f64::from(drones) / PASSAGES).max(1.0)
}

/// The place among these messages of a list with room for this assignment.
fn open_list(said: &[Message], part: &Assignment) -> Option<usize> {
    said.iter().position(|message| matches!(message, Message::AssignmentList(list) if list.takes(part)))
}

/// What a message is about, and its version; `None` if it is not passed on.
fn subject(source: DroneId, message: MessageRef<'_>) -> Option<(Subject, Version)> {
    Some(match message {
        MessageRef::Plan(plan) => (Subject::Plan(plan.group), Version::of(plan.id)),
        MessageRef::Assignment(part) => (Subject::Part(part.scope, part.drone), Version::of(part.id)),
        MessageRef::Arrivals(row) => (Subject::Arrivals(row.kind, row.drone), Version::at(row.stamp)),
        MessageRef::Passed(passed) => (Subject::Passed(passed.drone(source)), Version::at(passed.stamp)),
        _ => return None,
    })
}

/// Whether some drone may still need the message. `part`: the assignment that it brings.
fn need(
    k: &Knowledge,
    now: SimTime,
    subject: Subject,
    part: Option<Assignment>,
    (fact, passing): (Fact<'_>, &Passing),
) -> Need {
    let now_or_later = |wanted| if wanted { Need::Now } else { Need::Later };
    if let (Subject::Plan(scope), Fact::Plan(plan)) = (subject, fact) {
        return now_or_later(is_plan_wanted(k, now, scope, plan));
    }
    let is_first = passing.gossip.is_first();
    let Some(part) = part else { return now_or_later(is_first) };
    match k.peers().last_of_living(part.drone, now) {
        Some(pose) if is_late(&pose, part.id.ballot, part.id.epoch) => Need::Now,
        // Unless it was said, it is said once if the drone falls silent.
        Some(_) if is_first => Need::Later,
        Some(_) => Need::Over,
        None => now_or_later(is_first),
    }
}

/// Whether this drone, which is at `position`, is closer to the drone that a message is for than the one it heard it from. In the end
/// the message is passed on in all directions. `part`: the assignment that it brings.
fn is_on_the_way(k: &Knowledge, position: Vec2, part: Option<Assignment>, passing: &Passing) -> bool {
    let Some(pose) = part.and_then(|part| k.peers().last(part.drone)) else { return true };
    let away_m = |from: Vec2| (from - pose.position()).norm();
    let closer = || k.peers().last(passing.from).is_none_or(|from| away_m(position) < away_m(from.position()));
    passing.gossip.doublings() >= DETOUR_DOUBLINGS || closer()
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
    use skein_protocol::payload::Passed;

    #[test]
    fn each_message_is_forgotten_when_it_was_not_heard_for_long() {
        let mut facts = RelayedFacts {
            rhythm: GossipRhythm::varying(0.2, DroneId(8)),
            room: 64,
            drones: 8,
            known: FactStore::new(8),
            passing: Pool::default(),
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
    fn what_is_kept_with_a_message_takes_little_memory() {
        assert_eq!((size_of::<Relayed>(), size_of::<Passing>()), (12, 24));
    }

    #[test]
    fn a_passage_is_passed_on_less_often_in_a_large_swarm() {
        let passed_on = |drones: u32| {
            let mut facts = RelayedFacts {
                rhythm: GossipRhythm::varying(0.2, DroneId(8)),
                room: 64,
                drones: 9,
                known: FactStore::new(9),
                passing: Pool::default(),
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
