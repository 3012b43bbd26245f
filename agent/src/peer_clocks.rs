//! What the stamps of other drones mean by this drone's clock.

use skein_protocol::payload::{Pose, Presence};
use skein_protocol::{DroneId, MessageRef, SimTime};
use std::collections::BTreeMap;

/// Length of a window in which the least time of a drone's messages counts, s: some hundred beacons.
const WINDOW_S: f64 = 30.0;

/// Estimates how far the clocks of the others are apart from this drone's, from the least time that a message seemed to take. What a
/// drone learns by it decides how well it flies; the safety rule allows for every clock error within the bound.
#[derive(Clone, Debug)]
pub(crate) struct PeerClocks {
    /// Greatest difference of two clocks, ns; 0 for exact clocks.
    bound_ns: i64,
    least: BTreeMap<DroneId, Least>,
}

/// The least time that a message of one drone seemed to take lately. It is forgotten after two windows, because a clock may be set
/// anew, and drifts.
#[derive(Clone, Copy, Debug)]
struct Least {
    /// Start of the present window.
    since: SimTime,
    /// In the present window, ns.
    now_ns: i64,
    /// In the window before, ns.
    before_ns: i64,
}

impl Least {
    /// Notes that a message seemed to take this long, ns. Returns the least of the two windows.
    fn note(&mut self, now: SimTime, took_ns: i64) -> i64 {
        if now.since(self.since) >= WINDOW_S {
            *self = Self { since: now, now_ns: took_ns, before_ns: self.now_ns };
        }
        self.now_ns = self.now_ns.min(took_ns);
        self.now_ns.min(self.before_ns)
    }
}

/// A message whose stamp is by this drone's clock.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Restamped {
    Pose(Pose),
    Presence(Presence),
}

impl Restamped {
    pub(crate) fn message(&self) -> MessageRef<'_> {
        match self {
            Self::Pose(pose) => MessageRef::Pose(pose),
            Self::Presence(presence) => MessageRef::Presence(presence),
        }
    }
}

impl PeerClocks {
    /// Nothing heard. `error_s`: greatest error of a clock, s.
    pub(crate) fn new(error_s: f64) -> Self {
        Self { bound_ns: (2.0 * error_s * 1e9).ceil() as i64, least: BTreeMap::new() }
    }

    /// The same message with its stamp by this drone's clock; `None` if its stamps need no change. Those of a leader number its messages, and
    /// are only compared with each other.
    pub(crate) fn restamp(&mut self, now: SimTime, source: DroneId, message: MessageRef<'_>) -> Option<Restamped> {
        if self.bound_ns == 0 {
            return None;
        }
        match message {
            MessageRef::Pose(pose) => {
                Some(Restamped::Pose(Pose { stamp: self.by_own_clock(now, source, pose.stamp), ..*pose }))
            }
            MessageRef::Presence(said) => {
                // These stamps are by the clocks of others, too. What is from the future by no more than clocks may differ is of now.
                let latest = SimTime(now.0.saturating_add(self.bound_ns));
                let mut presence = *said;
                presence
                    .drones
                    .iter_mut()
                    .filter(|one| one.stamp <= latest)
                    .for_each(|one| one.stamp = one.stamp.min(now));
                Some(Restamped::Presence(presence))
            }
            _ => None,
        }
    }

    fn by_own_clock(&mut self, now: SimTime, source: DroneId, stamp: SimTime) -> SimTime {
        let took_ns = now.0.saturating_sub(stamp.0);
        let first = Least { since: now, now_ns: took_ns, before_ns: took_ns };
        let least_ns = self.least.entry(source).or_insert(first).note(now, took_ns);
        SimTime(stamp.0.saturating_add(least_ns.clamp(-self.bound_ns, self.bound_ns)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;

    fn heard(clocks: &mut PeerClocks, now_s: f64, stamp_s: f64) -> Option<f64> {
        let pose = Pose { stamp: SimTime::from_secs(stamp_s), ..Pose::zeroed() };
        match clocks.restamp(SimTime::from_secs(now_s), DroneId(1), MessageRef::Pose(&pose))? {
            Restamped::Pose(pose) => Some(pose.stamp.secs()),
            Restamped::Presence(_) => None,
        }
    }

    #[test]
    fn a_state_that_was_passed_on_is_not_from_the_future() {
        let mut said = Presence { count: 3, ..Presence::zeroed() };
        for (one, stamp_s) in said.drones.iter_mut().zip([9.0, 11.5, 12.5]) {
            one.stamp = SimTime::from_secs(stamp_s);
        }
        let (now, message) = (SimTime::from_secs(10.0), MessageRef::Presence(&said));
        let Some(Restamped::Presence(heard)) = PeerClocks::new(1.0).restamp(now, DroneId(1), message) else {
            panic!("clocks are not exact")
        };
        let stamps: Vec<f64> = heard.present().iter().map(|one| one.stamp.secs()).collect();
        assert_eq!(stamps, [9.0, 10.0, 12.5], "no clock is 2.5 s ahead");
        assert!(PeerClocks::new(0.0).restamp(now, DroneId(1), message).is_none(), "clocks are exact");
    }

    #[test]
    fn a_stamp_from_the_future_becomes_one_of_now() {
        let mut clocks = PeerClocks::new(1.0);
        assert_eq!(heard(&mut clocks, 10.0, 11.5), Some(10.0), "its clock is at least 1.5 s ahead");
        assert_eq!(heard(&mut clocks, 10.3, 11.5), Some(10.0), "this beacon took 0.3 s longer");
        assert_eq!(heard(&mut clocks, 11.0, 30.0), Some(28.0), "no clock is that far ahead");
        assert_eq!(heard(&mut PeerClocks::new(0.0), 10.0, 11.5), None, "clocks are exact");
    }

    #[test]
    fn a_clock_that_is_set_back_is_estimated_anew() {
        let mut clocks = PeerClocks::new(1.0);
        assert_eq!(heard(&mut clocks, 10.0, 11.0), Some(10.0), "its clock is a second ahead");
        assert_eq!(heard(&mut clocks, 20.0, 20.0), Some(19.0), "its clock was set back, which looks like a delay");
        for tick in 0..700 {
            let now_s = 20.0 + 0.1 * f64::from(tick);
            heard(&mut clocks, now_s, now_s);
        }
        assert_eq!(heard(&mut clocks, 90.0, 90.0), Some(90.0));
    }

    #[test]
    fn the_delay_of_a_radio_is_not_taken_for_a_clock_error() {
        let mut clocks = PeerClocks::new(0.01);
        assert!((heard(&mut clocks, 12.0, 10.0).unwrap() - 10.02).abs() < 1e-9);
    }
}
