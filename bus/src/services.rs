//! The run's services: the launcher makes them and sets every limit; all other processes open them.

use crate::domain::{Domain, hold};
use crate::error::BusError;
use crate::payload::{DownWord, RecordWord, StreamHeader, UplinkHeader, WireFrame};
use crate::ports::{
    DownlinkPublisher, DownlinkSubscriber, Factory, Health, Receiver, RecordPolicy, RecordPublisher, RecordSubscriber,
    Segments, Sender, StreamPublisher, StreamSubscriber, UplinkPublisher, UplinkSubscriber, WatchPublisher,
};
use crate::room::{Room, check_join};
use iceoryx2::port::{BackpressureAction, BackpressureInfo, DegradationAction};
use iceoryx2::prelude::{
    AllocationStrategy, BackpressureStrategy, CallbackProgression, LogLevel, Node, NodeBuilder, NodeName, NodeState,
    PortFactory as _, ServiceName, SignalHandlingMode, ZeroCopySend, ipc, set_log_level_from_env_or,
};
use iceoryx2::service::builder::publish_subscribe::Builder;
use skein_protocol::downlink::{DownlinkHeader, SensesHeader};
use skein_protocol::frame::AirFrame;
use skein_protocol::record::{DroneRow, RecordHeader};
use std::fmt::{Debug, Display};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};

/// Drones per uplink service. Receiving takes time quadratic in the number of a service's publishers.
pub const SHARD_DRONES: usize = 32;

/// Spare places per service, for restarted drones whose dead node is not yet cleaned.
const SPARE: usize = 4;
/// Size of a subscriber's buffer, samples.
const BUFFER: usize = 8;
/// Size of an observer's buffer, samples: more than a second at 50 Hz.
const WATCH_BUFFER: usize = 64;
/// Size of the recorder's buffer: least and greatest number of records. It looks every millisecond; in this time, a few
/// drones that wait by yielding fly a hundred ticks.
const RECORD_BUFFER: [usize; 2] = [64, 512];
/// Size of the recorder's buffer, rows of records.
const RECORD_ROWS: usize = 8192;
/// Samples that a subscriber can hold at a time.
const BORROWED: usize = 2;
/// Most chunks of an overflowing service's data segment in addition to those in the buffers, which all hold the same newest
/// samples. So many subscribers may have died or been frozen while each held an older sample. If more were needed, iceoryx2
/// 0.10 would make a segment that is larger than its own counters cover, and panic. Its own worst case is gigabytes at 1000
/// drones. Services that do not overflow get that worst case, because their buffers hold different samples.
const HELD_CHUNKS: usize = 120;
/// Frames that fit into an uplink sample before its segment grows.
pub(crate) const UPLINK_FRAMES: usize = 16;
/// Space for the neighbours, obstacles and frames of one drone in the first downlink segment, bytes.
const DOWNLINK_ROOM: usize = 448;
/// Frames of a tick that fit into the first segments of downlink and record: per drone, and the number of drones that counts. A run
/// of a usual tick length then needs no other segment, for which there may be no room.
const TICK_FRAMES: [usize; 2] = [4, 64];
/// Maximum number of observers at a time. Each may open every service that is for observers.
const OBSERVERS: usize = 8;

/// Part of iceoryx2's errors if a limit of a service is reached.
const EXCEEDS: &str = "Exceeds";

const DOWNLINK: &str = "skein/downlink";
const RECORD: &str = "skein/record";
const WATCH: &str = "skein/watch";

/// Limits of one service.
#[derive(Clone, Copy)]
struct Limits {
    publishers: usize,
    subscribers: usize,
    nodes: usize,
    buffer: usize,
    overflow: bool,
}

/// The services of a run, as one process sees them. Its ports must stay on the thread that made them. In the launcher, the
/// services and their ports must be dropped before the [`Domain`], which removes their files.
#[derive(Debug)]
pub struct Services {
    node: Node<ipc::Service>,
    drones: usize,
    room: Room,
    /// For an observer: the run's folder, which may vanish at any time.
    visited: Option<PathBuf>,
    /// In the launcher: keeps all services open. A service exists as long as at least one process has it open.
    _kept: Option<Kept>,
}

#[derive(Debug)]
struct Kept {
    _downlink: Factory<DownWord, StreamHeader>,
    _uplinks: Vec<Factory<WireFrame, UplinkHeader>>,
    _record: Factory<RecordWord, StreamHeader>,
    _watch: Factory<RecordWord, StreamHeader>,
}

/// Number of uplink shards; drone i is on shard i / [`SHARD_DRONES`].
#[must_use]
pub fn shards(drones: usize) -> usize {
    drones.div_ceil(SHARD_DRONES)
}

