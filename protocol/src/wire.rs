//! Numbers on the wire and the enums that they stand for. Payloads and slots hold integers, because another process wrote
//! them. Code that reads a payload works with the enums.

use serde::{Deserialize, Serialize};
use std::fmt;
use thiserror::Error;

/// A number that stands for no value of an enum.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("{number} is not a known {what}")]
pub struct UnknownCode {
    /// Name of the expected enum, for example `phase`.
    pub what: &'static str,
    /// The number that was found.
    pub number: u32,
}

/// `bit` if `set` is true, else 0. Used to build a word of flags.
#[must_use]
pub fn flag(set: bool, bit: u32) -> u32 {
    if set { bit } else { 0 }
}

/// What a [`crate::payload::Leadership`] message says. The names are those of Raft.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LeadershipKind {
    /// The source starts a new term and leads in it.
    Claim,
    /// The source leads and is alive.
    Heartbeat,
    /// The source no longer hears the leader of this term. It asks which drones have heard of that leader since the stamp.
    PreVote,
    /// Answer to a pre-vote: the source has heard of this term's leader, most recently at the stamp.
    PreVoteRejection,
    /// The source leads and asks the drone in [`crate::payload::Leadership::heir`] to take over.
    LeadershipTransfer,
}

impl LeadershipKind {
    /// All kinds, in wire order from 1.
    pub const ALL: [Self; 5] =
        [Self::Claim, Self::Heartbeat, Self::PreVote, Self::PreVoteRejection, Self::LeadershipTransfer];

    /// The kind's number on the wire, from 1.
    #[must_use]
    pub const fn to_wire(self) -> u32 {
        self as u32 + 1
    }

    /// The kind with this number on the wire.
    ///
    /// # Errors
    /// [`UnknownCode`] if no kind has this number.
    pub fn from_wire(number: u32) -> Result<Self, UnknownCode> {
        let kind = Self::ALL.into_iter().find(|kind| kind.to_wire() == number);
        kind.ok_or(UnknownCode { what: "kind of leadership", number })
    }
}

/// What a plan tells its group to do.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Phase {
    /// Fly in formation while the anchor moves forward.
    #[default]
    Cruise,
    /// Fly past the obstacle set; each drone follows its route and rank.
    Avoid,
    /// Return to the slots of the target shape.
    Reform,
}

impl Phase {
    /// All phases, in wire order from 0.
    pub const ALL: [Self; 3] = [Self::Cruise, Self::Avoid, Self::Reform];

    /// The phase's number on the wire, from 0.
    #[must_use]
    pub const fn to_wire(self) -> u32 {
        self as u32
    }

    /// The phase with this number on the wire.
    ///
    /// # Errors
    /// [`UnknownCode`] if no phase has this number.
    pub fn from_wire(number: u32) -> Result<Self, UnknownCode> {
        Self::ALL.into_iter().find(|phase| phase.to_wire() == number).ok_or(UnknownCode { what: "phase", number })
    }

    /// The phase's name in JSON and on the screen.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Cruise => "cruise",
            Self::Avoid => "avoid",
            Self::Reform => "reform",
        }
    }
}

/// What a [`crate::payload::Arrivals`] message is for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ArrivalsKind {
    /// The source reports the arrival times of its members and expects no answer.
    #[default]
    Report,
    /// The source asks for the arrival times of the other groups and waits for them before it decides.
    Query,
    /// The leader that plans for several groups has decided. Only the route that it assigned to the drone has a finite
    /// time.
    Decision,
}

impl ArrivalsKind {
    /// All kinds, in wire order from 0.
    pub const ALL: [Self; 3] = [Self::Report, Self::Query, Self::Decision];

    /// The kind's number on the wire, from 0.
    #[must_use]
    pub const fn to_wire(self) -> u32 {
        self as u32
    }

    /// The kind with this number on the wire.
    ///
    /// # Errors
    /// [`UnknownCode`] if no kind has this number.
    pub fn from_wire(number: u32) -> Result<Self, UnknownCode> {
        let kind = Self::ALL.into_iter().find(|kind| kind.to_wire() == number);
        kind.ok_or(UnknownCode { what: "kind of arrivals", number })
    }
}

/// Which of a drone's sensors report nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct BrokenSensors {
    /// The obstacle sensor.
    pub obstacles: bool,
    /// The ranging to neighbours.
    pub ranging: bool,
}

impl BrokenSensors {
    const OBSTACLES: u32 = 1;
    const RANGING: u32 = 2;

    /// Whether at least one sensor is broken.
    #[must_use]
    pub const fn any(self) -> bool {
        self.obstacles || self.ranging
    }

    /// The sensors as flags on the wire.
    #[must_use]
    pub fn to_wire(self) -> u32 {
        flag(self.obstacles, Self::OBSTACLES) | flag(self.ranging, Self::RANGING)
    }

    /// The sensors that these flags on the wire stand for. Unknown flags are ignored.
    #[must_use]
    pub const fn from_wire(flags: u32) -> Self {
        Self { obstacles: flags & Self::OBSTACLES != 0, ranging: flags & Self::RANGING != 0 }
    }
}

impl fmt::Display for Phase {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_value_survives_a_round_trip_through_its_wire_number() {
        for kind in LeadershipKind::ALL {
            assert_eq!(LeadershipKind::from_wire(kind.to_wire()), Ok(kind));
        }
        for phase in Phase::ALL {
            assert_eq!(Phase::from_wire(phase.to_wire()), Ok(phase));
        }
        for kind in ArrivalsKind::ALL {
            assert_eq!(ArrivalsKind::from_wire(kind.to_wire()), Ok(kind));
        }
        for broken in (0..4).map(BrokenSensors::from_wire) {
            assert_eq!(BrokenSensors::from_wire(broken.to_wire()), broken);
        }
    }

    #[test]
    fn the_error_for_an_unknown_number_contains_it() {
        assert!(LeadershipKind::from_wire(0).is_err() && LeadershipKind::from_wire(6).is_err());
        assert_eq!(Phase::from_wire(3).unwrap_err().to_string(), "3 is not a known phase");
        assert_eq!(ArrivalsKind::from_wire(3), Err(UnknownCode { what: "kind of arrivals", number: 3 }));
    }
}
