//! Names: of drones, groups, obstacles, terms of leadership and plans.

use bytemuck::{Pod, Zeroable};
use serde::{Deserialize, Serialize};
use std::fmt;

/// A drone, numbered from 0.
#[repr(transparent)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Pod, Zeroable, Serialize, Deserialize)]
pub struct DroneId(pub u32);

impl DroneId {
    /// Nobody.
    pub const NONE: Self = Self(u32::MAX);

    /// The id as an index.
    #[must_use]
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

impl fmt::Display for DroneId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if *self == Self::NONE { f.write_str("none") } else { write!(f, "{}", self.0) }
    }
}

/// An obstacle, under the world's number.
#[repr(transparent)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Pod, Zeroable, Serialize, Deserialize)]
pub struct ObstacleId(pub u32);

/// A term of leadership, ordered lexicographically. The launcher hands every start of a process a new incarnation, so
/// that a drone that forgot everything cannot repeat a ballot, and two sides of a partition cannot share one.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Pod, Zeroable, Serialize, Deserialize)]
pub struct Ballot {
    /// Raised above every round heard of, by whoever claims. 0: no term at all.
    pub round: u32,
    /// Of the claimant's process, from 1.
    pub incarnation: u32,
    /// Who claims to lead.
    pub claimant: DroneId,
}

impl Ballot {
    /// Before the first election. Lower than every ballot that is claimed.
    pub const NONE: Self = Self { round: 0, incarnation: 0, claimant: DroneId(0) };

    /// Whether this is a term at all.
    #[must_use]
    pub fn is_some(self) -> bool {
        self.round > 0
    }
}

/// What a drone obeys: a leader's term and the running number of its plan. Never goes back within an incarnation.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Pod, Zeroable, Serialize, Deserialize)]
pub struct PlanStamp {
    /// The leader's term.
    pub ballot: Ballot,
    /// The plan's number in that term, from 1.
    pub epoch: u32,
}

/// Deepest lineage of a group.
pub const GROUP_DEPTH: usize = 8;

/// A group by its lineage: the whole swarm is `N`, its first split gives `N1`, `N2`, …, the next `N11`, `N12`, ….
/// Digit 1 is the leftmost route, seen along the flight.
#[repr(transparent)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Pod, Zeroable, Serialize, Deserialize)]
pub struct GroupId(pub [u8; GROUP_DEPTH]);

impl GroupId {
    /// The whole swarm, `N`.
    pub const ALL: Self = Self([0; GROUP_DEPTH]);

    /// Number of splits this group came from.
    #[must_use]
    pub fn depth(self) -> usize {
        self.0.iter().take_while(|&&digit| digit != 0).count()
    }

    /// The subgroup with this number (from 1); the group itself at the greatest depth.
    #[must_use]
    pub fn child(self, number: u8) -> Self {
        let mut path = self.0;
        if let Some(digit) = path.get_mut(self.depth()) {
            *digit = number.max(1);
        }
        Self(path)
    }

    /// Whether this is a lineage: nothing after the last split.
    #[must_use]
    pub fn is_lineage(self) -> bool {
        self.0[self.depth()..].iter().all(|&digit| digit == 0)
    }

    /// Whether `other` is this group or was split from it.
    #[must_use]
    pub fn contains(self, other: Self) -> bool {
        self.0[..self.depth()] == other.0[..self.depth()]
    }

    /// The group this one was split from; the whole swarm for itself.
    #[must_use]
    pub fn parent(self) -> Self {
        let mut path = self.0;
        if let Some(last) = self.depth().checked_sub(1) {
            path[last] = 0;
        }
        Self(path)
    }
}

impl fmt::Display for GroupId {
    /// `N`, `N1`, `N12`; a digit above nine is set in brackets, `N1[12]`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("N")?;
        self.0.iter().take(self.depth()).try_for_each(|&digit| match digit {
            1..=9 => write!(f, "{digit}"),
            _ => write!(f, "[{digit}]"),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ballots_order_by_round_then_incarnation_then_claimant() {
        let ballot = |round, incarnation, claimant| Ballot { round, incarnation, claimant: DroneId(claimant) };
        assert!(ballot(2, 1, 0) > ballot(1, 9, 9));
        assert!(ballot(1, 2, 0) > ballot(1, 1, 9));
        assert!(ballot(1, 1, 3) > ballot(1, 1, 2));
        assert!(ballot(1, 1, 0) > Ballot::NONE);
    }

    #[test]
    fn groups_are_named_by_lineage() {
        assert_eq!(GroupId::ALL.to_string(), "N");
        assert_eq!(GroupId::ALL.child(1).child(2).to_string(), "N12");
        assert_eq!(GroupId::ALL.child(1).child(2).parent(), GroupId::ALL.child(1));
        assert_eq!(GroupId::ALL.parent(), GroupId::ALL);
        assert_eq!(GroupId::ALL.child(12).to_string(), "N[12]");
        assert!(GroupId::ALL.is_lineage() && (0..9).fold(GroupId::ALL, |group, _| group.child(2)).is_lineage());
        assert!(!GroupId([1, 0, 2, 0, 0, 0, 0, 0]).is_lineage());
    }

    #[test]
    fn a_group_contains_itself_and_what_it_was_split_into() {
        let (one, two) = (GroupId::ALL.child(1), GroupId::ALL.child(2));
        assert!(GroupId::ALL.contains(one.child(2)) && one.contains(one.child(2)) && one.contains(one));
        assert!(!one.contains(two) && !one.contains(GroupId::ALL) && !one.child(2).contains(one));
    }
}
