//! The lines between this drone and one other, and the rules by which they change (docs/safety.md, "By word alone").

use super::separating_line::{SeparatingLine, Side};
use skein_protocol::{SimTime, Vec2};

/// Greatest number of lines that do not imply each other. A drone that is bound to that many makes no further line for the time being.
pub const MAX_LINES: usize = 6;

/// In place of the number of a line, if a drone says that it knows no line.
pub const NO_LINE: u32 = u32::MAX;

/// A line with its number.
#[derive(Clone, Copy, Debug, PartialEq, Hash)]
pub struct NumberedLine {
    /// Its number among the lines of the two drones.
    pub number: u32,
    /// The line.
    pub line: SeparatingLine,
}

/// What a drone says of one other drone: a line to which it is bound.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Statement {
    /// The line.
    pub bound_to: NumberedLine,
    /// Incarnation of the drone that says it, from 1.
    pub incarnation: u32,
    /// Incarnation of the drone that it is said to, from 1.
    pub addressed: u32,
}

/// The lines between this drone and one other to which this drone is bound. The two drones are always bound to at least one
/// common line.
#[derive(Clone, Debug, PartialEq, Hash)]
pub struct SeparationPair {
    side: Side,
    /// This drone's incarnation.
    incarnation: u32,
    /// The incarnation of the other drone that this drone listens to, and addresses.
    peer_incarnation: u32,
    /// Lines to which this drone is bound, by ascending numbers.
    bound: Vec<NumberedLine>,
    /// Numbers of further lines to which it is bound. A line in `bound` with a higher number implies each of them.
    implied: Vec<u32>,
    /// The highest number seen.
    newest: u32,
    /// Whether this drone is bound to a line to which it has heard the other one to be bound. The two have a common line then, and from
    /// then on.
    agreed: bool,
}

impl SeparationPair {
    /// A drone on `side` in its first incarnation. It is bound to `first`, which both drones know from the start.
    #[must_use]
    pub fn new(side: Side, first: SeparatingLine) -> Self {
        let bound = vec![NumberedLine { number: 0, line: first }];
        Self { side, incarnation: 1, peer_incarnation: 1, bound, implied: Vec::new(), newest: 0, agreed: true }
    }

    /// A drone on `side` that has been restarted and knows no line. It hovers until the two [agree](Self::has_agreed).
    #[must_use]
    pub fn restarted(side: Side, incarnation: u32) -> Self {
        let (bound, implied) = (Vec::new(), Vec::new());
        Self { side, incarnation, peer_incarnation: 1, bound, implied, newest: 0, agreed: false }
    }

    /// The drone's side.
    #[must_use]
    pub fn side(&self) -> Side {
        self.side
    }

    /// The lines that bind the drone; none if it knows no line.
    #[must_use]
    pub fn lines(&self) -> &[NumberedLine] {
        &self.bound
    }

    /// Whether this drone knows that the two have a common line.
    #[must_use]
    pub fn has_agreed(&self) -> bool {
        self.agreed
    }

    /// What a drone says that knows no line: the other one may make a first line if it knows none either. `None` if it knows one.
    #[must_use]
    pub fn lacks_line(&self) -> Option<Statement> {
        let nowhere = SeparatingLine::resting(SimTime::ZERO, Vec2::x(), 0.0);
        self.bound.is_empty().then(|| self.says(NumberedLine { number: NO_LINE, line: nowhere }))
    }

    /// Whether this drone may make a first line, having heard this: neither drone knows a line of the other's present incarnation.
    #[must_use]
    pub fn may_open(&self, heard: &Statement) -> bool {
        heard.bound_to.number == NO_LINE && self.bound.is_empty() && self.counts(heard)
    }

    /// What the drone says: the line with the highest number to which it is bound.
    #[must_use]
    pub fn statement(&self) -> Option<Statement> {
        self.bound.last().map(|&line| self.says(line))
    }

    /// What a drone that can make no further line says in turn with [`Self::statement`]: the newest line of the other drone's making to
    /// which it is bound. It frees the other drone from older lines. `None` if it can make further lines, or has no such line.
    #[must_use]
    pub fn answer(&self) -> Option<Statement> {
        let theirs = |line: &&NumberedLine| line.number % 2 != self.parity();
        let full = self.bound.len() >= MAX_LINES;
        self.bound.iter().rev().find(theirs).filter(|_| full).map(|&line| self.says(line))
    }

    fn says(&self, bound_to: NumberedLine) -> Statement {
        Statement { bound_to, incarnation: self.incarnation, addressed: self.peer_incarnation }
    }

    /// What a drone says whose other drone was restarted: each line to which it is bound in turn. The other one keeps to the oldest of them,
    /// and maybe to no newer one. `turn`: how often it has spoken.
    #[must_use]
    pub fn statement_in_turn(&self, turn: usize) -> Option<Statement> {
        let index = turn.checked_rem(self.bound.len())?;
        self.bound.get(index).map(|&line| self.says(line))
    }

