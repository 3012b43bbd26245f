//! The lines of other drones that this drone passes on, because the two drones of a line may not hear each other.
//!
//! The proof in `docs/safety.md` allows any delay, loss and number of copies, so it also holds for lines that are passed on
//! unchanged. What is passed on decides only how fast drones fly that are out of each other's reach.
//!
//! A line is passed on by drones that are nearer to the drone it is meant for than those that have said it. It is repeated more and
//! more rarely; from the start most rarely if its two drones are near each other. A new line of the same two drones shortens the wait. A
//! line is not passed on for a while after the other drone answered it. Answers themselves are not answered: they are only repeated rarely.

use super::separation_pair::NO_LINE;
use crate::tuning::{LINE_ANSWERED_S, LINE_FIRST_S, LINE_FORGET_S, LINE_NEAR, LINE_REDUNDANCY, LINE_REPEAT_S};
use skein_protocol::payload::{MAX_SEPARATORS, Separation, Separator};
use skein_protocol::{DroneId, SimTime};
use std::collections::BTreeMap;

/// Most lines that a drone remembers in order to pass them on.
const MAX_LINES: usize = 2048;
/// The time between two repetitions is doubled at most this often.
const MAX_DOUBLINGS: u32 = 3;

/// What decides whether and when a drone passes on a line that is meant for another drone, the addressee. Distances, m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Distances {
    /// From the source of the message that was heard to the addressee.
    pub(crate) said_m: f64,
    /// From this drone to the addressee.
    pub(crate) own_m: f64,
    /// From the drone that is bound to the line to the addressee.
    pub(crate) pair_m: f64,
    /// From this drone to the farthest drone that it hears.
    pub(crate) reach_m: f64,
}

/// A line of another drone.
#[derive(Clone, Debug)]
struct Heard {
    line: Separator,
    /// When it was last heard.
    last: SimTime,
    /// When this drone next passes it on, or finds that others did.
    turn: SimTime,
    /// How often the time to the next turn has been doubled since the line last changed.
    doublings: u32,
    /// How often nearer drones have said it since the last turn.
    nearer: u32,
    /// When the other drone was last heard to be bound to it, or to a later line.
    answered: SimTime,
}

/// The lines of others that one drone has heard. Memory is bounded.
#[derive(Clone, Debug, Default)]
pub(crate) struct RelayedLines {
    heard: BTreeMap<Key, Heard>,
    /// Scratch memory: lines whose turn it is, and since when it is.
    due: Vec<(SimTime, Key)>,
}

/// Which line it is. Of the lines with one key, only the newest is passed on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Key {
    /// The drone that is bound to the line, and says so.
    speaker: DroneId,
    /// The drone for which it is meant.
    peer: DroneId,
    /// Whether the speaker made the line. Otherwise it answers a line that the other drone made.
    own: bool,
}

impl Key {
    /// Drones with the lower id make lines with even numbers. That a drone knows no line is its own word.
    fn new(speaker: DroneId, line: &Separator) -> Self {
        Self {
            speaker,
            peer: line.peer,
            own: number(line).is_none_or(|number| number % 2 == u32::from(speaker > line.peer)),
        }
    }
}

impl RelayedLines {
    /// Forgets all lines.
    pub(crate) fn clear(&mut self) {
        self.heard.clear();
    }

    /// Hears a line of `speaker` that is meant for a third drone. `direct`: `speaker` said it itself.
    pub(crate) fn hear(&mut self, now: SimTime, speaker: DroneId, line: &Separator, direct: bool, at: Distances) {
        let key = Key::new(speaker, line);
        let near = at.pair_m <= LINE_NEAR * at.reach_m;
        let (wait_s, doublings) = if near { (slowest_s(), MAX_DOUBLINGS) } else { (LINE_FIRST_S, 0) };
        let turn = now.after(wait_s * (at.own_m / at.said_m.max(1.0)).min(1.0));
        let full = self.heard.len() >= MAX_LINES;
        let before = self.heard.get_mut(&key);
        if before.as_ref().map_or(full, |before| version(line) < version(&before.line)) {
            return;
        }
        let answered = now.after(-2.0 * LINE_ANSWERED_S);
        let new = Heard { line: *line, last: now, turn, doublings, nearer: 0, answered };
        let heard = match before {
            None => self.heard.entry(key).or_insert(new),
            Some(before) => {
                if version(line) > version(&before.line) {
                    // A pair that makes lines all the time must not put off the turn.
                    *before =
                        Heard { turn: before.turn.min(turn), nearer: before.nearer, answered: before.answered, ..new };
                }
                before
            }
        };
        heard.last = now;
        if at.said_m <= at.own_m {
            heard.nearer += if direct { LINE_REDUNDANCY } else { 1 };
        }
        self.note_answer(now, speaker, line);
    }

