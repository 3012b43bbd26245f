//! The numbers of this crate that were chosen by hand: sampling periods, and limits that bound time, memory and file sizes.
//!
//! No number here influences a flight. To judge a change, run `skein run SCENARIO` and `skein report RUN_DIR`, and compare
//! the time after the last tick (`report_s` in summary.json) and the sizes of run.mcap and report.html.

/// Time between two samples of the swarm metrics, s. Chosen by hand.
pub(crate) const METRICS_PERIOD_S: f64 = 0.1;
/// Largest number of drones for which connectivity is computed: its eigenvalues cost O(n³). Chosen by hand; the neighbour
/// graph needs a bit per drone in a `u64`, so that it must not exceed 64.
pub(crate) const CONNECTIVITY_DRONES_MAX: usize = 64;

/// Largest number of drones for which the closing of the formation solves the assignment in every tick in which the last
/// assignment does not fit. Chosen by hand.
pub(crate) const SOLVE_ALWAYS_DRONES_MAX: usize = 64;
/// Above [`SOLVE_ALWAYS_DRONES_MAX`] drones, least time between two solutions, s. Chosen by hand.
pub(crate) const SOLVE_PERIOD_S: f64 = 1.0;

/// Time between two samples of the deviation from the target shape, s. Chosen by hand.
pub(crate) const DEVIATION_PERIOD_S: f64 = 0.1;
/// The same for a swarm of more than [`DEVIATION_SMALL_SWARM_MAX`] drones, s: the assignment takes longer. Chosen by hand.
pub(crate) const DEVIATION_LARGE_SWARM_PERIOD_S: f64 = 1.0;
/// Largest number of drones that are sampled every [`DEVIATION_PERIOD_S`]. Chosen by hand.
pub(crate) const DEVIATION_SMALL_SWARM_MAX: usize = 64;
/// Largest number of drones for which the deviation is sampled at all: above, assignment and spline take seconds per
/// sample. Chosen by hand.
pub(crate) const DEVIATION_DRONES_MAX: usize = 200;

/// Samples per simulated second in run.mcap. Chosen by hand.
pub(crate) const SAMPLE_RATE_HZ: f64 = 10.0;
/// Number of drones above which the sample rate falls in proportion to the number. Chosen by hand.
pub(crate) const FULL_RATE_DRONES: f64 = 100.0;
/// Number of samples between two updates of danger zones, slots and links in run.mcap. Chosen by hand.
pub(crate) const SCENE_PERIOD: u64 = 5;
/// Largest number of frames in a sample; the oldest frames beyond it are left out. Chosen by hand.
pub(crate) const SAMPLE_FRAMES_MAX: usize = 4096;
/// Largest number of marks, and of lines, in a sample; the last ones beyond it are left out. Chosen by hand.
pub(crate) const SAMPLE_MARKS_MAX: usize = 4096;

/// Time between two samples of a plot, s. Chosen by hand.
pub(crate) const PLOT_PERIOD_S: f64 = 0.1;
/// Largest number of samples in a plot of a quantity over time: those of half an hour. Chosen by hand; it must be even.
pub(crate) const PLOT_SAMPLES_MAX: usize = 20_000;
/// Largest number of points of all tracks in a plot, so that a plot of a thousand drones can still be opened. Chosen by
/// hand.
pub(crate) const PLOT_POINTS_MAX: usize = 60_000;
/// Largest number of drones for which the slot error is plotted: the best assignment takes O(n³). Chosen by hand.
pub(crate) const PLOT_SLOT_ERROR_DRONES_MAX: usize = 100;
/// Largest number of panels in the plot of the figures that pilots report. Chosen by hand.
pub(crate) const OWN_PANELS_MAX: usize = 24;
/// Largest number of drones in the animated flight: more would make the file too large. Chosen by hand.
pub(crate) const ANIMATION_DRONES_MAX: usize = 64;
/// Time between two frames of the marks and lines in the animated flight, s. Chosen by hand.
pub(crate) const ANIMATION_SIGN_PERIOD_S: f64 = 0.5;
/// Largest number of marks and lines in all frames of the animated flight; beyond it, frames become longer. Chosen by hand.
pub(crate) const ANIMATION_SIGNS_MAX: usize = 20_000;
/// Largest number of marks and lines in a frame of the animated flight that have labels. Chosen by hand.
pub(crate) const ANIMATION_LABELS_MAX: usize = 60;
/// Largest product of drones and samples in report.html; beyond it, samples are left out evenly. Chosen by hand.
pub(crate) const PAGE_POSITIONS_MAX: usize = 300_000;

/// Size at which a block of records is handed to the writing thread, bytes. Chosen by hand.
pub(crate) const SPOOL_BLOCK_BYTES: usize = 64 << 10;
/// Number of blocks, by which a slow disk may lag behind. They bound the memory used. Chosen by hand.
pub(crate) const SPOOL_BLOCKS: usize = 128;
/// Size of the pieces in which the spool is read, bytes. Chosen by hand.
pub(crate) const SPOOL_PIECE_BYTES: usize = 1 << 20;
