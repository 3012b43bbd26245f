//! Which drones led, for how long two led the same group, and how long a group had no leader after its leader died or was frozen.

use crate::summary::{LeaderEntry, Term};
use skein_protocol::record::DroneRow;
use skein_protocol::{Ballot, DroneId, GroupId, horizontal};
use std::collections::{BTreeMap, BTreeSet};

/// Follows leadership over a mission.
#[derive(Default)]
pub(crate) struct Leading {
    entries: Vec<LeaderEntry>,
    split_brain_s: f64,
    failovers: Vec<Failover>,
    ballots: BTreeSet<Term>,
    orphans: Vec<Orphan>,
    /// The group that each leader leads, and the leader, in the tick that was taken last.
    leaders: Vec<(GroupId, usize)>,
    /// The last term in which each drone became a leader.
    terms: BTreeMap<DroneId, Ballot>,
}

/// What the summary reports about leadership.
pub(crate) struct LeadershipSummary {
    /// Number of different ballots that led.
    pub elections: u32,
    /// Which drones became leaders.
    pub entries: Vec<LeaderEntry>,
    /// Time in which two leaders could hear each other although one had to follow the other, s: both lead the same group,
    /// or the later term is for a group that contains the other leader's own group.
    pub split_brain_s: f64,
    /// For each leader that died or was frozen, the time until its group had a leader again, s; `None` if it never had. If the group splits
    /// meanwhile, its part counts. A leader that went on after a freeze before another drone led is left out.
    pub failover_s: Vec<Option<f64>>,
}

/// What became of a group without a leader.
#[derive(Clone, Copy)]
enum Failover {
    /// It has none yet.
    Open,
    /// It has one again, after this time, s.
    Done(f64),
    /// Its leader was frozen and went on.
    Resumed,
}

/// A group whose leader died or is frozen.
struct Orphan {
    group: GroupId,
    /// The group that the leader was in: part of the group, if it was just about to split.
    own: GroupId,
    leader: DroneId,
    /// Whether the leader may go on, because it is frozen.
    frozen: bool,
    since_s: f64,
    /// Index in `failovers`.
    failover: usize,
}

impl Leading {
    /// The result.
    pub(crate) fn finish(self) -> LeadershipSummary {
        let time = |failover: &Failover| match failover {
            Failover::Open => Some(None),
            Failover::Done(time_s) => Some(Some(*time_s)),
            Failover::Resumed => None,
        };
        LeadershipSummary {
            elections: self.ballots.len() as u32,
            entries: self.entries,
            split_brain_s: self.split_brain_s,
            failover_s: self.failovers.iter().filter_map(time).collect(),
        }
    }

    /// Notes that a drone became the leader of a group.
    pub(crate) fn elected(&mut self, t_s: f64, group: String, ballot: Ballot, leader: DroneId) {
        self.ballots.insert(ballot.into());
        self.terms.insert(leader, ballot);
        self.entries.push(LeaderEntry { t_s, group, ballot: ballot.into(), leader: leader.0 });
    }

    /// Notes that a drone died or, if `frozen`, that it froze. Its last row was `row`.
    pub(crate) fn lost(&mut self, t_s: f64, leader: DroneId, row: &DroneRow, frozen: bool) {
        if let Some(orphan) = self.orphans.iter_mut().find(|orphan| orphan.frozen && orphan.leader == leader) {
            // It died while it was frozen.
            orphan.frozen = frozen;
        } else if leads(row) {
            let own = if row.led.contains(row.group) { row.group } else { row.led };
            let failover = self.failovers.len();
            self.orphans.push(Orphan { group: row.led, own, leader, frozen, since_s: t_s, failover });
            self.failovers.push(Failover::Open);
        }
    }

