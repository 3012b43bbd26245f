//! A share: it offers what the swarms of this machine publish to viewers elsewhere. It changes nothing of a swarm.

use crate::ask::{self, FeedKey, Samples, SharedRun, Wanted};
use crate::cli::ShareArgs;
use crate::error::HostsError;
use crate::feed_thread::FeedThread;
use crate::names;
use crate::network::Side;
use crate::say::say;
use crate::signals::watch_signals;
use crossbeam_channel::{RecvTimeoutError, unbounded};
use skein_bus::living;
use skein_runtime::scenario_file;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;
use zenoh::query::Query;
use zenoh::{Session, Wait};

/// Time between two looks for a signal. Chosen by hand.
const POLL: Duration = Duration::from_millis(50);
/// Niceness of a share, as in `nice -n`, so that the swarms have precedence.
const NICE: i32 = 10;

/// Offers this machine's swarms until a signal comes. Returns the exit code.
///
/// # Errors
/// [`HostsError`] if they cannot be offered.
pub(crate) fn run(args: &ShareArgs) -> Result<u8, HostsError> {
    let signal = watch_signals()?;
    // If it fails, the share takes a little more CPU time from the swarms.
    let _ = rustix::process::nice(NICE);
    let session = args.network.open(&args.listen, Side::Host)?;
    let share = Share { session, prefix: args.run.clone(), feeds: BTreeMap::new() };
    share.serve(&args.listen, &signal)
}

/// The swarms that are offered.
struct Share {
    session: Session,
    /// What the names of the swarms begin with, if not all are offered.
    prefix: Option<String>,
    /// What viewers get.
    feeds: BTreeMap<FeedKey, FeedThread>,
}

impl Share {
    fn serve(mut self, listen: &[String], signal: &AtomicUsize) -> Result<u8, HostsError> {
        let (sender, queries) = unbounded();
        let _offer = self
            .session
            .declare_queryable(self.key())
            .callback(move |query| _ = sender.send(query))
            .wait()
            .map_err(HostsError::network("offering to look"))?;
        let which = self.prefix.as_ref().map_or(String::new(), |prefix| format!(" whose names begin with {prefix}"));
        say(&format!("shares the swarms of this machine{which} at {}", listen.join(", ")));
        loop {
            match signal.load(Ordering::Relaxed) {
                0 => {}
                number => return Ok(128_u8.wrapping_add(number as u8)),
            }
            match queries.recv_timeout(POLL) {
                Ok(query) => self.answer(query),
                Err(RecvTimeoutError::Timeout) => self.feeds.retain(|_, thread| !thread.is_finished()),
                Err(RecvTimeoutError::Disconnected) => return Err(HostsError::Message("the session is closed")),
            }
        }
    }

    fn key(&self) -> String {
        names::share(&self.session.zid().to_string())
    }

    /// Answers a question, or passes it on to what the viewer gets.
    fn answer(&mut self, query: Query) {
        let bytes = query.payload().map(|payload| payload.to_bytes().into_owned()).unwrap_or_default();
        let sent = match ask::parse(&bytes) {
            Ok(Wanted::Runs { known }) => query.reply(self.key(), self.list(&known)).wait(),
            Ok(Wanted::Next(feed)) => return self.pass_on(query, feed),
            Err(why) => {
                tracing::warn!("a viewer is refused: {why}");
                query.reply_err(why).wait()
            }
        };
        note(sent);
    }

    /// The list of the swarms, without the scenarios that are known.
    fn list(&self, known: &[String]) -> Vec<u8> {
        let run = |path: PathBuf| {
            let folder = folder_name(&path)?;
            let scenario = if known.contains(&folder) {
                None
            } else {
                // A swarm that has just started has none. It is offered when it has one.
                Some(serde_json::to_value(scenario_file::read(&path).ok()?).ok()?)
            };
            Some(SharedRun { folder, scenario })
        };
        let runs: Vec<SharedRun> = self.offered().into_iter().filter_map(run).collect();
        // Scenarios came from JSON, and JSON can hold them.
        serde_json::to_vec(&runs).unwrap_or_default()
    }

    /// The folders of the swarms that are offered.
    fn offered(&self) -> Vec<PathBuf> {
        let named = |path: &PathBuf| {
            let prefix = self.prefix.as_deref().unwrap_or_default();
            folder_name(path).is_some_and(|name| name.starts_with(prefix))
        };
        living().unwrap_or_default().into_iter().filter(named).collect()
    }

    /// Passes a question on to the thread that answers it. If there is none, it is the viewer's first question about this swarm.
    fn pass_on(&mut self, query: Query, wanted: FeedKey) {
        let query = match self.feeds.get(&wanted) {
            Some(thread) => match thread.asked.send(query) {
                Ok(()) => return,
                Err(unheard) => unheard.into_inner(),
            },
            None => query,
        };
        let is_wanted = |path: &PathBuf| folder_name(path).is_some_and(|name| name == wanted.folder);
        let found = self.offered().into_iter().find(is_wanted);
        match found {
            Some(path) => {
                let thread = FeedThread::start(&self.session, path, wanted.stream);
                // It has just been started, and hears.
                let _ = thread.asked.send(query);
                self.feeds.insert(wanted, thread);
            }
            None => note(query.reply(self.key(), Samples { over: true, words: Vec::new() }.to_bytes()).wait()),
        }
    }
}

/// Notes that a viewer gets no reply.
fn note(sent: zenoh::Result<()>) {
    if let Err(error) = sent {
        tracing::warn!(%error, "a viewer gets no reply");
    }
}

/// The name of a swarm's folder, if it can be part of a name on the network.
fn folder_name(path: &Path) -> Option<String> {
    let name = path.file_name()?.to_str()?;
    names::is_name(name).then(|| name.to_owned())
}
