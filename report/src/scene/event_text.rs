//! The events of a run as text for people.

use crate::number_text::fixed;
use skein_protocol::DroneId;
use skein_protocol::record::{EventKind, RunEvent};

/// How severe an event is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Severity {
    /// A normal event.
    Info,
    /// A fault, scheduled or not, or the failure of a pilot.
    Warning,
    /// A violated invariant.
    Error,
}

/// The severity of an event.
#[must_use]
pub fn severity(event: &RunEvent) -> Severity {
    match event.what {
        EventKind::Fault { .. } | EventKind::Failure { .. } => Severity::Warning,
        EventKind::Violation { .. } => Severity::Error,
        _ => Severity::Info,
    }
}

/// Describes an event in one line, without its time.
#[must_use]
pub fn line(event: &RunEvent) -> String {
    match &event.what {
        EventKind::Detected { stage, drone, obstacle, distance_m } => {
            format!("drone {drone} senses obstacle {} of set {} at {distance_m:.1} m", obstacle.0, stage + 1)
        }
        EventKind::Passed { stage } => format!("all living drones are past set {}", stage + 1),
        EventKind::Leader { group, ballot, leader, leads } => {
            let what = if *leads { "becomes leader of" } else { "is no longer leader of" };
            format!("drone {leader} {what} {group} (round {})", ballot.round)
        }
        EventKind::Grouping { plan, group, phase, members, predicted_s, .. } => {
            let forecast = predicted_s.map_or(String::new(), |s| format!(", predicted pass time {s:.1} s"));
            format!("drone {} plans for {group}: {phase}, {members} drones{forecast}", plan.ballot.claimant)
        }
        EventKind::Assigned { drone, group, leader, route, rank, .. } => {
            let route = route.map_or(String::new(), |route| format!(", route {route}, place {rank}"));
            format!("drone {drone} joins {group}, led by drone {leader}{route}")
        }
        EventKind::Fault { kind, target, detail, .. } => format!("{}, {}: {detail}", name(kind), target_text(*target)),
        EventKind::FaultOver { kind, target, detail } => {
            format!("{}, {}, is over: {detail}", name(kind), target_text(*target))
        }
        EventKind::Failure { drone, pilot, reason } => format!("the pilot {pilot} of drone {drone} failed: {reason}"),
        EventKind::Violation { kind, drones, value_m } => {
            let value = if kind.is_distance() { format!(": {} m", fixed(*value_m, 2)) } else { String::new() };
            format!("{} violated by drones {}{value}", name(kind), list(drones))
        }
        EventKind::End { outcome, reason, .. } => format!("{}: {reason}", name(outcome)),
    }
}

/// The name of a value in JSON, with spaces.
fn name(value: &impl serde::Serialize) -> String {
    let name = serde_json::to_value(value).ok().and_then(|name| name.as_str().map(str::to_owned));
    name.unwrap_or_default().replace('-', " ")
}

fn target_text(target: DroneId) -> String {
    if target == DroneId::NONE { "the whole swarm".to_owned() } else { format!("drone {target}") }
}

fn list(drones: &[DroneId]) -> String {
    drones.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use skein_protocol::record::{FaultKind, ViolationKind};

    #[test]
    fn events_have_a_text_and_a_severity() {
        let kill =
            EventKind::Fault { kind: FaultKind::Kill, target: DroneId(3), scheduled: true, detail: "signal 9".into() };
        let kill = RunEvent { t_s: 1.0, what: kill };
        assert_eq!((line(&kill).as_str(), severity(&kill)), ("kill, drone 3: signal 9", Severity::Warning));
        let violation = EventKind::Violation {
            kind: ViolationKind::Separation,
            drones: vec![DroneId(1), DroneId(2)],
            value_m: 24.5,
        };
        let violation = RunEvent { t_s: 1.0, what: violation };
        assert_eq!(line(&violation), "separation violated by drones 1, 2: 24.50 m");
        assert_eq!(severity(&violation), Severity::Error);
    }
}
