//! A drone that flies to the place opposite to its start.

use bytemuck::Zeroable;
use nalgebra::Vector2;
use serde::Deserialize;
use skein::{Birth, Command, Inbox, Out, Pilot, PilotError, Senses};
use skein_agent::braking_filter::{BrakingFilter, BrakingFilterParams, OwnMotion};
use skein_agent::separation::own_path::OwnPath;
use skein_agent::separation::{SeparationParams, Separations, messages};
use skein_leader::peers::Peers;
use skein_protocol::payload::Pose;
use skein_protocol::{DroneId, Message, MessageRef, SimTime};
use skein_scenario::{Scenario, ScenarioSource};

type Vec2 = Vector2<f64>;

/// The table `params` of the pilot.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct Params {
    /// The greatest angle by which a drone that is held up turns to the right, rad.
    turn_max_rad: f64,
    /// How fast it turns, rad/s.
    turn_rate_radps: f64,
    /// Acceleration per velocity error, 1/s.
    gain_per_s: f64,
    /// Distance from the goal within which the drone has arrived, m.
    arrived_m: f64,
}

impl Default for Params {
    fn default() -> Self {
        Self { turn_max_rad: 1.4, turn_rate_radps: 0.7, gain_per_s: 5.0, arrived_m: 0.2 }
    }
}

/// A drone that flies to the place opposite to its start.
pub(crate) struct Antipodal {
    params: Params,
    me: DroneId,
    incarnation: u32,
    goal: Vec2,
    beacon_ticks: u64,
    filter: BrakingFilter,
    separations: Separations,
    peers: Peers,
    /// By how much the drone turns to the right of its goal, rad.
    turn_rad: f64,
    flown_m: f64,
}

impl Antipodal {
    /// # Errors
    /// [`PilotError`] if the parameters or the scenario cannot be read.
    pub(crate) fn new(birth: &Birth) -> Result<Self, PilotError> {
        let scenario = Scenario::from_json(&birth.scenario, ScenarioSource { name: "scenario", stem: "scenario" })
            .map_err(|error| PilotError::new(format!("the scenario of this run: {error}")))?;
        let (drone, starts) = (&scenario.drone, scenario.starts());
        let filter = BrakingFilter::new(BrakingFilterParams {
            safe_distance_m: drone.safe_distance_m,
            clearance_m: scenario.avoidance.clearance_m,
            acceleration_max_mps2: drone.acceleration_max_mps2,
            braking_mps2: scenario.braking_mps2(),
            speed_max_mps: drone.speed_max_mps,
            dt_s: birth.dt_s,
        });
        let centre = starts.iter().sum::<Vec2>() / starts.len() as f64;
        let me = DroneId(birth.drone);
        let separation = SeparationParams {
            me,
            incarnation: birth.incarnation,
            starts_m: starts.clone().into(),
            start_velocity: Vec2::new(drone.speed_mps, 0.0),
            reaction_time_s: 0.0,
            keep_m: filter.params().keep_m(),
            radio_range_m: scenario.radio().beacon_range_m(),
            braking_mps2: scenario.braking_mps2(),
            period_s: scenario.separation_period_s(messages(starts.len())),
            dt_s: birth.dt_s,
        };
        Ok(Self {
            params: birth.params.parse()?,
            me,
            incarnation: birth.incarnation,
            goal: centre * 2.0 - starts[me.index()],
            beacon_ticks: ((scenario.beacon_period_s() / birth.dt_s).round() as u64).max(1),
            filter,
            separations: Separations::new(separation, SimTime::from_secs(birth.start_s)),
            peers: Peers::new(birth.drones, scenario.protocol.peer_timeout_s),
            turn_rad: 0.0,
            flown_m: 0.0,
        })
    }

    fn hear(&mut self, now: SimTime, inbox: &Inbox<'_>, path: &OwnPath) {
        for heard in inbox.heard() {
            match heard.message {
                MessageRef::Pose(pose) => {
                    self.separations.hear_incarnation(heard.source, pose.incarnation);
                    self.peers.hear(now, heard.source, *pose);
                }
                MessageRef::Separation(lines) => self.separations.hear(heard.source, lines, &self.peers, path),
                _ => {}
            }
        }
    }

    fn speak(&mut self, senses: &Senses<'_>, path: &OwnPath, out: &mut Out) {
        if senses.tick % self.beacon_ticks == u64::from(self.me.0) % self.beacon_ticks {
            out.message(Message::Pose(Pose {
                stamp: senses.now,
                position_m: senses.position_m,
                velocity_mps: senses.velocity_mps,
                incarnation: self.incarnation,
                ..Pose::zeroed()
            }));
        }
        self.separations.speak(&self.peers, path, out.messages_mut());
    }

    /// The acceleration that the drone wants, m/s². A drone that is held up turns to the right, so that drones that meet go round
    /// each other.
    fn wanted(&mut self, position: Vec2, velocity: Vec2, dt_s: f64) -> Vec2 {
        let (limits, params) = (*self.filter.params(), self.params);
        let way = self.goal - position;
        let speed_mps = limits.speed_max_mps.min((limits.braking_mps2 * way.norm()).sqrt());
        let held_up = velocity.norm() < 0.3 * speed_mps && way.norm() > params.arrived_m;
        let change = if held_up { params.turn_rate_radps * dt_s } else { -params.turn_rate_radps * dt_s };
        self.turn_rad = (self.turn_rad + change).clamp(0.0, params.turn_max_rad);
        let (sin, cos) = self.turn_rad.sin_cos();
        let right = Vec2::new(way.x * cos + way.y * sin, way.y * cos - way.x * sin);
        let direction = right.try_normalize(1e-9).unwrap_or_default();
        (direction * speed_mps - velocity) * params.gain_per_s
    }
}

impl Pilot for Antipodal {
    fn step(&mut self, senses: &Senses<'_>, inbox: &Inbox<'_>, out: &mut Out) -> Command {
        let limits = *self.filter.params();
        let (position, velocity) = (senses.position(), senses.velocity());
        let path = OwnPath::new((senses.tick, senses.now), vec![position], velocity, limits.law(), limits.stride());
        self.hear(senses.now, inbox, &path);
        self.speak(senses, &path, out);
        self.flown_m += velocity.norm() * limits.dt_s;
        let wanted = match self.separations.has_agreed_with_all() {
            true => self.wanted(position, velocity, limits.dt_s),
            false => limits.law().braking(velocity),
        };
        let own = OwnMotion {
            tick: senses.tick,
            now: senses.now,
            sensed_position: position,
            sensed_velocity: velocity,
            position,
            velocity,
            speed_limit_mps: limits.speed_max_mps,
            lag: 0,
        };
        let safe = self.filter.filter(&own, wanted, [].into_iter(), [].into_iter(), self.separations.lines());
        let arrived = (self.goal - position).norm() < self.params.arrived_m && velocity.norm() < 0.5;
        if arrived {
            out.metric("flown_m", self.flown_m);
        }
        out.done(arrived);
        out.line("goal", senses.position_m, [self.goal.x, self.goal.y, senses.position_m[2]]);
        Command::acceleration([safe.x, safe.y, 0.0])
    }
}
