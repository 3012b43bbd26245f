//! Who is in which part of the swarm, and when a drone takes up leading, or gives it up, although the leader is well.

use crate::election::Input;
use crate::leading::{Leading, Own};
use crate::member::Member;
use crate::membership::extrapolated;
use skein_protocol::{Ballot, DroneId, GroupId, PlanStamp, SimTime, Vec2};

/// A leader that has been behind for so long asks another one to take over, s.
const BEHIND_S: f64 = 3.0;

/// A drone that has had no part in its leader's plan for so long takes it that the leader does not hear it, s.
const LEFT_OUT_S: f64 = 4.0;

/// What a drone waits for.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Due {
    /// Since when its part of a split group has a task and no leader of its own.
    part: Option<SimTime>,
    /// Since when the parts could be one again.
    whole: Option<SimTime>,
    /// From when on this leader asks another one to take over, and whether because a sensor is broken.
    heir: Option<(bool, SimTime)>,
    /// Since when its leader plans without it.
    left_out: Option<SimTime>,
    /// Somebody obeys what this leader never said: a new term puts an end to that.
    pub plan_conflict_seen: bool,
}

impl Leading {
    /// What else there is to do about leading by now.
    pub(crate) fn calls_for(&mut self, now: SimTime, own: &Own) -> Option<Input> {
        if std::mem::take(&mut self.due.plan_conflict_seen) && self.election.leads() {
            return Some(Input::Claim(self.election.scope()));
        }
        let claim = self.claimable(now, own).or_else(|| self.scope_without_leader(now, own)).map(Input::Claim);
        claim.or_else(|| self.heir(now, own).map(Input::Yield))
    }

    /// The scope that this drone is to lead because its leader, well as it is, plans without it for too long: either that
    /// one hears nobody, and the others wait as well, those closer to the destination first; or nobody hears this drone,
    /// and what it claims does not matter.
    fn scope_without_leader(&mut self, now: SimTime, own: &Own) -> Option<GroupId> {
        if self.election.leads() || !self.ledger.is_left_out() {
            self.due.left_out = None;
            return None;
        }
        let waited_s = now.since(*self.due.left_out.get_or_insert(now)) - LEFT_OUT_S;
        if waited_s < 0.0 {
            return None;
        }
        let (scope, leader) = (self.election.scope(), self.election.obeyed().claimant);
        let mine = self.key(own.position, self.me);
        let rivals = self.living_peers(now).filter(|m| m.id != leader && scope.contains(m.group));
        let rank = rivals.filter(|m| self.key(m.position, m.id) < mine).count();
        (waited_s >= self.wait_s * rank as f64).then_some(scope)
    }

    /// Who is to take over from this leader: at once if a sensor of its own is broken and a member has all of them; or
    /// if it fell behind in formation: it has been the last of several for a while, and so far behind its own slot and
    /// the first one that it lost touch. Asked again until somebody does.
    fn heir(&mut self, now: SimTime, own: &Own) -> Option<DroneId> {
        if !self.election.leads() {
            self.due.heir = None;
            return None;
        }
        let sound = if self.impaired { self.first_sound(now) } else { None };
        let broken = sound.is_some();
        let heir = sound.or_else(|| self.first_if_behind(now, own));
        let begin = now.after(if broken { 0.0 } else { BEHIND_S });
        let from = heir.map(|_| self.due.heir.filter(|(why, _)| *why == broken).map_or(begin, |(_, from)| from));
        let due = from.is_some_and(|from| now >= from);
        self.due.heir = from.map(|from| (broken, if due { now.after(self.wait_s) } else { from }));
        heir.filter(|_| due)
    }