impl Services {
    /// Makes all services of a run. For the launcher. `per_process` drones share a process and its uplink. `name` is the
    /// node's name, for people.
    ///
    /// # Errors
    /// [`BusError::Service`].
    pub fn create(domain: &Domain, drones: usize, per_process: usize, name: &str) -> Result<Self, BusError> {
        let node = node(domain, name)?;
        let kept = Kept {
            _downlink: create(&node, DOWNLINK, downlink_limits(drones))?,
            _uplinks: (0..shards(drones))
                .map(|shard| create(&node, &uplink_name(shard), uplink_limits(per_process)))
                .collect::<Result<_, _>>()?,
            _record: create(&node, RECORD, record_limits(drones))?,
            _watch: create(&node, WATCH, watch_limits())?,
        };
        // iceoryx2 makes one of its files open to all users.
        domain.make_private()?;
        Ok(Self { node, drones, room: Room::of(domain), visited: None, _kept: Some(kept) })
    }

    /// Joins the run's services. For the processes of the run but the launcher. Each service is opened with its first port.
    ///
    /// # Errors
    /// [`BusError::NoRoom`], [`BusError::Service`].
    pub fn open(domain: &Domain, drones: usize, name: &str) -> Result<Self, BusError> {
        check_join()?;
        Ok(Self { node: node(domain, name)?, drones, room: Room::of(domain), visited: None, _kept: None })
    }

    /// As [`Services::open`], for an observer. The launcher does not wait for observers when it removes the run's files. iceoryx2 would
    /// then make the folders again, with a mode that lets others in, and no other run could start. So the files stay while a port is
    /// made.
    ///
    /// # Errors
    /// As [`Services::open`]; [`BusError::Folder`] if the run has ended. Its ports: [`BusError::Crowded`] if there are eight observers already.
    pub fn visit(domain: &Domain, drones: usize, name: &str) -> Result<Self, BusError> {
        let _held = hold(domain.path())?;
        let opened = Self::open(domain, drones, name)?;
        // An observer that outlives the run closes ports whose files are gone. iceoryx2 would warn of each.
        set_log_level_from_env_or(LogLevel::Error);
        Ok(Self { visited: Some(domain.path().to_owned()), ..opened })
    }

    /// Reserves all memory that the services have now. Call it before the first tick, when all ports are made: from then on,
    /// what others do in /dev/shm does not end these processes. Call it again when a process has joined that was started in flight;
    /// [`SpareRoom`](crate::SpareRoom) keeps the space for it.
    ///
    /// # Errors
    /// [`BusError::NoRoom`]; then nothing is reserved. [`BusError::Io`].
    pub fn reserve(&self) -> Result<(), BusError> {
        self.room.reserve()
    }

    /// Sends senses and frames. For the world.
    ///
    /// # Errors
    /// [`BusError::Service`], [`BusError::Degraded`].
    pub fn downlink_publisher(&self) -> Result<DownlinkPublisher, BusError> {
        let drone = size_of::<SensesHeader>() + DOWNLINK_ROOM;
        let room = (size_of::<DownlinkHeader>() + self.drones * drone + self.frames_room()) / size_of::<u64>();
        Ok(StreamPublisher(self.sender(DOWNLINK, room, |_| BackpressureAction::DiscardData)?))
    }

    /// Receives senses and frames. For a drone or an observer. It gets the samples that are sent after it was made and never
    /// delays the world: if its buffer of eight is full, it loses the oldest sample.
    ///
    /// # Errors
    /// [`BusError::Service`], [`BusError::Degraded`].
    pub fn downlink_subscriber(&self) -> Result<DownlinkSubscriber, BusError> {
        Ok(StreamSubscriber(self.receiver(DOWNLINK)?))
    }

    /// Sends frames. For a drone.
    ///
    /// # Errors
    /// [`BusError::Service`], also for a drone that is not in the swarm; [`BusError::Degraded`].
    pub fn uplink_publisher(&self, drone: usize) -> Result<UplinkPublisher, BusError> {
        let name = uplink_name(drone / SHARD_DRONES);
        Ok(UplinkPublisher(self.sender(&name, UPLINK_FRAMES, |_| BackpressureAction::DiscardDataAndFail)?))
    }

    /// Receives frames. For the world, one per shard, see [`shards`]. Not for observers: if a subscriber does not receive, the
    /// drones' sends fail. Observers find all frames in the downlink.
    ///
    /// # Errors
    /// [`BusError::Service`], [`BusError::Degraded`].
    pub fn uplink_subscriber(&self, shard: usize) -> Result<UplinkSubscriber, BusError> {
        Ok(UplinkSubscriber(self.receiver(&uplink_name(shard))?))
    }

