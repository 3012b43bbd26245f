//! The part of a drone that leads and follows: a sans-IO state machine. It hears messages, decides, and says messages.
//! Time is an argument.
//!
//! Terms are for groups. The leader of the whole swarm plans the first split. Then each part is led by one of its own
//! members, which plans what lies ahead of that part, jointly with the leaders of the other parts. Once all drones have
//! passed all obstacles, the foremost leader claims the whole swarm again, and the formation closes.

use crate::broadcaster::Broadcaster;
use crate::election::Input;
use crate::knowledge::Knowledge;
use crate::ledger::Ledger;
use crate::member::Member;
use crate::membership::Membership;
use crate::news::News;
use crate::obstacles::Obstacles;
use crate::own_state::OwnState;
use crate::params::LeadingParams;
use crate::peers::Peers;
use crate::plan_bundle::PlanBundle;
use crate::planned_set::PlannedSet;
use crate::planner::Planner;
use crate::relays::Relays;
use crate::roles::Roles;
use crate::silent::Silent;
use crate::situation::Situation;
use skein_protocol::payload::{Assignment, Leadership, MAX_PLACES, Presence, QueuePlace};
use skein_protocol::shape::ConvexShape;
use skein_protocol::{Ballot, DroneId, GroupId, Message, MessageRef, ObstacleId, PlanStamp, SimTime, Vec2};

/// The state machine of one drone. Its memory is bounded, whatever it hears.
///
/// In each tick, call [`Self::hear`] for each message, [`Self::sense`] for each sensed obstacle, [`Self::elect`], then if
/// it leads [`Self::refresh_members`], [`Self::decide`] and [`Self::adopt`], then [`Self::note_passed`] and
/// [`Self::speak`].
#[derive(Clone, Debug)]
pub struct Leading {
    drones: u32,
    knowledge: Knowledge,
    roles: Roles,
    membership: Membership,
    planner: Planner,
    broadcaster: Broadcaster,
    relays: Relays,
    leader_timeout_s: f64,
}

impl Leading {
    /// A drone that has just started and has heard nothing.
    #[must_use]
    pub fn new(params: &LeadingParams) -> Self {
        Self {
            drones: params.drones,
            knowledge: Knowledge::new(params),
            roles: Roles::default(),
            membership: Membership::default(),
            planner: Planner::new(params),
            broadcaster: Broadcaster::new(params),
            relays: Relays::new(params),
            leader_timeout_s: params.election.leader_timeout_s,
        }
    }

    /// The machine of the drone of `params` in a rollout: it knows what this drone knows, and this ledger. All drones are
    /// one group that this drone leads in its first term.
    #[must_use]
    pub fn rollout_member(&self, params: &LeadingParams, now: SimTime, ledger: Ledger) -> Self {
        let knowledge = self.knowledge.of_rollout_member(params, now, ledger);
        Self { knowledge, relays: Relays::unused(params), ..Self::new(params) }
    }

    /// Distance within which this drone hears others without a relay, m; `None` while, as far as it knows, all living drones hear each
    /// other.
    #[must_use]
    pub fn reach_m(&self) -> Option<f64> {
        self.relays.reach_m()
    }

    /// Whether this drone leads a group.
    #[must_use]
    pub fn is_leader(&self) -> bool {
        self.knowledge.election().leads()
    }

    /// The term this drone obeys, or leads in; [`Ballot::NONE`] before the first.
    #[must_use]
    pub fn term(&self) -> Ballot {
        self.knowledge.election().obeyed()
    }

    /// The group that the term is for.
    #[must_use]
    pub fn scope(&self) -> GroupId {
        self.knowledge.election().scope()
    }

    /// The group this drone is in: the scope of its term, or a part of it.
    #[must_use]
    pub fn group(&self) -> GroupId {
        self.ledger().group()
    }

    /// The stamp of the plan this drone obeys; the default, lower than any, before the first.
    #[must_use]
    pub fn stamp(&self) -> PlanStamp {
        self.ledger().stamp()
    }

    /// The newest stamp this drone has heard of, whether it can obey that plan yet or not.
    #[must_use]
    pub fn newest_stamp(&self) -> PlanStamp {
        self.ledger().newest()
    }

