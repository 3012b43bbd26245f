//! The paper's pilot: it detects obstacles, obeys plans, avoids, queues and re-forms, and it plans while it leads (paper,
//! Algorithm 1).

use crate::altitude::Altitude;
use crate::braking_filter::{BrakingFilter, Moving, OwnMotion};
use crate::detection::Detection;
use crate::detour::{Detour, RouteView};
use crate::emergency_route::EmergencyRoute;
use crate::escape::{Course, Escape};
use crate::few::Few;
use crate::guidance::anchor;
use crate::lone_flight::{self, LoneFlight};
use crate::navigator::{Heading, Navigator};
use crate::neighbour_table::{NeighbourTable, NeighbourView};
use crate::params::PilotParams;
use crate::peer_clocks::{PeerClocks, Restamped};
use crate::queue::QueuePacer;
use crate::reaction::ReactionDelay;
use crate::reunion::{Others, Reunion};
use crate::rollout::{Rollout, RolloutDrone, RolloutInput, RolloutPilot};
use crate::route_follower::RouteFollower;
use crate::safety::{NearObstacle, Neighbour, Safety};
use crate::sensing_errors::SensingErrors;
use crate::separation::own_path::OwnPath;
use crate::separation::{Separations, Sighting};
use crate::silent_drones::SilentDrones;
use crate::stale_formation::StaleFormation;
use crate::state_predictor::StatePredictor;
use crate::straggler::{OwnPlan, Straggler};
use crate::tuning::{
    BACK_OUT_SPEED, GUIDE_S, HANGING_RADIUS, LEAST_ESCAPE_SPEED, PATIENCE_IN_FORMATION_S, PATIENCE_ON_ROUTE_S,
    ROUTE_CHECK_S, SILENT_DRONE_RADIUS,
};
use bytemuck::Zeroable;
use skein_leader::candidates::MAX_ROLLOUT_DRONES;
use skein_leader::cost::{Flight, shortest, trips};
use skein_leader::leading::Leading;
use skein_leader::ledger::Ledger;
use skein_leader::member::Member;
use skein_leader::obstacles::set_ids;
use skein_leader::own_state::OwnState;
use skein_leader::params::{Objective, Strategy};
use skein_leader::plan_bundle::PlanBundle;
use skein_leader::routes::Routes;
use skein_leader::set_place::SetPlace;
use skein_pilot::{Command, Heard, Inbox, Out, Pilot, Status};
use skein_protocol::digest::Digest;
use skein_protocol::downlink::{SensedShape, Senses};
use skein_protocol::payload::{Assignment, MAX_PLACES, Plan, QueuePlace, set_tag};
use skein_protocol::shape::ConvexShape;
use skein_protocol::{DroneId, GroupId, Message, MessageRef, ObstacleId, Phase, PlanStamp, SimTime, Vec2, raised};
use std::iter;

/// The pilot of one drone, composed of machines that each own their state.
#[derive(Clone, Debug)]
pub struct SwarmPilot {
    params: PilotParams,
    leading: Leading,
    route: RouteFollower,
    queue: QueuePacer,
    safety: Safety,
    braking_filter: BrakingFilter,
    /// The speed that is safe on sight with this lag, ticks and m/s.
    on_sight_mps: Option<(u32, f64)>,
    altitude: Altitude,
    navigator: Navigator,
    detour: Detour,
    /// Where the route first turns, if a drone that detours flies there. World frame, m.
    turn: Option<Vec2>,
    reaction: ReactionDelay,
    /// The step that it has begun and not ended.
    begun: Option<BegunStep>,
    /// The tick in which the drone was stepped last.
    stepped: Option<u64>,
    /// If its first step is in this tick or later, its failsafe has braked it before.
    late_from: u64,
    escape: Escape,
    straggler: Straggler,
    stale_formation: StaleFormation,
    lone_flight: LoneFlight,
    reunion: Reunion,
    silent: SilentDrones,
    neighbours: NeighbourTable,
    clocks: PeerClocks,
    /// The lines that separate it from the others, if distances are kept by words, or if a drone could not range the others for a
    /// while. Boxed, because most drones have none.
    separations: Option<Box<Separations>>,
    /// Boxed: only a leader that looks ahead has one, and the others would carry the memory for it through every tick.
    rollout: Option<Box<Rollout<Self>>>,
}

impl SwarmPilot {
    /// A drone that has just started and knows nothing but its parameters.
    #[must_use]
    pub fn new(params: PilotParams) -> Self {
        let leading = Leading::new(&params.leading());
        Self::with_leading(params, leading)
    }

