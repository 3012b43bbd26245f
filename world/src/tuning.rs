//! Every tuned number of this crate, with its unit, how it was found, and the command that finds it again.

/// Speed at which a drone without a process comes down, m/s. Chosen by hand, as that of a drone under a parachute; no command
/// measures it.
pub(crate) const DESCENT_MPS: f64 = 5.0;

/// Up to this number of bodies, comparing every pair is faster than filling a grid.
///
/// Chosen by hand. It changes the time of a step and nothing else: `skein bench runtime --drones 8,64` measures it.
pub(crate) const PAIRWISE_MAX_BODIES: usize = 64;

/// How much farther neighbours are searched than they are needed, as a share of that distance. No unit. 0.1.
///
/// Chosen by hand: at 66 m, two drones at 20 m/s come so much closer in eight ticks, and a formation never. It changes the time of a step and
/// nothing else: `skein bench runtime --drones 8,64` measures it.
pub(crate) const NEIGHBOUR_MARGIN: f64 = 0.1;

/// Number of plans per drone whose assignments are remembered.
///
/// Chosen by hand: more than a restarted drone can still receive.
pub(crate) const PLANS_KEPT: usize = 16;

/// A swarm counts as cut once its parts have been the same for this long, s. 10. Chosen by hand: a swarm that meets again sooner
/// has hardly noticed, since a leader is missed after one second by default, and after twelve on a bad link.
pub(crate) const PARTED_S: f64 = 10.0;

/// A drone that has not moved for this long, s, stands still. 10. Chosen by hand: longer than a drone waits for the answer to a message
/// or for the drone before it in a queue. It changes what is said of a mission and nothing else.
pub(crate) const STANDSTILL_S: f64 = 10.0;

/// Up to this number of drones, the formation that fits those in their slots best is searched for. Chosen by hand: the search takes the
/// cube of the number, and at 256 drones some tens of milliseconds. It changes what is said of a mission and nothing else.
pub(crate) const FIT_MAX_DRONES: usize = 256;

/// Tolerance for rounding when distances are checked, m. It is no softer limit. Chosen by hand, far above the rounding
/// error of coordinates within 10⁶ m and far below any distance that matters.
pub(crate) const ROUNDING_M: f64 = 1e-6;