    /// The plan this drone obeys, with the assignments it has heard of.
    #[must_use]
    pub fn obeyed(&self) -> Option<&PlanBundle> {
        self.ledger().obeyed()
    }

    /// This drone's assignment in the plan it obeys.
    #[must_use]
    pub fn part(&self) -> Option<&Assignment> {
        self.ledger().part()
    }

    /// Hash of this drone's assignment: equal stamps must mean equal hashes. 0 before the first plan.
    #[must_use]
    pub fn part_hash(&self) -> u64 {
        self.ledger().part_hash()
    }

    /// The obstacle sets that are being passed, in flight order.
    #[must_use]
    pub fn planned_sets(&self) -> &[PlannedSet] {
        self.ledger().sets()
    }

    /// All that this drone knows of plans.
    #[must_use]
    pub fn ledger(&self) -> &Ledger {
        self.knowledge.ledger()
    }

    /// The beacons this drone has heard.
    #[must_use]
    pub fn peers(&self) -> &Peers {
        self.knowledge.peers()
    }

    /// The obstacles this drone knows.
    #[must_use]
    pub fn obstacles(&self) -> &Obstacles {
        self.knowledge.obstacles()
    }

    /// The living members of the group, this drone included, by id, as of the last [`Self::refresh_members`].
    #[must_use]
    pub fn members(&self) -> &[Member] {
        self.membership.members()
    }

    /// All living drones, by id, as of the last [`Self::refresh_members`].
    #[must_use]
    pub fn living(&self) -> Vec<Member> {
        self.membership.living()
    }

    /// Index of the alternative, of those that [`Self::decide`] returned last, that is flown until a choice is made.
    #[must_use]
    pub fn interim(&self) -> usize {
        self.planner.interim()
    }

    /// Whether this drone leads and hears others, none of which follows it. If this persists, no other drone can hear it.
    #[must_use]
    pub fn is_unfollowed(&self, now: SimTime) -> bool {
        self.knowledge.is_unfollowed(now)
    }

    /// The term in which this drone would lead all drones, had no drone led before.
    #[must_use]
    pub fn first_term(&self) -> Ballot {
        self.knowledge.first_term()
    }

    /// The ledger as if all drones were one group in this drone's [`Self::first_term`], with the queue places that living
    /// peers show in their beacons: what a rollout of the whole swarm starts from.
    #[must_use]
    pub fn united_ledger(&self, now: SimTime) -> Ledger {
        let living = self.peers().living(now);
        let places = living.flat_map(|(id, pose)| pose.pose().queue.into_iter().map(move |place| (id, place)));
        let flown: Vec<(DroneId, QueuePlace)> = places.filter(|(_, place)| place.set != 0).collect();
        self.ledger().united(self.first_term(), &flown)
    }

