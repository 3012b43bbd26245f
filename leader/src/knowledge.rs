//! What a drone knows of its swarm, and how messages change it: peers, obstacles, plans and terms.

use crate::beacons::Beacon;
use crate::election::{Election, Input};
use crate::ledger::Ledger;
use crate::member::Member;
use crate::obstacles::{Obstacles, set_ids};
use crate::own_state::OwnState;
use crate::params::{Destination, LeadingParams, PlannerParams};
use crate::peers::Peers;
use crate::plan_bundle::PlanBundle;
use crate::tuning::{LEFT_OUT_S, MAX_REJECTIONS, OLD_S};
use skein_protocol::formation::HOLD_SPEED_MPS;
use skein_protocol::payload::{Assignment, Leadership, Passed, Plan, Pose};
use skein_protocol::shape::ConvexShape;
use skein_protocol::{Ballot, DroneId, GroupId, LeadershipKind, ObstacleId, Phase, PlanStamp, SimTime, Vec2};

/// What one drone knows of its swarm. The other parts of `Leading` read it.
#[derive(Clone, Debug)]
pub(crate) struct Knowledge {
    me: DroneId,
    drones: u32,
    incarnation: u32,
    params: PlannerParams,
    impaired: bool,
    /// The greatest abscissa at which this drone has been, m.
    reached_x_m: f64,
    peers: Peers,
    obstacles: Obstacles,
    ledger: Ledger,
    election: Election,
    /// The newest formation of the whole swarm whose drones' passages are noted.
    formed: PlanStamp,
    /// The obstacles that its drones have passed, of those that were planned for.
    ended: Vec<ObstacleId>,
    /// Since when the leader itself has said only plans that are older than the newest one of its term that this drone heard of.
    older_said: Option<SimTime>,
}

impl Knowledge {
    /// A drone that has just started and has heard nothing.
    pub(crate) fn new(params: &LeadingParams) -> Self {
        let reach_m = 2.0 * params.planner.routes.planning_distance_m;
        Self {
            me: params.me,
            drones: params.drones,
            incarnation: params.incarnation,
            params: params.planner.clone(),
            impaired: false,
            reached_x_m: f64::NEG_INFINITY,
            peers: Peers::new(params.drones, params.peer_timeout_s).relayed_less(params.thinning()),
            obstacles: Obstacles::new(params.drones, reach_m)
                .bound_for(params.planner.destination, params.planner.routes),
            ledger: Ledger::new(params.me, params.drones, params.planner.routes),
            election: Election::new(params.me, params.incarnation, params.election, params.start),
            formed: PlanStamp::default(),
            ended: Vec::new(),
            older_said: None,
        }
    }

    /// What the drone of `params` would know, if it knew what this one knows and this ledger, and if all drones were one
    /// group that this drone leads in its [`Self::first_term`].
    pub(crate) fn of_rollout_member(&self, params: &LeadingParams, now: SimTime, ledger: Ledger) -> Self {
        let mut other = Self::new(params);
        // What the other drone has left behind is not known, and makes no difference to which routes are best.
        other.reached_x_m = f64::INFINITY;
        other.obstacles = self.obstacles.clone();
        other.peers = self.peers.clone();
        other.peers.forget(params.me);
        other.peers.unite(ledger.stamp());
        other.ledger = ledger;
        let (ballot, scope) = (self.first_term(), GroupId::ALL);
        let leads = Input::Claim(scope);
        let follows = Input::Sign { ballot, scope: Some(scope), named: true, stamp: Some(now) };
        other.election.handle(now, 0, if params.me == self.me { leads } else { follows });
        other.join(now);
        other
    }

    /// This drone.
    pub(crate) fn me(&self) -> DroneId {
        self.me
    }

    /// Number of this start of its process, from 1.
    pub(crate) fn incarnation(&self) -> u32 {
        self.incarnation
    }

    /// Parameters of planning.
    pub(crate) fn params(&self) -> &PlannerParams {
        &self.params
    }

    /// Whether a sensor of its own is broken.
    pub(crate) fn is_impaired(&self) -> bool {
        self.impaired
    }

