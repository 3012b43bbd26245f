//! HTTP and the socket: a thread a client, no more than a few clients.

use super::gate::{Asked, HEAD_MAX, judge};
use super::hub::{Hub, Listener};
use crate::interrupt::Interrupt;
use std::io::{ErrorKind, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};
use tungstenite::{Message, WebSocket};

/// Between two looks at new clients and at what a client says.
const LOOK: Duration = Duration::from_millis(4);
/// A client that does not ask, or does not read, for so long is let go.
const PATIENCE: Duration = Duration::from_secs(5);
/// Clients at a time.
const CLIENTS: usize = 32;

/// What is served.
pub enum Content {
    /// One page.
    Page(String),
    /// A page and the socket it listens to.
    Live {
        /// The page.
        page: String,
        /// Where its lines come from.
        hub: Arc<Hub>,
    },
}

/// Serves clients until it is interrupted.
pub fn serve(listener: &TcpListener, port: u16, content: &Content, interrupt: &Interrupt) -> std::io::Result<()> {
    listener.set_nonblocking(true)?;
    let clients = AtomicUsize::new(0);
    std::thread::scope(|scope| {
        while interrupt.signal().is_none() {
            match listener.accept() {
                Ok((stream, _)) if clients.load(Ordering::Relaxed) < CLIENTS => {
                    clients.fetch_add(1, Ordering::Relaxed);
                    let clients = &clients;
                    scope.spawn(move || {
                        // A client that goes is no trouble of ours.
                        let _ = answer(stream, port, content, interrupt);
                        clients.fetch_sub(1, Ordering::Relaxed);
                    });
                }
                Ok(_) => {}
                Err(error) if error.kind() == ErrorKind::WouldBlock => std::thread::sleep(LOOK),
                Err(error) => tracing::warn!(%error, "a client could not be accepted"),
            }
        }
    });
    Ok(())
}

fn answer(mut stream: TcpStream, port: u16, content: &Content, interrupt: &Interrupt) -> std::io::Result<()> {
    stream.set_nonblocking(false)?;
    stream.set_nodelay(true)?;
    stream.set_read_timeout(Some(LOOK))?;
    stream.set_write_timeout(Some(PATIENCE))?;
    let Some(head) = head(&stream, interrupt)? else { return Ok(()) };
    match (judge(&head, port), content) {
        (Asked::Socket, Content::Live { hub, .. }) => return talk(stream, hub, interrupt),
        (Asked::Page, Content::Page(page) | Content::Live { page, .. }) => respond(&mut stream, "200 OK", page)?,
        (Asked::Refused(status), _) => respond(&mut stream, status, status)?,
        (Asked::Socket, Content::Page(_)) => respond(&mut stream, "404 Not Found", "a recording has no socket")?,
    }
    // What was peeked at is read, or the system resets the connection under the answer.
    let mut rest = [0; HEAD_MAX];
    let _ = stream.read(&mut rest);
    Ok(())
}

/// The head of a request, left in the socket; `None` if it does not come.
fn head(stream: &TcpStream, interrupt: &Interrupt) -> std::io::Result<Option<String>> {
    let limit = Instant::now() + PATIENCE;
    let mut bytes = vec![0; HEAD_MAX];
    while Instant::now() < limit && interrupt.signal().is_none() {
        let length = match stream.peek(&mut bytes) {
            Ok(0) => return Ok(None),
            Ok(length) => length,
            Err(error) if waits(&error) => continue,
            Err(error) => return Err(error),
        };
        let text = String::from_utf8_lossy(&bytes[..length]);
        if let Some((head, _)) = text.split_once("\r\n\r\n") {
            return Ok(Some(head.to_owned()));
        }
        if length == HEAD_MAX {
            return Ok(None);
        }
        std::thread::sleep(LOOK);
    }
    Ok(None)
}

fn waits(error: &std::io::Error) -> bool {
    matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted)
}

fn respond(stream: &mut TcpStream, status: &str, body: &str) -> std::io::Result<()> {
    let kind = if status.starts_with("200") { "text/html" } else { "text/plain" };
    let head = format!(
        "HTTP/1.1 {status}\r\nContent-Type: {kind}; charset=utf-8\r\nContent-Length: {}\r\nCache-Control: no-store\r\n\
         X-Content-Type-Options: nosniff\r\nX-Frame-Options: DENY\r\nConnection: close\r\n\r\n",
        body.len()
    );
    stream.write_all(head.as_bytes())?;
    stream.write_all(body.as_bytes())?;
    stream.flush()
}

/// Sends what the hub tells, takes what the page selects.
fn talk(stream: TcpStream, hub: &Hub, interrupt: &Interrupt) -> std::io::Result<()> {
    stream.set_read_timeout(Some(PATIENCE))?;
    let Ok(mut socket) = tungstenite::accept(stream) else { return Ok(()) };
    socket.get_ref().set_read_timeout(Some(LOOK))?;
    let listener = hub.listen();
    while interrupt.signal().is_none() {
        if !hear(&mut socket, hub)? || !tell(&mut socket, &listener) {
            return Ok(());
        }
    }
    // The page shows that it has lost its server; more is not needed.
    let _ = socket.close(None);
    let _ = socket.flush();
    Ok(())
}

/// Waits a little for a word of the page. False once it has gone.
fn hear(socket: &mut WebSocket<TcpStream>, hub: &Hub) -> std::io::Result<bool> {
    match socket.read() {
        Ok(Message::Text(text)) => {
            let said: serde_json::Value = serde_json::from_str(&text).unwrap_or_default();
            if let Some(drone) = said.get("select") {
                hub.select(drone.as_u64().and_then(|drone| u32::try_from(drone).ok()));
            }
            Ok(true)
        }
        Ok(Message::Close(_)) => Ok(false),
        Ok(_) => Ok(true),
        Err(tungstenite::Error::Io(error)) if waits(&error) => Ok(true),
        Err(_) => Ok(false),
    }
}

/// Sends all lines there are, in one message. False once the page has gone.
fn tell(socket: &mut WebSocket<TcpStream>, listener: &Listener) -> bool {
    let lines = listener.lines();
    lines.is_empty() || socket.send(Message::text(lines.join("\n"))).is_ok()
}
