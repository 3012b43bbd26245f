//! Peers that are too far away to matter for a while. A drone hears all others, and looks only at those that may be near.

use skein_leader::changes::Changes;
use skein_protocol::{SimTime, Vec2, prefetch};

/// More than positions lose by rounding, m.
const ROUNDING_M: f64 = 1e-6;

/// Number of neighbouring peers whose least distance is known.
const BLOCK: usize = 8;

/// [`DistantPeers::until_m`] of a peer that may be within reach.
const NEAR: f32 = f32::NEG_INFINITY;

/// A peer that is out of reach.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Distant {
    /// By how much it is out of reach, m.
    pub(crate) beyond_m: f64,
    /// How fast it flies, m/s.
    pub(crate) speed_mps: f64,
}

/// Which of the peers ever heard may be within reach. A peer is taken to fly on with the velocity of its last beacon. `T`: what is kept of those
/// that may be within reach.
#[derive(Clone, Debug)]
pub(crate) struct DistantPeers<T> {
    /// Each peer is out of reach while [`Self::travelled_m`] is below this, m. A drone of a large swarm keeps a thousand of these, so they are
    /// small.
    until_m: Vec<f32>,
    /// The least of each [`BLOCK`] of peers, or less, without those that may be within reach, m.
    blocks_m: Vec<f64>,
    /// The least of all blocks, or less, m.
    least_m: f64,
    /// The indices of the peers that were within reach, ascending.
    near: Vec<u32>,
    /// What is kept of each of them, in the same order. Each tick reads it, so it is all in one place.
    copies: Vec<T>,
    /// The indices of further peers that may be within reach.
    suspects: Vec<u32>,
    /// Number of changes of the peers at the last look.
    seen: usize,
    /// Greatest speed of a distant peer, m/s.
    speed_mps: f64,
    /// By how much a distance can have fallen since the start, m: what this drone flew, and what a peer flies at that speed.
    travelled_m: f64,
    /// Time and position (world frame, m) of the last call of [`Self::advance`].
    last: Option<(SimTime, Vec2)>,
}

impl<T> Default for DistantPeers<T> {
    fn default() -> Self {
        Self {
            until_m: Vec::new(),
            blocks_m: Vec::new(),
            least_m: 0.0,
            near: Vec::new(),
            copies: Vec::new(),
            suspects: Vec::new(),
            seen: 0,
            speed_mps: 0.0,
            travelled_m: 0.0,
            last: None,
        }
    }
}

impl<T> DistantPeers<T> {
    /// Takes this drone's time and position, world frame, m. Call once per tick.
    pub(crate) fn advance(&mut self, now: SimTime, position: Vec2) {
        if let Some((then, from)) = self.last.replace((now, position)) {
            self.travelled_m += (position - from).norm() + self.speed_mps * now.since(then).abs();
        }
    }

    /// Finds the peers that have come within reach. `count`: number of peers. `changes`: theirs. `distant`: whether the peer at
    /// an index is out of reach. `copy`: what is kept of it if it is not.
    pub(crate) fn look(
        &mut self,
        count: usize,
        changes: &Changes,
        distant: impl Fn(usize) -> Option<Distant>,
        copy: impl Fn(usize) -> T,
    ) {
        let mut all = 0..0;
        if !self.suspect_changed(count, changes, &copy) {
            self.forget(count);
            all = 0..count;
        } else if self.travelled_m >= self.least_m {
            self.suspect_near();
        }
        // One call of `distant` for both cases, because it is a part of this loop then.
        while let Some(index) = all.next().or_else(|| Some(self.suspects.pop()? as usize)) {
            self.sort_in(index, distant(index), &copy);
        }
    }

    /// Fetches what [`Self::look`] and [`Self::visit`] read into the cache. `changes`: those of the peers.
    pub(crate) fn warm(&self, changes: &Changes) {
        prefetch(self.near.as_slice());
        prefetch(self.copies.as_slice());
        prefetch(self.blocks_m.as_slice());
        let changed = changes.since(self.seen).into_iter().flatten();
        changed.filter_map(|index| self.until_m.get(index)).for_each(prefetch);
    }

