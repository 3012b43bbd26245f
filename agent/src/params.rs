//! Parameters of a [`crate::SwarmPilot`]: constants of the vehicle and the mission, and no knowledge of the swarm's state.

use crate::braking_filter::BrakingFilterParams;
use crate::detection::Braking;
use crate::guidance::GuidanceParams;
use crate::neighbour_table::NeighbourParams;
use crate::queue::QueueParams;
use crate::reaction::ReactionDelay;
use crate::rollout::RolloutParams;
use crate::safety::SafetyParams;
use crate::sensing_errors::SensingErrors;
use crate::separation::SeparationParams;
use crate::silent_drones::SilenceParams;
use skein_leader::channel_params::ChannelParams;
use skein_leader::election::ElectionParams;
use skein_leader::params::LeadingParams;
use skein_leader::params::PlannerParams;
use skein_protocol::formation::HOLD_SPEED_MPS;
use skein_protocol::{DroneId, SimTime, Vec2};
use std::iter;
use std::sync::Arc;

/// Parameters of a [`crate::SwarmPilot`]. Places are in the frame of the mission's course.
#[derive(Clone, Debug)]
pub struct PilotParams {
    /// The drone that it flies.
    pub me: DroneId,
    /// Number of drones in the swarm.
    pub drones: u32,
    /// Incarnation of its process, from 1.
    pub incarnation: u32,
    /// When it starts.
    pub start: SimTime,
    /// Time between two steps of the pilot, s: a tick, or a step of a look-ahead.
    pub dt_s: f64,
    /// Length of a tick, s.
    pub tick_s: f64,
    /// Formation flight.
    pub guidance: GuidanceParams,
    /// The safety filter.
    pub safety: SafetyParams,
    /// Height above the ground that it keeps, m.
    pub altitude_m: f64,
    /// Range of its obstacle sensor, m.
    pub detection_range_m: f64,
    /// Greatest speed, m/s.
    pub speed_max_mps: f64,
    /// Greatest distance at which a drone senses its neighbours, m, if it does.
    pub ranging_m: f64,
    /// Whether distances between drones are kept by messages: nothing that the drone ranges is needed for them.
    pub apart_by_words: bool,
    /// Bounds on the errors of what it senses.
    pub sensing: SensingErrors,
    /// Where each drone starts, m. A drone whose distances are kept by messages keeps its first distances by it.
    pub starts_m: Arc<[Vec2]>,
    /// Stopping distances.
    pub braking: Braking,
    /// Planning while it leads. Headway, routes and course line apply to every drone.
    pub planner: PlannerParams,
    /// Elections.
    pub election: ElectionParams,
    /// Acceleration per velocity error, 1/s.
    pub velocity_gain_per_s: f64,
    /// Share of an evasion that the rear one of two queued drones takes, 0.5 to 1.
    pub precedence_share: f64,
    /// Whether drones on one route slow down into a single file before its gate.
    pub queue: bool,
    /// Shortest time between two beacons, s.
    pub beacon_period_s: f64,
    /// Longest time between two beacons, s: that of a drone that hears very many others.
    pub beacon_period_max_s: f64,
    /// Time between two statements of its separating lines, s.
    pub separation_period_s: f64,
    /// Time between two repetitions of a message that has to be repeated, s.
    pub repeat_period_s: f64,
    /// The channel that it shares with the drones near it.
    pub channel: ChannelParams,
    /// Silence after which a peer counts as gone, s.
    pub peer_timeout_s: f64,
}

impl PilotParams {
    /// The parameters of its election and planning.
    #[must_use]
    pub fn leading(&self) -> LeadingParams {
        LeadingParams {
            me: self.me,
            drones: self.drones,
            incarnation: self.incarnation,
            start: self.start,
            dt_s: self.dt_s,
            election: self.election,
            planner: self.planner.clone(),
            beacon_period_s: self.beacon_period_s,
            beacon_period_max_s: self.beacon_period_max_s,
            repeat_period_s: self.repeat_period_s,
            channel: self.channel,
            peer_timeout_s: self.peer_timeout_s,
        }
    }

