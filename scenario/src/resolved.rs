//! What a scenario can do: it is parsed from text, and gives the values that follow from its keys.

use crate::error::ScenarioErrors;
use crate::fault_bounds;
use crate::faults::FaultKind;
use crate::hosts::HostKeys;
use crate::keys::{End, FormationShape, Scenario};
use crate::parse::{self, ScenarioSource};
use crate::passage::Barrier;
use crate::pilots::DEFAULT_PILOT;
use crate::radio;
use skein_protocol::formation::Shape;
use skein_protocol::payload::{Pose, Separation};
use skein_protocol::radio::{HEAD_BYTES, Radio, SharedChannel};
use skein_protocol::shape::{ConvexShape, ShapeError};
use skein_protocol::{Course, Vec2};

/// Gravity as in the paper, m/s².
const GRAVITY_MPS2: f64 = 9.81;

/// What a passable gap leaves on either side, beyond the distance that drones keep from obstacles, m. The safety rule keeps 1 mm of it for
/// rounding errors, and a drone that flies through the middle deviates by less than the rest.
const GAP_ROOM_M: f64 = 0.004;
/// Default of `time.timeout_s` for a small swarm, s.
const TIMEOUT_S: f64 = 600.0;
/// Longest default of `time.timeout_s`, s: the greatest value of that key.
const TIMEOUT_MAX_S: f64 = 36_000.0;
/// The default of `time.timeout_s` is at least this many times the duration of a smooth flight. Chosen by hand: the way round walls and out of dead
/// ends is longer than the straight way, and drones wait for each other.
const TIMEOUT_FACTOR: f64 = 5.0;
/// Default of `formation.altitude_m`, m.
const ALTITUDE_M: f64 = 50.0;
/// Default of `protocol.beacon_period_s` where bandwidth is no limit, s.
const BEACON_PERIOD_S: f64 = 0.1;
/// Greatest share of the bandwidth that the beacons of all drones take by default.
const BEACON_SHARE: f64 = 0.25;
/// Longest time between two statements of separating lines, s.
const SEPARATION_PERIOD_MAX_S: f64 = 2.0;

impl Scenario {
    /// A checked scenario from TOML. `overrides` are key paths and values as in `--set obstacle.0.centre_m=[1,2]`. They
    /// are applied in their order before anything is checked. A value that is not valid TOML is taken as a string.
    ///
    /// # Errors
    /// [`ScenarioErrors`], each with its place. TOML syntax is checked first, then keys, types and ranges, then rules
    /// between keys. Only the errors of the first step that fails are given.
    pub fn parse(
        text: &str,
        source: ScenarioSource<'_>,
        overrides: &[(String, String)],
    ) -> Result<Self, ScenarioErrors> {
        parse::parse(text, source, overrides)
    }

    /// As [`Scenario::parse`], from bytes that may not be UTF-8.
    ///
    /// # Errors
    /// As [`Scenario::parse`]. If the bytes are not UTF-8, the only error is the place of the first invalid byte.
    pub fn parse_bytes(
        bytes: &[u8],
        source: ScenarioSource<'_>,
        overrides: &[(String, String)],
    ) -> Result<Self, ScenarioErrors> {
        parse::parse_bytes(bytes, source, overrides)
    }

    /// A checked scenario from the JSON that serde makes of one, such as the JSON in a run's manifest.
    ///
    /// # Errors
    /// As [`Scenario::parse`]. JSON has no places, so every error is at 1:1.
    pub fn from_json(json: &serde_json::Value, source: ScenarioSource<'_>) -> Result<Self, ScenarioErrors> {
        parse::from_json(json, source)
    }

    /// The error of a valid scenario with which something else is wrong, such as a parameter that its pilot refuses. It is placed
    /// at the first of `keys` that the text or the overrides write. `text` and `overrides` are those of [`Scenario::parse`].
    #[must_use]
    pub fn blame(
        text: &str,
        source: ScenarioSource<'_>,
        overrides: &[(String, String)],
        keys: &[String],
        message: &str,
    ) -> ScenarioErrors {
        parse::blame(text, source, overrides, keys, message)
    }