    /// Notes that the line which `speaker` says answers one of the other drone's.
    fn note_answer(&mut self, now: SimTime, speaker: DroneId, line: &Separator) {
        let Some(asked) = self.heard.get_mut(&Key { speaker: line.peer, peer: speaker, own: true }) else { return };
        let same = asked.line.incarnation == line.peer_incarnation && asked.line.peer_incarnation == line.incarnation;
        if same && number(line).is_some_and(|answered| Some(answered) >= number(&asked.line)) {
            asked.answered = now;
        }
    }

    /// The lines of one drone whose turn it is, as one message; `None` if there are none.
    pub(crate) fn speak(&mut self, now: SimTime) -> Option<Separation> {
        self.heard.retain(|_, heard| now.since(heard.last) <= LINE_FORGET_S);
        self.due.clear();
        for (&key, heard) in self.heard.iter_mut().filter(|(_, heard)| heard.turn <= now) {
            if heard.is_wanted(now, key.own) {
                self.due.push((heard.turn, key));
            } else {
                heard.end_turn(now);
            }
        }
        let speaker = self.due.iter().min()?.1.speaker;
        self.due.retain(|(_, key)| key.speaker == speaker);
        self.due.sort_unstable();
        self.due.truncate(MAX_SEPARATORS);
        let mut message = Separation { count: 0, of: speaker.0 + 1, separators: Default::default() };
        for (_, key) in &self.due {
            let Some(heard) = self.heard.get_mut(key) else { continue };
            heard.end_turn(now);
            message.separators[message.count as usize] = heard.line;
            message.count += 1;
        }
        Some(message)
    }
}

impl Heard {
    /// Whether it is to be passed on in this turn.
    fn is_wanted(&self, now: SimTime, own: bool) -> bool {
        // Only a line that its speaker made can be answered. What answers a line has no answer itself.
        self.nearer < LINE_REDUNDANCY && (!own || now.since(self.answered) > LINE_ANSWERED_S)
    }

    fn end_turn(&mut self, now: SimTime) {
        self.turn = now.after(LINE_REPEAT_S * f64::from(1_u32 << self.doublings));
        self.doublings = (self.doublings + 1).min(MAX_DOUBLINGS);
        self.nearer = 0;
    }
}

/// The longest time between two repetitions, s.
fn slowest_s() -> f64 {
    LINE_REPEAT_S * f64::from(1_u32 << MAX_DOUBLINGS)
}

/// Of two lines of the same drones, the one with the greater version is said later. A drone that knows no line says so before it says any.
fn version(line: &Separator) -> (u16, u16, Option<u32>) {
    (line.incarnation, line.peer_incarnation, number(line))
}

/// The number of a line; `None` if its speaker says that it knows no line.
fn number(line: &Separator) -> Option<u32> {
    Some(line.number).filter(|&number| number != NO_LINE)
}

#[cfg(test)]
mod tests {
    use super::*;

    const REACH_M: f64 = 300.0;

    /// Line `number` of drone 0, meant for drone 9.
    fn line(number: u32) -> Separator {
        Separator { peer: DroneId(9), number, incarnation: 1, peer_incarnation: 1, ..Separator::default() }
    }

    /// What drone 9 says to drone 0.
    fn answer(number: u32) -> Separator {
        Separator { peer: DroneId(0), ..line(number) }
    }

    fn at(tenths: u32) -> SimTime {
        SimTime::from_secs(0.1 * f64::from(tenths))
    }

    /// The two drones are `pair_m` apart. This drone is `own_m` from the one that a line is meant for.
    fn distances(said_m: f64, own_m: f64, pair_m: f64) -> Distances {
        Distances { said_m, own_m, pair_m, reach_m: REACH_M }
    }

    /// The tenths of a second in which a drone passes lines on while `hear` is called in each.
    fn said(mut hear: impl FnMut(u32, &mut RelayedLines)) -> Vec<u32> {
        let mut lines = RelayedLines::default();
        let says = |tenth: &u32| {
            hear(*tenth, &mut lines);
            lines.speak(at(*tenth)).is_some()
        };
        (0..200).filter(says).collect()
    }

    #[test]
    fn a_nearer_drone_passes_a_line_on_at_once_and_then_more_and_more_rarely() {
        let far = distances(600.0, 400.0, 600.0);
        let said = said(|tenth, lines| {
            if tenth % 5 == 0 {
                lines.hear(at(tenth), DroneId(0), &line(2), true, far);
            }
        });
        assert!(said[0] <= 5 && (4..=6).contains(&said.len()), "{said:?}");
        assert!(said.windows(3).all(|three| three[2] - three[1] >= three[1] - three[0]), "{said:?}");
    }

