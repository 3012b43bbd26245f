//! What a picture of a run is made of, the same for the recording, the report and a live view: a [`Sample`] of the swarm
//! every now and then, and the run's events in words.

pub mod event_text;
mod facts;
mod frames;
mod observer;
mod sample;
mod slots;

pub use facts::{SceneFacts, SetOutline};
pub(crate) use observer::fine;
pub use observer::{MAX_LISTED_DRONES, Observer};
pub use sample::{EnergySample, RadioSample, Sample, SentFrame, State};