    /// The parameters of its look-ahead.
    #[must_use]
    pub fn rollout(&self) -> RolloutParams {
        RolloutParams {
            dt_s: self.dt_s,
            safe_distance_m: self.safety.safe_distance_m,
            clearance_m: self.safety.clearance_m,
            acceleration_max_mps2: self.safety.acceleration_max_mps2,
            detection_range_m: self.detection_range_m,
            ranging_m: self.ranging_m,
            speed_mps: self.guidance.speed_mps,
            reform_speed_max_mps: self.guidance.reform_speed_max_mps,
            planner: self.planner.clone(),
        }
    }

    /// `between`: whether the route leads between two obstacles. `delay_s`: how long a message takes.
    pub(crate) fn queueing(&self, between: bool, delay_s: f64) -> QueueParams {
        QueueParams {
            headway_s: self.planner.turn_s(between, delay_s),
            speed_mps: self.guidance.speed_mps,
            speed_change_mps: self.guidance.speed_change_mps,
        }
    }

    pub(crate) fn braking_filter(&self) -> BrakingFilterParams {
        BrakingFilterParams {
            safe_distance_m: self.safety.safe_distance_m,
            clearance_m: self.safety.clearance_m,
            acceleration_max_mps2: self.safety.acceleration_max_mps2,
            braking_mps2: self.safety.braking_mps2,
            speed_max_mps: self.speed_max_mps,
            dt_s: self.dt_s,
        }
    }

    /// The speed up to which the drone can stop within what it senses, if its commands take effect `lag` ticks late, m/s.
    /// Two drones that come into ranging distance must both be able to stop.
    #[must_use]
    pub fn speed_on_sight_mps(&self, lag: u32) -> f64 {
        let filter = BrakingFilterParams { dt_s: self.tick_s, ..self.braking_filter() };
        // An outline may seem farther away than it is.
        let sight_m = self.detection_range_m - self.sensing.obstacle_m;
        let obstacles_mps = filter.speed_within_mps(sight_m - self.safety.clearance_m, lag);
        if self.apart_by_words || self.drones < 2 {
            return obstacles_mps;
        }
        let room_m = self.ranging_m - self.safety.safe_distance_m - filter.margin_m();
        obstacles_mps.min(filter.speed_within_mps(room_m / 2.0, lag))
    }

    /// The distance that two drones keep while nothing hinders them, m: the safe distance, its margin, and what a reaction time
    /// adds.
    #[must_use]
    pub fn separation_kept_m(&self) -> f64 {
        let filter = BrakingFilterParams { dt_s: self.tick_s, ..self.braking_filter() };
        let errors_m = if self.apart_by_words { 2.0 * self.sensing.position_m } else { 0.0 };
        (filter.keep_m() + errors_m).max(self.safety.keep_m(self.braking.reaction_time_s))
    }

    /// The parameters of the lines that keep drones apart.
    pub(crate) fn separation(&self) -> SeparationParams {
        // Without lines from the start on, only the number of drones counts.
        let starts_m = if self.apart_by_words {
            Arc::clone(&self.starts_m)
        } else {
            iter::repeat_n(Vec2::zeros(), self.drones as usize).collect()
        };
        SeparationParams {
            me: self.me,
            incarnation: self.incarnation,
            starts_m,
            start_velocity: Vec2::new(self.guidance.speed_mps, 0.0),
            reaction_time_s: ReactionDelay::new(self.braking.reaction_time_s, self.dt_s).delay_s(),
            keep_m: self.braking_filter().keep_m() + 2.0 * self.sensing.position_m,
            radio_range_m: self.planner.radio_range_m,
            braking_mps2: self.safety.braking_mps2,
            period_s: self.separation_period_s,
            dt_s: self.dt_s,
        }
    }

    pub(crate) fn silence(&self) -> SilenceParams {
        SilenceParams {
            braking_mps2: self.safety.braking_mps2,
            still_mps: self.safety.scale.speed(HOLD_SPEED_MPS),
            ranging_m: self.ranging_m,
        }
    }

    /// The least distance of two drones, as a share of their distance in formation, at most 1; `None` for a swarm that is too small to
    /// pass as a crowd.
    pub(crate) fn squeeze(&self) -> Option<f64> {
        let share = (self.safety.keep_m(0.0) / self.planner.spacing_m).min(1.0);
        self.planner.is_for_crowd(false).then_some(share)
    }

    pub(crate) fn neighbours(&self) -> NeighbourParams {
        NeighbourParams {
            safe_distance_m: self.safety.safe_distance_m,
            ranging_m: (!self.apart_by_words).then_some(self.ranging_m),
            precedence_share: self.precedence_share,
        }
    }
}
