//! Reads the events of a record.

use crate::error::TickError;
use skein_protocol::record::{RecordView, RunEvent};

/// The events of a record.
pub(crate) fn events(record: RecordView<'_>) -> Result<Vec<RunEvent>, TickError> {
    let events = record.parse_events(|line| serde_json::from_slice::<RunEvent>(line));
    events.map_err(|source| TickError::Event { tick: record.head.tick, source })
}
