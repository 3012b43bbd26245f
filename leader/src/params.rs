//! Parameters of planning and of leading.

use crate::channel_params::ChannelParams;
use crate::cost::Flight;
use crate::election::ElectionParams;
use crate::routes::RouteParams;
use crate::slots::Reformation;
use crate::tuning::{AGREEMENT_MESSAGES, CROWD_DRONES, LEADER_SHARE, PRESENCE_REPEATS, STATES_PER_S};
use skein_protocol::formation::Shape;
use skein_protocol::radio::HEAD_BYTES;
use skein_protocol::{DroneId, SimTime, Vec2};

/// How a leader chooses among the groupings of its members.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Strategy {
    /// The grouping in which the last drone passes the gate earliest (paper, Algorithm 3).
    PaperRule,
    /// The shortest paths, the paper's rule and the best few other groupings are flown ahead in a rollout. The best wins.
    LookAhead(Objective),
    /// Each drone takes its own shortest path.
    ShortestPath,
    /// A fixed number of drones on each side of one obstacle. Each side is filled in the least time.
    Fixed {
        /// Number of drones on the left route.
        left: usize,
        /// Number of drones on the right route.
        right: usize,
    },
}

/// Cost of a simulated mission: a weighted sum of energy and time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Objective {
    /// Weight of the energy of all drones until the end of the mission, 1/kJ.
    pub energy_per_kj: f64,
    /// Weight of the time until the end of the mission, 1/s.
    pub time_per_s: f64,
}

impl Objective {
    /// The cost of a mission that takes `energy_j` (J) and `time_s` (s). No unit.
    #[must_use]
    pub fn cost(&self, energy_j: f64, time_s: f64) -> f64 {
        self.energy_per_kj * energy_j / 1000.0 + self.time_per_s * time_s
    }
}

/// Where a mission ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Destination {
    /// The mission ends when the swarm holds its formation. A moving anchor stops at this abscissa.
    Hold {
        /// World frame, m; infinity: the anchor never stops.
        stop_x_m: f64,
    },
    /// The mission ends in the slots of a formation whose front slot is here.
    Goal {
        /// The front slot, world frame, m.
        front_m: Vec2,
    },
}

impl Destination {
    /// The distance that decides elections, m. The drone with the smallest one claims first. For [`Self::Hold`] it is the
    /// negative abscissa of `position` (world frame, m).
    #[must_use]
    pub fn distance_m(&self, position: Vec2) -> f64 {
        match self {
            Self::Hold { .. } => -position.x,
            Self::Goal { front_m } => (front_m - position).norm(),
        }
    }

    /// The abscissa at which a moving anchor stops, world frame, m.
    #[must_use]
    pub fn stop_x_m(&self) -> f64 {
        match self {
            Self::Hold { stop_x_m } => *stop_x_m,
            Self::Goal { front_m } => front_m.x,
        }
    }
}

/// What groups do between two obstacle sets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Between {
    /// The swarm becomes one group again and closes its formation.
    CloseUp,
    /// Each group goes on by itself to its part of the formation at the destination, and splits again before the next set. The
    /// swarm closes its formation once it has flown as far as the destination (paper, G1).
    GoOn,
}

/// Parameters of planning.
#[derive(Clone, Debug)]
pub struct PlannerParams {
    /// Number of drones in the swarm.
    pub drones: u32,
    /// How groupings are chosen.
    pub strategy: Strategy,
    /// Nominal speed, m/s.
    pub speed_mps: f64,
    /// Time between two drones on one route, s.
    pub headway_s: f64,
    /// Whether lines that the drones agree on keep them apart, because they do not range each other.
    pub by_words: bool,
    /// The greatest speed from which a drone stops within what it senses, m/s.
    pub speed_on_sight_mps: f64,
    /// Clearances of routes.
    pub routes: RouteParams,
    /// Shape of the formation.
    pub shape: Shape,
    /// Distance of neighbouring slots, m.
    pub spacing_m: f64,
    /// How slots are assigned to drones.
    pub reformation: Reformation,
    /// A drone has arrived when its distance to its slot is at most this, m.
    pub arrival_error_m: f64,
    /// Least distance of two drones, m.
    pub safe_distance_m: f64,
    /// Ordinate of the course line, m.
    pub course_y_m: f64,
    /// Where the mission ends.
    pub destination: Destination,
    /// What groups do between two obstacle sets.
    pub between: Between,
    /// Distance over which drones hear each other, m; infinite without a limit. Parts of the swarm may lose each other if it is finite.
    pub radio_range_m: f64,
    /// Delay between learning an obstacle and planning for it, so that one plan covers obstacles that are learnt together;
    /// also between a change of the members and new slots, s.
    pub debounce_s: f64,
}

