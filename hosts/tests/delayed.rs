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

/// A network that delays all bytes by the same time, in both directions, and can be cut.
struct SlowNetwork {
    endpoint: String,
    cut: Arc<AtomicBool>,
}

impl SlowNetwork {
    fn new(host: &str, one_way: Duration) -> Self {
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
                        read(from, |bytes| sender.send((Instant::now() + one_way, bytes)).is_ok())
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

#[test]
fn delay_does_not_change_the_digest() {
    let place = Place::new();
    let scenario = place.scenario("[radio]\nloss = 0.2");
    let host = place.host("a", &free_endpoint(), &[]);
    let short = ["--set", "time.timeout_s=6"];
    let alone = place.fly(&scenario, &[&["--runtime", "inline"], &short[..]].concat());
    for one_way_us in [100, 5_000, 25_000] {
        let network = SlowNetwork::new(&host.endpoint, Duration::from_micros(one_way_us));
        let args = ["--hosts", "a=4", "--connect", &network.endpoint];
        let flown = place.fly(&scenario, &[&args[..], &short[..]].concat());
        assert_eq!(flown["digest"], alone["digest"], "{one_way_us} µs");
        let median_us = flown["hosts"][0]["lateness_us"]["p50"].as_f64().unwrap();
        assert!(median_us > 2.0 * one_way_us as f64, "the network is as slow as it should be: {median_us} µs");
    }
}

#[test]
fn a_cut_of_a_second_is_survived_and_a_longer_one_is_not() {
    let place = Place::new();
    let scenario = place.scenario("");
    let host = place.host("a", &free_endpoint(), &[]);
    let network = SlowNetwork::new(&host.endpoint, Duration::from_micros(100));
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
