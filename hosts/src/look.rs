//! Looks at swarms of other machines, for a command of `skein`: it asks shares, and passes on what they say. The command checks it.

use crate::ask::{self, FeedKey, Samples, SharedRun, Wanted};
use crate::cli::LookArgs;
use crate::error::HostsError;
use crate::names;
use crate::network::Side;
use skein_bus::Version;
use skein_runtime::{LookRequest, LookRun, LookWord};
use std::collections::BTreeSet;
use std::io::{BufRead, Write};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use zenoh::query::{ConsolidationMode, QueryTarget};
use zenoh::{Session, Wait};

/// How long it waits for a share to be found. Chosen by hand: the time for which it tries to connect, and a little more.
const FIND_LIMIT: Duration = Duration::from_millis(5_500);
/// Time between two looks for a share. Chosen by hand.
const FIND_POLL: Duration = Duration::from_millis(20);
/// Time between two looks for swarms. Chosen by hand.
const RUNS_POLL: Duration = Duration::from_millis(250);
/// What Zenoh says in the place of a reply that takes too long.
const TIMED_OUT: &[u8] = b"Timeout";
/// How long a reply may take. Chosen by hand: large samples over a slow network. If a share is gone, there is an answer earlier.
const REPLY_LIMIT: Duration = Duration::from_secs(30);

/// Passes on what shares say until the command ends. Returns the exit code.
pub(crate) fn run(args: &LookArgs) -> u8 {
    match look(args) {
        Ok(()) => 0,
        Err(error) => {
            let usage = matches!(error, HostsError::Usage(_) | HostsError::NotShared(_));
            // If this fails, the command is gone, and there is no one to tell.
            let _ = tell(&LookWord::Failed { usage, why: error.to_string() });
            if usage { 2 } else { 3 }
        }
    }
}

fn look(args: &LookArgs) -> Result<(), HostsError> {
    let own = Version::OWN.to_string();
    if args.version != own {
        let why = format!("skein-hosts is built with {own}, skein with {}: use one version", args.version);
        return Err(HostsError::Usage(why));
    }
    let since = Instant::now();
    let session = args.network.open(&[], Side::Launcher)?;
    let shares = Arc::new(Shares { session, runs: Mutex::default() });
    let at = args.network.connect.join(", ");
    let mut list = shares.list()?;
    while list.is_none() && since.elapsed() < FIND_LIMIT {
        std::thread::sleep(FIND_POLL);
        list = shares.list()?;
    }
    if list.is_none() {
        return Err(HostsError::NoShare { at });
    }
    let asked = Arc::clone(&shares);
    std::thread::spawn(move || asked.serve());
    let mut told: Option<Vec<LookRun>> = None;
    while let Some(runs) = list {
        if told.as_ref() != Some(&runs) {
            tell(&LookWord::Runs(runs.clone()))?;
            told = Some(runs);
        }
        std::thread::sleep(RUNS_POLL);
        list = shares.list()?;
    }
    Err(HostsError::ShareGone { at })
}

/// The shares that can be reached.
struct Shares {
    session: Session,
    /// The swarms that they share or have shared; the place is the number.
    runs: Mutex<Vec<Known>>,
}

/// A swarm that is or was shared.
#[derive(Clone)]
struct Known {
    /// The key of its share.
    share: String,
    run: LookRun,
}

impl Shares {
    /// The swarms that fly now; `None` if there is no share.
    fn list(&self) -> Result<Option<Vec<LookRun>>, HostsError> {
        let known = self.lock().iter().map(|known| known.run.folder.clone()).collect();
        let replies = self.ask(&names::share("*"), Wanted::Runs { known })?;
        if replies.is_empty() {
            return Ok(None);
        }
        let mut now = BTreeSet::new();
        for (share, bytes) in replies {
            let runs: Vec<SharedRun> =
                serde_json::from_slice(&bytes).map_err(|_| HostsError::Message("a list of swarms is none"))?;
            now.extend(runs.into_iter().filter_map(|run| self.number(&share, run)));
        }
        let runs = self.lock();
        Ok(Some(now.into_iter().filter_map(|number| Some(runs.get(number)?.run.clone())).collect()))
    }

