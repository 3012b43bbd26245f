//! A network with delay and cuts between the launcher and a host: a proxy in this process carries the bytes of their connection.
#![allow(clippy::unwrap_used, reason = "a test fails where it cannot go on")]

mod support;

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};
use support::{Place, free_endpoint, wait_until};

/// How late a network is in each direction.
#[derive(Clone, Copy)]
struct Delay {
    one_way: Duration,
    /// The delay differs by up to this from the former.
    jitter: Duration,
    /// Each so-manieth packet is lost and comes again [`REPEATED`] later, with all that follow; 0: none.
    lost_of: u64,
}

/// The shortest time after which TCP on Linux repeats a packet.
const REPEATED: Duration = Duration::from_millis(200);

impl Delay {
    const fn constant(one_way: Duration) -> Self {
        Self { one_way, jitter: Duration::ZERO, lost_of: 0 }
    }

    /// Of a packet. The numbers look random and are the same in each run.
    fn of(&self, packet: u64) -> Duration {
        let mut state = packet.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        state ^= state >> 33;
        let jitter = self.jitter.mul_f64(2.0 * (state % 1000) as f64 / 999.0);
        let lost = self.lost_of > 0 && (state / 1000).is_multiple_of(self.lost_of);
        self.one_way + jitter - self.jitter + if lost { REPEATED } else { Duration::ZERO }
    }
}

/// A network that delays all bytes in both directions, and can be cut.
struct SlowNetwork {
    endpoint: String,
    cut: Arc<AtomicBool>,
}

impl SlowNetwork {
    fn new(host: &str, delay: Delay) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let endpoint = format!("tcp/{}", listener.local_addr().unwrap());
        let cut = Arc::new(AtomicBool::new(false));
        let (flag, address) = (Arc::clone(&cut), host.trim_start_matches("tcp/").to_owned());
        std::thread::spawn(move || {
            for near in listener.incoming().map_while(Result::ok) {
                let Ok(far) = TcpStream::connect(&address) else { continue };
                let ends = [(near.try_clone().unwrap(), far.try_clone().unwrap()), (far, near)];
                for (from, to) in ends {
                    to.set_nodelay(true).unwrap();
                    let (sender, receiver) = channel();
                    std::thread::spawn(move || {
                        let mut packet = 0;
                        read(from, |bytes| {
                            packet += 1;
                            sender.send((Instant::now() + delay.of(packet), bytes)).is_ok()
                        })
                    });
                    let flag = Arc::clone(&flag);
                    std::thread::spawn(move || deliver(&receiver, to, &flag));
                }
            }
        });
        Self { endpoint, cut }
    }
}

fn read(mut from: TcpStream, mut take: impl FnMut(Vec<u8>) -> bool) {
    let mut buffer = [0; 65536];
    while let Ok(count @ 1..) = from.read(&mut buffer) {
        if !take(buffer[..count].to_vec()) {
            return;
        }
    }
}

/// Writes what is due, in order. While the network is cut, all waits, as TCP's own repetitions do.
fn deliver(receiver: &Receiver<(Instant, Vec<u8>)>, mut to: TcpStream, cut: &AtomicBool) {
    while let Ok((due, bytes)) = receiver.recv() {
        std::thread::sleep(due.saturating_duration_since(Instant::now()));
        while cut.load(Ordering::Acquire) {
            std::thread::sleep(Duration::from_millis(1));
        }
        if to.write_all(&bytes).is_err() {
            return;
        }
    }
    // The other side has closed the connection.
    let _ = to.shutdown(std::net::Shutdown::Both);
}

/// 0.2 ms there and back; 5 ms, give or take 2 ms, with 1 % of the packets lost; 50 ms.
const NETWORKS: [Delay; 3] = [
    Delay::constant(Duration::from_micros(100)),
    Delay { one_way: Duration::from_micros(2500), jitter: Duration::from_millis(1), lost_of: 100 },
    Delay::constant(Duration::from_millis(25)),
];

/// Whether all missions are flown, which takes minutes; a variable of the environment asks for it.
fn flies_all() -> bool {
    std::env::var("HOST_NETWORKS").is_ok_and(|text| text == "all")
}

#[test]
fn a_slow_network_does_not_change_the_digest() {
    let place = Place::new();
    let lossy = place.scenario("[radio]\nloss = 0.2");
    same_digest(&place, &lossy, &["a=4"], "6");
    if flies_all() {
        fly_all();
    }
}

/// S2, the forest, faults and a lossy radio on one, two and four hosts over all networks.
fn fly_all() {
    let faults = "[[fault]]\nkind = \"freeze\"\nat_s = 1\nfor_s = 1\ndrone = 0\n\
                  [[fault]]\nkind = \"restart\"\nat_s = 2\nfor_s = 1\ndrone = 5\n\
                  [[fault]]\nkind = \"kill\"\nat_s = 3\ntarget = \"leader\"\n";
    let forest = format!("{}/../scenarios/paper/forest.toml", env!("CARGO_MANIFEST_DIR"));
    for more in ["", faults, "[radio]\nloss = 0.2\ndelay_s = 0.05\n", "forest"] {
        let place = Place::new();
        let scenario = if more == "forest" { forest.clone() } else { place.scenario(more) };
        same_digest(&place, &scenario, &["a=8", "a=4,b=4", "a=2,b=2,c=2,d=2"], "5");
    }
}

