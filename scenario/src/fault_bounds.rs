//! How far the faults of a scenario can take what one drone reads of itself from the truth.

use crate::faults::{Fault, FaultKind};
use crate::keys::Scenario;
use skein_protocol::Vec2;
use std::collections::BTreeSet;

/// A random number of a fault is within this many standard deviations.
const NORMAL_BOUND: f64 = 6.0;

/// The greatest error of the position by `gnss` faults, m.
pub(crate) fn gnss_m(scenario: &Scenario) -> f64 {
    greatest_sum(scenario, |fault| match fault.kind {
        FaultKind::Gnss => gnss_of_m(fault, lasts_s(scenario, fault)),
        _ => 0.0,
    })
}

/// The greatest error of the position by faults of any kind, m.
pub(crate) fn position_m(scenario: &Scenario) -> f64 {
    greatest_sum(scenario, |fault| match fault.kind {
        FaultKind::Gnss => gnss_of_m(fault, lasts_s(scenario, fault)),
        FaultKind::Noise => {
            let corner = NORMAL_BOUND * fault.position_std_m.unwrap_or(0.0);
            vector(fault.position_bias_m).norm() + Vec2::new(corner, corner).norm()
        }
        _ => 0.0,
    })
}

/// The greatest error of the clock by `clock` faults, s.
pub(crate) fn clock_s(scenario: &Scenario) -> f64 {
    greatest_sum(scenario, |fault| {
        let offset_s = fault.clock_offset_s.unwrap_or(0.0);
        let gain_s = fault.clock_drift_ppm.unwrap_or(0.0) * 1e-6 * lasts_s(scenario, fault);
        offset_s.abs().max((offset_s + gain_s).abs())
    })
}

/// The greatest error by one `gnss` fault that lasts `lasts_s`, m. Its length has no maximum between the two ends.
fn gnss_of_m(fault: &Fault, lasts_s: f64) -> f64 {
    let bias_m = vector(fault.position_bias_m);
    let last_m = bias_m + vector(fault.position_drift_mps) * lasts_s;
    bias_m.norm().max(last_m.norm()).min(fault.position_error_max_m.unwrap_or(f64::INFINITY))
}

/// How long a fault lasts at most, s.
fn lasts_s(scenario: &Scenario, fault: &Fault) -> f64 {
    let left_s = (scenario.timeout_s() - fault.at_s.unwrap_or(0.0)).max(0.0);
    fault.for_s.map_or(left_s, |for_s| for_s.min(left_s))
}

/// The greatest sum of the errors of the faults that one drone can have at the same time. A fault by role can affect any drone.
fn greatest_sum(scenario: &Scenario, error: impl Fn(&Fault) -> f64) -> f64 {
    let mut named = vec![0.0; scenario.formation.drones as usize];
    let mut any = 0.0;
    for fault in &scenario.fault_plan {
        if fault.target.is_some() {
            any += error(fault);
        }
        let ids: BTreeSet<u32> = fault.drone.into_iter().chain(fault.drones.iter().flatten().copied()).collect();
        for id in ids {
            if let Some(sum) = named.get_mut(id as usize) {
                *sum += error(fault);
            }
        }
    }
    any + named.into_iter().fold(0.0, f64::max)
}

fn vector(key: Option<[f64; 2]>) -> Vec2 {
    key.map_or_else(Vec2::zeros, Vec2::from)
}
