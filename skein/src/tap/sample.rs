//! A sample of what a swarm publishes.

use skein_bus::payload::{DownWord, RecordWord};
use skein_bus::ports::StreamSample;

/// A received sample.
pub(crate) enum Sample {
    /// A record of this machine, read in place.
    Record(StreamSample<RecordWord>),
    /// A downlink of this machine, read in place.
    Downlink(StreamSample<DownWord>),
    /// One that came over the network: its words, and its length in bytes.
    Remote(Vec<u64>, usize),
}

impl Sample {
    /// Its bytes, 8-aligned.
    pub(crate) fn bytes(&self) -> &[u8] {
        match self {
            Self::Record(sample) => sample.bytes(),
            Self::Downlink(sample) => sample.bytes(),
            Self::Remote(words, len) => &bytemuck::cast_slice(words)[..*len],
        }
    }

    /// One that came over the network.
    pub(super) fn remote((words, len): (Vec<u64>, usize)) -> Self {
        Self::Remote(words, len)
    }
}
