//! Rules between the keys of a fault.

use crate::broken_rule::BrokenRule;
use crate::faults::{Fault, FaultEvent, FaultKind};
use crate::keys::Scenario;
use skein_protocol::link_faults::MAX_PARTITIONS;
use std::collections::BTreeSet;

/// The rules that the scenario's faults break.
pub(crate) fn broken(scenario: &Scenario) -> Vec<BrokenRule> {
    let mut broken = Vec::new();
    for (number, fault) in scenario.fault_plan.iter().enumerate() {
        let mut rules = FaultRules { path: format!("fault.{number}"), scenario, fault, broken: &mut broken };
        rules.time();
        rules.targets();
        rules.keys_of_kind();
        rules.sides();
    }
    let mut partitions = scenario.fault_plan.iter().enumerate().filter(|(_, f)| f.kind == FaultKind::Partition);
    if let Some((number, _)) = partitions.nth(MAX_PARTITIONS) {
        let message = format!("found one more partition, expected at most {MAX_PARTITIONS} in a scenario");
        broken.push(BrokenRule { keys: vec![format!("fault.{number}.kind")], message });
    }
    broken
}

struct FaultRules<'a> {
    path: String,
    scenario: &'a Scenario,
    fault: &'a Fault,
    broken: &'a mut Vec<BrokenRule>,
}

