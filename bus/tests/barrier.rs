//! Tests of the barrier. Threads stand in for processes; each thread maps the control segment itself.
#![allow(clippy::unwrap_used)] // the lint exempts test functions, but not their helpers

use skein_bus::{BusError, Control, ControlSpec, DroneEndpoint, Patience, TickOutcome, TickSignal, WaitMode};
use skein_protocol::slot::Slot;
use std::io::Write;
use std::os::fd::AsRawFd;
use std::sync::Arc;
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

const LONG: Patience = Patience::For(Duration::from_secs(5));

fn segment(drones: usize, cores: usize, wait: WaitMode) -> Control {
    Control::create(ControlSpec { drones, cores, per_process: 1, wait }).unwrap()
}

fn end_of(launcher: &Control, drone: usize) -> DroneEndpoint {
    let control = Control::attach(launcher.fd().unwrap()).unwrap();
    DroneEndpoint::new(Arc::new(control), drone).unwrap()
}

fn slot(drone: usize, tick: u64) -> Slot {
    Slot { heard_hash: tick * 1000 + drone as u64, step_ns: tick as u32, ..Slot::default() }
}

/// Starts a thread that answers every tick until the mission ends. The thread returns the ticks it saw.
fn drone(launcher: &Control, drone: usize) -> JoinHandle<Vec<u64>> {
    let mut endpoint = end_of(launcher, drone);
    thread::spawn(move || {
        let mut seen = Vec::new();
        endpoint.announce(1);
        while let TickSignal::Tick(k) = endpoint.wait_tick(|| true) {
            endpoint.stats_mut().heard += 1;
            assert!(endpoint.finish(k, &slot(drone, k)));
            seen.push(k);
        }
        seen
    })
}

fn lockstep(drones: usize, cores: usize, ticks: u64, wait: WaitMode) {
    let launcher = segment(drones, cores, wait);
    let world = Control::attach(launcher.fd().unwrap()).unwrap();
    let threads: Vec<_> = (0..drones).map(|i| drone(&launcher, i)).collect();
    let mut answers = vec![TickOutcome::Pending; drones];
    for k in 0..ticks {
        world.open_tick(k).unwrap();
        world.wait_done(k, LONG, &mut answers).unwrap();
        assert!(answers.iter().all(|&answer| answer == TickOutcome::Done), "tick {k}: {answers:?}");
        assert!((0..drones).all(|i| world.slot(i) == slot(i, k)), "tick {k}");
    }
    world.close();
    for (i, drone) in threads.into_iter().enumerate() {
        assert!(drone.join().unwrap().into_iter().eq(0..ticks), "drone {i} did not see each tick exactly once");
        assert_eq!(launcher.stats(i).heard, ticks);
    }
}

#[test]
fn lockstep_loses_no_wake_up() {
    lockstep(1, 1, 5000, WaitMode::Block);
    lockstep(2, 2, 5000, WaitMode::Block);
    lockstep(7, 2, 3000, WaitMode::Block);
    lockstep(16, 3, 2000, WaitMode::Block);
}

#[test]
fn lockstep_works_with_yielding_waits() {
    lockstep(4, 2, 1000, WaitMode::Yield);
}

#[test]
fn drones_that_yield_sleep_until_the_first_tick() {
    let world = segment(2, 2, WaitMode::Yield);
    let threads = [0, 1].map(|i| drone(&world, i));
    thread::sleep(Duration::from_millis(50));
    let [_, calls] = world.calls();
    assert!(calls <= 4, "{calls} system calls before the first tick");
    world.open_tick(0).unwrap();
    world.wait_done(0, LONG, &mut [TickOutcome::Pending; 2]).unwrap();
    world.close();
    assert!(threads.map(|drone| drone.join().unwrap()) == [[0], [0]]);

    // A mission that ends before its first tick wakes them as well.
    let world = segment(1, 1, WaitMode::Yield);
    let waits = drone(&world, 0);
    thread::sleep(Duration::from_millis(20));
    world.close();
    assert!(waits.join().unwrap().is_empty());
}

#[test]
fn marking_a_drone_dead_wakes_the_world() {
    let world = Arc::new(segment(2, 1, WaitMode::Block));
    let survivor = drone(&world, 1);
    world.open_tick(0).unwrap();
    let supervisor = Control::attach(world.fd().unwrap()).unwrap();
    let watcher = thread::spawn(move || {
        thread::sleep(Duration::from_millis(30));
        supervisor.mark_dead(0);
    });
    let mut answers = [TickOutcome::Pending; 2];
    let start = Instant::now();
    world.wait_done(0, LONG, &mut answers).unwrap();
    assert!(start.elapsed() < Duration::from_secs(2), "marking the drone dead did not wake the world");
    assert_eq!(answers, [TickOutcome::Dead, TickOutcome::Done]);
    watcher.join().unwrap();

    // A new process answers from tick 5 on. Earlier ticks run without it.
    world.revive(0, 5);
    assert_eq!(world.ready(0), None);
    let restarted = drone(&world, 0);
    for k in 3..7 {
        world.open_tick(k).unwrap();
        answers[0] = if k < 5 { TickOutcome::Absent } else { TickOutcome::Pending };
        world.wait_done(k, LONG, &mut answers).unwrap();
        assert_eq!(answers, [if k < 5 { TickOutcome::Absent } else { TickOutcome::Done }, TickOutcome::Done]);
    }
    world.close();
    assert_eq!(restarted.join().unwrap(), [5, 6]);
    assert_eq!(survivor.join().unwrap(), [0, 3, 4, 5, 6]);
}

