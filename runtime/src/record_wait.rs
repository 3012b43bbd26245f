//! How long a world waits for a recorder that takes no record.

use crate::tuning::{RECORD_LIMIT, RECORD_PATIENCE, RECORD_WARNING};
use std::time::Duration;

/// Limits of the wait.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RecordLimits {
    /// A record is offered for this long before dead processes are looked for.
    pub(crate) patience: Duration,
    /// A recorder that takes no record for longer is warned of.
    pub(crate) warning: Duration,
    /// A recorder that takes no record for longer, and is not stopped, has failed.
    pub(crate) limit: Duration,
}

impl Default for RecordLimits {
    fn default() -> Self {
        Self { patience: RECORD_PATIENCE, warning: RECORD_WARNING, limit: RECORD_LIMIT }
    }
}

/// What the world does next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum NextOffer {
    /// It offers the record again.
    Offer,
    /// It says that it waits, and offers the record again.
    Warn,
    /// It ends the run.
    GiveUp,
}

/// The wait for one record.
#[derive(Debug)]
pub(crate) struct RecordWait {
    limits: RecordLimits,
    warned: bool,
}

impl RecordWait {
    /// A wait that begins.
    pub(crate) fn new(limits: RecordLimits) -> Self {
        Self { limits, warned: false }
    }

    /// What to do after no record was taken for so long. A recorder that is stopped, as by Ctrl-Z, is waited for.
    pub(crate) fn after(&mut self, waited: Duration, is_stopped: impl FnOnce() -> bool) -> NextOffer {
        if waited > self.limits.limit && !is_stopped() {
            return NextOffer::GiveUp;
        }
        if waited > self.limits.warning && !self.warned {
            self.warned = true;
            return NextOffer::Warn;
        }
        NextOffer::Offer
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use NextOffer::{GiveUp, Offer, Warn};

    fn decisions(stopped: bool) -> Vec<NextOffer> {
        let mut wait = RecordWait::new(RecordLimits::default());
        let times_s = [1.0, 4.9, 5.0, 5.1, 6.0, 59.9, 60.0, 60.1, 120.0];
        times_s.map(|waited_s| wait.after(Duration::from_secs_f64(waited_s), || stopped)).into()
    }

    #[test]
    fn a_recorder_that_does_not_read_is_warned_of_once_and_then_given_up() {
        assert_eq!(decisions(false), [Offer, Offer, Offer, Warn, Offer, Offer, Offer, GiveUp, GiveUp]);
    }

    #[test]
    fn a_stopped_recorder_is_waited_for() {
        assert_eq!(decisions(true), [Offer, Offer, Offer, Warn, Offer, Offer, Offer, Offer, Offer]);
    }

    #[test]
    fn a_stall_of_the_machine_that_skips_the_warning_gives_up_all_the_same() {
        let mut wait = RecordWait::new(RecordLimits::default());
        assert_eq!(wait.after(Duration::from_secs(61), || false), GiveUp);
    }
}
