//! What a drone knows of plans: the newest one it has heard of, the one it obeys, and the assignments in it. Leaders and
//! followers use the same ledger; a new leader continues from its own.

use crate::assignments::Assignments;
use crate::obstacles::{Obstacles, set_ids};
use crate::plan_bundle::PlanBundle;
use crate::planned_set::PlannedSet;
use crate::roster::Roster;
use crate::routes::{RouteParams, Routes};
use crate::set_place::SetPlace;
use skein_protocol::digest::Digest;
use skein_protocol::payload::{Assignment, Plan, Pose, QueuePlace, set_tag};
use skein_protocol::{Ballot, DroneId, GroupId, ObstacleId, Phase, PlanStamp};

/// The ledger of one drone. Memory is bounded by the size of the swarm and of an obstacle set.
#[derive(Clone, Debug)]
pub struct Ledger {
    me: DroneId,
    drones: u32,
    params: RouteParams,
    /// The newest stamp it has heard of.
    stamp: PlanStamp,
    /// The plan of that stamp.
    plan: Option<Plan>,
    /// The assignments of that stamp, until the plan is obeyed. Then they are in `obeyed`.
    parts: Assignments,
    obeyed: Option<PlanBundle>,
    /// This drone's assignment in `obeyed`: a copy that can be read without a search.
    mine: Option<Assignment>,
    /// The plan of an earlier leader that split the group, if this drone obeys a plan for a part.
    origin: Option<PlanBundle>,
    sets: Vec<PlannedSet>,
    /// The obstacles of sets that a formation of the whole swarm has ended, and that its leader says all its drones have passed.
    ended: Vec<ObstacleId>,
    /// Hash of `mine`.
    part_hash: u64,
    /// How often the routes past a set were drawn anew because an outline has grown.
    redrawn: usize,
}

impl Ledger {
    /// An empty ledger of drone `me` in a swarm of `drones`.
    #[must_use]
    pub fn new(me: DroneId, drones: u32, params: RouteParams) -> Self {
        Self {
            me,
            drones,
            params,
            stamp: PlanStamp::default(),
            plan: None,
            parts: Assignments::default(),
            obeyed: None,
            mine: None,
            origin: None,
            sets: Vec::new(),
            ended: Vec::new(),
            part_hash: 0,
            redrawn: 0,
        }
    }

    /// The ledger that drone `me` would have if it had heard the same.
    #[must_use]
    pub fn of_member(&self, me: DroneId) -> Self {
        let mut ledger = Self { me, ..self.clone() };
        ledger.mine = ledger.find_part();
        ledger.part_hash = ledger.hash_part();
        ledger
    }

    /// The ledger as if all drones were one group and all plans had been made in one term. `places`: queue places that
    /// drones are known to have. They count for drones that the newest plan does not assign.
    #[must_use]
    pub fn united(&self, ballot: Ballot, places: &[(DroneId, QueuePlace)]) -> Self {
        let mut all = Self { origin: None, ..self.clone() };
        let newest = self.obeyed.as_ref().filter(|bundle| bundle.plan.id == self.stamp);
        let given = |id: DroneId| newest.map_or(&self.parts, |bundle| &bundle.parts).contains(id);
        for set in &mut all.sets {
            (set.stamp.ballot, set.scope) = (ballot, GroupId::ALL);
            for &(drone, place) in places.iter().filter(|(id, place)| place.set == set.tag && !given(*id)) {
                let new = SetPlace { drone, group: GroupId::ALL, route: 0, rank: 0 };
                let part = set.parts.add(new);
                (part.route, part.rank) = (place.route, place.rank);
            }
        }
        if let Some(bundle) = &mut all.obeyed {
            bundle.unite(PlanStamp { ballot, ..bundle.plan.id });
        }
        all.mine = all.find_part();
        all.stamp.ballot = ballot;
        all
    }

    /// The plan this drone obeys, with the assignments it has heard of.
    #[must_use]
    pub fn obeyed(&self) -> Option<&PlanBundle> {
        self.obeyed.as_ref()
    }

    /// The plan that made this drone's group, by the leader of a wider group. The leaders of the parts repeat it for drones
    /// that missed it.
    #[must_use]
    pub fn origin(&self) -> Option<&PlanBundle> {
        self.origin.as_ref()
    }