impl FaultRules<'_> {
    fn expect(&mut self, holds: bool, keys: &[&str], message: impl FnOnce() -> String) {
        if !holds {
            let keys = keys.iter().map(|key| format!("{}.{key}", self.path)).collect();
            self.broken.push(BrokenRule { keys, message: message() });
        }
    }

    fn time(&mut self) {
        let fault = self.fault;
        self.expect(fault.at_s.is_some() || fault.on.is_some(), &["at_s", "kind"], || {
            "is missing: expected the time of the fault, either at_s or on".to_owned()
        });
        self.expect(fault.at_s.is_none() || fault.on.is_none(), &["on"], || {
            "expected either this key or at_s, not both".to_owned()
        });
        self.expect(fault.on.is_some() || fault.after_s == 0.0, &["after_s"], || {
            "needs an event: expected the key on beside it".to_owned()
        });
        let Some(event) = fault.on else {
            let message = || "needs an event: expected the key on beside it".to_owned();
            return self.expect(fault.stage == 0, &["stage"], message);
        };
        let sets = self.scenario.obstacles.len();
        let election = matches!(event, FaultEvent::LeaderElected | FaultEvent::GroupLeaderElected);
        self.expect(election || sets > 0, &["on"], || {
            "waits for an obstacle set, expected at least one [[obstacle]] in the scenario".to_owned()
        });
        self.expect(election || sets == 0 || (fault.stage as usize) < sets, &["stage"], || {
            format!("found {}, expected an obstacle set from 0 to {} at most", fault.stage, sets - 1)
        });
    }

    fn targets(&mut self) {
        let fault = self.fault;
        let keys =
            [("drone", fault.drone.is_some()), ("drones", fault.drones.is_some()), ("target", fault.target.is_some())];
        let written: Vec<&str> = keys.iter().filter(|(_, is)| *is).map(|(key, _)| *key).collect();
        match (fault.kind, written.as_slice()) {
            (FaultKind::Partition, [key, ..]) => {
                self.expect(false, &[key], || "does not belong to a partition, expected its drones in sides".to_owned())
            }
            (FaultKind::HostDown | FaultKind::HostCut, written) => {
                if let Some(key) = written.first() {
                    self.expect(false, &[key], || "does not belong to a fault of a host, expected host".to_owned());
                }
                self.host();
            }
            (FaultKind::Partition | FaultKind::Wind, []) | (_, [_]) => {}
            (_, []) => self.expect(false, &["target", "kind"], || {
                "is missing: expected the targets of the fault, one of drone, drones, target".to_owned()
            }),
            (_, [_, second, ..]) => {
                self.expect(false, &[second], || format!("expected either this key or {}, not both", written[0]));
            }
        }
        let drones = self.scenario.formation.drones;
        let named = [("drone", fault.drone.as_slice()), ("drones", fault.drones.as_deref().unwrap_or_default())];
        for (key, ids) in named {
            for &id in ids.iter().filter(|id| **id >= drones) {
                self.expect(false, &[key], || format!("found drone {id}, expected one from 0 to {}", drones - 1));
            }
        }
    }

    fn host(&mut self) {
        let names: Vec<&str> = self.scenario.hosts.iter().map(|host| host.name.as_str()).collect();
        let found = self.fault.host.as_deref();
        self.expect(found.is_some_and(|name| names.contains(&name)), &["host", "kind"], || {
            let found = found.map_or("is missing".to_owned(), |name| format!("found {name:?}"));
            match names.is_empty() {
                true => format!("{found}: expected the name of a host, and at least one [[host]] in the scenario"),
                false => format!("{found}: expected the name of a host: {}", names.join(", ")),
            }
        });
    }

    /// Keys that only some kinds allow, and keys that some kinds need.
    fn keys_of_kind(&mut self) {
        use FaultKind::{
            Blind, Clock, Freeze, Gnss, HostCut, HostDown, Noise, Partition, Ranging, Restart, Slow, Wind,
        };
        let fault = self.fault;
        let keys: [(&str, bool, &[FaultKind]); 23] = [
            ("reaction_time_s", fault.reaction_time_s.is_some(), &[Slow]),
            ("sides", fault.sides.is_some(), &[Partition]),
            ("sensor", fault.sensor.is_some(), &[Blind]),
            ("ranging_std_m", fault.ranging_std_m.is_some(), &[Ranging]),
            ("ranging_bearing_std_rad", fault.ranging_bearing_std_rad.is_some(), &[Ranging]),
            ("ranging_velocity_std_mps", fault.ranging_velocity_std_mps.is_some(), &[Ranging]),
            ("ranging_outlier_share", fault.ranging_outlier_share.is_some(), &[Ranging]),
            ("ranging_outlier_m", fault.ranging_outlier_m.is_some(), &[Ranging]),
            ("ranging_dropout_share", fault.ranging_dropout_share.is_some(), &[Ranging]),
            ("ranging_latency_s", fault.ranging_latency_s.is_some(), &[Ranging]),
            ("ranging_field_rad", fault.ranging_field_rad.is_some(), &[Ranging]),
            ("ranging_occlusion", fault.ranging_occlusion.is_some(), &[Ranging]),
            ("position_bias_m", fault.position_bias_m.is_some(), &[Noise, Gnss]),
            ("position_std_m", fault.position_std_m.is_some(), &[Noise]),
            ("velocity_bias_mps", fault.velocity_bias_mps.is_some(), &[Noise]),
            ("velocity_std_mps", fault.velocity_std_mps.is_some(), &[Noise]),
            ("position_drift_mps", fault.position_drift_mps.is_some(), &[Gnss]),
            ("position_error_max_m", fault.position_error_max_m.is_some(), &[Gnss]),
            ("clock_offset_s", fault.clock_offset_s.is_some(), &[Clock]),
            ("clock_drift_ppm", fault.clock_drift_ppm.is_some(), &[Clock]),
            ("wind_mps2", fault.wind_mps2.is_some(), &[Wind]),
            ("gust_mps2", fault.gust_mps2.is_some(), &[Wind]),
            ("gust_s", fault.gust_s.is_some(), &[Wind]),
        ];
        for (key, _, kinds) in keys.iter().filter(|(_, is, kinds)| *is && !kinds.contains(&fault.kind)) {
            let found = fault.kind.word();
            let words: Vec<String> = kinds.iter().map(|kind| format!("{:?}", kind.word())).collect();
            self.expect(false, &[key], || format!("belongs to kind = {}, found kind = {found:?}", words.join(" or ")));
        }
        self.expect(fault.host.is_none() || matches!(fault.kind, HostDown | HostCut), &["host"], || {
            format!("belongs to kind = \"host-down\" or \"host-cut\", found kind = {:?}", fault.kind.word())
        });
        let has = |wanted: &[&str]| keys.iter().any(|(key, is, _)| *is && wanted.contains(key));
        let needed: &[&str] = match fault.kind {
            Slow => &["reaction_time_s"],
            Partition => &["sides"],
            Ranging => &[
                "ranging_dropout_share",
                "ranging_std_m",
                "ranging_bearing_std_rad",
                "ranging_velocity_std_mps",
                "ranging_outlier_share",
                "ranging_outlier_m",
                "ranging_latency_s",
                "ranging_field_rad",
                "ranging_occlusion",
            ],
            Gnss => &["position_bias_m", "position_drift_mps"],
            Clock => &["clock_offset_s", "clock_drift_ppm"],
            Noise => &["position_std_m", "position_bias_m", "velocity_std_mps", "velocity_bias_mps"],
            Wind => &["wind_mps2", "gust_mps2"],
            _ => &[],
        };
        self.expect(needed.is_empty() || has(needed), &[needed.first().unwrap_or(&"kind"), "kind"], || {
            format!("is missing: kind = {:?} needs {}", fault.kind.word(), needed.join(" or "))
        });
        let spans = matches!(fault.kind, Freeze | Restart | HostCut);
        self.expect(!spans || fault.for_s.is_some(), &["for_s", "kind"], || {
            format!("is missing: kind = {:?} needs for_s", fault.kind.word())
        });
        self.expect(fault.kind != FaultKind::Kill || fault.for_s.is_none(), &["for_s"], || {
            "does not belong to kind = \"kill\", expected kind = \"restart\" for a drone that comes back".to_owned()
        });
    }

    fn sides(&mut self) {
        let Some(sides) = &self.fault.sides else { return };
        let drones = self.scenario.formation.drones;
        let sides = sides.of(drones);
        self.expect(sides.iter().all(|side| !side.is_empty()), &["sides"], || {
            format!("found an empty side with {drones} drones, expected at least one drone on each side")
        });
        let mut seen = BTreeSet::new();
        for id in sides.into_iter().flatten() {
            self.expect(id < drones, &["sides"], || format!("found drone {id}, expected one from 0 to {}", drones - 1));
            self.expect(seen.insert(id), &["sides"], || {
                format!("found drone {id} twice, expected it on one side only")
            });
        }
    }
}
