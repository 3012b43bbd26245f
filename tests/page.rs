//! The page in a real browser: the report of a run, and a running swarm.
#![allow(clippy::unwrap_used, reason = "a test fails where it cannot go on")]

mod support;

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::process::{Child, Stdio};
use support::Place;
use support::browser::Browser;

/// A hash of the picture on the canvas, and the number of its points that are not empty.
const SEEN: &str = "(() => { const c = document.getElementById('scene');
    const d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data;
    let sum = 0, some = 0; for (let i = 0; i < d.length; i += 4) { if (d[i + 3]) some++; sum = (sum * 31 + d[i] + d[i + 3]) | 0; }
    return [sum, some]; })()";

/// Waits until the page has drawn the next picture.
fn pictured(browser: &mut Browser) {
    browser.value("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(() => done(true))))");
}

/// Selects a drone as a user does.
fn choose(browser: &mut Browser, drone: u32) {
    browser.value(&format!(
        "(() => {{ const s = document.getElementById('selected'); s.value = '{drone}';
            s.dispatchEvent(new Event('change')); return true; }})()"
    ));
    browser.wait("document.getElementById('about').textContent.includes('position')");
}

#[test]
fn a_report_replays_offline() {
    let place = Place::new();
    let Some(mut browser) = Browser::start(&place.join("profile")) else { return };
    place.fly("s2-right", &["--runtime", "inline", "--out", "out", "--set", "radio.loss=0.2"]);
    browser.open(&format!("file://{}", place.join("out/report.html").display()));
    browser.wait("player.story.samples.length > 100 && document.querySelectorAll('#selected option').length === 9");
    assert!(browser.value("document.querySelector('.outcome').textContent").as_str().unwrap().starts_with("reached"));

    pictured(&mut browser);
    let start = browser.value(SEEN);
    assert!(start[1].as_u64().unwrap() > 1000, "the canvas is empty: {start}");
    // This moves the slider as a user does.
    browser.value(
        "(() => { const t = document.getElementById('time'); t.value = 20; t.dispatchEvent(new Event('input')); return true; })()",
    );
    pictured(&mut browser);
    assert_eq!(browser.value("document.getElementById('clock').textContent"), "20.0 s");
    assert_ne!(browser.value(SEEN), start, "another moment, the same picture");

    for name in ["zones", "tracks", "routes", "links", "names", "trails"] {
        let before = browser.value(SEEN);
        browser.value(&format!("document.getElementById('show-{name}').click()"));
        pictured(&mut browser);
        assert_ne!(browser.value(SEEN), before, "the switch {name} changes nothing");
    }
    // What the run has not is not in the key.
    for name in ["marks", "side"] {
        assert_eq!(browser.value(&format!("player.key.lines.{name}.hidden")), true, "{name}");
    }

    choose(&mut browser, 3);
    let about = browser.value("document.getElementById('about').textContent");
    let about = about.as_str().unwrap();
    assert!(about.contains("Hears 0") && about.contains("pose"), "no inbox: {about}");
    browser.wait("document.querySelectorAll('.inbox .lost').length > 0 || (player.seek(player.t + 0.1), false)");

    browser.value("document.getElementById('play').click()");
    browser.wait("player.t > 20.5 && player.playing");
    for name in ["trace", "separation", "speed", "distance", "energy", "formation", "leaders", "messages"] {
        assert_eq!(browser.value(&format!("document.querySelectorAll('figure#{name} svg').length")), 1, "{name}");
    }
    for width in [1280, 390] {
        browser.resize(width, 800);
        pictured(&mut browser);
        let wide = browser.value("document.documentElement.scrollWidth").as_u64().unwrap();
        assert!(wide <= u64::from(width), "{wide} pixels wide on a screen of {width}");
    }
    assert_eq!(browser.errors, Vec::<String>::new());
    let elsewhere = |url: &&String| !["file:", "blob:", "data:", "about:"].iter().any(|own| url.starts_with(own));
    assert_eq!(browser.requests.iter().filter(elsewhere).collect::<Vec<_>>(), Vec::<&String>::new());
}

#[test]
fn marks_and_altitudes_are_shown_where_there_are_any() {
    let place = Place::new();
    let Some(mut browser) = Browser::start(&place.join("profile")) else { return };
    place.fly("s1-left", &["--runtime", "inline", "--out", "out"]);
    browser.open(&format!("file://{}", place.join("out/report.html").display()));
    browser.wait("player.story.samples.length > 100 && player.key.lines.side.hidden");
    assert_eq!(browser.value("document.getElementById('side').hidden"), true);
    // Another sample, as a live view gets it: one drone climbs, and one shows a mark and a line.
    browser.value(
        "(() => { const s = structuredClone(player.story.samples.at(-1)); s.state.t_s += 1; s.state.z_m[2] += 30;
            const at = [s.state.x_m[0] - 60, s.state.y_m[0] + 10, 50];
            s.shown = { marks: [{ drone: 0, label: 'goal', at_m: at }], lines: [{ drone: 1, label: '', from_m: at, to_m: [0, 0, 50] }] };
            player.take({ sample: s }); player.seek(s.state.t_s); return true; })()",
    );
    browser.wait("!player.key.lines.marks.hidden && !player.key.lines.side.hidden");
    pictured(&mut browser);
    let seen = SEEN.replace("'scene'", "'side'");
    assert!(browser.value(&seen)[1].as_u64().unwrap() > 500, "the side view is empty");
    let with_marks = browser.value(SEEN);
    browser.value("document.getElementById('show-marks').click()");
    pictured(&mut browser);
    assert_ne!(browser.value(SEEN), with_marks, "marks are not drawn");
    browser.value("document.getElementById('show-side').click()");
    pictured(&mut browser);
    assert_eq!(browser.value("document.getElementById('side').hidden"), true);
    assert_eq!(browser.errors, Vec::<String>::new());
}

