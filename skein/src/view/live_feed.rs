//! The live feed: watches the running swarm, and the next one when it has ended, and sends lines of JSON to every page.

use crate::tap::{SwarmTap, running};
use skein_bus::BusError;
use skein_protocol::DroneId;
use skein_protocol::record::{EventKind, RecordView, RunEvent};
use skein_report::page;
use skein_report::scene::{Observer, Sample};
use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Time between two looks for a swarm, and for its end.
const SEARCH: Duration = Duration::from_millis(250);
/// Shortest and longest time between two looks for records. The faster records come, the shorter the time, because an
/// observer's buffer holds [`BUFFER`] records.
const POLL: [Duration; 2] = [Duration::from_micros(250), Duration::from_millis(8)];
/// Records that an observer's buffer holds.
const BUFFER: u32 = 64;
/// If more than twice this simulated time passes between two pictures, the swarm is too fast to show every frame. Then only
/// the frames of this time before each picture are shown, s.
const CLOSE_S: f64 = 0.1;
/// Wall time between two pictures; the second value is for swarms of more than [`MANY`] drones.
const PICTURE: [Duration; 2] = [Duration::from_millis(16), Duration::from_millis(50)];
/// From this size on, a swarm counts as large.
const MANY: u32 = 200;
/// Greatest number of lines that wait for a slow page. The page misses further samples.
const QUEUE: usize = 4096;
/// Greatest size of the samples that are kept for later pages, bytes.
const KEPT: usize = 24 << 20;
/// No drone is selected.
const NONE_SELECTED: u32 = u32::MAX;

type Line = Arc<str>;

/// The live feed.
pub(crate) struct LiveFeed {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

#[derive(Default)]
struct Shared {
    backlog: Mutex<Backlog>,
    selected: AtomicU32,
    stop: AtomicBool,
}

/// What a new page gets first, and the pages that listen.
#[derive(Default)]
struct Backlog {
    /// Facts, status and events of the run.
    history: Vec<Line>,
    samples: VecDeque<Line>,
    bytes: usize,
    pages: Vec<SyncSender<Line>>,
}

impl Backlog {
    fn send(&mut self, line: &Line) {
        self.pages.retain(|page| !matches!(page.try_send(Arc::clone(line)), Err(TrySendError::Disconnected(_))));
    }

    fn keep(&mut self, line: String) {
        let line: Line = line.into();
        self.send(&line);
        self.history.push(line);
    }

    fn sample(&mut self, line: String) {
        let line: Line = line.into();
        self.send(&line);
        self.bytes += line.len();
        self.samples.push_back(line);
        while self.bytes > KEPT {
            self.bytes -= self.samples.pop_front().map_or(self.bytes, |line| line.len());
        }
    }
}

/// The receiving end of one page.
pub(crate) struct Listener {
    first: Mutex<Vec<Line>>,
    lines: Receiver<Line>,
}

impl Listener {
    /// The lines that are new.
    pub(crate) fn lines(&self) -> Vec<Line> {
        let mut lines = std::mem::take(&mut *lock(&self.first));
        lines.extend(self.lines.try_iter());
        lines
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // Lists of lines are valid even if a thread panicked while it held the lock.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl LiveFeed {
    /// Starts to watch swarms, one after the other. If `name` is given: those whose name begins with it.
    pub(crate) fn start(name: Option<String>) -> Self {
        let shared = Arc::new(Shared { selected: AtomicU32::new(NONE_SELECTED), ..Shared::default() });
        let watched = Arc::clone(&shared);
        let thread = std::thread::spawn(move || watched.watch(name.as_deref()));
        Self { shared, thread: Some(thread) }
    }

    /// Adds a page. It first gets the run so far.
    pub(crate) fn listen(&self) -> Listener {
        let (page, lines) = sync_channel(QUEUE);
        let mut backlog = lock(&self.shared.backlog);
        backlog.pages.push(page);
        let first = backlog.history.iter().chain(&backlog.samples).cloned().collect();
        Listener { first: Mutex::new(first), lines }
    }

    /// Selects the drone whose received frames are shown in a large swarm.
    pub(crate) fn select(&self, drone: Option<u32>) {
        self.shared.selected.store(drone.unwrap_or(NONE_SELECTED), Ordering::Relaxed);
    }
}

impl Drop for LiveFeed {
    fn drop(&mut self) {
        self.shared.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            // The thread has printed its own panic.
            let _ = thread.join();
        }
    }
}

impl Shared {
    fn stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    fn watch(&self, name: Option<&str>) {
        let mut seen = Vec::new();
        while !self.stopped() {
            let mut found = running(name).unwrap_or_default().into_iter().filter(|run| !seen.contains(&run.path));
            // A swarm of another version of Skein cannot be attached to; others still can.
            let tap = found.find_map(|run| Some((SwarmTap::attach(&run.path).ok()?, run.path)));
            let Some((tap, path)) = tap else {
                std::thread::sleep(SEARCH);
                continue;
            };
            seen.push(path);
            self.follow(&tap);
        }
    }