    /// The table of `[[pilot]]` that flies each drone, by its number; `None`: the built-in pilot `paper`.
    #[must_use]
    pub fn pilot_tables(&self) -> Vec<Option<usize>> {
        let rest = self.pilots.iter().position(|pilot| pilot.drones.is_none());
        let mut tables = vec![rest; self.formation.drones as usize];
        for (number, pilot) in self.pilots.iter().enumerate() {
            for &drone in pilot.drones.iter().flatten() {
                if let Some(table) = tables.get_mut(drone as usize) {
                    *table = Some(number);
                }
            }
        }
        tables
    }

    /// The name of each drone's host, by the drone's number; `None`: the launcher's machine.
    #[must_use]
    pub fn hosts_of_drones(&self) -> Vec<Option<String>> {
        let named = |host: &HostKeys| std::iter::repeat_n(Some(host.name.clone()), host.drones as usize);
        let mut hosts: Vec<_> = self.hosts.iter().flat_map(named).collect();
        hosts.resize(self.formation.drones as usize, None);
        hosts
    }

    /// The name of the pilot that flies each drone, by its number.
    #[must_use]
    pub fn pilot_names(&self) -> Vec<String> {
        let name = |table: Option<usize>| table.map_or(DEFAULT_PILOT, |table| self.pilots[table].shown_name());
        self.pilot_tables().into_iter().map(|table| name(table).to_owned()).collect()
    }

    /// The shape of the formation.
    #[must_use]
    pub fn formation_shape(&self) -> Shape {
        match (&self.formation.offsets_m, self.formation.shape) {
            (Some(offsets), _) => Shape::Offsets(offsets.clone()),
            (None, Some(FormationShape::NestedV) | None) => Shape::NestedV,
            (None, Some(FormationShape::V)) => Shape::V,
            (None, Some(FormationShape::Line)) => Shape::Line,
            (None, Some(FormationShape::Column)) => Shape::Column,
            (None, Some(FormationShape::Grid)) => Shape::Grid,
            (None, Some(FormationShape::Circle)) => Shape::Circle,
            (None, Some(FormationShape::Wedge)) => Shape::Wedge,
        }
    }

    /// The direction in which the mission flies: along the axis nearest to the way from the start to the goal, or along +x without a goal.
    #[must_use]
    pub fn course(&self) -> Course {
        let goal = self.mission.goal_m.filter(|_| self.mission.end == End::Goal);
        goal.map_or(Course::East, |goal| Course::along_way(Vec2::from(goal) - Vec2::from(self.formation.start_m)))
    }

    /// The slots of the formation relative to its anchor, front slot first, axes of the world frame, m. The formation faces along the course.
    #[must_use]
    pub fn slots(&self) -> Vec<Vec2> {
        let slots = self.formation_shape().slots(self.formation.drones as usize, self.formation.spacing_m);
        slots.into_iter().map(|slot| self.course().to_world(slot)).collect()
    }

    /// The start position of each drone, world frame, m: its slot plus a jitter that depends on the seed, the drone and the course
    /// only.
    #[must_use]
    pub fn starts(&self) -> Vec<Vec2> {
        let start = Vec2::from(self.formation.start_m);
        let jitter = |drone: usize| in_unit_disc(self.seed, drone as u64) * self.formation.start_jitter_m;
        let place = |(drone, slot)| start + slot + self.course().to_world(jitter(drone));
        self.slots().into_iter().enumerate().map(place).collect()
    }

    /// The height above the ground at which the formation starts, m: `formation.altitude_m`; or 50 m, or
    /// `avoidance.clearance_m` if that is more.
    #[must_use]
    pub fn altitude_m(&self) -> f64 {
        self.formation.altitude_m.unwrap_or(ALTITUDE_M.max(self.avoidance.clearance_m))
    }

