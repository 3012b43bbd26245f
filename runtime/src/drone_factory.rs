//! Makes the drones of a swarm.

use crate::beacon::BeaconPilot;
use crate::mission;
use crate::pilot_host::{HostParams, PilotHost};
use crate::pilot_kind::PilotKind;
use skein_agent::SwarmPilot;
use skein_pilot::Pilot;
use skein_protocol::radio::Radio;
use skein_protocol::{DroneId, SimTime};
use skein_scenario::Scenario;
use std::sync::Arc;

/// Makes the drones of one scenario. They share one radio model.
pub struct DroneFactory<'s> {
    scenario: &'s Scenario,
    kind: PilotKind,
    radio: Arc<Radio>,
}

impl<'s> DroneFactory<'s> {
    /// A factory of drones with pilots of this kind.
    #[must_use]
    pub fn new(scenario: &'s Scenario, kind: PilotKind) -> Self {
        Self { scenario, kind, radio: Arc::new(scenario.radio()) }
    }

    /// One drone, ready for the tick that begins at `start`. A restarted drone has a higher incarnation, from 1.
    #[must_use]
    pub fn pilot_host(&self, id: DroneId, incarnation: u32, start: SimTime) -> PilotHost {
        let pilot: Box<dyn Pilot> = match self.kind {
            PilotKind::Swarm => Box::new(SwarmPilot::new(mission::pilot_params(self.scenario, id, incarnation, start))),
            PilotKind::Beacon => Box::new(BeaconPilot::new(id, incarnation, self.beacon_ticks())),
        };
        let params = HostParams {
            me: id,
            dt_s: self.scenario.time.dt_s,
            velocity_gain_per_s: self.scenario.guidance.velocity_gain_per_s,
        };
        PilotHost::new(params, Arc::clone(&self.radio), pilot)
    }

    fn beacon_ticks(&self) -> u64 {
        (self.scenario.beacon_period_s() / self.scenario.time.dt_s).round() as u64
    }
}
