//! Identifiers of drones, obstacles, groups, terms of leadership and plans.

use bytemuck::{Pod, Zeroable};
use serde::{Deserialize, Serialize};
use std::fmt;

/// Identifies a drone by its number, from 0. In JSON, [`DroneId::NONE`] is null.
#[repr(transparent)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Pod, Zeroable, Serialize, Deserialize)]
#[serde(from = "Option<u32>", into = "Option<u32>")]
pub struct DroneId(pub u32);

impl DroneId {
    /// Stands for no drone.
    pub const NONE: Self = Self(u32::MAX);

    /// The number as an index into per-drone slices.
    #[must_use]
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

impl From<Option<u32>> for DroneId {
    fn from(number: Option<u32>) -> Self {
        number.map_or(Self::NONE, Self)
    }
}

impl From<DroneId> for Option<u32> {
    fn from(drone: DroneId) -> Self {
        (drone != DroneId::NONE).then_some(drone.0)
    }
}

impl fmt::Display for DroneId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if *self == Self::NONE { f.write_str("none") } else { write!(f, "{}", self.0) }
    }
}

/// Identifies an obstacle by the number that the world gave it.
#[repr(transparent)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Pod, Zeroable, Serialize, Deserialize)]
pub struct ObstacleId(pub u32);

/// Identifies a term of leadership. Ballots are ordered lexicographically by round, incarnation and claimant.
///
/// Ballots are unique. Each start of a drone's process gets a new incarnation, so a drone that lost its memory in a restart
/// cannot reuse a ballot. The claimant is part of the ballot, so two sides of a partition cannot claim the same one.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Pod, Zeroable, Serialize, Deserialize)]
pub struct Ballot {
    /// Number of the round. A drone that claims leadership takes a round above all rounds it has heard of. 0 only in
    /// [`Ballot::NONE`].
    pub round: u32,
    /// Incarnation of the claimant's process, from 1.
    pub incarnation: u32,
    /// The drone that claims to lead.
    pub claimant: DroneId,
}

impl Ballot {
    /// No term: the value before the first election. It is lower than every ballot that a drone claims.
    pub const NONE: Self = Self { round: 0, incarnation: 0, claimant: DroneId(0) };

    /// Whether this ballot stands for a term, that is, whether its round is not 0.
    #[must_use]
    pub fn is_some(self) -> bool {
        self.round > 0
    }
}

/// Identifies a plan by the leader's term and the plan's number in that term. The stamp of the plan that a drone obeys never
/// decreases within one incarnation of the drone's process.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Pod, Zeroable, Serialize, Deserialize)]
pub struct PlanStamp {
    /// The leader's term.
    pub ballot: Ballot,
    /// The plan's number in that term, from 1.
    pub epoch: u32,
}

/// Maximum number of splits in the lineage of a group.
pub const GROUP_DEPTH: usize = 8;

/// Identifies a group by its lineage. The whole swarm is `N`; its split gives `N1`, `N2`, …; the split of `N1` gives `N11`,
/// `N12`, ….
///
/// The subgroups of a split are numbered from left to right by their routes, seen in the flight direction. Each entry of the
/// array is the number taken at one split; the entries after the last split are 0.
#[repr(transparent)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Pod, Zeroable, Serialize, Deserialize)]
pub struct GroupId(pub [u8; GROUP_DEPTH]);

impl GroupId {
    /// The whole swarm, `N`.
    pub const ALL: Self = Self([0; GROUP_DEPTH]);

    /// Number of splits between the whole swarm and this group.
    #[must_use]
    pub fn depth(self) -> usize {
        self.0.iter().take_while(|&&digit| digit != 0).count()
    }

    /// The subgroup with this number (from 1; 0 counts as 1). A group at depth [`GROUP_DEPTH`] has no subgroups, so this returns
    /// the group itself.
    #[must_use]
    pub fn child(self, number: u8) -> Self {
        let mut path = self.0;
        if let Some(digit) = path.get_mut(self.depth()) {
            *digit = number.max(1);
        }
        Self(path)
    }

    /// Whether the array is a valid lineage: all entries after the first 0 are 0.
    #[must_use]
    pub fn is_lineage(self) -> bool {
        self.0[self.depth()..].iter().all(|&digit| digit == 0)
    }

    /// Whether `other` is this group or descends from it.
    #[must_use]
    pub fn contains(self, other: Self) -> bool {
        self.0[..self.depth()] == other.0[..self.depth()]
    }

    /// The group that this one was split from. The parent of the whole swarm is the whole swarm.
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
    /// Writes `N`, `N1`, `N12`, …; a number above nine is in brackets, as in `N1[12]`.
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
    fn ballots_are_ordered_by_round_then_incarnation_then_claimant() {
        let ballot = |round, incarnation, claimant| Ballot { round, incarnation, claimant: DroneId(claimant) };
        assert!(ballot(2, 1, 0) > ballot(1, 9, 9));
        assert!(ballot(1, 2, 0) > ballot(1, 1, 9));
        assert!(ballot(1, 1, 3) > ballot(1, 1, 2));
        assert!(ballot(1, 1, 0) > Ballot::NONE);
    }

    #[test]
    fn a_group_is_named_by_its_lineage() {
        assert_eq!(GroupId::ALL.to_string(), "N");
        assert_eq!(GroupId::ALL.child(1).child(2).to_string(), "N12");
        assert_eq!(GroupId::ALL.child(1).child(2).parent(), GroupId::ALL.child(1));
        assert_eq!(GroupId::ALL.parent(), GroupId::ALL);
        assert_eq!(GroupId::ALL.child(12).to_string(), "N[12]");
        assert!(GroupId::ALL.is_lineage() && (0..9).fold(GroupId::ALL, |group, _| group.child(2)).is_lineage());
        assert!(!GroupId([1, 0, 2, 0, 0, 0, 0, 0]).is_lineage());
    }

    #[test]
    fn a_group_contains_itself_and_its_descendants_only() {
        let (one, two) = (GroupId::ALL.child(1), GroupId::ALL.child(2));
        assert!(GroupId::ALL.contains(one.child(2)) && one.contains(one.child(2)) && one.contains(one));
        assert!(!one.contains(two) && !one.contains(GroupId::ALL) && !one.child(2).contains(one));
    }
}