    fn with_leading(params: PilotParams, leading: Leading) -> Self {
        Self {
            leading,
            route: RouteFollower::new(params.me, params.planner.course_y_m, params.squeeze()),
            queue: QueuePacer::default(),
            safety: Safety::new(params.safety),
            braking_filter: BrakingFilter::new(params.braking_filter()).with_errors(params.sensing),
            on_sight_mps: None,
            altitude: Altitude::new(params.altitude_m, params.planner.routes.planning_distance_m),
            navigator: Navigator::new(
                params.safety.clearance_m + params.sensing.obstacle_m,
                params.planner.routes.planning_distance_m,
            ),
            detour: Detour::default(),
            turn: None,
            reaction: ReactionDelay::new(params.braking.reaction_time_s, params.dt_s),
            begun: None,
            stepped: None,
            late_from: u64::from(params.incarnation == 1),
            escape: Escape::default(),
            straggler: Straggler::default(),
            stale_formation: StaleFormation::default(),
            lone_flight: LoneFlight::new(params.drones, &params.planner),
            reunion: Reunion::new(params.drones, &params.planner),
            silent: SilentDrones::new(params.silence()),
            neighbours: NeighbourTable::new(params.neighbours()),
            clocks: PeerClocks::new(params.sensing.clock_s),
            separations: params.apart_by_words.then(|| Box::new(Separations::new(params.separation(), params.start))),
            rollout: None,
            params,
        }
    }

    /// Algorithm 2: notes every obstacle in detection range, with what is sensed of its outline.
    fn sense(&mut self, senses: &Senses<'_>) {
        for shape in senses.obstacles.iter().filter_map(|entry| senses.shape(entry)) {
            self.leading.sense(senses.now, shape.id, shape.shape);
        }
    }

    /// Takes part in elections, and plans while it leads.
    fn lead(&mut self, senses: &Senses<'_>, own: &OwnState, say: &mut Vec<Message>) {
        self.leading.elect(senses.now, own, say);
        if self.leading.is_leader() {
            self.plan(senses.now, own, say);
        } else {
            self.rollout = None;
        }
    }

    fn plan(&mut self, now: SimTime, own: &OwnState, say: &mut Vec<Message>) {
        self.leading.refresh_members(now, own);
        if let Some(rollout) = self.rollout.take() {
            self.look_ahead(now, own.tick, rollout);
            return;
        }
        let alternatives = self.leading.decide(now, self.silent.all(), say);
        match self.params.planner.strategy {
            Strategy::LookAhead(objective)
                if alternatives.len() > 1 && self.leading.living().len() <= MAX_ROLLOUT_DRONES =>
            {
                self.begin_rollout(now, own.tick, objective, alternatives);
            }
            // Without a look-ahead the leader takes the plan of the paper's rule, which is the second, or the only one.
            _ => {
                if let Some(bundle) = alternatives.into_iter().take(2).next_back() {
                    self.leading.adopt(now, bundle);
                }
            }
        }
    }

    /// Continues a look-ahead. If members or obstacles have changed, it ends at once with the best plan so far, and the
    /// leader plans for the change in the next tick.
    fn look_ahead(&mut self, now: SimTime, tick: u64, mut rollout: Box<Rollout<Self>>) {
        let chosen = if rollout.is_current(self.leading.members(), self.leading.obstacles().count()) {
            rollout.advance(tick)
        } else {
            Some(rollout.choose())
        };
        match chosen {
            Some(bundle) => self.leading.adopt(now, bundle),
            None => self.rollout = Some(rollout),
        }
    }

    /// Begins a look-ahead over these alternatives. Until it decides, the swarm flies the interim plan in its present
    /// groups.
    fn begin_rollout(&mut self, now: SimTime, tick: u64, objective: Objective, alternatives: Vec<PlanBundle>) {
        let (members, scope) = (self.leading.members(), self.leading.scope());
        let interim = self.leading.interim();
        let mut first = alternatives[interim].clone();
        first.unsplit(members, scope);
        first.parts.retain(|id| members.iter().any(|m| m.id == id));
        let params = self.params.rollout();
        let obstacles = self.leading.obstacles().iter();
        let input = RolloutInput {
            tick,
            now,
            objective,
            members: members.iter().map(|member| member.id).collect(),
            obstacles: obstacles.map(|(id, known)| SensedShape { shape: known.shape, id, reserved: 0 }).collect(),
            drones: self.rollout_drones(now, params.step_s()),
            alternatives,
            interim,
        };
        self.rollout = Some(Box::new(Rollout::new(params, input)));
        self.leading.adopt(now, first);
    }

    /// All drones that this leader knows to live, to be stepped every `step_s`.
    fn rollout_drones(&self, now: SimTime, step_s: f64) -> Vec<RolloutDrone<Self>> {
        let ledger = self.leading.united_ledger(now);
        let living = self.leading.living();
        let drone = |member: &Member| RolloutDrone {
            pilot: self.rollout_pilot(member.id, now, step_s, &ledger),
            position: member.position,
            velocity: member.velocity,
        };
        living.iter().map(drone).collect()
    }