impl PlannerParams {
    /// Whether drones pass side by side on a route, as a crowd, and not one behind another: the swarm is large, and there is room beside
    /// the route. `between`: whether the route leads between two obstacles.
    #[must_use]
    pub fn is_for_crowd(&self, between: bool) -> bool {
        self.drones >= CROWD_DRONES && !between
    }

    /// The nominal flight of a drone that is at `position` when it is planned for, world frame, m. A drone of a crowd does not return to the
    /// course line, but to its own ordinate.
    pub(crate) fn flight(&self, position: Vec2) -> Flight {
        if self.is_for_crowd(false) {
            Flight { speed_mps: self.speed_mps.min(self.speed_on_sight_mps), course_y_m: position.y }
        } else {
            Flight { speed_mps: self.speed_mps, course_y_m: self.course_y_m }
        }
    }

    /// Time between two drones on one route, s; 0 for a crowd. `between`: whether the route leads between two obstacles. `delay_s`: how long
    /// a message takes.
    ///
    /// By words, a drone follows another one into a gap only after the two have agreed on another line. That takes three messages: one that
    /// states where the other drone is now, one that states the line, and its answer. Drones that follow each other faster jam in front of
    /// the gap. Beside an outer route there is room.
    #[must_use]
    pub fn turn_s(&self, between: bool, delay_s: f64) -> f64 {
        if self.is_for_crowd(between) {
            return 0.0;
        }
        let agreed_s = if self.by_words && between { AGREEMENT_MESSAGES * delay_s } else { 0.0 };
        self.headway_s.max(agreed_s)
    }

    /// How long so many drones take to pass one behind another, s.
    #[must_use]
    pub fn file_s(&self, drones: u32) -> f64 {
        f64::from(drones) * self.headway_s
    }
}

/// What `Leading` needs to know before it starts.
#[derive(Clone, Debug)]
pub struct LeadingParams {
    /// This drone.
    pub me: DroneId,
    /// Number of drones in the swarm.
    pub drones: u32,
    /// Number of this start of the drone's process, from 1. No two starts of one drone share it.
    pub incarnation: u32,
    /// When it starts.
    pub start: SimTime,
    /// Length of a tick, s.
    pub dt_s: f64,
    /// Parameters of elections.
    pub election: ElectionParams,
    /// Parameters of planning.
    pub planner: PlannerParams,
    /// Shortest period of beacons, s.
    pub beacon_period_s: f64,
    /// Longest period of beacons, s: that of a drone that hears very many others.
    pub beacon_period_max_s: f64,
    /// Period of repetitions, s.
    pub repeat_period_s: f64,
    /// The channel that it shares with the drones near it.
    pub channel: ChannelParams,
    /// A peer that is silent for longer counts as gone, s. Longer on a bad link.
    pub peer_timeout_s: f64,
}

impl LeadingParams {
    /// Time between two states of a drone without news that are passed on, s.
    pub(crate) fn state_period_s(&self) -> f64 {
        self.repeat_period_s * PRESENCE_REPEATS * self.thinning()
    }

    /// How many times less often than in a small swarm states are passed on. No unit, at least 1.
    pub(crate) fn thinning(&self) -> f64 {
        (f64::from(self.drones) / (STATES_PER_S * self.repeat_period_s * PRESENCE_REPEATS)).max(1.0)
    }

    /// Time that a message with a payload of this size takes in one leader's share of the bandwidth, s; 0 if bandwidth is no limit.
    pub(crate) fn leader_frame_s(&self, bytes: usize) -> f64 {
        (HEAD_BYTES as f64 + bytes as f64) / (LEADER_SHARE * self.channel.bandwidth_bytes_per_s)
    }
}
