//! Ports: the objects by which a process sends and receives.
//!
//! A subscriber is connected to a publisher once each has looked for the other: in its next `send` or `receive`, or in
//! `connect`. Until then, the publisher's samples wait in the subscriber's buffer. Samples that do not fit are lost without
//! an error, and if the publisher ends, all are lost. Therefore: all processes make their ports, then all call `connect`,
//! then the mission begins; and a publisher stays until its last sample is received.
#![allow(unsafe_code)]

use crate::error::BusError;
use crate::payload::{DownWord, RecordWord, StreamHeader, UplinkHeader, WireFrame, Word};
use crate::room::Room;
use crate::shared_memory::require;
use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::port::{LoanError, ReceiveError, SendError};
use iceoryx2::prelude::{PortFactory as _, ZeroCopySend, ipc};
use iceoryx2::sample::Sample;
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;
use skein_protocol::Tick;
use skein_protocol::frame::Frame;
use std::cell::Cell;
use std::fmt::Debug;
use std::mem::MaybeUninit;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;

/// Sends the downlink of a tick from the world to all drones.
pub type DownlinkPublisher = StreamPublisher<DownWord>;
/// Receives the downlink, in a drone or an observer.
pub type DownlinkSubscriber = StreamSubscriber<DownWord>;
/// Receives the record, in the recorder or an observer.
pub type RecordSubscriber = StreamSubscriber<RecordWord>;

/// What the world does when the recorder's buffer is full.
pub enum RecordPolicy {
    /// Waits for the recorder as long as the function of the time waited returns true. Then it drops the sample, as below. For
    /// lockstep.
    Wait(Box<dyn Fn(Duration) -> bool + Send>),
    /// Drops the sample and counts it, see [`RecordPublisher::dropped`]. For the wall clock.
    Drop,
}

/// Most bytes of a sample beside its elements.
const SAMPLE_HEADER: usize = 128;

/// An open service of `P` with the user header `H`.
pub(crate) type Factory<P, H> = PortFactory<ipc::Service, [P], H>;

/// Whether a port has lost a connection. The degradation handlers set it: without them, iceoryx2 loses samples without an
/// error, at the latest when the limit of open files is reached. Even with them, it reports the loss only once, and not
/// while a port is made.
#[derive(Clone, Debug, Default)]
pub(crate) struct Health(Arc<AtomicBool>);

impl Health {
    pub(crate) fn degrade(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    pub(crate) fn check(&self, service: &str) -> Result<(), BusError> {
        if self.0.load(Ordering::Relaxed) {
            return Err(BusError::Degraded { service: service.to_owned() });
        }
        Ok(())
    }
}

/// A publisher, its service and its health.
#[derive(Debug)]
pub(crate) struct Sender<P: ZeroCopySend + Debug + 'static, H: ZeroCopySend + Debug> {
    pub(crate) port: Publisher<ipc::Service, [P], H>,
    pub(crate) service: String,
    pub(crate) health: Health,
    pub(crate) segments: Segments,
}

/// The data segments of a publisher. iceoryx2 makes another one for a sample that is longer than all before.
#[derive(Debug)]
pub(crate) struct Segments {
    room: Room,
    /// Greatest number of elements in a sample of the newest segment.
    longest: Cell<usize>,
    /// Samples in a segment.
    chunks: usize,
}

impl Segments {
    pub(crate) fn new(room: Room, longest: usize, chunks: usize) -> Self {
        Self { room, longest: Cell::new(longest), chunks }
    }

    /// Whether a sample of `len` elements of `P` needs another segment, for which there is room.
    fn grow<P>(&self, len: usize) -> Result<bool, BusError> {
        if len <= self.longest.get() {
            return Ok(false);
        }
        let longest = len.next_power_of_two();
        // Each sample has a header.
        let sample = (longest * size_of::<P>() + SAMPLE_HEADER).next_power_of_two();
        require((self.chunks * sample) as u64)?;
        self.longest.set(longest);
        Ok(true)
    }
}