    /// The shapes of the obstacles, world frame, m, in their order.
    ///
    /// # Errors
    /// [`ShapeError`] if an obstacle has an invalid shape. A scenario from [`Scenario::parse`] or [`Scenario::from_json`]
    /// has none.
    pub fn shapes(&self) -> Result<Vec<ConvexShape>, ShapeError> {
        self.obstacles.iter().map(crate::Obstacle::shape).collect()
    }

    /// The obstacles that are in the way of a flight at the formation's altitude, with their numbers: all but those whose floor
    /// or top is at least `avoidance.planning_distance_m` away from it.
    ///
    /// # Errors
    /// [`ShapeError`], as for [`Self::shapes`].
    pub fn shapes_in_the_way(&self) -> Result<Vec<(u32, ConvexShape)>, ShapeError> {
        let (altitude_m, margin_m) = (self.altitude_m(), self.avoidance.planning_distance_m);
        let shapes = (0..).zip(self.shapes()?);
        Ok(shapes.filter(|(_, shape)| shape.blocks(altitude_m, margin_m)).collect())
    }

    /// Deceleration of a drone that brakes fully, m/s²: g·c_d of the paper's E3, at most the drone's greatest acceleration.
    #[must_use]
    pub fn braking_mps2(&self) -> f64 {
        (GRAVITY_MPS2 * self.drone.drag_coefficient).min(self.drone.acceleration_max_mps2)
    }

    /// The stopping distance at nominal speed, m: the paper's E2 = E4 + E3 = v·t_c + v²/(2 g c_d), with
    /// [`Self::braking_mps2`] for g·c_d.
    #[must_use]
    pub fn stopping_distance_m(&self) -> f64 {
        let drone = &self.drone;
        drone.speed_mps * drone.reaction_time_s + drone.speed_mps.powi(2) / (2.0 * self.braking_mps2())
    }

    /// Greatest speed while re-forming, m/s: `mission.reform_speed_max_mps`; or the paper's v + δ, the nominal speed plus
    /// the greatest change of it, or the top speed if that is less.
    #[must_use]
    pub fn reform_speed_max_mps(&self) -> f64 {
        let drone = &self.drone;
        let changed_mps = drone.speed_mps + drone.speed_change_mps;
        self.mission.reform_speed_max_mps.unwrap_or(changed_mps.min(drone.speed_max_mps))
    }

    /// Greatest distance at which drones sense neighbours, m: `sensors.ranging_m`; or enough for two drones that fly at each
    /// other at the greatest speed of the mission to stop at the safe distance, and at least twice that distance.
    #[must_use]
    pub fn ranging_m(&self) -> f64 {
        let drone = &self.drone;
        let top_mps = drone.speed_mps.max(self.reform_speed_max_mps());
        let late_m = 2.0 * top_mps * (drone.reaction_time_s + 2.0 * self.time.dt_s);
        let enough_m = 1.01 * drone.safe_distance_m + top_mps.powi(2) / self.braking_mps2() + late_m;
        self.sensors.ranging_m.unwrap_or(enough_m.max(2.0 * drone.safe_distance_m))
    }

    /// Whether drones keep their distances by messages: they have no sensor that ranges neighbours, or it is not ideal, or a fault
    /// makes it worse. A drone does not know when such a fault begins, so it flies this way from the start.
    #[must_use]
    pub fn apart_by_words(&self) -> bool {
        !self.sensors.ranges_enough() || self.fault_plan.iter().any(|fault| fault.kind == FaultKind::Ranging)
    }

    /// Greatest error of the position that a drone reads of itself, with which the safety rule counts, m.
    #[must_use]
    pub fn position_error_max_m(&self) -> f64 {
        let spread_m = self.sensors.position_spread_m();
        self.sensors.position_error_max_m.unwrap_or_else(|| spread_m + fault_bounds::gnss_m(self))
    }