    /// The number of a swarm of this share.
    fn number(&self, share: &str, found: SharedRun) -> Option<usize> {
        let mut runs = self.lock();
        let known = runs.iter().position(|known| known.share == share && known.run.folder == found.folder);
        known.or_else(|| {
            let number = runs.len();
            let scenario = found.scenario.filter(|_| names::is_name(&found.folder))?;
            let run = LookRun { run: u32::try_from(number).ok()?, folder: found.folder, scenario };
            runs.push(Known { share: share.to_owned(), run });
            Some(number)
        })
    }

    fn lock(&self) -> MutexGuard<'_, Vec<Known>> {
        lock(&self.runs)
    }

    /// Asks shares. Returns the replies, each with the key of its share.
    fn ask(&self, key: &str, wanted: Wanted) -> Result<Vec<(String, Vec<u8>)>, HostsError> {
        let replies = self
            .session
            .get(key)
            .payload(ask::request(wanted))
            .target(QueryTarget::All)
            .consolidation(ConsolidationMode::None)
            .timeout(REPLY_LIMIT)
            .wait()
            .map_err(HostsError::network("asking a share"))?;
        let mut found = Vec::new();
        for reply in replies {
            match reply.into_result() {
                Ok(sample) => found.push((sample.key_expr().to_string(), sample.payload().to_bytes().into_owned())),
                Err(error) if *error.payload().to_bytes() == *TIMED_OUT => {}
                Err(error) => {
                    let why = String::from_utf8_lossy(&error.payload().to_bytes()).into_owned();
                    return Err(HostsError::NotShared(why));
                }
            }
        }
        Ok(found)
    }

    /// Does what the command requests, and ends this process once the command is gone.
    fn serve(self: Arc<Self>) {
        let active = Arc::new(Mutex::new(BTreeSet::new()));
        for line in std::io::stdin().lock().lines() {
            let Some(request) = line.ok().and_then(|line| serde_json::from_str::<LookRequest>(&line).ok()) else {
                break;
            };
            if !lock(&active).insert(request) {
                // It is on its way already.
                continue;
            }
            let (shares, active) = (Arc::clone(&self), Arc::clone(&active));
            std::thread::spawn(move || {
                let word = match shares.follow(request) {
                    Ok(()) => LookWord::Over(request),
                    Err(error) => LookWord::Lost(request, error.to_string()),
                };
                lock(&active).remove(&request);
                // As above: the command may be gone.
                let _ = tell(&word);
            });
        }
        std::process::exit(0);
    }

    /// Passes on what a swarm publishes, until it is gone.
    fn follow(&self, request: LookRequest) -> Result<(), HostsError> {
        let known = self.lock().get(request.run as usize).cloned();
        let known = known.ok_or(HostsError::Message("a request is for no swarm"))?;
        let viewer = self.session.zid().to_string();
        let feed = FeedKey { folder: known.run.folder, stream: request.stream, viewer };
        loop {
            let replies = self.ask(&known.share, Wanted::Next(feed.clone()))?;
            let (_, bytes) = replies.first().ok_or(HostsError::LookLost)?;
            let Samples { over, words } = Samples::read(bytes)?;
            if !words.is_empty() {
                tell(&LookWord::Samples(request, words))?;
            }
            if over {
                return Ok(());
            }
        }
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // Lists are valid even if a thread panicked while it held the lock.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Tells the command something. If it is slow, this waits, and so does the share.
fn tell(word: &LookWord) -> Result<(), HostsError> {
    let mut out = std::io::stdout().lock();
    word.write(&mut out).and_then(|()| out.flush()).map_err(HostsError::system("telling skein"))
}
