//! Reads the samples and events of a recording.

use crate::error::ReportError;
use crate::files::RECORDING;
use crate::scene::Sample;
use ::mcap::MessageStream;
use ::mcap::read::Options;
use serde::de::DeserializeOwned;
use skein_protocol::record::RunEvent;
use std::path::Path;

/// Reads run.mcap in a run's folder, and calls `sample` with each sample and `event` with each event, in order. Accepts a
/// truncated file.
///
/// # Errors
/// [`ReportError::Io`], [`ReportError::Recording`], or [`ReportError::Content`] for a recording of another version.
pub(crate) fn read(
    folder: &Path,
    mut sample: impl FnMut(Sample),
    mut event: impl FnMut(RunEvent),
) -> Result<(), ReportError> {
    let path = folder.join(RECORDING);
    let bytes = std::fs::read(&path).map_err(ReportError::io(&path))?;
    let stream = MessageStream::new_with_options(&bytes, Options::IgnoreEndMagic.into())
        .map_err(ReportError::recording(&path))?;
    let mut partial = Sample::default();
    for message in stream {
        let message = match message {
            Ok(message) => message,
            // The launcher was killed. All messages before this one are complete.
            Err(::mcap::McapError::UnexpectedEof | ::mcap::McapError::UnexpectedEoc) => return Ok(()),
            Err(error) => return Err(ReportError::recording(&path)(error)),
        };
        let topic = message.channel.topic.as_str();
        match topic {
            "/skein/state" => partial.state = parse(&path, topic, &message.data)?,
            "/skein/energy" => partial.energy = parse(&path, topic, &message.data)?,
            "/skein/radio" => {
                partial.radio = parse(&path, topic, &message.data)?;
                sample(std::mem::take(&mut partial));
            }
            "/skein/groups" | "/skein/leadership" | "/skein/events" => event(parse(&path, topic, &message.data)?),
            _ => {}
        }
    }
    Ok(())
}

fn parse<T: DeserializeOwned>(path: &Path, topic: &str, data: &[u8]) -> Result<T, ReportError> {
    serde_json::from_slice(data).map_err(|error| ReportError::Content {
        path: path.to_owned(),
        expected: "a recording by this version of Skein",
        found: format!("a message on {topic}: {error}"),
    })
}
