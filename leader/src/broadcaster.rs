//! What a drone broadcasts, and when: its beacon, its plan, and repetitions of what others may have missed.

use crate::beacon_pace::BeaconPace;
use crate::beacons::Beacon;
use crate::gossip::{Gossip, GossipRhythm};
use crate::knowledge::Knowledge;
use crate::news::News;
use crate::obstacles::{Obstacles, set_array, set_ids};
use crate::own_state::OwnState;
use crate::params::LeadingParams;
use crate::plan_bundle::PlanBundle;
use crate::relays::Relays;
use crate::tuning::{FAR_REPEATS, NEWS_TURNS, UNPACED};
use skein_protocol::payload::{
    Assignment, MAX_PLACES, Obstacle, POSE_BEFORE, POSE_IMPAIRED, POSE_LEADS, Passed, Pose, QueuePlace,
};
use skein_protocol::{Ballot, DroneId, Message, ObstacleId, Phase, PlanStamp, SimTime, flag, raised};
use std::collections::BTreeMap;

/// The broadcasts of one drone: their periods, and what was said when.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Broadcaster {
    pace: BeaconPace,
    rhythm: GossipRhythm,
    /// Time that one assignment takes in a leader's share of the bandwidth, s.
    part_s: f64,
    /// When each known obstacle is said again.
    obstacles: BTreeMap<ObstacleId, Retelling>,
    /// How often outlines had been learnt or had grown when that was last looked at.
    outlines: usize,
    /// When the passed sets are said again.
    passed: Gossip,
    /// The term that this drone obeyed in the last tick.
    term: Ballot,
    next_repeat: SimTime,
    /// The last plan of its own whose assignments it has said in full.
    announced: PlanStamp,
    /// Number of repetitions of plans.
    repetitions: u32,
}

/// When an obstacle is said again.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Retelling {
    gossip: Gossip,
    /// How often its outline had grown when the drone last looked.
    growths: u32,
}

impl Retelling {
    /// Whether drones may not know the obstacle as it is, although a plan covers it or this drone has passed it: its outline has grown not
    /// long ago, or a drone is heard again that was out of reach and has still to pass it.
    fn is_news(&self, k: &Knowledge, now: SimTime, id: ObstacleId) -> bool {
        self.gossip.doublings() < NEWS_TURNS && (self.growths > 0 || is_ahead_of_near(k, now, id))
    }
}

/// What is said of a bundle's assignments.
#[derive(Clone, Copy)]
struct Extent {
    /// All assignments, not only those of drones that obey an older plan.
    all: bool,
    /// The plan itself, too.
    plan: bool,
    /// Also assignments of drones that this drone does not hear directly.
    far: bool,
}

impl Broadcaster {
    /// Nothing said yet.
    pub(crate) fn new(params: &LeadingParams) -> Self {
        Self {
            pace: BeaconPace::new(params),
            rhythm: GossipRhythm::steady(params.repeat_period_s, params.me),
            part_s: params.leader_frame_s(size_of::<Assignment>()),
            obstacles: BTreeMap::new(),
            outlines: 0,
            passed: Gossip::new(params.start),
            term: Ballot::NONE,
            next_repeat: params.start,
            announced: PlanStamp::default(),
            repetitions: 0,
        }
    }

    /// Makes the next repetition of plans due at once: there is a new one.
    pub(crate) fn hurry(&mut self) {
        self.next_repeat = SimTime::ZERO;
    }

    /// Notes that another drone has said an obstacle. `exceeded`: this drone knows more of the outline.
    pub(crate) fn hear_obstacle(&mut self, now: SimTime, id: ObstacleId, exceeded: bool) {
        match self.obstacles.get_mut(&id) {
            Some(told) if exceeded => told.gossip.restart(now),
            Some(told) => told.gossip.hear(),
            None => {}
        }
    }

    /// Repeats all facts soon: a drone that may not know them can be heard (again).
    pub(crate) fn restart_gossip(&mut self, now: SimTime) {
        self.obstacles.values_mut().for_each(|told| told.gossip.restart(now));
        self.passed.restart(now);
    }

