//! The HTTP and WebSocket server: one thread per client, and a limited number of clients.

use super::live_feed::{Listener, LiveFeed};
use super::request::{MAX_HEAD, Request, classify};
use crate::interrupt::Interrupt;
use std::io::{ErrorKind, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};
use tungstenite::{Message, WebSocket};

/// Time between two looks for new clients and for messages of a client.
const POLL: Duration = Duration::from_millis(4);
/// A client that neither sends a request nor reads for this long is disconnected.
const CLIENT_TIMEOUT: Duration = Duration::from_secs(5);
/// Greatest number of clients at a time.
const MAX_CLIENTS: usize = 32;

/// What is served.
pub(crate) enum Content {
    /// One page.
    Page(String),
    /// A page and the WebSocket that it connects to.
    Live {
        /// The page.
        page: String,
        /// The source of its lines.
        feed: Arc<LiveFeed>,
    },
}

/// Serves clients until it is interrupted.
pub(crate) fn serve(
    listener: &TcpListener,
    port: u16,
    content: &Content,
    interrupt: &Interrupt,
) -> std::io::Result<()> {
    listener.set_nonblocking(true)?;
    let clients = AtomicUsize::new(0);
    std::thread::scope(|scope| {
        while interrupt.signal().is_none() {
            match listener.accept() {
                Ok((stream, _)) if clients.load(Ordering::Relaxed) < MAX_CLIENTS => {
                    clients.fetch_add(1, Ordering::Relaxed);
                    let clients = &clients;
                    scope.spawn(move || {
                        // A client that disconnects is not an error.
                        let _ = answer(stream, port, content, interrupt);
                        clients.fetch_sub(1, Ordering::Relaxed);
                    });
                }
                Ok(_) => {}
                Err(error) if error.kind() == ErrorKind::WouldBlock => std::thread::sleep(POLL),
                Err(error) => tracing::warn!(%error, "a client could not be accepted"),
            }
        }
    });
    Ok(())
}

fn answer(mut stream: TcpStream, port: u16, content: &Content, interrupt: &Interrupt) -> std::io::Result<()> {
    stream.set_nonblocking(false)?;
    stream.set_nodelay(true)?;
    stream.set_read_timeout(Some(POLL))?;
    stream.set_write_timeout(Some(CLIENT_TIMEOUT))?;
    let Some(head) = head(&stream, interrupt)? else { return Ok(()) };
    match (classify(&head, port), content) {
        (Request::Socket, Content::Live { feed, .. }) => return talk(stream, feed, interrupt),
        (Request::Page, Content::Page(page) | Content::Live { page, .. }) => respond(&mut stream, "200 OK", page)?,
        (Request::Refused(status), _) => respond(&mut stream, status, status)?,
        (Request::Socket, Content::Page(_)) => respond(&mut stream, "404 Not Found", "a recorded run has no socket")?,
    }
    // The request was only peeked at. If it stays unread, the system resets the connection before the answer arrives.
    let mut rest = [0; MAX_HEAD];
    let _ = stream.read(&mut rest);
    Ok(())
}

/// The head of a request. It stays in the socket. `None` if it does not come in time.
fn head(stream: &TcpStream, interrupt: &Interrupt) -> std::io::Result<Option<String>> {
    let limit = Instant::now() + CLIENT_TIMEOUT;
    let mut bytes = vec![0; MAX_HEAD];
    while Instant::now() < limit && interrupt.signal().is_none() {
        let length = match stream.peek(&mut bytes) {
            Ok(0) => return Ok(None),
            Ok(length) => length,
            Err(error) if would_block(&error) => continue,
            Err(error) => return Err(error),
        };
        let text = String::from_utf8_lossy(&bytes[..length]);
        if let Some((head, _)) = text.split_once("\r\n\r\n") {
            return Ok(Some(head.to_owned()));
        }
        if length == MAX_HEAD {
            return Ok(None);
        }
        std::thread::sleep(POLL);
    }
    Ok(None)
}

fn would_block(error: &std::io::Error) -> bool {
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

/// Sends the feed's lines to the page, and takes the page's selection.
fn talk(stream: TcpStream, feed: &LiveFeed, interrupt: &Interrupt) -> std::io::Result<()> {
    stream.set_read_timeout(Some(CLIENT_TIMEOUT))?;
    let Ok(mut socket) = tungstenite::accept(stream) else { return Ok(()) };
    socket.get_ref().set_read_timeout(Some(POLL))?;
    let listener = feed.listen();
    while interrupt.signal().is_none() {
        if !receive(&mut socket, feed)? || !send(&mut socket, &listener) {
            return Ok(());
        }
    }
    // The page shows that the connection is lost.
    let _ = socket.close(None);
    let _ = socket.flush();
    Ok(())
}

/// Waits briefly for a message of the page. False if the page has disconnected.
fn receive(socket: &mut WebSocket<TcpStream>, feed: &LiveFeed) -> std::io::Result<bool> {
    match socket.read() {
        Ok(Message::Text(text)) => {
            let message: serde_json::Value = serde_json::from_str(&text).unwrap_or_default();
            if let Some(drone) = message.get("select") {
                feed.select(drone.as_u64().and_then(|drone| u32::try_from(drone).ok()));
            }
            Ok(true)
        }
        Ok(Message::Close(_)) => Ok(false),
        Ok(_) => Ok(true),
        Err(tungstenite::Error::Io(error)) if would_block(&error) => Ok(true),
        Err(_) => Ok(false),
    }
}

/// Sends all waiting lines in one message. False if the page has disconnected.
fn send(socket: &mut WebSocket<TcpStream>, listener: &Listener) -> bool {
    let lines = listener.lines();
    lines.is_empty() || socket.send(Message::text(lines.join("\n"))).is_ok()
}
