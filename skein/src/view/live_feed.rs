//! The live feed: watches the running swarm, and the next one when it has ended, and sends lines of JSON to every page.

use crate::exit::Failure;
use crate::tap::{SwarmTap, Swarms};
use skein_protocol::DroneId;
use skein_protocol::record::{EventKind, RecordView, RunEvent};
use skein_report::page;
use skein_report::scene::{Observer, Sample};
use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
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
/// Greatest number of samples by which a page may be behind.
const LAG: u64 = 256;
/// Size of the lines that are sent to a page at a time, bytes; the last line may exceed it.
const PIECE: usize = 256 << 10;
/// Greatest size of the samples that are kept for later pages, bytes.
const KEPT: usize = 24 << 20;
/// No drone is selected.
const NONE_SELECTED: u32 = u32::MAX;

/// A line for the pages.
pub(crate) type Line = Arc<str>;

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
    /// Whether no swarm can be watched any more.
    lost: AtomicBool,
}

/// The lines of the run, from which every page takes what it does not have yet.
#[derive(Default)]
struct Backlog {
    /// Number of the run.
    run: u64,
    /// Facts, status and events of the run.
    history: Vec<Line>,
    samples: VecDeque<Line>,
    /// Size of the samples.
    bytes: usize,
    /// Number of samples of this run that are no longer kept.
    dropped: u64,
}

impl Backlog {
    fn begin(&mut self) {
        *self = Self { run: self.run + 1, ..Self::default() };
    }

    fn keep(&mut self, line: String) {
        self.history.push(line.into());
    }

    fn sample(&mut self, line: String) {
        self.bytes += line.len();
        self.samples.push_back(line.into());
        while self.bytes > KEPT {
            self.bytes -= self.samples.pop_front().map_or(self.bytes, |line| line.len());
            self.dropped += 1;
        }
    }

    /// The next lines for a page at this place, and the place after them.
    fn piece(&self, place: &mut Place) -> Vec<Line> {
        if place.run != self.run {
            *place = Place { run: self.run, ..Place::default() };
        }
        let all = self.dropped + self.samples.len() as u64;
        if place.live && all > place.sample + LAG {
            // The page is too slow. It misses samples.
            place.sample = all - 1;
        }
        place.sample = place.sample.max(self.dropped);
        let skipped = (place.sample - self.dropped) as usize;
        let (mut lines, mut bytes) = (Vec::new(), 0);
        for line in self.history.iter().skip(place.event).chain(self.samples.iter().skip(skipped)) {
            if bytes > PIECE {
                break;
            }
            bytes += line.len();
            lines.push(Arc::clone(line));
        }
        let events = lines.len().min(self.history.len() - place.event);
        place.event += events;
        place.sample += (lines.len() - events) as u64;
        place.live |= place.sample == all;
        lines
    }
}

/// What a page has got so far.
#[derive(Default)]
struct Place {
    run: u64,
    event: usize,
    sample: u64,
    /// Whether it once had everything.
    live: bool,
}

/// The receiving end of one page. It holds no lines, so that a slow page costs no memory.
pub(crate) struct Listener {
    shared: Arc<Shared>,
    place: Mutex<Place>,
}

impl Listener {
    /// Some of the lines that are new.
    pub(crate) fn lines(&self) -> Vec<Line> {
        lock(&self.shared.backlog).piece(&mut lock(&self.place))
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // Lists of lines are valid even if a thread panicked while it held the lock.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl LiveFeed {
    /// Starts to watch swarms, one after the other. If `name` is given: those whose name begins with it.
    pub(crate) fn start(swarms: Swarms, name: Option<String>) -> Self {
        let shared = Arc::new(Shared { selected: AtomicU32::new(NONE_SELECTED), ..Shared::default() });
        let watched = Arc::clone(&shared);
        let thread = std::thread::spawn(move || watched.watch(&swarms, name.as_deref()));
        Self { shared, thread: Some(thread) }
    }

    /// Whether the connection to the machines that it watches is lost. Nothing comes any more then.
    pub(crate) fn is_lost(&self) -> bool {
        self.shared.lost.load(Ordering::Acquire)
    }

    /// Adds a page. It first gets the run so far.
    pub(crate) fn listen(&self) -> Listener {
        Listener { shared: Arc::clone(&self.shared), place: Mutex::default() }
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

    fn watch(&self, swarms: &Swarms, name: Option<&str>) {
        let mut seen = Vec::new();
        while !self.stopped() {
            if let Some(failure) = swarms.failure() {
                lock(&self.backlog).keep(page::status_line(&failure.to_string()));
                return self.lost.store(true, Ordering::Release);
            }
            let mut found = swarms.running(name).unwrap_or_default().into_iter().filter(|run| !seen.contains(run));
            // A swarm of another version of Skein cannot be attached to; others still can.
            let tap = found.find_map(|run| Some((SwarmTap::attach(swarms, &run).ok()?, run)));
            let Some((tap, run)) = tap else {
                std::thread::sleep(SEARCH);
                continue;
            };
            seen.push(run);
            self.follow(&tap);
        }
    }

    /// Feeds the pages with one swarm until it has ended.
    fn follow(&self, tap: &SwarmTap) {
        {
            let mut backlog = lock(&self.backlog);
            backlog.begin();
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
    fn drain(&self, tap: &SwarmTap, watcher: &mut Watcher) -> Result<u32, Failure> {
        let mut taken = 0;
        while let Some(sample) = tap.record()? {
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

#[cfg(test)]
mod tests {
    use super::*;

    fn texts(lines: &[Line]) -> Vec<&str> {
        lines.iter().map(AsRef::as_ref).collect()
    }

    #[test]
    fn a_page_gets_every_line_once_and_a_slow_one_misses_samples() {
        let (mut backlog, mut page) = (Backlog::default(), Place::default());
        backlog.begin();
        backlog.keep("facts".to_owned());
        backlog.sample("1".to_owned());
        assert_eq!(texts(&backlog.piece(&mut page)), ["facts", "1"]);
        assert_eq!(texts(&backlog.piece(&mut page)), Vec::<&str>::new());
        backlog.sample("2".to_owned());
        backlog.keep("event".to_owned());
        assert_eq!(texts(&backlog.piece(&mut page)), ["event", "2"]);
        for number in 3..=3 + LAG {
            backlog.sample(number.to_string());
        }
        assert_eq!(texts(&backlog.piece(&mut page)), [(3 + LAG).to_string()]);
        backlog.begin();
        backlog.keep("next".to_owned());
        assert_eq!(texts(&backlog.piece(&mut page)), ["next"]);
    }

    #[test]
    fn a_late_page_gets_what_is_kept_in_pieces() {
        let (mut backlog, mut page) = (Backlog::default(), Place::default());
        backlog.begin();
        let line = "x".repeat(PIECE / 2);
        for _ in 0..200 {
            backlog.sample(line.clone());
        }
        let mut pieces = Vec::new();
        while let lines @ [_, ..] = &backlog.piece(&mut page)[..] {
            pieces.push(lines.len());
        }
        assert_eq!(pieces.iter().sum::<usize>(), KEPT / (PIECE / 2));
        assert!(pieces.iter().all(|&lines| lines <= 3), "{pieces:?}");
    }
}
