//! Limits of the runtime. None of them changes a flight in lockstep in which nothing fails: they decide when a process or a pilot
//! counts as failed.

use std::time::Duration;

/// A pilot that says more messages of its own in a tick has failed: 64. Chosen by hand: at 50 ticks/s it is 1 MB/s.
pub(crate) const MAX_OWN_MESSAGES: usize = 64;

/// A pilot that sends more messages in a tick, built-in ones included, has failed: 32768. A leader of 10000 drones sends a plan, an
/// assignment for each of them, and a few others.
pub(crate) const MAX_MESSAGES: usize = 32_768;

/// A pilot that reports more figures, marks and lines in a tick has failed: 1024. The world takes 80 and drops the others.
pub(crate) const MAX_TELEMETRY: usize = 1024;

/// A drone process that does not answer a tick in lockstep for this long is hung: 5 s. Chosen by hand: a step takes far
/// less than a millisecond, and a busy machine may stop a process for a second.
pub(crate) const HUNG_AFTER: Duration = Duration::from_secs(5);

/// A process that takes over a drone and is not ready after this is dead: 5 s. Chosen by hand; a start takes milliseconds.
pub(crate) const RESTART_READY_LIMIT: Duration = Duration::from_secs(5);

/// In lockstep, the world offers a record to the launcher for this long before it looks for dead processes: 1 s. Chosen by
/// hand.
pub(crate) const RECORD_PATIENCE: Duration = Duration::from_secs(1);

/// A launcher that takes no record for this long is warned of: 5 s. Chosen by hand: a disk may stall for a second.
pub(crate) const RECORD_WARNING: Duration = Duration::from_secs(5);

/// A launcher that takes no record for this long, and is not stopped, has failed: 60 s. Chosen by hand.
pub(crate) const RECORD_LIMIT: Duration = Duration::from_secs(60);

/// Time between two looks at whether the world process is stopped: 0.5 s. Chosen by hand: it takes microseconds.
pub(crate) const STOPPED_POLL: Duration = Duration::from_millis(500);

/// The supervisor kills, stops or continues a process within this: 5 s. Chosen by hand; it takes milliseconds.
pub(crate) const REQUEST_LIMIT: Duration = Duration::from_secs(5);

/// The supervisor restarts a process within this: 30 s. Chosen by hand: more than [`RESTART_READY_LIMIT`], so that the supervisor
/// gives up first.
pub(crate) const RESTART_LIMIT: Duration = Duration::from_secs(30);

/// Processes that are not ready after this have failed: 20 s, and [`START_LIMIT_PER_DRONE`] for each drone. Chosen by
/// hand; `skein bench runtime` shows what a start takes.
pub(crate) const START_LIMIT: Duration = Duration::from_secs(20);

/// Added to [`START_LIMIT`] for each drone of the swarm: 0.1 s. Chosen by hand.
pub(crate) const START_LIMIT_PER_DRONE: Duration = Duration::from_millis(100);

/// Processes that have not ended this long after the end of the mission are killed: 2 s. Chosen by hand.
pub(crate) const END_LIMIT: Duration = Duration::from_secs(2);

/// Time between two polls of the supervisor for records, requests and signals: 1 ms. Chosen by hand. It notices the end
/// of a process at once.
pub(crate) const SUPERVISOR_POLL: Duration = Duration::from_millis(1);

/// Time between two polls of a world process that waits for its launcher: 1 ms. Chosen by hand.
pub(crate) const DISMISSAL_POLL: Duration = Duration::from_millis(1);

/// A wall clock that has fallen behind by more than this starts anew instead of catching up: 1 s. Chosen by hand.
pub(crate) const STALL_LIMIT: Duration = Duration::from_secs(1);

/// A host carries out a kill, a stop or a continuation within this, its network included, or it is given up: 3 s. Chosen by hand: less
/// than [`REQUEST_LIMIT`], so that the supervisor gives up first.
pub(crate) const HOST_REQUEST_LIMIT: Duration = Duration::from_secs(3);

/// A host restarts a process within this, its network included, or the drone is dead again: 10 s. Chosen by hand: more than
/// [`RESTART_READY_LIMIT`] and less than [`RESTART_LIMIT`].
pub(crate) const HOST_RESTART_LIMIT: Duration = Duration::from_secs(10);

/// Time between two looks at whether a process of a host has ended while its drones are waited for: 1 ms. Chosen by hand.
pub(crate) const WING_POLL: Duration = Duration::from_millis(1);
