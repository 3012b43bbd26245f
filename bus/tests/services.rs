//! Tests of downlink, uplink and record between nodes, including the death of a process.
#![allow(clippy::unwrap_used)] // the lint exempts test functions, but not their helpers

use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
use skein_bus::{BusError, Domain, RecordPolicy, Services, UplinkHeader, clean_dead_nodes, raise_file_limit, shards};
use skein_protocol::SimTime;
use skein_protocol::downlink::{Downlink, DownlinkView, SensesHeader};
use skein_protocol::frame::{FRAME_PAYLOAD, Frame};
use std::io::{BufRead, BufReader, Write};
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::channel;
use std::time::{Duration, Instant};

const CHILD_RUN: &str = "SKEIN_BUS_TEST_RUN";

struct Run {
    domain: Domain,
    _root: tempfile::TempDir,
}

fn run() -> Run {
    let mode = std::fs::Permissions::from_mode(0o700);
    let root = tempfile::Builder::new().permissions(mode).tempdir().unwrap();
    Run { domain: Domain::create_in(root.path(), "test").unwrap(), _root: root }
}

fn frame(kind: u16) -> Frame {
    Frame { kind, version: 1, len: 8, payload: [kind as u8; FRAME_PAYLOAD] }
}

/// Starts this test binary as a child process that executes one of the `child_…` roles in the run.
fn child(role: &str, domain: &Domain) -> Child {
    Command::new(std::env::current_exe().unwrap())
        .args(["--exact", role, "--nocapture"])
        .env(CHILD_RUN, domain.path())
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap()
}

/// Reads the child's output up to its next `test result` line. Returns the first line that contains `word`.
fn hear(child: &mut Child, word: &str) -> String {
    let lines = BufReader::new(child.stdout.as_mut().unwrap()).lines();
    let lines_read: Vec<_> = lines.map(|line| line.unwrap()).take_while(|line| !line.contains("test result")).collect();
    lines_read
        .iter()
        .find(|line| line.contains(word))
        .unwrap_or_else(|| panic!("no `{word}` in {lines_read:?}"))
        .clone()
}

fn wait_for_line() {
    std::io::stdin().lock().read_line(&mut String::new()).unwrap();
}

#[test]
fn a_downlink_is_written_and_read_in_place() {
    let run = run();
    let _launcher = Services::create(&run.domain, 3, 1, "launcher").unwrap();
    let domain = Domain::join(run.domain.path()).unwrap();
    let world = Services::open(&domain, 3, "world").unwrap().downlink_publisher().unwrap();
    let drone = Services::open(&domain, 3, "drone-0").unwrap().downlink_subscriber().unwrap();
    assert!(drone.receive().unwrap().is_none());
    let mut down = Downlink::default();
    for tick in 0..6 {
        // The message grows far beyond the size of the first segment.
        down.drones.resize(3usize.pow(2 * tick as u32 + 1), SensesHeader { incarnation: 9, ..SensesHeader::default() });
        down.seal(tick, SimTime(7));
        assert_eq!(world.send(tick, down.byte_len(), |bytes| down.write_to(bytes)).unwrap(), 1);
        let sample = drone.receive_tick(tick).unwrap().unwrap();
        assert_eq!((sample.tick(), sample.bytes().len()), (tick, down.byte_len()));
        let view = DownlinkView::parse(sample.bytes()).unwrap();
        assert_eq!((view.drones, view.head.now), (&down.drones[..], SimTime(7)));
    }
}

#[test]
fn a_slow_drone_loses_the_oldest_downlinks_and_delays_no_other_process() {
    let run = run();
    let services = Services::create(&run.domain, 2, 1, "launcher").unwrap();
    let world = services.downlink_publisher().unwrap();
    let slow = services.downlink_subscriber().unwrap();
    let held = {
        world.send(0, 5, |bytes| bytes.copy_from_slice(b"first")).unwrap();
        slow.receive().unwrap().unwrap()
    };
    for tick in 1..=100 {
        world.send(tick, 3, |bytes| bytes.fill(tick as u8)).unwrap();
    }
    assert_eq!(held.bytes(), b"first");
    let second = slow.receive().unwrap().unwrap();
    assert_eq!((second.tick(), second.bytes()), (93, &[93; 3][..]));
    let error = slow.receive().err().unwrap();
    assert!(error.to_string().contains("drop the samples"), "{error}");
    drop((held, second));
    assert_eq!(slow.receive_tick(98).unwrap().unwrap().tick(), 98);
    assert!(slow.receive_tick(98).unwrap().is_none(), "only newer samples are left");
    assert_eq!(slow.receive_tick(100).unwrap().unwrap().tick(), 100);
}

