//! Whole missions of a world, flown by hand.

use super::*;
use crate::params::{End, Failsafe};
use crate::testing::{command, event_kinds, events, params, rectangle, starts, tick};
use skein_protocol::record::{ROW_ALIVE, ROW_LATE, RunEvent, Totals, ViolationKind};
use skein_protocol::shape::ShapeError;
use skein_protocol::slot::SLOT_LEADS;
use skein_protocol::{Ballot, Lack, Message, ObstacleId, PlanStamp, Vec2};

const CRUISE: [f64; 3] = [10.0, 0.0, 0.0];

fn eight(params: WorldParams, obstacles: &[ConvexShape]) -> World {
    World::new(params, &starts(8), obstacles).unwrap()
}

/// Flies straight on until the end. Gives all events.
fn fly(world: &mut World, slot: &Slot) -> Vec<RunEvent> {
    let mut all = Vec::new();
    while world.ended().is_none() {
        all.extend(tick(world, slot));
    }
    all
}

fn frame() -> Frame {
    let passed =
        skein_protocol::payload::Passed { stamp: SimTime::ZERO, set_count: 0, set: [ObstacleId(0); 32], of: 0 };
    Message::Passed(passed).encode()
}

#[test]
fn eight_drones_without_obstacles_run_out_of_time() {
    let mut world = eight(params(), &[]);
    assert_eq!(fly(&mut world, &Slot::default()), []);
    assert_eq!((world.ended(), world.tick()), (Some(Outcome::Timeout), 500));
    let record = world.record();
    assert_eq!((record.head.tick, record.head.now, record.rows.len()), (499, SimTime::from_secs(10.0), 8));
    assert!((record.rows[0].position_m[0] - 100.0).abs() < 1e-9);
    assert_eq!(record.rows[0].velocity_mps, CRUISE);
    assert!((record.rows[7].energy_j - 1260.3).abs() < 0.1, "ten seconds at 126.03 W");
    assert!((world.min_separation_m() - 35.0).abs() < 1e-9);
}

#[test]
fn an_invalid_start_or_obstacle_is_named() {
    let error = |starts: &[(Vec3, Vec3)], obstacles: &[ConvexShape]| {
        World::new(params(), starts, obstacles).map(|_| ()).unwrap_err()
    };
    assert_eq!(error(&[(Vec3::new(0.0, 0.0, f64::NAN), Vec3::zeros())], &[]), WorldError::Start(0));
    let hollow = ConvexShape { count: 0, ..rectangle(0.0, 0.0, 1.0, 1.0) };
    let wrong = error(&[], &[rectangle(0.0, 0.0, 1.0, 1.0), hollow]);
    assert_eq!(wrong, WorldError::Obstacle { index: 1, error: ShapeError::Count(0) });
    assert!(World::new(WorldParams { dt_ns: -1, ..params() }, &[], &[]).is_err());
}

#[test]
fn detection_is_logged_at_the_opening_and_passing_at_the_end_of_a_tick() {
    // From x = 0 at 10 m/s. The obstacle begins at x = 130 m, so it is 115 m away when the front reaches 15 m.
    let obstacle = rectangle(140.0, 0.0, 10.0, 5.0);
    let mut world = eight(WorldParams { timeout_s: 30.0, ..params() }, &[obstacle]);
    let logged = fly(&mut world, &Slot::default());
    let Some(RunEvent { t_s, what: EventKind::Detected { stage: 0, drone, distance_m, .. } }) = logged.first() else {
        panic!("{logged:?}");
    };
    assert_eq!(*drone, DroneId(0));
    assert!((1.5..=1.521).contains(t_s) && (114.79..=115.0).contains(distance_m), "{t_s} s, {distance_m} m");
    let passed = logged.iter().find(|event| event.what == EventKind::Passed { stage: 0 }).unwrap();
    // The last drone starts 3·35/√2 behind.
    let wanted = (140.0 + 3.0 * 35.0 / 2f64.sqrt()) / 10.0;
    assert!((0.0..=0.021).contains(&(passed.t_s - wanted)), "{} s", passed.t_s);
    assert!(logged.is_sorted_by(|a, b| a.t_s <= b.t_s));
    assert_eq!(world.ended(), Some(Outcome::Unsafe), "the front flew through it");
    assert!(world.min_clearance_m() < 0.0);
}

