//! The HTTP and WebSocket server: one thread per client, and a limited number of clients. Those without the view's token do not
//! take the places of the others.

use super::live_feed::{Line, LiveFeed};
use super::request::{Door, MAX_HEAD, Request, classify};
use super::waiting_room::WaitingRoom;
use crate::interrupt::Interrupt;
use std::io::{ErrorKind, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};
use tungstenite::{Message, WebSocket};

/// Time between two looks for new clients and for messages of a client.
const POLL: Duration = Duration::from_millis(4);
/// A client that does not read for this long is disconnected.
const CLIENT_TIMEOUT: Duration = Duration::from_secs(5);
/// A client that sends no request for this long is disconnected.
const REQUEST_TIMEOUT: Duration = Duration::from_secs(2);
/// Greatest number of clients that are served at a time.
const MAX_GUESTS: usize = 32;

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

impl Content {
    /// Whether nothing new comes any more, and never will.
    fn is_lost(&self) -> bool {
        matches!(self, Self::Live { feed, .. } if feed.is_lost())
    }
}

/// Serves clients until it is interrupted, or the connection to the swarms is lost.
pub(crate) fn serve(
    listener: &TcpListener,
    door: &Door,
    content: &Content,
    interrupt: &Interrupt,
) -> std::io::Result<()> {
    listener.set_nonblocking(true)?;
    let server = Server { door, content, interrupt, waiting: WaitingRoom::default(), guests: AtomicUsize::new(0) };
    std::thread::scope(|scope| {
        while interrupt.signal().is_none() && !content.is_lost() {
            match listener.accept() {
                Ok((stream, _)) => {
                    let server = &server;
                    // A client that disconnects is not an error. Without room for a thread it is disconnected.
                    let answer = move || drop(server.answer(stream));
                    if let Err(error) = std::thread::Builder::new().spawn_scoped(scope, answer) {
                        tracing::warn!(%error, "a client could not be served");
                    }
                }
                Err(error) if error.kind() == ErrorKind::WouldBlock => std::thread::sleep(POLL),
                Err(error) => {
                    tracing::warn!(%error, "a client could not be accepted");
                    std::thread::sleep(POLL);
                }
            }
        }
    });
    Ok(())
}

/// What the threads of the clients share.
struct Server<'a> {
    door: &'a Door,
    content: &'a Content,
    interrupt: &'a Interrupt,
    waiting: WaitingRoom,
    /// Number of clients that know the token and are served.
    guests: AtomicUsize,
}

impl Server<'_> {
    fn answer(&self, mut stream: TcpStream) -> std::io::Result<()> {
        stream.set_nonblocking(false)?;
        stream.set_nodelay(true)?;
        stream.set_read_timeout(Some(POLL))?;
        stream.set_write_timeout(Some(CLIENT_TIMEOUT))?;
        let place = self.waiting.enter(&stream)?;
        let head = head(&stream, self.interrupt);
        self.waiting.leave(place);
        let Some(head) = head? else { return Ok(()) };
        let request = classify(&head, self.door);
        if let Request::Refused(status) = request {
            respond(&mut stream, status, status)?;
        } else if self.guests.fetch_add(1, Ordering::Relaxed) < MAX_GUESTS {
            let served = self.serve(stream, request);
            self.guests.fetch_sub(1, Ordering::Relaxed);
            return served;
        } else {
            self.guests.fetch_sub(1, Ordering::Relaxed);
            let status = "503 Service Unavailable";
            respond(&mut stream, status, status)?;
        }
        end(stream);
        Ok(())
    }

    /// Serves a client that knows the token.
    fn serve(&self, mut stream: TcpStream, request: Request) -> std::io::Result<()> {
        match (request, self.content) {
            (Request::Socket, Content::Live { feed, .. }) => return talk(stream, feed, self.interrupt),
            (Request::Socket, Content::Page(_)) => {
                respond(&mut stream, "404 Not Found", "a recorded run has no socket")?;
            }
            (_, Content::Page(page) | Content::Live { page, .. }) => respond(&mut stream, "200 OK", page)?,
        }
        end(stream);
        Ok(())
    }
}

/// Ends an answered connection.
fn end(mut stream: TcpStream) {
    // The request was only peeked at. If it stays unread, the system resets the connection before the answer arrives.
    let mut rest = [0; MAX_HEAD];
    let _ = stream.read(&mut rest);
}

/// The head of a request. It stays in the socket. `None` if it does not come in time.
fn head(stream: &TcpStream, interrupt: &Interrupt) -> std::io::Result<Option<String>> {
    let limit = Instant::now() + REQUEST_TIMEOUT;
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
        // Looked at first, so that all that came before is sent.
        let lost = feed.is_lost();
        let lines = listener.lines();
        if !receive(&mut socket, feed)? || !send(&mut socket, &lines) {
            return Ok(());
        }
        if lost && lines.is_empty() {
            break;
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

/// Sends a piece of the lines that are new. False if the page has disconnected.
fn send(socket: &mut WebSocket<TcpStream>, lines: &[Line]) -> bool {
    lines.is_empty() || socket.send(Message::text(lines.join("\n"))).is_ok()
}