    /// The pilot of a drone as this leader knows it, to be stepped every `dt_s`.
    fn rollout_pilot(&self, me: DroneId, now: SimTime, dt_s: f64, ledger: &Ledger) -> Self {
        let mut params = PilotParams { me, start: now, dt_s, ..self.params.clone() };
        params.safety.dt_s = dt_s;
        params.beacon_period_s = dt_s.max(self.params.beacon_period_s);
        // A simulated leader does not look ahead itself.
        params.planner.strategy = Strategy::PaperRule;
        // Simulated drones sense each other, and without error.
        params.apart_by_words = false;
        params.sensing = SensingErrors::default();
        let leading = self.leading.rollout_member(&params.leading(), now, ledger.of_member(me));
        Self { late_from: u64::MAX, ..Self::with_leading(params, leading) }
    }

    /// Takes the shortest route past an obstacle that is in the danger zone and that no plan covers.
    fn emergency_avoidance(&mut self, senses: &Senses<'_>) {
        // While the formation closes, the path to the slot leads round obstacles anyway.
        if self.leading.obeyed().is_some_and(|bundle| bundle.plan.phase() == Phase::Reform) {
            self.route.drop_emergency();
            return;
        }
        let Some(id) = self.urgent_obstacle(senses) else { return };
        let obstacles = self.leading.obstacles();
        let Some(set) = obstacles.sets().iter().find(|set| set.contains(&id)) else { return };
        if self.route.emergency_set() == Some(set_tag(set)) {
            return;
        }
        let Some(shapes) = obstacles.shapes(set) else { return };
        let planner = &self.params.planner;
        let routes = Routes::new(&shapes, &planner.routes);
        let flight = Flight { speed_mps: self.params.guidance.speed_mps, course_y_m: planner.course_y_m };
        if let Some(route) = EmergencyRoute::shortest(set, routes, senses.position(), &flight) {
            self.route.set_emergency(route);
        }
    }

    /// Of the obstacles in the danger zone that this drone has neither passed nor an assignment for: the one with the
    /// least time to impact.
    fn urgent_obstacle(&self, senses: &Senses<'_>) -> Option<ObstacleId> {
        let (me, clearance_m) = (self.params.me, self.params.safety.clearance_m);
        let detect = |o| self.params.braking.detect(senses.position(), senses.velocity(), o, clearance_m);
        let near = senses.obstacles.iter().filter_map(|o| Some((detect(o), senses.shape(o)?.id)));
        let planned = |id| self.leading.planned_sets().iter().any(|s| s.ids.contains(&id) && s.parts.contains(me));
        let past = |id| self.leading.obstacles().has_passed(me, id);
        let urgent = near.filter(|(detection, id)| detection.danger && !planned(*id) && !past(*id));
        let sooner = |a: &(Detection, _), b: &(Detection, _)| a.0.time_to_impact_s.total_cmp(&b.0.time_to_impact_s);
        urgent.min_by(sooner).map(|(_, id)| id)
    }

    /// The velocity to fly if no other drone were near, m/s. `now`: the present time. `senses`: predicted for the moment at which the command
    /// takes effect; at that time, drones that are heard would seem silent. `open`: the places in the queues of the sets still to leave.
    fn wanted_velocity(&mut self, now: SimTime, senses: &Senses<'_>, open: &[QueuePlace; MAX_PLACES]) -> Vec2 {
        let guidance = self.params.guidance;
        if self.route.is_blocked() {
            return Vec2::new(-BACK_OUT_SPEED * guidance.speed_mps, 0.0);
        }
        if let Some(steering) = self.route.steering(senses.position()) {
            let direction = self.detour(senses, steering.total_m).unwrap_or(steering.direction);
            return direction * self.queue_speed_mps(now, open);
        }
        let (shape, spacing_m) = (&self.params.planner.shape, self.params.planner.spacing_m);
        let is_apart = |plan: &Plan| plan.phase() == Phase::Avoid || plan.group != GroupId::ALL;
        let apart = self.leading.obeyed().filter(|bundle| is_apart(&bundle.plan));
        let own =
            OwnPlan { unfollowed: self.leading.is_unfollowed(now), apart_since: apart.map(|bundle| bundle.plan.stamp) };
        if let Some((slot, velocity)) = self.straggler.slot(senses.now, own, shape, spacing_m) {
            return self.velocity_to_slot(senses, slot, velocity);
        }
        let stale = self.stale_formation.is_stale(now, self.leading.obeyed(), self.leading.term());
        match (self.leading.obeyed(), self.leading.part()) {
            (Some(bundle), Some(part)) if bundle.plan.phase() != Phase::Avoid && !stale => {
                let (anchor, velocity) = anchor(&bundle.plan, senses.now);
                self.velocity_to_slot(senses, anchor + Vec2::from(part.slot_m), velocity)
            }
            _ => self.lone_velocity(now, senses.position()),
        }
    }

