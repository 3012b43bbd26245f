//! Watches the record of a flight: when a leader died, and when all drones followed another one.

use skein_protocol::record::{DroneRow, RecordSink, RecordView, SinkError};
use skein_protocol::{Ballot, SimTime};
use skein_report::Recorder;
use std::collections::BTreeSet;
use std::time::Instant;

/// Bytes of a frame besides its payload: kind, version, length.
const FRAME_HEAD: u64 = 8;

/// Time before a death during which no drone may answer late if the death is to count as on time, s.
const CALM_S: f64 = 0.5;

/// What was observed.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct FailoverCounts {
    /// Leaders that died.
    pub(super) deaths: usize,
    /// For each leader that was replaced before its successor died: the time from its death to the end of the tick in
    /// which every living drone obeyed one living leader's term, s. In real time it is measured on the wall clock.
    pub(super) failover_s: Vec<f64>,
    /// Those of these times during which, and for half a second before, no drone answered late.
    pub(super) on_time_s: Vec<f64>,
    /// Terms in which a drone began to lead although all drones followed a living leader.
    pub(super) false_elections: usize,
    /// Longest time with two leaders at once, s. All drones hear each other in this mission.
    pub(super) split_max_s: f64,
    /// Time flown since the swarm first had a leader, s.
    pub(super) seconds: f64,
    /// The same, added up over the living drones, s.
    pub(super) drone_seconds: f64,
    /// Frames sent in this time.
    pub(super) frames: u64,
    /// Bytes of these frames.
    pub(super) bytes: u64,
}

/// The beginning of a time in which the swarm has no leader that all follow.
#[derive(Clone, Copy, Debug)]
struct LeaderDeath {
    /// Simulated time.
    at: SimTime,
    /// When the record of that tick came in.
    seen: Instant,
}

/// Takes the record of each tick, and forwards it to the recorder.
pub(super) struct FailoverMonitor {
    recorder: Recorder,
    dt_s: f64,
    /// Whether times are measured on the wall clock.
    by_wall: bool,
    death: Option<LeaderDeath>,
    begun: bool,
    /// When a drone last answered late.
    late: Option<SimTime>,
    /// For how long there have been two leaders, s.
    split_s: f64,
    leaders: Vec<bool>,
    terms: BTreeSet<Ballot>,
    counts: FailoverCounts,
}

impl FailoverMonitor {
    /// A monitor of a flight whose ticks last `dt_s`.
    pub(super) fn new(recorder: Recorder, dt_s: f64, by_wall: bool) -> Self {
        Self {
            recorder,
            dt_s,
            by_wall,
            death: None,
            begun: false,
            late: None,
            split_s: 0.0,
            leaders: Vec::new(),
            terms: BTreeSet::new(),
            counts: FailoverCounts::default(),
        }
    }

    /// The recorder, and what was observed.
    pub(super) fn finish(self) -> (Recorder, FailoverCounts) {
        (self.recorder, self.counts)
    }

    fn observe(&mut self, now: SimTime, rows: &[DroneRow]) {
        self.observe_deaths(now, rows);
        if rows.iter().any(|row| row.is_late()) {
            self.late = Some(now);
        }
        let new_terms = rows.iter().filter(|row| leads(row)).filter(|row| self.terms.insert(row.term)).count();
        if self.begun && self.death.is_none() {
            self.counts.false_elections += new_terms;
        }
        let split = self.begun && rows.iter().filter(|row| leads(row)).count() > 1;
        self.split_s = if split { self.split_s + self.dt_s } else { 0.0 };
        self.counts.split_max_s = self.counts.split_max_s.max(self.split_s);
        if all_follow_one_leader(rows) {
            self.begun = true;
            if let Some(death) = self.death.take() {
                self.count_failover(now, death);
            }
        }
    }

    fn observe_deaths(&mut self, now: SimTime, rows: &[DroneRow]) {
        let died = self.leaders.iter().zip(rows).any(|(led, row)| *led && !row.alive());
        self.leaders.clear();
        self.leaders.extend(rows.iter().map(leads));
        if died && self.begun {
            self.counts.deaths += 1;
            self.death = Some(LeaderDeath { at: now, seen: Instant::now() });
        }
    }

