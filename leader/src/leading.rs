//! The part of a drone that leads and follows, a sans-IO machine: who is there, who leads, what is planned, what is to
//! be said. It knows what it is told, and time only as an argument.
//!
//! Terms are for groups. The leader of the whole swarm plans the first split; then each part is led by a member of its
//! own, who plans what lies ahead of that part, jointly with the leaders of the other parts. Once all are past
//! everything, the foremost leader claims the whole swarm again, and the formation closes.

use crate::election::{Election, ElectionParams, Input};
use crate::ledger::Ledger;
use crate::member::Member;
use crate::membership::Peers;
use crate::obstacles::Obstacles;
use crate::params::PlannerParams;
use crate::parts::Due;
use crate::plan_bundle::PlanBundle;
use crate::planned_set::PlannedSet;
use crate::planner::Planner;
use crate::situation::Situation;
use crate::talk::Talk;
use skein_protocol::payload::{Assignment, Leadership, Pose, QueuePlace};
use skein_protocol::shape::ConvexShape;
use skein_protocol::{
    Ballot, DroneId, GroupId, LeadershipKind, Message, MessageRef, ObstacleId, PlanStamp, SimTime, Vec2,
};

/// What the machine needs to know before it starts.
#[derive(Clone, Debug)]
pub struct LeadingParams {
    /// Who it is.
    pub me: DroneId,
    /// Size of the swarm.
    pub drones: u32,
    /// Of its process, from 1.
    pub incarnation: u32,
    /// When it starts.
    pub start: SimTime,
    /// Length of a tick, s.
    pub dt_s: f64,
    /// Elections.
    pub election: ElectionParams,
    /// Planning.
    pub planner: PlannerParams,
    /// Between two beacons, s.
    pub beacon_period_s: f64,
    /// Between two repetitions of what has to be repeated, s.
    pub repeat_period_s: f64,
    /// A peer that is silent for longer counts as gone, s.
    pub peer_timeout_s: f64,
}

/// What a drone knows of itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Own {
    /// The running number of the tick.
    pub tick: u64,
    /// Where it is, world frame, m.
    pub position: Vec2,
    /// Its velocity, world frame, m/s.
    pub velocity: Vec2,
}

/// The machine of one drone. Bounded memory, whatever it hears.
#[derive(Clone, Debug)]
pub struct Leading {
    pub(crate) me: DroneId,
    pub(crate) incarnation: u32,
    drones: u32,
    pub(crate) wait_s: f64,
    pub(crate) peers: Peers,
    pub(crate) obstacles: Obstacles,
    pub(crate) ledger: Ledger,
    pub(crate) election: Election,
    pub(crate) planner: Planner,
    pub(crate) talk: Talk,
    pub(crate) members: Vec<Member>,
    pub(crate) others: Vec<Member>,
    pub(crate) due: Due,
    pub(crate) impaired: bool,
}

impl Leading {
    /// A drone that has just started and has heard nothing.
    #[must_use]
    pub fn new(params: &LeadingParams) -> Self {
        let reach_m = 2.0 * params.planner.routes.planning_distance_m;
        Self {
            me: params.me,
            incarnation: params.incarnation,
            drones: params.drones,
            wait_s: params.election.wait_s,
            peers: Peers::new(params.drones, params.peer_timeout_s),
            obstacles: Obstacles::new(params.drones, reach_m),
            ledger: Ledger::new(params.me, params.drones, params.planner.routes),
            election: Election::new(params.me, params.incarnation, params.election, params.start),
            planner: Planner::new(params.planner.clone(), params.drones, params.repeat_period_s),
            talk: Talk::new(params.start, params.dt_s, params.beacon_period_s, params.repeat_period_s),
            members: Vec::new(),
            others: Vec::new(),
            due: Due::default(),
            impaired: false,
        }
    }

    /// Whether this drone leads a group.
    #[must_use]
    pub fn is_leader(&self) -> bool {
        self.election.leads()
    }

    /// The term this drone obeys, or leads in; [`Ballot::NONE`] before the first.
    #[must_use]
    pub fn term(&self) -> Ballot {
        self.election.obeyed()
    }

