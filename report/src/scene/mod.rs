//! What a picture of a run is made of, the same for the recording, the report and a live view: a [`Sample`] of the swarm
//! every now and then, and the run's events in words.

mod air;
mod facts;
mod observer;
mod sample;
mod slots;
pub mod words;

pub use facts::{SceneFacts, SetOutline};
pub(crate) use observer::fine;
pub use observer::{MAX_DELIVERIES, Observer};
pub use sample::{EnergySample, RadioSample, Sample, SentFrame, State};