#[test]
fn an_answer_given_before_death_counts() {
    let world = segment(1, 1, WaitMode::Block);
    let mut endpoint = end_of(&world, 0);
    world.open_tick(0).unwrap();
    assert_eq!(endpoint.wait_tick(|| true), TickSignal::Tick(0));
    assert!(endpoint.finish(0, &slot(0, 0)));
    world.mark_dead(0);
    let mut answers = [TickOutcome::Pending];
    world.wait_done(0, LONG, &mut answers).unwrap();
    assert_eq!(answers, [TickOutcome::Done]);
    world.open_tick(1).unwrap();
    world.wait_done(1, LONG, &mut answers).unwrap();
    assert_eq!(answers, [TickOutcome::Dead]);
}

#[test]
fn a_slow_drone_is_late_after_a_deadline_and_hung_after_a_time_limit() {
    let world = segment(2, 1, WaitMode::Block);
    let prompt = drone(&world, 1);
    let mut slow = end_of(&world, 0);
    world.open_tick(0).unwrap();
    assert_eq!(slow.wait_tick(|| true), TickSignal::Tick(0));
    let mut answers = [TickOutcome::Pending; 2];
    let start = Instant::now();
    world.wait_done(0, Patience::Until(start + Duration::from_millis(300)), &mut answers).unwrap();
    assert_eq!(answers, [TickOutcome::Late, TickOutcome::Done]);
    assert!(start.elapsed() >= Duration::from_millis(300));

    // The slow drone answers tick 0 while tick 2 is open. This does not count as an answer to tick 2. The next tick
    // that the drone sees is the newest one.
    world.open_tick(1).unwrap();
    world.open_tick(2).unwrap();
    assert!(slow.finish(0, &slot(0, 0)));
    world.wait_done(2, Patience::For(Duration::from_millis(300)), &mut answers).unwrap();
    assert_eq!(answers, [TickOutcome::Hung, TickOutcome::Done]);
    assert_eq!(slow.wait_tick(|| true), TickSignal::Tick(2));
    assert!(slow.finish(2, &slot(0, 2)));
    world.wait_done(2, LONG, &mut answers).unwrap();
    assert_eq!((answers, world.slot(0)), ([TickOutcome::Done; 2], slot(0, 2)));
    world.close();
    assert_eq!(slow.wait_tick(|| true), TickSignal::Stop);
    assert_eq!(prompt.join().unwrap().last(), Some(&2));
}

#[test]
fn a_frozen_drone_neither_reads_nor_answers_an_old_tick() {
    let world = segment(1, 1, WaitMode::Block);
    let mut endpoint = end_of(&world, 0);
    world.open_tick(4).unwrap();
    assert_eq!(endpoint.wait_tick(|| true), TickSignal::Tick(4));
    world.freeze(0);
    assert!(!endpoint.finish(4, &slot(0, 4)), "the drone was frozen during its step");
    assert_eq!(world.slot(0), Slot::default());
    world.open_tick(5).unwrap();
    assert_eq!(endpoint.wait_tick(|| false), TickSignal::Orphaned, "a frozen drone does not see tick 5");
    world.set_resume_from(0, 6);
    assert_eq!(endpoint.wait_tick(|| false), TickSignal::Orphaned, "the drone resumes only from tick 6 on");
    world.open_tick(6).unwrap();
    assert_eq!(endpoint.wait_tick(|| true), TickSignal::Tick(6));
    assert!(endpoint.finish(6, &slot(0, 6)));
    assert!(!endpoint.finish(5, &slot(0, 5)), "a drone can answer only the tick that it was given");
}

#[test]
fn waiting_ends_when_the_peer_is_gone() {
    let launcher = segment(1, 1, WaitMode::Block);
    let mut calls = 0;
    let signal = end_of(&launcher, 0).wait_tick(|| {
        calls += 1;
        calls < 3
    });
    assert_eq!((signal, calls), (TickSignal::Orphaned, 3));
    assert!(!launcher.wait_go(|| false));
    launcher.give_go();
    assert!(launcher.wait_go(|| false));
    assert_eq!(launcher.stop_requested(), None);
    launcher.request_stop(15);
    assert_eq!(launcher.stop_requested(), Some(15));
}

#[test]
fn invalid_segments_and_arguments_are_refused() {
    let mut other = tempfile::tempfile().unwrap();
    let error = Control::attach(other.as_raw_fd()).unwrap_err();
    assert!(matches!(&error, BusError::Control(why) if why.contains("holds 0 bytes")), "{error}");
    other.write_all(&[7; 1 << 16]).unwrap();
    let error = Control::attach(other.as_raw_fd()).unwrap_err();
    assert!(matches!(&error, BusError::Control(why) if why.contains("not a control segment")), "{error}");
    assert!(matches!(Control::attach(-1), Err(BusError::Io { .. })));
    for (drones, cores) in [(0, 1), (1, 0), (1 << 17, 1)] {
        assert!(Control::create(ControlSpec { drones, cores, per_process: 1, wait: WaitMode::Block }).is_err());
    }
    let good = segment(3, 1, WaitMode::Yield);
    let attached = Control::attach(good.fd().unwrap()).unwrap();
    assert_eq!(attached.spec(), good.spec());
    assert!(DroneEndpoint::new(Arc::new(attached), 3).is_err());
    assert!(good.open_tick(u64::from(u32::MAX)).is_err());
    assert!(good.wait_done(0, LONG, &mut [TickOutcome::Pending]).is_err());
}
