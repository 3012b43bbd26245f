//! Watches the running swarm, and the next one when that has ended; tells every page.

use crate::tap::{Tap, running};
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

/// Between two looks for a swarm, and for one's end.
const SEARCH: Duration = Duration::from_millis(250);
/// Between two looks at records: shorter, the faster they come, for an observer's buffer holds [`BUFFER`].
const LOOK: [Duration; 2] = [Duration::from_micros(250), Duration::from_millis(8)];
const BUFFER: u32 = 64;
/// A swarm that flies farther than twice this from one picture to the next is too fast to be looked at closely: what is
/// said is told of so much simulated time before each picture, s.
const CLOSE_S: f64 = 0.1;
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
            let mut found = running(name).unwrap_or_default().into_iter().filter(|run| !seen.contains(&run.path));
            // One that another version of Skein flies keeps nobody from being watched.
            let tap = found.find_map(|run| Some((Tap::attach(&run.path).ok()?, run.path)));
            let Some((tap, path)) = tap else {
                std::thread::sleep(SEARCH);
                continue;
            };
            seen.push(path);
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
        let (mut looked, mut pause) = (Instant::now(), LOOK[0]);
        while !self.stopped() {
            match self.drain(tap, &mut watcher) {
                Ok(taken) if taken > BUFFER / 4 => pause = (pause / 2).max(LOOK[0]),
                Ok(taken) if taken < BUFFER / 16 => pause = (pause * 2).min(LOOK[1]),
                Ok(_) => {}
                Err(error) => return self.end(&format!("the swarm cannot be heard any more: {error}")),
            }
            std::thread::sleep(pause);
            if watcher.ended.is_some() || looked.elapsed() > SEARCH {
                looked = Instant::now();
                if watcher.ended.is_some() || !tap.alive() {
                    return self.end(watcher.ended.as_deref().unwrap_or("the swarm has gone"));
                }
            }
        }
    }

    /// Takes the records there are, and tells how many.
    fn drain(&self, tap: &Tap, watcher: &mut Watcher) -> Result<u32, BusError> {
        let mut taken = 0;
        while let Some(sample) = tap.records.receive()? {
            taken += 1;
            if let Ok(record) = RecordView::parse(sample.bytes()) {
                self.take(watcher, record);
            }
            if taken == BUFFER {
                break; // Others want to be looked at as well: the clock, the end.
            }
        }
        Ok(taken)
    }

    fn end(&self, how: &str) {
        lock(&self.board).keep(page::status_line(&format!("{how}. Waiting for the next swarm.")));
    }

    fn take(&self, watcher: &mut Watcher, record: RecordView<'_>) {
        let selected = self.selected.load(Ordering::Relaxed);
        if selected != watcher.selected {
            watcher.selected = selected;
            watcher.observer.select_receiver((selected != NOBODY).then_some(DroneId(selected)));
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
    /// Ticks that a fast swarm is looked at closely.
    close: u64,
    picture: Duration,
    /// Whether every tick is looked at closely.
    slow: bool,
    /// The tick in which a picture became due.
    due: Option<u64>,
    last_tick: u64,
    last: Instant,
    ended: Option<String>,
}

impl Watcher {
    fn new(tap: &Tap) -> Self {
        Self {
            observer: Observer::new(tap.facts.clone()),
            selected: NOBODY,
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
        let sample = self.look(record);
        (events.iter().filter_map(page::event_line).collect(), sample.as_ref().map(page::sample_line))
    }

    fn look(&mut self, record: RecordView<'_>) -> Option<Sample> {
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
