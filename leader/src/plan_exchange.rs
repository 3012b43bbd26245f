//! The exchange of arrivals between leaders before they plan for one obstacle set. Each leader sends the rows of its own
//! members. All of them split the same table, and each applies the part about its own members.

use crate::split::NEVER_S;
use crate::tuning::{ANNOUNCE_S, ARRIVALS_TIMEOUT_S, CLOCKS_S, UNPACED};
use skein_protocol::payload::{Arrivals, MAX_ROUTES};
use skein_protocol::{ArrivalsKind, Ballot, DroneId, GroupId, SimTime};
use std::collections::BTreeMap;

/// Rows that are repeated for a while.
#[derive(Clone, Debug, PartialEq)]
struct Announcement {
    until: SimTime,
    next_said: SimTime,
    rows: Vec<Arrivals>,
}

/// An open question of one term: this drone waits for the rows of others.
#[derive(Clone, Debug, PartialEq)]
struct Question {
    set: u32,
    ballot: Ballot,
    since: SimTime,
    next_said: SimTime,
    rows: Vec<Arrivals>,
}

impl Question {
    /// Whether the wait for rows is over. `delay_s`: how long a message takes to arrive.
    fn is_over(&self, now: SimTime, delay_s: f64) -> bool {
        now.since(self.since) >= ARRIVALS_TIMEOUT_S + 2.0 * delay_s
    }
}

/// The rows heard, and the question asked. Memory is bounded by the size of the swarm.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct PlanExchange {
    drones: u32,
    repeat_s: f64,
    /// Time that one row takes in a leader's share of the bandwidth, s.
    row_s: f64,
    heard: BTreeMap<DroneId, Arrivals>,
    /// The rows of a choice that the coordinator made.
    chosen: BTreeMap<DroneId, Arrivals>,
    announced: Option<Announcement>,
    question: Option<Question>,
    /// The set that another leader asked about last.
    asked: Option<u32>,
    /// When this drone may answer again.
    next_answer: SimTime,
    /// When this drone's share of the bandwidth allows further rows.
    next_rows: SimTime,
}

impl PlanExchange {
    /// Nothing heard, in a swarm of `drones`. Repetitions are `repeat_s` apart, or longer: a row takes `row_s` of a leader's share of
    /// the bandwidth.
    pub(crate) fn new(drones: u32, repeat_s: f64, row_s: f64) -> Self {
        Self {
            drones,
            repeat_s,
            row_s,
            heard: BTreeMap::new(),
            chosen: BTreeMap::new(),
            announced: None,
            question: None,
            asked: None,
            next_answer: SimTime::ZERO,
            next_rows: SimTime::ZERO,
        }
    }

    /// Hears a row. A row is ignored if it is older than the last one, from the future by more than clocks
    /// may differ, of no drone of the swarm, or if it
    /// has no usable route.
    pub(crate) fn hear(&mut self, now: SimTime, row: &Arrivals) {
        let usable = arrivals_s(row).iter().any(|s| s.abs() < NEVER_S);
        if row.drone.0 >= self.drones || row.stamp > now.after(CLOCKS_S) || !usable {
            return;
        }
        let rows = match row.kind() {
            ArrivalsKind::Report => &mut self.heard,
            ArrivalsKind::Query => {
                self.asked = Some(row.set);
                &mut self.heard
            }
            ArrivalsKind::Decision => &mut self.chosen,
        };
        let known = rows.entry(row.drone).or_insert(*row);
        if row.stamp >= known.stamp {
            *known = *row;
        }
    }

    /// Asks about a set in a term with the rows of this leader's members. `rows` makes them; they stay the same until the
    /// answer, so that all leaders split the same table. Members that come to the group meanwhile get a row. Says the rows when due.
    pub(crate) fn ask(
        &mut self,
        now: SimTime,
        (set, ballot): (u32, Ballot),
        members: impl IntoIterator<Item = DroneId>,
        rows: impl FnOnce() -> Vec<Arrivals>,
        say: &mut Vec<Arrivals>,
    ) {
        let question = match &mut self.question {
            Some(question) if (question.set, question.ballot) == (set, ballot) => question,
            other => other.insert(Question { set, ballot, since: now, next_said: now, rows: Vec::new() }),
        };
        let has_row = |question: &Question, drone| question.rows.iter().any(|row| row.drone == drone);
        if members.into_iter().any(|drone| !has_row(question, drone)) {
            let new: Vec<Arrivals> = rows().into_iter().filter(|row| !has_row(question, row.drone)).collect();
            question.rows.extend(new);
        }
        if now >= question.next_said.max(self.next_rows) {
            question.next_said = now.after(self.repeat_s);
            self.next_rows = now.after(pause_s(question.rows.len(), self.row_s));
            say.extend(question.rows.iter().map(|row| Arrivals { kind: ArrivalsKind::Query.to_wire(), ..*row }));
        }
    }

