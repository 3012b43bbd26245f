//! Flies one mission of the failover benchmark.

use super::monitor::FailoverMonitor;
use super::row::FailoverRow;
use super::setting::{ClockChoice, Setting};
use crate::context::Context;
use crate::error::BenchError;
use skein_bus::{PinMode, WaitMode};
use skein_protocol::record::Outcome;
use skein_report::{Recorder, RunCompletion};
use skein_runtime::run_facts::run_facts;
use skein_runtime::{Clock, Launch, PATIENCE, RunEnd, RuntimeError, inline, supervisor};
use skein_scenario::Scenario;

/// Flies a mission to its end, and returns its row.
pub(super) fn fly(setting: &Setting, context: &Context<'_>) -> Result<FailoverRow, BenchError> {
    let scenario = setting.scenario()?;
    let (runtime, clock) = match setting.clock {
        ClockChoice::Lockstep => ("inline", Clock::Lockstep),
        ClockChoice::Realtime => ("processes", Clock::Realtime { speed: 1.0 }),
    };
    let facts = run_facts(&scenario, runtime, &clock.to_string()).map_err(RuntimeError::Shape)?;
    let recorder = Recorder::in_memory(facts);
    let mut monitor = FailoverMonitor::new(recorder, setting.dt_s(), setting.clock == ClockChoice::Realtime);
    let end = match setting.clock {
        ClockChoice::Lockstep => inline::run(&scenario, context.pilots, &mut monitor, context.interrupted)?,
        ClockChoice::Realtime => fly_processes(&scenario, clock, &mut monitor, context)?,
    };
    let failure = end.failure.as_ref().map(ToString::to_string);
    if let Some(failure) = failure.or(end.sink_error.as_ref().map(ToString::to_string)) {
        return Err(BenchError::Flight(failure));
    }
    let (recorder, counts) = monitor.finish();
    let completion = RunCompletion { fallback: Outcome::Aborted, wall_s: None, startup_s: Some(end.startup_s) };
    Ok(FailoverRow::new(setting, &counts, &recorder.finish(&completion).0))
}

fn fly_processes(
    scenario: &Scenario,
    clock: Clock,
    monitor: &mut FailoverMonitor,
    context: &Context<'_>,
) -> Result<RunEnd, RuntimeError> {
    skein_bus::clean()?;
    let launch = Launch {
        scenario,
        clock,
        pin: PinMode::Auto,
        wait: WaitMode::Block,
        patience: PATIENCE,
        per_process: 1,
        program: context.pilots.program(),
        hosts: &[],
        on_ready: &mut |_| Ok(()),
        interrupted: &mut || (context.interrupted)(),
    };
    supervisor::run(launch, monitor)
}
