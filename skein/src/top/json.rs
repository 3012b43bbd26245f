//! The running swarms as JSON, for scripts.

use super::swarm_view::SwarmView;
use serde_json::{Value, json};
use skein_protocol::record::DroneRow;
use std::collections::BTreeMap;

/// One object: each swarm with its rates, groups and drones. Rates are per second of wall time.
pub(crate) fn page(swarms: &[SwarmView]) -> Value {
    json!({ "swarms": swarms.iter().map(swarm).collect::<Vec<Value>>() })
}

fn swarm(view: &SwarmView) -> Value {
    let (facts, rates) = (&view.tap.facts, view.rates);
    let all = rates.heard + rates.dropped;
    json!({
        "name": view.run.name(), "scenario": facts.scenario, "strategy": facts.strategy, "seed": facts.seed,
        "drones": facts.drones, "alive": view.rows.iter().filter(|row| row.alive()).count(),
        "t_s": view.t_s, "ticks_per_s": rates.ticks, "realtime_factor": rates.real,
        "separation_m": view.separation_m, "sent_per_s": rates.sent, "heard_per_s": rates.heard,
        "dropped_per_s": rates.dropped, "loss": (all > 0.0).then(|| rates.dropped / all),
        "groups": groups(&view.rows), "rows": view.rows.iter().enumerate().map(row).collect::<Vec<Value>>(),
    })
}

fn groups(rows: &[DroneRow]) -> Vec<Value> {
    let mut groups: BTreeMap<String, Vec<usize>> = BTreeMap::new();
    for (drone, row) in rows.iter().enumerate().filter(|(_, row)| row.alive()) {
        groups.entry(row.group.to_string()).or_default().push(drone);
    }
    let group = |(name, drones): (String, Vec<usize>)| {
        let leaders: Vec<usize> = drones.iter().copied().filter(|&drone| rows[drone].leads()).collect();
        json!({ "group": name, "drones": drones, "leaders": leaders })
    };
    groups.into_iter().map(group).collect()
}

fn row((drone, row): (usize, &DroneRow)) -> Value {
    json!({
        "drone": drone, "alive": row.alive(), "frozen": row.is_frozen(), "position_m": row.position_m,
        "velocity_mps": row.velocity_mps, "energy_j": row.energy_j, "group": row.group.to_string(),
        "leader": row.leader(), "leads": row.leads().then(|| row.led.to_string()), "phase": row.phase(),
        "step_us": f64::from(row.step_ns) / 1e3,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use skein_protocol::record::{ROW_ALIVE, ROW_LEADS};

    #[test]
    fn dead_drones_are_in_no_group_and_no_leader_is_null() {
        let alive = DroneRow { flags: ROW_ALIVE | ROW_LEADS, ..DroneRow::default() };
        let rows = [alive, DroneRow { flags: ROW_ALIVE, ..alive }, DroneRow::default()];
        assert_eq!(groups(&rows), [json!({ "group": "N", "drones": [0, 1], "leaders": [0] })]);
        let dead = row((2, &rows[2]));
        assert_eq!((&dead["alive"], &dead["leader"], &dead["leads"]), (&json!(false), &Value::Null, &Value::Null));
    }
}