impl<P: ZeroCopySend + Debug + 'static, H: ZeroCopySend + Debug + Default> Sender<P, H> {
    fn connect(&self) -> Result<(), BusError> {
        let result = self.port.update_connections();
        self.health.check(&self.service)?;
        result
            .map_err(|error| self.transfer("connect", error.to_string(), "raise the limit of open files (`ulimit -n`)"))
    }

    /// Loans `len` elements, lets `fill` write them in place, and sends them. Returns the number of receivers.
    fn send(&self, header: H, len: usize, fill: impl FnOnce(&mut [MaybeUninit<P>])) -> Result<usize, BusError> {
        self.health.check(&self.service)?;
        let grows = self.segments.grow::<P>(len)?;
        let mut sample = self.port.loan_slice_uninit(len).map_err(|error| self.refused(error))?;
        if grows {
            self.segments.room.reserve()?;
        }
        *sample.user_header_mut() = header;
        fill(sample.payload_mut());
        // SAFETY: `P` is plain data without invalid values, and the memory is a mapped file, where every byte has a value.
        let sent = unsafe { sample.assume_init() }.send();
        self.health.check(&self.service)?;
        sent.map_err(|error| match error {
            SendError::UnableToDeliver => BusError::Full { service: self.service.clone() },
            other => self.transfer("send", other.to_string(), "the run cannot go on"),
        })
    }

    fn refused(&self, error: LoanError) -> BusError {
        let hint = "free space in /dev/shm, or raise the limit of file sizes (`ulimit -f`)";
        self.transfer("loan a sample", error.to_string(), hint)
    }

    fn transfer(&self, what: &'static str, cause: String, hint: &'static str) -> BusError {
        BusError::Transfer { what, service: self.service.clone(), cause, hint }
    }
}

/// A subscriber, its service and its health.
#[derive(Debug)]
pub(crate) struct Receiver<P: ZeroCopySend + Debug + 'static, H: ZeroCopySend + Debug> {
    pub(crate) port: Subscriber<ipc::Service, [P], H>,
    pub(crate) service: String,
    pub(crate) health: Health,
}

impl<P: ZeroCopySend + Debug + 'static, H: ZeroCopySend + Debug> Receiver<P, H> {
    fn connect(&self) -> Result<(), BusError> {
        let result = self.port.update_connections();
        self.health.check(&self.service)?;
        result.map_err(|error| self.transfer(error.into()))
    }

    fn receive(&self) -> Result<Option<Sample<ipc::Service, [P], H>>, BusError> {
        let received = self.port.receive();
        self.health.check(&self.service)?;
        received.map_err(|error| self.transfer(error))
    }

    fn transfer(&self, error: ReceiveError) -> BusError {
        let hint = match error {
            ReceiveError::ExceedsMaxBorrows => "drop the samples held before",
            ReceiveError::ConnectionFailure(_) => "raise the limit of open files (`ulimit -n`)",
        };
        BusError::Transfer { what: "receive", service: self.service.clone(), cause: error.to_string(), hint }
    }
}

/// Sends byte streams, in place.
#[derive(Debug)]
pub struct StreamPublisher<W: Word>(pub(crate) Sender<W, StreamHeader>);

impl<W: Word> StreamPublisher<W> {
    /// Connects to the ports at the other end, see [`crate::ports`]. Otherwise the next call does so, within a tick.
    ///
    /// # Errors
    /// [`BusError::Degraded`] from the first failed connection on, [`BusError::Transfer`].
    pub fn connect(&self) -> Result<(), BusError> {
        self.0.connect()
    }