    /// Whether it flies in a formation of the whole swarm that names an obstacle as passed, but has never reached the end of that one: its
    /// leader may have taken it for a drone that stays where it is, or may have been told wrongly.
    pub(crate) fn is_before(&self) -> bool {
        let holds = matches!(self.params.destination, Destination::Hold { .. });
        let formation =
            self.ledger.obeyed().map(|bundle| &bundle.plan).filter(|plan| holds && is_formation_of_all(plan));
        let named = formation.into_iter().flat_map(|plan| set_ids(&plan.set, plan.set_count));
        let mut outlines = named.filter_map(|&id| self.obstacles.get(id));
        outlines.any(|known| self.reached_x_m < known.shape.bounds().1.x)
    }

    /// The beacons it has heard.
    pub(crate) fn peers(&self) -> &Peers {
        &self.peers
    }

    /// The obstacles it knows.
    pub(crate) fn obstacles(&self) -> &Obstacles {
        &self.obstacles
    }

    /// What it knows of plans.
    pub(crate) fn ledger(&self) -> &Ledger {
        &self.ledger
    }

    /// Which term it obeys.
    pub(crate) fn election(&self) -> &Election {
        &self.election
    }

    /// The term in which this drone would lead all drones, had no drone led before.
    pub(crate) fn first_term(&self) -> Ballot {
        Ballot { round: 1, incarnation: self.incarnation, claimant: self.me }
    }

    /// Sort key of claims: distance to the destination, then id.
    pub(crate) fn claim_key(&self, position: Vec2, id: DroneId) -> (f64, DroneId) {
        (self.params.destination.distance_m(position), id)
    }

    /// The term that a peer obeys, by its last beacon.
    pub(crate) fn term_of(&self, peer: DroneId) -> Ballot {
        self.peers.last(peer).map_or(Ballot::NONE, |pose| pose.term())
    }

    /// Whether a peer's last beacon says that all its sensors work.
    pub(crate) fn is_healthy(&self, peer: DroneId) -> bool {
        self.peers.last(peer).is_some_and(|pose| !pose.is_impaired())
    }

    /// This drone as a member.
    pub(crate) fn myself(&self, own: &OwnState) -> Member {
        let OwnState { position, velocity, .. } = *own;
        let (speed_mps, group) = (velocity.norm(), self.ledger.group());
        let before = self.is_before();
        Member { id: self.me, position, speed_mps, velocity, group, follows: true, settled: false, before }
    }

    /// Living peers, extrapolated to `now`, by id. A peer's group is the one that the obeyed plan, or the plan that split
    /// this group, puts it in; unless its beacon shows that it is past that plan or will not obey it.
    pub(crate) fn living_peers(&self, now: SimTime) -> impl Iterator<Item = Member> + Clone {
        let plans = [self.ledger.obeyed(), self.ledger.origin()];
        self.peers.living(now).map(move |(id, pose)| {
            let will_obey = |plan: &PlanStamp| pose.obeyed() < *plan && pose.term() <= plan.ballot;
            let pending = plans.into_iter().flatten().filter(|bundle| will_obey(&bundle.plan.id));
            let group = pending.filter_map(|bundle| bundle.parts.get(id)).map(|part| part.group).next();
            let group = group.unwrap_or_else(|| pose.group());
            let velocity = pose.velocity();
            let (position, follows) = (self.expected(now, id, pose), pose.term() == self.election.obeyed());
            let speed_mps = velocity.norm();
            let settled = pose.term() < self.election.obeyed() && self.rests_at_destination(position, speed_mps);
            Member { id, position, speed_mps, velocity, group, follows, settled, before: pose.is_before() }
        })
    }

    /// Where a peer is by now, world frame, m, if it has kept the velocity of its last beacon. It does not fly on past the slot in which it
    /// is to stay.
    fn expected(&self, now: SimTime, id: DroneId, pose: Beacon<'_>) -> Vec2 {
        let flown_s = now.since(pose.stamp());
        let closes = |bundle: &&PlanBundle| bundle.plan.phase() == Phase::Reform && bundle.plan.id == pose.obeyed();
        let Some(bundle) = self.ledger.obeyed().filter(|_| flown_s > OLD_S).filter(closes) else {
            return pose.extrapolated(now);
        };
        let (anchor, anchor_mps) = bundle.plan.anchor_at(now);
        let Some(part) = bundle.parts.get(id).filter(|_| anchor_mps == Vec2::zeros()) else {
            return pose.extrapolated(now);
        };
        let (way, velocity) = (anchor + Vec2::from(part.slot_m) - pose.position(), pose.velocity());
        let abreast_s = way.dot(&velocity) / velocity.norm_squared().max(f64::MIN_POSITIVE);
        pose.position() + velocity * abreast_s.clamp(0.0, flown_s)
    }

