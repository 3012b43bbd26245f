//! Builds the summary of a run from its records, tick by tick.

use crate::completion::RunCompletion;
use crate::energy::EnergyMarks;
use crate::error::TickError;
use crate::facts::RunFacts;
use crate::formation::{self, Closing};
use crate::leading::Leading;
use crate::metrics::SwarmMetrics;
use crate::own_metrics::OwnMetrics;
use crate::stages::Stages;
use crate::steps::StepTimer;
use crate::summary::{
    Dropped, FailureEntry, FaultEntry, Messages, SUMMARY_SCHEMA, StepTimes, Summary, UnfinishedEntry, Violation,
    numbers,
};
use crate::tuning::METRICS_PERIOD_S;
use crate::vicinity::Vicinity;
use skein_protocol::record::{DroneRow, EventKind, FaultKind, Outcome, Percentiles, RecordView, RunEvent, Totals};
use skein_protocol::{DroneId, Phase, UnfinishedDrone, Vec2, horizontal};

/// Why a mission ended whose record has no end.
const CUT_OFF: &str = "the record ends before the mission: the process of the world, or the launcher, has ended";

/// Accumulates everything that the summary of a run contains.
pub(crate) struct Accumulator {
    facts: RunFacts,
    stages: Stages,
    leading: Leading,
    vicinity: Vicinity,
    metrics: SwarmMetrics,
    steps: StepTimer,
    closing: Closing,
    reform_start_s: Option<f64>,
    energy: EnergyMarks,
    violations: Vec<Violation>,
    faults: Vec<FaultEntry>,
    failures: Vec<FailureEntry>,
    own_metrics: OwnMetrics,
    end: Option<End>,
    counts: Counts,
    /// The rows of the last tick.
    last: Vec<DroneRow>,
    /// Positions of the living drones in the last tick, m.
    positions: Vec<Vec2>,
    /// Where drones hang dead, m.
    dead: Vec<Vec2>,
    /// Their velocities, m/s.
    velocities: Vec<Vec2>,
}

/// The last tick of the record, and what can be counted without the end event.
#[derive(Default)]
struct Counts {
    tick: Option<u64>,
    t_s: f64,
    digest: Option<u64>,
    lost: u64,
    sent: u64,
    heard: u64,
    late: u64,
}

/// The end event.
struct End {
    t_s: f64,
    outcome: Outcome,
    stuck: Vec<DroneId>,
    unfinished: Vec<UnfinishedDrone>,
    standstill_s: Option<f64>,
    reason: String,
    totals: Totals,
}

impl Accumulator {
    pub(crate) fn new(facts: RunFacts) -> Self {
        Self {
            stages: Stages::new(&facts),
            leading: Leading::default(),
            vicinity: Vicinity::new(&facts),
            metrics: SwarmMetrics::new(facts.safe_distance_m, facts.radio_range_m),
            steps: StepTimer::new(),
            closing: Closing::default(),
            reform_start_s: None,
            energy: EnergyMarks::default(),
            violations: Vec::new(),
            faults: Vec::new(),
            failures: Vec::new(),
            own_metrics: OwnMetrics::default(),
            end: None,
            counts: Counts::default(),
            last: Vec::new(),
            positions: Vec::new(),
            dead: Vec::new(),
            velocities: Vec::new(),
            facts,
        }
    }

    /// Takes one record and its events. The last record of a run may repeat the rows of the record before it.
    ///
    /// # Errors
    /// [`TickError::Rows`] if the record does not have one row per drone.
    pub(crate) fn take(&mut self, record: RecordView<'_>, events: &[RunEvent]) -> Result<(), TickError> {
        let tick = record.head.tick;
        let fresh = !record.rows.is_empty() && self.counts.tick.is_none_or(|last| tick > last);
        if fresh && record.rows.len() != self.facts.drones as usize {
            let expected = self.facts.drones as usize;
            return Err(TickError::Rows { tick, expected, found: record.rows.len() });
        }
        self.counts.digest = Some(record.head.digest);
        self.counts.lost += u64::from(record.head.lost);
        if fresh {
            self.stages.take_frames(record.frames);
        }
        for event in events {
            self.take_event(event.clone(), record.rows);
        }
        if fresh {
            self.counts.sent += record.frames.len() as u64;
            self.own_metrics.take(tick, record.telemetry);
            self.take_rows(tick, record.head.now.secs(), record.rows);
        } else if record.head.lost > 0 {
            // The last ticks were lost; only the end of the mission was recorded.
            self.counts.tick = self.counts.tick.max(Some(tick));
            self.counts.t_s = self.counts.t_s.max(record.head.now.secs());
        }
        Ok(())
    }

