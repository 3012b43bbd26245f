//! Looking at the swarms of another machine: `skein share` there, and `topic`, `top` and `view` with `--connect` here.
#![allow(clippy::unwrap_used, reason = "a test fails where it cannot go on")]

mod support;

use serde_json::Value;
use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::process::{Child, Output};
use std::time::Duration;
use support::{Host, Place, WATCHDOG, children_of, free_endpoint, wait, wait_until};
use zenoh::Wait as _;

/// Short ticks, so that a flight in lockstep takes some seconds.
const SLOW: [&str; 2] = ["--set", "time.dt_s=0.001"];

/// A flight that has begun.
fn take_off(place: &Place, more: &[&str]) -> Child {
    let scenario = place.scenario("");
    let args = ["run", &scenario, "--json", "--no-record", "--out", "out"];
    let flight = place.command(&[&args[..], more].concat()).spawn().unwrap();
    let listed = place.path().join("out/processes.json");
    wait_until("the drones fly", WATCHDOG, || listed.exists());
    flight
}

fn land(flight: Child) -> Value {
    let done = flight.wait_with_output().unwrap();
    serde_json::from_slice(&done.stdout).unwrap_or_else(|error| panic!("{error}: {done:?}"))
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// The output of a command that ended well.
fn told(done: &Output) -> String {
    assert_eq!(done.status.code(), Some(0), "{done:?}");
    text(&done.stdout)
}

/// The lines of `topic echo`, by tick and drone.
fn lines(text: &str) -> BTreeMap<(u64, u64), String> {
    let key = |line: &str| {
        let value: Value = serde_json::from_str(line).unwrap();
        (value["tick"].as_u64().unwrap(), value["drone"].as_u64().unwrap())
    };
    text.lines().map(|line| (key(line), line.to_owned())).collect()
}

#[test]
fn topics_are_those_of_the_other_machine() {
    let place = Place::new();
    let share = place.share(&free_endpoint(), &[]);
    let connect = ["--connect", &share.endpoint];
    let flight = take_off(&place, &["--clock", "realtime:2"]);
    let list = |more: &[&str]| told(&place.run(&[&["topic", "list"], more].concat()));
    wait_until("the swarm is shared", WATCHDOG, || {
        place.run(&[&["topic", "list"], &connect[..]].concat()).status.success()
    });
    assert_eq!((list(&connect), list(&connect).lines().count()), (list(&[]), 4));
    let poses = told(
        &place
            .run(&[&["topic", "echo", "air", "--drone", "3", "--kind", "pose", "--count", "2"], &connect[..]].concat()),
    );
    let poses: Vec<Value> = poses.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert!(poses.iter().all(|line| line["drone"] == 3 && line["message"]["position_m"].is_array()), "{poses:?}");
    assert_eq!(poses.len(), 2);
    let rates = told(&place.run(&[&["topic", "hz", "record", "--count", "1"], &connect[..]].concat()));
    let rate = serde_json::from_str::<Value>(&rates).unwrap()["hz"]["messages"].as_f64().unwrap();
    assert!(rate > 400.0, "{rates}: eight drones, 100 ticks/s");
    // To the end of the swarm, here and there.
    for topic in ["record", "senses"] {
        let echo = |more: &[&str]| {
            let args = [&["topic", "echo", topic, "--drone", "0"], more].concat();
            place.command(&args).spawn().unwrap()
        };
        // The one there takes longer to begin.
        let count = |count| if topic == "record" { vec!["--count", count] } else { Vec::new() };
        let (there, here) = (echo(&[&connect[..], &count("200")].concat()), echo(&count("600")));
        let (there, here) = (there.wait_with_output().unwrap(), here.wait_with_output().unwrap());
        let (there, here) = (lines(&told(&there)), lines(&told(&here)));
        let both: Vec<_> = there.iter().filter(|(key, _)| here.contains_key(key)).collect();
        // How much both hear depends on when each of them begins.
        assert!(!both.is_empty(), "{topic}: {} here, {} there", here.len(), there.len());
        assert!(both.iter().all(|(key, line)| here[key] == **line), "{topic}");
    }
    assert_eq!(land(flight)["outcome"], "reached");
    let after = place.run(&[&["topic", "list"], &connect[..]].concat());
    assert_eq!(after.status.code(), Some(3), "{after:?}");
    assert!(text(&after.stderr).contains(&format!("no swarm runs at {}", share.endpoint)), "{after:?}");
}

#[test]
fn top_shows_the_swarms_of_the_other_machine_that_are_shared() {
    let place = Place::new();
    let (all, others) = (place.share(&free_endpoint(), &[]), place.share(&free_endpoint(), &["other"]));
    let top = |share: &Host, how: &str| told(&place.run(&["top", how, "--connect", &share.endpoint]));
    assert!(top(&all, "--once").contains(&format!("no swarm runs at {}", all.endpoint)));
    let mut flight = take_off(&place, &["--clock", "realtime"]);
    wait_until("the swarm is shared", WATCHDOG, || top(&all, "--once").contains("8/8"));
    let page: Value = serde_json::from_str(&top(&all, "--json")).unwrap();
    let swarm = &page["swarms"][0];
    assert_eq!((&swarm["drones"], swarm["rows"].as_array().unwrap().len()), (&8.into(), 8), "{page}");
    let ticks = swarm["ticks_per_s"].as_f64().unwrap();
    assert!((40.0..60.0).contains(&ticks), "{ticks} ticks/s, expected 50");
    assert!(top(&others, "--once").contains("no swarm runs"));
    flight.kill().unwrap();
    wait(&mut flight);
}

/// A view, and its address with the token.
fn view(place: &Place, connect: &str) -> (Child, String) {
    let mut child = place.command(&["view", "--connect", connect]).spawn().unwrap();
    let mut url = String::new();
    BufReader::new(child.stdout.take().unwrap()).read_line(&mut url).unwrap();
    (child, url.trim().trim_start_matches("http://").to_owned())
}

/// A request to a view, with these fields beside the host.
fn get(address: &str, path: &str, more: &str) -> TcpStream {
    let (host, query) = address.split_once('/').unwrap();
    let mut stream = TcpStream::connect(host).unwrap();
    stream.set_read_timeout(Some(WATCHDOG)).unwrap();
    write!(stream, "GET /{path}{query} HTTP/1.1\r\nHost: {host}\r\n{more}\r\n").unwrap();
    stream
}

/// Reads from a view until it has sent this text.
fn read_until(stream: &mut TcpStream, wanted: &str) -> String {
    let (mut seen, mut piece) = (String::new(), [0; 4096]);
    while !seen.contains(wanted) {
        let count = stream.read(&mut piece).unwrap();
        assert!(count > 0, "expected {wanted:?} before the end, found {seen}");
        seen.push_str(&text(&piece[..count]));
    }
    seen
}

const UPGRADE: &str = "Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n\
                       Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n";

#[test]
fn a_view_shows_the_swarm_of_the_other_machine_to_its_end() {
    let place = Place::new();
    let mut share = place.share(&free_endpoint(), &[]);
    let (mut child, address) = view(&place, &share.endpoint);
    assert!(read_until(&mut get(&address, "", ""), "</html>").contains("HTTP/1.1 200 OK"));
    let mut socket = get(&address, "socket", UPGRADE);
    read_until(&mut socket, "101 Switching Protocols");
    let flight = take_off(&place, &["--clock", "realtime:16"]);
    let seen = read_until(&mut socket, "Waiting for the next swarm");
    assert!(seen.contains("live: s2-right, 8 drones") && seen.contains("x_m"), "{}", &seen[..seen.len().min(2000)]);
    assert!(seen.contains("ended at "), "the last event is missing");
    assert_eq!(land(flight)["outcome"], "reached");
    share.kill();
    read_until(&mut socket, "is lost");
    let status = wait(&mut child);
    let mut said = String::new();
    child.stderr.take().unwrap().read_to_string(&mut said).unwrap();
    assert!(status.code() == Some(3) && said.contains("is lost"), "{status} {said}");
}

#[test]
fn viewers_that_are_slow_or_killed_do_not_disturb_the_run() {
    let place = Place::new();
    let alone = place.fly(&place.scenario(""), &[&["--runtime", "inline"], &SLOW[..]].concat());
    let share = place.share(&free_endpoint(), &[]);
    let connect = ["--connect", &share.endpoint];
    let flight = take_off(&place, &SLOW);
    let mut viewers: Vec<Child> = [&["topic", "echo", "record"][..], &["topic", "hz", "senses"], &["view"]]
        .iter()
        .map(|args| place.command(&[args, &connect[..]].concat()).spawn().unwrap())
        .collect();
    // The first one is not read: its pipe is full soon. The second one prints, so it gets samples.
    let mut line = String::new();
    BufReader::new(viewers[1].stdout.take().unwrap()).read_line(&mut line).unwrap();
    assert!(line.contains("hz"), "{line:?}");
    let helpers: Vec<u32> = viewers.iter().flat_map(|viewer| children_of(viewer.id())).collect();
    assert_eq!(helpers.len(), 3);
    for viewer in &mut viewers {
        viewer.kill().unwrap();
        wait(viewer);
    }
    let alive =
        |pid: &u32| std::fs::read_to_string(format!("/proc/{pid}/stat")).is_ok_and(|stat| !stat.contains(") Z "));
    wait_until("what the viewers started ends", Duration::from_secs(5), || !helpers.iter().any(alive));
    let flown = land(flight);
    assert_eq!((&flown["digest"], &flown["ticks"]), (&alone["digest"], &alone["ticks"]));
}

#[test]
fn a_lost_connection_is_said_in_words() {
    let place = Place::new();
    let mut share = place.share(&free_endpoint(), &[]);
    let mut flight = take_off(&place, &["--clock", "realtime"]);
    let connect = ["--connect", &share.endpoint];
    wait_until("the swarm is shared", WATCHDOG, || {
        place.run(&[&["topic", "list"], &connect[..]].concat()).status.success()
    });
    let mut echo = place.command(&[&["topic", "echo", "record"], &connect[..]].concat()).spawn().unwrap();
    let mut out = BufReader::new(echo.stdout.take().unwrap());
    let mut line = String::new();
    out.read_line(&mut line).unwrap();
    share.kill();
    std::io::copy(&mut out, &mut std::io::sink()).unwrap();
    let done = echo.wait_with_output().unwrap();
    assert!(done.status.code() == Some(3) && text(&done.stderr).contains("is lost"), "{done:?}");
    flight.kill().unwrap();
    wait(&mut flight);
}

#[test]
fn only_those_with_a_certificate_look() {
    let place = Place::new();
    for keys in ["keys", "others"] {
        assert!(place.run(&["host", "--init-keys", keys]).status.success());
    }
    let endpoint = free_endpoint().replace("tcp/", "tls/");
    let _share = place.share(&endpoint, &["--keys", "keys"]);
    let top = |more: &[&str]| place.run(&[&["top", "--once", "--connect", &endpoint], more].concat());
    assert!(told(&top(&["--keys", "keys"])).contains("no swarm runs"));
    for others in [&["--keys", "others"][..], &[]] {
        let done = top(others);
        assert_eq!(done.status.code(), Some(3), "{done:?}");
        assert!(
            text(&done.stderr).contains(&format!("nothing is shared at {endpoint}: expected `skein share`")),
            "{done:?}"
        );
    }
}

#[test]
fn what_cannot_be_looked_at_is_refused_in_words() {
    let place = Place::new();
    let refused = |args: &[&str], code: i32, why: &str| {
        let done = place.run(args);
        let said = text(&done.stderr);
        assert!(done.status.code() == Some(code) && said.contains(why), "{args:?}: {done:?}");
    };
    refused(&["topic", "list", "--connect", "tcp/10.255.0.1:7448"], 2, "--insecure");
    refused(&["view", "--connect", "nowhere"], 2, "expected an endpoint such as");
    refused(&["top", "--once", "--keys", "keys"], 2, "expected --connect");
    refused(&["share", "--listen", "tcp/0.0.0.0:0"], 2, "--insecure");
    let endpoint = free_endpoint();
    refused(&["view", "--connect", &endpoint], 3, &format!("nothing is shared at {endpoint}"));
    // A host shares nothing.
    let host = place.host("a", &free_endpoint(), &[]);
    refused(&["topic", "list", "--connect", &host.endpoint], 3, "nothing is shared at");
}

fn session(role: &str, endpoint: &str) -> zenoh::Session {
    let mut config = zenoh::Config::default();
    config.insert_json5("scouting/multicast/enabled", "false").unwrap();
    if role == "connect" {
        config.insert_json5("listen/endpoints", "[]").unwrap();
    }
    config.insert_json5(&format!("{role}/endpoints"), &format!("[{endpoint:?}]")).unwrap();
    zenoh::open(config).wait().unwrap()
}

#[test]
fn another_version_is_refused_by_its_name() {
    let place = Place::new();
    let share = place.share(&free_endpoint(), &[]);
    let viewer = session("connect", &share.endpoint);
    let ask = || {
        let replies = viewer.get("skein/share/*").payload(r#"{"version":"Skein 9.1","wanted":"all"}"#).wait().unwrap();
        replies.recv().ok().and_then(|reply| reply.into_result().err()).map(|error| text(&error.payload().to_bytes()))
    };
    let mut why = None;
    wait_until("the share answers", WATCHDOG, || {
        why = ask();
        why.is_some()
    });
    assert!(why.as_ref().unwrap().contains("the viewer with Skein 9.1: use one version"), "{why:?}");
    // And the other way round: a share of another version.
    let endpoint = free_endpoint();
    let other = session("listen", &endpoint);
    let answer = |query: zenoh::query::Query| query.reply_err("this share is built with Skein 9.1").wait().unwrap();
    let _offer = other.declare_queryable("skein/share/x").callback(answer).wait().unwrap();
    let done = place.run(&["topic", "list", "--connect", &endpoint]);
    assert!(done.status.code() == Some(2) && text(&done.stderr).contains("built with Skein 9.1"), "{done:?}");
}

#[test]
fn a_share_that_lies_ends_no_viewer_with_a_panic() {
    let place = Place::new();
    let scenario = place.scenario("");
    let manifest: Value = {
        let done = place.fly(&scenario, &["--runtime", "inline", "--out", "out"]);
        assert_eq!(done["outcome"], "reached");
        serde_json::from_slice(&std::fs::read(place.path().join("out/manifest.json")).unwrap()).unwrap()
    };
    let good = &manifest["scenario"];
    assert!(good.is_object(), "{manifest}");
    let list = |scenario: &Value| serde_json::json!([{ "folder": "lie.1_2_3", "scenario": scenario }]).to_string();
    let junk: Vec<u8> = [1_u64, 9, u64::MAX, 7, u64::MAX].iter().flat_map(|word| word.to_le_bytes()).collect();
    let record: Vec<u8> = [&1_u64.to_le_bytes()[..], &400_u64.to_le_bytes(), &[255; 400]].concat();
    let over = 2_u64.to_le_bytes().to_vec();
    for (what, runs, samples, code) in [
        ("no list", "[1".to_owned(), over.clone(), 3),
        ("no scenario", list(&Value::from(7)), over.clone(), 3),
        ("a swarm without end", list(good), b"abc".to_vec(), 3),
        ("an end at once", list(good), over.clone(), 0),
        ("samples that are longer than the message", list(good), [&junk[..], &over].concat(), 0),
        ("a record that is none", list(good), record, 0),
    ] {
        let endpoint = free_endpoint();
        let liar = session("listen", &endpoint);
        let told = std::sync::atomic::AtomicBool::new(false);
        let answer = move |query: zenoh::query::Query| {
            let asked = text(&query.payload().unwrap().to_bytes());
            let reply = match asked.contains("\"runs\"") {
                true => runs.clone().into_bytes(),
                false if told.swap(true, std::sync::atomic::Ordering::Relaxed) => 2_u64.to_le_bytes().to_vec(),
                false => samples.clone(),
            };
            query.reply("skein/share/x", reply).wait().unwrap();
        };
        let _offer = liar.declare_queryable("skein/share/x").callback(answer).wait().unwrap();
        let done = place.run(&["topic", "echo", "record", "--connect", &endpoint]);
        assert_eq!(done.status.code(), Some(code), "{what}: {done:?}");
        assert!(!text(&done.stderr).contains("panicked"), "{what}: {done:?}");
    }
}