    /// The group that the term is for.
    #[must_use]
    pub fn scope(&self) -> GroupId {
        self.election.scope()
    }

    /// The group this drone is in: the scope of its term, or a part of it.
    #[must_use]
    pub fn group(&self) -> GroupId {
        self.ledger.group()
    }

    /// The stamp of the plan this drone obeys; the default, lower than any, before the first.
    #[must_use]
    pub fn stamp(&self) -> PlanStamp {
        self.ledger.stamp()
    }

    /// The newest stamp this drone has heard of, whether it can obey that plan yet or not.
    #[must_use]
    pub fn newest_stamp(&self) -> PlanStamp {
        self.ledger.newest()
    }

    /// The plan this drone obeys, with the assignments it has heard of.
    #[must_use]
    pub fn obeyed(&self) -> Option<&PlanBundle> {
        self.ledger.obeyed()
    }

    /// This drone's assignment in the plan it obeys.
    #[must_use]
    pub fn part(&self) -> Option<&Assignment> {
        self.ledger.part()
    }

    /// Hash of this drone's assignment: equal stamps must mean equal hashes. 0 before the first plan.
    #[must_use]
    pub fn part_hash(&self) -> u64 {
        self.ledger.part_hash()
    }

    /// The obstacle sets that are being passed, in flight order.
    #[must_use]
    pub fn planned_sets(&self) -> &[PlannedSet] {
        self.ledger.sets()
    }

    /// All that this drone knows of plans.
    #[must_use]
    pub fn ledger(&self) -> &Ledger {
        &self.ledger
    }

    /// The beacons this drone has heard.
    #[must_use]
    pub fn peers(&self) -> &Peers {
        &self.peers
    }

    /// The obstacles this drone knows.
    #[must_use]
    pub fn obstacles(&self) -> &Obstacles {
        &self.obstacles
    }

    /// Notes which planned sets this drone has left behind, being at `position` (world frame, m).
    pub fn note_passed(&mut self, position: Vec2) {
        for set in self.ledger.sets().iter().filter(|set| position.x >= set.routes.exit_x_m()) {
            self.obstacles.note_passed(self.me, &set.ids);
        }
    }

    /// The ledger as if all drones were one group in this drone's [`Self::first_term`], with the queue places that living
    /// peers show in their beacons: what a rollout of the whole swarm starts from.
    #[must_use]
    pub fn united_ledger(&self, now: SimTime) -> Ledger {
        let living = self.peers.living(now);
        let places = living.flat_map(|(id, pose)| pose.queue.into_iter().map(move |place| (id, place)));
        let flown: Vec<(DroneId, QueuePlace)> = places.filter(|(_, place)| place.set != 0).collect();
        self.ledger.united(self.first_term(), &flown)
    }

    /// The term in which this drone would lead all, had nobody led before.
    #[must_use]
    pub fn first_term(&self) -> Ballot {
        Ballot { round: 1, incarnation: self.incarnation, claimant: self.me }
    }

    /// The machine of a drone that knows what this one knows, and of plans this ledger, were all drones one group that
    /// this one leads in its [`Self::first_term`].
    #[must_use]
    pub fn rollout_member(&self, params: &LeadingParams, now: SimTime, ledger: Ledger) -> Self {
        let mut study = Self::new(params);
        study.obstacles = self.obstacles.clone();
        study.peers = self.peers.clone();
        study.peers.forget(params.me);
        study.peers.unite(ledger.stamp());
        study.ledger = ledger;
        let (ballot, scope) = (self.first_term(), GroupId::ALL);
        let leads = Input::Claim(scope);
        let follows = Input::Sign { ballot, scope, named: true };
        study.election.handle(now, 0, if params.me == self.me { leads } else { follows });
        study.join(now);
        study
    }