    /// Greatest length of the position error that is no fault, m.
    #[must_use]
    pub fn position_noise_max_m(&self) -> f64 {
        let spread_m = self.sensors.position_spread_m();
        let bound_m = self.sensors.position_error_max_m.unwrap_or(spread_m);
        if self.fault_plan.iter().any(|fault| fault.kind == FaultKind::Gnss) { bound_m.min(spread_m) } else { bound_m }
    }

    /// Greatest error of the position that a drone can read of itself with all sensors and faults as the scenario has them, m. If it
    /// exceeds [`Self::position_error_max_m`], the margins do not cover it.
    #[must_use]
    pub fn position_error_possible_m(&self) -> f64 {
        let noise_m = if self.sensors.position_std_m > 0.0 { self.position_noise_max_m() } else { 0.0 };
        noise_m + fault_bounds::position_m(self)
    }

    /// Greatest difference between a drone's clock and the time of the mission up to the mission's time limit, with which the safety
    /// rule counts, s.
    #[must_use]
    pub fn clock_error_max_s(&self) -> f64 {
        self.sensors.clock_error_max_s.unwrap_or_else(|| self.clock_error_possible_s())
    }

    /// Greatest such difference with all clocks and faults as the scenario has them, s. If it exceeds [`Self::clock_error_max_s`],
    /// the margins do not cover it.
    #[must_use]
    pub fn clock_error_possible_s(&self) -> f64 {
        let own_s = self.sensors.clock_offset_max_s + self.sensors.clock_drift_max_ppm * 1e-6 * self.timeout_s();
        own_s + fault_bounds::clock_s(self)
    }

    /// Time between two beacons of a drone, s: `protocol.beacon_period_s`; or 0.1 s, or longer where the beacons of the drones that
    /// share a channel would take more than a quarter of the bandwidth.
    #[must_use]
    pub fn beacon_period_s(&self) -> f64 {
        let least_s = self.period_within_share_s(size_of::<Pose>());
        self.protocol.beacon_period_s.unwrap_or_else(|| least_s.clamp(BEACON_PERIOD_S, self.beacon_period_bound_s()))
    }

    /// No beacon period is longer than this, s, unless the scenario names one.
    fn beacon_period_bound_s(&self) -> f64 {
        BEACON_PERIOD_S.max(self.protocol.peer_timeout_s / 3.0)
    }

    /// What the beacons of all drones that share a channel in the formation take of its bandwidth, with the statements of their lines if
    /// words keep them apart, bit/s. `messages`: number of messages of one statement.
    #[must_use]
    pub fn beacons_bps(&self, messages: usize) -> f64 {
        let rate_bps = |bytes: usize, period_s: f64| 8.0 * (HEAD_BYTES as f64 + bytes as f64) / period_s;
        let statements_bps = || messages as f64 * rate_bps(size_of::<Separation>(), self.separation_period_s(messages));
        let words_bps = if self.apart_by_words() { statements_bps() } else { 0.0 };
        f64::from(self.channel_drones()) * (rate_bps(size_of::<Pose>(), self.beacon_period_s()) + words_bps)
    }

    /// Longest time between two beacons of a drone, s: that of a drone that hears very many others. It is that of all beacons if the
    /// scenario names it, or if distances are kept by words.
    #[must_use]
    pub fn beacon_period_max_s(&self) -> f64 {
        let fixed = self.protocol.beacon_period_s.is_some() || self.apart_by_words();
        if fixed { self.beacon_period_s() } else { self.beacon_period_bound_s() }
    }

    /// Time between two statements of a drone's separating lines, s. They are said with the beacons, or less often where those of
    /// all drones would take more than a quarter of the bandwidth. `messages`: number of messages of one statement.
    #[must_use]
    pub fn separation_period_s(&self, messages: usize) -> f64 {
        let least_s = messages as f64 * self.period_within_share_s(size_of::<Separation>());
        least_s.clamp(self.beacon_period_s(), self.beacon_period_s().max(SEPARATION_PERIOD_MAX_S))
    }