    /// Loans `byte_len` bytes (8-aligned), lets `fill` write them in place, and sends them under `tick`. Bytes that `fill`
    /// does not write keep old values. Returns the number of receivers.
    ///
    /// # Errors
    /// [`BusError::Degraded`] from the first failed connection on, [`BusError::Transfer`].
    pub fn send(&self, tick: Tick, byte_len: usize, fill: impl FnOnce(&mut [u8])) -> Result<usize, BusError> {
        let header = StreamHeader { tick, byte_len: byte_len as u64 };
        self.0.send(header, byte_len.div_ceil(size_of::<u64>()), |words| {
            // SAFETY: a `Word` is eight plain bytes, and in a mapped file every byte has a value. The slice covers the loaned
            // words, which are borrowed mutably.
            let bytes = unsafe { std::slice::from_raw_parts_mut(words.as_mut_ptr().cast::<u8>(), size_of_val(words)) };
            bytes[byte_len..].fill(0);
            fill(&mut bytes[..byte_len]);
        })
    }
}

/// Receives byte streams.
#[derive(Debug)]
pub struct StreamSubscriber<W: Word>(pub(crate) Receiver<W, StreamHeader>);

impl<W: Word> StreamSubscriber<W> {
    /// Connects to the ports at the other end, see [`crate::ports`]. Otherwise the next call does so, within a tick.
    ///
    /// # Errors
    /// [`BusError::Degraded`] from the first failed connection on, [`BusError::Transfer`].
    pub fn connect(&self) -> Result<(), BusError> {
        self.0.connect()
    }

    /// The oldest sample that is not yet received. A subscriber can hold two samples at a time: drop what is read.
    ///
    /// # Errors
    /// [`BusError::Degraded`] from the first failed connection on, [`BusError::Transfer`].
    pub fn receive(&self) -> Result<Option<StreamSample<W>>, BusError> {
        Ok(self.0.receive()?.map(StreamSample))
    }

    /// The sample of this tick. Older samples are dropped. If the next one is newer, it is dropped too, and the result is
    /// `None`.
    ///
    /// # Errors
    /// As [`StreamSubscriber::receive`].
    pub fn receive_tick(&self, tick: Tick) -> Result<Option<StreamSample<W>>, BusError> {
        while let Some(sample) = self.receive()? {
            if sample.tick() >= tick {
                return Ok(Some(sample).filter(|sample| sample.tick() == tick));
            }
        }
        Ok(None)
    }
}

/// A received byte stream, read in place and returned to the publisher when dropped.
pub struct StreamSample<W: Word>(Sample<ipc::Service, [W], StreamHeader>);

impl<W: Word> StreamSample<W> {
    /// The tick it belongs to.
    #[must_use]
    pub fn tick(&self) -> Tick {
        self.0.user_header().tick
    }

    /// Its bytes, 8-aligned.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        let words = self.0.payload();
        // Another process wrote the length, so it is limited to the payload.
        let len = usize::try_from(self.0.user_header().byte_len)
            .map_or(size_of_val(words), |len| len.min(size_of_val(words)));
        // SAFETY: a `Word` is eight plain bytes, `len` is at most the size of the payload, and the publisher does not write the
        // sample before it is dropped.
        unsafe { std::slice::from_raw_parts(words.as_ptr().cast::<u8>(), len) }
    }
}

/// Sends a drone's frames.
#[derive(Debug)]
pub struct UplinkPublisher(pub(crate) Sender<WireFrame, UplinkHeader>);

impl UplinkPublisher {
    /// Connects to the ports at the other end, see [`crate::ports`]. Otherwise the next call does so, within a tick.
    ///
    /// # Errors
    /// [`BusError::Degraded`] from the first failed connection on, [`BusError::Transfer`].
    pub fn connect(&self) -> Result<(), BusError> {
        self.0.connect()
    }

    /// Loans `count` frames, lets `fill` write them all in place, and sends them. To be called at most once per tick.
    ///
    /// # Errors
    /// [`BusError::Full`] if the world has not received the eight samples before, [`BusError::Degraded`] for good once a
    /// connection failed, [`BusError::Transfer`].
    pub fn send(&self, header: UplinkHeader, count: usize, fill: impl FnOnce(&mut [Frame])) -> Result<(), BusError> {
        self.0.send(header, count, |frames| {
            // SAFETY: `WireFrame` is transparent over `Frame`, which is plain data, and in a mapped file every byte has a value.
            // The slice covers the loaned frames, which are borrowed mutably.
            fill(unsafe { std::slice::from_raw_parts_mut(frames.as_mut_ptr().cast::<Frame>(), frames.len()) });
        })?;
        Ok(())
    }
}

