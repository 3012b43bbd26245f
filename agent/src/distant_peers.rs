//! Peers that are too far away to matter for a while. A drone hears all others, and looks only at those that may be near.

use skein_protocol::{SimTime, Vec2};

/// More than positions lose by rounding, m.
const ROUNDING_M: f64 = 1e-6;

/// When the last look at a peer is out of date: when it was heard again, or when it may have come into reach.
#[derive(Clone, Copy, Debug)]
struct Look {
    stamp: SimTime,
    /// The peer is out of reach while [`DistantPeers::travelled_m`] is below this, m.
    until_m: f64,
}

/// For each peer ever heard, whether it is certainly out of reach. A peer is taken to fly on with the velocity of its last
/// beacon.
#[derive(Clone, Debug, Default)]
pub(crate) struct DistantPeers {
    looks: Vec<Look>,
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

    /// Takes the time stamps of the peers' last beacons. Returns how many peers there are.
    pub(crate) fn follow(&mut self, stamps: &[SimTime]) -> usize {
        if self.looks.len() != stamps.len() {
            self.looks.clear();
            self.looks.extend(stamps.iter().map(|&stamp| Look { stamp, until_m: f64::NEG_INFINITY }));
        }
        for (look, &stamp) in self.looks.iter_mut().zip(stamps) {
            if look.stamp != stamp {
                *look = Look { stamp, until_m: f64::NEG_INFINITY };
            }
        }
        stamps.len()
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

    /// Distances of peers that fly straight on, each heard again every tenth tick.
    #[test]
    fn no_peer_comes_into_reach_unseen() {
        let reach_m = 50.0;
        let starts = [(400.0, -30.0), (90.0, 10.0), (60.0, 0.0), (-300.0, 25.0)];
        let mut distant = DistantPeers::default();
        let mut stamps = [SimTime::ZERO; 4];
        let mut looked = 0;
        for tick in 0..2000 {
            let now = SimTime::from_secs(0.02 * f64::from(tick));
            let mine = Vec2::new(5.0 * now.since(SimTime::ZERO), (f64::from(tick) * 0.01).sin() * 20.0);
            distant.advance(now, mine);
            for (index, stamp) in stamps.iter_mut().enumerate() {
                if (tick as usize + index).is_multiple_of(10) {
                    *stamp = now;
                }
            }
            assert_eq!(distant.follow(&stamps), 4);
            for (index, (x, v)) in starts.into_iter().enumerate() {
                let away_m = (Vec2::new(x + v * now.since(SimTime::ZERO), 0.0) - mine).norm();
                if distant.is_out_of_reach(index) {
                    assert!(away_m > reach_m, "peer {index} at {away_m} m in tick {tick}");
                } else {
                    looked += 1;
                    if away_m > reach_m {
                        distant.note(index, away_m - reach_m, v.abs());
                    }
                }
            }
        }
        assert!(looked < 4000, "{looked} looks of 8000");
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
