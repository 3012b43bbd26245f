//! Scheduled faults in whole worlds, flown by hand.

use crate::fault_plan::{Fault, FaultEffect, FaultPlan, FaultTargets, FaultTime, FaultTrigger, ProcessCommand, Wind};
use crate::params::{Failsafe, WorldParams};
use crate::sensor_errors::RangingErrors;
use crate::testing::{command, event_kinds, events, params, rectangle, starts};
use crate::world::World;
use skein_protocol::record::{EventKind, FaultKind, ROW_ALIVE, ROW_FROZEN, RunEvent};
use skein_protocol::slot::Slot;
use skein_protocol::{DroneId, Vec2, Vec3};

const ID: DroneId = DroneId(3);

fn world(effect: FaultEffect, time: FaultTime, for_s: f64, params: WorldParams) -> World {
    let fault = Fault { effect, time, targets: FaultTargets::Drones(vec![ID]), for_s };
    let faults = FaultPlan { seed: 1, faults: vec![fault] };
    World::new(WorldParams { faults, ..params }, &starts(8), &[rectangle(140.0, 0.0, 10.0, 5.0)]).unwrap()
}

/// Flies this number of ticks. Gives the commands with their ticks, and the events.
fn fly(world: &mut World, ticks: u64) -> (Vec<(u64, ProcessCommand)>, Vec<RunEvent>) {
    let (mut commands, mut flown) = (Vec::new(), Vec::new());
    for _ in 0..ticks {
        let tick = world.tick();
        commands.extend(world.process_commands().iter().map(|&command| (tick, command)));
        let drones = world.downlink().drones.len() as u32;
        for id in 0..drones {
            world.take_slot(DroneId(id), &Slot::default());
        }
        world.advance();
        flown.extend(events(world));
    }
    (commands, flown)
}

fn fault_times(events: &[RunEvent]) -> Vec<(f64, bool)> {
    let time = |event: &RunEvent| match &event.what {
        EventKind::Fault { target, scheduled: true, .. } if *target == ID => Some((event.t_s, true)),
        EventKind::FaultOver { target, .. } if *target == ID => Some((event.t_s, false)),
        _ => None,
    };
    events.iter().filter_map(time).collect()
}

#[test]
fn a_kill_is_commanded_once_at_its_tick() {
    let mut world = world(FaultEffect::Kill, FaultTime::At(1.0), f64::INFINITY, params());
    let (commands, flown) = fly(&mut world, 100);
    assert_eq!(commands, [(50, ProcessCommand::Kill(ID))]);
    assert_eq!(fault_times(&flown), [(1.0, true)]);
    assert!(!world.is_alive(ID));
}

#[test]
fn a_frozen_drone_hovers_and_flies_on_later() {
    let land = WorldParams { failsafe: Failsafe::Land, ..params() };
    let mut world = world(FaultEffect::Freeze, FaultTime::At(1.0), 3.0, land);
    fly(&mut world, 190);
    let row = world.record().rows[ID.index()];
    assert!(world.is_frozen(ID) && world.is_alive(ID));
    assert_eq!((row.velocity_mps, row.flags & (ROW_ALIVE | ROW_FROZEN)), ([0.0; 3], ROW_ALIVE | ROW_FROZEN));
    let other = world.record().rows[2];
    assert!(row.energy_j > other.energy_j, "hovering takes more power than cruising, and is counted");
    let (commands, flown) = fly(&mut world, 30);
    assert_eq!(commands, [(200, ProcessCommand::Resume(ID))]);
    assert_eq!(fault_times(&flown), [(4.0, false)]);
    world.process_commands();
    world.downlink();
    world.take_slot(ID, &command(1.0, 0.0));
    world.advance();
    assert!(world.record().rows[ID.index()].velocity_mps[0] > 0.0);
    assert_eq!(world.record().head.lost, 0);
}

#[test]
fn a_frozen_drone_that_is_killed_is_not_resumed() {
    let mut world = world(FaultEffect::Freeze, FaultTime::At(1.0), 1.0, params());
    fly(&mut world, 60);
    world.mark_dead(ID, FaultKind::Kill, false, "");
    assert!(!world.is_frozen(ID));
    let (commands, flown) = fly(&mut world, 100);
    assert_eq!((commands, fault_times(&flown)), (vec![], vec![]));
}

#[test]
fn a_restarted_drone_has_the_next_incarnation() {
    let mut world = world(FaultEffect::Restart, FaultTime::At(1.0), 2.0, params());
    let (commands, flown) = fly(&mut world, 151);
    assert_eq!(commands, [(50, ProcessCommand::Kill(ID)), (150, ProcessCommand::Restart(ID, 2))]);
    assert_eq!(fault_times(&flown), [(1.0, true), (3.0, false)]);
    assert!(world.is_alive(ID));
    assert_eq!(world.incarnation(ID), Some(2));
    let head = world.downlink().drones[ID.index()];
    assert_eq!((head.alive, head.incarnation), (1, 2));
}

#[test]
fn a_landed_drone_is_not_started_again() {
    let land = WorldParams { failsafe: Failsafe::Land, timeout_s: 60.0, ..params() };
    let mut world = world(FaultEffect::Restart, FaultTime::At(0.0), 14.0, land);
    let (commands, _) = fly(&mut world, 800);
    assert_eq!(commands, [(0, ProcessCommand::Kill(ID))]);
    assert!(!world.is_alive(ID));
}