    /// The velocity of a drone that has nothing left to pass and no formation to join, m/s.
    fn lone_velocity(&mut self, now: SimTime, position: Vec2) -> Vec2 {
        // How far away the farthest drone is that it hears says nothing of its reach once it hears only near ones.
        let range_m = Some(self.params.planner.radio_range_m).filter(|range_m| range_m.is_finite());
        let reach_m = self.leading.reach_m().map(|heard_m| range_m.unwrap_or(heard_m));
        let others = lone_flight::Others { peers: self.leading.peers(), reach_m, by_words: self.separations.is_some() };
        let exits = self.leading.planned_sets().iter().map(|set| set.routes.exit_x_m());
        let passed_x_m = exits.filter(|exit_x_m| *exit_x_m <= position.x).fold(f64::NEG_INFINITY, f64::max);
        let speed_mps = self.lone_flight.speed_mps(now, position, passed_x_m, &others, &self.params.guidance);
        match self.separations {
            Some(_) => self.lone_flight.direction(now, position, self.params.planner.spacing_m) * speed_mps,
            None => Vec2::new(speed_mps, 0.0),
        }
    }

    /// The direction of the shortest path to the end of the planned route, if a known obstacle blocks the route. If only the way to where
    /// the route first turns is blocked, and the way round is short, the direction of that way: a drone beside a wall flies along it to
    /// its own route, and not round the wall's other end. `route_m`: length of the planned route that is left. A detour that was begun is
    /// kept while it is shorter than that and the route does not keep the planning distance.
    fn detour(&mut self, senses: &Senses<'_>, route_m: f64) -> Option<Vec2> {
        let period = ((ROUTE_CHECK_S / self.params.dt_s) as u64).max(1);
        if self.update_map() || senses.tick.is_multiple_of(period) {
            let (route, navigator, position) = (&self.route, &self.navigator, senses.position());
            let turn = route.turn_if_blocked(position, |a, b| navigator.is_free(a, b));
            self.turn = turn.filter(|turn| navigator.is_short_way(position, *turn));
            let blocked = route.end_if_blocked(position, |a, b| navigator.is_free(a, b)).is_some();
            let view = route.end().map(|end| RouteView { end, route_m, blocked: blocked && self.turn.is_none() });
            let shorter = || navigator.left_m(position).is_some_and(|left_m| left_m < route_m);
            let near = || route.end_if_blocked(position, |a, b| navigator.is_clear(a, b)).is_some();
            self.detour.look(view, self.params.safety.clearance_m, || shorter() && near());
        }
        let target = self.detour.to().or(self.turn)?;
        let next = match self.navigator.head(senses.tick, senses.position(), target) {
            Heading::Straight => target,
            Heading::Via(corner) => corner,
            Heading::NoPath => return None,
        };
        (next - senses.position()).try_normalize(1e-9)
    }

    /// The velocity that takes the drone to a slot, round whatever is in the way, m/s.
    fn velocity_to_slot(&mut self, senses: &Senses<'_>, slot: Vec2, slot_velocity: Vec2) -> Vec2 {
        self.update_map();
        let guidance = self.params.guidance;
        match self.navigator.head(senses.tick, senses.position(), slot) {
            Heading::Via(corner) => {
                let speed_mps = guidance.speed_mps.max(slot_velocity.norm()).min(guidance.reform_speed_max_mps);
                (corner - senses.position()).try_normalize(1e-9).unwrap_or_default() * speed_mps
            }
            Heading::Straight | Heading::NoPath => guidance.to_slot(slot - senses.position(), slot_velocity),
        }
    }

    /// Gives the navigator the obstacles that are known by now; true if there are new ones.
    fn update_map(&mut self) -> bool {
        let known = self.leading.obstacles();
        // On the way to a slot there are many drones, and each would fly another way round a dead one.
        let passing = self.route.is_passing();
        let bodies = passing.then(|| self.silent.hanging(HANGING_RADIUS * self.params.safety.safe_distance_m));
        let bodies = bodies.unwrap_or_default();
        self.navigator.learn(known.changes(), known.iter().map(|(_, known)| &known.shape), &bodies)
    }

    /// A drone that cannot move would hold up the queue if it stayed first.
    fn give_up_first_place(&mut self, now: SimTime, open: &[QueuePlace; MAX_PLACES]) {
        let first = self.route.queues(open).into_iter().find(|place| place.set != 0);
        if first.is_some_and(|place| self.queue.is_first(place, self.leading.peers(), now)) {
            self.route.give_up_place();
        }
    }

