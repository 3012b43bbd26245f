//! Which living drones belong to the group that a leader plans for.

use crate::knowledge::Knowledge;
use crate::member::Member;
use crate::own_state::OwnState;
use skein_protocol::SimTime;

/// The living drones, as of the last [`Self::refresh`].
#[derive(Clone, Debug, Default)]
pub(crate) struct Membership {
    members: Vec<Member>,
    others: Vec<Member>,
}

impl Membership {
    /// The living members of the leader's group, the leader included, by id.
    pub(crate) fn members(&self) -> &[Member] {
        &self.members
    }

    /// Living drones of other groups, by id.
    pub(crate) fn others(&self) -> &[Member] {
        &self.others
    }

    /// All living drones, by id.
    pub(crate) fn living(&self) -> Vec<Member> {
        let mut all: Vec<Member> = self.members.iter().chain(&self.others).copied().collect();
        all.sort_by_key(|member| member.id);
        all
    }

    /// Determines anew which drones live, and which belong to the group. A drone of no part joins the part of the nearest
    /// drone.
    pub(crate) fn refresh(&mut self, k: &Knowledge, now: SimTime, own: &OwnState) {
        let Self { members, others } = self;
        let (scope, term) = (k.election().scope(), k.election().obeyed());
        let mut orphans = Vec::new();
        members.clear();
        others.clear();
        members.push(k.myself(own));
        for peer in k.living_peers(now) {
            if scope.contains(peer.group) {
                members.push(peer);
            } else if peer.group.contains(scope) && k.term_of(peer.id) <= term {
                orphans.push(peer);
            } else {
                others.push(peer);
            }
        }
        // A drone of another lineage, or of an older term, does not take an orphan in.
        orphans.retain(|orphan| {
            let later = |m: &Member| k.term_of(m.id) > k.term_of(orphan.id);
            let rivals = others.iter().filter(|m| orphan.group.contains(m.group) && later(m));
            let mine = k.term_of(orphan.id) == term;
            mine || nearest_m2(orphan, members.iter()) <= nearest_m2(orphan, rivals)
        });
        members.append(&mut orphans);
        members.sort_unstable_by_key(|member| member.id);
    }
}

/// Square of the distance to the nearest of these, m²; infinite without any.
fn nearest_m2<'m>(from: &Member, to: impl Iterator<Item = &'m Member>) -> f64 {
    to.map(|m| (m.position - from.position).norm_squared()).fold(f64::INFINITY, f64::min)
}