/// A running `skein view`. Dropping this ends it.
struct View {
    child: Child,
    /// With its token.
    url: String,
}

impl View {
    fn start(place: &Place, args: &[&str]) -> Self {
        let mut child = place.command(&[&["view"], args].concat()).stderr(Stdio::inherit()).spawn().unwrap();
        let mut url = String::new();
        BufReader::new(child.stdout.take().unwrap()).read_line(&mut url).unwrap();
        Self { child, url: url.trim().to_owned() }
    }

    /// Its address, and the query with its token.
    fn address(&self) -> (&str, &str) {
        self.url.trim_start_matches("http://").split_once('/').unwrap()
    }

    /// Sends a request and returns the status line of the answer. `OWN` stands for the address, `TOKEN` for the query.
    fn ask(&self, lines: &[&str]) -> String {
        let (address, query) = self.address();
        let mut stream = TcpStream::connect(address).unwrap();
        let head = lines.join("\r\n").replace("OWN", address).replace("TOKEN", query);
        stream.write_all(format!("{head}\r\n\r\n").as_bytes()).unwrap();
        let mut answer = Vec::new();
        let _ = stream.read_to_end(&mut answer);
        String::from_utf8_lossy(&answer).lines().next().unwrap_or_default().to_owned()
    }
}

impl Drop for View {
    fn drop(&mut self) {
        let _ = (self.child.kill(), self.child.wait());
    }
}

#[test]
fn the_page_shows_a_running_swarm() {
    let place = Place::new();
    let Some(mut browser) = Browser::start(&place.join("profile")) else { return };
    let view = View::start(&place, &[]);
    browser.open(&view.url);
    let flight = place.take_off("s2-right", &["--clock", "realtime:4"]);
    browser.wait("player.story.samples.length > 20");
    pictured(&mut browser);
    let (before, seen) = (browser.value("player.now.x[0]"), browser.value(SEEN));
    browser.wait(&format!("player.now.x[0] > {before} + 5"));
    assert_ne!(browser.value(SEEN), seen, "drones that fly do not move on the canvas");
    choose(&mut browser, 2);
    browser.wait("document.getElementById('about').textContent.includes('Hears 0')");
    browser.value("document.getElementById('play').click()");
    let still = browser.value("player.t");
    browser.wait(&format!("player.story.end > {still} + 1"));
    assert_eq!(browser.value("player.t"), still, "a paused view goes on");
    browser.wait("document.getElementById('status').textContent.includes('ended')");
    let done = flight.finish();
    assert_eq!(done.code, Some(0), "{done:?}");
    assert_eq!(browser.errors, Vec::<String>::new());
    let (address, _) = view.address();
    let own = |url: &&String| url.starts_with("about:") || url.contains(&format!("://{address}"));
    let elsewhere: Vec<_> = browser.requests.iter().filter(|url| !own(url)).collect();
    assert!(elsewhere.is_empty() && !browser.requests.is_empty(), "{elsewhere:?}");
}

#[test]
fn requests_from_other_origins_are_refused() {
    let place = Place::new();
    let view = View::start(&place, &[]);
    assert!(view.url.starts_with("http://127.0.0.1:"), "{}", view.url);
    assert_eq!(view.ask(&["GET /TOKEN HTTP/1.1", "Host: OWN"]), "HTTP/1.1 200 OK");
    assert_eq!(view.ask(&["GET /TOKEN HTTP/1.1", "Host: example.org"]), "HTTP/1.1 403 Forbidden");
    let upgrade = ["Upgrade: websocket", "Connection: Upgrade", "Sec-WebSocket-Version: 13"];
    let key = "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==";
    let foreign = ["GET /socketTOKEN HTTP/1.1", "Host: OWN", "Origin: http://example.org", key];
    assert_eq!(view.ask(&[&foreign[..], &upgrade].concat()), "HTTP/1.1 403 Forbidden");
    assert_eq!(view.ask(&["POST /TOKEN HTTP/1.1", "Host: OWN"]), "HTTP/1.1 405 Method Not Allowed");
}

#[test]
fn only_who_knows_the_token_gets_the_page() {
    let place = Place::new();
    let view = View::start(&place, &[]);
    for path in ["/", "/?token=", "/socket", "/?token=00000000000000000000000000000000"] {
        assert_eq!(view.ask(&[&format!("GET {path} HTTP/1.1"), "Host: OWN"]), "HTTP/1.1 403 Forbidden", "{path}");
    }
    // A client that holds places without a request keeps no one out.
    let held: Vec<TcpStream> = (0..100).map(|_| TcpStream::connect(view.address().0).unwrap()).collect();
    assert_eq!(view.ask(&["GET /TOKEN HTTP/1.1", "Host: OWN"]), "HTTP/1.1 200 OK");
    drop(held);
}
