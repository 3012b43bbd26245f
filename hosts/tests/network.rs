//! Hosts in network namespaces of their own, joined by virtual cables: machines as far as the network can tell. The test needs root. Where
//! it may not make them, it says so and passes. Where the kernel has `netem`, it flies with delay and loss as well.
#![allow(clippy::unwrap_used, reason = "a test fails where it cannot go on")]

mod support;

use serde_json::Value;
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;
use support::{Host, Place, wait_until};

/// Runs `ip` or `tc`; whether it succeeded.
fn run(words: &str) -> bool {
    let mut words = words.split(' ');
    let mut command = Command::new(words.next().unwrap());
    let status = command.args(words).stdout(Stdio::null()).stderr(Stdio::null()).status();
    status.is_ok_and(|status| status.success())
}

/// A namespace with a cable to this one. Dropping it removes both.
struct Machine {
    namespace: String,
    cable: String,
    address: String,
}

impl Machine {
    /// A machine; `None` if this process may not make it.
    fn new() -> Option<Self> {
        static MADE: AtomicU32 = AtomicU32::new(0);
        let number = MADE.fetch_add(1, Ordering::Relaxed);
        let pid = std::process::id();
        let (namespace, cable, far) =
            (format!("sk{pid}n{number}"), format!("sk{pid}c{number}"), format!("sk{pid}f{number}"));
        let net = format!("10.213.{}.", (pid.wrapping_mul(7) + number) % 256);
        let machine = Self { address: format!("{net}2"), namespace, cable };
        let Self { namespace, cable, address } = &machine;
        let made = run(&format!("ip netns add {namespace}"))
            && run(&format!("ip link add {cable} type veth peer name {far}"))
            && run(&format!("ip link set {far} netns {namespace}"))
            && run(&format!("ip addr add {net}1/24 dev {cable}"))
            && run(&format!("ip link set {cable} up"))
            && run(&format!("ip netns exec {namespace} ip addr add {address}/24 dev {far}"))
            && run(&format!("ip netns exec {namespace} ip link set {far} up"))
            && run(&format!("ip netns exec {namespace} ip link set lo up"));
        made.then_some(machine)
    }

    /// So many machines; `None`, with a word on stderr, if this process may not make them.
    fn all<const N: usize>() -> Option<[Self; N]> {
        let machines: Option<Vec<Self>> = (0..N).map(|_| Self::new()).collect();
        if machines.is_none() {
            eprintln!("skipped: expected the rights to make network namespaces (root, and the program ip)");
        }
        machines?.try_into().ok()
    }

    /// Starts a host there, with certificates.
    fn host(&self, place: &Place, name: &str) -> Host {
        let endpoint = format!("tls/{}:7447", self.address);
        place.host_by(&["ip", "netns", "exec", &self.namespace], name, &endpoint, &["--keys", "keys"])
    }

    /// Makes the cable delay and lose; false if the kernel cannot.
    fn netem(&self, how: &str) -> bool {
        run(&format!("tc qdisc replace dev {} root netem {how}", self.cable))
    }

    fn cut(&self) {
        assert!(run(&format!("ip link set {} down", self.cable)));
    }
}

impl Drop for Machine {
    fn drop(&mut self) {
        run(&format!("ip link del {}", self.cable));
        run(&format!("ip netns del {}", self.namespace));
    }
}

fn with_keys() -> Place {
    let place = Place::new();
    let made = place.run(&["host", "--init-keys", "keys"]);
    assert!(made.status.success(), "{made:?}");
    place
}

fn endpoints(hosts: &[Host]) -> String {
    hosts.iter().map(|host| host.endpoint.as_str()).collect::<Vec<_>>().join(",")
}

#[test]
fn up_to_four_machines_fly_the_digest_of_one() {
    let Some(machines) = Machine::all::<4>() else { return };
    let place = with_keys();
    let scenario =
        place.scenario("[radio]\nloss = 0.1\n[[fault]]\nkind = \"restart\"\nat_s = 2\nfor_s = 1\ndrone = 1\n");
    let short = ["--set", "time.timeout_s=5"];
    let alone = place.fly(&scenario, &[&["--runtime", "inline"], &short[..]].concat());
    let hosts: Vec<Host> =
        machines.iter().zip(["a", "b", "c", "d"]).map(|(machine, name)| machine.host(&place, name)).collect();
    let connect = endpoints(&hosts);
    let mut fly = |shares: &str| {
        let args = ["--hosts", shares, "--connect", &connect, "--keys", "keys"];
        let flown = place.fly(&scenario, &[&args[..], &short[..]].concat());
        assert_eq!(flown["digest"], alone["digest"], "{shares}");
    };
    ["a=8", "a=4,b=4", "a=2,b=2,c=2,d=2"].into_iter().for_each(&mut fly);
    for how in ["delay 0.2ms", "delay 5ms 2ms loss 1%", "delay 50ms"] {
        if machines.iter().all(|machine| machine.netem(how)) {
            fly("a=3,b=5");
        } else {
            eprintln!("skipped: netem {how}: expected the kernel to have sch_netem, and the program tc");
        }
    }
}

#[test]
fn a_machine_whose_cable_is_cut_is_gone() {
    let Some(machines) = Machine::all::<2>() else { return };
    let place = with_keys();
    let scenario = place.scenario("");
    let hosts: Vec<Host> = machines.iter().zip(["a", "b"]).map(|(machine, name)| machine.host(&place, name)).collect();
    let args = ["run", &scenario, "--json", "--no-record", "--hosts", "a=4,b=2", "--keys", "keys", "--out", "out"];
    let connect = endpoints(&hosts);
    let flight =
        place.command(&[&args[..], &["--clock", "realtime:5", "--connect", &connect]].concat()).spawn().unwrap();
    // It is there before the first tick.
    let listed = place.path().join("out/processes.json");
    wait_until("the drones fly", Duration::from_secs(30), || listed.exists());
    assert_eq!(hosts[1].drones().len(), 2);
    machines[1].cut();
    wait_until("the host has ended its drones", Duration::from_secs(4), || hosts[1].drones().is_empty());
    let done = flight.wait_with_output().unwrap();
    let summary: Value = serde_json::from_slice(&done.stdout).unwrap_or_else(|error| panic!("{error}: {done:?}"));
    let faults = summary["faults"].as_array().unwrap();
    let gone: Vec<_> =
        faults.iter().filter(|fault| fault["kind"] == "host-down").map(|fault| &fault["target"]).collect();
    assert_eq!(gone, [4, 5], "{faults:?}");
    assert!(summary["hosts"][0]["ticks"].as_u64().unwrap() > 0, "the other host flies on");
}