    /// Takes the rows of a tick that began at `t_s`. The last rows before it were taken `dt_s` earlier. Dead and frozen drones lead no group.
    pub(crate) fn take(&mut self, t_s: f64, dt_s: f64, rows: &[DroneRow], range_m: Option<f64>) {
        self.leaders.clear();
        self.leaders.extend(rows.iter().enumerate().filter(|(_, row)| leads(row)).map(|(drone, row)| (row.led, drone)));
        self.leaders.sort_unstable();
        let (leaders, failovers) = (&self.leaders, &mut self.failovers);
        self.orphans.retain(|orphan| {
            let of_group = |group: GroupId| orphan.group.contains(group) && group.contains(orphan.own);
            let mut of_group = leaders.iter().filter(|(group, _)| of_group(*group)).map(|(_, drone)| *drone);
            let Some(first) = of_group.next() else { return true };
            let resumed = orphan.frozen && first == orphan.leader.index() && of_group.next().is_none();
            failovers[orphan.failover] = if resumed { Failover::Resumed } else { Failover::Done(t_s - orphan.since_s) };
            false
        });
        let contact = |a: usize, b: usize| in_contact(&rows[a], &rows[b], range_m);
        let term = |drone: usize| self.terms.get(&DroneId(drone as u32));
        let over = |(led, a): (GroupId, usize), b: usize| term(a) > term(b) && led.contains(rows[b].group);
        let rivals = |a: (GroupId, usize), b: (GroupId, usize)| a.0 == b.0 || over(a, b.1) || over(b, a.1);
        let mut pairs = leaders.iter().enumerate().flat_map(|(i, &a)| leaders[..i].iter().map(move |&b| (a, b)));
        if pairs.any(|(a, b)| rivals(a, b) && contact(a.1, b.1)) {
            self.split_brain_s += dt_s;
        }
    }
}

fn leads(row: &DroneRow) -> bool {
    row.alive() && row.leads() && !row.is_frozen()
}

