//! When a drone sends its beacon.
//!
//! A drone that hears many others sends its beacons less often, so that the number of beacons that a drone hears per second does not grow
//! with the swarm. This is the rule that SAE J2945/1 has for cars, described in Rostami, Krishnan and Gruteser, *V2V Safety Communication
//! Scalability Based on the SAE J2945/1 Standard*, 2018: up to some number of neighbours the period is the shortest one, then it grows with
//! that number, up to a longest period. What others must know at once does not wait.

use crate::news::News;
use crate::params::LeadingParams;
use crate::tuning::BEACONS_PER_S;
use skein_protocol::DroneId;

/// The beacons of one drone: their period, and when the next one is due.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct BeaconPace {
    me: DroneId,
    /// Length of a tick, s.
    dt_s: f64,
    /// The shortest period, s.
    shortest_s: f64,
    /// The same, ticks.
    shortest: u64,
    /// The longest period, ticks.
    longest: u64,
    /// The present period, ticks.
    period: u64,
    /// No beacon without news is due before this tick.
    next: u64,
    /// What the last beacon said; `None` before the first one.
    said: Option<News>,
}

impl BeaconPace {
    /// No beacon sent yet.
    pub(crate) fn new(params: &LeadingParams) -> Self {
        let ticks = |period_s: f64| ((period_s / params.dt_s).round() as u64).max(1);
        let shortest = ticks(params.beacon_period_s);
        let longest = ticks(params.beacon_period_max_s).max(shortest);
        let (me, dt_s, shortest_s) = (params.me, params.dt_s, params.beacon_period_s);
        Self { me, dt_s, shortest_s, shortest, longest, period: shortest, next: 0, said: None }
    }

    /// The present period, s.
    pub(crate) fn period_s(&self) -> f64 {
        self.shortest_s * (self.period as f64 / self.shortest as f64)
    }

    /// Whether a beacon may be due in this tick. Beacons of different drones fall into different ticks. The first one is due at once, so that
    /// all drones know each other.
    pub(crate) fn may_be_due(&self, tick: u64) -> bool {
        self.said.is_none() || self.is_turn(tick)
    }

    fn is_turn(&self, tick: u64) -> bool {
        tick % self.shortest == u64::from(self.me.0) % self.shortest
    }

    /// Whether a beacon that says this news is due in this tick, if the drone hears `heard` others.
    pub(crate) fn is_due(&mut self, tick: u64, news: News, heard: usize) -> bool {
        let turn = self.is_turn(tick);
        let is_due = self.said.is_none() || (turn && (tick >= self.next || self.said != Some(news)));
        if is_due {
            let share = heard as f64 / (BEACONS_PER_S * self.dt_s);
            self.period = (share.round() as u64).clamp(self.shortest, self.longest);
            self.said = Some(news);
        }
        if is_due && turn {
            // A period that is no multiple of the shortest one is kept on average.
            self.next = self.next.max(tick.saturating_sub(self.period)) + self.period;
        }
        is_due
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;
    use skein_protocol::payload::Pose;

    /// The ticks of the first 1000 in which a drone sends beacons that hears this many others. It has news in tick 503.
    fn sent(drone: u32, heard: usize) -> Vec<u64> {
        let mut pace = BeaconPace {
            me: DroneId(drone),
            dt_s: 0.02,
            shortest_s: 0.1,
            shortest: 5,
            longest: 25,
            period: 5,
            next: 0,
            said: None,
        };
        let news = |tick| News::of(&Pose { flags: u32::from(tick >= 503), ..Pose::zeroed() });
        (0..1000).filter(|&tick| pace.is_due(tick, news(tick), heard)).collect()
    }

    #[test]
    fn a_drone_that_hears_few_sends_in_each_of_its_turns() {
        for drone in 0..7 {
            let turns = (1..1000).filter(|tick| tick % 5 == u64::from(drone) % 5);
            let all: Vec<u64> = [0].into_iter().chain(turns).collect();
            assert_eq!(sent(drone, 0), all);
            assert_eq!(sent(drone, 32), all);
        }
    }

    #[test]
    fn a_drone_that_hears_many_hears_no_more_beacons_per_second() {
        // Half of 1000 ticks are 10 s.
        for (heard, beacons) in [(48, 63..69), (64, 49..53), (100, 31..35), (160, 19..23), (1000, 19..23)] {
            let early = sent(3, heard).into_iter().filter(|tick| *tick < 503).count();
            assert!(beacons.contains(&early), "{early} of a drone that hears {heard}");
        }
    }

    #[test]
    fn news_is_said_in_the_next_turn() {
        for heard in [0, 40, 1000] {
            assert!(sent(3, heard).contains(&503) && sent(4, heard).contains(&504));
        }
    }
}
