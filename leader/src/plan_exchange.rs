//! What leaders tell each other before they plan for one obstacle set: the rows of the table they all split. Each
//! applies the part about its own members.

use crate::split::NEVER_S;
use skein_protocol::payload::{Arrivals, MAX_ROUTES};
use skein_protocol::{ArrivalsKind, Ballot, DroneId, GroupId, SimTime};
use std::collections::BTreeMap;

/// A leader that hears nothing of the others for so long plans alone, s; the air's delay comes on top, both ways.
pub const PATIENCE_S: f64 = 0.3;

/// What was chosen for other groups is repeated for so long, s.
const ANNOUNCE_S: f64 = 1.0;

/// What is said again and again for a while.
#[derive(Clone, Debug, PartialEq)]
struct Announcement {
    until: SimTime,
    next_said: SimTime,
    rows: Vec<Arrivals>,
}

/// A question that is open: this drone waits for the rows of others.
#[derive(Clone, Debug, PartialEq)]
struct Question {
    set: u32,
    since: SimTime,
    next_said: SimTime,
    rows: Vec<Arrivals>,
}

/// Rows heard, and the question asked. Bounded by the size of the swarm.
#[derive(Clone, Debug, PartialEq)]
pub struct PlanExchange {
    drones: u32,
    repeat_s: f64,
    heard: BTreeMap<DroneId, Arrivals>,
    /// What one leader chose for all.
    chosen: BTreeMap<DroneId, Arrivals>,
    announced: Option<Announcement>,
    question: Option<Question>,
    /// The set that somebody else asked about last, and when this drone may answer again.
    asked: Option<u32>,
    next_answer: SimTime,
}

impl PlanExchange {
    /// Nothing heard, in a swarm of `drones`; what has to be repeated is repeated every `repeat_s`.
    #[must_use]
    pub fn new(drones: u32, repeat_s: f64) -> Self {
        Self {
            drones,
            repeat_s,
            heard: BTreeMap::new(),
            chosen: BTreeMap::new(),
            announced: None,
            question: None,
            asked: None,
            next_answer: SimTime::ZERO,
        }
    }

