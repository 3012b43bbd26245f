//! The report of a run: turns the run's record into a summary, files, plots and a page.
//!
//! A run gives a [record](skein_protocol::record) per tick. [`Recorder`] takes the records in order and makes
//!
//! - the [`Summary`]: the result of the run in one object, summary.json;
//! - a [`FlightRecord`] in a [`RunFolder`], if the run has one. From it, [`FlightRecord::write_files`] makes trace.csv,
//!   events.jsonl and run.mcap.
//!
//! From a recorded folder, [`plot::write`] draws the plots and [`page::write`] makes report.html. [`text::summary`]
//! formats a summary for a terminal. [`scene::Observer`] makes the samples from which the recording, the page and the
//! live view draw the swarm. [`plot::sweep`], [`plot::surface`] and [`plot::reproduce`] draw figures over many runs.
//!
//! This crate knows nothing of scenarios, pilots or processes. What the record does not contain comes from the caller:
//! [`RunFacts`] before the run, [`RunCompletion`] after it. Nothing here influences a flight.
//!
//! # Example
//!
//! A run of one drone that flies for a single tick:
//!
//! ```
//! use skein_protocol::formation::Shape;
//! use skein_protocol::record::{DroneRow, Outcome, ROW_ALIVE, RecordHeader, RecordSink, RecordView};
//! use skein_protocol::SimTime;
//! use skein_report::{MissionEnd, Recorder, RunCompletion, RunFacts};
//!
//! let facts = RunFacts {
//!     scenario: "hover".to_owned(),
//!     strategy: "congestion-aware".to_owned(),
//!     seed: 1,
//!     runtime: "inline".to_owned(),
//!     clock: "lockstep".to_owned(),
//!     drones: 1,
//!     dt_s: 0.02,
//!     shape: Shape::Line,
//!     spacing_m: 30.0,
//!     end: MissionEnd::Hold,
//!     course: skein_protocol::Course::East,
//!     course_y_m: 0.0,
//!     safe_distance_m: 25.0,
//!     clearance_m: 15.0,
//!     planning_distance_m: 20.0,
//!     arrival_error_m: 0.8,
//!     radio_range_m: None,
//!     pilots: Vec::new(),
//!     obstacles: Vec::new(),
//!     topics: vec![],
//!     scene: Default::default(),
//! };
//! let mut recorder = Recorder::in_memory(facts);
//! let head = RecordHeader { now: SimTime::from_secs(0.02), rows: 1, digest: 0xabc, ..RecordHeader::default() };
//! let row = DroneRow { energy_j: 12.5, flags: ROW_ALIVE, ..DroneRow::default() };
//! recorder.take(RecordView { head: &head, rows: &[row], frames: &[], telemetry: &[], events: b"" }).unwrap();
//!
//! let completion = RunCompletion { fallback: Outcome::Aborted, wall_s: None, startup_s: None };
//! let (summary, record) = recorder.finish(&completion);
//! assert!(record.is_none());
//! assert_eq!((summary.ticks, summary.energy_j.total), (1, 12.5));
//! assert_eq!(summary.digest.as_deref(), Some("0000000000000abc"));
//! ```

mod accumulate;
mod close;
mod completion;
mod data_files;
pub mod deviation;
mod energy;
mod error;
mod facts;
mod files;
mod flight_record;
mod flown_routes;
mod folder;
mod formation;
mod geometry;
mod group_order;
mod interruption;
mod json_text;
mod leading;
mod markup;
mod mcap;
mod messages;
mod metrics;
pub mod number_text;
mod obstacle_set;
mod own_metrics;
pub mod page;
mod palette;
mod pilot_entry;
pub mod plot;
mod record_events;
mod record_files;
mod recorder;
mod reserved_summary;
pub mod scene;
mod scene_facts;
mod spool;
mod stages;
mod steps;
mod summary;
pub mod table;
#[cfg(test)]
mod testing;
pub mod text;
mod topic_schema;
mod trace;
mod tuning;
mod vicinity;
mod work_folder;

pub use completion::RunCompletion;
pub use data_files::DataFiles;
pub use error::{DrawError, ReportError};
pub use facts::{MissionEnd, RunFacts};
pub use flight_record::FlightRecord;
pub use folder::{Manifest, ProcessEntry, Role, RunFolder};
pub use interruption::Interrupted;
pub use pilot_entry::PilotEntry;
pub use recorder::Recorder;
pub use reserved_summary::ReservedSummary;
pub use summary::*;
pub use topic_schema::TopicSchema;
pub use work_folder::WorkFolder;
