//! A living drone, as a leader knows it.

use crate::params::Destination;
use skein_protocol::{DroneId, GroupId, Vec2};
use std::collections::BTreeMap;

/// A living drone, as a leader knows it. Positions are extrapolated from the last beacon to now.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Member {
    /// Its id.
    pub id: DroneId,
    /// Where it is now, world frame, m.
    pub position: Vec2,
    /// Its speed, m/s.
    pub speed_mps: f64,
    /// Its velocity, world frame, m/s.
    pub velocity: Vec2,
    /// The group it is in.
    pub group: GroupId,
    /// Whether its last beacon shows that it obeys this leader's term.
    pub follows: bool,
    /// Whether it rests at the destination and obeys an older term: it does not hear this leader, so it will not pass what it does not
    /// know.
    pub settled: bool,
    /// Whether it has never reached the end of an obstacle that its formation names as passed.
    pub before: bool,
}

/// The leader of each member's group: the member of that group that is closest to the destination. The lower id wins a
/// tie. `groups[i]` is the group of `members[i]`.
pub(crate) fn group_leaders(members: &[Member], groups: &[GroupId], destination: &Destination) -> Vec<DroneId> {
    let distance_m = |m: &Member| destination.distance_m(m.position);
    let mut first: BTreeMap<GroupId, &Member> = BTreeMap::new();
    for (member, &group) in members.iter().zip(groups) {
        let best = first.entry(group).or_insert(member);
        if distance_m(member) < distance_m(best) {
            *best = member;
        }
    }
    groups.iter().map(|group| first.get(group).map_or(DroneId::NONE, |m| m.id)).collect()
}