    /// Says what is due; `places` are this drone's places in queues. Call once per tick.
    pub(crate) fn speak(
        &mut self,
        k: &Knowledge,
        now: SimTime,
        own: &OwnState,
        places: &[QueuePlace; MAX_PLACES],
        relays: &mut Relays,
        say: &mut Vec<Message>,
    ) {
        if self.pace.may_be_due(own.tick) {
            let beacon = pose(k, now, own, places);
            let heard = if relays.is_wide() { k.peers().direct_count() } else { 0 };
            if self.pace.is_due(own.tick, News::of(&beacon), heard) {
                k.peers().warm_near();
                let hears = k.peers().hears(k.me(), now);
                relays.look(k, now, own, self.pace.period_s(), hears);
                say.push(Message::Pose(Pose { hears, ..beacon }));
            }
        }
        if std::mem::replace(&mut self.term, k.election().obeyed()) != k.election().obeyed() {
            // The new leader may not know.
            self.restart_gossip(now);
        }
        // Plans come first. Where bandwidth is short, the first frames of a tick are those that are transmitted.
        if self.repeat_due(now) && k.election().leads() {
            let first = say.len();
            self.say_plans(k, now, say);
            let paced = (say.len() - first).saturating_sub(UNPACED);
            self.next_repeat = self.next_repeat.max(now.after(paced as f64 * self.part_s));
        }
        self.say_obstacles(k, now, relays.is_wide(), say);
        if self.passed.is_due(&self.rhythm, now) {
            say_passed(k, now, own, say);
        }
        relays.speak(k, now, say);
    }

    /// Says the obstacles that are due and that no plan covers yet, so that the leader learns what any member senses. A drone
    /// says what it has sensed first at once.
    fn say_obstacles(&mut self, k: &Knowledge, now: SimTime, wide: bool, say: &mut Vec<Message>) {
        if std::mem::replace(&mut self.outlines, k.obstacles().changes()) != k.obstacles().changes() {
            for (id, known) in k.obstacles().iter() {
                let me = k.me();
                let told = self.obstacles.entry(id).or_insert_with(|| {
                    if known.witness == me {
                        say.extend(obstacle(k.obstacles(), id));
                    }
                    Retelling { gossip: Gossip::new(now), growths: known.growths }
                });
                if std::mem::replace(&mut told.growths, known.growths) != known.growths {
                    told.gossip.restart(now);
                }
            }
        }
        for (&id, told) in &mut self.obstacles {
            if told.gossip.is_due(&self.rhythm, now)
                && (is_open(k, id) || told.is_news(k, now, id) || (wide && is_missed(k, now, id)))
            {
                say.extend(obstacle(k.obstacles(), id));
            }
        }
    }

    fn repeat_due(&mut self, now: SimTime) -> bool {
        let due = now >= self.next_repeat;
        if due {
            self.next_repeat = now.after(self.rhythm.shortest_s());
        }
        due
    }

    /// Says the leader's own plan: the assignments of all drones when it is new, later those of drones whose beacons do
    /// not show that they obey it. A plan of an earlier leader, which split the group, is repeated only for drones that
    /// missed it.
    fn say_plans(&mut self, k: &Knowledge, now: SimTime, say: &mut Vec<Message>) {
        let Some(bundle) = k.ledger().obeyed() else { return };
        let own = bundle.plan.id.ballot == k.election().obeyed();
        let new = own && self.announced != bundle.plan.id;
        self.repetitions = if new { 0 } else { self.repetitions.wrapping_add(1) };
        let far = self.repetitions.is_multiple_of(FAR_REPEATS);
        if own {
            say.push(Message::Plan(bundle.plan));
        }
        if own || bundle.plan.group != k.election().scope() {
            say_parts(k, bundle, now, Extent { all: new, plan: !own, far }, say);
        }
        if let Some(origin) = k.ledger().origin() {
            say_parts(k, origin, now, Extent { all: false, plan: true, far }, say);
        }
        if own {
            self.announced = bundle.plan.id;
        }
    }
}

/// The beacon of this drone, without what it hears.
fn pose(k: &Knowledge, now: SimTime, own: &OwnState, places: &[QueuePlace; MAX_PLACES]) -> Pose {
    let (leads, impaired) = (flag(k.election().leads(), POSE_LEADS), flag(k.is_impaired(), POSE_IMPAIRED));
    Pose {
        stamp: now,
        position_m: raised(own.position, own.altitude_m),
        velocity_mps: raised(own.velocity, own.climb_mps),
        queue: *places,
        obeyed: k.ledger().stamp(),
        group: k.ledger().group(),
        term: k.election().obeyed(),
        incarnation: k.incarnation(),
        flags: leads | impaired | flag(k.is_before(), POSE_BEFORE),
        hears: 0,
    }
}

