//! Swarms over two hosts on this machine: the digest is that of one machine, and faults are real.
#![allow(clippy::unwrap_used, reason = "a test fails where it cannot go on")]

mod support;

use serde_json::Value;
use std::time::Duration;
use support::{Place, children_of, free_endpoint, wait, wait_until};

/// The flight inline, which needs no other process.
fn reference(place: &Place, scenario: &str, hosts: &str) -> Value {
    place.fly(scenario, &["--runtime", "inline", "--hosts", hosts])
}

#[test]
fn the_digest_is_that_of_one_machine() {
    let place = Place::new();
    let scenario = place.scenario("[radio]\nloss = 0.2\ndelay_s = 0.05");
    let (_hosts, connect) = place.two_hosts();
    let alone = place.fly(&scenario, &["--runtime", "inline"]);
    assert_eq!(alone["hosts"], Value::Array(Vec::new()));
    // Two drones stay here.
    for hosts in ["a=4,b=4", "a=1,b=5", "b=8"] {
        let flown = place.fly(&scenario, &["--hosts", hosts, "--connect", &connect]);
        for key in ["digest", "ticks", "messages", "outcome", "energy_j"] {
            assert_eq!(flown[key], alone[key], "{hosts}: {key}");
        }
        let names: Vec<_> =
            flown["hosts"].as_array().unwrap().iter().map(|host| host["name"].as_str().unwrap()).collect();
        let asked: Vec<_> = hosts.split(',').map(|host| host.split('=').next().unwrap()).collect();
        assert_eq!(names, asked);
        for host in flown["hosts"].as_array().unwrap() {
            assert_eq!(host["ticks"], alone["ticks"], "{host}");
            assert!(host["lateness_us"]["max"].as_f64().unwrap() > 0.0);
        }
    }
    let packed = place.fly(&scenario, &["--hosts", "a=6", "--connect", &connect, "--drones-per-process", "3"]);
    assert_eq!(packed["digest"], alone["digest"]);
}

#[test]
fn the_missions_of_the_paper_fly_over_hosts() {
    let place = Place::new();
    let (_hosts, connect) = place.two_hosts();
    for name in ["s2-right", "forest"] {
        let scenario = format!("{}/../scenarios/paper/{name}.toml", env!("CARGO_MANIFEST_DIR"));
        let alone = place.fly(&scenario, &["--runtime", "inline"]);
        let flown = place.fly(&scenario, &["--hosts", "a=4,b=4", "--connect", &connect]);
        assert_eq!(flown["outcome"], "reached", "{name}");
        assert_eq!(flown["digest"], alone["digest"], "{name}");
    }
}

#[test]
fn faults_are_carried_out_on_hosts() {
    let place = Place::new();
    let scenario = place.scenario(
        "[[fault]]\nkind = \"freeze\"\nat_s = 2\nfor_s = 3\ndrone = 0\n\
         [[fault]]\nkind = \"restart\"\nat_s = 4\nfor_s = 2\ndrone = 5\n\
         [[fault]]\nkind = \"kill\"\non = \"queued\"\ntarget = \"leader\"\n\
         [[fault]]\nkind = \"host-cut\"\nat_s = 9\nfor_s = 1\nhost = \"b\"\n\
         [[host]]\nname = \"a\"\ndrones = 3\n[[host]]\nname = \"b\"\ndrones = 4\n",
    );
    let (_hosts, connect) = place.two_hosts();
    let alone = place.fly(&scenario, &["--runtime", "inline"]);
    let flown = place.fly(&scenario, &["--connect", &connect]);
    assert_eq!(flown["hosts"].as_array().unwrap().len(), 2);
    for key in ["digest", "ticks", "faults", "outcome", "messages"] {
        assert_eq!(flown[key], alone[key], "{key}");
    }
    let kinds: Vec<_> =
        flown["faults"].as_array().unwrap().iter().map(|fault| fault["kind"].as_str().unwrap()).collect();
    assert_eq!(kinds.iter().filter(|kind| **kind == "freeze").count(), 5, "{kinds:?}");
}