    /// Whether a question about a set in a term is open, nothing is to be said about it, and it certainly has no answer yet. As
    /// [`Self::ask`] and [`Self::answer`], without the rows of the members.
    pub(crate) fn waits(
        &self,
        now: SimTime,
        (set, ballot): (u32, Ballot),
        members: impl IntoIterator<Item = DroneId>,
        others: &[DroneId],
        delay_s: f64,
    ) -> bool {
        let asked = self.question.as_ref().filter(|question| (question.set, question.ballot) == (set, ballot));
        asked.is_some_and(|question| {
            let has_row = |drone| question.rows.iter().any(|row| row.drone == drone);
            let is_heard = |drone: &DroneId| self.heard.get(drone).is_some_and(|row| row.set == set);
            now < question.next_said.max(self.next_rows)
                && !question.is_over(now, delay_s)
                && members.into_iter().all(has_row)
                && !others.iter().all(is_heard)
        })
    }

    /// The whole table, by drone, once every drone of `others` has a row or the wait is over. It includes the rows of this
    /// leader's members. `delay_s`: how long a message takes to arrive.
    pub(crate) fn answer(
        &self,
        now: SimTime,
        others: &[DroneId],
        routes: usize,
        delay_s: f64,
    ) -> Option<Vec<Arrivals>> {
        let question = self.question.as_ref()?;
        let fits = |row: &&Arrivals| row.set == question.set && row.routes as usize == routes;
        let foreign: Vec<Arrivals> =
            others.iter().filter_map(|drone| self.heard.get(drone)).filter(fits).copied().collect();
        if foreign.len() < others.len() && !question.is_over(now, delay_s) {
            return None;
        }
        let mut table: Vec<Arrivals> = question.rows.iter().copied().chain(foreign).collect();
        table.sort_by_key(|row| row.drone);
        table.dedup_by_key(|row| row.drone);
        Some(table)
    }

    /// Closes the question. Its rows are said once more, as other leaders may still wait for them.
    pub(crate) fn close(&mut self, now: SimTime, say: &mut Vec<Arrivals>) {
        if let Some(question) = self.question.take() {
            self.next_answer = now.after(self.repeat_s);
            self.asked = None;
            if now >= self.next_rows {
                self.note_said(now, question.rows.len());
                say.extend(question.rows);
            }
        }
    }

    /// Repeats these rows of a choice for a while.
    pub(crate) fn announce(&mut self, now: SimTime, rows: Vec<Arrivals>) {
        self.announced = Some(Announcement { until: now.after(ANNOUNCE_S), next_said: now, rows });
    }

    /// Says the rows of a choice when they are due.
    pub(crate) fn repeat(&mut self, now: SimTime, say: &mut Vec<Arrivals>) {
        let Some(announcement) = self.announced.as_mut().filter(|one| now <= one.until) else { return };
        if now >= announcement.next_said.max(self.next_rows) {
            announcement.next_said = now.after(self.repeat_s);
            self.next_rows = now.after(pause_s(announcement.rows.len(), self.row_s));
            say.extend(&announcement.rows);
        }
    }

    /// The route past a set that `leader` chose for a drone at `since` or later, if it was heard.
    pub(crate) fn chosen(&self, drone: DroneId, set: u32, leader: DroneId, since: SimTime) -> Option<usize> {
        let row = self.chosen.get(&drone)?;
        let meant = row.set == set && row.ballot.claimant == leader && row.stamp >= since;
        row.gate_s.iter().take(row.routes as usize).position(|s| s.is_finite()).filter(|_| meant)
    }

    /// The set that another leader asked about, if an answer is due. Marks it as answered.
    pub(crate) fn asked(&mut self, now: SimTime) -> Option<u32> {
        if now < self.next_answer.max(self.next_rows) {
            return None;
        }
        let set = self.asked.take()?;
        self.next_answer = now.after(self.repeat_s);
        Some(set)
    }

    /// Notes that this drone says this many rows.
    pub(crate) fn note_said(&mut self, now: SimTime, rows: usize) {
        self.next_rows = now.after(pause_s(rows, self.row_s));
    }
}

/// How long a leader says no further rows after this many, s.
fn pause_s(rows: usize, row_s: f64) -> f64 {
    rows.saturating_sub(UNPACED) as f64 * row_s
}

