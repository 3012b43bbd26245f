//! The same mission with another pilot.

use skein_scenario::{PilotKeys, Scenario};

/// The scenario with this pilot for all drones.
pub(crate) fn flown_by(scenario: &Scenario, pilot: &str) -> Scenario {
    let table = PilotKeys { name: Some(pilot.to_owned()), ..PilotKeys::default() };
    Scenario { pilots: vec![table], ..scenario.clone() }
}
