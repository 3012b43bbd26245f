//! The mission of the failover benchmark: a cruise during which leaders are killed and restarted.

use crate::error::BenchError;
use clap::ValueEnum;
use skein_report::number_text::tidy;
use skein_scenario::{Scenario, ScenarioSource};

/// Size of the swarm.
pub(super) const DRONES: u32 = 8;
/// Usual time between two heartbeats of a leader, s.
pub(super) const HEARTBEAT_S: f64 = 0.02;
/// Heartbeats in the time of silence after which a leader is missed on a link without loss.
const TIMEOUT_HEARTBEATS: f64 = 3.0;
/// Ticks in a heartbeat: two, so that the tick does not dominate the result.
const TICKS: f64 = 2.0;

/// Distance between slots, m. It is so wide that no drone has to evade one that stops dead.
const SPACING_M: f64 = 60.0;

/// Time before the first kill, s.
const SETTLE_S: f64 = 5.0;
/// Time between two kills without loss and delay, s.
const INTERVAL_S: f64 = 2.0;
/// Longer time between two kills per unit of loss, s.
const PER_LOSS_S: f64 = 2.0;
/// Longer time between two kills per second of delay.
const PER_DELAY: f64 = 10.0;

/// What paces the ticks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ClockChoice {
    /// Each tick waits for all drones; flown in this process
    Lockstep,
    /// Ticks follow the wall clock; one process per drone
    Realtime,
}

/// One mission of the benchmark.
#[derive(Clone, Copy, Debug)]
pub(super) struct Setting {
    /// What paces the ticks.
    pub(super) clock: ClockChoice,
    /// Time between two heartbeats of a leader, s.
    pub(super) heartbeat_s: f64,
    /// Share of frames that are lost.
    pub(super) loss: f64,
    /// Transmission delay of a frame besides its tick, s.
    pub(super) delay_s: f64,
    /// Number of leaders to kill.
    pub(super) kills: u32,
    /// Seed of everything random.
    pub(super) seed: u64,
}

impl Setting {
    /// The mission's scenario.
    pub(super) fn scenario(&self) -> Result<Scenario, BenchError> {
        let source = ScenarioSource { name: "bench failover", stem: "failover" };
        Ok(Scenario::parse(&self.toml(), source, &[])?)
    }

    /// Time of silence after which a leader is missed on a link without loss, s.
    pub(super) fn timeout_s(&self) -> f64 {
        tidy(self.heartbeat_s * TIMEOUT_HEARTBEATS)
    }

    /// Length of a tick, s.
    pub(super) fn dt_s(&self) -> f64 {
        tidy(self.heartbeat_s / TICKS)
    }

    fn interval_s(&self) -> f64 {
        INTERVAL_S + PER_LOSS_S * self.loss + PER_DELAY * self.delay_s
    }

    /// The current leader is killed again and again. It is restarted halfway between two kills, when another drone leads.
    /// Each kill is one tick later in the heartbeat than the one before, over seven ticks.
    fn toml(&self) -> String {
        let (interval_s, heartbeat_s, dt_s) = (self.interval_s(), self.heartbeat_s, self.dt_s());
        let kill = |number: u32| {
            let at_s = SETTLE_S + f64::from(number) * interval_s + f64::from(number % 7) * dt_s;
            format!(
                "[[fault]]\nkind = \"restart\"\ntarget = \"leader\"\nat_s = {at_s:.3}\nfor_s = {:.3}\n",
                interval_s / 2.0
            )
        };
        let faults: String = (0..self.kills).map(kill).collect();
        let leader_timeout_s = self.timeout_s();
        let timeout_s = SETTLE_S + f64::from(self.kills) * interval_s + 1.0;
        format!(
            "name = \"failover\"\nseed = {}\n[time]\ndt_s = {dt_s}\ntimeout_s = {timeout_s:.3}\n\
             [formation]\nshape = \"v\"\ndrones = {DRONES}\nspacing_m = {SPACING_M}\n[mission]\nend = \"hold\"\nstop_x_m = 1e6\n\
             [protocol]\nheartbeat_period_s = {heartbeat_s}\nleader_timeout_s = {leader_timeout_s}\n\
             election_wait_s = {heartbeat_s}\n[radio]\nloss = {:?}\ndelay_s = {:?}\n{faults}",
            self.seed, self.loss, self.delay_s
        )
    }
}
