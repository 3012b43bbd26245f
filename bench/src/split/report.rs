//! The results of dividing the world.

use super::cost_model::{CostModel, PartMeans};
use super::forecast::{Forecast, Habits};
use super::loopback::Wire;
use crate::runtime::workload::Workload;
use serde::Serialize;
use std::fmt::Write;

/// The results of all sizes and numbers of parts, and what they say about larger swarms.
#[derive(Clone, Debug, Default, Serialize)]
pub struct SplitReport {
    /// One row for each size and number of parts.
    pub rows: Vec<SplitRow>,
    /// How the swarms talk and look.
    pub habits: Option<Habits>,
    /// The costs.
    pub model: Option<CostModel>,
    /// What a connection costs on this machine.
    pub loopback: Option<Wire>,
    /// What a connection is assumed to cost between machines.
    pub network: Option<Wire>,
    /// What the costs say about larger swarms on the assumed network.
    pub forecasts: Vec<Forecast>,
}

/// One swarm in some parts.
#[derive(Clone, Debug, Serialize)]
pub struct SplitRow {
    /// Size of the swarm.
    pub drones: u32,
    /// Ticks that were measured.
    pub ticks: u64,
    /// The digest after all ticks, which is the same for every number of parts.
    pub digest: String,
    /// What each part did.
    pub parts: Vec<PartMeans>,
    /// What the part that took longest computed, µs per tick.
    pub slowest_us: f64,
    /// What the model says about that part, µs per tick.
    pub model_us: f64,
    /// Whether the model was made from this size.
    pub learnt: bool,
}

impl SplitRow {
    /// A row that the model has not judged yet.
    pub(super) fn new(drones: u32, ticks: u64, digest: u64, parts: Vec<PartMeans>) -> Self {
        let digest = format!("{digest:016x}");
        Self { drones, ticks, digest, parts, slowest_us: f64::NAN, model_us: f64::NAN, learnt: false }
    }

    /// Compares it with the model.
    pub(super) fn judge(&mut self, model: &CostModel, learnt: bool) {
        let cost = |part: &&PartMeans| part.work_us + part.exchange_us;
        if let Some(slowest) = self.parts.iter().max_by(|a, b| cost(a).total_cmp(&cost(b))) {
            (self.slowest_us, self.model_us) = (cost(&slowest), model.part_us(slowest));
        }
        self.learnt = learnt;
    }

    /// The error of the model, relative to what was measured.
    #[must_use]
    pub fn error(&self) -> f64 {
        self.model_us / self.slowest_us - 1.0
    }

    /// How this swarm talks and looks.
    pub(super) fn habits(&self, workload: &Workload) -> Habits {
        let sum = |of: fn(&PartMeans) -> f64| self.parts.iter().map(of).sum::<f64>();
        let (drones, scenario) = (f64::from(self.drones), &workload.scenario);
        Habits {
            // The part of the drone that hears all goes through all frames.
            frames_per_drone: self.parts.iter().map(|part| part.frames).fold(0.0, f64::max) / drones,
            frame_bytes: sum(|part| part.sent_frame_bytes) / sum(|part| part.sent_frames).max(1.0),
            body_bytes: sum(|part| part.sent_body_bytes) / sum(|part| part.sent_bodies).max(1.0),
            digest_bytes: sum(|part| part.digest_bytes) / drones,
            spacing_m: scenario.formation.spacing_m,
            ranging_m: scenario.ranging_m(),
            radio_m: scenario.radio.range_m.unwrap_or(f64::INFINITY),
        }
    }
}

impl SplitReport {
    /// The rows, the costs and the forecasts as text tables.
    #[must_use]
    pub fn table(&self) -> String {
        let mut out = String::new();
        // Writing to a string cannot fail.
        let _ = self.write(&mut out);
        out
    }

    fn write(&self, out: &mut String) -> std::fmt::Result {
        writeln!(
            out,
            "{:>7}{:>7}{:>12}{:>12}{:>12}{:>12}{:>12}{:>9}  digest",
            "drones", "parts", "slowest µs", "model µs", "error", "halo", "B/part", "model"
        )?;
        for row in &self.rows {
            let mean = |of: fn(&PartMeans) -> f64| row.parts.iter().map(of).sum::<f64>() / row.parts.len() as f64;
            writeln!(
                out,
                "{:>7}{:>7}{:>12.0}{:>12.0}{:>10.1} %{:>12.1}{:>12.0}{:>9}  {}",
                row.drones,
                row.parts.len(),
                row.slowest_us,
                row.model_us,
                100.0 * row.error(),
                mean(|part| part.halo_bodies),
                mean(|part| part.sent_bytes),
                if row.learnt { "learnt" } else { "checked" },
                row.digest,
            )?;
        }
        if let (Some(model), Some(loopback), Some(network), Some(habits)) =
            (self.model, self.loopback, self.network, self.habits)
        {
            let CostModel { drone_us, frame_us, pair_us, exchange_drone_us, exchange_byte_us } = model;
            writeln!(
                out,
                "\nµs per agent-step {drone_us:.3}, per frame {frame_us:.3}, per agent-step and drone of the swarm {pair_us:.5}; \
                 to exchange: per drone {exchange_drone_us:.4}, per byte {exchange_byte_us:.5}"
            )?;
            writeln!(
                out,
                "frames per drone and tick {:.3}, bytes of the digest per drone and tick {:.0}",
                habits.frames_per_drone, habits.digest_bytes
            )?;
            writeln!(
                out,
                "loopback: {:.1} µs there and back, {:.5} µs per byte; assumed between machines: {} µs, {} µs per byte\n",
                loopback.round_trip_us, loopback.byte_us, network.round_trip_us, network.byte_us
            )?;
        }
        writeln!(
            out,
            "{:>9}{:>7}{:>12}{:>12}{:>13}{:>12}{:>12}{:>12}{:>14}",
            "drones", "parts", "part ms", "leader ms", "network ms", "digest ms", "halo kB", "tick ms", "without ms"
        )?;
        for forecast in &self.forecasts {
            let Forecast { drones, parts, part_ms, leader_ms, network_ms, digest_ms, .. } = forecast;
            writeln!(
                out,
                "{drones:>9}{parts:>7}{part_ms:>12.2}{leader_ms:>12.2}{network_ms:>13.2}{digest_ms:>12.2}{:>12.1}{:>12.1}{:>14.1}",
                forecast.halo_bytes / 1e3,
                1e3 / forecast.ticks_per_s,
                1e3 / forecast.ticks_per_s_without,
            )?;
        }
        Ok(())
    }
}
