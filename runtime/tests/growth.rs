//! What a drone hears does not grow with the swarm, where radios have a limited range. Leaders exchange
//! no arrivals that they do not need.
#![allow(clippy::unwrap_used, reason = "a test fails where it cannot go on")]

mod support;

use skein_protocol::message::Topic;
use skein_protocol::record::{RecordSink, RecordView, SinkError};
use skein_runtime::{PilotRegistry, inline};
use support::scenario;

/// Time at which a grid has one leader and plan, and at which its flight ends, s.
const SETTLED_S: f64 = 15.0;
const END_S: f64 = 21.0;

/// Counts what all drones hear after [`SETTLED_S`].
#[derive(Default)]
struct Ears {
    heard: u64,
    steps: u64,
}

impl RecordSink for Ears {
    fn take(&mut self, record: RecordView<'_>) -> Result<(), SinkError> {
        if record.head.tick as f64 * 0.02 > SETTLED_S {
            self.heard += record.rows.iter().map(|row| u64::from(row.heard)).sum::<u64>();
            self.steps += record.rows.len() as u64;
        }
        Ok(())
    }
}

/// The messages that a drone of a grid over radios of 300 m hears per tick in formation.
fn heard_per_tick(drones: u32) -> f64 {
    let sets = [("formation.drones", drones.to_string()), ("time.timeout_s", END_S.to_string())];
    let scenario = scenario("grid", &sets.each_ref().map(|(key, value)| (*key, value.as_str())));
    let mut ears = Ears::default();
    inline::run(&scenario, &PilotRegistry::built_in().unwrap(), &mut ears, || None).unwrap();
    assert!(ears.steps >= 290 * u64::from(drones), "{} steps", ears.steps);
    ears.heard as f64 / ears.steps as f64
}

/// Beacons, states that are passed on, and messages of leaders. Each drone of the larger grid has more neighbours, and four times as many
/// others of which it hears from them.
#[test]
fn a_drone_of_a_large_swarm_hears_no_more_than_one_of_a_small_one() {
    let [small, large] = [100, 400].map(heard_per_tick);
    assert!(large < 1.1 * small, "{small} messages per tick with 100 drones, {large} with 400");
}

/// Counts rows of arrivals that are sent.
#[derive(Default)]
struct Rows(usize);

impl RecordSink for Rows {
    fn take(&mut self, record: RecordView<'_>) -> Result<(), SinkError> {
        self.0 += record.frames.iter().filter(|air| air.frame.kind == Topic::Arrivals as u16).count();
        Ok(())
    }
}

/// The leaders of two parts would have to exchange when each of their drones can be where, which all drones of a large swarm pass on. But drones
/// that pass in lanes of their own do not wait for each other.
#[test]
fn leaders_of_a_large_swarm_exchange_no_arrivals_where_drones_do_not_queue() {
    let sets = [("formation.drones", "150"), ("obstacle.0.centre_m", "[420, 0]"), ("time.timeout_s", "31")];
    let mut rows = Rows::default();
    inline::run(&scenario("grid", &sets), &PilotRegistry::built_in().unwrap(), &mut rows, || None).unwrap();
    assert_eq!(rows.0, 0);
}