    /// The stamp of the plan it obeys; the default, lower than any, before the first.
    #[must_use]
    pub fn stamp(&self) -> PlanStamp {
        self.obeyed.as_ref().map_or(PlanStamp::default(), |bundle| bundle.plan.id)
    }

    /// The newest stamp it has heard of, whether it can obey that plan yet or not.
    #[must_use]
    pub fn newest(&self) -> PlanStamp {
        self.stamp
    }

    /// This drone's assignment in the plan it obeys.
    #[must_use]
    pub fn part(&self) -> Option<&Assignment> {
        self.mine.as_ref()
    }

    fn find_part(&self) -> Option<Assignment> {
        self.obeyed.as_ref()?.parts.get(self.me)
    }

    /// The newest plan, if it has no assignment for this drone, as far as it was heard.
    #[must_use]
    pub fn left_out_of(&self) -> Option<PlanStamp> {
        let newer = self.plan.as_ref().map(|plan| plan.id).filter(|id| *id > self.stamp());
        newer.filter(|_| !self.parts.contains(self.me))
    }

    /// The sets that are being passed, in flight order.
    #[must_use]
    pub fn sets(&self) -> &[PlannedSet] {
        &self.sets
    }

    /// Takes the obstacles that all drones of the obeyed formation have passed: those of the sets that a formation of the whole
    /// swarm has ended since the last call.
    pub fn take_ended(&mut self) -> Vec<ObstacleId> {
        std::mem::take(&mut self.ended)
    }

    /// Hash of this drone's assignment: equal stamps must mean equal hashes. 0 before the first plan.
    #[must_use]
    pub fn part_hash(&self) -> u64 {
        self.part_hash
    }

    fn hash_part(&self) -> u64 {
        let (Some(bundle), Some(part)) = (&self.obeyed, self.part()) else { return 0 };
        let mut digest = Digest::default();
        digest.bytes(bytemuck::bytes_of(part)).word(u64::from(bundle.plan.phase));
        digest.bytes(bytemuck::cast_slice(set_ids(&bundle.plan.set, bundle.plan.set_count)));
        digest.value().max(1)
    }

    /// The group this drone is in.
    #[must_use]
    pub fn group(&self) -> GroupId {
        self.part().map_or(GroupId::ALL, |part| part.group)
    }

    /// Hears a plan. An older plan is ignored.
    pub fn hear_plan(&mut self, plan: &Plan, obstacles: &Obstacles) {
        if self.open(plan.id) {
            self.plan.get_or_insert(*plan);
            self.settle(obstacles);
        }
    }

    /// Hears a drone's assignment. An assignment of an older plan, or of no drone of the swarm, is ignored.
    pub fn hear_assignment(&mut self, part: &Assignment, obstacles: &Obstacles) {
        if part.drone.0 >= self.drones || !self.open(part.id) {
            return;
        }
        if let Some(bundle) = self.obeyed.as_mut().filter(|bundle| bundle.plan.id == part.id) {
            bundle.parts.add(part);
            for set in self.sets.iter_mut().filter(|set| set.stamp == part.id) {
                set.parts.add(part.into());
            }
        } else {
            self.parts.add(part);
            self.settle(obstacles);
        }
    }

    /// Takes note of another drone's assignment in a plan that this drone obeys, or that made its group, although it obeys a later
    /// term by now. So the leader of a part knows which drones are in other parts.
    pub(crate) fn complete(&mut self, part: &Assignment) {
        if part.drone.0 >= self.drones || part.drone == self.me {
            return;
        }
        let plans = [self.obeyed.as_mut(), self.origin.as_mut()];
        let Some(bundle) = plans.into_iter().flatten().find(|bundle| bundle.plan.id == part.id) else { return };
        if !bundle.parts.contains(part.drone) {
            bundle.parts.add(part);
            for set in self.sets.iter_mut().filter(|set| set.stamp == part.id && !set.parts.contains(part.drone)) {
                set.parts.add(part.into());
            }
        }
    }

