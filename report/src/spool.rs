//! Keeps the records of a run while it flies: a thread appends them, as they are, to one file.
//!
//! The files for people and tools are made from it after the flight, so that a swarm that needs all cores does not wait
//! for text to be formatted. In the file, each record follows its length in bytes as a `u64` in native byte order, and is
//! padded to eight bytes.

use crate::error::ReportError;
use crate::tuning::{SPOOL_BLOCK_BYTES, SPOOL_BLOCKS, SPOOL_PIECE_BYTES};
use crossbeam_channel::{Receiver, Sender, bounded};
use skein_protocol::record::RecordView;
use std::fs::File;
use std::io::{self, BufReader, ErrorKind, Read, Seek, SeekFrom, Write};
use std::mem;
use std::path::Path;
use std::thread::JoinHandle;

const WORD: usize = size_of::<u64>();

/// Appends records to the file.
pub(crate) struct Spool {
    block: Vec<u8>,
    block_len: usize,
    full: Sender<Vec<u8>>,
    empty: Receiver<Vec<u8>>,
    writer: JoinHandle<io::Result<()>>,
}

impl Spool {
    /// Starts the thread, which writes to a new file.
    pub(crate) fn new(file: File) -> io::Result<Self> {
        Self::start(file, SPOOL_BLOCK_BYTES)
    }

    fn start(mut out: impl Write + Send + 'static, block_len: usize) -> io::Result<Self> {
        let (full, filled) = bounded::<Vec<u8>>(SPOOL_BLOCKS);
        let (emptied, empty) = bounded(SPOOL_BLOCKS);
        // The channel has room for all blocks: sending an empty one neither fails nor waits.
        for _ in 1..SPOOL_BLOCKS {
            drop(emptied.send(Vec::new()));
        }
        let write = move || {
            for mut block in filled {
                out.write_all(&block)?;
                block.clear();
                // The receiver may be gone, because the spool was finished.
                let _ = emptied.send(block);
            }
            out.flush()
        };
        let writer = std::thread::Builder::new().name("spool".to_owned()).spawn(write)?;
        Ok(Self { block: Vec::new(), block_len, full, empty, writer })
    }

    /// Whether [`Spool::take`] would not wait for the disk.
    pub(crate) fn ready(&self) -> bool {
        !self.empty.is_empty() || self.writer.is_finished()
    }

    /// Takes a record, and waits if the disk is slow. Returns false after a write has failed; [`Spool::finish`] then
    /// returns the error.
    pub(crate) fn take(&mut self, record: RecordView<'_>) -> bool {
        let len = record.byte_len();
        let at = self.block.len();
        self.block.extend_from_slice(&(len as u64).to_ne_bytes());
        self.block.resize(at + WORD + len.next_multiple_of(WORD), 0);
        record.write_to(&mut self.block[at + WORD..]);
        if self.block.len() < self.block_len {
            return true;
        }
        let Ok(next) = self.empty.recv() else { return false };
        self.full.send(mem::replace(&mut self.block, next)).is_ok()
    }

    /// Waits until all records are written.
    ///
    /// # Errors
    /// The error of the first write that failed. All records before it are in the file.
    pub(crate) fn finish(self) -> io::Result<()> {
        if !self.block.is_empty() {
            // If the channel is closed, the thread has ended with an error.
            let _ = self.full.send(self.block);
        }
        drop(self.full);
        self.writer.join().unwrap_or_else(|_| Err(io::Error::other("the writing thread panicked")))
    }
}