    /// Whether a drone with this position (world frame, m) and speed is where it stays if it hears no other drone.
    fn rests_at_destination(&self, position: Vec2, speed_mps: f64) -> bool {
        let (destination, error_m) = (self.params.destination, self.params.arrival_error_m);
        let there = match destination {
            Destination::Hold { stop_x_m } => position.x >= stop_x_m - error_m,
            Destination::Goal { front_m } => (position - front_m).norm() <= error_m,
        };
        there && speed_mps < self.params.routes.scale.speed(HOLD_SPEED_MPS)
    }

    /// Number of living drones of the scope that claim before this one: those closer to the destination, and healthy ones
    /// while this one is impaired. The missing leader is not counted. 0 while there is a leader. They are counted only until it is certain
    /// that this drone's turn has not come yet: a large swarm does not fit into a cache.
    pub(crate) fn closer(&self, now: SimTime, own: &OwnState) -> usize {
        let is_early = |closer: usize| now < self.election.next_deadline(closer, self.peers.delay_s());
        if !self.election.seeks(now) || is_early(0) {
            return 0;
        }
        let mine = (self.impaired, self.claim_key(own.position, self.me));
        let (scope, missing) = (self.election.scope(), self.election.obeyed());
        let rivals = self
            .living_peers(now)
            .filter(|m| !(missing.is_some() && m.id == missing.claimant) && scope.contains(m.group));
        let mut closer = 0;
        for _ in rivals.filter(|m| (!self.is_healthy(m.id), self.claim_key(m.position, m.id)) < mine) {
            closer += 1;
            if is_early(closer) {
                break;
            }
        }
        closer
    }

    /// Whether it leads and hears others, none of which follows it. If this persists, no other drone can hear this one.
    pub(crate) fn is_unfollowed(&self, now: SimTime) -> bool {
        let mut peers = self.peers.living(now).peekable();
        self.election.leads() && peers.peek().is_some() && peers.all(|(_, pose)| pose.term() != self.election.obeyed())
    }

    /// Whether a beacon comes from a drone that may have missed what others said: from a new process, or after a silence.
    pub(crate) fn is_back(&self, now: SimTime, source: DroneId, pose: &Pose) -> bool {
        self.peers.last_of_living(source, now).is_none_or(|last| last.incarnation() != pose.incarnation)
    }

    /// Hears a beacon. Returns whether it shows a plan of this leader's term that this leader never made.
    pub(crate) fn hear_pose(&mut self, now: SimTime, source: DroneId, pose: &Pose) -> bool {
        self.peers.hear(now, source, pose);
        self.ledger.hear_place(source, pose);
        let (ballot, scope) = (self.election.obeyed(), self.election.scope());
        if pose.leads() && pose.term == ballot && ballot.claimant == source && scope.contains(pose.group) {
            self.election.handle(now, 0, Input::Sign { ballot, scope: None, named: false, stamp: Some(pose.stamp) });
        }
        self.is_plan_conflict(source, pose)
    }

    /// Hears a beacon of `drone` that another drone passed on. Returns the same as [`Self::hear_pose`].
    pub(crate) fn hear_of(&mut self, now: SimTime, drone: DroneId, pose: &Pose) -> bool {
        self.peers.hear_of(now, drone, pose);
        self.is_plan_conflict(drone, pose)
    }

    /// Whether a beacon of `drone` shows a plan of this leader's term that this leader never made: one that came later, or the same one with
    /// the drone in another group.
    fn is_plan_conflict(&self, drone: DroneId, pose: &Pose) -> bool {
        let (ballot, stamp, obeyed) = (self.election.obeyed(), self.ledger.stamp(), pose.obeyed);
        if !self.election.leads() || obeyed.ballot != ballot {
            return false;
        }
        let made = if stamp.ballot == ballot { stamp.epoch } else { 0 };
        let part = self.ledger.obeyed().filter(|_| obeyed == stamp).and_then(|bundle| bundle.parts.get(drone));
        obeyed.epoch > made || part.is_some_and(|part| part.group != pose.group)
    }

    /// Learns of an obstacle. Returns whether it is new.
    pub(crate) fn learn(&mut self, now: SimTime, id: ObstacleId, shape: ConvexShape, witness: DroneId) -> bool {
        let new = self.obstacles.learn(now, id, shape, witness);
        if new {
            self.ledger.settle(&self.obstacles);
            self.ledger.redraw(id, &self.obstacles);
            self.join(now);
        }
        new
    }

