//! Nothing that a client sends to the port of a view ends the view or the run. `PROPTEST_CASES` sets the number of clients.
#![allow(clippy::unwrap_used, reason = "a test fails where it cannot go on")]

mod support;

use proptest::prelude::*;
use proptest::test_runner::{Config, TestRunner};
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::process::Stdio;
use std::time::Duration;
use support::Place;

/// Clients of a short run.
const CLIENTS: u32 = 64;

/// A head of a request, line by line. `OWN` stands for the address, `TOKEN` for the query.
fn head() -> impl Strategy<Value = Vec<String>> {
    let lines = [
        "Host: OWN",
        "Host: OWN",
        "Origin: http://OWN",
        "Origin: null",
        "Upgrade: websocket",
        "Connection: Upgrade",
        "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==",
        "Sec-WebSocket-Version: 13",
        "Sec-WebSocket-Version: -1",
        ":",
        "Content-Length: -1",
        "Transfer-Encoding: chunked",
    ];
    let first =
        ["GET /TOKEN HTTP/1.1", "GET /socketTOKEN HTTP/1.1", "GET", "POST /TOKEN HTTP/9", "GET /../TOKEN HTTP/1.1", ""];
    let line = prop_oneof![9 => prop::sample::select(lines.to_vec()).prop_map(str::to_owned), 1 => ".{0,40}"];
    let lines = (prop::sample::select(first.to_vec()), prop::collection::vec(line, 0..9));
    lines.prop_map(|(first, rest)| std::iter::once(first.to_owned()).chain(rest).collect())
}

/// The head of an honest request for the socket.
fn upgrade() -> Vec<String> {
    let lines = [
        "GET /socketTOKEN HTTP/1.1",
        "Host: OWN",
        "Upgrade: websocket",
        "Connection: Upgrade",
        "Sec-WebSocket-Version: 13",
        "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==",
    ];
    lines.map(str::to_owned).into()
}

/// A masked WebSocket frame with any first byte and length.
fn frame() -> impl Strategy<Value = Vec<u8>> {
    let texts = ["{\"select\":0}", "{\"select\":-1}", "{\"select\":1e99}", "[", "{\"select\":{}}", "\u{0}"];
    let body = prop_oneof![
        prop::sample::select(texts.to_vec()).prop_map(|text| text.as_bytes().to_vec()),
        prop::collection::vec(any::<u8>(), 0..100),
    ];
    let first = prop_oneof![4 => Just(0x81u8), 1 => Just(0x88u8), 1 => any::<u8>()];
    (first, any::<u8>(), any::<bool>(), body).prop_map(|(first, length, honest, body)| {
        let length = if honest { 0x80 | body.len() as u8 } else { length };
        [&[first, length, 0, 0, 0, 0], &body[..]].concat()
    })
}

/// What a client sends: a head, and bytes after it.
fn request() -> impl Strategy<Value = (Vec<String>, Vec<u8>)> {
    let frames = prop::collection::vec(frame(), 0..6).prop_map(|frames| frames.concat());
    prop_oneof![
        (head(), prop::collection::vec(any::<u8>(), 0..40)),
        (Just(upgrade()), frames),
        (Just(Vec::new()), prop::collection::vec(any::<u8>(), 0..400)),
    ]
}

#[test]
fn views() {
    let place = Place::new();
    // A mission that outlasts every number of clients.
    let long =
        ["mission.end=\"time\"", "mission.duration_s=35000", "time.timeout_s=36000"].map(|key| ["--set", key]).concat();
    let mut flight = place.take_off("s2-right", &[&["--clock", "realtime"], &long[..]].concat());
    flight.processes();
    let mut view = place.command(&["view"]).stderr(Stdio::null()).spawn().unwrap();
    let mut url = String::new();
    BufReader::new(view.stdout.take().unwrap()).read_line(&mut url).unwrap();
    let (address, query) = url.trim().trim_start_matches("http://").split_once('/').unwrap();
    let send = |lines: &[String], more: &[u8]| -> Vec<u8> {
        let mut stream = TcpStream::connect(address).unwrap();
        stream.set_read_timeout(Some(Duration::from_millis(20))).unwrap();
        let head = lines.join("\r\n").replace("OWN", address).replace("TOKEN", query);
        let end = if lines.is_empty() { "" } else { "\r\n\r\n" };
        // A refused client is cut off while it still sends.
        let _ = stream.write_all(&[head.as_bytes(), end.as_bytes(), more].concat());
        let mut answer = vec![0; 1 << 12];
        let length = stream.read(&mut answer).unwrap_or(0);
        answer.truncate(length);
        answer
    };
    let cases = std::env::var("PROPTEST_CASES").ok().and_then(|cases| cases.parse().ok()).unwrap_or(CLIENTS);
    let mut runner = TestRunner::new(Config { cases, failure_persistence: None, ..Config::default() });
    let sent = runner.run(&request(), |(lines, more)| {
        send(&lines, &more);
        prop_assert!(support::process::is_alive(view.id()), "the view has ended");
        Ok(())
    });
    let page = ["GET /TOKEN HTTP/1.1".to_owned(), "Host: OWN".to_owned()];
    let served =
        std::iter::repeat_with(|| send(&page, &[])).take(100).any(|answer| answer.starts_with(b"HTTP/1.1 200 OK"));
    let ended = view.try_wait().unwrap();
    let _ = (view.kill(), view.wait());
    sent.unwrap();
    assert!(served && ended.is_none(), "served: {served}, ended: {ended:?}");
    let flying = support::process::is_alive(flight.pid());
    support::process::signal("INT", flight.pid());
    assert!(flying && flight.finish().code == Some(130), "the run has ended");
}
