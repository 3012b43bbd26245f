//! Reads back what a picture needs: the samples and the events.

use crate::error::ReportError;
use crate::mcap::FILE;
use crate::scene::Sample;
use ::mcap::MessageStream;
use ::mcap::read::Options;
use serde::de::DeserializeOwned;
use skein_protocol::record::RunEvent;
use std::path::Path;

/// Reads run.mcap, also one that was cut short. Samples go to `sample`, events to `event`, each in their order.
pub(crate) fn read(
    folder: &Path,
    mut sample: impl FnMut(Sample),
    mut event: impl FnMut(RunEvent),
) -> Result<(), ReportError> {
    let path = folder.join(FILE);
    let bytes = std::fs::read(&path).map_err(ReportError::io(&path))?;
    let stream = MessageStream::new_with_options(&bytes, Options::IgnoreEndMagic.into())
        .map_err(ReportError::recording(&path))?;
    let mut open = Sample::default();
    for message in stream {
        let message = match message {
            Ok(message) => message,
            // Of a launcher that was killed: what came before is whole.
            Err(::mcap::McapError::UnexpectedEof | ::mcap::McapError::UnexpectedEoc) => return Ok(()),
            Err(error) => return Err(ReportError::recording(&path)(error)),
        };
        let topic = message.channel.topic.as_str();
        match topic {
            "/skein/state" => open.state = parse(&path, topic, &message.data)?,
            "/skein/energy" => open.energy = parse(&path, topic, &message.data)?,
            "/skein/radio" => {
                open.radio = parse(&path, topic, &message.data)?;
                sample(std::mem::take(&mut open));
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