    #[test]
    fn the_message_names_the_drone_whose_lines_it_has() {
        let mut lines = RelayedLines::default();
        for peer in [7, 8, 9] {
            let line = Separator { peer: DroneId(peer), ..line(2) };
            lines.hear(at(0), DroneId(0), &line, true, distances(600.0, 400.0, 600.0));
            lines.hear(at(1), DroneId(4), &line, true, distances(600.0, 400.0, 600.0));
        }
        let said = [lines.speak(at(10)), lines.speak(at(10)), lines.speak(at(10))];
        let of = |said: &Option<Separation>| said.map(|said| (said.drone(DroneId(2)).0, said.count));
        assert_eq!(said.each_ref().map(of), [Some((0, 3)), Some((4, 3)), None]);
        assert_eq!(said[0].map(|said| said.separators[2].peer), Some(DroneId(9)));
    }

    #[test]
    fn a_drone_that_is_farther_away_passes_nothing_on() {
        let away = distances(600.0, 700.0, 600.0);
        let said = said(|tenth, lines| {
            if tenth % 5 == 0 {
                lines.hear(at(tenth), DroneId(0), &line(2), true, away);
            }
        });
        assert!(said.is_empty(), "its speaker is nearer: {said:?}");
    }

    #[test]
    fn a_line_that_two_nearer_drones_have_said_is_not_said_in_that_turn() {
        let mut lines = RelayedLines::default();
        lines.hear(at(0), DroneId(0), &line(2), true, distances(600.0, 400.0, 600.0));
        for _ in 0..LINE_REDUNDANCY {
            lines.hear(at(1), DroneId(0), &line(2), false, distances(300.0, 400.0, 600.0));
        }
        assert_eq!(lines.speak(at(10)), None);
        assert!(lines.speak(at(30)).is_some(), "nobody said it in the next turn");
    }

    #[test]
    fn lines_that_change_all_the_time_are_passed_on_and_the_newest_is() {
        let mut newest = 0;
        let mut lines = RelayedLines::default();
        for tenth in 0..20 {
            newest = 2 * tenth;
            lines.hear(at(tenth), DroneId(0), &line(newest), true, distances(600.0, 400.0, 600.0));
            lines.hear(at(tenth), DroneId(0), &line(0), true, distances(600.0, 400.0, 600.0));
            if let Some(said) = lines.speak(at(tenth)) {
                assert_eq!(said.separators[0].number, newest);
                return;
            }
        }
        panic!("line {newest} was not passed on");
    }

    #[test]
    fn drones_that_hear_each_other_are_left_alone() {
        let near = distances(100.0, 50.0, 100.0);
        let said = said(|tenth, lines| {
            if tenth % 5 == 0 {
                lines.hear(at(tenth), DroneId(0), &line(2 * tenth), true, near);
                lines.hear(at(tenth + 1), DroneId(9), &answer(2 * tenth), true, near);
            }
        });
        assert!(said.len() <= 4, "only answers, and rarely: {said:?}");
    }

    #[test]
    fn lines_without_an_answer_are_passed_on_although_the_drones_are_near() {
        let near = distances(100.0, 50.0, 100.0);
        let said = said(|tenth, lines| {
            if tenth % 5 == 0 {
                lines.hear(at(tenth), DroneId(0), &line(2), true, near);
            }
        });
        assert!((2..=4).contains(&said.len()), "{said:?}");
    }

    #[test]
    fn the_word_that_there_is_no_line_is_passed_on_until_there_is_one() {
        let mut lines = RelayedLines::default();
        let far = distances(600.0, 400.0, 600.0);
        let mut said = |tenth: u32, heard: &[(u32, Separator)]| {
            for (speaker, line) in heard {
                lines.hear(at(tenth), DroneId(*speaker), line, true, far);
            }
            lines.speak(at(tenth)).map(|said| said.separators[0].number)
        };
        assert_eq!(said(0, &[(0, line(NO_LINE)), (9, answer(NO_LINE))]), None);
        assert_eq!(said(10, &[]), Some(NO_LINE), "that the other drone knows none either is no answer");
        assert_eq!(said(20, &[(0, line(0))]), Some(0));
        assert_ne!(said(30, &[(0, line(NO_LINE))]), Some(NO_LINE), "it is older than the line");
    }

    #[test]
    fn a_line_that_nobody_says_any_more_is_forgotten() {
        let mut lines = RelayedLines::default();
        lines.hear(at(0), DroneId(0), &line(2), true, distances(600.0, 400.0, 600.0));
        assert_eq!(lines.speak(at(400)), None);
        assert!(lines.heard.is_empty());
    }

    #[test]
    fn memory_is_bounded() {
        let mut lines = RelayedLines::default();
        for number in 0..2 * MAX_LINES as u32 {
            let (speaker, peer) = (DroneId(number / 50), DroneId(1000 + number % 50));
            let line = Separator { peer, ..line(2) };
            lines.hear(at(0), speaker, &line, true, distances(600.0, 400.0, 600.0));
        }
        assert_eq!(lines.heard.len(), MAX_LINES);
    }
}