/// Whether no plan covers an obstacle yet and this drone still has to pass it.
fn is_open(k: &Knowledge, id: ObstacleId) -> bool {
    !k.obstacles().has_passed(k.me(), id) && !k.ledger().sets().iter().any(|set| set.ids.contains(&id))
}

/// Whether radios have a limited range, and a drone that this one hears still has to pass an obstacle.
fn is_ahead_of_near(k: &Knowledge, now: SimTime, id: ObstacleId) -> bool {
    if k.params().radio_range_m.is_infinite() {
        return false;
    }
    let obstacles = k.obstacles();
    let exit_x_m = obstacles.exit_x_m(&[id], k.params().routes.planning_distance_m);
    let ahead = |(peer, pose): (DroneId, Beacon<'_>)| !obstacles.is_past(peer, pose.position().x, &[id], exit_x_m);
    k.peers().direct(now).any(ahead)
}

/// Whether an obstacle is in the plan that this drone obeys, and a neighbour may not obey that plan because it does not know
/// the obstacle.
fn is_missed(k: &Knowledge, now: SimTime, id: ObstacleId) -> bool {
    let Some(set) = k.ledger().sets().iter().find(|set| set.ids.contains(&id)) else { return false };
    k.peers().direct(now).any(|(_, pose)| set.scope.contains(pose.group()) && pose.obeyed() < set.stamp)
}

/// Says which sets this drone has passed, until the swarm re-forms. In a part of the swarm, as long as it hears drones of another part,
/// also later, if those may not know it: with a limited range, and if outlines are sensed in part.
fn say_passed(k: &Knowledge, now: SimTime, own: &OwnState, say: &mut Vec<Message>) {
    let mut passed = |set: &[ObstacleId]| {
        let (set, set_count) = set_array(set);
        say.push(Message::Passed(Passed { stamp: now, set_count, set, of: 0 }));
    };
    let planned = k.ledger().sets().iter().filter(|set| own.position.x >= set.routes.exit_x_m());
    planned.for_each(|set| passed(&set.ids));
    let limited_range = k.params().radio_range_m.is_finite();
    let others = |bundle: &PlanBundle| k.living_peers(now).any(|m| !bundle.parts.contains(m.id));
    let unsure = k.ledger().obeyed().is_some_and(|bundle| match bundle.plan.phase() {
        Phase::Reform => limited_range && others(bundle),
        // Other drones may know by now that the outlines reach farther.
        Phase::Cruise => k.obstacles().have_grown() && others(bundle),
        Phase::Avoid => false,
    });
    if unsure {
        let is_passed = |set: &&Vec<ObstacleId>| set.iter().all(|&id| k.obstacles().has_passed(k.me(), id));
        k.obstacles().sets().iter().filter(is_passed).for_each(|set| passed(set));
    }
}

/// Says assignments of a bundle, to the given extent, with the obstacles that their drones may not know. Says nothing if
/// there is no assignment to be said.
fn say_parts(k: &Knowledge, bundle: &PlanBundle, now: SimTime, extent: Extent, say: &mut Vec<Message>) {
    let (stamp, peers) = (bundle.plan.id, k.peers());
    let heard = |id: DroneId| if extent.far { peers.is_living(id, now) } else { peers.is_direct(id, now) };
    let late = |id: DroneId| heard(id) && peers.last(id).is_some_and(|pose| pose.obeyed() < stamp);
    let first = say.len();
    let parts = bundle.parts.iter().filter(|part| extent.all || late(part.drone));
    say.extend(parts.map(Message::Assignment));
    if say.len() == first {
        return;
    }
    if extent.plan {
        say.push(Message::Plan(bundle.plan));
    }
    if bundle.plan.phase() == Phase::Avoid {
        let ids = set_ids(&bundle.plan.set, bundle.plan.set_count);
        say.extend(ids.iter().filter_map(|&id| obstacle(k.obstacles(), id)));
    }
}

/// The message about a known obstacle.
fn obstacle(obstacles: &Obstacles, id: ObstacleId) -> Option<Message> {
    let known = obstacles.get(id)?;
    Some(Message::Obstacle(Obstacle { shape: known.shape, id, witness: known.witness }))
}