#[test]
fn a_scheduled_host_down_ends_its_drones_and_they_come_back() {
    let place = Place::new();
    let scenario = place.scenario("[[fault]]\nkind = \"host-down\"\nat_s = 3\nfor_s = 4\nhost = \"b\"\n");
    let (_hosts, connect) = place.two_hosts();
    let hosts = ["--hosts", "a=5,b=3"];
    let alone = reference(&place, &scenario, "a=5,b=3");
    let flown = place.fly(&scenario, &[&hosts[..], &["--connect", &connect]].concat());
    for key in ["digest", "ticks", "faults", "outcome"] {
        assert_eq!(flown[key], alone[key], "{key}");
    }
    assert_eq!(flown["faults"].as_array().unwrap().len(), 3);
}

#[test]
fn drones_of_a_host_that_is_gone_are_dead_and_the_others_fly_on() {
    let place = Place::new();
    let scenario = place.scenario("");
    let (mut hosts, connect) = place.two_hosts();
    let args =
        ["run", &scenario, "--json", "--no-record", "--out", "out", "--clock", "realtime:5", "--connect", &connect];
    let flight = place.command(&[&args[..], &["--hosts", "a=4,b=3"]].concat()).spawn().unwrap();
    let listed = place.path().join("out/processes.json");
    wait_until("the drones fly", Duration::from_secs(30), || listed.exists());
    let orphans = hosts[1].drones();
    hosts[1].kill();
    wait_until("its drones end", Duration::from_secs(2), || !orphans.iter().any(|pid| alive(*pid)));
    let done = flight.wait_with_output().unwrap();
    let summary: Value = serde_json::from_slice(&done.stdout).unwrap_or_else(|error| panic!("{error}: {done:?}"));
    let gone: Vec<_> =
        summary["faults"].as_array().unwrap().iter().filter(|fault| fault["kind"] == "host-down").collect();
    let targets: Vec<_> = gone.iter().map(|fault| fault["target"].as_u64().unwrap()).collect();
    assert_eq!(targets, [4, 5, 6], "{summary}");
    assert!(gone.iter().all(|fault| fault["scheduled"] == false), "{gone:?}");
    assert_eq!(summary["hosts"][1]["ticks"], Value::Null);
    assert!(summary["hosts"][0]["ticks"].as_u64().unwrap() > 0);
    assert!(String::from_utf8_lossy(&done.stderr).contains("host b is gone"), "{done:?}");
}

fn alive(pid: u32) -> bool {
    std::fs::read_to_string(format!("/proc/{pid}/stat")).is_ok_and(|stat| !stat.contains(") Z "))
}

#[test]
fn drones_end_with_their_launcher_and_the_host_offers_itself_again() {
    let place = Place::new();
    let scenario = place.scenario("");
    let (hosts, connect) = place.two_hosts();
    let args =
        ["run", &scenario, "--quiet", "--no-record", "--out", "out", "--clock", "realtime", "--connect", &connect];
    let mut flight = place.command(&[&args[..], &["--hosts", "a=4,b=4"]].concat()).spawn().unwrap();
    // It is there before the first tick.
    let listed = place.path().join("out/processes.json");
    wait_until("the drones fly", Duration::from_secs(30), || listed.exists());
    assert!(hosts.iter().all(|host| host.drones().len() == 4));
    flight.kill().unwrap();
    wait(&mut flight);
    wait_until("the drones end", Duration::from_secs(2), || hosts.iter().all(|host| host.drones().is_empty()));
    let again = place.fly(&scenario, &["--hosts", "a=8", "--connect", &connect]);
    assert_eq!(again["outcome"], "reached");
    assert!(children_of(hosts[0].pid()).is_empty());
}

#[test]
fn what_a_host_cannot_fly_is_refused_with_its_name() {
    let place = Place::new();
    let scenario = place.scenario("");
    let host = place.host("a", &free_endpoint(), &["--drones", "4"]);
    let refused = |args: &[&str]| {
        let done =
            place.run(&[&["run", &scenario, "--quiet", "--no-record", "--out", "out", "--force"], args].concat());
        (done.status.code(), String::from_utf8_lossy(&done.stderr).into_owned())
    };
    let (code, said) = refused(&["--hosts", "a=5", "--connect", &host.endpoint]);
    assert!(code == Some(2) && said.contains("host a: it offers 4 drones"), "{code:?} {said}");
    let (code, said) = refused(&["--hosts", "a=9", "--connect", &host.endpoint]);
    assert!(code == Some(2) && said.contains("expected formation.drones = 8 at most"), "{code:?} {said}");
    let (code, said) = refused(&["--hosts", "a=4"]);
    assert!(code == Some(2) && said.contains("--connect"), "{code:?} {said}");
    let (code, said) = refused(&["--hosts", "c=4", "--connect", &host.endpoint]);
    assert!(code == Some(3) && said.contains("host c does not answer"), "{code:?} {said}");
    let (code, said) = refused(&["--hosts", "a=4", "--connect", "tcp/10.255.0.1:7447"]);
    assert!(code == Some(2) && said.contains("--insecure"), "{code:?} {said}");
}

