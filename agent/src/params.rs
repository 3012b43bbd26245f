//! What a drone is told before it starts: constants of the vehicle and the mission, no knowledge of the swarm's state.

use crate::danger::Braking;
use crate::guidance::GuidanceParams;
use crate::safety::SafetyParams;
use skein_leader::election::ElectionParams;
use skein_leader::leading::LeadingParams;
use skein_leader::params::PlannerParams;
use skein_protocol::{DroneId, SimTime};

/// Parameters of a [`crate::SwarmPilot`].
#[derive(Clone, Debug)]
pub struct PilotParams {
    /// Who it is.
    pub me: DroneId,
    /// Size of the swarm.
    pub drones: u32,
    /// Of its process, from 1.
    pub incarnation: u32,
    /// When it starts.
    pub start: SimTime,
    /// Length of a tick, s.
    pub dt_s: f64,
    /// Formation flight.
    pub guidance: GuidanceParams,
    /// The safety filter.
    pub safety: SafetyParams,
    /// Whether it has a sensor that ranges neighbours.
    pub ranging: bool,
    /// Stopping distances.
    pub braking: Braking,
    /// Planning, should it lead; also headway, routes and course for everybody.
    pub planner: PlannerParams,
    /// Elections.
    pub election: ElectionParams,
    /// Velocity error to acceleration, 1/s.
    pub velocity_gain_per_s: f64,
    /// Share of an evasion that the drone behind takes from the one ahead in the same queue, 0.5 to 1.
    pub precedence_share: f64,
    /// Whether drones on one route slow down into a single file before its gate.
    pub queue: bool,
    /// Between two beacons, s.
    pub beacon_period_s: f64,
    /// Between two repetitions of what has to be repeated, s.
    pub repeat_period_s: f64,
    /// A peer that is silent for longer counts as gone, s.
    pub peer_timeout_s: f64,
}

impl PilotParams {
    /// What its leading part needs of them.
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
            repeat_period_s: self.repeat_period_s,
            peer_timeout_s: self.peer_timeout_s,
        }
    }
}