    /// Fetches what these messages will be compared with into the cache: a large swarm does not fit into it, and reads that are begun together
    /// take as long as one. Without any other effect. Call before [`Self::hear`].
    pub fn expect<'m>(&self, heard: impl Iterator<Item = (DroneId, MessageRef<'m>)> + Clone) {
        let peers = self.peers();
        if !peers.is_large() {
            return;
        }
        let stamp_of = peers.stamp_finder();
        for (source, message) in heard.clone() {
            peers.warm(source);
            match message {
                MessageRef::Presence(presence) => presence.present().iter().for_each(|present| {
                    peers.warm_stamp(present.drone);
                }),
                _ => self.relays.warm_facts(source, message),
            }
        }
        for (source, message) in heard {
            let MessageRef::Presence(presence) = message else {
                peers.warm_full(source);
                continue;
            };
            let near = self.relays.is_near(&self.knowledge, source);
            for present in presence.present() {
                let is_new = stamp_of(present.drone) < Some(present.stamp);
                if near || is_new {
                    self.relays.warm(present.drone);
                }
                if is_new {
                    peers.warm(present.drone);
                }
            }
        }
    }

    /// Hears a message of `source`. An answer that is due at once goes into `say`. A message of this drone, or of no drone
    /// of the swarm, is ignored.
    pub fn hear<'m>(
        &mut self,
        now: SimTime,
        source: DroneId,
        message: impl Into<MessageRef<'m>>,
        say: &mut Vec<Message>,
    ) {
        if source == self.knowledge.me() || source.0 >= self.drones {
            return;
        }
        let message = message.into();
        let is_fact = !matches!(message, MessageRef::Leadership(_) | MessageRef::Pose(_) | MessageRef::Presence(_));
        let passes_on = is_fact && self.relays.is_wide();
        let near = passes_on && self.relays.is_near(&self.knowledge, source);
        match message {
            MessageRef::Pose(pose) => {
                if self.knowledge.is_back(now, source, pose) {
                    self.broadcaster.restart_gossip(now);
                }
                let before = self.news_of(source);
                if self.knowledge.hear_pose(now, source, pose) {
                    self.roles.note_plan_conflict();
                }
                self.relays.hear_state(&self.knowledge, now, source, before, None);
            }
            MessageRef::Obstacle(o) => {
                self.knowledge.learn(now, o.id, o.shape, o.witness);
                if !passes_on || near {
                    let exceeded = self.knowledge.obstacles().exceed(o.id, &o.shape);
                    self.broadcaster.hear_obstacle(now, o.id, exceeded);
                }
            }
            MessageRef::Leadership(l) => {
                if self.relays.admits(&self.knowledge, now, source, l) {
                    say.extend(self.knowledge.hear_leadership(now, source, l).map(Message::Leadership));
                }
            }
            MessageRef::Plan(plan) => self.knowledge.hear_plan(now, source, plan),
            MessageRef::Assignment(part) => self.hear_assignment(now, source, part),
            MessageRef::AssignmentList(list) => {
                for part in list.assignments() {
                    self.hear_assignment(now, source, &part);
                    if passes_on {
                        self.relays.hear(&self.knowledge, now, source, near, MessageRef::Assignment(&part));
                    }
                }
            }
            MessageRef::Arrivals(row) => self.planner.hear(now, row),
            MessageRef::Passed(passed) => self.knowledge.hear_passed(source, passed),
            MessageRef::Presence(presence) => self.hear_presence(now, source, presence),
            // Neither lines between drones nor a message of the pilot's own say anything about leading.
            MessageRef::Separation(_) | MessageRef::User(_) => {}
        }
        if passes_on {
            self.relays.hear(&self.knowledge, now, source, near, message);
        }
    }

    fn hear_assignment(&mut self, now: SimTime, source: DroneId, part: &Assignment) {
        let goes_on = self.relays.newest(now, self.leader_timeout_s).any(|l| l.ballot == part.id.ballot);
        self.knowledge.hear_assignment(now, source, part, goes_on);
    }

    /// What this drone knows of another one, if it would pass it on.
    fn news_of(&self, drone: DroneId) -> Option<News> {
        let wide = self.relays.is_wide();
        self.peers().last(drone).filter(|_| wide).map(News::of_last)
    }

    /// Hears of drones that `source` has heard of. Most of it is known: several drones pass the same states on.
    fn hear_presence(&mut self, now: SimTime, source: DroneId, presence: &Presence) {
        let me = self.knowledge.me();
        let near = self.relays.is_near(&self.knowledge, source);
        for present in presence.present().iter().filter(|present| present.drone != me && present.drone.0 < self.drones)
        {
            let drone = present.drone;
            let known = self.knowledge.peers().stamp_of(drone);
            if known == Some(present.stamp) {
                if near {
                    self.relays.hear_newest(now, drone, present.stamp);
                }
                continue;
            }
            if known > Some(present.stamp) && !near {
                continue;
            }
            let pose = presence.pose(present);
            let before = self.news_of(drone);
            if self.knowledge.hear_of(now, drone, &pose) {
                self.roles.note_plan_conflict();
            }
            self.relays.hear_state(&self.knowledge, now, drone, before, near.then_some(&pose));
        }
    }

    /// Senses a whole obstacle, world frame. Returns whether it is new.
    pub fn sense(&mut self, now: SimTime, id: ObstacleId, shape: ConvexShape) -> bool {
        self.knowledge.learn(now, id, shape, self.knowledge.me())
    }

    /// Sets whether a sensor of this drone is broken. An impaired drone leads only while no healthy one can.
    pub fn set_impaired(&mut self, impaired: bool) {
        self.knowledge.set_impaired(impaired);
    }

    /// Runs the election: heartbeats, pre-votes, claims and transfers go into `say`. Call once per tick.
    pub fn elect(&mut self, now: SimTime, own: &OwnState, say: &mut Vec<Message>) {
        if self.relays.is_settling(&self.knowledge, now) {
            self.knowledge.elect(now, Input::Settling);
        }
        self.follow_part(now);
        let (closer, delay_s) = (self.knowledge.closer(now, own), self.peers().delay_s());
        say.extend(self.knowledge.elect(now, Input::Tick { closer, delay_s }).map(Message::Leadership));
        if let Some(input) = self.roles.decide(&self.knowledge, &self.relays, now, own) {
            say.extend(self.knowledge.elect(now, input).map(Message::Leadership));
        }
    }

    /// Obeys the leader of this drone's part of a split group, if that leader was heard before this drone knew which part it is in.
    /// What was passed on counts only if this drone does not hear that leader itself.
    fn follow_part(&mut self, now: SimTime) {
        let (scope, group) = (self.knowledge.election().scope(), self.knowledge.election().group());
        if scope == group {
            return;
        }
        let own_word = |l: &Leadership| l.hops == 0 || !self.peers().is_heard_now(l.ballot.claimant, now);
        let mut newest = self.relays.newest(now, self.leader_timeout_s);
        if let Some(message) = newest.find(|l| l.group == group).copied().filter(own_word) {
            self.knowledge.elect(now, Input::Heard(message));
        }
    }

    /// Determines which living drones belong to the group. Call before [`Self::decide`].
    pub fn refresh_members(&mut self, now: SimTime, own: &OwnState) {
        self.membership.refresh(&self.knowledge, now, own);
        self.knowledge.note_members_passed(self.membership.members());
    }

    /// What a leader decides now: nothing, one plan, or alternatives to choose among. Messages to other leaders go into
    /// `say`. `silent`: drones that are not heard any more.
    pub fn decide(&mut self, now: SimTime, silent: &[Silent], say: &mut Vec<Message>) -> Vec<PlanBundle> {
        let mut rows = Vec::new();
        let k = &self.knowledge;
        let situation = Situation {
            params: k.params(),
            now,
            ballot: k.election().obeyed(),
            scope: k.election().scope(),
            members: self.membership.members(),
            others: self.membership.others(),
            delay_s: k.peers().delay_s(),
            wide: self.relays.is_wide(),
            silent,
            obstacles: k.obstacles(),
            ledger: k.ledger(),
        };
        let bundles = self.planner.decide(&situation, &mut rows);
        say.extend(rows.into_iter().map(Message::Arrivals));
        bundles
    }

    /// Adopts a plan of this drone's own making and makes it due to be said. Assignments of drones of other groups are
    /// announced to their leaders instead.
    pub fn adopt(&mut self, now: SimTime, mut bundle: PlanBundle) {
        let members = self.membership.members();
        self.planner.announce_choice(now, &mut bundle, |id| members.iter().any(|m| m.id == id));
        self.obey(now, bundle);
    }

    /// Adopts a plan, whichever leader made it.
    pub fn obey(&mut self, now: SimTime, bundle: PlanBundle) {
        self.knowledge.adopt(now, bundle);
        self.broadcaster.hurry();
    }

    /// Notes which planned sets this drone has left behind, being at `position` (world frame, m).
    pub fn note_passed(&mut self, position: Vec2) {
        self.knowledge.note_passed(position);
    }

    /// Says what is due: the beacon, and repetitions. `places` are this drone's places in queues. Call once per tick.
    pub fn speak(&mut self, now: SimTime, own: &OwnState, places: &[QueuePlace; MAX_PLACES], say: &mut Vec<Message>) {
        self.broadcaster.speak(&self.knowledge, now, own, places, &mut self.relays, say);
    }
}
