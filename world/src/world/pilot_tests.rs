//! What pilots report about themselves, their failures, and the ends of a mission that depend on pilots or time.

use crate::fault_plan::ProcessCommand;
use crate::params::{End, WorldParams};
use crate::testing::{command, event_kinds, events, params, starts, tick};
use crate::world::World;
use skein_protocol::record::{EventKind, FaultKind, Outcome};
use skein_protocol::slot::{LinkStats, SLOT_DONE, SLOT_FAILED, Slot};
use skein_protocol::telemetry::Telemetry;
use skein_protocol::{DroneId, Message, MetricName, TopicName, UserMessage};

const ID: DroneId = DroneId(3);

fn world(end: End) -> World {
    World::new(WorldParams { end, pilots: vec!["boids".to_owned(); 8], ..params() }, &starts(8), &[]).unwrap()
}

fn order(value: f64) -> Telemetry {
    Telemetry::Metric { name: MetricName::new("order").unwrap(), value }
}

/// Lets one drone answer `one` and the others `rest`, and advances one tick.
fn answer(world: &mut World, one: &Slot, rest: &Slot) {
    world.downlink();
    for id in (0..8).map(DroneId) {
        world.take_slot(id, if id == ID { one } else { rest });
    }
    world.advance();
}

#[test]
fn telemetry_is_recorded_and_never_on_the_air() {
    let gossip = UserMessage::new(TopicName::new("gossip").unwrap(), b"hello").unwrap();
    let (mut told, mut untold) = (world(End::Pilots), world(End::Pilots));
    told.take_frames(ID, &[order(0.5).encode(), Message::User(gossip).encode(), order(f64::NAN).encode()]);
    untold.take_frames(ID, &[Message::User(gossip).encode()]);
    for world in [&mut told, &mut untold] {
        tick(world, &Slot::default());
        let frames = world.record().frames;
        assert_eq!((frames.len(), frames[0].sequence), (1, 0));
    }
    let rows: Vec<_> = told.record().telemetry.iter().map(|row| (row.drone, row.telemetry())).collect();
    assert_eq!(rows, [(ID, Some(order(0.5)))]);
    assert_eq!(told.digest(), untold.digest());
    tick(&mut told, &Slot::default());
    assert!(told.record().telemetry.is_empty());
    told.finish(&LinkStats::default(), 1.0);
    let Some(EventKind::End { totals, .. }) = event_kinds(events(&told)).pop() else { panic!("no end") };
    assert_eq!((totals.sent, totals.telemetry_refused), (1, 1));
}

#[test]
fn a_drone_whose_pilot_fails_brakes_and_is_killed_when_the_next_tick_begins() {
    let mut world = world(End::Pilots);
    let failed = Slot { flags: SLOT_FAILED, ..command(5.0, 0.0) };
    let reason = "the pilot panicked".to_owned();
    world.take_frames(ID, &[Telemetry::Failure { reason: reason.clone() }.encode()]);
    answer(&mut world, &failed, &Slot::default());
    assert!(world.record().rows[ID.index()].velocity_mps[0] < 10.0, "it brakes");
    let failure = EventKind::Failure { drone: ID, pilot: "boids".to_owned(), reason: reason.clone() };
    assert_eq!(event_kinds(events(&world)), [failure]);
    assert!(world.is_alive(ID));
    assert_eq!(world.process_commands(), [ProcessCommand::Kill(ID)]);
    let killed = EventKind::Fault { kind: FaultKind::Kill, target: ID, scheduled: false, detail: reason };
    assert_eq!(event_kinds(tick(&mut world, &Slot::default())), [killed]);
    assert!(!world.is_alive(ID));
    assert_eq!(world.process_commands(), []);
}

#[test]
fn a_mission_that_lasts_a_time_reaches_its_end_then() {
    let mut world = world(End::Time { duration_s: 1.0 });
    while world.ended().is_none() {
        tick(&mut world, &Slot::default());
    }
    assert_eq!((world.ended(), world.tick()), (Some(Outcome::Reached), 50));
}

#[test]
fn a_mission_ends_when_all_living_pilots_are_done() {
    let mut world = world(End::Pilots);
    let done = Slot { flags: SLOT_DONE, ..Slot::default() };
    tick(&mut world, &Slot::default());
    answer(&mut world, &Slot::default(), &done);
    assert_eq!(world.ended(), None, "one drone is not done");
    world.mark_dead(ID, FaultKind::Kill, false, "");
    tick(&mut world, &done);
    assert_eq!(world.ended(), Some(Outcome::Reached));
}

#[test]
fn a_mission_without_living_drones_is_never_a_success() {
    for end in [End::Pilots, End::Time { duration_s: 0.02 }] {
        let mut world = world(end);
        (0..8).for_each(|id| world.mark_dead(DroneId(id), FaultKind::Kill, false, ""));
        tick(&mut world, &Slot { flags: SLOT_DONE, ..Slot::default() });
        assert_eq!(world.ended(), Some(Outcome::Stuck));
    }
}
