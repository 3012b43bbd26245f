//! When a drone takes up leading, or hands it over, although its leader is healthy.

use crate::election::Input;
use crate::knowledge::{Knowledge, is_formation_of_all};
use crate::member::Member;
use crate::onward;
use crate::own_state::OwnState;
use crate::params::Between;
use crate::relays::Relays;
use crate::tuning::{ARRIVED_S, BEHIND_S, LEFT_OUT_S};
use skein_protocol::payload::Plan;
use skein_protocol::{Ballot, DroneId, GroupId, Phase, PlanStamp, SimTime, Vec2};
use std::cell::LazyCell;

/// What this drone's role in its group depends on, and since when.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Roles {
    /// Since when its part of a split group has a task and no leader of its own.
    part: Option<SimTime>,
    /// Since when the parts could be one group again.
    whole: Option<SimTime>,
    /// Since when drones that left this leader's formation have nothing to pass any more.
    torn: Option<SimTime>,
    transfer: Option<Transfer>,
    /// The leader's term and since when it has planned without this drone.
    left_out: Option<(Ballot, SimTime)>,
    /// The newest plan without this drone for which it has claimed to lead. It claims once for each: two drones that both missed their
    /// assignments would otherwise take over from each other for ever.
    claimed_for: PlanStamp,
    /// Whether a drone obeys a plan of this leader's term that this leader never made. A new term ends that.
    plan_conflict_seen: bool,
}

/// A transfer of leadership that is due.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Transfer {
    /// Whether the reason is a broken sensor.
    impaired: bool,
    /// When the heir is asked (again).
    from: SimTime,
}

impl Roles {
    /// Notes that a drone obeys a plan of this leader's term that this leader never made.
    pub(crate) fn note_plan_conflict(&mut self) {
        self.plan_conflict_seen = true;
    }

    /// The claim or the transfer of leadership that is due now. Call once per tick.
    pub(crate) fn decide(&mut self, k: &Knowledge, relays: &Relays, now: SimTime, own: &OwnState) -> Option<Input> {
        if std::mem::take(&mut self.plan_conflict_seen) && k.election().leads() {
            return Some(Input::Claim(k.election().scope()));
        }
        let claim =
            self.claimable(k, relays, now, own).or_else(|| self.scope_of_deaf_leader(k, now, own)).map(Input::Claim);
        claim.or_else(|| self.heir(k, now, own).map(Input::Transfer))
    }

    /// The group that this drone is to lead now although another leader may be healthy: its part of a split group, with an
    /// obstacle ahead; or the whole swarm, if it leads a part, no drone has an obstacle ahead any more, and groups do not go on
    /// by themselves.
    fn claimable(&mut self, k: &Knowledge, relays: &Relays, now: SimTime, own: &OwnState) -> Option<GroupId> {
        let (scope, group) = (k.election().scope(), k.election().group());
        let me = LazyCell::new(|| k.myself(own));
        let part = scope != group && scope.contains(group) && part_has_ahead(k, now, &me);
        if !part && !k.election().leads() {
            (self.part, self.whole, self.torn) = (None, None, None);
            return None;
        }
        let whole =
            scope != GroupId::ALL && k.election().leads() && !any_has_ahead(k, now, &me) && !goes_on(k, now, &me);
        let rank = match (part, whole) {
            (true, _) => rank_in_part(k, now, &me),
            (false, true) => rank_among_leaders(k, now, &me),
            (false, false) => 0,
        };
        // Plans and claims of the drones with a lower rank must have time to arrive.
        let wait_s = k.election().wait_s().max(2.0 * k.peers().delay_s()) * rank as f64;
        let claim_part = held(&mut self.part, part, now, wait_s);
        let claim_whole = held(&mut self.whole, whole && !part, now, wait_s) || self.claims_torn(k, relays, now);
        if claim_part { Some(group) } else { claim_whole.then_some(GroupId::ALL) }
    }