    /// Hears which incarnation of the other drone speaks. From a new one on, what an older one said no longer counts. Returns whether it is
    /// a new one.
    pub fn hear_incarnation(&mut self, incarnation: u32) -> bool {
        let is_new = incarnation > self.peer_incarnation;
        self.peer_incarnation = self.peer_incarnation.max(incarnation);
        is_new
    }

    /// Whether a statement counts: it is said by the incarnation that this drone listens to, and to this drone's incarnation.
    #[must_use]
    pub fn counts(&self, heard: &Statement) -> bool {
        heard.incarnation == self.peer_incarnation && heard.addressed == self.incarnation
    }

    /// Hears that the other drone is, or was, bound to a line. `keeps`: whether this drone's path, with the commands that it has
    /// given and full braking after them, keeps to the line. The drone binds itself to the line if it can and if that frees it from an
    /// older line. It is then free of all lines with lower numbers.
    pub fn hear(&mut self, heard: &Statement, keeps: impl FnOnce(&SeparatingLine) -> bool) {
        if !self.counts(heard) || heard.bound_to.number == NO_LINE {
            return;
        }
        let heard = heard.bound_to;
        self.newest = self.newest.max(heard.number);
        if self.is_bound_to(heard.number) {
            self.agreed = true;
            self.forget_below(heard.number);
            return;
        }
        let useful = self.bound.first().is_none_or(|oldest| oldest.number < heard.number);
        if useful && keeps(&heard.line) {
            let place = self.bound.partition_point(|known| known.number < heard.number);
            self.bound.insert(place, heard);
            self.agreed = true;
            self.forget_below(heard.number);
        }
    }

    /// Binds the drone to a new line, to which its path keeps. Returns whether it did: a drone that is bound to as many lines as `most`
    /// makes no further one. The other drone may not have heard of these lines, or may be unable to keep to them. If each of the two is
    /// bound to such lines only, no line of theirs ever changes until one of them makes a further one: then `most` has no limit.
    pub fn propose(&mut self, line: SeparatingLine, now: SimTime, most: usize) -> bool {
        let Some(number) = self.next_number() else { return false };
        if self.bound.is_empty() {
            return false;
        }
        let (side, bound) = (self.side, self.bound.iter());
        if bound.filter(|known| !line.implies(&known.line, side, now)).count() >= most {
            return false;
        }
        let implied = &mut self.implied;
        self.bound.retain(|known| {
            let keep = !line.implies(&known.line, side, now);
            if !keep {
                implied.push(known.number);
            }
            keep
        });
        self.bound.push(NumberedLine { number, line });
        self.newest = number;
        true
    }

    /// Binds a drone that has no line to its first one, to which its path keeps. Returns whether it did.
    pub fn open(&mut self, line: SeparatingLine) -> bool {
        let Some(number) = self.next_number().filter(|_| self.bound.is_empty()) else { return false };
        self.bound.push(NumberedLine { number, line });
        self.newest = number;
        true
    }

    /// Drones in front use even numbers, and drones at the back odd ones.
    fn parity(&self) -> u32 {
        u32::from(self.side == Side::Back)
    }

    /// The next number that no drone has used.
    fn next_number(&self) -> Option<u32> {
        let next = self.newest.checked_add(1)?;
        let next = if next % 2 == self.parity() { next } else { next.checked_add(1)? };
        (next != NO_LINE).then_some(next)
    }

    /// Whether the drone is bound to the line with this number.
    #[must_use]
    pub fn is_bound_to(&self, number: u32) -> bool {
        self.bound.iter().any(|known| known.number == number) || self.implied.contains(&number)
    }

