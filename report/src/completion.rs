//! What the caller of a run knows when it is over.

use skein_protocol::record::Outcome;

/// What is known of a finished run beside its record.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RunCompletion {
    /// Outcome for a record that has no end event, because the world process died or could not send it.
    pub fallback: Outcome,
    /// Wall time from the first tick opened to the last tick done, s. Used if the record has no end event.
    pub wall_s: Option<f64>,
    /// Wall time from the command to the first tick, s.
    pub startup_s: Option<f64>,
}
