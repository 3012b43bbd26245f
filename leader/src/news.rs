//! What other drones must know at once about a drone. See [`crate::relays`].

use crate::beacons::Beacon;
use skein_protocol::payload::Pose;
use skein_protocol::{Ballot, GroupId, PlanStamp};

/// The part of a beacon that is passed on at once when it changes: what the drone obeys, and its flags.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct News {
    obeyed: PlanStamp,
    term: Ballot,
    group: GroupId,
    flags: u32,
    incarnation: u32,
}

impl News {
    /// That of a beacon.
    pub(crate) fn of(pose: &Pose) -> Self {
        let Pose { obeyed, term, group, flags, incarnation, .. } = *pose;
        Self { obeyed, term, group, flags, incarnation }
    }

    /// That of a drone's last beacon.
    pub(crate) fn of_last(last: Beacon<'_>) -> Self {
        let (obeyed, term, group) = (last.obeyed(), last.term(), last.group());
        Self { obeyed, term, group, flags: last.flags(), incarnation: last.incarnation() }
    }
}