/// A row of the table. `gate_s`: time to the gate along each route, s from `now`.
pub(crate) fn row(now: SimTime, ballot: Ballot, group: GroupId, drone: DroneId, set: u32, gate_s: &[f64]) -> Arrivals {
    let mut row = Arrivals {
        stamp: now,
        ballot,
        drone,
        group,
        set,
        routes: gate_s.len().min(MAX_ROUTES) as u32,
        kind: ArrivalsKind::Report.to_wire(),
        gate_s: [f32::INFINITY; MAX_ROUTES],
    };
    for (to, &from) in row.gate_s.iter_mut().zip(gate_s) {
        *to = from as f32;
    }
    row
}

/// The arrivals in a row, s from the start of the mission, so that rows of different times can be compared.
pub(crate) fn arrivals_s(row: &Arrivals) -> Vec<f64> {
    let start_s = row.stamp.since(SimTime::ZERO);
    row.gate_s.iter().take(row.routes as usize).map(|&s| start_s + f64::from(s)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(seconds: f64) -> SimTime {
        SimTime::from_secs(seconds)
    }

    const TERM: Ballot = Ballot { round: 1, incarnation: 1, claimant: DroneId(0) };

    fn row_of(drone: u32, stamp_s: f64, set: u32) -> Arrivals {
        row(at(stamp_s), TERM, GroupId::ALL.child(1), DroneId(drone), set, &[1.0, f64::INFINITY])
    }

    fn asking(exchange: &mut PlanExchange, now_s: f64) -> Vec<Arrivals> {
        let mut said = Vec::new();
        exchange.ask(at(now_s), (7, TERM), [DroneId(0)], || vec![row_of(0, now_s, 7)], &mut said);
        said
    }

    #[test]
    fn a_table_is_complete_once_every_drone_has_a_row() {
        let mut exchange = PlanExchange::new(4, 0.2, 0.0);
        assert_eq!(asking(&mut exchange, 1.0).len(), 1);
        assert!(exchange.answer(at(1.0), &[DroneId(2)], 2, 0.0).is_none());
        exchange.hear(at(1.1), &row_of(2, 1.05, 8));
        assert!(exchange.answer(at(1.1), &[DroneId(2)], 2, 0.0).is_none());
        exchange.hear(at(1.1), &row_of(2, 1.06, 7));
        let table = exchange.answer(at(1.1), &[DroneId(2)], 2, 0.0).unwrap();
        assert_eq!(table.iter().map(|row| row.drone.0).collect::<Vec<_>>(), [0, 2]);
        assert!((arrivals_s(&table[1])[0] - 2.06).abs() < 1e-9 && arrivals_s(&table[1])[1].is_infinite());
    }

    #[test]
    fn a_question_waits_while_there_is_nothing_to_say_and_no_answer() {
        let mut exchange = PlanExchange::new(4, 0.2, 0.0);
        let waits = |exchange: &PlanExchange, now_s: f64, set: u32, members: &[u32]| {
            exchange.waits(at(now_s), (set, TERM), members.iter().copied().map(DroneId), &[DroneId(2)], 0.0)
        };
        assert!(!waits(&exchange, 1.0, 7, &[0]), "nothing was asked");
        asking(&mut exchange, 1.0);
        assert!(waits(&exchange, 1.1, 7, &[0]));
        assert!(!waits(&exchange, 1.1, 8, &[0]), "another set");
        assert!(!waits(&exchange, 1.1, 7, &[0, 1]), "a member without a row");
        assert!(!waits(&exchange, 1.2, 7, &[0]), "the rows are due again");
        asking(&mut exchange, 1.2);
        assert!(!waits(&exchange, 1.3, 7, &[0]), "the wait is over");
        exchange.hear(at(1.25), &row_of(2, 1.22, 7));
        assert!(!waits(&exchange, 1.25, 7, &[0]), "the table is complete");
    }

    #[test]
    fn rows_stay_the_same_and_are_repeated_until_the_wait_is_over() {
        let mut exchange = PlanExchange::new(4, 0.2, 0.0);
        let first = asking(&mut exchange, 1.0);
        assert!(asking(&mut exchange, 1.1).is_empty());
        assert_eq!(asking(&mut exchange, 1.2), first);
        assert!(exchange.answer(at(1.29), &[DroneId(2)], 2, 0.0).is_none());
        assert_eq!(exchange.answer(at(1.3), &[DroneId(2)], 2, 0.0).unwrap().len(), 1);
        assert!(exchange.answer(at(2.3), &[DroneId(2)], 2, 1.0).is_none());
    }

    #[test]
    fn a_member_that_comes_later_gets_a_row_and_a_question_of_an_earlier_term_is_dropped() {
        let mut exchange = PlanExchange::new(4, 0.2, 0.0);
        let mut ask = |now_s: f64, ballot, members: &[u32]| {
            let rows = || members.iter().map(|drone| row_of(*drone, now_s, 7)).collect();
            exchange.ask(at(now_s), (7, ballot), members.iter().copied().map(DroneId), rows, &mut Vec::new());
            let table = exchange.answer(at(now_s), &[], 2, 0.0).unwrap();
            table.iter().map(|row| (row.drone.0, row.stamp)).collect::<Vec<_>>()
        };
        assert_eq!(ask(1.0, TERM, &[0]), [(0, at(1.0))]);
        assert_eq!(ask(1.1, TERM, &[0, 1]), [(0, at(1.0)), (1, at(1.1))]);
        assert_eq!(ask(5.0, Ballot { round: 2, ..TERM }, &[1]), [(1, at(5.0))]);
    }

    #[test]
    fn many_rows_are_repeated_only_as_often_as_the_share_of_the_bandwidth_allows() {
        let mut exchange = PlanExchange::new(100, 0.2, 0.1);
        let mut ask = |now_s: f64| {
            let mut said = Vec::new();
            let rows = || (0..UNPACED as u32 + 10).map(|drone| row_of(drone, now_s, 7)).collect();
            exchange.ask(at(now_s), (7, TERM), [DroneId(0)], rows, &mut said);
            said.len()
        };
        assert_eq!(ask(1.0), UNPACED + 10);
        assert_eq!((ask(1.2), ask(1.98)), (0, 0));
        assert_eq!(ask(2.01), UNPACED + 10, "ten rows more than are free take a second");
        assert_eq!(exchange.asked(at(2.5)), None);
    }

    #[test]
    fn a_late_question_is_answered_but_not_in_every_tick() {
        let mut exchange = PlanExchange::new(4, 0.2, 0.0);
        exchange.hear(at(1.0), &Arrivals { kind: ArrivalsKind::Query.to_wire(), ..row_of(2, 1.0, 7) });
        assert_eq!(exchange.asked(at(1.0)), Some(7));
        exchange.hear(at(1.1), &Arrivals { kind: ArrivalsKind::Query.to_wire(), ..row_of(2, 1.1, 7) });
        assert_eq!((exchange.asked(at(1.1)), exchange.asked(at(1.2))), (None, Some(7)));
    }

    #[test]
    fn a_choice_counts_only_from_the_coordinator_and_only_if_it_is_new() {
        let mut exchange = PlanExchange::new(4, 0.2, 0.0);
        let choice = |stamp_s| Arrivals {
            kind: ArrivalsKind::Decision.to_wire(),
            gate_s: one_of(1),
            routes: 3,
            ..row_of(2, stamp_s, 7)
        };
        exchange.hear(at(1.1), &choice(1.0));
        assert_eq!(exchange.chosen(DroneId(2), 7, DroneId(0), at(1.0)), Some(1));
        assert_eq!(exchange.chosen(DroneId(2), 7, DroneId(3), at(1.0)), None);
        assert_eq!(exchange.chosen(DroneId(2), 8, DroneId(0), at(1.0)), None);
        assert_eq!(exchange.chosen(DroneId(2), 7, DroneId(0), at(1.05)), None);
        assert!(exchange.heard.is_empty(), "a choice is not a row of the table");
    }

    #[test]
    fn a_choice_is_repeated_for_a_while() {
        let mut exchange = PlanExchange::new(4, 0.2, 0.0);
        exchange.announce(at(1.0), vec![row_of(2, 1.0, 7)]);
        let mut said = Vec::new();
        for tick in 0..100 {
            exchange.repeat(at(1.0 + 0.05 * f64::from(tick)), &mut said);
        }
        assert!((5..=7).contains(&said.len()), "{}", said.len());
    }

    fn one_of(route: usize) -> [f32; MAX_ROUTES] {
        let mut gate_s = [f32::INFINITY; MAX_ROUTES];
        gate_s[route] = 3.0;
        gate_s
    }

    #[test]
    fn rows_of_strangers_of_the_future_and_without_a_route_are_ignored() {
        let mut exchange = PlanExchange::new(4, 0.2, 0.0);
        asking(&mut exchange, 1.0);
        exchange.hear(at(1.0), &row_of(9, 0.5, 7));
        exchange.hear(at(1.0), &row_of(2, 1.1 + CLOCKS_S, 7));
        exchange.hear(at(1.0), &Arrivals { gate_s: [f32::MAX; MAX_ROUTES], ..row_of(2, 0.5, 7) });
        assert!(exchange.answer(at(1.0), &[DroneId(2)], 2, 0.0).is_none() && exchange.heard.is_empty());
    }
}