#[test]
fn uplinks_arrive_in_order_and_a_full_uplink_is_an_error() {
    let run = run();
    let services = Services::create(&run.domain, 34, 1, "launcher").unwrap();
    assert_eq!(shards(34), 2);
    let worlds: Vec<_> = (0..2).map(|shard| services.uplink_subscriber(shard).unwrap()).collect();
    let drones: Vec<_> = [0, 31, 33].map(|id| (id, services.uplink_publisher(id as usize).unwrap())).into();
    worlds.iter().for_each(|world| world.connect().unwrap());
    for tick in 0..8 {
        for (source, port) in &drones {
            let header = UplinkHeader { tick, source: *source, incarnation: 1 };
            // More frames than the first segment has room for.
            port.send(header, 10 * tick as usize + 1, |frames| frames.fill(frame(*source as u16))).unwrap();
        }
    }
    let header = UplinkHeader { tick: 8, source: 0, incarnation: 1 };
    let error = drones[0].1.send(header, 1, |frames| frames.fill(frame(0))).unwrap_err();
    assert!(matches!(&error, BusError::Full { service } if service == "skein/uplink/0"), "{error}");

    for (shard, sources) in [(0, &[0, 31][..]), (1, &[33])] {
        let mut next = vec![0; sources.len()];
        for _ in 0..8 * sources.len() {
            let sample = worlds[shard].receive().unwrap().unwrap();
            let UplinkHeader { tick, source, .. } = sample.header();
            let place = sources.iter().position(|&id| id == source).unwrap();
            assert_eq!(tick, next[place]);
            assert_eq!(sample.frames(), vec![frame(source as u16); 10 * tick as usize + 1]);
            next[place] += 1;
        }
        assert!(worlds[shard].receive().unwrap().is_none());
    }
    drones[0].1.send(header, 1, |frames| frames.fill(frame(0))).unwrap();
    let error = services.uplink_publisher(64).unwrap_err();
    assert!(error.to_string().contains("in this swarm?"), "{error}");
}

/// Capacity of the record buffer in a run of one drone, in records.
const RECORDS: u64 = 512;

#[test]
fn in_lockstep_the_record_waits_for_the_recorder() {
    let run = run();
    let services = Services::create(&run.domain, 1, 1, "launcher").unwrap();
    let alive = Arc::new(AtomicBool::new(true));
    let recorder_alive = Arc::clone(&alive);
    let policy = RecordPolicy::Wait(Box::new(move |_| recorder_alive.load(Ordering::Relaxed)));
    let world = services.record_publisher(policy).unwrap();
    let domain = run.domain.path().to_owned();
    let (done, wait_done) = channel();
    let (die, wait_die) = channel::<()>();
    let recorder = std::thread::spawn(move || {
        let services = Services::open(&Domain::join(&domain).unwrap(), 1, "recorder").unwrap();
        let port = services.record_subscriber().unwrap();
        let mut ticks = Vec::new();
        while ticks.len() < 2000 {
            match port.receive().unwrap() {
                Some(sample) => ticks.push((sample.tick(), sample.bytes().to_vec())),
                None => std::thread::sleep(Duration::from_millis(1)),
            }
        }
        done.send(ticks).unwrap();
        let _ = wait_die.recv();
    });
    while world.send(0, 1, |bytes| bytes[0] = 0).unwrap() < 1 {
        std::thread::sleep(Duration::from_millis(1));
    }
    for tick in 1..2000 {
        world.send(tick, 1, |bytes| bytes[0] = tick as u8).unwrap();
    }
    let ticks = wait_done.recv().unwrap();
    assert!(ticks.into_iter().eq((0..2000).map(|tick| (tick, vec![tick as u8]))), "the recorder lost a record");
    assert_eq!(world.dropped(), 0);

    // The recorder dies with a full buffer.
    for tick in 0..RECORDS {
        world.send(tick, 1, |_| ()).unwrap();
    }
    alive.store(false, Ordering::Relaxed);
    let start = Instant::now();
    world.send(RECORDS, 1, |_| ()).unwrap();
    assert!(start.elapsed() < Duration::from_secs(1));
    assert_eq!(world.dropped(), 1);
    drop(die);
    recorder.join().unwrap();
}

