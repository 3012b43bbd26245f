//! Leadership over time: a row per group, a bar per term.

use super::style::{Axes, Heading, PALETTE, RED, Sign, plot, px, rgb, text};
use crate::error::DrawError;
use crate::facts::RunFacts;
use crate::group_order::GroupOrder;
use plotters::prelude::*;
use skein_protocol::record::{EventKind, RunEvent};
use std::collections::BTreeMap;

/// Height of a row.
const ROW: u32 = px(34);
/// Height of a bar as a share of its row.
const BAR: f64 = 0.62;

/// The time in which a drone leads a group.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Term {
    group: String,
    leader: u32,
    from_s: f64,
    to_s: f64,
}

/// The terms in the events of a run, in order of their beginning. A fault of a leader ends its terms.
pub(super) fn terms(events: &[RunEvent], end_s: f64) -> Vec<Term> {
    let (mut terms, mut open): (Vec<Term>, BTreeMap<(u32, String), usize>) = Default::default();
    for event in events {
        match &event.what {
            EventKind::Leader { group, leader, leads: true, .. } => {
                let from = terms.len();
                let key = (leader.0, group.clone());
                // If the same leader starts a new term when its last one ends, both are drawn as one.
                let same = |term: &Term| (term.leader, &term.group) == (leader.0, group) && term.to_s >= event.t_s;
                if let Some(place) = terms.iter().rposition(same) {
                    terms[place].to_s = end_s;
                    open.insert(key, place);
                } else {
                    let (leader, group) = (leader.0, group.clone());
                    terms.push(Term { group, leader, from_s: event.t_s, to_s: end_s });
                    open.insert(key, from);
                }
            }
            EventKind::Leader { group, leader, leads: false, .. } => {
                if let Some(place) = open.remove(&(leader.0, group.clone())) {
                    terms[place].to_s = event.t_s;
                }
            }
            EventKind::Fault { target, .. } => {
                for (_, place) in open.extract_if((target.0, String::new()).., |key, _| key.0 == target.0) {
                    terms[place].to_s = event.t_s;
                }
            }
            _ => {}
        }
    }
    terms
}

/// Draws the timeline. There must be at least one term. Returns the SVG.
pub(super) fn draw(
    terms: &[Term],
    events: &[RunEvent],
    order: &GroupOrder,
    facts: &RunFacts,
    end_s: f64,
) -> Result<String, DrawError> {
    let mut order = order.clone();
    let mut groups: Vec<&str> = terms.iter().map(|term| term.group.as_str()).collect();
    groups.sort_unstable();
    groups.dedup();
    let title = format!("Leadership: {}, {} drones, {}", facts.scenario, facts.drones, facts.strategy);
    let faults: Vec<f64> = events.iter().filter(|e| matches!(e.what, EventKind::Fault { .. })).map(|e| e.t_s).collect();
    let mut signs = vec![(Sign::Block(PALETTE[0]), "a drone leads the group; its number is in the bar".to_owned())];
    signs.extend((!faults.is_empty()).then(|| (Sign::Line(RED), "fault".to_owned())));
    let rows = groups.len() as f64;
    let axes =
        Axes { x: ("time (s)", 0.0..end_s.max(1e-3)), y: ("", 0.0..rows), height: ROW * groups.len().max(2) as u32 };
    plot(&Heading::narrow(&title, signs), axes, |canvas, chart| {
        for at in &faults {
            let line = [(*at, 0.0), (*at, rows)];
            chart.draw_series([PathElement::new(line, RED.stroke_width(px(2)))]).map_err(DrawError::new)?;
        }
        for term in terms {
            let row = rows - 1.0 - groups.iter().position(|group| *group == term.group).unwrap_or(0) as f64;
            let (low, high) = (row + (1.0 - BAR) / 2.0, row + (1.0 + BAR) / 2.0);
            let (corners, colour) = ([(term.from_s, low), (term.to_s, high)], rgb(order.colour(&term.group)));
            // A white edge separates terms that follow each other.
            let bars = [Rectangle::new(corners, colour.filled()), Rectangle::new(corners, WHITE.stroke_width(px(1)))];
            chart.draw_series(bars).map_err(DrawError::new)?;
            let (x, y) = chart.backend_coord(&(term.from_s, row + 0.5));
            let label = Text::new(term.leader.to_string(), (x + px(4) as i32, y), text(13).color(&WHITE));
            canvas.draw(&label).map_err(DrawError::new)?;
        }
        for (row, group) in groups.iter().rev().enumerate() {
            let (x, y) = chart.backend_coord(&(0.0, row as f64 + 0.5));
            let label = Text::new((*group).to_owned(), (x - px(50) as i32, y), text(13));
            canvas.draw(&label).map_err(DrawError::new)?;
        }
        Ok(())
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use skein_protocol::record::FaultKind;
    use skein_protocol::{Ballot, DroneId};

    fn leads(t_s: f64, leader: u32, round: u32, leads: bool) -> RunEvent {
        let ballot = Ballot { round, incarnation: 1, claimant: DroneId(leader) };
        RunEvent { t_s, what: EventKind::Leader { group: "N".into(), ballot, leader: DroneId(leader), leads } }
    }

    #[test]
    fn terms_end_by_resignation_or_death_and_renewed_terms_are_joined() {
        let kill =
            EventKind::Fault { kind: FaultKind::Kill, target: DroneId(2), scheduled: true, detail: String::new() };
        let events = [
            leads(1.0, 2, 1, true),
            leads(2.0, 2, 1, false),
            leads(2.0, 2, 2, true),
            RunEvent { t_s: 5.0, what: kill },
            leads(6.0, 0, 3, true),
        ];
        let term = |leader, from_s, to_s| Term { group: "N".into(), leader, from_s, to_s };
        assert_eq!(terms(&events, 9.0), [term(2, 1.0, 5.0), term(0, 6.0, 9.0)]);
    }
}