/// Reads the records of a file in order, from its beginning. Stops before a record that was cut short. `path` names the file
/// in errors.
///
/// # Errors
/// The error of `take`, [`ReportError::Io`], or [`ReportError::Content`] for bytes that are not a record.
pub(crate) fn read(
    mut file: &File,
    path: &Path,
    mut take: impl FnMut(RecordView<'_>) -> Result<(), ReportError>,
) -> Result<(), ReportError> {
    let begin = file.seek(SeekFrom::Start(0)).and_then(|_| file.metadata());
    let left = begin.map_err(ReportError::io(path))?.len();
    let mut records = Records { input: BufReader::with_capacity(SPOOL_PIECE_BYTES, file), left, words: Vec::new() };
    loop {
        match records.next() {
            Ok(Some(record)) => take(record)?,
            Ok(None) => return Ok(()),
            Err(error) if error.kind() == ErrorKind::InvalidData => {
                let (path, found) = (path.to_owned(), error.to_string());
                return Err(ReportError::Content { path, expected: "the records of a run", found });
            }
            Err(error) => return Err(ReportError::io(path)(error)),
        }
    }
}

/// Reads records one after the other.
struct Records<R> {
    input: R,
    /// Number of bytes not yet read.
    left: u64,
    /// The record read last. Its parts must be aligned, so it is stored in words.
    words: Vec<u64>,
}

impl<R: Read> Records<R> {
    fn next(&mut self) -> io::Result<Option<RecordView<'_>>> {
        let mut len = [0; WORD];
        let Some(left) = self.left.checked_sub(WORD as u64) else { return Ok(None) };
        self.input.read_exact(&mut len)?;
        let len = u64::from_ne_bytes(len);
        let padded = len.checked_next_multiple_of(WORD as u64);
        let Some(left) = padded.and_then(|padded| left.checked_sub(padded)) else { return Ok(None) };
        self.left = left;
        self.words.resize(len.div_ceil(WORD as u64) as usize, 0);
        let bytes: &mut [u8] = bytemuck::cast_slice_mut(&mut self.words);
        self.input.read_exact(bytes)?;
        let record = RecordView::parse(&bytes[..len as usize]);
        record.map(Some).map_err(|error| io::Error::new(ErrorKind::InvalidData, error))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::SPOOL;
    use crate::testing::row;
    use skein_protocol::record::{DroneRow, RecordHeader};
    use std::sync::Arc;
    use std::sync::atomic::{AtomicUsize, Ordering};
    use std::time::{Duration, Instant};

    /// A slow disk that fails once it holds `room` bytes.
    struct Disk {
        file: File,
        room: usize,
        delay: Duration,
        largest: Arc<AtomicUsize>,
    }

    impl Write for Disk {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            std::thread::sleep(self.delay);
            self.largest.fetch_max(bytes.len(), Ordering::Relaxed);
            if self.room == 0 {
                return Err(ErrorKind::StorageFull.into());
            }
            let part = self.file.write(&bytes[..bytes.len().min(self.room)])?;
            self.room -= part;
            Ok(part)
        }

        fn flush(&mut self) -> io::Result<()> {
            self.file.flush()
        }
    }

    fn disk(path: &Path, room: usize, delay_us: u64) -> Disk {
        let file = File::create(path).unwrap();
        Disk { file, room, delay: Duration::from_micros(delay_us), largest: Arc::default() }
    }

    /// Gives the spool a record of `tick`, whose events have another length in each tick. Returns whether it was taken.
    fn give(spool: &mut Spool, tick: u64) -> bool {
        let rows: Vec<DroneRow> = (0..4).map(|drone| row(tick as f64, f64::from(drone))).collect();
        let events = vec![b'x'; tick as usize % 11];
        let head = RecordHeader { tick, rows: 4, events_len: events.len() as u32, ..RecordHeader::default() };
        spool.take(RecordView { head: &head, rows: &rows, frames: &[], telemetry: &[], events: &events })
    }

    fn ticks(path: &Path) -> Vec<u64> {
        let mut ticks = Vec::new();
        let take = |record: RecordView<'_>| {
            assert_eq!(record.rows[3].position_m, [record.head.tick as f64, 3.0, 50.0]);
            assert_eq!(record.events.len() as u64, record.head.tick % 11);
            ticks.push(record.head.tick);
            Ok(())
        };
        read(&File::open(path).unwrap(), path, take).unwrap();
        ticks
    }

    #[test]
    fn a_slow_disk_delays_the_recorder_and_loses_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(SPOOL);
        let slow = disk(&path, usize::MAX, 300);
        let largest = Arc::clone(&slow.largest);
        let mut spool = Spool::start(slow, 4096).unwrap();
        let waited = (0..2000).filter(|&tick| {
            let ready = spool.ready();
            assert!(give(&mut spool, tick));
            !ready
        });
        assert!(waited.count() > 0, "the disk was never behind");
        spool.finish().unwrap();
        assert_eq!(ticks(&path), (0..2000).collect::<Vec<_>>());
        assert!(largest.load(Ordering::Relaxed) < 2 * 4096, "blocks grow if the disk is slow");
    }

    #[test]
    fn a_full_disk_is_reported_and_earlier_records_are_kept() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(SPOOL);
        let mut spool = Spool::start(disk(&path, 100_000, 0), 4096).unwrap();
        let refused = (0..100_000).find(|&tick| !give(&mut spool, tick));
        assert!(refused.is_some(), "the disk never was full");
        // The thread closes its channels before it ends, so that a record can be refused a moment earlier.
        let deadline = Instant::now() + Duration::from_secs(10);
        while !spool.ready() && Instant::now() < deadline {
            std::thread::yield_now();
        }
        assert!(spool.ready(), "the spool waits for a full disk");
        assert_eq!(spool.finish().unwrap_err().kind(), ErrorKind::StorageFull);
        let kept = ticks(&path);
        assert!(kept.len() > 90 && kept.iter().zip(0..).all(|(&tick, place)| tick == place), "{kept:?}");
    }

    #[test]
    fn invalid_records_are_refused_and_a_truncated_one_ends_the_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(SPOOL);
        let read_words = |words: &[u64]| {
            std::fs::write(&path, bytemuck::cast_slice(words)).unwrap();
            read(&File::open(&path).unwrap(), &path, |_| panic!("{words:?} is no record"))
        };
        let error = read_words(&[16, 7, 7]).unwrap_err().to_string();
        assert!(error.contains(SPOOL) && error.contains("16 bytes"), "{error}");
        for cut in [&[][..], &[24, 7, 7], &[u64::MAX, 7]] {
            read_words(cut).unwrap();
        }
    }
}