    /// Sends the record. For the world.
    ///
    /// # Errors
    /// [`BusError::Service`], [`BusError::Degraded`].
    pub fn record_publisher(&self, policy: RecordPolicy) -> Result<RecordPublisher, BusError> {
        let dropped = Arc::new(AtomicU64::new(0));
        let handler = record_handler(policy, Arc::clone(&dropped));
        Ok(RecordPublisher { stream: StreamPublisher(self.sender(RECORD, self.record_room(), handler)?), dropped })
    }

    /// Receives the record. For the recorder in the launcher only, because the world may wait for it.
    ///
    /// # Errors
    /// [`BusError::Service`], [`BusError::Degraded`].
    pub fn record_subscriber(&self) -> Result<RecordSubscriber, BusError> {
        Ok(StreamSubscriber(self.receiver(RECORD)?))
    }

    /// Sends the record to observers. For the world.
    ///
    /// # Errors
    /// [`BusError::Service`], [`BusError::Degraded`].
    pub fn watch_publisher(&self) -> Result<WatchPublisher, BusError> {
        let service: Factory<RecordWord, StreamHeader> = open(&self.node, WATCH)?;
        let stream = StreamPublisher(self.sender(WATCH, self.record_room(), |_| BackpressureAction::DiscardData)?);
        Ok(WatchPublisher { stream, service })
    }

    /// Receives the record of each tick from now on. For an observer. It never delays the world: if its buffer of 64 is full, it
    /// loses the oldest sample.
    ///
    /// # Errors
    /// [`BusError::Crowded`] if there are eight observers already, [`BusError::Service`], [`BusError::Degraded`].
    pub fn watch_subscriber(&self) -> Result<RecordSubscriber, BusError> {
        Ok(StreamSubscriber(self.receiver(WATCH)?))
    }

    /// Number of words in a record.
    fn record_room(&self) -> usize {
        (size_of::<RecordHeader>() + self.drones * size_of::<DroneRow>() + self.frames_room()) / size_of::<u64>()
    }

    /// Space for the frames of a tick, bytes.
    fn frames_room(&self) -> usize {
        let [per_drone, drones] = TICK_FRAMES;
        per_drone * self.drones.min(drones) * size_of::<AirFrame>()
    }

    /// Opens a service and makes a publisher. Its first segment has `room` elements per sample. `on_full` decides what to do
    /// when a subscriber's buffer is full, unless the service overflows.
    fn sender<P, H, F>(&self, name: &str, room: usize, on_full: F) -> Result<Sender<P, H>, BusError>
    where
        P: ZeroCopySend + Debug + 'static,
        H: ZeroCopySend + Debug,
        F: Fn(&BackpressureInfo) -> BackpressureAction + Send + 'static,
    {
        let service: Factory<P, H> = open(&self.node, name)?;
        let health = Health::default();
        let degraded = health.clone();
        let overflows = service.static_config().has_safe_overflow();
        let buffer = service.static_config().subscriber_max_buffer_size();
        let held = held_chunks(service.static_config().max_subscribers());
        let chunks = Arc::new(AtomicUsize::new(0));
        let counted = Arc::clone(&chunks);
        let builder = service
            .publisher_builder()
            .initial_max_slice_len(room)
            .allocation_strategy(AllocationStrategy::PowerOfTwo)
            .max_loaned_samples(1)
            .override_sample_preallocation(move |worst| {
                let chunks = if overflows { worst.min(buffer + held) } else { worst };
                counted.store(chunks, Ordering::Relaxed);
                chunks
            })
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            .set_backpressure_handler(on_full)
            .set_degradation_handler(move |_, _| {
                degraded.degrade();
                DegradationAction::DegradeAndFail
            });
        let port = builder.create().map_err(failed("make a publisher of", name))?;
        health.check(name)?;
        let segments = Segments::new(self.room.clone(), room, chunks.load(Ordering::Relaxed));
        Ok(Sender { port, service: name.to_owned(), health, segments })
    }

    /// Opens a service and makes a subscriber.
    fn receiver<P, H>(&self, name: &str) -> Result<Receiver<P, H>, BusError>
    where
        P: ZeroCopySend + Debug + 'static,
        H: ZeroCopySend + Debug,
    {
        let _held = self.visited.as_deref().map(hold).transpose()?;
        open(&self.node, name).and_then(|service| subscriber(&service, name)).map_err(|error| match error {
            BusError::Service { cause, .. } if self.visited.is_some() && cause.contains(EXCEEDS) => {
                BusError::Crowded { most: OBSERVERS }
            }
            other => other,
        })
    }
}

