//! What a relay sends to a host.

use crate::downlink_part;
use crate::error::HostsError;
use crate::reader::Reader;
use skein_protocol::Tick;
use skein_protocol::downlink::DownlinkView;
use skein_runtime::RelayRequest;
use std::ops::Range;
use std::time::Duration;

const TICK: u64 = 1;
const REQUEST: u64 = 2;
const END: u64 = 3;

/// What a host gets from a relay.
#[derive(Debug)]
pub(crate) enum Down {
    /// A tick is open.
    Tick(OpenTick),
    /// Something is to be done to a drone's process before the next tick.
    Request(RelayRequest),
    /// The run is over.
    End,
}

/// A tick that is open, and what the drones need for it.
#[derive(Debug)]
pub(crate) struct OpenTick {
    /// Its number.
    pub(crate) tick: Tick,
    /// How long a drone may take.
    pub(crate) limit: Duration,
    /// The downlinks since the last open tick, in rising order; the last one is that of this tick.
    pub(crate) downlinks: Vec<(Tick, Vec<u64>)>,
}

/// A message that opens a tick, while it is written.
pub(crate) struct TickMessage {
    bytes: Vec<u8>,
    drones: Range<usize>,
}

impl TickMessage {
    /// A message for these drones, without a downlink.
    pub(crate) fn new(drones: Range<usize>, limit: Duration) -> Self {
        let limit_ns = u64::try_from(limit.as_nanos()).unwrap_or(u64::MAX);
        let mut bytes = Vec::new();
        [TICK, limit_ns].iter().for_each(|word| bytes.extend(word.to_le_bytes()));
        Self { bytes, drones }
    }

    /// Adds a downlink. The last one is that of the open tick.
    pub(crate) fn push(&mut self, tick: Tick, down: &DownlinkView<'_>) {
        self.bytes.extend(tick.to_le_bytes());
        let at = self.bytes.len();
        self.bytes.extend([0; 8]);
        downlink_part::write(down, self.drones.clone(), &mut self.bytes);
        let len = (self.bytes.len() - at - 8) as u64;
        self.bytes[at..at + 8].copy_from_slice(&len.to_le_bytes());
    }

    /// The message.
    pub(crate) fn finish(self) -> Vec<u8> {
        self.bytes
    }
}

/// A message with a request.
pub(crate) fn request(request: &RelayRequest) -> Vec<u8> {
    let mut bytes = REQUEST.to_le_bytes().to_vec();
    // A request is numbers, which JSON can hold.
    bytes.extend(serde_json::to_vec(request).unwrap_or_default());
    bytes
}

/// The message that ends a flight.
pub(crate) fn end() -> Vec<u8> {
    END.to_le_bytes().to_vec()
}

impl Down {
    /// Reads a message for these drones of a swarm of `count`.
    ///
    /// # Errors
    /// [`HostsError`] if it is none.
    pub(crate) fn read(bytes: &[u8], drones: &Range<usize>, count: usize) -> Result<Self, HostsError> {
        let mut reader = Reader(bytes);
        match reader.value::<u64>()? {
            TICK => {
                let limit = Duration::from_nanos(reader.value()?);
                let mut downlinks = Vec::new();
                while !reader.0.is_empty() {
                    let (tick, len): (Tick, _) = (reader.value()?, reader.count()?);
                    downlinks.push((tick, downlink_part::read(reader.bytes(len)?, drones.clone(), count)?));
                }
                let tick = downlinks.last().ok_or(HostsError::Message("a tick has no downlink"))?.0;
                Ok(Self::Tick(OpenTick { tick, limit, downlinks }))
            }
            REQUEST => {
                let request = serde_json::from_slice(reader.0);
                request.map(Self::Request).map_err(|_| HostsError::Message("a request is none"))
            }
            END => Ok(Self::End),
            _ => Err(HostsError::Message("it is of an unknown kind")),
        }
    }
}