    /// The follower with all its sensors that is closest to the destination.
    fn first_sound(&self, now: SimTime) -> Option<DroneId> {
        let scope = self.election.scope();
        let follows = |m: &Member| scope.contains(m.group) && self.term_of(m.id) == self.election.obeyed();
        let sound = self.living_peers(now).filter(|m| follows(m) && self.is_healthy(m.id));
        sound
            .map(|m| self.key(m.position, m.id))
            .min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)))
            .map(|(_, id)| id)
    }

    fn first_if_behind(&self, now: SimTime, own: &Own) -> Option<DroneId> {
        let (bundle, part) = (self.ledger.obeyed()?, self.ledger.part()?);
        let (anchor, moves) = (Vec2::from(bundle.plan.anchor_m), Vec2::from(bundle.plan.anchor_mps));
        let moved = anchor + moves * now.since(bundle.plan.stamp);
        let anchor = Vec2::new(moved.x.min(bundle.plan.anchor_stop_x_m.max(anchor.x)), moved.y);
        let distance_m = |position| self.planner.params.destination.distance_m(position);
        let (mine_m, spacing_m) = (distance_m(own.position), self.planner.params.spacing_m);
        let slot_m = distance_m(anchor + Vec2::from(part.slot_m));
        let scope = self.election.scope();
        let members = self.living_peers(now).filter(|m| scope.contains(m.group));
        if !self.ledger.sets().is_empty()
            || mine_m - slot_m <= spacing_m
            || !members.clone().all(|m| distance_m(m.position) < mine_m)
        {
            return None;
        }
        let follower = |m: &Member| self.term_of(m.id) == self.election.obeyed();
        let nearer =
            |a: &Member, b: &Member| distance_m(a.position).total_cmp(&distance_m(b.position)).then(a.id.cmp(&b.id));
        let first = members.filter(follower).min_by(nearer)?;
        (mine_m - distance_m(first.position) > spacing_m).then_some(first.id)
    }

    /// The group that this drone is to lead by now although another leader may be well: its part of a split group, with
    /// an obstacle ahead; or the whole swarm, when it leads a part and nobody has an obstacle ahead any more.
    fn claimable(&mut self, now: SimTime, own: &Own) -> Option<GroupId> {
        let (scope, group) = (self.election.scope(), self.election.group());
        let me = self.myself(own);
        let part = scope != group && scope.contains(group) && self.part_has_ahead(now, &me);
        let whole = scope != GroupId::ALL && self.election.leads() && !self.all_have_ahead(now, &me);
        let rank = match (part, whole) {
            (true, _) => self.rank_in_part(now, &me),
            (false, true) => self.rank_of_leaders(now, &me),
            (false, false) => 0,
        };
        // Plans and claims of those before it have to be heard.
        let step_s = self.wait_s.max(2.0 * self.peers.delay_s());
        let due = |since: &mut Option<SimTime>, condition: bool| {
            *since = condition.then(|| since.unwrap_or(now));
            since.is_some_and(|since| now.since(since) >= step_s * rank as f64)
        };
        let mut since = self.due;
        let (claim_part, claim_whole) = (due(&mut since.part, part), due(&mut since.whole, whole && !part));
        self.due = since;
        if claim_part { Some(group) } else { claim_whole.then_some(GroupId::ALL) }
    }

    fn myself(&self, own: &Own) -> Member {
        let Own { position, velocity, .. } = *own;
        let (speed_mps, group) = (velocity.norm(), self.ledger.group());
        Member { id: self.me, position, speed_mps, velocity, group, follows: true }
    }

    /// Living peers by now. The group is the one the plan puts a peer in, or the plan before that split the group, unless
    /// its beacon shows that it is on already or will not obey it.
    pub(crate) fn living_peers(&self, now: SimTime) -> impl Iterator<Item = Member> + Clone {
        let plans = [self.ledger.obeyed(), self.ledger.origin()];
        self.peers.living(now).map(move |(id, pose)| {
            let hears = |ballot| pose.term == ballot || (pose.term < ballot && ballot == self.election.obeyed());
            let will_obey = |plan: &PlanStamp| pose.obeyed < *plan && hears(plan.ballot);
            let untold = plans.into_iter().flatten().filter(|bundle| will_obey(&bundle.plan.id));
            let group = untold.filter_map(|bundle| bundle.parts.get(id)).map(|part| part.group).next();
            let group = group.unwrap_or(pose.group);
            let velocity = Vec2::from(pose.velocity_mps);
            let (position, follows) = (extrapolated(pose, now), pose.term == self.election.obeyed());
            Member { id, position, speed_mps: velocity.norm(), velocity, group, follows }
        })
    }

    /// Living peers in this drone's part.
    fn kin(&self, now: SimTime, me: &Member) -> impl Iterator<Item = Member> + Clone {
        let group = me.group;
        self.living_peers(now).filter(move |m| group.contains(m.group))
    }

    /// Whether this drone has an obstacle ahead, or is to lead a part of which somebody has.
    fn part_has_ahead(&self, now: SimTime, me: &Member) -> bool {
        let named = self.ledger.part().is_some_and(|part| part.leader == self.me);
        let kin = self.kin(now, me).filter(|_| named);
        self.planner.has_ahead(&self.obstacles, kin.chain([*me]))
    }

    fn all_have_ahead(&self, now: SimTime, me: &Member) -> bool {
        self.planner.has_ahead(&self.obstacles, self.living_peers(now).chain([*me]))
    }

    /// Members of this drone's part that should lead it rather: the one the plan names, even if its own part in it was
    /// not heard, and those closer to the destination.
    fn rank_in_part(&self, now: SimTime, me: &Member) -> usize {
        let named = self.ledger.part().map_or(DroneId::NONE, |part| part.leader);
        let mine = (me.id != named, self.key(me.position, me.id));
        let unheard = |id: DroneId| self.ledger.obeyed().is_some_and(|bundle| !bundle.parts.contains(id));
        let before = |m: &Member| (m.id != named, self.key(m.position, m.id)) < mine;
        let kin = |m: &Member| me.group.contains(m.group) || (m.id == named && unheard(named));
        self.living_peers(now).filter(|m| kin(m) && before(m)).count()
    }

    /// Leaders closer to the destination.
    fn rank_of_leaders(&self, now: SimTime, me: &Member) -> usize {
        let mine = self.key(me.position, me.id);
        let leaders = self.peers.living(now).filter(|(_, pose)| pose.leads());
        leaders.filter(|(id, pose)| self.key(extrapolated(pose, now), *id) < mine).count()
    }

    /// Takes stock of who is there, before a leader decides. A drone of no part joins the one of the nearest drone.
    pub fn refresh_members(&mut self, now: SimTime, own: &Own) {
        let scope = self.election.scope();
        let (mut members, mut others) = (std::mem::take(&mut self.members), std::mem::take(&mut self.others));
        let mut orphans = Vec::new();
        members.clear();
        others.clear();
        members.push(self.myself(own));
        for peer in self.living_peers(now) {
            if scope.contains(peer.group) {
                members.push(peer);
            } else if peer.group.contains(scope) && self.term_of(peer.id) <= self.election.obeyed() {
                orphans.push(peer);
            } else {
                others.push(peer);
            }
        }
        // Whoever is of another lineage, or obeys an older term, does not take it in.
        orphans.retain(|orphan| {
            let later = |m: &Member| self.term_of(m.id) > self.term_of(orphan.id);
            let kin = others.iter().filter(|m| orphan.group.contains(m.group) && later(m));
            let mine = self.term_of(orphan.id) == self.election.obeyed();
            mine || nearest_m2(orphan, members.iter()) <= nearest_m2(orphan, kin)
        });
        members.append(&mut orphans);
        (self.members, self.others) = (members, others);
        self.members.sort_unstable_by_key(|member| member.id);
        for set in self.ledger.sets() {
            let past = self.members.iter().filter(|member| member.position.x >= set.routes.exit_x_m());
            past.for_each(|member| self.obstacles.note_passed(member.id, &set.ids));
        }
    }

    /// The term that a peer obeys, by its last beacon.
    pub(crate) fn term_of(&self, peer: DroneId) -> Ballot {
        self.peers.last(peer).map_or(Ballot::NONE, |pose| pose.term)
    }

    /// All living drones, by id, as of the last [`Self::refresh_members`].
    #[must_use]
    pub fn living(&self) -> Vec<Member> {
        let mut all: Vec<Member> = self.members.iter().chain(&self.others).copied().collect();
        all.sort_by_key(|member| member.id);
        all
    }

    /// The living members, by id, as of the last [`Self::refresh_members`].
    #[must_use]
    pub fn members(&self) -> &[Member] {
        &self.members
    }
}

/// Square of the distance to the nearest of these, m².
fn nearest_m2<'m>(from: &Member, to: impl Iterator<Item = &'m Member>) -> f64 {
    to.map(|m| (m.position - from.position).norm_squared()).fold(f64::INFINITY, f64::min)
}