    /// Takes the queue places in a beacon for the drone's assignments, where those were not heard.
    pub fn hear_place(&mut self, drone: DroneId, pose: &Pose) {
        for place in pose.queue.iter().filter(|place| place.rank != QueuePlace::NO_RANK) {
            let (route, rank) = (place.route, place.rank);
            let waits = |set: &&mut PlannedSet| set.tag == place.set && pose.obeyed >= set.stamp;
            for set in self.sets.iter_mut().filter(waits).filter(|set| !set.parts.contains(drone)) {
                set.parts.add(SetPlace { drone, group: pose.group, route, rank });
            }
        }
    }

    /// Adopts a plan.
    pub fn adopt(&mut self, bundle: PlanBundle, obstacles: &Obstacles) {
        if self.open(bundle.plan.id) {
            self.plan = Some(bundle.plan);
            self.parts = bundle.parts;
            self.settle(obstacles);
        }
    }

    /// Forgets the newest plan, which this drone does not obey, in favour of the one with this stamp.
    pub(crate) fn withdraw(&mut self, said: PlanStamp) {
        self.stamp = said.max(self.stamp());
        self.plan = None;
        self.parts.clear();
    }

    /// Starts over if the stamp is newer than the newest one. Returns false if it is older.
    fn open(&mut self, stamp: PlanStamp) -> bool {
        if stamp > self.stamp {
            self.stamp = stamp;
            self.plan = None;
            self.parts.clear();
        }
        stamp == self.stamp
    }

    /// Draws the routes past an obstacle anew, whose outline has grown.
    pub fn redraw(&mut self, id: ObstacleId, obstacles: &Obstacles) {
        for set in self.sets.iter_mut().filter(|set| set.ids.contains(&id)) {
            if let Some(shapes) = obstacles.shapes(&set.ids) {
                set.routes = set.routes.redrawn(&shapes, &self.params);
                self.redrawn += 1;
            }
        }
    }

    /// How often routes were drawn anew.
    #[must_use]
    pub fn redrawn(&self) -> usize {
        self.redrawn
    }

    /// The places in the newest plan, with room for those that were not heard yet.
    fn set_places(&self, plan: &Plan) -> Roster<SetPlace> {
        let mut places = Roster::with_capacity(plan.members.min(self.drones) as usize);
        for part in self.parts.iter() {
            places.add(SetPlace::from(&part));
        }
        places
    }

    /// Obeys the newest plan once the plan, this drone's assignment and all obstacles of the set are known. Call again when
    /// an obstacle was learnt.
    pub fn settle(&mut self, obstacles: &Obstacles) {
        let Some(plan) = self.plan.filter(|plan| plan.id > self.stamp()) else { return };
        if !self.parts.contains(self.me) {
            return;
        }
        if plan.phase() == Phase::Avoid {
            let ids = set_ids(&plan.set, plan.set_count);
            let Some(shapes) = obstacles.shapes(ids) else { return };
            let routes = Routes::new(&shapes, &self.params);
            self.sets.retain(|set| !set.ids.iter().any(|id| ids.contains(id)));
            let (ids, tag, parts) = (ids.to_vec(), set_tag(ids), self.set_places(&plan));
            let (stamp, made, members, scope) = (plan.id, plan.stamp, plan.members, plan.group);
            self.sets.push(PlannedSet { ids, tag, stamp, made, members, scope, routes, parts });
            self.sets.sort_by(|a, b| a.routes.gate_x_m().total_cmp(&b.routes.gate_x_m()));
        } else {
            // A leader may close the formation because it does not know an obstacle that drones still have ahead.
            let named = set_ids(&plan.set, plan.set_count);
            let is_named = |set: &PlannedSet| set.ids.iter().all(|id| named.contains(id));
            let of_all = plan.phase() == Phase::Reform && plan.group == GroupId::ALL;
            let ended = self.sets.drain(..).filter(|set| of_all && is_named(set));
            self.ended.extend(ended.flat_map(|set| set.ids));
        }
        let parts = std::mem::take(&mut self.parts);
        let before = self.obeyed.replace(PlanBundle { plan, parts });
        self.mine = self.find_part();
        if let Some(before) = before
            && before.plan.group != plan.group
        {
            self.origin = before.plan.group.contains(plan.group).then_some(before);
        }
        self.part_hash = self.hash_part();
    }
}