    /// The tick of the death counts, because the death happened when that tick opened.
    fn count_failover(&mut self, now: SimTime, death: LeaderDeath) {
        let since_s = if self.by_wall { death.seen.elapsed().as_secs_f64() } else { now.since(death.at) };
        self.counts.failover_s.push(since_s + self.dt_s);
        if self.late.is_none_or(|late| death.at.since(late) > CALM_S) {
            self.counts.on_time_s.push(since_s + self.dt_s);
        }
    }

    fn count_frames(&mut self, record: &RecordView<'_>) {
        let living = record.rows.iter().filter(|row| row.alive()).count();
        self.counts.seconds += self.dt_s;
        self.counts.drone_seconds += living as f64 * self.dt_s;
        self.counts.frames += record.frames.len() as u64;
        self.counts.bytes += record.frames.iter().map(|frame| FRAME_HEAD + u64::from(frame.frame.len)).sum::<u64>();
    }
}

impl RecordSink for FailoverMonitor {
    fn take(&mut self, record: RecordView<'_>) -> Result<(), SinkError> {
        if !record.rows.is_empty() {
            self.observe(record.head.now, record.rows);
            if self.begun {
                self.count_frames(&record);
            }
        }
        self.recorder.take(record)
    }
}

fn leads(row: &DroneRow) -> bool {
    row.alive() && row.leads()
}

/// Whether every living drone obeys the term of one living leader.
fn all_follow_one_leader(rows: &[DroneRow]) -> bool {
    let mut living = rows.iter().filter(|row| row.alive() && !row.is_frozen());
    let Some(term) = living.clone().map(|row| row.term).next() else { return false };
    let leader = rows.get(term.claimant.index());
    term.is_some() && living.all(|row| row.term == term) && leader.is_some_and(|row| leads(row) && row.term == term)
}

#[cfg(test)]
mod tests {
    use super::*;
    use skein_protocol::DroneId;
    use skein_protocol::record::{ROW_ALIVE, ROW_LEADS};

    fn term(round: u32, claimant: u32) -> Ballot {
        Ballot { round, incarnation: 1, claimant: DroneId(claimant) }
    }

    fn row(term: Ballot, flags: u32) -> DroneRow {
        DroneRow { term, flags, ..DroneRow::default() }
    }

    const LEADS: u32 = ROW_ALIVE | ROW_LEADS;

    #[test]
    fn all_drones_must_obey_the_term_of_a_living_leader() {
        let (first, second) = (term(1, 0), term(2, 1));
        assert!(all_follow_one_leader(&[row(first, LEADS), row(first, ROW_ALIVE), row(second, 0)]));
        assert!(!all_follow_one_leader(&[row(first, LEADS), row(second, LEADS)]));
        assert!(!all_follow_one_leader(&[row(first, 0), row(first, ROW_ALIVE)]));
        assert!(!all_follow_one_leader(&[row(second, ROW_ALIVE), row(second, ROW_ALIVE)]));
        assert!(!all_follow_one_leader(&[row(Ballot::NONE, LEADS)]));
    }

    #[test]
    fn a_failover_ends_when_all_follow_and_a_second_leader_is_a_false_election() {
        let scenario = skein_scenario::Scenario::parse(
            "[formation]\ndrones = 3\n",
            skein_scenario::ScenarioSource { name: "t", stem: "t" },
            &[],
        );
        let facts = skein_runtime::run_facts::run_facts(&scenario.unwrap(), "inline", "lockstep").unwrap();
        let mut monitor = FailoverMonitor::new(Recorder::in_memory(facts), 0.01, false);
        let (first, second, third) = (term(1, 0), term(2, 1), term(3, 2));
        let ticks = [
            [row(first, LEADS), row(first, ROW_ALIVE), row(first, ROW_ALIVE)],
            [row(first, 0), row(first, ROW_ALIVE), row(first, ROW_ALIVE)],
            [row(first, 0), row(second, LEADS), row(first, ROW_ALIVE)],
            [row(first, 0), row(second, LEADS), row(second, ROW_ALIVE)],
            [row(first, 0), row(second, LEADS), row(third, LEADS)],
        ];
        for (tick, rows) in ticks.iter().enumerate() {
            monitor.observe(SimTime::from_secs(0.01 * (tick + 1) as f64), rows);
        }
        let found = monitor.finish().1;
        assert_eq!((found.deaths, found.false_elections), (1, 1));
        assert_eq!(found.on_time_s, found.failover_s);
        assert!((found.split_max_s - 0.01).abs() < 1e-9, "{found:?}");
        assert!((found.failover_s[0] - 0.03).abs() < 1e-9, "{found:?}");
    }
}