#[test]
fn with_keys_only_those_with_a_certificate_are_let_in() {
    let place = Place::new();
    for keys in ["keys", "others"] {
        let made = place.run(&["host", "--init-keys", keys]);
        assert!(made.status.success(), "{made:?}");
    }
    let scenario = place.scenario("");
    let endpoint = free_endpoint().replace("tcp/", "tls/");
    let _host = place.host("a", &endpoint, &["--keys", "keys"]);
    let flown = place.fly(&scenario, &["--hosts", "a=2", "--connect", &endpoint, "--keys", "keys"]);
    assert_eq!(flown["digest"], place.fly(&scenario, &["--runtime", "inline"])["digest"]);
    for others in [&["--keys", "others"][..], &[]] {
        let args =
            [&["run", &scenario, "--quiet", "--no-record", "--hosts", "a=2", "--connect", &endpoint], others].concat();
        let done = place.run(&args);
        assert_eq!(done.status.code(), Some(3), "{done:?}");
        assert!(String::from_utf8_lossy(&done.stderr).contains("host a does not answer"), "{done:?}");
    }
}

#[test]
fn a_program_that_is_missing_or_another_one_on_the_host_is_refused() {
    let place = Place::new();
    let pilot = format!("#!/bin/sh\nexec {} \"$@\"\n", support::swarm().display());
    place.script("pilot", &pilot);
    let scenario = place.scenario("[[pilot]]\ncommand = [\"pilot\"]\nname = \"paper\"\ndrones = [0, 1]\n");
    let host = place.host("a", &free_endpoint(), &[]);
    let flown = place.fly(&scenario, &["--hosts", "a=4", "--connect", &host.endpoint]);
    assert_eq!(flown["digest"], place.fly(&scenario, &[])["digest"]);
    let elsewhere = Place::new();
    let host = elsewhere.host("b", &free_endpoint(), &[]);
    let refusal = || {
        let args = ["run", &scenario, "--quiet", "--no-record", "--hosts", "b=4", "--connect", &host.endpoint];
        let done = place.run(&args);
        assert_eq!(done.status.code(), Some(2), "{done:?}");
        String::from_utf8_lossy(&done.stderr).into_owned()
    };
    assert!(refusal().contains("host b: the program pilot is missing here"), "{}", refusal());
    elsewhere.script("pilot", &format!("{pilot}# another one\n"));
    assert!(refusal().contains("host b: the program pilot is another one here"), "{}", refusal());
}

#[test]
fn a_pilot_of_ones_own_flies_on_hosts_of_its_program_only() {
    let place = Place::new();
    let scenario = place.scenario("");
    let host = place.host("a", &free_endpoint(), &[]);
    let short = ["--pilot", "thinker", "--set", "time.timeout_s=2"];
    let alone = place.fly(&scenario, &[&["--runtime", "inline"], &short[..]].concat());
    let flown = place.fly(&scenario, &[&["--hosts", "a=4", "--connect", &host.endpoint], &short[..]].concat());
    assert_eq!(flown["digest"], alone["digest"]);
    assert_eq!(flown["pilots"][0]["name"], "thinker");
    // A host that another program offers.
    let other = place.host_of("true", "b", &free_endpoint());
    let args = ["run", &scenario, "--quiet", "--no-record", "--pilot", "thinker", "--hosts", "b=4", "--connect"];
    let done = place.run(&[&args[..], &[&other.endpoint]].concat());
    let said = String::from_utf8_lossy(&done.stderr);
    assert!(done.status.code() == Some(2) && said.contains("host b: the program true is another one here"), "{done:?}");
}