    /// What is kept of the peers that were within reach.
    pub(crate) fn kept(&self) -> &[T] {
        &self.copies
    }

    /// Visits the peers within reach, by index, with what is kept of them. `visit` returns how far away one is that has left it.
    pub(crate) fn visit(&mut self, mut visit: impl FnMut(usize, &T) -> Option<Distant>) {
        let mut stay = 0;
        for place in 0..self.near.len() {
            let index = self.near[place];
            if let Some(distant) = visit(index as usize, &self.copies[place]) {
                self.note(index as usize, distant);
                continue;
            }
            if stay < place {
                self.near[stay] = index;
                self.copies.swap(stay, place);
            }
            stay += 1;
        }
        self.near.truncate(stay);
        self.copies.truncate(stay);
    }

    /// The peers that have changed may be within reach. Of those that were, what is kept is replaced. Returns whether it is known which have
    /// changed.
    fn suspect_changed(&mut self, count: usize, changes: &Changes, copy: impl Fn(usize) -> T) -> bool {
        let changed = changes.since(self.seen).filter(|_| self.until_m.len() == count);
        self.seen = changes.count();
        let Some(changed) = changed else { return false };
        for index in changed {
            if self.suspect(index) {
                continue;
            }
            if let Ok(place) = self.near.binary_search(&(index as u32)) {
                self.copies[place] = copy(index);
            }
        }
        true
    }

    /// Nothing is known of any of `count` peers.
    fn forget(&mut self, count: usize) {
        self.until_m.clear();
        self.until_m.resize(count, NEAR);
        self.blocks_m.clear();
        self.blocks_m.resize(count.div_ceil(BLOCK), f64::INFINITY);
        self.least_m = f64::INFINITY;
        self.suspects.clear();
        self.near.clear();
        self.copies.clear();
    }

    /// Notes where a peer is. `distant`: by how much it is out of reach, if it is.
    #[inline]
    fn sort_in(&mut self, index: usize, distant: Option<Distant>, copy: impl Fn(usize) -> T) {
        if let Some(distant) = distant {
            self.note(index, distant);
            return;
        }
        let place = self.near.partition_point(|near| (*near as usize) < index);
        self.near.insert(place, index as u32);
        self.copies.insert(place, copy(index));
    }

    /// The peers that can have come into reach may be within reach.
    fn suspect_near(&mut self) {
        self.least_m = f64::INFINITY;
        for block in 0..self.blocks_m.len() {
            if self.travelled_m >= self.blocks_m[block] {
                self.blocks_m[block] = self.suspect_near_of(block);
            }
            self.least_m = self.least_m.min(self.blocks_m[block]);
        }
    }

    /// The same for one block. Returns the least of the others, m.
    fn suspect_near_of(&mut self, block: usize) -> f64 {
        let mut least_m = f64::INFINITY;
        for index in block * BLOCK..(block * BLOCK + BLOCK).min(self.until_m.len()) {
            let until_m = f64::from(self.until_m[index]);
            if self.travelled_m < until_m {
                least_m = least_m.min(until_m);
            } else {
                self.suspect(index);
            }
        }
        least_m
    }

    /// Notes that a peer may be within reach. Returns whether it was taken to be out of reach.
    fn suspect(&mut self, index: usize) -> bool {
        let was_distant = std::mem::replace(&mut self.until_m[index], NEAR) != NEAR;
        if was_distant {
            self.suspects.push(index as u32);
        }
        was_distant
    }