    /// Bandwidth that drones near each other share, bytes/s; infinite if it is no limit.
    #[must_use]
    pub fn bandwidth_bytes_per_s(&self) -> f64 {
        self.share_bps(1.0) / 8.0
    }

    /// Distance within which drones share the bandwidth, m; infinite if all do.
    #[must_use]
    pub fn carrier_sense_m(&self) -> f64 {
        self.radio.carrier_sense_m.unwrap_or(f64::INFINITY)
    }

    /// The greatest number of drones that share a channel in the formation: those within [`Self::carrier_sense_m`] of one slot.
    #[must_use]
    pub fn channel_drones(&self) -> u32 {
        let reach_m = self.carrier_sense_m();
        if reach_m.is_infinite() || self.radio.rate_bps.is_none() {
            return self.formation.drones;
        }
        let mut slots = self.slots();
        slots.sort_by(|a, b| a.x.total_cmp(&b.x));
        let mut first = 0;
        let shares = slots.iter().map(|here| {
            first += slots[first..].iter().take_while(|slot| slot.x < here.x - reach_m).count();
            let ahead = slots[first..].iter().take_while(|slot| slot.x <= here.x + reach_m);
            ahead.filter(|slot| (*slot - here).norm_squared() <= reach_m * reach_m).count()
        });
        shares.max().and_then(|most| u32::try_from(most).ok()).unwrap_or(1)
    }

    /// The time in which all drones that share a channel say one message each, if the messages take a quarter of the bandwidth, s.
    /// `bytes`: size of the payload.
    fn period_within_share_s(&self, bytes: usize) -> f64 {
        let frame_bits = 8.0 * (HEAD_BYTES as f64 + bytes as f64);
        f64::from(self.channel_drones()) * frame_bits / self.share_bps(BEACON_SHARE)
    }

    /// A share of the bandwidth, bit/s.
    fn share_bps(&self, share: f64) -> f64 {
        self.radio.rate_bps.map_or(f64::INFINITY, |rate_bps| share * rate_bps)
    }

    /// The radio of the scenario: delay, loss, range and copies, keyed by the seed.
    #[must_use]
    pub fn radio(&self) -> Radio {
        radio::radio(self.seed, &self.radio)
    }

    /// The topics that pilots declare, each with its key.
    #[must_use]
    pub fn declared_topics(&self) -> Vec<(String, &str)> {
        let mut declared = Vec::new();
        for (number, pilot) in self.pilots.iter().enumerate() {
            let names = pilot.topics.iter().enumerate();
            declared.extend(names.map(|(i, name)| (format!("pilot.{number}.topics.{i}"), name.as_str())));
        }
        declared
    }

    /// The channel that drones near each other share; `None` if bandwidth is no limit.
    #[must_use]
    pub fn channel(&self) -> Option<SharedChannel> {
        radio::channel(self.seed, &self.radio)
    }

    /// Half the width of the narrowest gap that is passable, m: leaders plan routes through wider ones only, and a mission whose drones are
    /// enclosed by narrower ones is stuck. The paths and the safety rule of a drone need less, so that a route is never blocked for it.
    #[must_use]
    pub fn half_gap_m(&self) -> f64 {
        self.avoidance.clearance_m + self.sensors.obstacle_error_max_m + GAP_ROOM_M
    }