    /// Hears a row. One that is older than what is known, from the future, of nobody in the swarm, or of a drone that
    /// could go nowhere is ignored.
    pub fn hear(&mut self, now: SimTime, row: &Arrivals) {
        let somewhere = arrivals_s(row).iter().any(|s| s.abs() < NEVER_S);
        if row.drone.0 >= self.drones || row.stamp > now || !somewhere {
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

    /// Asks about a set with the rows of one's own members, made by `rows` for the first time; they stay the same until
    /// the answer, so that all split the same table. Says them when due.
    pub fn ask(&mut self, now: SimTime, set: u32, rows: impl FnOnce() -> Vec<Arrivals>, say: &mut Vec<Arrivals>) {
        let question = match &mut self.question {
            Some(question) if question.set == set => question,
            other => other.insert(Question { set, since: now, next_said: now, rows: rows() }),
        };
        if now >= question.next_said {
            question.next_said = now.after(self.repeat_s);
            say.extend(question.rows.iter().map(|row| Arrivals { kind: ArrivalsKind::Query.to_wire(), ..*row }));
        }
    }

    /// The whole table once everybody in `others` has a row, or after waiting for too long: `delay_s` is how long a
    /// message is on the air. By drone; one's own rows among them.
    pub fn answer(&self, now: SimTime, others: &[DroneId], routes: usize, delay_s: f64) -> Option<Vec<Arrivals>> {
        let question = self.question.as_ref()?;
        let fits = |row: &&Arrivals| row.set == question.set && row.routes as usize == routes;
        let foreign: Vec<Arrivals> =
            others.iter().filter_map(|drone| self.heard.get(drone)).filter(fits).copied().collect();
        let waited = now.since(question.since) >= PATIENCE_S + 2.0 * delay_s;
        if foreign.len() < others.len() && !waited {
            return None;
        }
        let mut table: Vec<Arrivals> = question.rows.iter().copied().chain(foreign).collect();
        table.sort_by_key(|row| row.drone);
        table.dedup_by_key(|row| row.drone);
        Some(table)
    }

    /// The question is settled. Its rows are said once more without a question: others may still wait for them.
    pub fn close(&mut self, now: SimTime, say: &mut Vec<Arrivals>) {
        if let Some(question) = self.question.take() {
            self.next_answer = now.after(self.repeat_s);
            self.asked = None;
            say.extend(question.rows);
        }
    }

    /// Says for a while what was chosen for all.
    pub fn announce(&mut self, now: SimTime, rows: Vec<Arrivals>) {
        self.announced = Some(Announcement { until: now.after(ANNOUNCE_S), next_said: now, rows });
    }

    /// Says again what is due.
    pub fn repeat(&mut self, now: SimTime, say: &mut Vec<Arrivals>) {
        let Some(announcement) = self.announced.as_mut().filter(|one| now <= one.until) else { return };
        if now >= announcement.next_said {
            announcement.next_said = now.after(self.repeat_s);
            say.extend(&announcement.rows);
        }
    }

    /// The route past a set that this leader has chosen for a drone since then, if it was heard.
    #[must_use]
    pub fn chosen(&self, drone: DroneId, set: u32, leader: DroneId, since: SimTime) -> Option<usize> {
        let row = self.chosen.get(&drone)?;
        let meant = row.set == set && row.ballot.claimant == leader && row.stamp >= since;
        row.gate_s.iter().take(row.routes as usize).position(|s| s.is_finite()).filter(|_| meant)
    }

    /// The set that another leader asked about, if an answer is due.
    pub fn asked(&mut self, now: SimTime) -> Option<u32> {
        if now < self.next_answer {
            return None;
        }
        let set = self.asked.take()?;
        self.next_answer = now.after(self.repeat_s);
        Some(set)
    }
}

/// A row: `gate_s` in s from `now`, one a route.
#[must_use]
pub fn row(now: SimTime, ballot: Ballot, group: GroupId, drone: DroneId, set: u32, gate_s: &[f64]) -> Arrivals {
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
    row.gate_s.iter_mut().zip(gate_s).for_each(|(to, &from)| *to = from as f32);
    row
}

/// The arrivals in a row, in s from the mission's start, so that rows made at different times can be compared.
#[must_use]
pub fn arrivals_s(row: &Arrivals) -> Vec<f64> {
    let start_s = row.stamp.since(SimTime::ZERO);
    row.gate_s.iter().take(row.routes as usize).map(|&s| start_s + f64::from(s)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(seconds: f64) -> SimTime {
        SimTime::from_secs(seconds)
    }

    fn row_of(drone: u32, stamp_s: f64, set: u32) -> Arrivals {
        let ballot = Ballot { round: 1, incarnation: 1, claimant: DroneId(0) };
        row(at(stamp_s), ballot, GroupId::ALL.child(1), DroneId(drone), set, &[1.0, f64::INFINITY])
    }

    fn asking(plan_exchange: &mut PlanExchange, now_s: f64) -> Vec<Arrivals> {
        let mut said = Vec::new();
        plan_exchange.ask(at(now_s), 7, || vec![row_of(0, now_s, 7)], &mut said);
        said
    }

    #[test]
    fn a_table_is_whole_once_everybody_has_a_row() {
        let mut plan_exchange = PlanExchange::new(4, 0.2);
        assert_eq!(asking(&mut plan_exchange, 1.0).len(), 1);
        assert!(plan_exchange.answer(at(1.0), &[DroneId(2)], 2, 0.0).is_none());
        plan_exchange.hear(at(1.1), &row_of(2, 1.05, 8));
        assert!(plan_exchange.answer(at(1.1), &[DroneId(2)], 2, 0.0).is_none());
        plan_exchange.hear(at(1.1), &row_of(2, 1.06, 7));
        let table = plan_exchange.answer(at(1.1), &[DroneId(2)], 2, 0.0).unwrap();
        assert_eq!(table.iter().map(|row| row.drone.0).collect::<Vec<_>>(), [0, 2]);
        assert!((arrivals_s(&table[1])[0] - 2.06).abs() < 1e-9 && arrivals_s(&table[1])[1].is_infinite());
    }

    #[test]
    fn rows_stay_the_same_are_repeated_and_nobody_waits_for_ever() {
        let mut plan_exchange = PlanExchange::new(4, 0.2);
        let first = asking(&mut plan_exchange, 1.0);
        assert!(asking(&mut plan_exchange, 1.1).is_empty());
        assert_eq!(asking(&mut plan_exchange, 1.2), first);
        assert!(plan_exchange.answer(at(1.29), &[DroneId(2)], 2, 0.0).is_none());
        assert_eq!(plan_exchange.answer(at(1.3), &[DroneId(2)], 2, 0.0).unwrap().len(), 1);
        assert!(plan_exchange.answer(at(2.3), &[DroneId(2)], 2, 1.0).is_none());
    }

    #[test]
    fn whoever_asks_late_is_answered_but_not_in_every_tick() {
        let mut plan_exchange = PlanExchange::new(4, 0.2);
        plan_exchange.hear(at(1.0), &Arrivals { kind: ArrivalsKind::Query.to_wire(), ..row_of(2, 1.0, 7) });
        assert_eq!(plan_exchange.asked(at(1.0)), Some(7));
        plan_exchange.hear(at(1.1), &Arrivals { kind: ArrivalsKind::Query.to_wire(), ..row_of(2, 1.1, 7) });
        assert_eq!((plan_exchange.asked(at(1.1)), plan_exchange.asked(at(1.2))), (None, Some(7)));
    }

    #[test]
    fn a_choice_counts_from_the_one_who_thinks_for_all_and_not_if_it_is_older() {
        let mut plan_exchange = PlanExchange::new(4, 0.2);
        let choice = |stamp_s| Arrivals {
            kind: ArrivalsKind::Decision.to_wire(),
            gate_s: one_of(1),
            routes: 3,
            ..row_of(2, stamp_s, 7)
        };
        plan_exchange.hear(at(1.1), &choice(1.0));
        assert_eq!(plan_exchange.chosen(DroneId(2), 7, DroneId(0), at(1.0)), Some(1));
        assert_eq!(plan_exchange.chosen(DroneId(2), 7, DroneId(3), at(1.0)), None);
        assert_eq!(plan_exchange.chosen(DroneId(2), 8, DroneId(0), at(1.0)), None);
        assert_eq!(plan_exchange.chosen(DroneId(2), 7, DroneId(0), at(1.05)), None);
        assert!(plan_exchange.heard.is_empty(), "a choice is no row of the table");
    }

    #[test]
    fn a_choice_is_repeated_for_a_while() {
        let mut plan_exchange = PlanExchange::new(4, 0.2);
        plan_exchange.announce(at(1.0), vec![row_of(2, 1.0, 7)]);
        let mut said = Vec::new();
        for tick in 0..100 {
            plan_exchange.repeat(at(1.0 + 0.05 * f64::from(tick)), &mut said);
        }
        assert!((5..=7).contains(&said.len()), "{}", said.len());
    }

    fn one_of(route: usize) -> [f32; MAX_ROUTES] {
        let mut gate_s = [f32::INFINITY; MAX_ROUTES];
        gate_s[route] = 3.0;
        gate_s
    }

    #[test]
    fn rows_of_strangers_from_the_future_and_to_nowhere_are_refused() {
        let mut plan_exchange = PlanExchange::new(4, 0.2);
        asking(&mut plan_exchange, 1.0);
        plan_exchange.hear(at(1.0), &row_of(9, 0.5, 7));
        plan_exchange.hear(at(1.0), &row_of(2, 1.5, 7));
        plan_exchange.hear(at(1.0), &Arrivals { gate_s: [f32::MAX; MAX_ROUTES], ..row_of(2, 0.5, 7) });
        assert!(plan_exchange.answer(at(1.0), &[DroneId(2)], 2, 0.0).is_none() && plan_exchange.heard.is_empty());
    }
}