    /// Hears a message about leadership that [`crate::relays::Relays`] admitted; returns the answer.
    pub(crate) fn hear_leadership(
        &mut self,
        now: SimTime,
        source: DroneId,
        message: &Leadership,
    ) -> Option<Leadership> {
        if message.ballot.claimant.0 >= self.drones {
            return None;
        }
        let others_reject = || !self.election.leads() && self.lower_living_peers(now, source) >= MAX_REJECTIONS;
        if message.kind() == LeadershipKind::PreVote && others_reject() {
            return None;
        }
        self.elect(now, Input::Heard(*message))
    }

    /// Number of living peers with a lower id than this drone, up to [`MAX_REJECTIONS`]: they also answer a pre-vote of
    /// `source`.
    fn lower_living_peers(&self, now: SimTime, source: DroneId) -> usize {
        let lower = self.peers.living(now).take_while(|(id, _)| *id < self.me);
        lower.filter(|&(id, _)| id != source).take(MAX_REJECTIONS).count()
    }

    /// Hears a plan.
    pub(crate) fn hear_plan(&mut self, now: SimTime, source: DroneId, plan: &Plan) {
        let (ballot, scope) = (plan.id.ballot, plan.group);
        if self.obeys(now, Term { ballot, scope, named: false, goes_on: ballot.claimant == source }, source) {
            if ballot.claimant == source {
                self.hear_leaders_plan(now, plan.id);
            }
            self.ledger.hear_plan(plan, &self.obstacles);
            self.join(now);
        }
    }

    /// Notes which plan the leader itself says. It repeats its newest one. If it says only older ones than this drone heard of, for as long as
    /// no delay explains, the newer one was invented, and this drone forgets it.
    fn hear_leaders_plan(&mut self, now: SimTime, said: PlanStamp) {
        let newest = self.ledger.newest();
        let is_older = said < newest && said.ballot == newest.ballot && newest > self.ledger.stamp();
        self.older_said = is_older.then(|| self.older_said.unwrap_or(now));
        let patience_s = LEFT_OUT_S + 2.0 * self.peers.delay_s();
        if self.older_said.take_if(|since| now.since(*since) >= patience_s).is_some() {
            self.ledger.withdraw(said);
        }
    }

    /// Hears a drone's assignment. `goes_on`: whether the term's leader was heard of just now.
    pub(crate) fn hear_assignment(&mut self, now: SimTime, source: DroneId, part: &Assignment, goes_on: bool) {
        let (ballot, scope, named) = (part.id.ballot, part.scope, part.drone == self.me);
        let goes_on = ballot.claimant == source || (named && goes_on);
        if self.obeys(now, Term { ballot, scope, named, goes_on }, source) {
            self.ledger.hear_assignment(part, &self.obstacles);
            self.join(now);
            if part.id == self.formed {
                self.note_joined(now, part.drone);
            }
        } else {
            self.ledger.complete(part);
        }
    }

    /// Takes note of the term that a message of `source` belongs to. Returns whether this drone obeys it and does not
    /// lead it.
    fn obeys(&mut self, now: SimTime, term: Term, source: DroneId) -> bool {
        let Term { ballot, scope, named, goes_on } = term;
        if ballot.claimant.0 >= self.drones {
            return false;
        }
        // A repetition by another drone does not show that the leader lives, nor that there is such a term. A repetition
        // by a drone that leads another term by now does not show that this term goes on.
        let over = ballot == self.election.obeyed() && self.term_of(source) > ballot;
        if goes_on && !over {
            self.election.handle(now, 0, Input::Sign { ballot, scope: Some(scope), named, stamp: None });
        }
        ballot == self.election.obeyed() && !self.election.leads()
    }

    /// Hears which obstacles a drone has passed.
    pub(crate) fn hear_passed(&mut self, source: DroneId, passed: &Passed) {
        self.obstacles.hear_passed(passed.drone(source), passed);
    }

    /// Notes which planned sets this drone has passed, being at `position`.
    pub(crate) fn note_passed(&mut self, position: Vec2) {
        self.reached_x_m = self.reached_x_m.max(position.x);
        for set in self.ledger.sets().iter().filter(|set| position.x >= set.routes.exit_x_m()) {
            self.obstacles.note_passed(self.me, &set.ids);
        }
        if self.ledger.obeyed().is_some_and(|bundle| is_formation_of_all(&bundle.plan)) {
            self.note_beyond(&[(self.me, position.x)]);
        }
    }