    /// Whether this leader of the whole swarm is to claim it anew: some drones left its formation for an obstacle that they learnt of
    /// only then, and are past it. They obey later terms, so they do not hear of this leader's plans any more. And they may wait for
    /// drones that stand in slots before that obstacle. Leaders of parts that can claim the swarm do so before. In a swarm that is wider
    /// than its radio's range, word of the drones that obey a term may come before that term's own messages: then it may be a claim of the
    /// whole swarm that is under way to this leader.
    fn claims_torn(&mut self, k: &Knowledge, relays: &Relays, now: SimTime) -> bool {
        let election = k.election();
        let forms = || k.ledger().obeyed().is_some_and(|bundle| is_formation_of_all(&bundle.plan));
        let torn = election.leads() && election.scope() == GroupId::ALL && forms() && {
            let is_of_part = |term| !relays.is_wide() || relays.is_of_part(now, term);
            let gone = k.living_peers(now).map(|m| (k.term_of(m.id), m)).filter(|(term, _)| *term > election.obeyed());
            let gone = gone.filter(|(term, _)| is_of_part(*term)).map(|(_, m)| m);
            gone.clone().next().is_some() && !has_ahead(k, gone)
        };
        let leaders = || k.peers().living(now).filter(|(_, pose)| pose.leads()).count();
        let wait_s = if torn { election.wait_s().max(2.0 * k.peers().delay_s()) * (1 + leaders()) as f64 } else { 0.0 };
        held(&mut self.torn, torn, now, wait_s)
    }

    /// The scope that this drone is to lead because its leader, although healthy, has planned without it for too long.
    /// Either that leader hears no other drone: then the others wait as well, and those closer to the destination claim
    /// first. Or no drone hears this one: then its claim does not matter.
    fn scope_of_deaf_leader(&mut self, k: &Knowledge, now: SimTime, own: &OwnState) -> Option<GroupId> {
        let plan = k.ledger().left_out_of().filter(|plan| !k.election().leads() && *plan > self.claimed_for);
        let Some(plan) = plan else {
            self.left_out = None;
            return None;
        };
        // Far from the leader, its neighbours notice first. And word takes longer there, to the leader and back.
        let patience_s = match k.election().hops() {
            0 => LEFT_OUT_S,
            hops => LEFT_OUT_S * (1.0 + f64::from(hops)) + 2.0 * k.election().silence_s(),
        };
        let term = k.election().obeyed();
        let known = self.left_out.filter(|(known, _)| *known == term);
        let (_, since) = *self.left_out.insert(known.unwrap_or((term, now)));
        let waited_s = now.since(since) - patience_s;
        if waited_s < 0.0 {
            return None;
        }
        let (scope, leader) = (k.election().scope(), k.election().obeyed().claimant);
        let mine = k.claim_key(own.position, k.me());
        let rivals = k.living_peers(now).filter(|m| m.id != leader && scope.contains(m.group));
        let rank = rivals.filter(|m| k.claim_key(m.position, m.id) < mine).count();
        let due = waited_s >= k.election().wait_s() * rank as f64;
        if due {
            self.claimed_for = plan;
        }
        due.then_some(scope)
    }

    /// The drone that is to take over from this leader. At once, if a sensor of this leader is broken and a follower is
    /// healthy. After a while, if this leader fell behind in formation: it has been the last of several, and so far behind
    /// its slot and the first drone that it lost touch. The request is repeated until a drone takes over.
    fn heir(&mut self, k: &Knowledge, now: SimTime, own: &OwnState) -> Option<DroneId> {
        if !k.election().leads() {
            self.transfer = None;
            return None;
        }
        let healthy = if k.is_impaired() { first_healthy(k, now) } else { None };
        let impaired = healthy.is_some();
        let heir = healthy.or_else(|| first_if_behind(k, now, own));
        let begin = now.after(if impaired { 0.0 } else { BEHIND_S });
        let known = self.transfer.filter(|transfer| transfer.impaired == impaired);
        let from = heir.map(|_| known.map_or(begin, |transfer| transfer.from));
        let due = from.is_some_and(|from| now >= from);
        let next = |from| if due { now.after(k.election().wait_s()) } else { from };
        self.transfer = from.map(|from| Transfer { impaired, from: next(from) });
        heir.filter(|_| due)
    }
}

/// Whether a condition has held for `wait_s`; `since`: since when it holds.
fn held(since: &mut Option<SimTime>, condition: bool, now: SimTime, wait_s: f64) -> bool {
    *since = condition.then(|| since.unwrap_or(now));
    since.is_some_and(|since| now.since(since) >= wait_s)
}

/// The healthy follower that is closest to the destination.
fn first_healthy(k: &Knowledge, now: SimTime) -> Option<DroneId> {
    let scope = k.election().scope();
    let follows = |m: &Member| scope.contains(m.group) && k.term_of(m.id) == k.election().obeyed();
    let healthy = k.living_peers(now).filter(|m| follows(m) && k.is_healthy(m.id));
    healthy
        .map(|m| k.claim_key(m.position, m.id))
        .min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)))
        .map(|(_, id)| id)
}

