//! The part of a drone that leads and follows, a sans-IO machine: who is there, who leads, what is planned, what is to
//! be said. It knows what it is told, and time only as an argument.
//!
//! Terms are for groups. The leader of the whole swarm plans the first split; then each part is led by a member of its
//! own, who plans what lies ahead of that part, jointly with the leaders of the other parts. Once all are past
//! everything, the foremost leader claims the whole swarm again, and the formation closes.

use crate::election::{Election, ElectionParams, Input};
use crate::ledger::{Ledger, Orders};
use crate::membership::{Peers, extrapolated};
use crate::obstacles::Obstacles;
use crate::planner::{Member, Planner, PlannerParams, Situation};
use crate::talk::Talk;
use skein_protocol::payload::{LEADERSHIP_OBJECTION, LEADERSHIP_PROBE, Leadership, POSE_LEADS, Pose};
use skein_protocol::shape::ConvexShape;
use skein_protocol::{Ballot, DroneId, GroupId, Message, ObstacleId, PlanStamp, SimTime, Vec2};

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
    wait_s: f64,
    /// Who is there.
    pub peers: Peers,
    /// What is in the way.
    pub obstacles: Obstacles,
    /// What is planned.
    pub ledger: Ledger,
    /// Who leads.
    pub election: Election,
    /// How groupings are chosen, should it lead.
    pub planner: Planner,
    pub(crate) talk: Talk,
    members: Vec<Member>,
    others: Vec<Member>,
    /// Since when its part of a split group has a task and no leader of its own.
    part_due: Option<SimTime>,
    /// Since when the parts could be one again.
    whole_due: Option<SimTime>,
    /// Somebody obeys what it never said: a new term puts an end to that.
    belied: bool,
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
            part_due: None,
            whole_due: None,
            belied: false,
        }
    }

    /// The machine that another member would have, had it heard what this leader has heard, and these orders.
    #[must_use]
    pub fn of_member(&self, params: &LeadingParams, now: SimTime, orders: &Orders) -> Self {
        let mut study = Self::new(params);
        study.obstacles = self.obstacles.clone();
        study.peers = self.peers.clone();
        study.peers.forget(params.me);
        study.ledger = self.ledger.of_member(params.me);
        study.ledger.adopt(orders.clone(), &study.obstacles);
        if params.me == self.me {
            study.election = self.election.clone();
        } else {
            let (ballot, scope) = (self.election.obeyed(), self.election.scope());
            study.election.handle(now, 0, Input::Sign { ballot, scope, named: true });
        }
        study.join(now);
        study
    }

    /// Hears a message of `source`; what has to be answered at once goes into `say`.
    pub fn hear(&mut self, now: SimTime, source: DroneId, message: &Message, say: &mut Vec<Message>) {
        if source == self.me || source.0 >= self.drones {
            return;
        }
        match message {
            Message::Pose(pose) => self.hear_pose(now, source, pose),
            Message::Obstacle(o) => {
                if self.obstacles.learn(now, o.id, o.shape, o.witness) {
                    self.settle();
                }
            }
            Message::Leadership(l) => self.hear_leadership(now, source, l, say),
            Message::Plan(plan) => {
                if self.sign(now, source, plan.id.ballot, plan.group, false) {
                    self.ledger.hear_plan(plan, &self.obstacles);
                    self.join(now);
                }
            }
            Message::Assignment(part) => {
                if self.sign(now, source, part.id.ballot, part.scope, part.drone == self.me) {
                    self.ledger.hear_assignment(part, &self.obstacles);
                    self.join(now);
                }
            }
            Message::Arrivals(row) => self.planner.hear(now, row),
            Message::Passed(passed) => self.obstacles.hear_passed(source, passed),
        }
    }

    fn hear_pose(&mut self, now: SimTime, source: DroneId, pose: &Pose) {
        self.peers.hear(now, source, *pose);
        let ballot = self.election.obeyed();
        if pose.flags & POSE_LEADS != 0 && pose.term == ballot && ballot.claimant == source {
            let scope = self.election.scope();
            self.election.handle(now, 0, Input::Sign { ballot, scope, named: false });
        }
        let made = Some(self.ledger.stamp()).filter(|stamp| stamp.ballot == ballot).map_or(0, |stamp| stamp.epoch);
        self.belied |= self.election.leads() && pose.obeyed.ballot == ballot && pose.obeyed.epoch > made;
    }

    /// Claims and heartbeats count from the claimant alone.
    fn hear_leadership(&mut self, now: SimTime, source: DroneId, message: &Leadership, say: &mut Vec<Message>) {
        let relayed = [LEADERSHIP_PROBE, LEADERSHIP_OBJECTION].contains(&message.kind);
        if message.ballot.claimant.0 >= self.drones || (!relayed && message.ballot.claimant != source) {
            return;
        }
        // A few answers are enough.
        if message.kind == LEADERSHIP_PROBE && !self.election.leads() && self.answerers(now, source) >= ANSWERS {
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

    /// Hears something that is said in this term; whether the drone obeys it, and does not lead itself.
    fn sign(&mut self, now: SimTime, source: DroneId, ballot: Ballot, scope: GroupId, named: bool) -> bool {
        if ballot.claimant.0 >= self.drones {
            return false;
        }
        // Repeated by somebody else it is no sign that the leader lives, nor that there is such a term.
        if ballot.claimant == source {
            self.election.handle(now, 0, Input::Sign { ballot, scope, named });
        }
        ballot == self.election.obeyed() && !self.election.leads()
    }

    /// Senses an obstacle whole; true if it is new.
    pub fn sense(&mut self, now: SimTime, id: ObstacleId, shape: ConvexShape) -> bool {
        let new = self.obstacles.learn(now, id, shape, self.me);
        if new {
            self.talk.hurry();
            self.settle();
        }
        new
    }

    fn settle(&mut self) {
        self.ledger.settle(&self.obstacles);
        let group = self.ledger.group();
        self.election.handle(SimTime::ZERO, 0, Input::Joined(group));
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
        if let Some(scope) = self.claimable(now, own) {
            let said = self.election.handle(now, epoch, Input::Claim(scope));
            say.extend(said.map(Message::Leadership));
        }
    }

    /// When the machine next wants to be told the time, if nothing is heard until then.
    #[must_use]
    pub fn next_deadline(&self, now: SimTime, own: &Own) -> SimTime {
        self.election.next_deadline(self.closer(now, own), self.peers.delay_s())
    }

    /// Living drones of the scope that are closer to the destination, the suspect not counted; nobody has to be counted
    /// while there is a leader.
    fn closer(&self, now: SimTime, own: &Own) -> usize {
        if self.election.has_leader(now) {
            return 0;
        }
        let mine = self.key(own.position, self.me);
        let (scope, suspect) = (self.election.scope(), self.election.obeyed());
        let rivals =
            self.living(now).filter(|m| !(suspect.is_some() && m.id == suspect.claimant) && scope.contains(m.group));
        rivals.filter(|m| self.key(m.position, m.id) < mine).count()
    }

    /// Order of claims: by distance to the destination, ties by id.
    fn key(&self, position: Vec2, id: DroneId) -> (f64, DroneId) {
        (self.planner.params.destination.distance_m(position), id)
    }

    /// The group that this drone is to lead by now although another leader may be well: its part of a split group, with
    /// an obstacle ahead; or the whole swarm, when it leads a part and nobody has an obstacle ahead any more.
    fn claimable(&mut self, now: SimTime, own: &Own) -> Option<GroupId> {
        let (scope, group) = (self.election.scope(), self.election.group());
        if std::mem::take(&mut self.belied) && self.election.leads() {
            return Some(scope);
        }
        let me = self.myself(own);
        let part = scope != group && scope.contains(group) && self.part_has_ahead(now, &me);
        let whole = scope != GroupId::ALL && self.election.leads() && !self.all_have_ahead(now, &me);
        let rank = match (part, whole) {
            (true, _) => self.rank_in_part(now, &me),
            (false, true) => self.rank_of_leaders(now, &me),
            (false, false) => 0,
        };
        let due = |since: &mut Option<SimTime>, condition: bool| {
            *since = condition.then(|| since.unwrap_or(now));
            since.is_some_and(|since| now.since(since) >= self.wait_s * rank as f64)
        };
        let (mut part_due, mut whole_due) = (self.part_due, self.whole_due);
        let (claim_part, claim_whole) = (due(&mut part_due, part), due(&mut whole_due, whole && !part));
        (self.part_due, self.whole_due) = (part_due, whole_due);
        if claim_part { Some(group) } else { claim_whole.then_some(GroupId::ALL) }
    }

    fn myself(&self, own: &Own) -> Member {
        let Own { position, velocity, .. } = *own;
        Member { id: self.me, position, speed_mps: velocity.norm(), velocity, group: self.ledger.group() }
    }

    /// Living peers by now. The group is the one the plan puts a peer in, or the plan before that split the group, unless
    /// its beacon shows that it is on already or will not obey it.
    fn living(&self, now: SimTime) -> impl Iterator<Item = Member> {
        let plans = [self.ledger.obeyed(), self.ledger.origin()];
        self.peers.living(now).map(move |(id, pose)| {
            let will_obey = |plan: &PlanStamp| pose.obeyed < *plan && pose.term <= plan.ballot;
            let untold = plans.into_iter().flatten().filter(|orders| will_obey(&orders.plan.id));
            let group = untold.filter_map(|orders| orders.parts.get(&id)).map(|part| part.group).next();
            let group = group.unwrap_or(pose.group);
            let velocity = Vec2::from(pose.velocity_mps);
            Member { id, position: extrapolated(pose, now), speed_mps: velocity.norm(), velocity, group }
        })
    }

    /// Living peers in this drone's part.
    fn kin(&self, now: SimTime, me: &Member) -> impl Iterator<Item = Member> {
        let group = me.group;
        self.living(now).filter(move |m| group.contains(m.group))
    }

    /// Whether this drone has an obstacle ahead, or is to lead a part of which somebody has.
    fn part_has_ahead(&self, now: SimTime, me: &Member) -> bool {
        let named = self.ledger.part().is_some_and(|part| part.leader == self.me);
        let kin: Vec<Member> = self.kin(now, me).filter(|_| named).collect();
        self.planner.has_ahead(&self.obstacles, kin.iter().chain([me]))
    }

    fn all_have_ahead(&self, now: SimTime, me: &Member) -> bool {
        let all: Vec<Member> = self.living(now).collect();
        self.planner.has_ahead(&self.obstacles, all.iter().chain([me]))
    }

    /// Members of this drone's part that should lead it rather: the one the plan names, and those closer to the
    /// destination.
    fn rank_in_part(&self, now: SimTime, me: &Member) -> usize {
        let named = self.ledger.part().map_or(DroneId::NONE, |part| part.leader);
        let mine = (me.id != named, self.key(me.position, me.id));
        self.kin(now, me).filter(|m| (m.id != named, self.key(m.position, m.id)) < mine).count()
    }

    /// Leaders closer to the destination.
    fn rank_of_leaders(&self, now: SimTime, me: &Member) -> usize {
        let mine = self.key(me.position, me.id);
        let leaders = self.peers.living(now).filter(|(_, pose)| pose.flags & POSE_LEADS != 0);
        leaders.filter(|(id, pose)| self.key(extrapolated(pose, now), *id) < mine).count()
    }

    /// Takes stock of who is there, before a leader decides. A drone of no part joins the one of the nearest drone.
    pub fn muster(&mut self, now: SimTime, own: &Own) {
        let scope = self.election.scope();
        let (mut members, mut others, mut orphans) = (vec![self.myself(own)], Vec::new(), Vec::new());
        for peer in self.living(now) {
            if scope.contains(peer.group) {
                members.push(peer);
            } else if peer.group.contains(scope) && self.term_of(peer.id) < self.election.obeyed() {
                orphans.push(peer);
            } else {
                others.push(peer);
            }
        }
        // Whoever is of another lineage, or obeys an older term, does not take it in.
        orphans.retain(|orphan| {
            let later = |m: &Member| self.term_of(m.id) > self.term_of(orphan.id);
            let kin = others.iter().filter(|m| orphan.group.contains(m.group) && later(m));
            nearest_m2(orphan, members.iter()) <= nearest_m2(orphan, kin)
        });
        members.append(&mut orphans);
        (self.members, self.others) = (members, others);
        self.members.sort_by_key(|member| member.id);
        for set in self.ledger.sets() {
            let past = self.members.iter().filter(|member| member.position.x >= set.routes.exit_x_m());
            past.for_each(|member| self.obstacles.note_passed(member.id, &set.ids));
        }
    }

    /// The term that a peer obeys, by its last beacon.
    fn term_of(&self, peer: DroneId) -> Ballot {
        self.peers.last(peer).map_or(Ballot::NONE, |pose| pose.term)
    }

    /// The living members, by id, as of the last [`Self::muster`].
    #[must_use]
    pub fn members(&self) -> &[Member] {
        &self.members
    }

    /// What a leader decides now: nothing, orders, or alternatives. `silent`: where drones that fell silent may hang, m.
    pub fn decide(&mut self, now: SimTime, silent: &[Vec2], say: &mut Vec<Message>) -> Vec<Orders> {
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
        let orders = self.planner.decide(&situation, &mut rows);
        say.extend(rows.into_iter().map(Message::Arrivals));
        orders
    }

    /// Takes up orders of one's own making, and tells them at once.
    pub fn adopt(&mut self, now: SimTime, orders: Orders) {
        self.ledger.adopt(orders, &self.obstacles);
        self.join(now);
        self.talk.hurry();
    }
}

/// Most members that answer a probe, besides the leader.
const ANSWERS: usize = 4;

/// Square of the distance to the nearest of these, m².
fn nearest_m2<'m>(from: &Member, to: impl Iterator<Item = &'m Member>) -> f64 {
    to.map(|m| (m.position - from.position).norm_squared()).fold(f64::INFINITY, f64::min)
}