/// Receives the frames of a shard's drones, in the world.
#[derive(Debug)]
pub struct UplinkSubscriber(pub(crate) Receiver<WireFrame, UplinkHeader>);

impl UplinkSubscriber {
    /// Connects to the ports at the other end, see [`crate::ports`]. Otherwise the next call does so, within a tick.
    ///
    /// # Errors
    /// [`BusError::Degraded`] from the first failed connection on, [`BusError::Transfer`].
    pub fn connect(&self) -> Result<(), BusError> {
        self.0.connect()
    }

    /// The next sample of any drone of the shard; the samples of one drone are in order. Call it as often as samples are
    /// expected: each call looks through the shard's drones from the first one on.
    ///
    /// # Errors
    /// [`BusError::Degraded`] from the first failed connection on, [`BusError::Transfer`].
    pub fn receive(&self) -> Result<Option<UplinkSample>, BusError> {
        Ok(self.0.receive()?.map(UplinkSample))
    }
}

/// Frames of one drone and tick, read in place and returned to the publisher when dropped.
pub struct UplinkSample(Sample<ipc::Service, [WireFrame], UplinkHeader>);

impl UplinkSample {
    /// The source and the tick.
    #[must_use]
    pub fn header(&self) -> UplinkHeader {
        *self.0.user_header()
    }

    /// The frames.
    #[must_use]
    pub fn frames(&self) -> &[Frame] {
        let frames = self.0.payload();
        // SAFETY: `WireFrame` is transparent over `Frame`; the publisher does not write the sample before it is dropped.
        unsafe { std::slice::from_raw_parts(frames.as_ptr().cast::<Frame>(), frames.len()) }
    }
}

/// Sends the record to the recorder.
#[derive(Debug)]
pub struct RecordPublisher {
    pub(crate) stream: StreamPublisher<RecordWord>,
    pub(crate) dropped: Arc<AtomicU64>,
}

impl RecordPublisher {
    /// Connects to the ports at the other end, see [`crate::ports`]. Otherwise the next call does so, within a tick.
    ///
    /// # Errors
    /// [`BusError::Degraded`] from the first failed connection on, [`BusError::Transfer`].
    pub fn connect(&self) -> Result<(), BusError> {
        self.stream.connect()
    }

    /// As [`StreamPublisher::send`]. Whether it waits for the recorder depends on the policy.
    ///
    /// # Errors
    /// As [`StreamPublisher::send`].
    pub fn send(&self, tick: Tick, byte_len: usize, fill: impl FnOnce(&mut [u8])) -> Result<usize, BusError> {
        self.stream.send(tick, byte_len, fill)
    }

    /// Number of samples that were dropped because the recorder's buffer was full.
    #[must_use]
    pub fn dropped(&self) -> u64 {
        self.dropped.load(Ordering::Relaxed)
    }
}

/// Sends the record to observers.
#[derive(Debug)]
pub struct WatchPublisher {
    pub(crate) stream: StreamPublisher<RecordWord>,
    pub(crate) service: Factory<RecordWord, StreamHeader>,
}

impl WatchPublisher {
    /// Whether at least one observer watches. Asked in every tick, so that a run without observers sends nothing.
    #[must_use]
    pub fn watched(&self) -> bool {
        self.service.dynamic_config().number_of_subscribers() > 0
    }

    /// As [`StreamPublisher::send`]. It never waits.
    ///
    /// # Errors
    /// As [`StreamPublisher::send`].
    pub fn send(&self, tick: Tick, byte_len: usize, fill: impl FnOnce(&mut [u8])) -> Result<usize, BusError> {
        self.stream.send(tick, byte_len, fill)
    }
}
