//! What one viewer gets of one swarm: a thread with a tap of its own, which answers each time the viewer asks.

use crate::ask::Samples;
use crate::error::HostsError;
use crate::names;
use crate::outbox::Outbox;
use crossbeam_channel::{Receiver, Sender, TryRecvError, unbounded};
use skein_bus::{DownlinkSubscriber, living};
use skein_runtime::{LocalTap, LookStream};
use std::path::PathBuf;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use zenoh::query::Query;
use zenoh::{Session, Wait};

/// Shortest and longest time between two looks for samples. The faster they come, the shorter the time, because the buffer of an
/// observer holds 64 records, and that of the downlink eight.
const POLL: [Duration; 2] = [Duration::from_micros(250), Duration::from_millis(8)];
/// With more samples than this in one look, the next look is sooner; with less than a quarter of it, later.
const MANY: u32 = 4;
/// How long a question waits for samples. Chosen by hand: less than viewers wait for a reply.
const HOLD: Duration = Duration::from_millis(500);
/// A viewer that asks nothing for this long is gone. Chosen by hand.
const IDLE: Duration = Duration::from_secs(5);
/// Time between two looks whether the swarm still flies.
const ALIVE: Duration = Duration::from_millis(250);
/// How long a swarm may take to have its services. Chosen by hand.
const ATTACH_LIMIT: Duration = Duration::from_secs(5);
/// Time between two attempts to attach to a swarm.
const ATTACH_POLL: Duration = Duration::from_millis(50);

/// A thread that answers what one viewer asks of one swarm.
pub(crate) struct FeedThread {
    /// Takes the viewer's questions.
    pub(crate) asked: Sender<Query>,
    thread: JoinHandle<()>,
}

impl FeedThread {
    /// Starts a thread for the swarm in this folder. It ends when `asked` is dropped, the viewer asks no more, or the swarm is gone and
    /// all is told.
    pub(crate) fn start(session: &Session, path: PathBuf, stream: LookStream) -> Self {
        let (sender, asked) = unbounded();
        let key = names::share(&session.zid().to_string());
        let thread = std::thread::spawn(move || {
            let (replies, to_reply) = unbounded();
            // Replies over a slow network block. Meanwhile, samples are taken and room is made.
            std::thread::spawn(move || reply(&key, &to_reply));
            let (waiting, heard, outbox) = (None, Instant::now(), Outbox::default());
            Feed { path, asked, replies, waiting, heard, outbox }.run(stream);
        });
        Self { asked: sender, thread }
    }

    /// Whether it has ended.
    pub(crate) fn is_finished(&self) -> bool {
        self.thread.is_finished()
    }
}

/// A question, and what is replied to it.
type Reply = (Query, Result<Samples, String>);

/// Sends replies.
fn reply(key: &str, replies: &Receiver<Reply>) {
    for (query, reply) in replies {
        let sent = match reply {
            Ok(samples) => query.reply(key, samples.to_bytes()).wait(),
            Err(why) => query.reply_err(why).wait(),
        };
        if let Err(error) = sent {
            tracing::warn!(%error, "a viewer gets no reply");
        }
    }
}

struct Feed {
    path: PathBuf,
    asked: Receiver<Query>,
    replies: Sender<Reply>,
    /// The question that is not yet answered, and when it came.
    waiting: Option<(Query, Instant)>,
    /// When the viewer asked last.
    heard: Instant,
    outbox: Outbox,
}

impl Feed {
    fn run(mut self, stream: LookStream) {
        if let Err(error) = self.serve(stream) {
            tracing::warn!(%error, "a viewer gets no more");
            if let Some((query, _)) = self.waiting.take() {
                self.send(query, Err(error.to_string()));
            }
        }
    }

    fn serve(&mut self, stream: LookStream) -> Result<(), HostsError> {
        let Some(tap) = self.attach()? else { return Ok(()) };
        // A tap takes records anyway; whoever wants the downlink leaves them.
        let downlink = match stream {
            LookStream::Record => None,
            LookStream::Downlink => Some(tap.downlink()?),
        };
        let (mut pause, mut checked, mut over) = (POLL[0], Instant::now(), false);
        while self.listen() && !(over && self.outbox.is_empty()) {
            match self.drain(&tap, downlink.as_ref())? {
                taken if taken > MANY => pause = (pause / 2).max(POLL[0]),
                taken if taken <= MANY / 4 => pause = (pause * 2).min(POLL[1]),
                _ => {}
            }
            self.answer(false);
            if checked.elapsed() > ALIVE {
                // What comes between this and the end of the swarm is taken once more before the end is told.
                over = over || !tap.is_alive();
                checked = Instant::now();
                if over {
                    self.drain(&tap, downlink.as_ref())?;
                }
            }
            std::thread::sleep(pause);
        }
        self.end();
        Ok(())
    }

    /// Attaches to the swarm. If it is gone, the viewer is told so; if it has no place for an observer, it is told why.
    fn attach(&mut self) -> Result<Option<LocalTap>, HostsError> {
        let since = Instant::now();
        while self.listen() {
            let error = match LocalTap::attach(&self.path) {
                Ok(tap) => return Ok(Some(tap)),
                Err(error) => error,
            };
            if !living().is_ok_and(|runs| runs.contains(&self.path)) {
                self.end();
                return Ok(None);
            }
            if since.elapsed() > ATTACH_LIMIT {
                return Err(error.into());
            }
            self.answer(false);
            std::thread::sleep(ATTACH_POLL);
        }
        Ok(None)
    }

    /// Takes the viewer's questions. False if it asks no more.
    fn listen(&mut self) -> bool {
        loop {
            match self.asked.try_recv() {
                Ok(query) => {
                    self.heard = Instant::now();
                    self.waiting = Some((query, self.heard));
                }
                Err(TryRecvError::Empty) => return self.heard.elapsed() < IDLE,
                Err(TryRecvError::Disconnected) => return false,
            }
        }
    }

    /// Takes what the swarm has published. Returns how many samples there were.
    fn drain(&mut self, tap: &LocalTap, downlink: Option<&DownlinkSubscriber>) -> Result<u32, HostsError> {
        let mut taken = 0;
        match downlink {
            Some(port) => {
                while let Some(sample) = port.receive()? {
                    self.outbox.push_downlink(sample.bytes());
                    taken += 1;
                }
            }
            None => {
                while let Some(sample) = tap.records().receive()? {
                    self.outbox.push_record(sample.bytes());
                    taken += 1;
                }
            }
        }
        Ok(taken)
    }

    /// Answers the question that waits, once there is something to tell or it has waited long enough.
    fn answer(&mut self, over: bool) {
        if let Some((query, _)) =
            self.waiting.take_if(|(_, since)| over || !self.outbox.is_empty() || since.elapsed() > HOLD)
        {
            let words = self.outbox.take();
            self.send(query, Ok(Samples { over: over && self.outbox.is_empty(), words }));
        }
    }

    fn send(&self, query: Query, reply: Result<Samples, String>) {
        // The thread that replies lives as long as this one.
        let _ = self.replies.send((query, reply));
    }

    /// Tells the viewer that the swarm is gone, as soon as it asks.
    fn end(&mut self) {
        while self.waiting.is_none() && self.listen() {
            std::thread::sleep(POLL[1]);
        }
        self.answer(true);
    }
}