#[test]
fn commands_that_are_not_finite_are_counted_and_huge_ones_clipped() {
    let mut world = eight(params(), &[]);
    world.take_slot(DroneId(0), &command(f64::NAN, 0.0));
    world.take_slot(DroneId(1), &command(0.0, 1e200));
    for id in 2..8 {
        world.take_slot(DroneId(id), &Slot::default());
    }
    world.take_slot(DroneId(99), &command(1.0, 0.0));
    world.advance();
    assert_eq!(world.record().rows[0].velocity_mps, CRUISE);
    assert_eq!(world.record().rows[1].velocity_mps, [10.0, 0.1, 0.0]);
    assert_eq!(totals_of(&mut world).rejected_commands, 1);
}

/// Ends the mission. Gives the totals of its end event.
fn totals_of(world: &mut World) -> Totals {
    world.finish(&LinkStats::default(), 2.5);
    match event_kinds(events(world)).pop() {
        Some(EventKind::End { totals, .. }) => *totals,
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_late_drone_brakes_and_receives_nothing() {
    let mut world = eight(params(), &[]);
    tick(&mut world, &Slot { heard: 3, step_ns: 9, ..command(1.0, 0.0) });
    let before = world.record().rows[0].velocity_mps[0];
    for id in 1..8 {
        world.take_slot(DroneId(id), &command(1.0, 0.0));
    }
    world.hold(DroneId(0));
    world.advance();
    let rows = world.record().rows;
    assert!(rows[0].velocity_mps[0] < before && rows[1].velocity_mps[0] > before);
    assert_eq!((rows[0].flags, rows[0].heard, rows[0].step_ns), (ROW_ALIVE | ROW_LATE, 0, 0));
    world.advance();
    assert_eq!(world.record().rows[7].flags, ROW_ALIVE | ROW_LATE, "a missing answer counts as late");
    let totals = totals_of(&mut world);
    assert_eq!((totals.deadline_misses, totals.delivered), (9, 24));
}

#[test]
fn a_drone_without_commands_brakes_until_the_next_one() {
    let mut world = eight(params(), &[]);
    tick(&mut world, &command(1.0, 0.0));
    let mut speeds = Vec::new();
    for _ in 0..200 {
        for id in 1..8 {
            world.take_slot(DroneId(id), &command(0.0, 0.0));
        }
        world.advance();
        speeds.push(world.record().rows[0].velocity_mps[0]);
    }
    assert!(speeds.is_sorted_by(|a, b| a >= b) && speeds[1] < speeds[0] && speeds[199] == 0.0, "{speeds:?}");
    tick(&mut world, &command(1.0, 0.0));
    assert!(world.record().rows[0].velocity_mps[0] > 0.0);
}

#[test]
fn frames_are_stamped_and_are_in_the_next_downlink() {
    let mut world = eight(params(), &[]);
    world.take_frames(DroneId(3), &[frame()]);
    world.take_frames(DroneId(1), &[frame(), frame()]);
    tick(&mut world, &Slot::default());
    assert_eq!(world.record().frames.len(), 3);
    world.take_frames(DroneId(1), &[frame()]);
    let heads = |frames: &[AirFrame]| frames.iter().map(|f| (f.tick, f.source.0, f.sequence)).collect::<Vec<_>>();
    assert_eq!(heads(&world.downlink().frames), [(0, 1, 0), (0, 1, 1), (0, 3, 0)]);
    assert_eq!(world.downlink().frames[0].position(), starts(8)[1].0, "the position is that of the sending");
    assert_eq!(world.downlink().head.frames, 3);
    world.advance();
    assert_eq!(heads(&world.downlink().frames), [(1, 1, 2)]);
    assert_eq!(totals_of(&mut world).sent, 4);
}

#[test]
fn a_dead_drone_brakes_stays_and_sends_nothing() {
    let mut world = eight(WorldParams { timeout_s: 20.0, ..params() }, &[]);
    tick(&mut world, &Slot { flags: SLOT_LEADS, ..Slot::default() });
    world.mark_dead(DroneId(7), FaultKind::Kill, true, "SIGKILL");
    world.mark_dead(DroneId(7), FaultKind::Kill, true, "again");
    world.take_frames(DroneId(7), &[frame()]);
    world.take_slot(DroneId(7), &command(5.0, 0.0));
    world.advance();
    let fault =
        EventKind::Fault { kind: FaultKind::Kill, target: DroneId(7), scheduled: true, detail: "SIGKILL".into() };
    assert_eq!(events(&world), [RunEvent { t_s: 0.02, what: fault }]);
    let row = world.record().rows[7];
    assert_eq!((row.flags, world.record().frames.len(), world.is_alive(DroneId(7))), (0, 0, false));
    assert_eq!(row.velocity_mps, [9.9, 0.0, 0.0]);
    let energy = row.energy_j;
    fly(&mut world, &Slot::default());
    let row = world.record().rows[7];
    assert_eq!((row.velocity_mps, row.energy_j), ([0.0; 3], energy));
    assert_eq!(world.downlink().drones[7].alive, 0);
}

#[test]
fn dead_bodies_still_count_for_separation_until_they_have_landed() {
    let pair = [(0.0, 0.0), (-200.0, 10.0)].map(|(x, vx)| (Vec3::new(x, 0.0, 50.0), Vec3::new(vx, 0.0, 0.0)));
    let outcome = |failsafe| {
        let mut world = World::new(WorldParams { failsafe, timeout_s: 30.0, ..params() }, &pair, &[]).unwrap();
        world.mark_dead(DroneId(0), FaultKind::Hung, false, "no answer");
        fly(&mut world, &Slot::default());
        (world.ended(), world.violations())
    };
    assert_eq!(outcome(Failsafe::Hover), (Some(Outcome::Unsafe), 1));
    assert_eq!(outcome(Failsafe::Land), (Some(Outcome::Timeout), 0));
}

#[test]
fn a_time_out_says_who_is_not_done_and_whether_the_swarm_stands_still() {
    let ended = |brakes_mps2: f64| {
        let params = WorldParams { end: End::Goal { front_m: Vec2::new(1e4, 0.0) }, timeout_s: 30.0, ..params() };
        let mut world = eight(params, &[rectangle(900.0, 0.0, 5.0, 5.0)]);
        // After 10 s they brake to a stop, or hardly brake and fly on. They are far from their slots in either case.
        for at in 0.. {
            let braking = if (500..600).contains(&at) { brakes_mps2 } else { 0.0 };
            tick(&mut world, &command(braking, 0.0));
            if world.ended().is_some() {
                break;
            }
        }
        assert_eq!(world.ended(), Some(Outcome::Timeout));
        world.finish(&LinkStats::default(), 0.0);
        let Some(EventKind::End { reason, unfinished, standstill_s, .. }) = event_kinds(events(&world)).pop() else {
            panic!("no end")
        };
        (reason, unfinished, standstill_s)
    };
    let (reason, unfinished, standstill_s) = ended(-5.0);
    assert!(reason.starts_with("the time of 30 s is over; no drone has moved for 1"), "{reason}");
    assert!(standstill_s.is_some_and(|still_s| (18.0..20.0).contains(&still_s)), "{standstill_s:?}");
    assert_eq!(unfinished.len(), 8);
    assert!(unfinished.iter().all(|drone| drone.lack == Lack::Slot && drone.stage == Some(0)), "{unfinished:?}");
    let (reason, unfinished, standstill_s) = ended(-0.05);
    assert!(reason.contains("slow: 8 of the 8 drones"), "{reason}");
    assert_eq!((unfinished.len(), standstill_s), (8, None));
}

#[test]
fn without_living_drones_the_mission_is_over() {
    let mut world = eight(params(), &[]);
    for id in 0..8 {
        world.mark_dead(DroneId(id), FaultKind::Kill, false, "exit 1");
    }
    world.advance();
    assert_eq!(world.ended(), Some(Outcome::Stuck));
    world.finish(&LinkStats::default(), 0.0);
    let Some(EventKind::End { reason, stuck, .. }) = event_kinds(events(&world)).pop() else { panic!("no end") };
    assert_eq!((reason.as_str(), stuck.len()), ("no drone is left alive", 8));
}

#[test]
fn a_drone_without_a_way_ends_the_mission_in_its_first_tick() {
    let mut world = eight(WorldParams { without_way: vec![DroneId(2), DroneId(5)], ..params() }, &[]);
    world.advance();
    assert_eq!((world.ended(), world.tick()), (Some(Outcome::Stuck), 1));
    world.finish(&LinkStats::default(), 0.0);
    let Some(EventKind::End { reason, stuck, .. }) = event_kinds(events(&world)).pop() else { panic!("no end") };
    assert_eq!(stuck, [DroneId(2), DroneId(5)]);
    assert!(reason.starts_with("drones 2, 5 have no way"), "{reason}");
}

#[test]
fn a_held_formation_ends_the_mission_with_a_last_record() {
    let end = End::Hold { stop_x_m: 15.0 };
    let mut world = eight(WorldParams { end, ..params() }, &[]);
    for _ in 0..50 {
        tick(&mut world, &Slot::default());
    }
    // Each tick of braking takes away 0.099 m/s: after the 91st less than 1 m/s is left.
    while world.ended().is_none() {
        tick(&mut world, &command(-4.95, 0.0));
    }
    assert_eq!((world.ended(), world.tick()), (Some(Outcome::Reached), 141));
    let digest = world.digest();
    world.finish(&LinkStats::default(), 2.5);
    let record = world.record();
    assert_eq!((record.rows.len(), record.frames.len(), record.head.tick, record.head.digest), (0, 0, 140, digest));
    let logged = events(&world);
    assert!((logged[0].t_s - 2.82).abs() < 1e-9, "{logged:?}");
    let EventKind::End { outcome: Outcome::Reached, totals, .. } = &logged[0].what else { panic!("{logged:?}") };
    assert_eq!(totals.wall_s, 2.5);
}

#[test]
fn only_the_first_abort_counts() {
    let mut world = eight(params(), &[]);
    world.abort("SIGINT");
    world.abort("SIGTERM");
    assert_eq!(world.ended(), Some(Outcome::Aborted));
    world.finish(&LinkStats::default(), 0.0);
    let Some(EventKind::End { reason, .. }) = event_kinds(events(&world)).pop() else { panic!("no end") };
    assert_eq!(reason, "SIGINT");
}

#[test]
fn obeying_an_older_plan_is_unsafe_except_after_a_restart() {
    let obeys = |epoch| {
        let obeyed = PlanStamp { ballot: Ballot { round: 1, incarnation: 1, claimant: DroneId(0) }, epoch };
        Slot { obeyed, part_hash: 1, ..Slot::default() }
    };
    let flown = |restarted: bool| {
        let mut world = eight(params(), &[]);
        tick(&mut world, &obeys(2));
        if restarted {
            for id in 0..8 {
                world.set_incarnation(DroneId(id), 2);
            }
        }
        let logged = event_kinds(tick(&mut world, &obeys(1)));
        assert_eq!(world.downlink().drones[0].incarnation, if restarted { 2 } else { 1 });
        fly(&mut world, &obeys(1));
        (logged, world.ended())
    };
    assert_eq!(flown(true), (vec![], Some(Outcome::Timeout)));
    let (events, outcome) = flown(false);
    let back = |drone| EventKind::Violation {
        kind: ViolationKind::BallotWentBack,
        drones: vec![DroneId(drone)],
        value_m: 0.0,
    };
    assert_eq!((events, outcome), ((0..8).map(back).collect(), Some(Outcome::Unsafe)));
}

/// The digest after a second of flight, in which one slot of the tenth tick is changed.
fn digest_with(change: impl Fn(&mut Slot)) -> u64 {
    let mut world = eight(params(), &[rectangle(140.0, 0.0, 10.0, 5.0)]);
    for k in 0..50 {
        let slot = Slot { heard: 2, heard_hash: k, ..command(0.1, -0.2) };
        let mut changed = slot;
        if k == 10 {
            change(&mut changed);
        }
        world.downlink();
        // In the reverse order of ids, which must make no difference.
        for id in (0..8).rev() {
            world.take_slot(DroneId(id), if id == 5 { &changed } else { &slot });
        }
        world.advance();
    }
    world.digest()
}

#[test]
fn equal_runs_have_equal_digests_and_one_bit_changes_them() {
    let plain = digest_with(|_| {});
    assert_eq!(plain, digest_with(|_| {}));
    assert_eq!(plain, digest_with(|slot| slot.step_ns = 77), "wall time is not in the digest");
    assert_ne!(plain, digest_with(|slot| slot.heard_hash ^= 1));
    assert_ne!(plain, digest_with(|slot| slot.heard += 1));
    assert_ne!(plain, digest_with(|slot| slot.dropped[4] += 1));
    let later = [digest_with(|slot| slot.duplicates += 1), digest_with(|slot| slot.dropped[6] += 1)];
    assert!(later[0] != plain && later[1] != plain && later[0] != later[1], "{later:?}");
    assert_ne!(plain, digest_with(|slot| slot.acceleration_mps2[1] = f64::from_bits((-0.2f64).to_bits() ^ 1 << 20)));
}

#[test]
fn sent_frames_are_in_the_digest() {
    let digest_of = |kind, byte| {
        let mut world = eight(params(), &[]);
        let mut frame = frame();
        (frame.kind, frame.len, frame.payload[5]) = (kind, 6, byte);
        world.downlink();
        for id in 0..8 {
            world.take_slot(DroneId(id), &Slot::default());
        }
        world.take_frames(DroneId(3), &[frame]);
        world.advance();
        world.digest()
    };
    assert_eq!(digest_of(1, 7), digest_of(1, 7));
    assert_ne!(digest_of(1, 7), digest_of(1, 6));
    assert_ne!(digest_of(1, 7), digest_of(2, 7));
}

#[test]
fn the_grid_senses_and_checks_a_swarm_of_a_thousand() {
    let mut world = World::new(params(), &starts(1000), &[rectangle(140.0, 0.0, 10.0, 5.0)]).unwrap();
    tick(&mut world, &Slot::default());
    let front = world.downlink().drones[0];
    // In a nested V of 35 m, within 66 m: the next drone of each arm at 35 m, and the tip of the next chevron at 49.5 m.
    assert_eq!(front.neighbour_count, 3);
    assert!((world.min_separation_m() - 35.0).abs() < 1e-6);
    assert_eq!(world.violations(), 0);
}

/// A world of two drones at this altitude, 40 m apart, without obstacles.
fn pair_at(altitude_m: f64) -> World {
    let starts = [0.0, 40.0].map(|y| (Vec3::new(0.0, y, altitude_m), Vec3::new(10.0, 0.0, 0.0)));
    World::new(params(), &starts, &[]).unwrap()
}

/// Flies this number of ticks; drone 1 accelerates upward at this rate, m/s².
fn climb(world: &mut World, climb_mps2: f64, ticks: usize) -> Vec<RunEvent> {
    let mut all = Vec::new();
    for _ in 0..ticks {
        world.take_slot(DroneId(0), &Slot::default());
        world.take_slot(DroneId(1), &Slot { acceleration_mps2: [0.0, 0.0, climb_mps2], ..Slot::default() });
        world.advance();
        all.extend(events(world));
    }
    all
}

#[test]
fn a_body_climbs_and_is_ranged_in_space() {
    let mut world = pair_at(50.0);
    climb(&mut world, 1.0, 200);
    let rows = world.record().rows;
    assert!(
        (rows[1].position_m[2] - 58.0).abs() < 1e-9 && (rows[1].velocity_mps[2] - 4.0).abs() < 1e-9,
        "{:?}",
        rows[1]
    );
    assert_eq!(rows[0].position_m[2], 50.0);
    assert!(rows[1].energy_j > rows[0].energy_j + 20.0 * 7.9, "8 m of height cost 160 J: {}", rows[1].energy_j);
    let down = world.downlink().clone();
    let near = down.view().senses(DroneId(0)).unwrap().neighbours[0];
    assert!((near.position_m[2] - 8.0).abs() < 1e-9 && (near.velocity_mps[2] - 4.0).abs() < 1e-9, "{near:?}");
    // Ranging reaches 66 m: 40 m beside and 52.5 m above.
    climb(&mut world, 2.0, 280);
    assert!(world.downlink().neighbours.is_empty());
    assert_eq!(world.violations(), 0);
}

#[test]
fn the_digest_contains_the_altitude() {
    let digest = |altitude_m| {
        let mut world = pair_at(altitude_m);
        climb(&mut world, 0.0, 1);
        world.digest()
    };
    assert_ne!(digest(50.0), digest(60.0));
    assert_eq!(digest(50.0), digest(50.0));
}

#[test]
fn a_drone_too_close_to_the_ground_is_a_violation_once() {
    let mut world = pair_at(20.0);
    let logged = climb(&mut world, -1.0, 200);
    let violations: Vec<_> = event_kinds(logged);
    let [EventKind::Violation { kind: ViolationKind::Ground, drones, value_m }] = violations.as_slice() else {
        panic!("{violations:?}");
    };
    assert_eq!(drones, &[DroneId(1)]);
    assert!((14.9..15.0).contains(value_m), "{value_m}");
    assert_eq!(world.violations(), 1);
}

#[test]
fn a_block_below_is_kept_clear_of_by_its_distance_in_space() {
    let block = rectangle(60.0, 20.0, 10.0, 40.0).between(f64::NEG_INFINITY, 34.9).unwrap();
    let starts = [0.0, 40.0].map(|y| (Vec3::new(0.0, y, 50.0), Vec3::new(10.0, 0.0, 0.0)));
    let mut world = World::new(params(), &starts, &[block]).unwrap();
    climb(&mut world, 0.0, 450);
    assert!((world.min_clearance_m() - 15.1).abs() < 1e-9, "{}", world.min_clearance_m());
    assert_eq!(world.violations(), 0);
}