#[test]
fn in_wall_clock_mode_a_full_record_buffer_drops_records_and_counts_them() {
    let run = run();
    let services = Services::create(&run.domain, 1, 1, "launcher").unwrap();
    let world = services.record_publisher(RecordPolicy::Drop).unwrap();
    let recorder = services.record_subscriber().unwrap();
    recorder.connect().unwrap();
    for tick in 0..RECORDS + 6 {
        world.send(tick, 16, |bytes| bytes.fill(1)).unwrap();
    }
    assert_eq!(world.dropped(), 6);
    assert_eq!(recorder.receive().unwrap().unwrap().tick(), 0);
}

#[test]
fn observers_can_join_and_leave_and_lose_the_oldest_samples() {
    let run = run();
    let services = Services::create(&run.domain, 1, 1, "launcher").unwrap();
    let world = services.watch_publisher().unwrap();
    assert!(!world.watched());
    for round in 0..10u64 {
        let observer = services.watch_subscriber().unwrap();
        assert!(world.watched());
        for tick in 0..100 {
            assert_eq!(world.send(round * 100 + tick, 8, |bytes| bytes.fill(1)).unwrap(), 1);
        }
        assert_eq!(
            observer.receive().unwrap().unwrap().tick(),
            round * 100 + 36,
            "the newest 64 of 100 samples should be left"
        );
    }
    assert!(!world.watched());
    assert_eq!(world.send(0, 8, |bytes| bytes.fill(1)).unwrap(), 0);
}

/// Observers on all services for them, in a run whose drones and restarted drones have their places, too.
#[test]
fn eight_observers_find_a_place_at_all_services_and_a_ninth_is_told_what_to_do() {
    let run = run();
    let services = Services::create(&run.domain, 2, 1, "launcher").unwrap();
    let worlds = (services.downlink_publisher().unwrap(), services.watch_publisher().unwrap());
    let _drones = [(); 2].map(|()| services.downlink_subscriber().unwrap());
    let domain = Domain::join(run.domain.path()).unwrap();
    let visit = || {
        let observer = Services::visit(&domain, 2, "observer").unwrap();
        let watch = observer.watch_subscriber()?;
        Ok::<_, BusError>((watch, observer.downlink_subscriber()?, observer))
    };
    let mut observers: Vec<_> = (0..8).map(|_| visit().unwrap()).collect();
    let _restarted = [(); 4].map(|()| services.downlink_subscriber().unwrap());
    assert_eq!(worlds.0.send(0, 8, |bytes| bytes.fill(1)).unwrap(), 14);
    assert_eq!(worlds.1.send(0, 8, |bytes| bytes.fill(1)).unwrap(), 8);
    for (watch, downlink, _) in &observers {
        assert!(watch.receive().unwrap().is_some() && downlink.receive().unwrap().is_some());
    }
    let error = visit().err().unwrap().to_string();
    assert!(error.contains("has 8 observers") && error.contains("end one of them (`skein view`"), "{error}");
    observers.pop();
    visit().unwrap();
}

#[test]
fn two_runs_do_not_hear_each_other() {
    let (one, two) = (run(), run());
    let first = Services::create(&one.domain, 1, 1, "launcher").unwrap();
    let second = Services::create(&two.domain, 1, 1, "launcher").unwrap();
    let heard = [first.downlink_subscriber().unwrap(), second.downlink_subscriber().unwrap()];
    let worlds = [first.downlink_publisher().unwrap(), second.downlink_publisher().unwrap()];
    assert_eq!(worlds[0].send(1, 1, |_| ()).unwrap(), 1);
    assert!(heard[0].receive().unwrap().is_some() && heard[1].receive().unwrap().is_none());
    let again = Services::create(&one.domain, 1, 1, "launcher").unwrap_err();
    assert!(again.to_string().contains("belongs to a running swarm"), "{again}");
}