    fn forget_below(&mut self, number: u32) {
        self.bound.retain(|known| known.number >= number);
        self.implied.retain(|&known| known >= number);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOW: SimTime = SimTime::ZERO;

    fn line(stop_m: f64) -> SeparatingLine {
        SeparatingLine::resting(NOW, Vec2::x(), stop_m)
    }

    fn numbers(pair: &SeparationPair) -> Vec<u32> {
        pair.lines().iter().map(|known| known.number).collect()
    }

    #[test]
    fn a_drone_is_bound_to_its_own_line_and_the_old_one_until_the_other_is_bound_to_the_new_one() {
        let (mut front, mut back) =
            (SeparationPair::new(Side::Front, line(0.0)), SeparationPair::new(Side::Back, line(0.0)));
        assert!(front.propose(line(-5.0), NOW, MAX_LINES), "it asks for room");
        assert_eq!(numbers(&front), [0, 2]);
        back.hear(&front.statement().unwrap(), |_| false);
        assert_eq!(numbers(&back), [0], "its path does not keep to the line");
        back.hear(&front.statement().unwrap(), |_| true);
        assert_eq!(numbers(&back), [2]);
        front.hear(&back.statement().unwrap(), |_| true);
        assert_eq!(numbers(&front), [2]);
    }

    #[test]
    fn a_line_that_gives_room_needs_no_answer() {
        let (mut front, mut back) =
            (SeparationPair::new(Side::Front, line(0.0)), SeparationPair::new(Side::Back, line(0.0)));
        for step in 1..=20 {
            assert!(front.propose(line(f64::from(step)), NOW, MAX_LINES));
            assert_eq!(front.lines().len(), 1);
        }
        back.hear(&front.statement().unwrap(), |_| true);
        assert_eq!(numbers(&back), [40]);
    }

    #[test]
    fn two_lines_at_the_same_time_both_bind_until_one_is_superseded() {
        let (mut front, mut back) =
            (SeparationPair::new(Side::Front, line(0.0)), SeparationPair::new(Side::Back, line(0.0)));
        assert!(front.propose(line(-2.0), NOW, MAX_LINES) && back.propose(line(2.0), NOW, MAX_LINES));
        let (said, answered) = (front.statement().unwrap(), back.statement().unwrap());
        front.hear(&answered, |_| true);
        back.hear(&said, |_| true);
        assert_eq!((numbers(&front), numbers(&back)), (vec![1, 2], vec![2]));
        front.hear(&back.statement().unwrap(), |_| true);
        assert_eq!(numbers(&front), [2]);
    }

    /// Each drone is bound to lines to which the other one's path does not keep, and has heard only of the newest of them.
    #[test]
    fn two_drones_that_can_make_no_further_line_free_each_other() {
        let start = || (SeparationPair::new(Side::Front, line(0.0)), SeparationPair::new(Side::Back, line(0.0)));
        let (mut front, mut back) = start();
        assert!(back.propose(line(1.0), NOW, MAX_LINES));
        front.hear(&back.statement().unwrap(), |_| true);
        assert_eq!(numbers(&front), [1]);
        while front.propose(line(-f64::from(front.newest)), NOW, MAX_LINES) {}
        while back.propose(line(f64::from(back.newest) + 2.0), NOW, MAX_LINES) {}
        assert_eq!((front.lines().len(), back.lines().len()), (MAX_LINES, MAX_LINES));
        back.hear(&front.statement().unwrap(), |_| false);
        front.hear(&back.statement().unwrap(), |_| false);
        assert!(
            !front.propose(line(-50.0), NOW, MAX_LINES) && !back.propose(line(50.0), NOW, MAX_LINES),
            "neither can move"
        );
        back.hear(&front.answer().unwrap(), |_| false);
        assert_eq!(numbers(&back)[0], 1, "line 0 is over");
        assert!(back.propose(line(0.5), NOW, MAX_LINES) && back.answer().is_none());
        front.hear(&back.statement().unwrap(), |_| true);
        back.hear(&front.answer().or(front.statement()).unwrap(), |_| false);
        assert_eq!(numbers(&back).len(), 1, "both are bound to the newest line: {:?}", numbers(&back));
    }

    /// Each drone is bound to lines of its own making only, besides the first one, and the other one cannot keep to any of them.
    #[test]
    fn a_further_line_frees_two_drones_that_have_no_answer_for_each_other() {
        let (mut front, mut back) =
            (SeparationPair::new(Side::Front, line(0.0)), SeparationPair::new(Side::Back, line(0.0)));
        while front.propose(line(-f64::from(front.newest) - 1.0), NOW, MAX_LINES) {}
        while back.propose(line(f64::from(back.newest) + 1.0), NOW, MAX_LINES) {}
        for _ in 0..2 {
            back.hear(&front.answer().or(front.statement()).unwrap(), |_| false);
            front.hear(&back.answer().or(back.statement()).unwrap(), |_| false);
        }
        assert_eq!((front.lines().len(), back.lines().len()), (MAX_LINES, MAX_LINES));
        assert!(!front.propose(line(-20.0), NOW, MAX_LINES) && front.propose(line(-20.0), NOW, usize::MAX));
        back.hear(&front.statement().unwrap(), |_| true);
        front.hear(&back.statement().unwrap(), |_| true);
        assert_eq!((front.lines().len(), back.lines().len()), (1, 1));
        assert_eq!(numbers(&front), numbers(&back));
    }

    #[test]
    fn a_drone_makes_a_bounded_number_of_lines() {
        let mut front = SeparationPair::new(Side::Front, line(0.0));
        let made = (1..50).filter(|step| front.propose(line(-f64::from(*step)), NOW, MAX_LINES)).count();
        assert_eq!(made, MAX_LINES - 1);
        let mut restarted = SeparationPair::restarted(Side::Front, 2);
        assert!(!restarted.propose(line(0.0), NOW, MAX_LINES));
        let bound_to = NumberedLine { number: NO_LINE - 1, line: line(0.0) };
        restarted.hear(&Statement { bound_to, incarnation: 1, addressed: 1 }, |_| true);
        assert!(restarted.lines().is_empty(), "it was said to the incarnation before");
        restarted.hear(&Statement { bound_to, incarnation: 1, addressed: 2 }, |_| true);
        assert_eq!(restarted.lines().len(), 1);
        assert!(!restarted.propose(line(0.0), NOW, MAX_LINES), "there are no more numbers");
    }
}