    fn queue_speed_mps(&mut self, now: SimTime, open: &[QueuePlace; MAX_PLACES]) -> f64 {
        let nominal_mps = self.params.guidance.speed_mps;
        if !self.params.queue {
            return nominal_mps;
        }
        let queues = self.route.queues(open);
        let places = queues.iter().copied().filter(|place| place.set != 0);
        let peers = self.leading.peers();
        let params = |place: QueuePlace| self.params.queueing(self.route.leads_between(place), peers.delay_s());
        self.queue.speed_mps(places, peers, now, params).min(nominal_mps)
    }

    /// The safe acceleration nearest to the one that leads to the wanted velocity, m/s².
    fn safe_acceleration(
        &mut self,
        wanted: Vec2,
        now: &Senses<'_>,
        senses: &Senses<'_>,
        neighbours: &[Neighbour],
    ) -> Vec2 {
        let gain = self.params.velocity_gain_per_s;
        let error_m = self.obstacle_error_m(senses);
        let obstacles = senses
            .obstacles
            .iter()
            .map(|o| NearObstacle { nearest_m: o.nearest() - senses.position(), distance_m: o.distance_m })
            .chain(remembered(&self.leading, senses).map(|(_, near)| near))
            .map(|near| near.nearer_by(error_m));
        // Drones that keep apart by words keep to the lines between them instead of fleeing from where an old beacon was.
        let words = self.separations.as_deref();
        let by_words = |n: &Neighbour| !n.sensed && words.is_some_and(|lines| lines.has_agreed(n.id));
        let neighbours = neighbours.iter().copied().filter(|n| !self.params.apart_by_words && !by_words(n));
        let wanted = (wanted - senses.velocity()) * gain;
        let smooth = self.safety.filter(wanted, senses.velocity(), obstacles, neighbours);
        self.keep_braking_path(smooth, now, senses)
    }

    /// Whether the drone senses no obstacles, and no other one may report them: it hears none whose sensors work. What it remembers of an
    /// outline may also be a part of it.
    fn flies_blind(&self, senses: &Senses<'_>) -> bool {
        senses.broken.obstacles && (self.params.sensing.partial_outlines || !self.is_guided(senses.now))
    }

    /// Whether it hears a drone whose sensors work.
    fn is_guided(&self, now: SimTime) -> bool {
        let peers = self.leading.peers();
        let oldest = now.after(-GUIDE_S - peers.delay_s());
        peers.living(now).any(|(_, pose)| !pose.is_impaired() && pose.stamp() >= oldest)
    }

    /// How far the outlines that the drone keeps clear of may be displaced, m.
    fn obstacle_error_m(&self, senses: &Senses<'_>) -> f64 {
        let sensing = &self.params.sensing;
        if senses.broken.obstacles { sensing.remembered_obstacle_m() } else { sensing.obstacle_m }
    }

    /// [`PilotParams::speed_on_sight_mps`], computed anew only if the lag has changed.
    fn speed_on_sight_mps(&mut self, lag: u32) -> f64 {
        match self.on_sight_mps {
            Some((of, speed_mps)) if of == lag => speed_mps,
            _ => {
                let speed_mps = self.params.speed_on_sight_mps(lag);
                self.on_sight_mps = Some((lag, speed_mps));
                speed_mps
            }
        }
    }

    /// The acceleration nearest to `wanted` that the safety rule allows, m/s².
    /// `now`: what is sensed; `then`: the same, predicted for the moment at which the command takes effect.
    fn keep_braking_path(&mut self, wanted: Vec2, now: &Senses<'_>, then: &Senses<'_>) -> Vec2 {
        let lag = self.reaction.ticks() as u32;
        let own = OwnMotion {
            tick: now.tick,
            now: now.now,
            sensed_position: now.position(),
            sensed_velocity: now.velocity(),
            position: then.position(),
            velocity: then.velocity(),
            speed_limit_mps: self.speed_on_sight_mps(lag),
            lag,
        };
        let remembered = remembered(&self.leading, then).map(|(shape, near)| (shape, near.distance_m));
        let sensed = then.obstacles.iter().filter_map(|o| Some((&then.shape(o)?.shape, o.distance_m)));
        let obstacles = sensed.chain(remembered);
        let separations = self.separations.as_deref();
        let ranged = if self.params.apart_by_words { &[] } else { now.neighbours };
        // A drone that commands late and ranges cannot follow one that keeps to a line by words.
        let by_words = |drone| lag > 0 && separations.is_some_and(|lines| lines.has_agreed(drone));
        let neighbours = ranged.iter().filter(|n| !by_words(n.drone)).map(|n| Moving {
            id: n.drone,
            position_m: n.position(),
            velocity_mps: n.velocity() + now.velocity(),
        });
        let by_words_alone = self.params.apart_by_words || now.broken.ranging;
        let alone = by_words_alone && separations.is_some_and(|lines| !lines.has_agreed_with_all());
        let hovers = alone || self.flies_blind(now);
        let wanted = if hovers { self.braking_filter.params().law().braking(then.velocity()) } else { wanted };
        let error_m = self.obstacle_error_m(now);
        self.braking_filter.set_obstacle_error_m(error_m);
        match separations {
            Some(separations) => self.braking_filter.filter(&own, wanted, obstacles, neighbours, separations.lines()),
            None => self.braking_filter.filter(&own, wanted, obstacles, neighbours, iter::empty()),
        }
    }