/// Not a test by itself: the role of a drone that sends once, holds a sample, and is then killed.
#[test]
fn child_drone() {
    let Some(path) = std::env::var_os(CHILD_RUN) else { return };
    let services = Services::open(&Domain::join(Path::new(&path)).unwrap(), 1, "drone-0").unwrap();
    let (down, up) = match services.downlink_subscriber() {
        Ok(down) => (down, services.uplink_publisher(0).unwrap()),
        Err(error) => return println!("\nrefused: {error}\ntest result"),
    };
    up.send(UplinkHeader { tick: 3, source: 0, incarnation: 1 }, 1, |frames| frames.fill(frame(5))).unwrap();
    println!("\njoined\ntest result");
    wait_for_line();
    let _held = down.receive().unwrap().unwrap();
    println!("\nheld\ntest result");
    wait_for_line();
}

#[test]
fn killed_drones_occupy_their_ports_until_they_are_cleaned() {
    let run = run();
    let services = Services::create(&run.domain, 1, 1, "launcher").unwrap();
    let world = services.downlink_publisher().unwrap();
    let uplink = services.uplink_subscriber(0).unwrap();
    let _observers = [(); 8].map(|()| services.downlink_subscriber().unwrap());
    for tick in 0..5 {
        let mut drone = child("child_drone", &run.domain);
        hear(&mut drone, "joined");
        assert_eq!(world.send(tick, 8, |bytes| bytes.fill(1)).unwrap(), tick as usize + 9);
        drone.stdin.as_mut().unwrap().write_all(b"\n").unwrap();
        hear(&mut drone, "held");
        drone.kill().unwrap();
        drone.wait().unwrap();
        let last_sample = uplink.receive().unwrap().unwrap();
        assert_eq!((last_sample.header().source, last_sample.frames()), (0, &[frame(5)][..]));
    }
    let mut refused = child("child_drone", &run.domain);
    let output = hear(&mut refused, "refused");
    assert!(output.contains("skein/downlink") && output.contains("clean dead nodes"), "{output}");
    refused.wait().unwrap();

    let dead = clean_dead_nodes(&run.domain).unwrap();
    assert_eq!((dead.removed, dead.failed), (5, 0));
    assert_eq!(world.send(9, 8, |bytes| bytes.fill(1)).unwrap(), 8);
    let mut drone = child("child_drone", &run.domain);
    hear(&mut drone, "joined");
    assert_eq!(world.send(10, 8, |bytes| bytes.fill(1)).unwrap(), 9);
    assert_eq!(uplink.receive().unwrap().unwrap().header().tick, 3);
    drone.kill().unwrap();
    drone.wait().unwrap();
}

/// Not a test by itself: the role of a world with too few file descriptors.
#[test]
fn child_world() {
    let Some(path) = std::env::var_os(CHILD_RUN) else { return };
    let services = Services::open(&Domain::join(Path::new(&path)).unwrap(), 40, "world").unwrap();
    let world = services.downlink_publisher().unwrap();
    let open = std::fs::read_dir("/proc/self/fd").unwrap().count() as u64;
    let maximum = getrlimit(Resource::Nofile).maximum;
    setrlimit(Resource::Nofile, Rlimit { current: Some(open + 5), maximum }).unwrap();
    println!("\njoined\ntest result");
    wait_for_line();
    let errors = [0, 1].map(|tick| world.send(tick, 8, |bytes| bytes.fill(1)).unwrap_err().to_string());
    println!("\nerrors {errors:?}\ntest result");
}

#[test]
fn at_the_file_descriptor_limit_every_loss_is_reported_as_an_error() {
    raise_file_limit().unwrap();
    let run = run();
    let services = Services::create(&run.domain, 40, 1, "launcher").unwrap();
    let mut world = child("child_world", &run.domain);
    hear(&mut world, "joined");
    let drones: Vec<_> = (0..30).map(|_| services.downlink_subscriber().unwrap()).collect();
    world.stdin.as_mut().unwrap().write_all(b"\n").unwrap();
    let output = hear(&mut world, "errors");
    assert_eq!(output.matches("ulimit -n").count(), 2, "{output}");
    world.wait().unwrap();
    drop(drones);
}