    #[inline]
    fn note(&mut self, index: usize, distant: Distant) {
        self.speed_mps = self.speed_mps.max(distant.speed_mps);
        let until_m = at_most(self.travelled_m + distant.beyond_m - ROUNDING_M);
        self.until_m[index] = until_m;
        let block_m = &mut self.blocks_m[index / BLOCK];
        *block_m = block_m.min(until_m.into());
        self.least_m = self.least_m.min(until_m.into());
    }
}

/// A number that is not greater than this one.
fn at_most(number: f64) -> f32 {
    let near = number as f32;
    if f64::from(near) <= number { near } else { near.next_down() }
}

#[cfg(test)]
mod tests {
    use super::*;

    const REACH_M: f64 = 50.0;

    /// A peer at this distance and speed, m and m/s.
    fn distant(away_m: f64, speed_mps: f64) -> Option<Distant> {
        (away_m > REACH_M).then_some(Distant { beyond_m: away_m - REACH_M, speed_mps })
    }

    /// Distances of peers that fly straight on, each heard again every tenth tick. They are in two blocks.
    #[test]
    fn the_peers_within_reach_are_found_with_few_looks() {
        let starts = [(400.0, -30.0), (90.0, 10.0), (60.0, 0.0), (-300.0, 25.0)];
        let starts: Vec<(f64, f64)> =
            starts.into_iter().chain((0..6).map(|i| (700.0 + 50.0 * f64::from(i), -9.0))).collect();
        let mut peers = DistantPeers::default();
        let mut changes = Changes::default();
        changes.note_moved(10);
        let looked = std::cell::Cell::new(0);
        for tick in 0..2000 {
            let now = SimTime::from_secs(0.02 * f64::from(tick));
            let mine = Vec2::new(5.0 * now.since(SimTime::ZERO), (f64::from(tick) * 0.01).sin() * 20.0);
            let of = |index: usize| {
                let (x, v) = starts[index];
                distant((Vec2::new(x + v * now.since(SimTime::ZERO), 0.0) - mine).norm(), f64::abs(v))
            };
            peers.advance(now, mine);
            (0..10).filter(|index| (tick as usize + index).is_multiple_of(10)).for_each(|index| changes.note(index));
            let look = |index| {
                looked.set(looked.get() + 1);
                of(index)
            };
            peers.look(10, &changes, look, |_| tick);
            let mut near = Vec::new();
            peers.visit(|index, copied| {
                assert!(tick - copied < 10, "each was heard since");
                look(index).or_else(|| {
                    near.push(index);
                    None
                })
            });
            let expected: Vec<usize> = (0..10).filter(|&index| of(index).is_none()).collect();
            assert_eq!(near, expected, "tick {tick}");
        }
        assert!(looked.get() < 8000, "{} looks of 20 000", looked.get());
    }

    #[test]
    fn a_peer_that_changed_is_looked_at_and_all_are_when_they_moved() {
        let (mut peers, mut changes) = (DistantPeers::default(), Changes::default());
        let near = |peers: &mut DistantPeers<()>, away_m: f64| {
            let mut near = Vec::new();
            peers.visit(|index, ()| {
                near.push(index);
                distant(away_m, 0.0)
            });
            near
        };
        changes.note_moved(9);
        peers.look(9, &changes, |index| distant(if index < 4 { 0.0 } else { 150.0 }, 0.0), |_| ());
        assert_eq!(near(&mut peers, 150.0), [0, 1, 2, 3]);
        let nobody = |_| -> Option<Distant> { panic!("nothing has changed") };
        peers.look(9, &changes, nobody, |_| ());
        assert!(near(&mut peers, 0.0).is_empty());
        changes.note(8);
        changes.note(3);
        peers.look(9, &changes, |_| None, |_| ());
        assert_eq!(near(&mut peers, 0.0), [3, 8]);
        changes.note_moved(9);
        peers.look(9, &changes, |_| None, |_| ());
        assert_eq!(near(&mut peers, 0.0).len(), 9);
        peers.look(4, &changes, |_| None, |_| ());
        assert_eq!(near(&mut peers, 0.0).len(), 4);
    }
}