    /// The acceleration to command now, m/s², computed for the moment at which it takes effect.
    fn steer(&mut self, senses: &Senses<'_>, open: &[QueuePlace; MAX_PLACES]) -> Vec2 {
        let mut predictor = StatePredictor::default();
        let delay_s = self.reaction.delay_s();
        let (predicted, mut present);
        // Whether others are heard depends on the present time.
        let (then, seen) = if delay_s > 0.0 {
            predictor.predict(senses, delay_s, self.reaction.pending_motion(senses.velocity()));
            predicted = predictor.predicted(senses);
            present = predicted;
            present.now = senses.now;
            (&predicted, &present)
        } else {
            (senses, senses)
        };
        let wanted = match self.lost_place(seen) {
            Some(place) => self.velocity_to_slot(then, place, Vec2::zeros()),
            None => self.unstuck_velocity(senses.now, then, open),
        };
        let peers = self.leading.peers();
        let view = NeighbourView { now: senses.now, senses: then, peers, obeyed: self.leading.stamp(), places: open };
        let mut neighbours = Few::new();
        self.neighbours.update(&view, &mut neighbours);
        self.safe_acceleration(wanted, senses, then, &neighbours)
    }

    /// Where the drone looks for another one that it has lost, world frame, m.
    fn lost_place(&mut self, senses: &Senses<'_>) -> Option<Vec2> {
        let by_words = self.separations.is_some();
        if self.route.is_passing() && !by_words {
            self.reunion.rest();
        }
        let starts_m: &[Vec2] = if self.params.apart_by_words { &self.params.starts_m } else { &[] };
        let braking_mps2 = self.params.guidance.braking_mps2;
        let (me, range_m) = (self.params.me, self.params.planner.radio_range_m);
        let others = Others { me, peers: self.leading.peers(), starts_m, braking_mps2, range_m, by_words };
        self.reunion.place(senses, &others)
    }

    /// The velocity to fly if no other drone were near, or if the drone is stuck, the one by which it escapes, m/s. `then`: the senses,
    /// predicted for the moment at which the command takes effect.
    fn unstuck_velocity(&mut self, now: SimTime, then: &Senses<'_>, open: &[QueuePlace; MAX_PLACES]) -> Vec2 {
        let wanted = self.wanted_velocity(now, then, open);
        let nominal_mps = self.params.guidance.speed_mps;
        let slow_mps = (nominal_mps - self.params.guidance.speed_change_mps).max(LEAST_ESCAPE_SPEED * nominal_mps);
        let patience_s = if self.route.is_passing() { PATIENCE_ON_ROUTE_S } else { PATIENCE_IN_FORMATION_S };
        let attempts = self.escape.attempts();
        let by_words = self.params.apart_by_words;
        let course = Course { now: then.now, position: then.position(), velocity: then.velocity(), by_words, wanted };
        let wanted = self.escape.steer(&course, patience_s, slow_mps, self.params.safety.scale);
        if self.escape.attempts() > attempts {
            self.give_up_first_place(now, open);
        }
        wanted
    }

    /// The path of this drone with the commands that it has given and full braking after them.
    fn own_path(&self, senses: &Senses<'_>) -> OwnPath {
        let (position, velocity) = (senses.position(), senses.velocity());
        let pending = self.reaction.pending_motions(velocity).map(|motion| position + motion.offset);
        let given = iter::once(position).chain(pending).collect();
        let velocity = self.reaction.pending_motion(velocity).velocity;
        let filter = self.braking_filter.params();
        let path = OwnPath::new((senses.tick, senses.now), given, velocity, filter.law(), filter.stride());
        path.with_clock_error(self.params.sensing.clock_s)
    }

    /// After ticks without a step, the first ones included, and after a restart, the drone has been braked by its failsafe. Its pending
    /// commands are void.
    fn brake_after_a_gap(&mut self, senses: &Senses<'_>) {
        let missed = match self.stepped.replace(senses.tick) {
            Some(before) => senses.tick > before + 1,
            None => senses.tick >= self.late_from,
        };
        if missed {
            self.reaction.brake(senses.tick, senses.velocity(), self.braking_filter.params().law());
            self.braking_filter.forget();
        }
    }