    fn take_event(&mut self, event: RunEvent, rows: &[DroneRow]) {
        let t_s = event.t_s;
        match event.what {
            EventKind::Detected { stage, .. } => {
                if self.stages.detected(stage, t_s) {
                    self.energy.detected(&self.last, self.facts.drones);
                }
            }
            EventKind::Passed { stage } => {
                self.stages.passed(stage, t_s);
                if self.stages.all_passed() {
                    self.energy.passed(rows);
                }
            }
            EventKind::Leader { group, ballot, leader, leads: true } => {
                self.leading.elected(t_s, group, ballot, leader);
            }
            EventKind::Fault { kind, target, scheduled, detail } => {
                if let (true, Some(row)) = (kind.stops_process(), self.last.get(target.index())) {
                    self.leading.lost(t_s, target, row, kind == FaultKind::Freeze);
                }
                let target = (target != DroneId::NONE).then_some(target.0);
                self.faults.push(FaultEntry { t_s, kind, target, scheduled, detail });
            }
            EventKind::Failure { drone, pilot, reason } => {
                self.failures.push(FailureEntry { t_s, drone: drone.0, pilot, reason });
            }
            EventKind::Violation { kind, drones, value_m } => {
                self.violations.push(Violation { t_s, kind, drones: numbers(&drones), value_m });
            }
            EventKind::End { outcome, reason, stuck, unfinished, standstill_s, totals } => {
                self.end = Some(End { t_s, outcome, reason, stuck, unfinished, standstill_s, totals: *totals });
            }
            // Decisions are read from the frames, the end of a leadership from the rows. The summary does not report
            // the end of a fault.
            EventKind::Leader { .. }
            | EventKind::Grouping { .. }
            | EventKind::Assigned { .. }
            | EventKind::FaultOver { .. } => {}
        }
    }

    fn take_rows(&mut self, tick: u64, t_s: f64, rows: &[DroneRow]) {
        let dt_s = self.counts.tick.map_or(self.facts.dt_s, |_| t_s - self.counts.t_s);
        (self.counts.tick, self.counts.t_s) = (Some(tick), t_s);
        for row in rows {
            self.counts.heard += u64::from(row.heard);
            self.counts.late += u64::from(row.is_late());
            if row.alive() {
                self.steps.take(row.step_ns);
            }
        }
        self.stages.take_rows(rows);
        // Drones decide at the beginning of a tick. The events about leaders have that time.
        self.leading.take(t_s - self.facts.dt_s, dt_s, rows, self.facts.radio_range_m);
        self.vicinity.take(rows);
        self.gather_living(rows);
        if tick.is_multiple_of((METRICS_PERIOD_S / self.facts.dt_s).round().max(1.0) as u64) {
            self.metrics.take(&self.positions, &self.velocities);
        }
        self.reform(t_s, rows);
        self.last.clear();
        self.last.extend_from_slice(rows);
    }

    fn gather_living(&mut self, rows: &[DroneRow]) {
        self.positions.clear();
        self.velocities.clear();
        self.dead.clear();
        for row in rows {
            if row.alive() {
                self.positions.push(horizontal(row.position_m));
                self.velocities.push(horizontal(row.velocity_mps));
            } else if row.position_m[2] > 0.0 {
                self.dead.push(horizontal(row.position_m));
            }
        }
    }

    fn reform(&mut self, t_s: f64, rows: &[DroneRow]) {
        let mut living = rows.iter().filter(|row| row.alive());
        let reforms = |row: &DroneRow| row.phase() == Phase::Reform && row.obeyed.ballot.is_some();
        if self.reform_start_s.is_none() && self.stages.all_passed() && living.clone().any(reforms) {
            self.reform_start_s = Some(t_s);
        }
        if self.reform_start_s.is_some() && living.all(reforms) {
            self.closing.take(&self.facts, t_s, &self.positions, &self.dead);
        } else {
            self.closing.reopen();
        }
    }

