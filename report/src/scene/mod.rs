//! What a picture of a run consists of: a [`Sample`] of the swarm at regular times, and the text of each event.
//!
//! The recording, the page and the live view are made from the same samples.

pub mod event_text;
mod frames;
mod message_json;
mod observer;
mod rounding;
mod sample;
mod shown;
mod slots;

pub use crate::scene_facts::{SceneFacts, SetOutline};
pub(crate) use frames::reason as drop_reason_name;
pub use frames::topic;
pub use message_json::message_json;
pub use observer::{MAX_LISTED_DRONES, Observer};
pub(crate) use rounding::rounded;
pub use sample::{EnergySample, RadioSample, Sample, SentFrame, State};
pub use shown::{Shown, ShownLine, ShownMark};
