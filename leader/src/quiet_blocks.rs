//! Until when certainly no peer is silent for too long, without a look at each.

use skein_protocol::SimTime;
use std::fmt;
use std::ops::Range;

/// Number of neighbouring peers in a block. Chosen by hand: a look at a block costs as much as a few beacons.
const BLOCK: usize = 16;

/// For each block of peers, a moment until which none of them is silent for too long.
#[derive(Clone, Default)]
pub(crate) struct QuietBlocks {
    blocks: Vec<SimTime>,
    /// The least of all of them, or less; the default of no blocks is not looked at.
    least: SimTime,
}

impl QuietBlocks {
    /// Whether certainly no peer is silent for too long.
    #[inline]
    pub(crate) fn are_quiet(&self, now: SimTime) -> bool {
        now <= self.least || self.blocks.is_empty()
    }

    /// Whether the peer at this index is certainly not silent for too long.
    #[inline]
    pub(crate) fn is_quiet(&self, index: usize, now: SimTime) -> bool {
        self.blocks.get(index / BLOCK).is_some_and(|until| now <= *until)
    }

    /// Notes that the peer at this index is not silent for too long until then.
    #[inline]
    pub(crate) fn note(&mut self, index: usize, until: SimTime) {
        if let Some(block) = self.blocks.get_mut(index / BLOCK) {
            *block = (*block).min(until);
        }
        self.least = self.least.min(until);
    }

    /// Adds a peer at this index. The index of those from there on rises by one. `count`: number of peers, with this one.
    pub(crate) fn insert(&mut self, index: usize, until: SimTime, count: usize) {
        if self.blocks.is_empty() {
            self.least = SimTime::MAX;
        }
        self.blocks.resize(count.div_ceil(BLOCK), SimTime::MAX);
        // The last peer of each block is now the first one of the next block.
        for block in (index / BLOCK + 1..self.blocks.len()).rev() {
            self.blocks[block] = self.blocks[block].min(self.blocks[block - 1]);
        }
        self.note(index, until);
    }

    /// Removes the peer at this index. The index of those behind it falls by one. `count`: number of peers, without this one.
    pub(crate) fn remove(&mut self, index: usize, count: usize) {
        // The first peer of each block is now the last one of the block before.
        for block in index / BLOCK + 1..self.blocks.len() {
            self.blocks[block - 1] = self.blocks[block - 1].min(self.blocks[block]);
        }
        self.blocks.truncate(count.div_ceil(BLOCK));
    }

    /// The indices of the peers that may be silent for too long, ascending. `count`: number of peers.
    pub(crate) fn suspects(&self, now: SimTime, count: usize) -> impl Iterator<Item = usize> {
        let some = if self.are_quiet(now) { 0 } else { self.blocks.len() };
        let suspects = self.blocks.iter().enumerate().take(some).filter(move |(_, until)| now > **until);
        suspects.flat_map(move |(block, _)| range(block, count))
    }

    /// Finds out anew for the blocks whose time ends before `next`, when this is called again. `until`: a moment until which the peer at an
    /// index is not silent for too long. `count`: number of peers.
    pub(crate) fn look(&mut self, next: SimTime, count: usize, until: impl Fn(usize) -> SimTime) {
        for (block, quiet) in self.blocks.iter_mut().enumerate().filter(|(_, quiet)| **quiet < next) {
            *quiet = range(block, count).map(&until).min().unwrap_or(SimTime::MAX);
        }
        self.least = self.blocks.iter().copied().min().unwrap_or_default();
    }
}

/// The indices of the peers of a block.
fn range(block: usize, count: usize) -> Range<usize> {
    block * BLOCK..count.min((block + 1) * BLOCK)
}

/// It says nothing about the peers that they do not say themselves, so it is not shown: the model check compares states by what is shown.
impl fmt::Debug for QuietBlocks {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("QuietBlocks")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_peer_is_missed_whatever_comes_and_goes() {
        let (mut peers, mut blocks) = (Vec::<SimTime>::new(), QuietBlocks::default());
        let (mut quiet, mut looks, mut seed) = (0, 0, 1_u64);
        let mut draw = |below: usize| {
            seed = seed.wrapping_mul(0x5851_f42d_4c95_7f2d).wrapping_add(1);
            (seed >> 33) as usize % below
        };
        for step in 0..20_000 {
            let now = SimTime(step);
            let until = SimTime(step + 200 + draw(800) as i64);
            let index = draw(peers.len() + 1);
            match draw(1000) {
                0..10 if peers.len() < 100 => {
                    peers.insert(index, until);
                    blocks.insert(index, until, peers.len());
                }
                10..15 if index < peers.len() => {
                    peers.remove(index);
                    blocks.remove(index, peers.len());
                }
                15..600 if index < peers.len() => {
                    peers[index] = until;
                    blocks.note(index, until);
                }
                600..650 => blocks.look(SimTime(step + 20), peers.len(), |index| peers[index]),
                _ => {}
            }
            let silent = |index: &usize| peers[*index] < now;
            let expected: Vec<usize> = (0..peers.len()).filter(silent).collect();
            assert_eq!(blocks.suspects(now, peers.len()).filter(silent).collect::<Vec<_>>(), expected, "step {step}");
            assert!(expected.iter().all(|index| !blocks.is_quiet(*index, now)));
            assert!(expected.is_empty() || !blocks.are_quiet(now));
            quiet += (0..peers.len()).filter(|index| blocks.is_quiet(*index, now)).count();
            looks += (0..peers.len()).filter(|index| !silent(index)).count();
        }
        // Most of the others need no look.
        assert!(quiet * 10 > looks * 3 && quiet < looks, "{quiet} of {looks}");
    }
}
