//! The memory of a drone whose commands take effect late. It senses its neighbours, but not the commands that they have given and
//! that have not taken effect yet. So two drones keep to lines that both compute from what both have sensed.
//! `docs/safety.md`, "Reaction time", states and proves the rule.

mod sight;
mod sighted_pair;

use crate::braking_motion::{BrakingFilterParams, Moving, OwnMotion};
use crate::braking_path::BrakingPath;
pub(crate) use sight::Sight;
use sighted_pair::{Paths, SightedPair};
use skein_protocol::{DroneId, Vec2};
use std::collections::BTreeMap;

/// Lines are made this many times per reaction time.
const LINES_PER_REACTION: u32 = 4;

/// What a drone remembers of its neighbours.
#[derive(Clone, Debug, Default)]
pub(crate) struct Sights {
    /// The tick of the newest sights.
    tick: Option<u64>,
    /// The reaction time with which they were made, ticks.
    lag: u32,
    /// Velocity in that tick, m/s.
    velocity: Vec2,
    /// What the drone has flown since its memory began, m. All remembered positions are in this frame, so errors of the measured
    /// position do not matter.
    flown_m: Vec2,
    pairs: BTreeMap<DroneId, SightedPair>,
}

impl Sights {
    /// Notes what the drone senses in this tick. The neighbours of the very first call, in any reaction time, are known: at the start
    /// all drones keep to the lines between them. After a gap in the ticks, and if the reaction time has changed, nothing is known.
    pub(crate) fn look(
        &mut self,
        own: &OwnMotion,
        neighbours: impl Iterator<Item = Moving>,
        params: &BrakingFilterParams,
        stride: u32,
    ) {
        let first = self.tick.is_none();
        if self.tick.is_some_and(|tick| tick + 1 == own.tick) && self.lag == own.lag {
            self.flown_m += (self.velocity + own.sensed_velocity) * (params.dt_s / 2.0);
        } else {
            self.pairs.clear();
        }
        (self.tick, self.lag, self.velocity) = (Some(own.tick), own.lag, own.sensed_velocity);
        let law = params.law();
        let given_m = self.flown_m + own.position - own.sensed_position;
        let mut paths = Paths {
            tick: own.tick,
            lag: own.lag,
            stride,
            half_m: params.keep_m() / 2.0,
            sensed: BrakingPath::new(self.flown_m, own.sensed_velocity, law),
            given: BrakingPath::new(given_m, own.velocity, law),
            other: BrakingPath::new(Vec2::zeros(), Vec2::zeros(), law),
        };
        let makes_lines = own.tick.is_multiple_of(u64::from((own.lag / LINES_PER_REACTION).max(1)));
        let reach_m = |velocity: Vec2, ticks: u32| params.late_reach_m(own, velocity.norm(), ticks);
        for other in neighbours {
            let distance_m = other.position_m.norm();
            let room_m = (distance_m - params.keep_m()) / 2.0;
            paths.other = BrakingPath::new(self.flown_m + other.position_m, other.velocity_mps, law);
            let fits = |ticks: u32| {
                reach_m(own.sensed_velocity, ticks) <= room_m && reach_m(other.velocity_mps, ticks) <= room_m
            };
            let pair = self.pairs.entry(other.id).or_default();
            if fits(own.lag + 2) {
                pair.stay_apart(&paths);
                continue;
            }
            if pair.is_new() && first {
                pair.begin(&paths);
            } else if pair.is_new() && fits(own.lag) {
                pair.meet(&paths);
            }
            pair.come_near(&paths, makes_lines);
        }
        self.pairs.retain(|_, pair| pair.seen() == Some(own.tick));
    }

    /// Forgets all neighbours, after ticks in which the drone did not give its commands.
    pub(crate) fn forget(&mut self) {
        self.pairs.clear();
        self.lag = u32::MAX;
        self.tick.get_or_insert(0);
    }

    /// Whether there is a near neighbour with which the drone shares no line. Such a drone brakes.
    pub(crate) fn must_brake(&self) -> bool {
        self.pairs.values().any(|pair| !pair.is_known())
    }

    /// The lines to which the drone keeps.
    pub(crate) fn lines(&self) -> impl Iterator<Item = &Sight> {
        self.pairs.values().flat_map(SightedPair::lines)
    }

    /// What the drone has flown since its memory began, m: its present position in the frame of the lines.
    pub(crate) fn flown_m(&self) -> Vec2 {
        self.flown_m
    }
}