fn subscriber<P, H>(service: &Factory<P, H>, name: &str) -> Result<Receiver<P, H>, BusError>
where
    P: ZeroCopySend + Debug + 'static,
    H: ZeroCopySend + Debug,
{
    let health = Health::default();
    let degraded = health.clone();
    let builder = service.subscriber_builder().set_degradation_handler(move |_, _| {
        degraded.degrade();
        DegradationAction::DegradeAndFail
    });
    let port = builder.create().map_err(failed("make a subscriber of", name))?;
    health.check(name)?;
    Ok(Receiver { port, service: name.to_owned(), health })
}

fn node(domain: &Domain, name: &str) -> Result<Node<ipc::Service>, BusError> {
    set_log_level_from_env_or(LogLevel::Warn);
    let node_name = NodeName::new(name).map_err(failed("name the node", name))?;
    NodeBuilder::new()
        .name(&node_name)
        .config(domain.config())
        .signal_handling_mode(SignalHandlingMode::Disabled)
        .create()
        .map_err(failed("make the node", name))
}

fn uplink_name(shard: usize) -> String {
    format!("skein/uplink/{shard}")
}

fn downlink_limits(drones: usize) -> Limits {
    let subscribers = drones + SPARE + OBSERVERS;
    Limits { publishers: 1, subscribers, nodes: subscribers + 2, buffer: BUFFER, overflow: true }
}

/// Only the world subscribes: a subscriber that does not read would hold up the drones.
fn uplink_limits(per_process: usize) -> Limits {
    let publishers = SHARD_DRONES + SPARE;
    let buffer = uplink_buffer(per_process);
    Limits { publishers, subscribers: 1, nodes: publishers + 2, buffer, overflow: false }
}

/// Size of the uplink's buffer for a process that sends for so many drones, samples.
pub(crate) fn uplink_buffer(senders: usize) -> usize {
    BUFFER * senders.clamp(1, SHARD_DRONES)
}

/// Only the launcher subscribes: in lockstep, a subscriber that does not read would hold up the swarm.
fn record_limits(drones: usize) -> Limits {
    let buffer = (RECORD_ROWS / drones.max(1)).clamp(RECORD_BUFFER[0], RECORD_BUFFER[1]);
    Limits { publishers: 1, subscribers: 1, nodes: 2, buffer, overflow: false }
}

fn watch_limits() -> Limits {
    Limits { publishers: 1, subscribers: OBSERVERS, nodes: OBSERVERS + 3, buffer: WATCH_BUFFER, overflow: true }
}

/// Chunks of an overflowing service that subscribers can hold in addition to those in their buffers, and the loaned one.
fn held_chunks(subscribers: usize) -> usize {
    (subscribers * BORROWED + 2).min(HELD_CHUNKS)
}

/// Decides what to do when the recorder's buffer is full.
fn record_handler(policy: RecordPolicy, dropped: Arc<AtomicU64>) -> impl Fn(&BackpressureInfo) -> BackpressureAction {
    move |info| match &policy {
        RecordPolicy::Wait(goes_on) if goes_on(info.elapsed_time) => BackpressureAction::Retry,
        _ => {
            dropped.fetch_add(1, Ordering::Relaxed);
            BackpressureAction::DiscardData
        }
    }
}

fn builder<P, H>(node: &Node<ipc::Service>, name: &str) -> Result<Builder<[P], H, ipc::Service>, BusError>
where
    P: ZeroCopySend + Debug + 'static,
    H: ZeroCopySend + Debug,
{
    let service = ServiceName::new(name).map_err(failed("name the service", name))?;
    Ok(node.service_builder(&service).publish_subscribe::<[P]>().user_header::<H>())
}

fn create<P, H>(node: &Node<ipc::Service>, name: &str, limits: Limits) -> Result<Factory<P, H>, BusError>
where
    P: ZeroCopySend + Debug + 'static,
    H: ZeroCopySend + Debug,
{
    builder(node, name)?
        .max_publishers(limits.publishers)
        .max_subscribers(limits.subscribers)
        .max_nodes(limits.nodes)
        .subscriber_max_buffer_size(limits.buffer)
        .subscriber_max_borrowed_samples(BORROWED)
        .history_size(0)
        .enable_safe_overflow(limits.overflow)
        .create()
        .map_err(failed("create the service", name))
}

