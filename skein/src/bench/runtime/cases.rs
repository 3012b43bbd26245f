//! What is measured, and on what.

use super::flight;
use super::floor;
use super::probe::Measured;
use crate::exit::Failure;
use crate::interrupt::Interrupt;
use clap::ValueEnum;
use serde::Serialize;
use skein_bus::WaitMode;
use skein_protocol::downlink::{DownlinkHeader, SensedNeighbour, SensesHeader};
use skein_protocol::frame::AirFrame;
use skein_runtime::PilotKind;
use skein_scenario::{Scenario, ScenarioSource};

/// Drones in a process, where several share one.
pub(super) const PACK: u32 = 32;
/// Drones from which on the radio's range is limited, as it would be.
const MANY: u32 = 256;

/// What is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Case {
    /// Raw shared memory, one word, one counter: [`skein_bus::Baseline`].
    Floor,
    /// The floor's exchange over Unix datagrams.
    Datagrams,
    /// Function calls, trivial pilot.
    InlineBeacon,
    /// Processes that sleep, trivial pilot.
    BlockBeacon,
    /// Processes that yield, trivial pilot.
    YieldBeacon,
    /// Function calls, the paper's pilot in formation.
    Inline,
    /// Processes that sleep, the paper's pilot in formation.
    Block,
    /// Processes that yield, the paper's pilot in formation.
    Yield,
    /// The same with [`PACK`] drones a process, sleeping.
    Packed,
}

impl Case {
    /// Those for a swarm of this size; of these, if there are any.
    pub(super) fn of(drones: u32, datagrams: bool, only: &[Self]) -> Vec<Self> {
        use Case::*;
        let all = [Floor, Datagrams, InlineBeacon, BlockBeacon, YieldBeacon, Inline, Block, Yield, Packed];
        let apt = |case: &Case| match case {
            Datagrams => datagrams || only.contains(case),
            Packed => drones > PACK,
            _ => true,
        };
        let wanted = |case: &Case| only.is_empty() || only.contains(case);
        all.into_iter().filter(apt).filter(wanted).collect()
    }

    /// For people.
    pub fn name(self) -> &'static str {
        match self {
            Self::Floor => "naive floor",
            Self::Datagrams => "unix datagrams",
            Self::InlineBeacon => "inline, trivial",
            Self::BlockBeacon => "block, trivial",
            Self::YieldBeacon => "yield, trivial",
            Self::Inline => "inline, formation",
            Self::Block => "block, formation",
            Self::Yield => "yield, formation",
            Self::Packed => "block, formation, 32 a process",
        }
    }

    /// Measures it once.
    pub(super) fn measure(self, size: &Size, interrupt: &Interrupt) -> Result<Measured, Failure> {
        use PilotKind::{Beacon, Swarm};
        match self {
            Self::Floor => floor::measure(size, floor::Transport::Memory),
            Self::Datagrams => floor::measure(size, floor::Transport::Datagrams),
            Self::InlineBeacon => flight::inline(size, Beacon, interrupt),
            Self::Inline => flight::inline(size, Swarm, interrupt),
            Self::BlockBeacon => flight::processes(size, Beacon, WaitMode::Block, 1, interrupt),
            Self::YieldBeacon => flight::processes(size, Beacon, WaitMode::Yield, 1, interrupt),
            Self::Block => flight::processes(size, Swarm, WaitMode::Block, 1, interrupt),
            Self::Yield => flight::processes(size, Swarm, WaitMode::Yield, 1, interrupt),
            Self::Packed => flight::processes(size, Swarm, WaitMode::Block, PACK, interrupt),
        }
    }
}

/// A swarm of some size, and how long it flies.
pub(super) struct Size {
    pub drones: u32,
    pub scenario: Scenario,
    /// The window that counts: from this tick up to that.
    pub from: u64,
    pub until: u64,
    /// Bytes that go down in a tick on average, and those that concern one drone.
    pub down_len: usize,
    pub read_len: usize,
}

impl Size {
    /// A grid in formation flight at the paper's spacing.
    pub fn new(drones: u32, quick: bool, ticks: Option<u64>) -> Result<Self, Failure> {
        let window = (240_000 / u64::from(drones + 16)).clamp(240, 12_000);
        let window = ticks.unwrap_or(if quick { window / 3 } else { window });
        // The plan that puts all into formation is made and known by then.
        let from = 60;
        let until = from + window;
        let scenario = scenario(drones, until + 80)?;
        let beacons = drones as f64 * scenario.time.dt_s / scenario.protocol.beacon_period_s;
        let heard = if drones < MANY { beacons } else { beacons.min(8.0 * beacons / f64::from(drones)) };
        let senses = size_of::<SensesHeader>() + 4 * size_of::<SensedNeighbour>();
        Ok(Self {
            drones,
            from,
            until,
            down_len: size_of::<DownlinkHeader>()
                + drones as usize * senses
                + (beacons * size_of::<AirFrame>() as f64) as usize,
            read_len: senses + (heard * size_of::<AirFrame>() as f64) as usize,
            scenario,
        })
    }

    /// Ticks that count.
    pub fn window(&self) -> u64 {
        self.until - self.from
    }
}

fn scenario(drones: u32, ticks: u64) -> Result<Scenario, Failure> {
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
    if drones >= MANY {
        // The leader hears all and is heard by all; everybody else hears the neighbours.
        text += "[radio]\nrange_m = 100\n[[radio.rule]]\nto = [0]\nrange_m = 100000\n";
        text += "[[radio.rule]]\ntopics = [\"leadership\", \"plan\", \"assignment\"]\nrange_m = 100000\n";
    }
    Scenario::parse(&text, ScenarioSource { name: "bench", stem: "bench" }, &[]).map_err(Failure::diagnostic)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_case_that_is_named_is_measured() {
        assert!(!Case::of(8, false, &[]).contains(&Case::Datagrams));
        assert!(Case::of(8, true, &[]).contains(&Case::Datagrams));
        assert_eq!(Case::of(8, false, &[Case::Floor, Case::Datagrams]), [Case::Floor, Case::Datagrams]);
        assert_eq!(Case::of(PACK, false, &[Case::Packed]), []);
    }
}