/// Whether each of two drones can hear the other: they are in radio range, no fault of the links separates them, and
/// neither is frozen. A message may still be lost.
fn in_contact(a: &DroneRow, b: &DroneRow, range_m: Option<f64>) -> bool {
    let distance_m = (horizontal(a.position_m) - horizontal(b.position_m)).norm();
    let hears = |a: &DroneRow, b: &DroneRow| !a.is_frozen() && a.link_faults.drop_reason(b.link_faults).is_none();
    range_m.is_none_or(|range_m| distance_m <= range_m) && hears(a, b) && hears(b, a)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::row;
    use skein_protocol::link_faults::LinkFaults;
    use skein_protocol::record::{ROW_ALIVE, ROW_FROZEN, ROW_LEADS};

    fn leader(x_m: f64, group: GroupId) -> DroneRow {
        DroneRow { flags: ROW_ALIVE | ROW_LEADS, led: group, ..row(x_m, 0.0) }
    }

    #[test]
    fn two_leaders_of_a_group_in_contact_are_a_split_brain() {
        let one = GroupId::ALL.child(1);
        let split = |range, rows: &[DroneRow]| {
            let mut leading = Leading::default();
            leading.take(1.0, 0.5, rows, range);
            leading.finish().split_brain_s
        };
        let rivals = [leader(0.0, one), row(5.0, 0.0), leader(60.0, one)];
        assert_eq!(split(None, &rivals), 0.5);
        assert_eq!(split(Some(60.0), &rivals), 0.5);
        assert_eq!(split(Some(50.0), &rivals), 0.0);
        assert_eq!(split(None, &[leader(0.0, one), leader(60.0, GroupId::ALL)]), 0.0);
        let nested = |later: u32, group| {
            let mut leading = Leading::default();
            for (round, leader) in [(1, 1 - later), (2, later)] {
                let ballot = Ballot { round, incarnation: 1, claimant: DroneId(leader) };
                leading.elected(0.5, "N".to_owned(), ballot, DroneId(leader));
            }
            let whole_group = DroneRow { group, ..leader(0.0, GroupId::ALL) };
            leading.take(1.0, 0.5, &[whole_group, DroneRow { group: one, ..leader(60.0, one) }], None);
            leading.finish().split_brain_s
        };
        let two = GroupId::ALL.child(2);
        assert_eq!(nested(1, two), 0.0, "a subgroup has its own leader, the former leader leads the rest");
        assert_eq!(nested(0, two), 0.5, "the whole group was claimed, and the leader of a subgroup continues");
        assert_eq!(nested(1, one), 0.5, "the subgroup of the former leader has a new leader");
        let dead = DroneRow { flags: ROW_LEADS, ..leader(60.0, one) };
        assert_eq!(split(None, &[leader(0.0, one), dead]), 0.0);
        for link_faults in
            [LinkFaults { deaf: 1, ..LinkFaults::default() }, LinkFaults { mute: 1, ..LinkFaults::default() }]
        {
            assert_eq!(split(None, &[leader(0.0, one), DroneRow { link_faults, ..leader(60.0, one) }]), 0.0);
        }
        let on_side = |x_m, side| {
            let mut row = leader(x_m, one);
            row.link_faults.partitions.join(0, side);
            row
        };
        assert_eq!(split(None, &[on_side(0.0, 0), on_side(60.0, 1)]), 0.0);
        assert_eq!(split(None, &[on_side(0.0, 1), on_side(60.0, 1)]), 0.5);
        let frozen = DroneRow { flags: ROW_ALIVE | ROW_LEADS | ROW_FROZEN, ..leader(60.0, one) };
        assert_eq!(split(None, &[leader(0.0, one), frozen]), 0.0);
    }

    fn failover_s(leading: Leading) -> Vec<Option<f64>> {
        leading.finish().failover_s
    }

    #[test]
    fn failover_lasts_until_another_drone_leads_the_group() {
        let (one, two) = (GroupId::ALL.child(1), GroupId::ALL.child(2));
        let mut leading = Leading::default();
        leading.lost(10.0, DroneId(1), &leader(0.0, one), false);
        leading.lost(10.0, DroneId(2), &row(0.0, 0.0), false);
        leading.lost(10.5, DroneId(3), &leader(0.0, two), false);
        leading.take(10.6, 0.1, &[leader(0.0, GroupId::ALL)], None);
        leading.take(11.25, 0.1, &[leader(0.0, one)], None);
        leading.take(12.0, 0.1, &[leader(0.0, one)], None);
        assert_eq!(failover_s(leading), [Some(1.25), None]);
    }

    #[test]
    fn a_group_that_splits_is_led_again_by_the_leader_of_the_lost_ones_part() {
        let [one, two] = [1, 2].map(|part| GroupId::ALL.child(part));
        let mut leading = Leading::default();
        leading.lost(10.0, DroneId(0), &DroneRow { group: one, ..leader(0.0, GroupId::ALL) }, false);
        leading.take(11.0, 1.0, &[row(0.0, 0.0), leader(9.0, two)], None);
        leading.take(12.0, 1.0, &[leader(5.0, one), leader(9.0, two)], None);
        assert_eq!(failover_s(leading), [Some(2.0)]);
    }

    #[test]
    fn failover_from_a_frozen_leader_ends_with_another_leader() {
        let all = GroupId::ALL;
        let frozen = DroneRow { flags: ROW_ALIVE | ROW_LEADS | ROW_FROZEN, ..leader(0.0, all) };
        let after = |ticks: &[[DroneRow; 2]], dies: bool| {
            let mut leading = Leading::default();
            leading.lost(10.0, DroneId(0), &leader(0.0, all), true);
            for (rows, tick) in ticks.iter().zip(1..) {
                if dies && tick == 2 {
                    leading.lost(12.0, DroneId(0), &frozen, false);
                }
                leading.take(10.0 + f64::from(tick), 1.0, rows, None);
            }
            failover_s(leading)
        };
        let (led, follower, goes_on) = (leader(9.0, all), row(9.0, 0.0), leader(0.0, all));
        assert_eq!(after(&[[frozen, follower], [frozen, led], [goes_on, led]], false), [Some(2.0)]);
        assert_eq!(after(&[[frozen, follower], [frozen, follower]], false), [None]);
        assert_eq!(after(&[[frozen, follower], [goes_on, follower], [goes_on, led]], false), [], "it went on");
        let dead = DroneRow { flags: 0, ..frozen };
        assert_eq!(after(&[[frozen, follower], [dead, follower], [dead, led]], true), [Some(3.0)], "one failover");
        assert_eq!(after(&[[frozen, led], [dead, led]], true), [Some(1.0)], "it led no more when it died");
    }

    #[test]
    fn a_ballot_that_leads_twice_is_one_election() {
        let mut leading = Leading::default();
        for (round, leader) in [(1, 0), (1, 0), (2, 3)] {
            let ballot = Ballot { round, incarnation: 1, claimant: DroneId(leader) };
            leading.elected(1.0, "N".to_owned(), ballot, DroneId(leader));
        }
        let summary = leading.finish();
        assert_eq!((summary.elections, summary.entries.len()), (2, 3));
    }
}
