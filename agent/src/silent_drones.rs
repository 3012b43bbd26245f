//! Drones that send nothing any more: they may be dead and hover where they were.

use crate::tuning::{HANGS_S, HANGS_UNHEARD_S, NEAR_RANGING, REDRAW_DRIFT, REDRAW_DRIFT_M, UNSEEN_S};
use skein_leader::peers::Peers;
use skein_leader::routes::Body;
use skein_leader::silent::Silent;
use skein_protocol::downlink::Senses;
use skein_protocol::{DroneId, SimTime, Vec2};
use std::collections::BTreeMap;

/// A silent drone that hangs still.
#[derive(Clone, Copy, Debug)]
struct Hanging {
    /// World frame, m.
    place: Vec2,
    /// Since when.
    since: SimTime,
    /// When it was ranged last.
    seen: SimTime,
}

/// What a drone assumes of silent drones.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SilenceParams {
    /// A drone that was not heard of for long has braked at this rate, m/s².
    pub(crate) braking_mps2: f64,
    /// A drone that flies slower hangs still, m/s.
    pub(crate) still_mps: f64,
    /// Distance up to which others are ranged, m.
    pub(crate) ranging_m: f64,
}

/// Where the silent drones are assumed to be.
#[derive(Clone, Debug)]
pub(crate) struct SilentDrones {
    params: SilenceParams,
    all: Vec<Silent>,
    /// Those that hung still when this drone ranged them last, and that it has not heard since.
    hanging: BTreeMap<DroneId, Hanging>,
    /// For how long a silent drone has to hang still until it counts as dead, s.
    patience_s: f64,
}

impl SilentDrones {
    /// No silent drone yet.
    pub(crate) fn new(params: SilenceParams) -> Self {
        Self { params, all: Vec::new(), hanging: BTreeMap::new(), patience_s: HANGS_S }
    }

    /// Finds the silent drones. A ranged one is where it is ranged, whether it was ever heard or not. Another one is where it has come to
    /// rest since its last beacon.
    pub(crate) fn update(&mut self, senses: &Senses<'_>, peers: &Peers) {
        if self.hanging.is_empty() && peers.are_all_living(senses.now) {
            self.all.clear();
            return;
        }
        for ranged in senses.neighbours {
            let place = senses.position() + ranged.position();
            let still = (senses.velocity() + ranged.velocity()).norm() < self.params.still_mps;
            let silent = !peers.is_living(ranged.drone, senses.now);
            if silent && still {
                let since = self.hanging.get(&ranged.drone).map_or(senses.now, |hanging| hanging.since);
                self.hanging.insert(ranged.drone, Hanging { place, since, seen: senses.now });
            } else {
                self.hanging.remove(&ranged.drone);
            }
        }
        self.forget(senses, peers);
        self.list(senses, peers);
    }

    /// Lists all silent drones: first those that are ranged.
    fn list(&mut self, senses: &Senses<'_>, peers: &Peers) {
        self.all.clear();
        let is_living = |drone| peers.is_living(drone, senses.now);
        for ranged in senses.neighbours.iter().filter(|ranged| !is_living(ranged.drone)) {
            let since = peers.last(ranged.drone).map_or(SimTime::ZERO, |beacon| beacon.stamp());
            let place = senses.position() + ranged.position();
            self.all.push(Silent { place, since, hangs: self.hangs(ranged.drone) });
        }
        for (drone, pose) in
            peers.silent(senses.now).filter(|(id, _)| !senses.neighbours.iter().any(|n| n.drone == *id))
        {
            let place = pose.stopped(self.params.braking_mps2);
            self.all.push(Silent { place, since: pose.stamp(), hangs: self.hangs(drone) });
        }
    }

    /// Whether a silent drone has hung still for long.
    fn hangs(&self, drone: DroneId) -> bool {
        self.hanging.get(&drone).is_some_and(|hanging| self.is_dead(hanging))
    }

    fn is_dead(&self, hanging: &Hanging) -> bool {
        hanging.seen.since(hanging.since) >= self.patience_s
    }

    /// Forgets the drones that are heard again, and those that are not where they hung.
    fn forget(&mut self, senses: &Senses<'_>, peers: &Peers) {
        if self.hanging.is_empty() {
            return;
        }
        // A drone that hears no other may be deaf itself. Then the others live, and move sooner or later.
        let hears = peers.living(senses.now).next().is_some();
        self.patience_s = if hears { HANGS_S } else { HANGS_UNHEARD_S };
        let near_m = NEAR_RANGING * self.params.ranging_m;
        let is_gone = |hanging: &Hanging| {
            senses.now.since(hanging.seen) > UNSEEN_S && (hanging.place - senses.position()).norm() < near_m
        };
        self.hanging.retain(|&drone, hanging| !peers.is_living(drone, senses.now) && !is_gone(hanging));
    }

