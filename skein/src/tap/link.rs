//! The link to swarms of other machines: the program `skein-hosts`, which fetches what they publish.

use crate::exit::Failure;
use crate::hosts::{self, NetworkArgs};
use skein_bus::Version;
use skein_runtime::{LookRequest, LookRun, LookWord, samples};
use std::collections::BTreeMap;
use std::io::{BufReader, Write};
use std::os::unix::process::CommandExt;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;

/// Samples that wait to be taken, as many as an observer's buffer holds. Until one is taken, no more are fetched.
const BUFFER: usize = 64;

/// Something that comes over the link.
pub(crate) enum Heard {
    /// A sample in words, and its length in bytes.
    Sample(Vec<u64>, usize),
    /// No more comes, and why.
    Lost(String),
}

/// The link. Dropping it ends the program.
pub(crate) struct Link {
    /// The endpoints, for messages.
    at: String,
    child: Mutex<Child>,
    requests: Mutex<ChildStdin>,
    heard: Arc<LinkState>,
    reader: Option<JoinHandle<()>>,
}

/// What the thread that reads has heard.
#[derive(Default)]
struct LinkState {
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Default)]
struct State {
    /// The swarms that fly; `None` until the first list has come.
    runs: Option<Vec<LookRun>>,
    takers: BTreeMap<LookRequest, SyncSender<Heard>>,
    /// Why nothing comes any more, and whether that is because of the command line.
    failure: Option<(bool, String)>,
}

impl Link {
    /// Connects to shares, and waits until one says what flies.
    pub(crate) fn connect(args: &NetworkArgs) -> Result<Self, Failure> {
        let path = hosts::program()?;
        let mut words = vec!["look".into(), "--version".into(), Version::OWN.to_string().into()];
        args.append_to(&mut words, None);
        let mut command = Command::new(&path);
        command.args(words).stdin(Stdio::piped()).stdout(Stdio::piped());
        // A Ctrl-C of the terminal is for this process: it ends the program after itself.
        let started = command.process_group(0).spawn();
        let mut child =
            started.map_err(|error| Failure::environment(format!("starting {}: {error}", path.display())))?;
        let (Some(requests), Some(words)) = (child.stdin.take(), child.stdout.take()) else {
            return Err(Failure::environment("expected pipes to skein-hosts"));
        };
        let heard = Arc::new(LinkState::default());
        let hearer = Arc::clone(&heard);
        let reader = std::thread::spawn(move || hearer.read(words));
        let (child, requests) = (Mutex::new(child), Mutex::new(requests));
        let link = Self { at: args.connect.join(", "), child, requests, heard, reader: Some(reader) };
        link.wait();
        link.failure().map_or(Ok(link), Err)
    }

    /// Waits for the first list of swarms, or a failure.
    fn wait(&self) {
        let waits = |state: &mut State| state.runs.is_none() && state.failure.is_none();
        drop(self.heard.changed.wait_while(self.heard.lock(), waits).unwrap_or_else(PoisonError::into_inner));
    }

    /// The endpoints.
    pub(crate) fn at(&self) -> &str {
        &self.at
    }

    /// Why nothing comes any more; `None` if something may.
    pub(crate) fn failure(&self) -> Option<Failure> {
        let state = self.heard.lock();
        let (usage, why) = state.failure.as_ref()?;
        Some(if *usage { Failure::usage(why) } else { Failure::environment(why) })
    }

    /// The swarms that fly.
    pub(crate) fn runs(&self) -> Result<Vec<LookRun>, Failure> {
        self.failure().map_or_else(|| Ok(self.heard.lock().runs.clone().unwrap_or_default()), Err)
    }

    /// Asks for what a swarm publishes from now on. The end of the channel is the end of the swarm, or a failure of the link.
    pub(crate) fn request(&self, request: LookRequest) -> Result<Receiver<Heard>, Failure> {
        if let Some(failure) = self.failure() {
            return Err(failure);
        }
        let (sender, receiver) = sync_channel(BUFFER);
        self.heard.lock().takers.insert(request, sender);
        let mut line = serde_json::to_vec(&request).map_err(Failure::environment)?;
        line.push(b'\n');
        // If the program has ended, the thread that reads tells why.
        let _ = lock(&self.requests).write_all(&line);
        Ok(receiver)
    }
}

impl Drop for Link {
    fn drop(&mut self) {
        let child = self.child.get_mut().unwrap_or_else(PoisonError::into_inner);
        // It may have ended by itself.
        let _ = (child.kill(), child.wait());
        if let Some(reader) = self.reader.take() {
            // The thread has printed its own panic.
            let _ = reader.join();
        }
    }
}

impl LinkState {
    fn lock(&self) -> MutexGuard<'_, State> {
        lock(&self.state)
    }

    /// Reads what the program says, to its end.
    fn read(&self, words: ChildStdout) {
        let mut from = BufReader::new(words);
        let failure = loop {
            match LookWord::read(&mut from) {
                Ok(Some(LookWord::Runs(runs))) => {
                    self.lock().runs = Some(runs);
                    self.changed.notify_all();
                }
                Ok(Some(LookWord::Samples(request, words))) => self.pass_on(request, &words),
                Ok(Some(LookWord::Over(request))) => _ = self.lock().takers.remove(&request),
                Ok(Some(LookWord::Lost(request, why))) => {
                    let taker = self.lock().takers.remove(&request);
                    // Whoever takes no more need not know.
                    let _ = taker.map(|taker| taker.send(Heard::Lost(why)));
                }
                Ok(Some(LookWord::Failed { usage, why })) => break (usage, why),
                Ok(None) => break (false, "skein-hosts has ended, which fetches what other machines share".to_owned()),
                Err(error) => break (false, format!("expected words of skein-hosts: {error}")),
            }
        };
        let mut state = self.lock();
        state.failure = Some(failure);
        state.takers.clear();
        self.changed.notify_all();
    }

    /// Hands samples to the one who asked for them, and waits while it has many.
    fn pass_on(&self, request: LookRequest, words: &[u64]) {
        let Some(taker) = self.lock().takers.get(&request).cloned() else { return };
        for sample in samples(words) {
            let Some((words, len)) = sample else {
                tracing::warn!("what came of a swarm ends too early");
                return;
            };
            if taker.send(Heard::Sample(words.to_owned(), len)).is_err() {
                // The swarm is looked at no more.
                self.lock().takers.remove(&request);
                return;
            }
        }
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // What it guards is valid even if a thread panicked while it held the lock.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
