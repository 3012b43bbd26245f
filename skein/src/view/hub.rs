//! Watches the running swarm, and the next one when that has ended; tells every page.

use crate::tap::{Tap, running};
use skein_protocol::DroneId;
use skein_protocol::record::{Happening, RecordView, RunEvent};
use skein_report::page;
use skein_report::scene::Observer;
use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Between two looks for a swarm, and for one's end.
const SEARCH: Duration = Duration::from_millis(250);
/// Between two looks at records.
const LOOK: Duration = Duration::from_micros(500);
/// Simulated time between two samples of a fast swarm, s; a slow one is sampled for every picture.
const SAMPLE_S: f64 = 0.1;
/// Wall time between two pictures, and in a swarm of more than [`MANY`] drones.
const PICTURE: [Duration; 2] = [Duration::from_millis(16), Duration::from_millis(50)];
const MANY: u32 = 200;
/// Lines that wait for a slow page: it misses samples beyond.
const QUEUE: usize = 4096;
/// Bytes of samples kept for a page that comes later.
const KEPT: usize = 24 << 20;
/// Nobody selected.
const NOBODY: u32 = u32::MAX;

type Line = Arc<str>;

/// Tells every page what happens.
pub struct Hub {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

#[derive(Default)]
struct Shared {
    board: Mutex<Board>,
    selected: AtomicU32,
    stop: AtomicBool,
}

/// What a page that comes now is told first, and who listens.
#[derive(Default)]
struct Board {
    /// Facts, status and events of the run.
    story: Vec<Line>,
    samples: VecDeque<Line>,
    bytes: usize,
    pages: Vec<SyncSender<Line>>,
}

impl Board {
    fn tell(&mut self, line: &Line) {
        self.pages.retain(|page| !matches!(page.try_send(Arc::clone(line)), Err(TrySendError::Disconnected(_))));
    }

    fn keep(&mut self, line: String) {
        let line: Line = line.into();
        self.tell(&line);
        self.story.push(line);
    }

    fn sample(&mut self, line: String) {
        let line: Line = line.into();
        self.tell(&line);
        self.bytes += line.len();
        self.samples.push_back(line);
        while self.bytes > KEPT {
            self.bytes -= self.samples.pop_front().map_or(self.bytes, |line| line.len());
        }
    }
}

/// One page's ear.
pub struct Listener {
    first: Mutex<Vec<Line>>,
    lines: Receiver<Line>,
}

impl Listener {
    /// What is new.
    pub fn lines(&self) -> Vec<Line> {
        let mut lines = std::mem::take(&mut *lock(&self.first));
        lines.extend(self.lines.try_iter());
        lines
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // Lists of lines are whole whatever a thread that panicked was doing with them.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Hub {
    /// Watches swarms whose names begin so, one after the other.
    pub fn start(name: Option<String>) -> Self {
        let shared = Arc::new(Shared { selected: AtomicU32::new(NOBODY), ..Shared::default() });
        let watched = Arc::clone(&shared);
        let thread = std::thread::spawn(move || watched.watch(name.as_deref()));
        Self { shared, thread: Some(thread) }
    }

    /// A new page's ear: it is told the run so far.
    pub fn listen(&self) -> Listener {
        let (page, lines) = sync_channel(QUEUE);
        let mut board = lock(&self.shared.board);
        board.pages.push(page);
        let first = board.story.iter().chain(&board.samples).cloned().collect();
        Listener { first: Mutex::new(first), lines }
    }

    /// In a large swarm, tells what this drone hears.
    pub fn select(&self, drone: Option<u32>) {
        self.shared.selected.store(drone.unwrap_or(NOBODY), Ordering::Relaxed);
    }
}

impl Drop for Hub {
    fn drop(&mut self) {
        self.shared.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            // A panic in there was printed there.
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
            let found = running(name).unwrap_or_default().into_iter().find(|run| !seen.contains(&run.path));
            let Some(tap) = found.as_ref().and_then(|run| Tap::attach(&run.path).ok()) else {
                std::thread::sleep(SEARCH);
                continue;
            };
            seen.extend(found.map(|run| run.path));
            self.follow(&tap);
        }
    }

    /// Tells of one swarm until it has ended.
    fn follow(&self, tap: &Tap) {
        {
            let mut board = lock(&self.board);
            (board.story, board.samples, board.bytes) = Default::default();
            board.keep(page::facts_line(&tap.facts));
            board.keep(page::status_line(&page::live_status(&tap.facts)));
        }
        let mut watcher = Watcher::new(tap);
        let mut looked = Instant::now();
        while !self.stopped() {
            match tap.records.receive() {
                Ok(Some(sample)) => {
                    if let Ok(record) = RecordView::parse(sample.bytes()) {
                        self.take(&mut watcher, record);
                    }
                }
                Ok(None) => std::thread::sleep(LOOK),
                Err(error) => return self.end(&format!("the swarm cannot be heard any more: {error}")),
            }
            if watcher.ended.is_some() || looked.elapsed() > SEARCH {
                looked = Instant::now();
                if watcher.ended.is_some() || !tap.alive() {
                    return self.end(watcher.ended.as_deref().unwrap_or("the swarm has gone"));
                }
            }
        }
    }

    fn end(&self, how: &str) {
        lock(&self.board).keep(page::status_line(&format!("{how}. Waiting for the next swarm.")));
    }

    fn take(&self, watcher: &mut Watcher, record: RecordView<'_>) {
        let selected = self.selected.load(Ordering::Relaxed);
        if selected != watcher.selected {
            watcher.selected = selected;
            watcher.observer.listen((selected != NOBODY).then_some(DroneId(selected)));
        }
        let (events, sample) = watcher.take(record);
        if events.is_empty() && sample.is_none() {
            return;
        }
        let mut board = lock(&self.board);
        events.into_iter().for_each(|line| board.keep(line));
        sample.into_iter().for_each(|line| board.sample(line));
    }
}

/// Makes lines of one swarm's records.
struct Watcher {
    observer: Observer,
    selected: u32,
    /// Ticks between two samples at most.
    stride: u64,
    picture: Duration,
    last_tick: Option<u64>,
    last: Instant,
    ended: Option<String>,
}

impl Watcher {
    fn new(tap: &Tap) -> Self {
        Self {
            observer: Observer::new(tap.facts.clone()),
            selected: NOBODY,
            stride: (SAMPLE_S / tap.facts.dt_s).round().max(1.0) as u64,
            picture: PICTURE[usize::from(tap.facts.drones > MANY)],
            last_tick: None,
            last: Instant::now(),
            ended: None,
        }
    }

    fn take(&mut self, record: RecordView<'_>) -> (Vec<String>, Option<String>) {
        let parse = |line: &[u8]| serde_json::from_slice::<RunEvent>(line);
        let events = record.parse_events(parse).unwrap_or_default();
        for event in &events {
            if let Happening::End { reason, .. } = &event.what {
                self.ended = Some(format!("ended at {:.2} s: {reason}", event.t_s));
            }
        }
        let tick = record.head.tick;
        let far = self.last_tick.is_none_or(|last| tick >= last + self.stride);
        let wanted = far || self.last.elapsed() >= self.picture;
        let sample = self.observer.take(record, wanted);
        if sample.is_some() {
            (self.last_tick, self.last) = (Some(tick), Instant::now());
        }
        (events.iter().filter_map(page::event_line).collect(), sample.as_ref().map(page::sample_line))
    }
}
