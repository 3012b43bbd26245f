//! The cases of the runtime benchmark.

use super::baseline::{self, Transport};
use super::flight;
use super::measurement::Measurement;
use super::workload::Workload;
use crate::context::Context;
use crate::error::BenchError;
use clap::ValueEnum;
use serde::Serialize;
use skein_bus::WaitMode;

/// Drones per process in the case [`Case::Packed`].
const PACK: u32 = 32;

/// What is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Case {
    /// Raw shared memory with one futex word and one counter
    #[value(alias = "floor")]
    Baseline,
    /// The baseline's exchange over Unix datagrams
    Datagrams,
    /// Function calls, trivial pilot
    InlineBeacon,
    /// Processes that sleep while they wait, trivial pilot
    BlockBeacon,
    /// Processes that yield while they wait, trivial pilot
    YieldBeacon,
    /// Function calls, the paper's pilot in formation
    Inline,
    /// Processes that sleep while they wait, the paper's pilot in formation
    Block,
    /// Processes that yield while they wait, the paper's pilot in formation
    Yield,
    /// As block, with 32 drones per process
    Packed,
}

impl Case {
    /// The cases for a swarm of this size. `only` restricts them unless it is empty.
    pub(super) fn of(drones: u32, datagrams: bool, only: &[Self]) -> Vec<Self> {
        use Case::*;
        let all = [Baseline, Datagrams, InlineBeacon, BlockBeacon, YieldBeacon, Inline, Block, Yield, Packed];
        let applies = |case: &Case| match case {
            Datagrams => datagrams || only.contains(case),
            Packed => drones > PACK,
            _ => true,
        };
        let wanted = |case: &Case| only.is_empty() || only.contains(case);
        all.into_iter().filter(applies).filter(wanted).collect()
    }

    /// Its name in tables.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Baseline => "baseline",
            Self::Datagrams => "unix datagrams",
            Self::InlineBeacon => "inline, trivial",
            Self::BlockBeacon => "block, trivial",
            Self::YieldBeacon => "yield, trivial",
            Self::Inline => "inline, formation",
            Self::Block => "block, formation",
            Self::Yield => "yield, formation",
            Self::Packed => "block, formation, 32 per process",
        }
    }

    /// Measures the case once.
    pub(super) fn measure(self, workload: &Workload, context: &Context<'_>) -> Result<Measurement, BenchError> {
        const BEACON: &str = "beacon";
        const PAPER: &str = "paper";
        let processes = |pilot, wait, per_process| {
            let processes = flight::Processes { pilot, wait, per_process };
            flight::processes(workload, &processes, context)
        };
        match self {
            Self::Baseline => baseline::measure(workload, Transport::Memory, context.pilots.program()),
            Self::Datagrams => baseline::measure(workload, Transport::Datagrams, context.pilots.program()),
            Self::InlineBeacon => flight::inline(workload, BEACON, context),
            Self::Inline => flight::inline(workload, PAPER, context),
            Self::BlockBeacon => processes(BEACON, WaitMode::Block, 1),
            Self::YieldBeacon => processes(BEACON, WaitMode::Yield, 1),
            Self::Block => processes(PAPER, WaitMode::Block, 1),
            Self::Yield => processes(PAPER, WaitMode::Yield, 1),
            Self::Packed => processes(PAPER, WaitMode::Block, PACK),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_case_that_is_asked_for_is_measured() {
        assert!(!Case::of(8, false, &[]).contains(&Case::Datagrams));
        assert!(Case::of(8, true, &[]).contains(&Case::Datagrams));
        assert_eq!(Case::of(8, false, &[Case::Baseline, Case::Datagrams]), [Case::Baseline, Case::Datagrams]);
        assert_eq!(Case::of(PACK, false, &[Case::Packed]), []);
    }
}