    /// Feeds the pages with one swarm until it has ended.
    fn follow(&self, tap: &SwarmTap) {
        {
            let mut backlog = lock(&self.backlog);
            (backlog.history, backlog.samples, backlog.bytes) = Default::default();
            backlog.keep(page::facts_line(&tap.facts));
            backlog.keep(page::status_line(&page::live_status(&tap.facts)));
        }
        let mut watcher = Watcher::new(tap);
        let (mut checked, mut pause) = (Instant::now(), POLL[0]);
        while !self.stopped() {
            match self.drain(tap, &mut watcher) {
                Ok(taken) if taken > BUFFER / 4 => pause = (pause / 2).max(POLL[0]),
                Ok(taken) if taken < BUFFER / 16 => pause = (pause * 2).min(POLL[1]),
                Ok(_) => {}
                Err(error) => return self.end(&format!("the connection to the swarm failed: {error}")),
            }
            std::thread::sleep(pause);
            if watcher.ended.is_some() || checked.elapsed() > SEARCH {
                checked = Instant::now();
                if watcher.ended.is_some() || !tap.alive() {
                    return self.end(watcher.ended.as_deref().unwrap_or("the swarm has gone"));
                }
            }
        }
    }

    /// Takes the waiting records. Returns how many there were.
    fn drain(&self, tap: &SwarmTap, watcher: &mut Watcher) -> Result<u32, BusError> {
        let mut taken = 0;
        while let Some(sample) = tap.records.receive()? {
            taken += 1;
            if let Ok(record) = RecordView::parse(sample.bytes()) {
                self.take(watcher, record);
            }
            if taken == BUFFER {
                break; // The caller checks the clock and the swarm's end in between.
            }
        }
        Ok(taken)
    }

    fn end(&self, how: &str) {
        lock(&self.backlog).keep(page::status_line(&format!("{how}. Waiting for the next swarm.")));
    }

    fn take(&self, watcher: &mut Watcher, record: RecordView<'_>) {
        let selected = self.selected.load(Ordering::Relaxed);
        if selected != watcher.selected {
            watcher.selected = selected;
            watcher.observer.select_receiver((selected != NONE_SELECTED).then_some(DroneId(selected)));
        }
        let (events, sample) = watcher.take(record);
        if events.is_empty() && sample.is_none() {
            return;
        }
        let mut backlog = lock(&self.backlog);
        for line in events {
            backlog.keep(line);
        }
        if let Some(line) = sample {
            backlog.sample(line);
        }
    }
}

/// Turns one swarm's records into lines.
struct Watcher {
    observer: Observer,
    selected: u32,
    /// Number of ticks before each picture whose frames are shown, if the swarm is fast.
    close: u64,
    picture: Duration,
    /// Whether the frames of every tick are shown.
    slow: bool,
    /// The tick in which the next picture became due.
    due: Option<u64>,
    last_tick: u64,
    last: Instant,
    ended: Option<String>,
}

impl Watcher {
    fn new(tap: &SwarmTap) -> Self {
        Self {
            observer: Observer::new(tap.facts.clone()),
            selected: NONE_SELECTED,
            close: (CLOSE_S / tap.facts.dt_s).round().max(1.0) as u64,
            picture: PICTURE[usize::from(tap.facts.drones > MANY)],
            slow: true,
            due: None,
            last_tick: 0,
            last: Instant::now(),
            ended: None,
        }
    }

    fn take(&mut self, record: RecordView<'_>) -> (Vec<String>, Option<String>) {
        let parse = |line: &[u8]| serde_json::from_slice::<RunEvent>(line);
        let events = record.parse_events(parse).unwrap_or_default();
        for event in &events {
            if let EventKind::End { reason, .. } = &event.what {
                self.ended = Some(format!("ended at {:.2} s: {reason}", event.t_s));
            }
        }
        let sample = self.sample(record);
        (events.iter().filter_map(page::event_line).collect(), sample.as_ref().map(page::sample_line))
    }

    fn sample(&mut self, record: RecordView<'_>) -> Option<Sample> {
        let tick = record.head.tick;
        if self.due.is_none() && (self.last.elapsed() >= self.picture || self.ended.is_some()) {
            self.due = Some(tick);
        }
        if !self.slow && self.due.is_none() {
            self.observer.skip(record);
            return None;
        }
        let wanted = self.due.is_some_and(|due| self.slow || tick >= due + self.close || self.ended.is_some());
        let sample = self.observer.take(record, wanted)?;
        self.slow = tick - self.last_tick.min(tick) < 2 * self.close;
        (self.due, self.last_tick, self.last) = (None, tick, Instant::now());
        Some(sample)
    }
}