    /// A drone that cannot range the others, and one that such a drone speaks to, keep apart by lines from now on.
    fn open_words(&mut self, senses: &Senses<'_>, inbox: &Inbox<'_>) {
        if self.params.apart_by_words || self.params.drones < 2 {
            return;
        }
        let me = self.params.me;
        let spoken_to = |message: MessageRef<'_>| match message {
            MessageRef::Separation(lines) => lines.separators().iter().any(|line| line.peer == me),
            _ => false,
        };
        let blind = senses.broken.ranging;
        if blind || (self.separations.is_none() && inbox.heard().iter().any(|heard| spoken_to(heard.message))) {
            let params = &self.params;
            let unbound = || Box::new(Separations::unbound(params.separation(), senses.now));
            let separations = self.separations.get_or_insert_with(unbound);
            if blind {
                separations.open_all();
            }
        }
    }

    fn hear_separation(&mut self, source: DroneId, message: MessageRef<'_>, path: Option<&OwnPath>) {
        let (Some(separations), Some(path)) = (&mut self.separations, path) else { return };
        match message {
            MessageRef::Separation(lines) => separations.hear(source, lines, self.leading.peers(), path),
            MessageRef::Pose(pose) => separations.hear_incarnation(source, pose.incarnation),
            _ => {}
        }
    }

    /// `senses`: neighbours that the drone ranges are better known than by their beacons.
    fn speak_separation(&mut self, senses: &Senses<'_>, path: Option<&OwnPath>, say: &mut Vec<Message>) {
        if let (Some(separations), Some(path)) = (&mut self.separations, path) {
            for seen in senses.neighbours {
                let position = senses.position() + seen.position();
                separations.see(seen.drone, Sighting { position, velocity: senses.velocity() + seen.velocity() });
            }
            separations.set_reach(self.leading.reach_m());
            separations.speak(self.leading.peers(), path, say);
        }
    }

    fn command(&self, acceleration_mps2: [f64; 3], open: &[QueuePlace; MAX_PLACES]) -> Command {
        let first = open.iter().find(|place| place.set != 0);
        Command::acceleration(acceleration_mps2).with_status(Status {
            obeyed: self.leading.stamp(),
            part_hash: self.leading.part_hash(),
            group: self.leading.group(),
            leads: self.leading.is_leader().then(|| self.leading.scope()),
            term: self.leading.term(),
            phase: self.leading.obeyed().map_or(Phase::Cruise, |bundle| bundle.plan.phase()),
            place: first.map(|place| (place.route, place.rank)),
        })
    }

    /// Begins a step, on the senses at the altitude that it keeps.
    fn begin(&mut self, senses: &Senses<'_>, inbox: &Inbox<'_>, say: &mut Vec<Message>) -> BegunStep {
        let levelled = self.altitude.look(senses);
        if levelled {
            let altitude = self.altitude.clone();
            self.begin_level(&altitude.level(senses), inbox, say);
        } else {
            self.begin_level(senses, inbox, say);
        }
        BegunStep { tick: senses.tick, levelled }
    }

    /// Begins a step on senses that hold no obstacles but those in the way: hears, leads, and looks where it is on its route.
    fn begin_level(&mut self, senses: &Senses<'_>, inbox: &Inbox<'_>, say: &mut Vec<Message>) {
        self.params.braking.reaction_time_s = self.reaction.set_extra(senses.extra_reaction_s);
        self.safety.set_reaction_time(self.reaction.delay_s());
        self.brake_after_a_gap(senses);
        self.open_words(senses, inbox);
        let path = self.separations.as_ref().map(|_| self.own_path(senses));
        self.leading.expect(inbox.heard().iter().map(|heard| (heard.source, heard.message)));
        for &Heard { source, message } in inbox.heard() {
            let restamped = self.clocks.restamp(senses.now, source, message);
            let message = restamped.as_ref().map_or(message, Restamped::message);
            self.hear_separation(source, message, path.as_ref());
            if matches!(message, MessageRef::Obstacle(obstacle) if !self.altitude.is_blocked_by(&obstacle.shape)) {
                continue;
            }
            self.leading.hear(senses.now, source, message, say);
            self.straggler.hear(self.params.drones, message);
        }
        if self.leading.peers().is_large() {
            self.neighbours.warm(self.leading.peers());
            self.safety.warm();
        }
        self.leading.set_impaired(senses.broken.any());
        self.sense(senses);
        let safety = self.params.safety;
        self.silent.update(senses, self.leading.peers());
        self.lead(senses, &own_state(senses), say);
        self.emergency_avoidance(senses);
        let bodies = self.silent.bodies(SILENT_DRONE_RADIUS * safety.safe_distance_m);
        self.route.update(self.leading.ledger(), senses.position(), &bodies);
        self.leading.note_passed(senses.position());
        self.speak_separation(senses, path.as_ref(), say);
    }

    /// Ends a step on the same senses: steers, and says where it is.
    fn end_level(&mut self, senses: &Senses<'_>, say: &mut Vec<Message>) -> Command {
        let places = self.route.places(senses.position());
        let open = self.route.open_places(places);
        let safe = self.steer(senses, &open);
        let acceleration = self.reaction.push(safe);
        let limit_mps2 = self.params.safety.acceleration_max_mps2;
        let climb_mps2 = self.altitude.climb_mps2(senses, acceleration, limit_mps2);
        let command = self.command(raised(acceleration, climb_mps2), &open);
        self.leading.speak(senses.now, &own_state(senses), &places, say);
        command
    }
}

