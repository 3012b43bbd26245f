//! One long flight in which leaders are killed and come back.

use super::ClockChoice;
use super::outcome::Row;
use super::witness::Witness;
use crate::exit::Failure;
use crate::interrupt::Interrupt;
use skein_bus::{PinMode, WaitMode};
use skein_protocol::record::Outcome;
use skein_report::{Recorder, RunCompletion};
use skein_runtime::run_facts::run_facts;
use skein_runtime::{Clock, Launch, PilotKind, RunEnd, RuntimeError, inline, supervisor};
use skein_scenario::{Scenario, ScenarioSource};

/// Size of the swarm.
pub const DRONES: u32 = 8;
/// Between two heartbeats of a leader, s.
pub const HEARTBEAT_S: f64 = 0.02;
/// A leader that is silent for so long is missed on a clean link, s.
pub const TIMEOUT_S: f64 = 0.06;
/// Length of a tick, s: two to a heartbeat, so that what is measured is not the tick.
pub const DT_S: f64 = 0.01;

/// Distance of slots, m: so wide that nobody has to evade a drone which stops dead.
const SPACING_M: f64 = 60.0;

/// Before the first kill, s.
const SETTLE_S: f64 = 5.0;
/// Between two kills, s: so much, and more on an air that loses or delays.
const INTERVAL_S: f64 = 2.0;
const PER_LOSS_S: f64 = 2.0;
const PER_DELAY: f64 = 10.0;

/// What is flown.
#[derive(Clone, Copy, Debug)]
pub struct ChannelSetting {
    /// What paces it.
    pub clock: ClockChoice,
    /// Share of frames that are lost.
    pub loss: f64,
    /// How long a frame is on the air besides its tick, s.
    pub delay_s: f64,
    /// Leaders killed.
    pub kills: u32,
    /// Of everything random.
    pub seed: u64,
}

impl ChannelSetting {
    fn interval_s(&self) -> f64 {
        INTERVAL_S + PER_LOSS_S * self.loss + PER_DELAY * self.delay_s
    }

    /// Whoever leads is killed again and again, and started again in the middle between two kills, when another one leads.
    /// The moments move over the beat by a tick each.
    fn toml(&self) -> String {
        let interval_s = self.interval_s();
        let kill = |number: u32| {
            let at_s = SETTLE_S + f64::from(number) * interval_s + f64::from(number % 7) * DT_S;
            format!(
                "[[fault]]\nkind = \"restart\"\ntarget = \"leader\"\nat_s = {at_s:.3}\nfor_s = {:.3}\n",
                interval_s / 2.0
            )
        };
        let faults: String = (0..self.kills).map(kill).collect();
        let timeout_s = SETTLE_S + f64::from(self.kills) * interval_s + 1.0;
        format!(
            "name = \"failover\"\nseed = {}\n[time]\ndt_s = {DT_S}\ntimeout_s = {timeout_s:.3}\n\
             [formation]\nshape = \"v\"\ndrones = {DRONES}\nspacing_m = {SPACING_M}\n[mission]\nend = \"hold\"\nstop_x_m = 1e6\n\
             [protocol]\nheartbeat_period_s = {HEARTBEAT_S}\nleader_timeout_s = {TIMEOUT_S}\n\
             election_wait_s = {HEARTBEAT_S}\n[radio]\nloss = {:?}\ndelay_s = {:?}\n{faults}",
            self.seed, self.loss, self.delay_s
        )
    }

    fn scenario(&self) -> Result<Scenario, Failure> {
        let source = ScenarioSource { name: "bench failover", stem: "failover" };
        Scenario::parse(&self.toml(), source, &[]).map_err(Failure::diagnostic)
    }
}

/// Flies it to the end, and tells what came of it.
pub fn fly(air: &ChannelSetting, interrupt: &Interrupt) -> Result<Row, Failure> {
    let scenario = air.scenario()?;
    let (runtime, clock) = match air.clock {
        ClockChoice::Lockstep => ("inline", Clock::Lockstep),
        ClockChoice::Realtime => ("processes", Clock::Realtime { speed: 1.0 }),
    };
    let recorder = Recorder::in_memory(run_facts(&scenario, runtime, &clock.to_string()).map_err(Failure::usage)?);
    let mut witness = Witness::new(recorder, DT_S, air.clock == ClockChoice::Realtime);
    let flown = match air.clock {
        ClockChoice::Lockstep => inline::run(&scenario, &mut witness, || interrupt.signal()),
        ClockChoice::Realtime => in_processes(&scenario, clock, &mut witness, interrupt),
    };
    let end = flown.map_err(Failure::environment)?;
    if let Some(trouble) = end.failure.as_ref().or(end.sink_error.as_ref()) {
        return Err(Failure::environment(trouble));
    }
    let (recorder, found) = witness.finish();
    let completion = RunCompletion { fallback: Outcome::Aborted, wall_s: None, startup_s: Some(end.startup_s) };
    Ok(Row::new(air, &found, &recorder.finish(&completion).0))
}

fn in_processes(
    scenario: &Scenario,
    clock: Clock,
    witness: &mut Witness,
    interrupt: &Interrupt,
) -> Result<RunEnd, RuntimeError> {
    skein_bus::clean()?;
    let launch = Launch {
        scenario,
        clock,
        pin: PinMode::Auto,
        wait: WaitMode::Block,
        pilot: PilotKind::Swarm,
        per_process: 1,
        executable: std::env::current_exe().map_err(RuntimeError::system("finding this executable"))?,
        on_ready: &mut |_| Ok(()),
        interrupted: &mut || interrupt.signal(),
    };
    supervisor::run(launch, witness)
}