/// The follower that is closest to the destination, if this leader is the last of several and lost touch with them.
fn first_if_behind(k: &Knowledge, now: SimTime, own: &OwnState) -> Option<DroneId> {
    let (bundle, part) = (k.ledger().obeyed()?, k.ledger().part()?);
    let (anchor, _) = bundle.plan.anchor_at(now);
    let distance_m = |position| k.params().destination.distance_m(position);
    let (mine_m, spacing_m) = (distance_m(own.position), k.params().spacing_m);
    let slot_m = distance_m(anchor + Vec2::from(part.slot_m));
    let scope = k.election().scope();
    let members = k.living_peers(now).filter(|m| scope.contains(m.group));
    if !k.ledger().sets().is_empty()
        || mine_m - slot_m <= spacing_m
        || !members.clone().all(|m| distance_m(m.position) < mine_m)
    {
        return None;
    }
    let follower = |m: &Member| k.term_of(m.id) == k.election().obeyed();
    let nearer =
        |a: &Member, b: &Member| distance_m(a.position).total_cmp(&distance_m(b.position)).then(a.id.cmp(&b.id));
    let first = members.filter(follower).min_by(nearer)?;
    (mine_m - distance_m(first.position) > spacing_m).then_some(first.id)
}

/// Whether some of these drones still have an obstacle set to pass.
fn has_ahead(k: &Knowledge, drones: impl Iterator<Item = Member> + Clone) -> bool {
    let planning_m = k.params().routes.planning_distance_m;
    k.obstacles().to_be_passed().iter().any(|set| {
        let exit_x_m = k.obstacles().exit_x_m(set, planning_m);
        drones.clone().any(|m| !m.settled && !k.obstacles().is_past(m.id, m.position.x, set, exit_x_m))
    })
}

/// Whether this drone has an obstacle ahead, or is to lead a part with a member that has.
fn part_has_ahead(k: &Knowledge, now: SimTime, me: &Member) -> bool {
    let named = k.ledger().part().is_some_and(|part| part.leader == k.me());
    let mates = named.then(|| k.living_peers(now).filter(|m| me.group.contains(m.group)));
    has_ahead(k, mates.into_iter().flatten().chain([*me]))
}

/// Whether any living drone has an obstacle ahead.
fn any_has_ahead(k: &Knowledge, now: SimTime, me: &Member) -> bool {
    has_ahead(k, k.living_peers(now).chain([*me]))
}

/// Whether this drone's group has waited at its destination for long. Groups that plan by themselves may stop where the swarm as a whole
/// would have to fly on, or in the same slots.
fn has_waited(k: &Knowledge, now: SimTime) -> bool {
    let plan = k.ledger().obeyed().map(|bundle| &bundle.plan).filter(|plan| plan.phase() == Phase::Cruise);
    plan.and_then(Plan::anchor_stops).is_some_and(|stops| now.since(stops) >= ARRIVED_S)
}

/// Whether groups still go on by themselves.
fn goes_on(k: &Knowledge, now: SimTime, me: &Member) -> bool {
    k.params().between == Between::GoOn
        && !has_waited(k, now)
        && onward::is_under_way(k.params(), k.living_peers(now).chain([*me]).map(|m| m.position))
}

/// Number of members of this drone's part that should lead it rather: the one that the plan names, even if that drone's
/// own assignment was not heard, and those closer to the destination.
fn rank_in_part(k: &Knowledge, now: SimTime, me: &Member) -> usize {
    let named = k.ledger().part().map_or(DroneId::NONE, |part| part.leader);
    let mine = (me.id != named, k.claim_key(me.position, me.id));
    let unheard = |id: DroneId| k.ledger().obeyed().is_some_and(|bundle| !bundle.parts.contains(id));
    let before = |m: &Member| (m.id != named, k.claim_key(m.position, m.id)) < mine;
    let mate = |m: &Member| me.group.contains(m.group) || (m.id == named && unheard(named));
    k.living_peers(now).filter(|m| mate(m) && before(m)).count()
}

/// Number of leaders that are closer to the destination.
fn rank_among_leaders(k: &Knowledge, now: SimTime, me: &Member) -> usize {
    let mine = k.claim_key(me.position, me.id);
    let leaders = k.peers().living(now).filter(|(_, pose)| pose.leads());
    leaders.filter(|(id, pose)| k.claim_key(pose.extrapolated(now), *id) < mine).count()
}