#[test]
fn a_swarm_that_awaits_a_restart_does_not_end_the_mission() {
    let targets = FaultTargets::All;
    let fault = Fault { effect: FaultEffect::Restart, time: FaultTime::At(1.0), targets, for_s: 1.0 };
    let faults = FaultPlan { seed: 1, faults: vec![fault] };
    let mut world = World::new(WorldParams { faults, ..params() }, &starts(8), &[]).unwrap();
    let (commands, _) = fly(&mut world, 120);
    assert_eq!((commands.len(), world.ended()), (16, None));
}

#[test]
fn a_blind_drone_detects_nothing() {
    // Drone 0 at the front comes into range at 1.5 s, the next two 2.47 s later.
    let blind = FaultEffect::Blind { obstacles: true, ranging: true };
    let fault =
        Fault { effect: blind, time: FaultTime::At(0.0), targets: FaultTargets::Drones(vec![DroneId(0)]), for_s: 60.0 };
    let faults = FaultPlan { seed: 1, faults: vec![fault] };
    let shape = [rectangle(140.0, 0.0, 10.0, 5.0)];
    let mut world = World::new(WorldParams { faults, ..params() }, &starts(8), &shape).unwrap();
    let (_, flown) = fly(&mut world, 300);
    let detected = event_kinds(flown).into_iter().find_map(|what| match what {
        EventKind::Detected { drone, .. } => Some(drone),
        _ => None,
    });
    assert_eq!(detected, Some(DroneId(1)));
    let view = world.downlink().view();
    assert!(view.senses(DroneId(0)).unwrap().neighbours.is_empty());
    assert!(!view.senses(DroneId(1)).unwrap().neighbours.is_empty());
}

#[test]
fn a_fault_on_detection_begins_in_the_tick_that_detects() {
    let time = FaultTime::On { event: FaultTrigger::Detected, stage: 0, after_s: 0.0 };
    let mut world = world(FaultEffect::Slow(0.4), time, 1.0, params());
    let (_, flown) = fly(&mut world, 80);
    let detected = flown.iter().find(|event| matches!(event.what, EventKind::Detected { .. })).unwrap();
    assert_eq!(fault_times(&flown), [(detected.t_s, true)]);
    assert_eq!(world.downlink().drones[ID.index()].extra_reaction_s, 0.4);
}

#[test]
fn wind_accelerates_its_targets_alone() {
    let wind = Wind { acceleration_mps2: Vec2::new(0.0, 1.0), gust_mps2: 0.0, gust_s: 1.0 };
    let mut world = world(FaultEffect::Wind(wind), FaultTime::At(0.0), 1.0, params());
    fly(&mut world, 100);
    let velocity = |world: &World, drone: usize| world.record().rows[drone].velocity_mps;
    assert!((velocity(&world, 3)[1] - 1.0).abs() < 1e-9, "a second of 1 m/s²: {:?}", velocity(&world, 3));
    assert_eq!(velocity(&world, 2)[1], 0.0);
}

/// The faulty drone ranges a neighbour that flies away from it: late while the fault lasts, and by the true course of the flight.
#[test]
fn late_ranging_begins_and_ends_with_its_fault() {
    let at = |x: f64, velocity: f64| (Vec3::new(x, 0.0, 50.0), Vec3::new(velocity, 0.0, 0.0));
    let starts = [at(0.0, 0.0), at(40.0, 1.0)];
    let late = RangingErrors { latency_s: 0.5, ..RangingErrors::default() };
    let fault = Fault {
        effect: FaultEffect::Ranging(late),
        time: FaultTime::At(1.0),
        targets: FaultTargets::Drones(vec![DroneId(0)]),
        for_s: 1.0,
    };
    let faults = FaultPlan { seed: 1, faults: vec![fault] };
    let mut world = World::new(WorldParams { faults, ..params() }, &starts, &[]).unwrap();
    for tick in 0..150_u64 {
        world.process_commands();
        let view = world.downlink().view();
        let ranged_m = |drone| view.senses(DroneId(drone)).unwrap().neighbours[0].position_m[0];
        let age_ticks = if (50..100).contains(&tick) { 25 } else { 0 };
        assert!((ranged_m(0) - (40.0 + 0.02 * (tick - age_ticks) as f64)).abs() < 1e-9, "tick {tick}: {}", ranged_m(0));
        assert!((ranged_m(1) + 40.0 + 0.02 * tick as f64).abs() < 1e-9, "the other drone has no fault");
        for id in 0..2 {
            world.take_slot(DroneId(id), &Slot::default());
        }
        world.advance();
    }
}

#[test]
fn frames_carry_the_link_faults_of_their_sender() {
    let mut world = world(FaultEffect::Mute, FaultTime::At(0.0), 1.0, params());
    world.downlink();
    let passed = skein_protocol::payload::Passed {
        stamp: skein_protocol::SimTime::ZERO,
        set_count: 0,
        set: [skein_protocol::ObstacleId(0); 32],
        of: 0,
    };
    let frame = skein_protocol::Message::Passed(passed).encode();
    world.take_frames(ID, &[frame]);
    world.take_frames(DroneId(0), &[frame]);
    world.advance();
    let down = world.downlink();
    assert_eq!(down.frames.iter().map(|frame| frame.link_faults.mute).collect::<Vec<_>>(), [0, 1]);
    let reasons: Vec<_> = down.frames.iter().map(|frame| down.drones[5].drop_reason(frame)).collect();
    assert_eq!(reasons, [None, Some(skein_protocol::radio::DropReason::Deaf)]);
}
