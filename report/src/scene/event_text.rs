//! The run's events in words, for people.

use skein_protocol::DroneId;
use skein_protocol::record::{EventKind, RunEvent};

/// How much an event matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Severity {
    /// It is as it should be.
    Info,
    /// A fault: meant, or coped with.
    Warning,
    /// An invariant is broken.
    Error,
}

/// How much an event matters.
#[must_use]
pub fn severity(event: &RunEvent) -> Severity {
    match event.what {
        EventKind::Fault { .. } => Severity::Warning,
        EventKind::Violation { .. } => Severity::Error,
        _ => Severity::Info,
    }
}

/// An event in a line, without its time.
#[must_use]
pub fn line(event: &RunEvent) -> String {
    match &event.what {
        EventKind::Detected { stage, drone, obstacle, distance_m } => {
            format!("drone {drone} senses obstacle {} of set {} at {distance_m:.1} m", obstacle.0, stage + 1)
        }
        EventKind::Passed { stage } => format!("all are past set {}", stage + 1),
        EventKind::Leader { group, ballot, leader, leads } => {
            let what = if *leads { "leads" } else { "no longer leads" };
            format!("drone {leader} {what} {group} (round {})", ballot.round)
        }
        EventKind::Grouping { plan, group, phase, members, predicted_s, .. } => {
            let forecast = predicted_s.map_or(String::new(), |s| format!(", forecast {s:.1} s"));
            format!("plan for {group} by drone {}: {phase}, {members} drones{forecast}", plan.ballot.claimant)
        }
        EventKind::Assigned { drone, group, leader, route, rank, .. } => {
            let route = route.map_or(String::new(), |route| format!(", route {route}, place {rank}"));
            format!("drone {drone} is in {group} under drone {leader}{route}")
        }
        EventKind::Fault { kind, target, detail, .. } => format!("{} of {}: {detail}", name(kind), whom(*target)),
        EventKind::FaultOver { kind, target, detail } => {
            format!("{} of {} is over: {detail}", name(kind), whom(*target))
        }
        EventKind::Violation { kind, drones, value_m } => {
            format!("{} broken by drones {}: {value_m:.2}", name(kind), list(drones))
        }
        EventKind::End { outcome, reason, .. } => format!("{}: {reason}", name(outcome)),
    }
}

fn name(value: &impl serde::Serialize) -> String {
    let name = serde_json::to_value(value).ok().and_then(|name| name.as_str().map(str::to_owned));
    name.unwrap_or_default().replace('-', " ")
}

fn whom(target: DroneId) -> String {
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
        assert_eq!((line(&kill).as_str(), severity(&kill)), ("kill of drone 3: signal 9", Severity::Warning));
        let broken = EventKind::Violation {
            kind: ViolationKind::Separation,
            drones: vec![DroneId(1), DroneId(2)],
            value_m: 24.5,
        };
        let broken = RunEvent { t_s: 1.0, what: broken };
        assert_eq!(line(&broken), "separation broken by drones 1, 2: 24.50");
        assert_eq!(severity(&broken), Severity::Error);
    }
}
