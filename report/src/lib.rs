//! A run's record: what becomes of it. Feeds on [`skein_protocol::record`] alone.
//!
//! [`Recorder`] takes the record of each tick and makes a [`Summary`], trace.csv and events.jsonl in a [`RunFolder`];
//! [`plot::write`] draws a flown run from its trace; [`text::summary`] says it to a person.

mod accumulate;
mod close;
mod completion;
pub mod deviation;
mod error;
mod facts;
mod folder;
mod formation;
mod leading;
mod mcap;
mod metrics;
pub mod page;
pub mod plot;
mod recorder;
pub mod scene;
mod spool;
mod stages;
mod steps;
mod summary;
#[cfg(test)]
mod testing;
pub mod text;
mod trace;
mod vicinity;

pub use completion::RunCompletion;
pub use error::{DrawError, ReportError, TickError};
pub use facts::{MissionEnd, RunFacts};
pub use folder::{Manifest, ProcessEntry, Role, RunFolder};
pub use recorder::Recorder;
pub use summary::*;