/// Flies the beginning of a mission on these hosts over each network, and compares its digest with that of one machine.
fn same_digest(place: &Place, scenario: &str, shares: &[&str], timeout_s: &str) {
    let timeout = format!("time.timeout_s={timeout_s}");
    let short = ["--set", &timeout];
    let alone = place.fly(scenario, &[&["--runtime", "inline"], &short[..]].concat());
    let names = ["a", "b", "c", "d"].iter().take(shares.iter().map(|of| of.split(',').count()).max().unwrap_or(0));
    let hosts: Vec<_> = names.map(|name| place.host(name, &free_endpoint(), &[])).collect();
    for delay in NETWORKS {
        let networks: Vec<_> = hosts.iter().map(|host| SlowNetwork::new(&host.endpoint, delay)).collect();
        let connect = networks.iter().map(|network| network.endpoint.as_str()).collect::<Vec<_>>().join(",");
        for of in shares {
            let flown = place.fly(scenario, &[&["--hosts", of, "--connect", &connect], &short[..]].concat());
            assert_eq!(flown["digest"], alone["digest"], "{scenario}, {of}, {:?}", delay.one_way);
            let median_us = flown["hosts"][0]["lateness_us"]["p50"].as_f64().unwrap();
            let least_us = 2e6 * (delay.one_way - delay.jitter).as_secs_f64();
            assert!(median_us > least_us, "the network is as slow as it should be: {median_us} µs");
            eprintln!("{scenario}, {of}, {:?} one way: {}", delay.one_way, flown["digest"]);
        }
    }
}

/// Its answers take 50 ms, and a tick 20 ms.
#[test]
fn a_host_that_is_too_slow_for_the_clock_is_late_and_holds_up_nobody() {
    let place = Place::new();
    let scenario = place.scenario("");
    let host = place.host("a", &free_endpoint(), &[]);
    let network = SlowNetwork::new(&host.endpoint, NETWORKS[2]);
    let args = ["--hosts", "a=2", "--connect", &network.endpoint, "--clock", "realtime", "--set", "time.timeout_s=4"];
    let flown = place.fly(&scenario, &args);
    let (ticks, missed) = (flown["ticks"].as_u64().unwrap(), flown["deadline_misses"].as_u64().unwrap());
    assert_eq!(ticks, 200, "no tick waited for it");
    assert!(missed > ticks, "both of its drones are late in most ticks: {missed}");
    let median_us = flown["hosts"][0]["lateness_us"]["p50"].as_f64().unwrap();
    assert!(median_us > 20_000.0, "{median_us} µs");
    assert_eq!(flown["violations"].as_array().unwrap().len(), 0);
    let gone = flown["faults"].as_array().unwrap();
    assert!(gone.is_empty(), "a host that is late is not gone: {gone:?}");
}

#[test]
fn a_cut_of_a_second_is_survived_and_a_longer_one_is_not() {
    let place = Place::new();
    let scenario = place.scenario("");
    let host = place.host("a", &free_endpoint(), &[]);
    let network = SlowNetwork::new(&host.endpoint, NETWORKS[0]);
    let fly = |out: &str, cut: Duration| {
        let args = ["run", &scenario, "--json", "--no-record", "--hosts", "a=3", "--connect", &network.endpoint];
        let flight = place.command(&[&args[..], &["--clock", "realtime:10", "--out", out]].concat()).spawn().unwrap();
        // It is there before the first tick.
        let listed = place.path().join(out).join("processes.json");
        wait_until("the drones fly", Duration::from_secs(30), || listed.exists());
        network.cut.store(true, Ordering::Release);
        std::thread::sleep(cut);
        network.cut.store(false, Ordering::Release);
        let done = flight.wait_with_output().unwrap();
        let summary: serde_json::Value =
            serde_json::from_slice(&done.stdout).unwrap_or_else(|error| panic!("{error}: {done:?}"));
        summary
    };
    let survived = fly("short", Duration::from_secs(1));
    assert_eq!(survived["faults"].as_array().unwrap().len(), 0, "{}", survived["faults"]);
    assert!(survived["deadline_misses"].as_u64().unwrap() > 3 * 40, "{}", survived["deadline_misses"]);
    let lost = fly("long", Duration::from_secs(4));
    let targets: Vec<_> = lost["faults"].as_array().unwrap().iter().map(|fault| fault["target"].as_u64()).collect();
    assert_eq!(targets, [Some(0), Some(1), Some(2)], "{}", lost["faults"]);
    assert!(lost["faults"].as_array().unwrap().iter().all(|fault| fault["kind"] == "host-down"));
    wait_until("the host has ended its drones", Duration::from_secs(2), || host.drones().is_empty());
}
