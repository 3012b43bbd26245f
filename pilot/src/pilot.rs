//! What flies a drone.

use crate::command::Command;
use crate::inbox::Inbox;
use crate::out::Out;
use skein_protocol::SimTime;
use skein_protocol::downlink::Senses;

/// The software that flies one drone. It should be deterministic: equal senses and messages give equal commands and messages.
/// Then a mission has the same digest in every runtime and in every repetition.
pub trait Pilot: Send {
    /// Steps one tick. `inbox`: the messages received since the step before. The pilot says through `out` what it has to say.
    fn step(&mut self, senses: &Senses<'_>, inbox: &Inbox<'_>, out: &mut Out) -> Command;

    /// Does what comes first in the step of a tick, before the pilot steers. A runtime that steps many pilots in one thread calls this for some
    /// of them, and then [`step`](Self::step) for each with the same arguments: so the processor's cache holds the code of one half
    /// at a time. A pilot that has this method works as well without the call, because programs that step pilots may leave it out. The
    /// default does nothing.
    fn begin_step(&mut self, senses: &Senses<'_>, inbox: &Inbox<'_>, out: &mut Out) {
        let _ = (senses, inbox, out);
    }

    /// Replaces the contents of `ages` with the ages at `now` of what it knows of its peers, s: one per known peer, or those of a sample. They
    /// go into the statistics. The default knows of none.
    fn pose_ages_s(&self, now: SimTime, ages: &mut Vec<f64>) {
        let _ = now;
        ages.clear();
    }
}
