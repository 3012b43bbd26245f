//! A swarm of some size, and how long it flies.

use crate::error::BenchError;
use skein_protocol::downlink::{DownlinkHeader, SensedNeighbour, SensesHeader};
use skein_protocol::frame::AirFrame;
use skein_scenario::{Scenario, ScenarioSource};

/// From this size on, the radio's range is limited, as it would be in a real swarm.
const LIMITED_RANGE_DRONES: u32 = 256;
/// Ticks before the measurement. By then the leader's plan has put all drones into formation.
const WARM_UP_TICKS: u64 = 60;
/// The same with a limited range. By then word of each drone has come to all others.
const LIMITED_WARM_UP_TICKS: u64 = 300;
/// Ticks after the measurement.
const COOL_DOWN_TICKS: u64 = 80;

/// A swarm of some size, and how long it flies.
pub(crate) struct Workload {
    /// Size of the swarm.
    pub(crate) drones: u32,
    /// A grid in formation flight.
    pub(crate) scenario: Scenario,
    /// First tick that is measured.
    pub(crate) from: u64,
    /// Tick at which the measurement ends.
    pub(crate) until: u64,
    /// Bytes that the world sends to all drones per tick, on average.
    pub(crate) down_len: usize,
    /// Bytes of these that one drone reads.
    pub(crate) read_len: usize,
}

impl Workload {
    /// A grid in formation flight at the paper's spacing. `ticks` are measured; without it, fewer ticks the more drones
    /// there are, and a third of them if `quick`.
    pub(crate) fn new(drones: u32, quick: bool, ticks: Option<u64>) -> Result<Self, BenchError> {
        let window = (240_000 / u64::from(drones.saturating_add(16))).clamp(240, 12_000);
        let window = ticks.unwrap_or(if quick { window / 3 } else { window });
        let from = if drones < LIMITED_RANGE_DRONES { WARM_UP_TICKS } else { LIMITED_WARM_UP_TICKS };
        let until = from + window;
        let scenario = scenario(drones, until + COOL_DOWN_TICKS)?;
        let beacons = f64::from(drones) * scenario.time.dt_s / scenario.beacon_period_s();
        let heard =
            if drones < LIMITED_RANGE_DRONES { beacons } else { beacons.min(8.0 * beacons / f64::from(drones)) };
        let senses = size_of::<SensesHeader>() + 4 * size_of::<SensedNeighbour>();
        let frame = size_of::<AirFrame>() as f64;
        Ok(Self {
            drones,
            from,
            until,
            down_len: size_of::<DownlinkHeader>() + drones as usize * senses + (beacons * frame) as usize,
            read_len: senses + (heard * frame) as usize,
            scenario,
        })
    }

    /// Number of ticks that are measured.
    pub(crate) fn window(&self) -> u64 {
        self.until - self.from
    }

    /// Number of ticks of the whole flight.
    pub(crate) fn all_ticks(&self) -> u64 {
        self.until + COOL_DOWN_TICKS
    }
}

fn scenario(drones: u32, ticks: u64) -> Result<Scenario, BenchError> {
    let mut text = format!(
        r#"
name = "bench-{drones}"
[time]
timeout_s = {}
[formation]
shape = "grid"
drones = {drones}
spacing_m = 65
[mission]
stop_x_m = 1000000
reformation = "identity"
[drone]
safe_distance_m = 37
"#,
        ticks as f64 * 0.02
    );
    if drones >= LIMITED_RANGE_DRONES {
        // The leader and every drone can hear each other; other drones hear their neighbours.
        text += "[radio]\nrange_m = 100\n[[radio.rule]]\nto = [0]\nrange_m = 100000\n";
        text += "[[radio.rule]]\ntopics = [\"leadership\", \"plan\", \"assignment\"]\nrange_m = 100000\n";
    }
    Ok(Scenario::parse(&text, ScenarioSource { name: "bench", stem: "bench" }, &[])?)
}
