//! Peers that are too far away to matter for a while. A drone hears all others, and looks only at those that may be near.

use skein_leader::changes::{BLOCK, Changes};
use skein_protocol::{SimTime, Vec2};
use std::ops::Range;

/// More than positions lose by rounding, m.
const ROUNDING_M: f64 = 1e-6;

/// When the last look at a peer is out of date: when it was heard again, or when it may have come into reach.
#[derive(Clone, Copy, Debug)]
struct Look {
    stamp: SimTime,
    /// The peer is out of reach while [`DistantPeers::travelled_m`] is below this, m.
    until_m: f64,
}

/// What is remembered of a block of peers.
#[derive(Clone, Copy, Debug)]
struct LookAtBlock {
    /// The count of [`Changes`] at the last look.
    changes: u32,
    /// All peers of the block are out of reach while [`DistantPeers::travelled_m`] is below this, m.
    until_m: f64,
}

/// For each peer ever heard, whether it is certainly out of reach. A peer is taken to fly on with the velocity of its last
/// beacon.
#[derive(Clone, Debug, Default)]
pub(crate) struct DistantPeers {
    looks: Vec<Look>,
    blocks: Vec<LookAtBlock>,
    /// Greatest speed of a distant peer, m/s.
    speed_mps: f64,
    /// By how much a distance can have fallen since the start, m: what this drone flew, and what a peer flies at that speed.
    travelled_m: f64,
    /// Time and position (world frame, m) of the last call of [`Self::advance`].
    last: Option<(SimTime, Vec2)>,
}

impl DistantPeers {
    /// Takes this drone's time and position, world frame, m. Call once per tick.
    pub(crate) fn advance(&mut self, now: SimTime, position: Vec2) {
        if let Some((then, from)) = self.last.replace((now, position)) {
            self.travelled_m += (position - from).norm() + self.speed_mps * now.since(then).abs();
        }
    }

    /// Takes the time stamps of the peers' last beacons. Returns how many blocks of [`BLOCK`] peers there are.
    pub(crate) fn follow(&mut self, stamps: &[SimTime]) -> usize {
        if self.looks.len() != stamps.len() {
            let near = f64::NEG_INFINITY;
            self.looks.clear();
            self.looks.extend(stamps.iter().map(|&stamp| Look { stamp, until_m: near }));
            self.blocks.clear();
            self.blocks.resize(stamps.len().div_ceil(BLOCK), LookAtBlock { changes: 0, until_m: near });
        }
        self.blocks.len()
    }

    /// The indices of a block of peers; `None` if all of them are certainly out of reach. `stamps` are those of
    /// [`Self::follow`], and `changes` theirs. Call [`Self::close`] after the look.
    pub(crate) fn open(&mut self, block: usize, stamps: &[SimTime], changes: &Changes) -> Option<Range<usize>> {
        let first = block * BLOCK;
        let range = first..(first + BLOCK).min(self.looks.len());
        let look = self.blocks.get_mut(block)?;
        let count = changes.counts().get(block).copied().unwrap_or_default();
        if look.changes == count {
            return (self.travelled_m >= look.until_m).then_some(range);
        }
        look.changes = count;
        for (look, &stamp) in self.looks[range.clone()].iter_mut().zip(&stamps[range.clone()]) {
            if look.stamp != stamp {
                *look = Look { stamp, until_m: f64::NEG_INFINITY };
            }
        }
        Some(range)
    }

    /// Ends the look at a block.
    pub(crate) fn close(&mut self, block: usize) {
        let first = block * BLOCK;
        let looks = &self.looks[first..(first + BLOCK).min(self.looks.len())];
        self.blocks[block].until_m = looks.iter().map(|look| look.until_m).fold(f64::INFINITY, f64::min);
    }

    /// Whether the peer at this index is certainly out of reach.
    pub(crate) fn is_out_of_reach(&self, index: usize) -> bool {
        self.looks.get(index).is_some_and(|look| self.travelled_m < look.until_m)
    }

    /// Notes that the peer at this index is out of reach by this much, m, and flies at this speed, m/s.
    pub(crate) fn note(&mut self, index: usize, beyond_m: f64, speed_mps: f64) {
        self.speed_mps = self.speed_mps.max(speed_mps);
        if let Some(look) = self.looks.get_mut(index) {
            look.until_m = self.travelled_m + beyond_m - ROUNDING_M;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Distances of peers that fly straight on, each heard again every tenth tick. They are in two blocks.
    #[test]
    fn no_peer_comes_into_reach_unseen() {
        let reach_m = 50.0;
        let starts = [(400.0, -30.0), (90.0, 10.0), (60.0, 0.0), (-300.0, 25.0)];
        let starts: Vec<(f64, f64)> =
            starts.into_iter().chain((0..6).map(|i| (700.0 + 50.0 * f64::from(i), -9.0))).collect();
        let mut distant = DistantPeers::default();
        let mut stamps = [SimTime::ZERO; 10];
        let mut changes = Changes::default();
        changes.note_from(0, 10);
        let mut looked = 0;
        for tick in 0..2000 {
            let now = SimTime::from_secs(0.02 * f64::from(tick));
            let mine = Vec2::new(5.0 * now.since(SimTime::ZERO), (f64::from(tick) * 0.01).sin() * 20.0);
            distant.advance(now, mine);
            for (index, stamp) in stamps.iter_mut().enumerate() {
                if (tick as usize + index).is_multiple_of(10) {
                    *stamp = now;
                    changes.note(index);
                }
            }
            assert_eq!(distant.follow(&stamps), 2);
            for block in 0..2 {
                let open = distant.open(block, &stamps, &changes);
                let is_open = open.is_some();
                for index in open.unwrap_or(block * BLOCK..(block * BLOCK + BLOCK).min(starts.len())) {
                    let (x, v) = starts[index];
                    let away_m = (Vec2::new(x + v * now.since(SimTime::ZERO), 0.0) - mine).norm();
                    if !is_open || distant.is_out_of_reach(index) {
                        assert!(away_m > reach_m, "peer {index} at {away_m} m in tick {tick}");
                    } else {
                        looked += 1;
                        if away_m > reach_m {
                            distant.note(index, away_m - reach_m, v.abs());
                        }
                    }
                }
                if is_open {
                    distant.close(block);
                }
            }
        }
        assert!(looked < 8000, "{looked} looks of 20 000");
    }

    #[test]
    fn peers_are_looked_at_anew_when_their_number_changes() {
        let mut distant = DistantPeers::default();
        distant.follow(&[SimTime::ZERO]);
        distant.note(0, 100.0, 0.0);
        assert!(distant.is_out_of_reach(0));
        distant.follow(&[SimTime::ZERO; 2]);
        assert!(!distant.is_out_of_reach(0) && !distant.is_out_of_reach(1));
    }
}