    /// Notes for each of these drones, at these abscissas (m), the obstacle sets that it is beyond, planned for or not.
    fn note_beyond(&mut self, drones: &[(DroneId, f64)]) {
        let beyond_m = self.params.routes.planning_distance_m;
        let known = &self.obstacles;
        let noted = |drone: DroneId, set: &[ObstacleId]| set.iter().all(|&id| known.has_passed(drone, id));
        let mut new = Vec::new();
        for set in known.sets() {
            let exit_x_m = known.exit_x_m(set, beyond_m);
            let beyond = drones.iter().filter(|(drone, x_m)| *x_m >= exit_x_m && !noted(*drone, set));
            new.extend(beyond.map(|&(drone, _)| (drone, set.clone())));
        }
        for (drone, set) in new {
            self.obstacles.note_passed(drone, &set);
        }
    }

    /// Notes what the drones of a new formation of the whole swarm are beyond. A slot may lie before the exit of a set that all have
    /// passed; a drone that flies back to it does not have to pass the set again.
    /// `ended`: the obstacles of the sets that it has ended. The assignments of some drones may not be heard yet.
    fn note_formed(&mut self, now: SimTime, ended: Vec<ObstacleId>) {
        let formation = self.ledger.obeyed().filter(|bundle| is_formation_of_all(&bundle.plan));
        let Some(bundle) = formation.filter(|bundle| bundle.plan.id != self.formed) else { return };
        let of_all = bundle.plan.members >= self.drones;
        let belongs = |drone: DroneId| of_all || bundle.parts.contains(drone);
        let members = self.living_peers(now).filter(|m| belongs(m.id));
        let members: Vec<(DroneId, f64)> = members.map(|m| (m.id, m.position.x)).collect();
        for drone in (0..self.drones).map(DroneId).filter(|&drone| belongs(drone)) {
            self.obstacles.note_passed(drone, &ended);
        }
        (self.formed, self.ended) = (bundle.plan.id, ended);
        self.note_beyond(&members);
    }

    /// Notes what a drone is beyond whose assignment in the new formation was just heard.
    fn note_joined(&mut self, now: SimTime, drone: DroneId) {
        self.obstacles.note_passed(drone, &self.ended);
        if let Some(pose) = self.peers.last_of_living(drone, now) {
            self.note_beyond(&[(drone, self.expected(now, drone, pose).x)]);
        }
    }

    /// Notes which planned sets these members have passed.
    pub(crate) fn note_members_passed(&mut self, members: &[Member]) {
        for set in self.ledger.sets() {
            for member in members.iter().filter(|member| member.position.x >= set.routes.exit_x_m()) {
                self.obstacles.note_passed(member.id, &set.ids);
            }
        }
    }

    /// Sets whether a sensor of its own is broken.
    pub(crate) fn set_impaired(&mut self, impaired: bool) {
        self.impaired = impaired;
    }

    /// Gives the election an input; returns what is to be said.
    pub(crate) fn elect(&mut self, now: SimTime, input: Input) -> Option<Leadership> {
        let epoch = self.ledger.stamp().epoch;
        self.election.handle(now, epoch, input)
    }

    /// Adopts a plan, whichever leader made it.
    pub(crate) fn adopt(&mut self, now: SimTime, bundle: PlanBundle) {
        self.ledger.adopt(bundle, &self.obstacles);
        self.join(now);
    }

    /// Tells the election which group this drone is in, and notes what the drones of a new formation have passed. Drones that its
    /// leader did not hear may still be before the obstacles.
    fn join(&mut self, now: SimTime) {
        let ended = self.ledger.take_ended();
        self.note_formed(now, ended);
        let group = self.ledger.group();
        self.election.handle(now, 0, Input::Joined(group));
    }
}

/// Whether a plan closes one formation of the whole swarm.
pub(crate) fn is_formation_of_all(plan: &Plan) -> bool {
    plan.phase() == Phase::Reform && plan.group == GroupId::ALL
}

/// The term that a message belongs to.
#[derive(Clone, Copy)]
struct Term {
    ballot: Ballot,
    /// The group that the term is for.
    scope: GroupId,
    /// Whether the message names this drone.
    named: bool,
    /// Whether the message shows that the term's leader lives.
    goes_on: bool,
}
