//! Names of the files that a run leaves in its folder.

/// The run as it was ordered: scenario, seed, version, facts.
pub(crate) const MANIFEST: &str = "manifest.json";
/// The processes of the run.
pub(crate) const PROCESSES: &str = "processes.json";
/// The summary of the run.
pub(crate) const SUMMARY: &str = "summary.json";
/// The events of the run, one JSON object per line.
pub(crate) const EVENTS: &str = "events.jsonl";
/// State of each drone in each tick.
pub(crate) const TRACE: &str = "trace.csv";
/// The same as Parquet.
pub(crate) const TRACE_PARQUET: &str = "trace.parquet";
/// The messages, a row for each frame and receiver.
pub(crate) const MESSAGES: &str = "messages.csv";
/// The same as Parquet.
pub(crate) const MESSAGES_PARQUET: &str = "messages.parquet";
/// Deviation of the swarm from its target shape over time.
pub(crate) const FORMATION: &str = "formation.csv";
/// The recording for Foxglove and other readers of MCAP.
pub(crate) const RECORDING: &str = "run.mcap";
/// The page with replay, tables and figures.
pub(crate) const PAGE: &str = "report.html";
/// The raw records while the run flies; removed at its end.
pub(crate) const SPOOL: &str = "flight.spool";
/// The folder of the plots.
pub(crate) const PLOTS: &str = "plots";

/// All files that a run leaves in its folder, except for its plots.
pub(crate) const ALL: [&str; 12] = [
    MANIFEST,
    PROCESSES,
    SUMMARY,
    EVENTS,
    TRACE,
    TRACE_PARQUET,
    MESSAGES,
    MESSAGES_PARQUET,
    FORMATION,
    RECORDING,
    PAGE,
    SPOOL,
];

/// Names of the plots in a run's `plots` folder, in this order: tracks, least separation, speed, distance between
/// drones, energy, slot error, leaders, messages, animated flight, distance from the target shape, bending energy, figures that pilots report.
pub const PLOT_FILES: [&str; 12] = [
    "trace.svg",
    "separation.svg",
    "speed.svg",
    "distance.svg",
    "energy.svg",
    "formation.svg",
    "leaders.svg",
    "messages.svg",
    "flight.svg",
    "disturbance.svg",
    "bending.svg",
    "metrics.svg",
];