    /// All of them.
    pub(crate) fn all(&self) -> &[Silent] {
        &self.all
    }

    /// Discs of this radius around them, for path planning.
    pub(crate) fn bodies(&self, radius_m: f64) -> Vec<Body> {
        discs(self.all.iter().map(|silent| silent.place), radius_m)
    }

    /// Discs of this radius around those that have hung still for long, for its own path. On a bad link, a drone that waits in a queue may be
    /// silent for a while.
    pub(crate) fn hanging(&self, radius_m: f64) -> Vec<Body> {
        let dead = self.hanging.values().filter(|hanging| self.is_dead(hanging));
        discs(dead.map(|hanging| hanging.place), radius_m)
    }
}

fn discs(centres_m: impl Iterator<Item = Vec2>, radius_m: f64) -> Vec<Body> {
    centres_m.map(|centre_m| Body { centre_m, radius_m }).collect()
}

/// Whether silent drones have come, gone, or drifted so far that paths have to be drawn again.
pub(crate) fn have_moved(old: &[Body], new: &[Body]) -> bool {
    let has_drifted = |(old, new): (&Body, &Body)| {
        (old.centre_m - new.centre_m).norm() > REDRAW_DRIFT_M.min(REDRAW_DRIFT * new.radius_m)
    };
    old.len() != new.len() || old.iter().zip(new).any(has_drifted)
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;
    use skein_protocol::downlink::SensedNeighbour;
    use skein_protocol::payload::Pose;

    const PARAMS: SilenceParams = SilenceParams { braking_mps2: 3.0, still_mps: 1.0, ranging_m: 60.0 };
    const DEAD: DroneId = DroneId(1);

    /// A drone that hears drone 2 all the time, unless it is deaf, and looks from its place along x at a dead drone at x = 0.
    struct Watch {
        silent: SilentDrones,
        peers: Peers,
        now_s: f64,
        hears: bool,
    }

    impl Watch {
        fn new() -> Self {
            Self { silent: SilentDrones::new(PARAMS), peers: Peers::new(3, 1.5), now_s: 0.0, hears: true }
        }

        fn hear(&mut self, id: DroneId) {
            let stamp = SimTime::from_secs(self.now_s);
            self.peers.hear(stamp, id, Pose { stamp, ..Pose::zeroed() });
        }

        /// Looks for so many seconds, and gives the number of dead drones that it flies round after that. `seen`: whether it ranges the
        /// dead one, which flies this fast, m/s.
        fn look(&mut self, x_m: f64, seconds: u32, seen: Option<f64>) -> usize {
            for _ in 0..seconds {
                self.now_s += 1.0;
                if self.hears {
                    self.hear(DroneId(2));
                }
                let ranged = seen.map(|speed_mps| SensedNeighbour {
                    position_m: [-x_m, 0.0, 0.0],
                    velocity_mps: [speed_mps, 0.0, 0.0],
                    drone: DEAD,
                    reserved: 0,
                });
                let now = SimTime::from_secs(self.now_s);
                let ranged: Vec<_> = ranged.into_iter().collect();
                let senses = Senses::new((0, now), ([x_m, 0.0, 0.0], [0.0; 3]), &[], &ranged, &[]);
                self.silent.update(&senses, &self.peers);
            }
            self.silent.hanging(20.0).len()
        }
    }

    #[test]
    fn a_drone_that_hangs_silent_for_long_is_remembered_out_of_sight() {
        let mut watch = Watch::new();
        assert_eq!(watch.look(40.0, 20, Some(5.0)), 0, "it flies");
        assert_eq!(watch.look(40.0, 5, Some(0.2)), 0, "it may be a drone that waits on a bad link");
        assert_eq!(watch.look(40.0, 7, Some(0.2)), 1);
        assert_eq!(watch.look(80.0, 30, None), 1, "it is out of reach");
        assert_eq!(watch.look(20.0, 1, None), 0, "it has landed");
    }

    #[test]
    fn a_drone_that_is_heard_again_lives() {
        let mut watch = Watch::new();
        assert_eq!(watch.look(40.0, 12, Some(0.0)), 1);
        watch.hear(DEAD);
        assert_eq!(watch.look(40.0, 1, Some(0.0)), 0);
    }

    #[test]
    fn a_drone_that_hears_no_other_is_slow_to_take_one_for_dead() {
        let mut watch = Watch::new();
        assert_eq!(watch.look(40.0, 12, Some(0.0)), 1);
        watch.hears = false;
        watch.now_s += 10.0;
        assert_eq!(watch.look(40.0, 7, Some(0.0)), 0, "it may be deaf");
        assert_eq!(watch.look(40.0, 3, Some(0.0)), 1);
        assert_eq!(watch.look(80.0, 30, None), 1, "it is out of reach");
    }
}
