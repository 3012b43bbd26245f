//! Makes the drones of a swarm.

use crate::error::RuntimeError;
use crate::pilot_host::{HostParams, PilotHost};
use crate::pilot_registry::PilotRegistry;
use serde_json::Value;
use skein_bus::ForkGuard;
use skein_protocol::radio::Radio;
use skein_protocol::{DroneId, SimTime};
use skein_scenario::Scenario;
use std::sync::Arc;

/// Makes the drones of one scenario. They share one radio model.
pub struct DroneFactory<'s> {
    scenario: &'s Scenario,
    pilots: &'s PilotRegistry,
    /// The scenario, as pilots get it.
    json: Arc<Value>,
    /// The table of each drone's pilot.
    tables: Vec<Option<usize>>,
    radio: Arc<Radio>,
}

impl<'s> DroneFactory<'s> {
    /// A factory of drones with the pilots that the scenario names.
    #[must_use]
    pub fn new(scenario: &'s Scenario, pilots: &'s PilotRegistry) -> Self {
        // A checked scenario has no value that JSON cannot hold.
        let json = Arc::new(serde_json::to_value(scenario).unwrap_or_default());
        Self { scenario, pilots, json, tables: scenario.pilot_tables(), radio: Arc::new(scenario.radio()) }
    }

    /// One drone, ready for the tick that begins at `start`. A restarted drone has a higher incarnation, from 1.
    ///
    /// # Errors
    /// [`RuntimeError::Pilot`] if its pilot cannot be made, [`RuntimeError::Bus`].
    pub fn pilot_host(&self, id: DroneId, incarnation: u32, start: SimTime) -> Result<PilotHost, RuntimeError> {
        let table = self.tables.get(id.index()).copied().flatten();
        let pilot = self.pilots.make(self.scenario, &self.json, table, (id, incarnation, start))?;
        let params = HostParams {
            me: id,
            dt_s: self.scenario.time.dt_s,
            velocity_gain_per_s: self.scenario.guidance.velocity_gain_per_s,
        };
        Ok(PilotHost::new(params, Arc::clone(&self.radio), pilot).guarded(ForkGuard::new()?))
    }
}