    /// The drones that have no way to their destination: obstacles that no drone fits between enclose the drone, or the goal.
    /// Ids in ascending order. A mission without a goal leads out of every enclosure.
    ///
    /// # Errors
    /// [`ShapeError`], as for [`Self::shapes`].
    pub fn drones_without_a_way(&self) -> Result<Vec<u32>, ShapeError> {
        let shapes: Vec<ConvexShape> = self.shapes_in_the_way()?.into_iter().map(|(_, shape)| shape).collect();
        let barrier = Barrier::new(&shapes, self.half_gap_m());
        let far_m = shapes.iter().map(|shape| shape.bounds().1.x).fold(0.0, f64::max) + 1e6;
        let goal = self.mission.goal_m.filter(|_| self.mission.end == End::Goal);
        let to = goal.map_or(Vec2::new(far_m, self.formation.start_m[1]), Vec2::from);
        let starts = self.starts().into_iter().zip(0..);
        Ok(starts.filter(|(start, _)| barrier.separates(*start, to)).map(|(_, drone)| drone).collect())
    }

    /// The time limit of the mission, s: `time.timeout_s`; or 600 s, or five times what a smooth flight takes
    /// from the last slot past all obstacles and to the destination, one drone behind another, if that is longer, but at most 10 hours; at
    /// least the duration of a mission that lasts a time.
    #[must_use]
    pub fn timeout_s(&self) -> f64 {
        let lasts_s = self.mission.duration_s.filter(|_| self.mission.end == End::Time).unwrap_or(0.0);
        let smooth_s = || (TIMEOUT_FACTOR * self.smooth_flight_s()).ceil().clamp(TIMEOUT_S, TIMEOUT_MAX_S);
        self.time.timeout_s.unwrap_or_else(|| smooth_s().max(lasts_s))
    }

    /// What a flight without delay takes from the farthest slot past all obstacles and to the destination, one drone behind another, s.
    fn smooth_flight_s(&self) -> f64 {
        let drone = &self.drone;
        let outlines = self.shapes().unwrap_or_default();
        let course = self.course();
        let rear_m = outlines.iter().map(|shape| shape.extent(course).1).fold(f64::NEG_INFINITY, f64::max);
        let past_m = rear_m + self.avoidance.planning_distance_m - course.along(self.formation.start_m.into());
        let farthest_m = self.slots().iter().map(|slot| slot.norm()).fold(0.0, f64::max);
        let way_m = farthest_m + self.formation.start_jitter_m + self.way_m().max(past_m);
        let headway_s = self.avoidance.headway_factor * drone.safe_distance_m / drone.speed_mps;
        way_m / drone.speed_mps.min(self.reform_speed_max_mps()) + f64::from(self.formation.drones) * headway_s
    }

    /// The straight way of the formation's front slot to the destination, m; 0 if the mission has none.
    #[must_use]
    pub fn way_m(&self) -> f64 {
        let start = Vec2::from(self.formation.start_m);
        match (self.mission.end, self.mission.goal_m) {
            (End::Goal, Some(goal_m)) => (Vec2::from(goal_m) - start).norm(),
            (End::Hold, _) => (self.mission.stop_x_m - start.x).max(0.0),
            _ => 0.0,
        }
    }

    /// The scenario as TOML with every key written out. [`Scenario::parse`] makes an equal scenario of it.
    ///
    /// # Errors
    /// The serializer's error if a number does not fit TOML. A checked scenario has no such number.
    pub fn to_toml(&self) -> Result<String, toml::ser::Error> {
        toml::to_string(self)
    }
}

/// A uniform point of the unit disc that depends on the two keys only. It uses SplitMix64 and rejection, so that no bit
/// depends on a platform's sine.
fn in_unit_disc(seed: u64, drone: u64) -> Vec2 {
    let mut state = mix(mix(seed) ^ drone);
    let mut draw = || {
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        (mix(state) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    };
    let points = std::iter::repeat_with(|| Vec2::new(draw(), draw()));
    points.take(1000).find(|p| p.norm_squared() <= 1.0).unwrap_or_default()
}

/// The finalizer of SplitMix64.
fn mix(value: u64) -> u64 {
    let value = (value ^ (value >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let value = (value ^ (value >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    value ^ (value >> 31)
}