fn open<P, H>(node: &Node<ipc::Service>, name: &str) -> Result<Factory<P, H>, BusError>
where
    P: ZeroCopySend + Debug + 'static,
    H: ZeroCopySend + Debug,
{
    builder(node, name)?.open().map_err(failed("open the service", name))
}

/// For `map_err` on what iceoryx2 refuses.
fn failed<E: Display>(what: &'static str, service: &str) -> impl FnOnce(E) -> BusError {
    let service = service.to_owned();
    move |error| {
        let cause = error.to_string();
        let hint = hint(&cause);
        BusError::Service { what, service, cause, hint }
    }
}

fn hint(cause: &str) -> &'static str {
    let hints = [
        ("IncompatibleTypes", "its payload has another type or version: use one build for launcher and children"),
        ("DoesNotExist", "the run has no such service: is its launcher still alive, and is the drone in this swarm?"),
        (EXCEEDS, "all its places are taken: clean dead nodes before a restart, close observers"),
        ("AlreadyExists", "it belongs to a running swarm: use a domain of its own"),
    ];
    let other =
        "see the limits of open files (`ulimit -n`) and file sizes (`ulimit -f`), and the free space in /dev/shm";
    hints.iter().find(|(part, _)| cause.contains(part)).map_or(other, |(_, hint)| hint)
}

/// Result of [`clean_dead_nodes`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DeadNodes {
    /// Nodes that were removed; their places are free again.
    pub removed: usize,
    /// Nodes that could not be removed, perhaps because another process was removing them.
    pub failed: usize,
}

/// Frees the resources of processes that were killed in this run. To be called before a drone is restarted, between two
/// ticks; it takes 2 to 130 ms.
///
/// # Errors
/// [`BusError::Service`].
pub fn clean_dead_nodes(domain: &Domain) -> Result<DeadNodes, BusError> {
    let mut dead = DeadNodes::default();
    Node::<ipc::Service>::list(domain.config(), |state| {
        if let NodeState::Dead(view) = state {
            let removed = view.try_remove_stale_resources().is_ok();
            dead.removed += usize::from(removed);
            dead.failed += usize::from(!removed);
        }
        CallbackProgression::Continue
    })
    .map_err(failed("list the nodes of", domain.prefix()))?;
    Ok(dead)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::PermissionsExt;

    #[test]
    fn another_payload_or_header_is_refused() {
        let mode = std::fs::Permissions::from_mode(0o700);
        let root = tempfile::Builder::new().permissions(mode).tempdir().unwrap();
        let domain = Domain::create_in(root.path(), "types").unwrap();
        let services = Services::create(&domain, 1, 1, "launcher").unwrap();
        let payload = open::<RecordWord, StreamHeader>(&services.node, DOWNLINK).unwrap_err();
        let header = open::<DownWord, UplinkHeader>(&services.node, DOWNLINK).unwrap_err();
        for error in [payload.to_string(), header.to_string()] {
            assert!(error.contains("IncompatibleTypes") && error.contains("one build"), "{error}");
        }
        assert!(open::<DownWord, StreamHeader>(&services.node, DOWNLINK).is_ok());
    }

    #[test]
    fn services_have_one_writer_and_no_second_reader_where_it_could_hold_up_the_swarm() {
        let mode = std::fs::Permissions::from_mode(0o700);
        let root = tempfile::Builder::new().permissions(mode).tempdir().unwrap();
        let domain = Domain::create_in(root.path(), "one").unwrap();
        let launcher = Services::create(&domain, 1, 1, "launcher").unwrap();
        let world = Services::open(&domain, 1, "world").unwrap();
        let _world = (
            world.downlink_publisher().unwrap(),
            world.record_publisher(RecordPolicy::Drop).unwrap(),
            world.watch_publisher().unwrap(),
            world.uplink_subscriber(0).unwrap(),
        );
        let _record = launcher.record_subscriber().unwrap();
        let refused = [
            launcher.downlink_publisher().map(|_| ()),
            launcher.record_publisher(RecordPolicy::Drop).map(|_| ()),
            launcher.watch_publisher().map(|_| ()),
            launcher.uplink_subscriber(0).map(|_| ()),
            launcher.record_subscriber().map(|_| ()),
        ];
        for error in refused.map(Result::unwrap_err) {
            assert!(error.to_string().contains("Exceeds"), "{error}");
        }
        for file in std::fs::read_dir("/dev/shm").unwrap().map(Result::unwrap) {
            if file.file_name().to_string_lossy().starts_with(domain.prefix()) {
                let mode = file.metadata().unwrap().permissions().mode();
                assert_eq!(mode & 0o077, 0, "{:?} is open to others: {mode:o}", file.file_name());
            }
        }
    }
}
