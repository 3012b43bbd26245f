//! The line between the supervisor and a relay: requests one way, replies and the last report the other way. One JSON object a line.

use crate::error::RuntimeError;
use crate::host_share::HostReport;
use serde::{Deserialize, Serialize};
use skein_bus::RequestKind;
use std::io::{BufRead, BufReader, Write};
use std::os::fd::OwnedFd;
use std::os::unix::net::UnixStream;
use std::time::Duration;

/// What the supervisor asks a relay to have done on its host.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RelayRequest {
    /// The number of a [`RequestKind`].
    kind: u32,
    /// The drone.
    pub drone: u32,
    /// The tick of the request, see [`skein_bus::ProcessRequest::tick`].
    pub tick: u64,
    /// For a restart: the incarnation of the new process.
    pub incarnation: u32,
}

impl RelayRequest {
    /// A request about a drone.
    #[must_use]
    pub fn new(kind: RequestKind, drone: u32, tick: u64, incarnation: u32) -> Self {
        Self { kind: kind as u32, drone, tick, incarnation }
    }

    /// What is to be done; `None` for a number that no kind has.
    #[must_use]
    pub fn kind(&self) -> Option<RequestKind> {
        use RequestKind::{Freeze, Kill, KillProcess, Restart, Resume};
        [Kill, Freeze, Resume, Restart, KillProcess].into_iter().find(|&kind| kind as u32 == self.kind)
    }
}

/// What a relay says to the supervisor.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum RelayWord {
    /// A request is carried out: the number that the supervisor answers to the world.
    Done(u32),
    /// The run is over.
    End(HostReport),
}

/// The supervisor's end of the line.
#[derive(Debug)]
pub(crate) struct RelayLine {
    stream: BufReader<UnixStream>,
}

impl RelayLine {
    /// A line, and the end that becomes the relay's standard input.
    pub(crate) fn pair() -> Result<(Self, OwnedFd), RuntimeError> {
        let (own, other) = UnixStream::pair().map_err(RuntimeError::system("making a line to a relay"))?;
        Ok((Self { stream: BufReader::new(own) }, other.into()))
    }

    /// Has a request carried out; the relay's reply, or `None` if there is none within `limit`.
    pub(crate) fn ask(&mut self, request: RelayRequest, limit: Duration) -> Option<u32> {
        let mut line = serde_json::to_vec(&request).ok()?;
        line.push(b'\n');
        self.stream.get_mut().write_all(&line).ok()?;
        self.stream.get_ref().set_read_timeout(Some(limit)).ok()?;
        match self.word()? {
            RelayWord::Done(reply) => Some(reply),
            RelayWord::End(_) => None,
        }
    }

    /// The last report of a relay that has ended.
    pub(crate) fn report(&mut self) -> Option<HostReport> {
        self.stream.get_ref().set_read_timeout(Some(Duration::from_millis(100))).ok()?;
        loop {
            if let RelayWord::End(report) = self.word()? {
                return Some(report);
            }
        }
    }

    fn word(&mut self) -> Option<RelayWord> {
        let mut line = String::new();
        self.stream.read_line(&mut line).ok()?;
        serde_json::from_str(&line).ok()
    }
}