/// What the first half of a step leaves to the second one.
#[derive(Clone, Copy, Debug)]
struct BegunStep {
    tick: u64,
    /// Whether obstacles above and below were left out, or flattened.
    levelled: bool,
}

/// What a drone knows of itself.
fn own_state(senses: &Senses<'_>) -> OwnState {
    OwnState {
        tick: senses.tick,
        position: senses.position(),
        velocity: senses.velocity(),
        altitude_m: senses.position_m[2],
        climb_mps: senses.velocity_mps[2],
    }
}

/// The obstacles that a drone with a broken obstacle sensor knows from before or from others.
fn remembered<'a>(
    leading: &'a Leading,
    senses: &Senses<'_>,
) -> impl Iterator<Item = (&'a ConvexShape, NearObstacle)> + Clone {
    let position = senses.position();
    let known = senses.broken.obstacles.then(|| leading.obstacles().iter());
    let shapes = known.into_iter().flatten().map(|(_, known)| &known.shape);
    shapes.map(move |shape| (shape, NearObstacle::seen_from(position, shape)))
}

impl Pilot for SwarmPilot {
    fn begin_step(&mut self, senses: &Senses<'_>, inbox: &Inbox<'_>, out: &mut Out) {
        self.begun = Some(self.begin(senses, inbox, out.messages_mut()));
    }

    fn step(&mut self, senses: &Senses<'_>, inbox: &Inbox<'_>, out: &mut Out) -> Command {
        let say = out.messages_mut();
        let begun = self.begun.take().filter(|begun| begun.tick == senses.tick);
        let begun = begun.unwrap_or_else(|| self.begin(senses, inbox, say));
        if begun.levelled {
            let altitude = self.altitude.clone();
            return self.end_level(&altitude.level(senses), say);
        }
        self.end_level(senses, say)
    }

    fn pose_ages_s(&self, now: SimTime, ages: &mut Vec<f64>) {
        ages.clear();
        let first = Digest::chain(u64::from(self.params.me.0), now.0 as u64);
        self.leading.peers().ages_s(now, first, ages);
    }
}

impl RolloutPilot for SwarmPilot {
    fn id(&self) -> DroneId {
        self.params.me
    }

    fn obey(&mut self, now: SimTime, bundle: PlanBundle) {
        self.leading.obey(now, bundle);
    }

    fn stamp(&self) -> PlanStamp {
        self.leading.stamp()
    }

    fn newest_stamp(&self) -> PlanStamp {
        self.leading.newest_stamp()
    }

    fn plan(&self) -> Option<&Plan> {
        self.leading.obeyed().map(|bundle| &bundle.plan)
    }

    fn part_past(&self, set: u32) -> Option<Assignment> {
        let planned = self.leading.planned_sets().iter().find(|planned| planned.tag == set)?;
        let &SetPlace { drone, group, route, rank } = planned.parts.get(self.params.me)?;
        let slot_m = self.leading.part().map_or([0.0; 2], |part| part.slot_m);
        Some(Assignment {
            id: planned.stamp,
            scope: planned.scope,
            group,
            drone,
            leader: DroneId::NONE,
            slot_m,
            route,
            rank,
            ..Assignment::zeroed()
        })
    }

    fn own_part(&self, plan: &Plan, position: Vec2) -> Assignment {
        let (drone, ids) = (self.params.me, set_ids(&plan.set, plan.set_count));
        let planner = &self.params.planner;
        let shortest_of = |shapes: Vec<_>| {
            let flight = Flight { speed_mps: self.params.guidance.speed_mps, course_y_m: planner.course_y_m };
            shortest(&trips(&[], &Routes::new(&shapes, &planner.routes), position, &flight)) as u16
        };
        let route = || self.leading.obstacles().shapes(ids).map_or(0, shortest_of);
        let new = || Assignment { drone, leader: DroneId::NONE, route: route(), ..Assignment::zeroed() };
        self.part_past(set_tag(ids)).unwrap_or_else(new)
    }

    fn slot(&self) -> Option<Vec2> {
        self.leading.part().map(|part| Vec2::from(part.slot_m))
    }

    fn last_gate_x_m(&self) -> f64 {
        let gates = self.leading.planned_sets().iter().map(|set| set.routes.gate_x_m());
        gates.fold(f64::NEG_INFINITY, f64::max)
    }
}