    /// The summary of all records taken.
    pub(crate) fn finish(self, completion: &RunCompletion) -> Summary {
        let error = formation::error(&self.facts, &self.positions, &self.dead);
        let (ticks, sim_s) = (self.counts.tick.map_or(0, |tick| tick.saturating_add(1)), self.counts.t_s);
        let wall_s =
            self.end.as_ref().map(|end| end.totals.wall_s).or(completion.wall_s).filter(|wall_s| *wall_s > 0.0);
        let steps = ticks as f64 * f64::from(self.facts.drones);
        let totals = self.end.as_ref().map(|end| &end.totals);
        let leading = self.leading.finish();
        Summary {
            schema: SUMMARY_SCHEMA.to_owned(),
            drones: self.facts.drones,
            dt_s: self.facts.dt_s,
            ticks,
            sim_s,
            realtime_factor: wall_s.map(|wall_s| sim_s / wall_s),
            agent_steps_per_s: wall_s.map(|wall_s| steps / wall_s),
            wall_s,
            startup_s: completion.startup_s,
            report_s: None,
            outcome: self.end.as_ref().map_or(completion.fallback, |end| end.outcome),
            reason: Some(self.end.as_ref().map_or_else(|| CUT_OFF.to_owned(), |end| end.reason.clone())),
            stuck: self.end.as_ref().map_or(Vec::new(), |end| end.stuck.iter().map(|id| id.0).collect()),
            unfinished: self
                .end
                .as_ref()
                .map_or(Vec::new(), |end| end.unfinished.iter().cloned().map(UnfinishedEntry::from).collect()),
            standstill_s: self.end.as_ref().and_then(|end| end.standstill_s),
            mission_s: self.end.as_ref().map_or(sim_s, |end| end.t_s),
            reform_start_s: self.reform_start_s,
            reform_end_s: self.closing.since_s(),
            formation_error_m: error.as_ref().map(|error| error.largest_m),
            formation_rmse_m: error.as_ref().map(|error| error.rmse_m),
            mean_distance_error_m: error.and_then(|error| error.mean_distance_m),
            energy_j: self.energy.finish(&self.last, self.stages.any()),
            min_separation_m: self.vicinity.separation_m(),
            min_clearance_m: self.vicinity.clearance_m(),
            min_altitude_m: self.vicinity.altitude_m(),
            metrics: self.metrics.means(),
            elections: leading.elections,
            messages: messages(&self.counts, totals),
            pilots: self.facts.pilots.clone(),
            deadline_misses: totals.map_or(self.counts.late, |totals| totals.deadline_misses),
            lateness_us: totals.and_then(|totals| lateness(&totals.lateness_s)),
            step_us: self.steps.times().filter(|_| self.facts.runtime != "inline"),
            metrics_own: self.own_metrics.finish(),
            telemetry_refused: totals.map(|totals| totals.telemetry_refused),
            parts: totals.and_then(|totals| totals.parts),
            failures: self.failures,
            hosts: Vec::new(),
            rejected_commands: totals.map(|totals| totals.rejected_commands),
            lost_ticks: self.counts.lost,
            digest: self.counts.digest.map(|digest| format!("{digest:016x}")),
            stages: self.stages.finish(),
            leaders: leading.entries,
            split_brain_s: leading.split_brain_s,
            failover_s: leading.failover_s,
            violations: self.violations,
            faults: self.faults,
            scenario: self.facts.scenario,
            strategy: self.facts.strategy,
            seed: self.facts.seed,
            runtime: self.facts.runtime,
            clock: self.facts.clock,
        }
    }
}

fn lateness(late_s: &Percentiles) -> Option<StepTimes> {
    let us = |s: Option<f64>| s.map(|s| s * 1e6);
    Some(StepTimes { p50: us(late_s.p50)?, p99: us(late_s.p99)?, max: us(late_s.max)? })
}

/// The counters of the end event; without one, what the record shows.
fn messages(counts: &Counts, totals: Option<&Totals>) -> Messages {
    let Some(totals) = totals else {
        let (dropped, delay_s, age_s) = Default::default();
        return Messages { sent: counts.sent, delivered: counts.heard, duplicates: None, dropped, delay_s, age_s };
    };
    let [loss, burst, range, partition, deaf, malformed, queue] = totals.dropped.map(Some);
    Messages {
        sent: totals.sent,
        delivered: totals.delivered,
        duplicates: Some(totals.duplicates),
        dropped: Dropped { loss, burst, range, partition, deaf, malformed, queue },
        delay_s: totals.delay_s,
        age_s: totals.age_s,
    }
}
