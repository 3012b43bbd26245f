//! Reads the samples and events of a recording.

use crate::error::ReportError;
use crate::files::RECORDING;
use crate::folder::RunFolder;
use crate::interruption::Interrupted;
use crate::scene::Sample;
use ::mcap::McapError;
use ::mcap::records::Record;
use ::mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use serde::de::DeserializeOwned;
use skein_protocol::record::RunEvent;
use std::collections::BTreeMap;
use std::io::Read;
use std::path::Path;

/// Greatest length of a record in the file, bytes. The longest is the attached scenario.
const RECORD_BYTES_MAX: usize = 256 << 20;

/// Reads run.mcap in a run's folder piece by piece, and calls `sample` with each sample and `event` with each event, in
/// order. Accepts a truncated file.
///
/// # Errors
/// The error of `sample`; [`ReportError::Interrupted`], [`ReportError::Io`], [`ReportError::Recording`], or
/// [`ReportError::Content`] for a recording of another version.
pub(crate) fn read(
    folder: &RunFolder,
    interrupted: &Interrupted<'_>,
    sample: impl FnMut(Sample) -> Result<(), ReportError>,
    event: impl FnMut(RunEvent),
) -> Result<(), ReportError> {
    let path = folder.path().join(RECORDING);
    let mut file = folder.files().read(RECORDING)?;
    let options = LinearReaderOptions::default().with_skip_end_magic(true).with_record_length_limit(RECORD_BYTES_MAX);
    let mut reader = LinearReader::new_with_options(options);
    let mut messages = Messages { path: &path, topics: BTreeMap::new(), partial: Sample::default(), sample, event };
    while let Some(next) = reader.next_event() {
        match next {
            Ok(LinearReadEvent::ReadRequest(length)) => {
                interrupted.check()?;
                let length = file.read(reader.insert(length)).map_err(ReportError::io(&path))?;
                reader.notify_read(length);
            }
            Ok(LinearReadEvent::Record { opcode, data }) => {
                messages.take(::mcap::parse_record(opcode, data).map_err(ReportError::recording(&path))?)?;
            }
            // The writer was killed. All messages before this one are complete.
            Err(McapError::UnexpectedEof | McapError::UnexpectedEoc) => return Ok(()),
            Err(error) => return Err(ReportError::recording(&path)(error)),
        }
    }
    Ok(())
}

/// Sorts the messages of a recording by their topics.
struct Messages<'p, S, E> {
    path: &'p Path,
    /// The topics by channel.
    topics: BTreeMap<u16, String>,
    /// A sample of which not all parts have come.
    partial: Sample,
    sample: S,
    event: E,
}

impl<S: FnMut(Sample) -> Result<(), ReportError>, E: FnMut(RunEvent)> Messages<'_, S, E> {
    fn take(&mut self, record: Record<'_>) -> Result<(), ReportError> {
        match record {
            Record::Channel(channel) => {
                self.topics.insert(channel.id, channel.topic);
            }
            Record::Message { header, data } => {
                let topic = self.topics.get(&header.channel_id).map_or("", String::as_str);
                match topic {
                    "/skein/state" => self.partial.state = parse(self.path, topic, &data)?,
                    "/skein/energy" => self.partial.energy = parse(self.path, topic, &data)?,
                    "/skein/marks" => self.partial.shown = parse(self.path, topic, &data)?,
                    "/skein/radio" => {
                        self.partial.radio = parse(self.path, topic, &data)?;
                        (self.sample)(std::mem::take(&mut self.partial))?;
                    }
                    "/skein/groups" | "/skein/leadership" | "/skein/events" => {
                        (self.event)(parse(self.path, topic, &data)?);
                    }
                    _ => {}
                }
            }
            _ => {}
        }
        Ok(())
    }
}

fn parse<T: DeserializeOwned>(path: &Path, topic: &str, data: &[u8]) -> Result<T, ReportError> {
    serde_json::from_slice(data).map_err(|error| ReportError::Content {
        path: path.to_owned(),
        expected: "a recording by this version of Skein",
        found: format!("a message on {topic}: {error}"),
    })
}
