//! Looks at the record of a flight: when a leader died, and when everybody followed another one.

use skein_protocol::record::{DroneRow, RecordSink, RecordView, SinkError};
use skein_protocol::{Ballot, SimTime};
use skein_report::Recorder;
use std::collections::BTreeSet;
use std::time::Instant;

/// Bytes that a frame has besides its payload: kind, version, length.
const FRAME_HEAD: u64 = 8;

/// So long the machine must have kept time before a death, s.
const CALM_S: f64 = 0.5;

/// What was seen.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Found {
    /// Leaders that died.
    pub deaths: usize,
    /// For each that was replaced before the next one died: from its death to the end of the tick in which every living
    /// drone obeyed one living leader's term, s. By the wall clock measured on it.
    pub followed_s: Vec<f64>,
    /// Those of them during which the machine kept time, and for half a second before: nobody answered late.
    pub on_time_s: Vec<f64>,
    /// Terms in which somebody began to lead although the swarm had a living leader.
    pub false_elections: usize,
    /// Longest time with two leaders at once, who all hear each other here, s.
    pub split_max_s: f64,
    /// Flown since the swarm first had a leader, s.
    pub seconds: f64,
    /// The same for each living drone, added up, s.
    pub drone_seconds: f64,
    /// Frames sent meanwhile.
    pub frames: u64,
    /// Their bytes.
    pub bytes: u64,
}

/// A swarm without a leader that all follow.
#[derive(Clone, Copy, Debug)]
struct Orphaned {
    /// When it became so.
    at: SimTime,
    /// When the record of that tick came in.
    seen: Instant,
}

/// Takes each tick's record, and hands it on to the summary.
pub struct Witness {
    recorder: Recorder,
    dt_s: f64,
    /// Whether times are measured on the wall clock.
    by_wall: bool,
    orphaned: Option<Orphaned>,
    begun: bool,
    /// When somebody last answered late.
    late: Option<SimTime>,
    /// For how long there have been two leaders, s.
    split_s: f64,
    leaders: Vec<bool>,
    terms: BTreeSet<Ballot>,
    found: Found,
}

impl Witness {
    /// Ticks last `dt_s`.
    pub fn new(recorder: Recorder, dt_s: f64, by_wall: bool) -> Self {
        Self {
            recorder,
            dt_s,
            by_wall,
            orphaned: None,
            begun: false,
            late: None,
            split_s: 0.0,
            leaders: Vec::new(),
            terms: BTreeSet::new(),
            found: Found::default(),
        }
    }

    /// What was seen, and the summary's part.
    pub fn finish(self) -> (Recorder, Found) {
        (self.recorder, self.found)
    }

    fn look(&mut self, now: SimTime, rows: &[DroneRow]) {
        let died = self.leaders.iter().zip(rows).any(|(led, row)| *led && !row.alive());
        self.leaders.clear();
        self.leaders.extend(rows.iter().map(leads));
        if died && self.begun {
            self.found.deaths += 1;
            self.orphaned = Some(Orphaned { at: now, seen: Instant::now() });
        }
        if rows.iter().any(|row| row.is_late()) {
            self.late = Some(now);
        }
        let new = rows.iter().filter(|row| leads(row)).filter(|row| self.terms.insert(row.term)).count();
        if self.begun && self.orphaned.is_none() {
            self.found.false_elections += new;
        }
        let split = self.begun && rows.iter().filter(|row| leads(row)).count() > 1;
        self.split_s = if split { self.split_s + self.dt_s } else { 0.0 };
        self.found.split_max_s = self.found.split_max_s.max(self.split_s);
        if follow(rows) {
            self.begun = true;
            if let Some(orphaned) = self.orphaned.take() {
                // The tick of the death counts: it happened when that tick opened.
                let since_s = match self.by_wall {
                    true => orphaned.seen.elapsed().as_secs_f64(),
                    false => now.since(orphaned.at),
                };
                self.found.followed_s.push(since_s + self.dt_s);
                if self.late.is_none_or(|late| orphaned.at.since(late) > CALM_S) {
                    self.found.on_time_s.push(since_s + self.dt_s);
                }
            }
        }
    }

    fn count(&mut self, record: &RecordView<'_>) {
        let living = record.rows.iter().filter(|row| row.alive()).count();
        self.found.seconds += self.dt_s;
        self.found.drone_seconds += living as f64 * self.dt_s;
        self.found.frames += record.frames.len() as u64;
        self.found.bytes += record.frames.iter().map(|frame| FRAME_HEAD + u64::from(frame.frame.len)).sum::<u64>();
    }
}

impl RecordSink for Witness {
    fn take(&mut self, record: RecordView<'_>) -> Result<(), SinkError> {
        if !record.rows.is_empty() {
            self.look(record.head.now, record.rows);
            if self.begun {
                self.count(&record);
            }
        }
        self.recorder.take(record)
    }
}

fn leads(row: &DroneRow) -> bool {
    row.alive() && row.leads()
}

/// Whether every living drone obeys one term, and that of a living leader.
fn follow(rows: &[DroneRow]) -> bool {
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
    fn only_the_term_of_a_living_leader_is_followed_and_by_all() {
        let (first, second) = (term(1, 0), term(2, 1));
        assert!(follow(&[row(first, LEADS), row(first, ROW_ALIVE), row(second, 0)]));
        assert!(!follow(&[row(first, LEADS), row(second, LEADS)]));
        assert!(!follow(&[row(first, 0), row(first, ROW_ALIVE)]));
        assert!(!follow(&[row(second, ROW_ALIVE), row(second, ROW_ALIVE)]));
        assert!(!follow(&[row(Ballot::NONE, LEADS)]));
    }

    #[test]
    fn a_death_ends_when_all_follow_and_what_begins_beside_it_is_false() {
        let scenario = skein_scenario::Scenario::parse(
            "[formation]\ndrones = 3\n",
            skein_scenario::ScenarioSource { name: "t", stem: "t" },
            &[],
        );
        let facts = skein_runtime::run_facts::run_facts(&scenario.unwrap(), "inline", "lockstep").ok().unwrap();
        let mut witness = Witness::new(Recorder::in_memory(facts), 0.01, false);
        let (first, second, third) = (term(1, 0), term(2, 1), term(3, 2));
        let courses = [
            [row(first, LEADS), row(first, ROW_ALIVE), row(first, ROW_ALIVE)],
            [row(first, 0), row(first, ROW_ALIVE), row(first, ROW_ALIVE)],
            [row(first, 0), row(second, LEADS), row(first, ROW_ALIVE)],
            [row(first, 0), row(second, LEADS), row(second, ROW_ALIVE)],
            [row(first, 0), row(second, LEADS), row(third, LEADS)],
        ];
        for (tick, rows) in courses.iter().enumerate() {
            witness.look(SimTime::from_secs(0.01 * (tick + 1) as f64), rows);
        }
        let found = witness.finish().1;
        assert_eq!((found.deaths, found.false_elections), (1, 1));
        assert_eq!(found.on_time_s, found.followed_s);
        assert!((found.split_max_s - 0.01).abs() < 1e-9, "{found:?}");
        assert!((found.followed_s[0] - 0.03).abs() < 1e-9, "{found:?}");
    }
}