    /// Hears a message of `source`; what has to be answered at once goes into `say`.
    pub fn hear<'m>(
        &mut self,
        now: SimTime,
        source: DroneId,
        message: impl Into<MessageRef<'m>>,
        say: &mut Vec<Message>,
    ) {
        if source == self.me || source.0 >= self.drones {
            return;
        }
        match message.into() {
            MessageRef::Pose(pose) => self.hear_pose(now, source, pose),
            MessageRef::Obstacle(o) => {
                if self.obstacles.learn(now, o.id, o.shape, o.witness) {
                    self.settle(now);
                }
            }
            MessageRef::Leadership(l) => self.hear_leadership(now, source, l, say),
            MessageRef::Plan(plan) => {
                if self.sign(now, source, plan.id.ballot, plan.group, false) {
                    self.ledger.hear_plan(plan, &self.obstacles);
                    self.join(now);
                }
            }
            MessageRef::Assignment(part) => {
                if self.sign(now, source, part.id.ballot, part.scope, part.drone == self.me) {
                    self.ledger.hear_assignment(part, &self.obstacles);
                    self.join(now);
                }
            }
            MessageRef::Arrivals(row) => self.planner.hear(now, row),
            MessageRef::Passed(passed) => self.obstacles.hear_passed(source, passed),
        }
    }

    fn hear_pose(&mut self, now: SimTime, source: DroneId, pose: &Pose) {
        self.peers.hear(now, source, *pose);
        self.ledger.hear_place(source, pose);
        let ballot = self.election.obeyed();
        if pose.leads() && pose.term == ballot && ballot.claimant == source {
            let scope = self.election.scope();
            self.election.handle(now, 0, Input::Sign { ballot, scope, named: false });
        }
        let made = Some(self.ledger.stamp()).filter(|stamp| stamp.ballot == ballot).map_or(0, |stamp| stamp.epoch);
        self.due.plan_conflict_seen |=
            self.election.leads() && pose.obeyed.ballot == ballot && pose.obeyed.epoch > made;
    }

    /// Claims and heartbeats count from the claimant alone.
    fn hear_leadership(&mut self, now: SimTime, source: DroneId, message: &Leadership, say: &mut Vec<Message>) {
        let relayed = matches!(message.kind(), LeadershipKind::PreVote | LeadershipKind::PreVoteRejection);
        if message.ballot.claimant.0 >= self.drones || (!relayed && message.ballot.claimant != source) {
            return;
        }
        // A few answers are enough.
        if message.kind() == LeadershipKind::PreVote && !self.election.leads() && self.answerers(now, source) >= ANSWERS
        {
            return;
        }
        let answer = self.election.handle(now, self.ledger.stamp().epoch, Input::Heard(*message));
        say.extend(answer.map(Message::Leadership));
    }

    /// Living peers before this drone that answer a probe of `source` as well.
    fn answerers(&self, now: SimTime, source: DroneId) -> usize {
        let before = |&(id, _): &(DroneId, &Pose)| id < self.me && id != source;
        self.peers.living(now).take_while(|(id, _)| *id < self.me).filter(before).take(ANSWERS).count()
    }

    /// Whether it leads and hears others, none of whom follows it. Lasts that, nobody hears this drone.
    #[must_use]
    pub fn is_unfollowed(&self, now: SimTime) -> bool {
        let mut peers = self.peers.living(now).peekable();
        self.election.leads() && peers.peek().is_some() && peers.all(|(_, pose)| pose.term != self.election.obeyed())
    }

    /// Hears something that is said in this term; whether the drone obeys it, and does not lead itself.
    fn sign(&mut self, now: SimTime, source: DroneId, ballot: Ballot, scope: GroupId, named: bool) -> bool {
        if ballot.claimant.0 >= self.drones {
            return false;
        }
        // Repeated by somebody else it is no sign that the leader lives, nor that there is such a term; repeated by one
        // who leads another term by now, it is none that this one goes on.
        let over = ballot == self.election.obeyed() && self.term_of(source) > ballot;
        if ballot.claimant == source && !over {
            self.election.handle(now, 0, Input::Sign { ballot, scope, named });
        }
        ballot == self.election.obeyed() && !self.election.leads()
    }

    /// Senses an obstacle whole; true if it is new.
    pub fn sense(&mut self, now: SimTime, id: ObstacleId, shape: ConvexShape) -> bool {
        let new = self.obstacles.learn(now, id, shape, self.me);
        if new {
            self.talk.hurry();
            self.settle(now);
        }
        new
    }

    /// Whether a sensor of its own is broken: then it leads only while nobody else can.
    pub fn set_impaired(&mut self, impaired: bool) {
        self.impaired = impaired;
    }

    /// Whether a peer's last beacon says that it has all its sensors.
    pub(crate) fn is_healthy(&self, peer: DroneId) -> bool {
        self.peers.last(peer).is_some_and(|pose| !pose.is_impaired())
    }

    fn settle(&mut self, now: SimTime) {
        self.ledger.settle(&self.obstacles);
        self.join(now);
    }

    fn join(&mut self, now: SimTime) {
        let group = self.ledger.group();
        self.election.handle(now, 0, Input::Joined(group));
    }

    /// Elections: heartbeats, probes, claims.
    pub fn elect(&mut self, now: SimTime, own: &Own, say: &mut Vec<Message>) {
        let (closer, delay_s) = (self.closer(now, own), self.peers.delay_s());
        let epoch = self.ledger.stamp().epoch;
        let said = self.election.handle(now, epoch, Input::Tick { closer, delay_s });
        say.extend(said.map(Message::Leadership));
        if let Some(input) = self.calls_for(now, own) {
            say.extend(self.election.handle(now, epoch, input).map(Message::Leadership));
        }
    }

    /// When the machine next wants to be told the time, if nothing is heard until then.
    #[must_use]
    pub fn next_deadline(&self, now: SimTime, own: &Own) -> SimTime {
        self.election.next_deadline(self.closer(now, own), self.peers.delay_s())
    }

    /// Living drones of the scope that are closer to the destination, or sound while this one is not, the suspect not
    /// counted; nobody has to be counted while there is a leader.
    fn closer(&self, now: SimTime, own: &Own) -> usize {
        if !self.election.seeks(now) {
            return 0;
        }
        let mine = (self.impaired, self.key(own.position, self.me));
        let (scope, suspect) = (self.election.scope(), self.election.obeyed());
        let rivals = self
            .living_peers(now)
            .filter(|m| !(suspect.is_some() && m.id == suspect.claimant) && scope.contains(m.group));
        rivals.filter(|m| (!self.is_healthy(m.id), self.key(m.position, m.id)) < mine).count()
    }

    /// Order of claims: by distance to the destination, ties by id.
    pub(crate) fn key(&self, position: Vec2, id: DroneId) -> (f64, DroneId) {
        (self.planner.params.destination.distance_m(position), id)
    }

    /// Which of the alternatives decided on last is to be flown while this leader thinks.
    #[must_use]
    pub fn interim(&self) -> usize {
        self.planner.meanwhile
    }

    /// What a leader decides now: nothing, orders, or alternatives. `silent`: where drones that fell silent may hang, m.
    pub fn decide(&mut self, now: SimTime, silent: &[Vec2], say: &mut Vec<Message>) -> Vec<PlanBundle> {
        let mut rows = Vec::new();
        let situation = Situation {
            now,
            ballot: self.election.obeyed(),
            scope: self.election.scope(),
            members: &self.members,
            others: &self.others,
            delay_s: self.peers.delay_s(),
            silent,
            obstacles: &self.obstacles,
            ledger: &self.ledger,
        };
        let bundle = self.planner.decide(&situation, &mut rows);
        say.extend(rows.into_iter().map(Message::Arrivals));
        bundle
    }

    /// Takes up orders of one's own making, and tells them at once; what they say of other groups, to their leaders.
    pub fn adopt(&mut self, now: SimTime, mut bundle: PlanBundle) {
        let members = &self.members;
        let own = |id: DroneId| members.iter().any(|m| m.id == id);
        self.planner.tell_chosen(now, &mut bundle, own);
        self.obey(now, bundle);
    }

    /// Takes up orders that it obeys, whoever made them.
    pub fn obey(&mut self, now: SimTime, bundle: PlanBundle) {
        self.ledger.adopt(bundle, &self.obstacles);
        self.join(now);
        self.talk.hurry();
    }
}

/// Most members that answer a probe, besides the leader.
const ANSWERS: usize = 4;
